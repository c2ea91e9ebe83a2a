//! Layers in three.js: its own loader and shaders in a headless browser, with the lines of the README.

use crate::report::three;
use serde_json::json;

const PAGE: &str = include_str!("dimmed.html");
const README: &str = include_str!("../../README.md");

/// Colour that three.js shows in the middle of triangles of a file whose layers are dimmed, and what it should be.
pub(crate) fn seen(glb: &[u8], dim: &[f64]) -> Vec<([f64; 3], [f64; 3])> {
    let input = json!({ "glb": three::url("application/octet-stream", glb), "wanted": dim });
    three::seen(&PAGE.replace("SNIPPET", &snippet()), &input)
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
