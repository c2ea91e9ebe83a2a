//! The files in three.js: its own loaders and shaders in a headless browser.
//!
//! Needs Chromium and the npm module three (`npm install three`, in HAARLIGHT_NODE_MODULES or tools/web); skipped without.

use crate::browser::Browser;
use crate::file::Mapped;
use glam::DVec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const PAGE: &str = include_str!("three.html");
const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// The module's folder.
fn three() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/web/node_modules");
    let named = std::env::var_os("HAARLIGHT_NODE_MODULES").map(PathBuf::from);
    let named = named.into_iter().flat_map(|p| [p.join("node_modules"), p]);
    let places = named.chain([own]).map(|p| p.join("three"));
    places
        .into_iter()
        .find(|p| p.join("build/three.core.js").exists())
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

/// What three.js shows at points of triangles, which are given by the number of their entry in the index: linear sRGB.
/// None: it is not there.
pub(crate) fn shown(
    folder: &Path,
    index: &Value,
    points: &[(usize, DVec3, DVec3)],
) -> Option<Vec<[f64; 3]>> {
    let Some(three) = three() else {
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
            .replace("'../libs/fflate.module.js'", "'fflate'")
            .replace("'../utils/BufferGeometryUtils.js'", "'geometry'")
            .replace("'../utils/SkeletonUtils.js'", "'skeleton'");
        url("text/javascript", text.as_bytes())
    };
    let imports = json!({ "imports": {
        "core": module("build/three.core.js"),
        "three": module("build/three.module.js"),
        "fflate": module("examples/jsm/libs/fflate.module.js"),
        "geometry": module("examples/jsm/utils/BufferGeometryUtils.js"),
        "skeleton": module("examples/jsm/utils/SkeletonUtils.js"),
        "gltf": module("examples/jsm/loaders/GLTFLoader.js"),
        "exr": module("examples/jsm/loaders/EXRLoader.js"),
    } });
    let file = |name: &str| {
        url(
            "application/octet-stream",
            &std::fs::read(folder.join(name)).unwrap(),
        )
    };
    let pages = index["pages"].as_array().unwrap().iter();
    let rows = points
        .iter()
        .map(|(k, p, n)| json!([k, p.x, p.y, p.z, n.x, n.y, n.z]));
    let input = json!({
        "glb": file("room.glb"),
        "pages": pages.map(|p| file(p["exr"].as_str().unwrap())).collect::<Vec<_>>(),
        "index": index, "points": rows.collect::<Vec<_>>(),
    });
    let page = PAGE
        .replace("MAP", &imports.to_string())
        .replace("INPUT", &input.to_string());
    let path = folder.join("three.html");
    std::fs::write(&path, page).unwrap();
    browser.open(&path);
    browser.wait_for("typeof window.seen === 'string'");
    let seen: Vec<[f64; 4]> = serde_json::from_str(&browser.run("window.seen")).unwrap();
    assert!(browser.faults().is_empty(), "{:#?}", browser.faults());
    Some(
        seen.into_iter()
            .map(|[r, g, b, a]| {
                assert_eq!(a, 1.0, "nothing was drawn there");
                [r, g, b]
            })
            .collect(),
    )
}

/// Normal of a triangle out of the side that is lit.
pub(crate) fn facing(of: &Mapped) -> DVec3 {
    let [a, b, c] = of.corners;
    let flat = (b - a).cross(c - a).normalize();
    if flat.dot(of.normals[0]) < 0.0 {
        -flat
    } else {
        flat
    }
}
