//! Set-up shared by tests of several files of the transport.

use super::receiver::Receiver;
use crate::hierarchy::Tree;
use crate::scene::{Options, Scene};
use crate::solve::{Bake, Settings};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, OnceLock};

/// One of the rooms of `scenes/` after this many rounds, baked once for all tests that ask for it.
pub(crate) fn baked(room: &'static str, rounds: usize) -> &'static Bake {
    type Bakes = BTreeMap<(&'static str, usize), &'static OnceLock<Bake>>;
    static ALL: Mutex<Bakes> = Mutex::new(BTreeMap::new());
    let mut all = ALL.lock().unwrap();
    // Each has a lock of its own: others need not wait until it is done.
    let one = *all
        .entry((room, rounds))
        .or_insert_with(|| Box::leak(Box::default()));
    drop(all);
    one.get_or_init(|| {
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        let scene = Scene::load(scenes.join(room), &Options::default()).unwrap();
        let settings = Settings {
            rounds,
            ..Settings::default()
        };
        let mut bake = Bake::new(scene, settings);
        bake.run();
        bake
    })
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
