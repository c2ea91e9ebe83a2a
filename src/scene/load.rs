//! A room from its file: document, geometry, paint and lamps, and everything that is wrong with any of them together.

use super::changes::Changes;
use super::check::{Check, Unknown};
use super::document::{Document, RawLight};
use super::fluorescing;
use super::lamp_spectra::LampSpectra;
use super::layers::LayerWish;
use super::lights;
use super::materials;
use super::pane;
use super::parting;
use super::sky::{self, Sky, SkyWish};
use super::solids;
use super::spectra_file::SpectraFile;
use super::{Image, LightSpectrum, Material, Options, PunctualLight, Scene, Surface};
use super::{lacking, luminaires};
use crate::color::Upsampler;
use crate::data::Spectrum;
use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::path::Path;

impl Scene {
    /// Reads a room.
    ///
    /// ```
    /// use haarlight::scene::{Options, Scene, effects::{EffectKind, Plan}};
    /// let room = Scene::load("scenes/convex.glb", &Options::default())?;
    /// assert_eq!(room.materials[0].name, "floor");
    /// // Nothing can block in a convex empty room, so that no visibility is worked out.
    /// assert!(!Plan::of(&room).runs(EffectKind::Occlusion));
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
        let mut check = Check::new(document.source.place());
        let (surfaces, images) = (geometry.surfaces, geometry.images);
        let mut lit = PaintedScene::of(&document, surfaces, &images, options, &mut check);
        let sky = lit.under_sky(&document, options, &mut check);
        lit.calm();
        let unknown = match options.lenient {
            true => Unknown::Warn,
            false => Unknown::Refuse,
        };
        parting::check_names(
            &lit.layers,
            &document.source.json,
            (&lit.surfaces, &lit.lights),
            &lit.materials,
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
        let (surfaces, materials) = (&lit.surfaces, &lit.materials);
        let solids = solids::solids(surfaces, materials, &lit.lights, &geometry.cameras);
        let scene = Self {
            source: document.source,
            grid: options.grid,
            surfaces: lit.surfaces,
            panes: lit.panes,
            materials: lit.materials,
            solids,
            images,
            spectra: lit.spectra,
            lights: lit.lights,
            sky,
            cameras: geometry.cameras,
            warnings,
            changes: Changes {
                layers_wished: lit.layers,
                ..Changes::default()
            },
        };
        Ok(scene.scaled(options.scale.unwrap_or(1.0)))
    }
}

/// Surfaces with their paint, and lamps.
struct PaintedScene {
    surfaces: Vec<Surface>,
    panes: Vec<Surface>,
    materials: Vec<Material>,
    lights: Vec<PunctualLight>,
    spectra: Vec<LightSpectrum>,
    /// What the file of spectra says of the sky.
    sky: SkyWish,
    /// And of layers.
    layers: Vec<LayerWish>,
}

impl PaintedScene {
    fn of(
        document: &Document,
        surfaces: Vec<Surface>,
        images: &[Image],
        options: &Options,
        check: &mut Check,
    ) -> Self {
        let (path, grid) = (&document.source.path, &options.grid);
        let raw = &pane::blended(document.raw_materials(), &surfaces, images);
        let raw_lights = document.raw_lights();
        let names: Vec<String> = raw.iter().map(materials::name_of).collect();
        let light_names: Vec<String> = raw_lights.iter().map(lights::name_of).collect();
        let file = SpectraFile::open(path, options, &names, &light_names, check);
        let upsampler = Upsampler::new(grid);
        let mut lamps = LampSpectra::new(grid, &upsampler);
        let tinted = tinted(raw.len(), &surfaces);
        let (mut materials, shining) = materials::materials(
            raw, &tinted, images, &file, path, grid, &upsampler, &mut lamps, check,
        );
        for material in &mut materials {
            material.tint_mirror(images, &upsampler);
        }
        let nodes = raw_lights.iter().filter_map(|raw| raw.ies.as_ref());
        let profiles = luminaires::profiles(&document.source, nodes, check);
        let mut lights = lights::punctual(raw_lights, &profiles, &file, path, &mut lamps, check);
        let luminous = lamps.luminous();
        let excited = std::mem::take(&mut lamps.excited);
        let mut spectra = lamps.finish(&mut materials, &mut lights);
        fluorescing::join(&mut materials, &mut spectra, excited);
        let size = |light: usize, shape: &Spectrum| luminous(&spectra[light], shape);
        let is_pane = |s: &Surface| materials.get(s.material).is_some_and(|m| m.pane.is_some());
        let (panes, surfaces): (Vec<_>, Vec<_>) = surfaces.into_iter().partition(is_pane);
        let scale = options.scale.unwrap_or(1.0);
        luminaires::add(
            &shining,
            &surfaces,
            &mut materials,
            &mut lights,
            scale,
            size,
            check,
        );
        Self {
            surfaces,
            panes,
            materials,
            lights,
            spectra,
            sky: file.sky,
            layers: file.layers,
        }
    }

    /// What no surface shows gives out nothing and has no light spectrum; where no lamp is, nothing fluoresces.
    fn calm(&mut self) {
        let shown: BTreeSet<usize> = self.surfaces.iter().map(|s| s.material).collect();
        let unseen = (self.materials.iter_mut().enumerate()).filter(|(k, _)| !shown.contains(k));
        for (_, material) in unseen {
            (material.emission, material.fluorescence) = (None, None);
        }
        prune(&mut self.materials, &mut self.lights, &mut self.spectra);
        let shines = self.materials.iter().any(|m| m.emission.is_some());
        if self.lights.is_empty() && !shines {
            self.spectra.clear();
            self.materials
                .iter_mut()
                .for_each(|m| m.fluorescence = None);
        }
    }

    /// Adds the lamps of the sky that is asked for.
    fn under_sky(
        &mut self,
        document: &Document,
        options: &Options,
        check: &mut Check,
    ) -> Option<Sky> {
        let named = |raw: &RawLight| {
            let name = document.source.json["nodes"][raw.node]["name"].as_str();
            (name.unwrap_or_default().to_owned(), lights::name_of(raw))
        };
        let nodes: Vec<(String, String)> = document.raw_lights().iter().map(named).collect();
        let wish = options.sky.clone().or(self.sky.clone());
        let (lights, spectra) = (&mut self.lights, &mut self.spectra);
        let sky = sky::join(&wish, &nodes, &options.grid, lights, spectra, check);
        if sky.as_ref().is_some_and(|sky| sky.sun_of_file) {
            prune(&mut self.materials, lights, spectra);
        }
        sky
    }
}

/// Takes out spectra that no lamp has any more.
fn prune(
    materials: &mut [Material],
    lights: &mut [PunctualLight],
    spectra: &mut Vec<LightSpectrum>,
) {
    let mut used: Vec<usize> = materials.iter().flat_map(Material::lights).collect();
    used.extend(lights.iter().map(|l| l.light));
    let kept: Vec<usize> = (0..spectra.len()).filter(|k| used.contains(k)).collect();
    let place = |light: &mut usize| *light = kept.partition_point(|k| k < light);
    let given = materials.iter_mut().flat_map(Material::lights_mut);
    given.for_each(place);
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
