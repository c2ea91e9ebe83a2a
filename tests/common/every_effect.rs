//! A room in which every effect runs: panes before sky and sun, walls of paper, a tinted mirror, a ceiling with a dye, and a table that
//! shines by a profile.

use haarlight::scene::{Options, Scene};
use serde_json::json;
use std::path::Path;

pub(crate) fn room() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/glazed.glb");
    let csv = |rows: &str| json!({"csv": rows});
    let options = Options {
        said: Some(json!({"materials": {
            "walls": {"transmission": 0.05},
            "red wall": {"mirror": true},
            "ceiling": {"reflectance": 0.4, "fluorescence": {
                "excitation": csv("380,0.5\n480,0.5"), "emission": csv("500,1\n600,1"), "yield": 1.0,
            }},
            "table": {"emission": {"profile": "gallery-panel.ldt", "name": "cie/LED-B3"}},
        }})),
        ..Options::default()
    };
    Scene::load(path, &options).unwrap()
}
