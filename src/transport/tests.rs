//! Set-up shared by tests of several files of the transport.

use super::receiver::Receiver;
use crate::hierarchy::Tree;
use crate::scene::{Options, Scene};
use crate::solve::{Bake, Settings};
use std::path::Path;

/// One of the rooms of `scenes/` after this many rounds.
pub(crate) fn baked(room: &str, rounds: usize) -> Bake {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scene = Scene::load(scenes.join(room), &Options::default()).unwrap();
    let settings = Settings {
        rounds,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    bake.run();
    bake
}

/// The middle of a leaf.
pub(super) fn middle(tree: &Tree, leaf: u32) -> Receiver {
    let element = tree.element(tree.node(leaf)).unwrap();
    Receiver {
        point: element.at([1.0 / 3.0; 3]),
        normal: tree.face_normal[element.face as usize],
        plane: tree.face_plane[element.face as usize],
        leaf: Some(leaf),
        seed: u64::from(leaf),
    }
}
