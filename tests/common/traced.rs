//! What the path tracer says of rooms that several tests look at.

use haarlight::audit::PathReference;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::path::Path;
use std::sync::LazyLock;

/// 200 points of the Cornell box for bakes to the default error.
pub(crate) static CORNELL: LazyLock<PathReference> = LazyLock::new(|| of("cornell", 1 << 15, 0.5));

/// 200 points of a room of `scenes` for bakes to an error, by so many paths each at the most.
pub(crate) fn of(room: &str, paths: usize, error: f64) -> PathReference {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let room = scenes.join(format!("{room}.glb"));
    let scene = Scene::load(room, &Options::default()).unwrap();
    let settings = Settings {
        error,
        ..Settings::default()
    };
    PathReference::new(&Bake::new(scene, settings), 200, paths, 3)
}
