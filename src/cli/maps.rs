//! `haarlight bake ROOM --light maps`: what may be asked for, and the files that are written.

use super::paths::text;
use super::stop::Stop;
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::gather::Baked;
use crate::lightmap::{LightMaps, MapLimits};
use crate::output::maps::{self, Precision};
use crate::output::{BakedGlb, Exposure};
use crate::scene::Scene;
use crate::solve::Bake;
use crate::store::file;
use std::path::{Path, PathBuf};

/// Pages are as many texels wide and high at the most, where nothing is said.
const PAGE: usize = 1024;
/// Least and most that can be asked for: margins take 8, and graphics cards hold 16,384.
pub const PAGES: [usize; 2] = [64, 16_384];

/// Where the light is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
#[non_exhaustive]
pub enum Medium {
    /// At the vertices of a mesh that is as fine as the light needs it.
    #[default]
    Vertices,
    /// In light maps for the room's own mesh.
    Maps,
}

/// What of the light is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[non_exhaustive]
pub enum Only {
    /// What was reflected at least once: for engines that keep their own lamps.
    Indirect,
}

/// Options of light maps.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
#[non_exhaustive]
pub struct Mapping {
    /// Where the light is written.
    #[arg(long, value_enum, value_name = "WHERE", default_value_t)]
    pub light: Medium,
    /// With --light maps: pages have N x N texels at the most [default: 1024].
    #[arg(long, value_name = "N")]
    pub map_size: Option<usize>,
    /// With --light maps: texels of all pages at the most, about [default: as many as the error needs].
    #[arg(long, value_name = "N")]
    pub texels: Option<usize>,
    /// With --light maps: write only this light.
    #[arg(long, value_enum, value_name = "WHAT")]
    pub only: Option<Only>,
    /// With --light maps: write the pages as KTX 2.0 too.
    #[arg(long)]
    pub ktx2: bool,
}

impl Mapping {
    /// Are light maps wanted?
    pub(super) fn is_wanted(&self) -> bool {
        self.light == Medium::Maps
    }

    /// The light in maps.
    pub(super) fn maps(&self, bake: &Bake, stop: &Stop, talk: &Talk) -> LightMaps {
        let limits = MapLimits {
            page: self.map_size.unwrap_or(PAGE),
            texels: self.texels,
            indirect: self.only == Some(Only::Indirect),
            late: &|| stop.is_late(0.0),
        };
        bake.light_maps(&limits, &|done, of| {
            talk.progress("gathering", done, of);
        })
    }

    /// Options that do not go together; `of_vertices`: options for light at vertices, and whether they were given.
    pub(super) fn problems(&self, of_vertices: &[(&str, bool)]) -> Vec<Problem> {
        let own = [
            ("--map-size", self.map_size.is_some()),
            ("--texels", self.texels.is_some()),
            ("--only", self.only.is_some()),
            ("--ktx2", self.ktx2),
        ];
        let (options, what, next) = match self.is_wanted() {
            true => (
                of_vertices,
                "is for light at vertices",
                "leave it out, or leave --light maps out",
            ),
            false => (
                &own[..],
                "is for light maps",
                "add --light maps, or leave it out",
            ),
        };
        let refused = options.iter().filter(|(_, given)| *given);
        let mut problems: Vec<Problem> = refused
            .map(|(option, _)| Problem::new(*option, what, next))
            .collect();
        let [least, most] = PAGES;
        if let Some(size) = self.map_size.filter(|s| !(least..=most).contains(s)) {
            problems.push(Problem::new(
                format!("--map-size {size}"),
                format!("pages have {least} to {most} texels along a side"),
                "give a number between these",
            ));
        }
        problems
    }
}

/// A mesh with the solved light, as cameras meter it: what is written has too few vertices for that.
pub fn metered(bake: &Bake) -> Baked {
    let none = |surface: &crate::scene::Surface| vec![false; surface.triangles.len()];
    let nowhere: Vec<Vec<bool>> = bake.scene().surfaces.iter().map(none).collect();
    bake.sketch(&nowhere, &|_, _| ())
}

/// Writes the pages and their index beside the glb at `output`; their names. `room` is not written over.
///
/// # Errors
/// A file cannot be written, or an internal fault of an encoder.
pub fn write(
    output: &Path,
    room: &Path,
    scene: &Scene,
    maps: &LightMaps,
    glb: &BakedGlb,
    look: &Exposure,
    ktx2: bool,
) -> Result<Vec<String>> {
    let page_path = |k: usize, layer: Option<usize>, ending: &str| {
        let layer = layer.map_or(String::new(), |l| format!("layer-{}.", l + 1));
        output.with_extension(format!("{layer}map-{k}.{ending}"))
    };
    let name = |k: usize, layer: Option<usize>, ending: &str| {
        let path = page_path(k, layer, ending);
        path.file_name()
            .map_or(String::new(), |n| n.to_string_lossy().into_owned())
    };
    let index = maps::index(scene, maps, glb, look, ktx2, &name)?;
    let json = serde_json::to_vec_pretty(&index)
        .map_err(|problem| Error::Internal(format!("index of light maps: {problem}")))?;
    let precision = Precision::of(maps);
    let mut files: Vec<(PathBuf, Vec<u8>)> = vec![(output.with_extension("maps.json"), json)];
    let of_layers = (0..).zip(&maps.layers).map(|(l, pages)| (Some(l), pages));
    for (layer, pages) in std::iter::once((None, &maps.pages)).chain(of_layers) {
        for (k, page) in pages.iter().enumerate() {
            let exr = maps::to_exr(page, index.lux_per_unit, precision)?;
            files.push((page_path(k, layer, "exr"), exr));
            if ktx2 {
                let ktx2 = maps::to_ktx2(page, index.lux_per_unit, precision);
                files.push((page_path(k, layer, "ktx2"), ktx2));
            }
        }
    }
    for (path, bytes) in &files {
        file::write_atomic(path, Some(room), |w| w.write_all(bytes))?;
    }
    Ok(files.iter().map(|(path, _)| text(path)).collect())
}
