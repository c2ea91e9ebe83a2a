//! A room from its file: document, geometry, paint and lamps, and everything that is wrong with any of them together.

use super::changes::Changes;
use super::check::{Check, Unknown};
use super::document::Document;
use super::light::{self, Lamps};
use super::material;
use super::pane;
use super::sky::{self, SkyWish};
use super::spectra_file::SpectraFile;
use super::{
    LightSpectrum, Material, PunctualLight, Scene, Surface, lacking, layers, luminaires, said,
};
use crate::color::Upsampler;
use crate::data::{Grid, Leaves};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// How to read a room.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The wavelengths to work on; 380 to 780 nm by default.
    pub grid: Grid,
    /// The file of spectra; none: `room.spectra.json` beside `room.glb`, if there is one.
    pub spectra: Option<PathBuf>,
    /// What is said over the file of spectra: an object of the same form, laid over it as RFC 7396 has it (`null` takes out), where the
    /// name of a spectrum takes the place of a CSV, and a CSV that of a name.
    pub said: Option<serde_json::Value>,
    /// Only warn of keys and names in the file of spectra that mean nothing.
    pub lenient: bool,
    /// Metres for each unit of the file; none: 1, as glTF has it.
    pub scale: Option<f64>,
    /// Sky and sun; what is not said here the file of spectra may say.
    pub sky: SkyWish,
}

impl Options {
    /// Says more, over what was said: see [`Options::said`].
    pub fn say(&mut self, more: serde_json::Value) {
        self.said = said::over(self.said.take(), Some(&more));
    }
}

impl Scene {
    /// Reads a room.
    ///
    /// ```
    /// use haarlight::scene::{Options, Scene, effects::{Kind, Plan}};
    /// let room = Scene::load("scenes/convex.glb", &Options::default())?;
    /// assert_eq!(room.materials[0].name, "floor");
    /// // Nothing can block in a convex empty room, so that no visibility is worked out.
    /// assert!(!Plan::of(&room).runs(Kind::Occlusion));
    /// # Ok::<(), haarlight::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such file; [`Error::Input`] with all problems of document, geometry, materials,
    /// lights and spectra.
    pub fn load(path: impl AsRef<Path>, options: &Options) -> Result<Self> {
        Self::from_document(Document::open(path)?, options)
    }

    /// The room that a document holds.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn from_document(document: Document, options: &Options) -> Result<Self> {
        let geometry = document.load_geometry();
        let raw_materials = &pane::blended(
            document.raw_materials(),
            &geometry.surfaces,
            &geometry.images,
        );
        let path = &document.source.path;
        let mut check = Check::new(path.display().to_string());
        let raw_lights = document.raw_lights();
        let names: Vec<String> = raw_materials.iter().map(material::name_of).collect();
        let light_names: Vec<String> = raw_lights.iter().map(light::name_of).collect();
        let grid = options.grid;
        let file = SpectraFile::open(path, options, &names, &light_names, &mut check);
        let upsampler = Upsampler::new(&grid);
        let mut lamps = Lamps::new(&grid, &upsampler);
        let (mut materials, shining) = material::materials(
            raw_materials,
            &tinted(raw_materials.len(), &geometry.surfaces),
            &file,
            path,
            &grid,
            &upsampler,
            &mut lamps,
            &mut check,
        );
        let nodes = raw_lights.iter().filter_map(|raw| raw.ies.as_ref());
        let profiles = luminaires::profiles(&document.source, nodes, &mut check);
        let mut lights =
            light::punctual(raw_lights, &profiles, &file, path, &mut lamps, &mut check);
        let luminous = lamps.luminous();
        let mut spectra = lamps.finish(&mut materials, &mut lights);
        let size = |light: usize, shape: &Leaves| luminous(&spectra[light], shape);
        let is_pane = |s: &Surface| materials.get(s.material).is_some_and(|m| m.pane.is_some());
        let (panes, surfaces): (Vec<_>, Vec<_>) = geometry.surfaces.into_iter().partition(is_pane);
        luminaires::add(
            &shining,
            &surfaces,
            &mut materials,
            &mut lights,
            options.scale.unwrap_or(1.0),
            size,
            &mut check,
        );
        let nodes: Vec<(String, String)> = raw_lights
            .iter()
            .map(|raw| {
                (
                    node_name(&document.source.json, raw.node),
                    light::name_of(raw),
                )
            })
            .collect();
        let wish = options.sky.clone().or(file.sky.clone());
        let sky = sky::join(&wish, &nodes, &grid, &mut lights, &mut spectra, &mut check);
        if sky.as_ref().is_some_and(|sky| sky.sun_of_file) {
            prune(&mut materials, &mut lights, &mut spectra);
        }
        let unknown = match options.lenient {
            true => Unknown::Warn,
            false => Unknown::Refuse,
        };
        layers::check_names(
            &file.layers,
            &document.source.json,
            (&surfaces, &lights),
            &materials,
            unknown,
            &mut check,
        );
        for warning in lacking::warnings(&document.source.json) {
            check.warn(warning);
        }

        let (found, said) = check.into_parts();
        let mut problems = geometry.problems;
        problems.extend(found);
        if !problems.is_empty() {
            return Err(Error::Input(problems));
        }
        let mut warnings = geometry.warnings;
        warnings.extend(said);
        let scene = Self {
            source: document.source,
            grid,
            surfaces,
            panes,
            materials,
            images: geometry.images,
            spectra,
            lights,
            sky,
            cameras: geometry.cameras,
            warnings,
            changes: Changes {
                layers_wished: file.layers,
                ..Changes::default()
            },
        };
        Ok(scene.scaled(options.scale.unwrap_or(1.0)))
    }
}

fn node_name(json: &serde_json::Value, node: usize) -> String {
    json["nodes"][node]["name"]
        .as_str()
        .unwrap_or_default()
        .to_owned()
}

/// Takes out spectra that no lamp has any more.
fn prune(
    materials: &mut [Material],
    lights: &mut [PunctualLight],
    spectra: &mut Vec<LightSpectrum>,
) {
    let emissions = |m: &mut [Material]| -> Vec<usize> {
        m.iter()
            .filter_map(|m| Some(m.emission.as_ref()?.light))
            .collect()
    };
    let mut used = emissions(materials);
    used.extend(lights.iter().map(|l| l.light));
    let kept: Vec<usize> = (0..spectra.len()).filter(|k| used.contains(k)).collect();
    let place = |light: &mut usize| *light = kept.partition_point(|k| k < light);
    let emissions = materials.iter_mut().filter_map(|m| m.emission.as_mut());
    emissions.for_each(|e| place(&mut e.light));
    lights.iter_mut().for_each(|l| place(&mut l.light));
    *spectra = kept.iter().map(|&k| spectra[k].clone()).collect();
}

/// For each material: do all surfaces that carry it have vertex colours?
fn tinted(materials: usize, surfaces: &[Surface]) -> Vec<bool> {
    let mut tinted = vec![false; materials];
    for colored in [true, false] {
        for surface in surfaces.iter().filter(|s| s.colors.is_some() == colored) {
            if let Some(slot) = tinted.get_mut(surface.material) {
                *slot = colored;
            }
        }
    }
    tinted
}
