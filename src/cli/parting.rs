//! `bake --layers` and `--probes`: the light of each group of lamps, and light in the air.

use super::options::positive;
use super::paths::text as text_of;
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::output::Exposure;
use crate::output::probes::{ProbeGrid, Probes, to_volume};
use crate::scene::Scene;
use crate::solve::{Bake, Representation};
use crate::store::file;
use crate::survey::PointLocation;
use std::path::Path;

/// What is written beside the light of surfaces.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Parting {
    /// Write the light of each lamp, or group of lamps ("layers" in the file of spectra), by itself as well, so that it can be
    /// dimmed: as COLOR_1, COLOR_2, ... or, with --light maps, as further pages.
    #[arg(long)]
    pub layers: bool,
    /// Write light in the air, in a grid of points so far apart (in the file's unit), for objects that move.
    #[arg(long, value_name = "SPACING", value_parser = positive, allow_negative_numbers = true)]
    pub probes: Option<f64>,
}

impl Parting {
    /// Parts the lamps of a room, if that was asked for.
    pub(super) fn part(self, scene: &mut Scene, talk: &Talk) -> Result<()> {
        if !self.layers {
            return Ok(());
        }
        scene.part_lamps()?;
        match &scene.changes.layers {
            Some(layers) => talk.say(&format!("layers: {}", layers.names.join(", "))),
            None => talk.warn("--layers: no lamp lights the room, there are none"),
        }
        Ok(())
    }

    /// Where probes stand, if they were asked for.
    ///
    /// # Errors
    /// They are too many.
    pub(super) fn grid(self, scene: &Scene) -> Result<Option<ProbeGrid>> {
        let spacing = self.probes.map(|spacing| spacing * scene.changes.scale);
        spacing
            .map(|spacing| ProbeGrid::of(scene, spacing))
            .transpose()
    }

    /// How spectra are carried that does not go with layers.
    pub(super) fn problem(self, spectrum: Representation) -> Option<Problem> {
        let what = "does not hold the light of each lamp by itself";
        let next = "leave it out, or leave --layers out";
        let given = self.layers && spectrum != Representation::Adaptive;
        given.then(|| Problem::new("--spectrum", what, next))
    }
}

/// Gathers the light of probes and writes it beside the glb; names of the files.
pub(super) fn write_probes(
    bake: &Bake,
    grid: &ProbeGrid,
    (output, room): (&Path, &Path),
    look: &Exposure,
    talk: &Talk,
) -> Result<Vec<String>> {
    let [json, ktx2] = ["probes.json", "probes.ktx2"].map(|end| output.with_extension(end));
    let air = bake.air(&grid.points());
    let count = |place| air.iter().filter(|a| a.place == place).count();
    let (inside, outside) = (count(PointLocation::Inside), count(PointLocation::Outside));
    let name = ktx2.file_name().map(|n| n.to_string_lossy().into_owned());
    let error = bake.rounds().last().map(|round| round.error.total_de2000);
    let name = name.unwrap_or_default();
    let probes = Probes::new(bake.scene(), grid, air, look, error, name);
    let [x, y, z] = probes.counts;
    talk.say(&format!(
        "probes: {x} x {y} x {z}, {inside} inside something solid, {outside} outside; nine coefficients leave out {:.1} % of the \
         light's directions (mean, measured), {:.1} % at the most",
        100.0 * probes.truncation.mean,
        100.0 * probes.truncation.max,
    ));
    let text = serde_json::to_vec(&probes)
        .map_err(|problem| Error::Internal(format!("probes: {problem}")))?;
    if bake.team().is_first() {
        for (path, bytes) in [(&json, text), (&ktx2, to_volume(&probes))] {
            file::write_atomic(path, Some(room), |w| w.write_all(&bytes))?;
        }
    }
    Ok([json, ktx2].map(|path| text_of(&path)).to_vec())
}
