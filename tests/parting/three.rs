//! Layers in three.js: its own loader and shaders in a headless browser, with the lines of the README.
//!
//! Needs Chromium and the npm module three (`npm install three`, in HAARLIGHT_NODE_MODULES or tools/web); skipped without.

use crate::browser::Browser;
use serde_json::json;
use std::path::{Path, PathBuf};

const PAGE: &str = include_str!("three.html");
const README: &str = include_str!("../../README.md");
const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// The module's folder.
fn module_folder() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/web/node_modules");
    let named = std::env::var_os("HAARLIGHT_NODE_MODULES").map(PathBuf::from);
    let named = named.into_iter().flat_map(|p| [p.join("node_modules"), p]);
    let mut places = named.chain([own]).map(|p| p.join("three"));
    places.find(|p| p.join("build/three.core.js").exists())
}

fn url(kind: &str, bytes: &[u8]) -> String {
    let mut out = format!("data:{kind};base64,");
    for three in bytes.chunks(3) {
        let at = |k: usize| u32::from(*three.get(k).unwrap_or(&0));
        let all = (at(0) << 16) | (at(1) << 8) | at(2);
        for k in 0..4 {
            let digit = DIGITS[(all >> (18 - 6 * k)) as usize % 64];
            out.push(if k <= three.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    out
}

/// The README's lines that dim lamps.
fn snippet() -> String {
    let start = README
        .find("    const { scale, names }")
        .expect("the README dims lamps");
    let lines = README[start..]
        .lines()
        .take_while(|l| l.starts_with("    "));
    lines
        .map(|line| line.trim_start().to_owned() + "\n")
        .collect()
}

/// Colour that three.js shows in the middle of triangles of a file whose layers are dimmed, and what it should be. None: it is not
/// there.
pub(crate) fn seen(glb: &[u8], dim: &[f64]) -> Option<Vec<([f64; 3], [f64; 3])>> {
    let Some(three) = module_folder() else {
        eprintln!("skipped: the npm module three is not installed");
        return None;
    };
    let Some(mut browser) = Browser::start() else {
        eprintln!("skipped: no Chromium");
        return None;
    };
    let module = |path: &str| {
        let text = std::fs::read_to_string(three.join(path)).unwrap();
        let text = text
            .replace("'./three.core.js'", "'core'")
            .replace("'../utils/BufferGeometryUtils.js'", "'geometry'")
            .replace("'../utils/SkeletonUtils.js'", "'skeleton'");
        url("text/javascript", text.as_bytes())
    };
    let imports = json!({ "imports": {
        "core": module("build/three.core.js"),
        "three": module("build/three.module.js"),
        "geometry": module("examples/jsm/utils/BufferGeometryUtils.js"),
        "skeleton": module("examples/jsm/utils/SkeletonUtils.js"),
        "gltf": module("examples/jsm/loaders/GLTFLoader.js"),
    } });
    let input = json!({ "glb": url("application/octet-stream", glb), "wanted": dim });
    let page = PAGE
        .replace("MAP", &imports.to_string())
        .replace("INPUT", &input.to_string())
        .replace("SNIPPET", &snippet());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("three.html");
    std::fs::write(&path, page).unwrap();
    browser.open(&path);
    browser.wait_for("typeof window.seen === 'string'");
    let seen = serde_json::from_str(&browser.run("window.seen")).unwrap();
    assert!(browser.faults().is_empty(), "{:#?}", browser.faults());
    Some(seen)
}
