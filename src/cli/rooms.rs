//! Rooms as commands read and prepare them.

use super::options::{Common, Reading, Solving};
use super::paths;
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::gather::Baked;
use crate::output::npz;
use crate::scene::Scene;
use crate::solve::{Bake, NOBODY, Representation, Settings};
use crate::store::file;
use crate::survey::advise_unless;
use crate::team::{Asked, Interrupt, NEVER};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Phases of a round, in order.
const PHASES: [&str; 6] = [
    "links", "spectrum", "direct", "balance", "solve", "estimate",
];
/// Reads a room and looks it over; its problems and those that `others` finds (given the files the room is made of) come together.
pub(super) fn load(
    room: &Path,
    reading: &Reading,
    others: impl FnOnce(&[PathBuf]) -> Vec<Problem>,
) -> Result<Scene> {
    load_unless(room, reading, &NEVER, others)
}

/// [`load`], but the room is not looked over once that is interrupted.
pub(super) fn load_unless(
    room: &Path,
    reading: &Reading,
    interrupt: &Interrupt,
    others: impl FnOnce(&[PathBuf]) -> Vec<Problem>,
) -> Result<Scene> {
    match Scene::load(room, &reading.options()) {
        Ok(mut scene) => {
            let mut problems = advise_unless(&mut scene, reading.wishes(), interrupt);
            problems.extend(others(&paths::parts(&scene)));
            if problems.is_empty() {
                Ok(scene)
            } else {
                Err(Error::Input(problems))
            }
        }
        Err(Error::Input(mut problems)) => {
            problems.extend(others(&[]));
            Err(Error::Input(problems))
        }
        Err(Error::Io { path, source }) => {
            let mut problems = vec![Problem::new(
                path,
                source.to_string(),
                "name a file that can be read",
            )];
            problems.extend(others(&[]));
            Err(Error::Input(problems))
        }
        Err(fault) => Err(fault),
    }
}

/// The bake of a scene, which tells `talk` of its phases.
pub(super) fn prepare(
    scene: Scene,
    solving: &Solving,
    common: &Common,
    representation: Representation,
    talk: &Talk,
) -> Bake {
    let never = Arc::new(|| false);
    prepare_unless(scene, solving, common, representation, talk, never).expect(NOBODY)
}

/// [`prepare`], unless `asked` ends it before there is anything to write.
pub(super) fn prepare_unless(
    scene: Scene,
    solving: &Solving,
    common: &Common,
    representation: Representation,
    talk: &Talk,
    asked: Asked,
) -> Option<Bake> {
    let settings = Settings {
        error: solving.error,
        representation,
        seed: common.seed,
        ..Settings::default()
    };
    let mut bake = Bake::new_unless(scene, settings, asked)?;
    bake.spread_over(common.team);
    let parts = talk.parts();
    bake.watch(Arc::new(move |ended| {
        let place = PHASES.iter().position(|phase| *phase == ended);
        let next = place.and_then(|k| PHASES.get(k + 1)).unwrap_or(&"");
        parts.begins("round", next);
    }));
    Some(bake)
}

/// Writes a baked mesh with its spectra for NumPy.
pub(super) fn write_npz(path: &Path, room: &Path, bake: &Bake, baked: &Baked) -> Result<()> {
    let spectra = bake.radiosity_spectra(baked);
    let names = bake.layers().map_or(&[][..], |layers| &layers.names);
    let layer = |k: usize| bake.layer_spectra(baked, k);
    // The writer's own error says more than what the system makes of it.
    let mut problem = None;
    let written = file::write_atomic(path, Some(room), |w| {
        let (scene, parts) = (bake.scene(), (names, &layer as &dyn Fn(usize) -> _));
        npz::write_parted(w, scene, &baked.surfaces, &spectra, parts).map_err(|e| {
            let text = e.to_string();
            problem = Some(e);
            std::io::Error::other(text)
        })
    });
    match problem {
        Some(Error::Internal(what)) => Err(Error::Internal(what)),
        _ => written,
    }
}
