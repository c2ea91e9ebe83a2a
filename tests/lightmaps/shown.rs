//! The files in three.js: its own loaders and shaders in a headless browser.

use super::file::Mapped;
use crate::report::three::{self, url};
use glam::DVec3;
use serde_json::{Value, json};
use std::path::Path;

const PAGE: &str = include_str!("shown.html");

/// What three.js shows at points of triangles, which are given by the number of their entry in the index: linear sRGB.
pub(crate) fn shown(
    folder: &Path,
    index: &Value,
    points: &[(usize, DVec3, DVec3)],
) -> Vec<[f64; 3]> {
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
    let seen: Vec<[f64; 4]> = three::seen(PAGE, &input);
    let colors = seen.into_iter().map(|[r, g, b, a]| {
        assert_eq!(a, 1.0, "nothing was drawn there");
        [r, g, b]
    });
    colors.collect()
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
