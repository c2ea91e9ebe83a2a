//! Pages that run in a headless browser with the module three, which they hold as data.
//!
//! Needs Chromium and the npm module three (`npm install three`, in HAARLIGHT_NODE_MODULES or tools/web); skipped without.

use crate::report::browser::Browser;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Are the module and a browser there? If not, it says that a test is skipped.
pub(crate) fn is_there() -> bool {
    let there = folder().is_some() && Browser::program().is_some();
    if !there {
        eprintln!("skipped: the npm module three or Chromium is not installed");
    }
    there
}

/// What a page tells in `window.seen`; MAP in it stands for the modules, INPUT for what it is given.
pub(crate) fn seen<T: DeserializeOwned>(page: &str, input: &Value) -> T {
    let modules = folder().expect("the module is there");
    let mut browser = Browser::start().expect("a browser is there");
    let page = page
        .replace("MAP", &imports(&modules).to_string())
        .replace("INPUT", &input.to_string());
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("three.html");
    std::fs::write(&path, page).unwrap();
    browser.open(&path);
    browser.wait_for("typeof window.seen === 'string'");
    let seen = serde_json::from_str(&browser.run("window.seen")).unwrap();
    assert!(browser.faults().is_empty(), "{:#?}", browser.faults());
    seen
}

/// Bytes as an address.
pub(crate) fn url(kind: &str, bytes: &[u8]) -> String {
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

/// The module's folder.
fn folder() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/web/node_modules");
    let named = std::env::var_os("HAARLIGHT_NODE_MODULES").map(PathBuf::from);
    let named = named.into_iter().flat_map(|p| [p.join("node_modules"), p]);
    let mut places = named.chain([own]).map(|p| p.join("three"));
    places.find(|p| p.join("build/three.core.js").exists())
}

/// The modules by the names that pages import them by.
fn imports(folder: &Path) -> Value {
    let module = |path: &str| {
        let text = std::fs::read_to_string(folder.join(path)).unwrap();
        let text = text
            .replace("'./three.core.js'", "'core'")
            .replace("'../libs/fflate.module.js'", "'fflate'")
            .replace("'../utils/BufferGeometryUtils.js'", "'geometry'")
            .replace("'../utils/SkeletonUtils.js'", "'skeleton'");
        url("text/javascript", text.as_bytes())
    };
    json!({ "imports": {
        "core": module("build/three.core.js"),
        "three": module("build/three.module.js"),
        "fflate": module("examples/jsm/libs/fflate.module.js"),
        "geometry": module("examples/jsm/utils/BufferGeometryUtils.js"),
        "skeleton": module("examples/jsm/utils/SkeletonUtils.js"),
        "gltf": module("examples/jsm/loaders/GLTFLoader.js"),
        "exr": module("examples/jsm/loaders/EXRLoader.js"),
    } })
}
