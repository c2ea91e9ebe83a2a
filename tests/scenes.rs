//! The rooms of `scenes/`: the generator writes exactly the committed files, and each of them loads.

use crate::generator;

use clap::Parser;
use generator::Args;
use haarlight::scene::{Options, Scene};
use std::path::Path;

/// The generator's own code in this program: run by cargo, it builds the library once more wherever the environment is not that of the
/// first build (200 s).
fn rooms(dir: &Path, more: &[&str]) {
    let arguments = ["rooms", dir.to_str().unwrap()].into_iter();
    let arguments = arguments.chain(more.iter().copied());
    generator::run(&Args::try_parse_from(arguments).unwrap()).unwrap();
}

#[test]
fn the_generator_writes_the_committed_rooms() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let fresh = tempfile::tempdir().unwrap();
    rooms(fresh.path(), &[]);
    let mut seen = 0;
    for entry in std::fs::read_dir(fresh.path()).unwrap() {
        let name = entry.unwrap().file_name();
        let [new, committed] =
            [fresh.path(), &scenes].map(|dir| std::fs::read(dir.join(&name)).unwrap());
        assert!(new == committed, "{} differs", name.display());
        if name.to_string_lossy().ends_with(".glb") {
            assert!(new.len() < 100_000, "{} is large", name.display());
            let scene = Scene::load(scenes.join(&name), &Options::default()).unwrap();
            assert!(
                !scene.cameras.is_empty() && !scene.spectra.is_empty(),
                "{}",
                name.display()
            );
        }
        seen += 1;
    }
    assert_eq!(seen, 38);
}

#[test]
fn the_furnished_room_grows_to_what_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for wanted in [1_000usize, 20_000, 100_000] {
        rooms(
            folder.path(),
            &["--only", "furnished", "--triangles", &wanted.to_string()],
        );
        let scene = Scene::load(folder.path().join("furnished.glb"), &Options::default()).unwrap();
        let triangles: usize = scene.surfaces.iter().map(|s| s.triangles.len()).sum();
        assert!(
            triangles > wanted / 2 && triangles < wanted * 2,
            "{triangles} for {wanted}"
        );
    }
}
