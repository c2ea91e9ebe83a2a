//! The choice of lanes behind each [`Representation`].
//!
//! Perceptual and guaranteed control choose on a model of the room (`coarse`, `bounded`); the others follow from the
//! lights and materials alone.

use super::sources::DenseSources;
use super::{Bake, Representation, SPECTRUM_SHARE, coarse, direct, punctual};
use crate::color::normalization;
use crate::light::lanes::Lanes;
use crate::light::{self, Filters, Rows, guide};
use crate::scene::effects::EffectKind;
use crate::scene::{LightSpectrum, Scene};
use crate::spectrum::methods::basis;
use crate::spectrum::{
    BANDS, CmfTree, Control, DyadicTree, Estimate, List, Metric, Partition, Path, Spectrum,
    control, represent,
};
use crate::team::Interrupted;

/// The paper's error limits leave this colour difference, CIELUV, to its light sources (Table 1): mean of .26, .33 and
/// .27.
const PAPER_DE_LUV: f64 = 0.29;
/// Materials whose first and second reflections the paper's control includes, and that train a basis.
const MATERIALS: usize = 32;
/// Tinted panes and mirrors that the choice of lanes includes.
const TINTS: usize = 8;
/// Patches of the model for bounds: these take a dozen numbers a lane and a hundred bounces.
const BOUNDED_PATCHES: usize = 48;

impl Bake {
    /// Chooses the lanes of the rounds to come.
    pub(crate) fn choose_lanes(&mut self) -> Result<(), Interrupted> {
        let lanes = self.chosen_lanes()?;
        if !lanes.same_meaning(&self.solution.lanes) {
            // Light on lanes of another meaning is no start: the next solve starts afresh.
            self.solution.light.reflected = Rows::default();
            match lanes.places_in(&self.solution.lanes) {
                Some(places) if lamps_are_flat(&self.room.scene) => {
                    self.refinement.direct.relabel(&places)
                }
                _ => self.refinement.direct = direct::Direct::default(),
            }
        }
        self.solution.lanes = lanes;
        self.solution.light.apart = self.solution.lanes.excites().is_some();
        self.solution.filters = Filters::new(&self.room.scene, &self.solution.lanes);
        Ok(())
    }

    pub(super) fn chosen_lanes(&mut self) -> Result<Lanes, Interrupted> {
        (self.solution.spectrum_error, self.solution.list_limit) = (None, self.list_limit());
        let (spectra, weights) = (&self.room.scene.spectra, &self.room.weights);
        let none = spectra.is_empty() || self.refinement.tree.nodes.is_empty();
        let share = SPECTRUM_SHARE * self.room.settings.error;
        let tolerance = self.room.settings.spectrum.unwrap_or(share);
        let guide = guide(&self.room.scene, weights);
        Ok(match self.room.settings.representation {
            // Light that excites lies where these representations are blind, or in lanes that they mix.
            Representation::Rgb
            | Representation::Paper
            | Representation::Characteristic(_)
            | Representation::Guaranteed
                if guide.is_some() =>
            {
                self.solution.spectrum_error = Some(0.0);
                Lanes::dense(spectra, weights)
            }
            Representation::Uniform(n) if !none => {
                self.guided(Lanes::uniform(spectra, n.into(), weights))
            }
            Representation::Rgb if !none => Lanes::rgb(spectra, &self.room.upsampler, weights),
            Representation::Paper if !none => {
                let cut = paper_cut(&self.room.scene, weights, tolerance);
                Lanes::absolute(spectra, cut, weights)
            }
            // A filter would have to be a matrix here, and so would the transmittance of a sheet.
            Representation::Characteristic(_)
                if self.room.panes.is_some()
                    || self.room.mirrors.is_some()
                    || self.room.plan.runs(EffectKind::Sheets) =>
            {
                Lanes::dense(spectra, weights)
            }
            Representation::Characteristic(n) if !none => {
                let lights: Vec<Spectrum> = spectra.iter().map(|s| s.power).collect();
                let basis = basis(&lights, &paints(&self.room.scene), n.into());
                Lanes::vectors(spectra, basis, weights)
            }
            Representation::Adaptive if !none => self.perceptual(guide.as_ref(), tolerance)?,
            Representation::Guaranteed if !none => {
                let model = self.model(BOUNDED_PATCHES)?;
                let (spectra, weights) = (&self.room.scene.spectra, &self.room.weights);
                let choice =
                    model.choose_bounded(spectra, weights, self.solution.light.white, tolerance);
                // Without light there is no white to judge an error by.
                self.solution.spectrum_error = Some(choice.error).filter(|e| e.is_finite());
                Lanes::ratio(&self.room.scene.spectra, &choice.cuts, &self.room.weights)
            }
            _ => {
                self.solution.spectrum_error = Some(0.0);
                Lanes::dense(spectra, weights)
            }
        })
    }

    /// The colour difference (CIELUV) that lists may make, where light is carried by them. Where it passes filters on its way, or excites other
    /// light, it goes band by band.
    pub(super) fn list_limit(&self) -> Option<f64> {
        let room = &self.room;
        let carried = room.settings.representation == Representation::Lists
            && room.panes.is_none()
            && room.mirrors.is_none()
            && !room.plan.runs(EffectKind::Sheets)
            && guide(&room.scene, &room.weights).is_none()
            && room.team.is_alone()
            && !room.scene.spectra.is_empty();
        let share = SPECTRUM_SHARE * room.settings.error;
        carried.then(|| room.settings.spectrum.unwrap_or(share))
    }

    /// Ratios to each light on as few intervals as the model of the room allows.
    fn perceptual(
        &mut self,
        guide: Option<&[Spectrum; 3]>,
        tolerance: f64,
    ) -> Result<Lanes, Interrupted> {
        let mut model = self.model(coarse::PATCHES)?;
        let kin = Kin::of(&self.room.scene);
        model.join(&kin.of, kin.spectra.len());
        let (spectra, weights) = (&kin.spectra, &self.room.weights);
        if guide.is_some() {
            model.add_fluorescence(spectra, weights, self.room.scene.grid.width());
        }
        let (known, white) = (self.solution.lanes.cuts(), self.solution.light.white);
        let known = known.map(|cuts| kin.one_of_each(&cuts));
        let copies = kin.copies.as_deref();
        let choose = |model: &coarse::Coarse| {
            let seen = (weights, guide);
            model.choose(spectra, seen, white, tolerance, known.clone(), copies)
        };
        let mut choice = choose(&model);
        // Behind a pane light has other spectra: the lanes must serve all of them.
        let plain = (model.emission.clone(), model.punctual.clone());
        for filter in tints(&self.room.scene) {
            self.room.interrupt.check()?;
            (model.emission, model.punctual) = plain.clone();
            model.behind(&filter);
            let other = choose(&model);
            let both = choice.cuts.iter().zip(other.cuts);
            let both: Vec<Partition> = both.map(|(cut, more)| cut.union(more)).collect();
            if kin.fits(&both) {
                choice.cuts = both;
            }
        }
        // Without light there is no white to judge an error by.
        self.solution.spectrum_error = Some(choice.error).filter(|e| e.is_finite());
        let cuts: Vec<Partition> = kin.of.iter().map(|&k| choice.cuts[k]).collect();
        let lanes = Lanes::ratio(&self.room.scene.spectra, &cuts, &self.room.weights);
        Ok(self.guided(lanes))
    }

    /// Lanes that also weigh light by what it excites, where surfaces fluoresce.
    pub(super) fn guided(&self, lanes: Lanes) -> Lanes {
        match guide(&self.room.scene, &self.room.weights) {
            Some(guide) => lanes.guided(
                &guide,
                light::balance(&self.room.scene, &self.room.weights, &guide),
            ),
            None => lanes,
        }
    }

    /// The model of the room on its present links.
    fn model(&mut self, patches: usize) -> Result<coarse::Coarse, Interrupted> {
        let (room, refinement) = (&self.room, &mut self.refinement);
        let leaves = refinement.leaves();
        let shadowed = match refinement.frozen.take() {
            Some(known) => known,
            None => {
                refinement.trace_leaf_rays(room)?;
                let tree = &refinement.tree;
                room.with_sight(|sight| {
                    punctual::factors(
                        tree,
                        &leaves,
                        sight,
                        &room.scene,
                        &room.mesh,
                        room.outside.as_ref(),
                        (room.team, &room.interrupt),
                    )
                })?
            }
        };
        let painter = room.painter();
        let dense = DenseSources::new(&painter, &refinement.tree, &shadowed, &leaves);
        Ok(coarse::Coarse::new(
            &refinement.tree,
            &refinement.graph.links,
            &refinement.leaf_rays.target,
            &refinement.areas,
            &leaves,
            &dense,
            room.scene.spectra.len(),
            patches,
        ))
    }
}

/// Distinct light spectra. A room with layers has copies of a spectrum: a cut that is good for one is good for all of them,
/// each of which may be shown alone.
struct Kin {
    /// The distinct spectra.
    spectra: Vec<LightSpectrum>,
    /// Index of each of the scene's spectra among these.
    of: Vec<usize>,
    /// How many copies there are of each; none without layers.
    copies: Option<Vec<usize>>,
}

impl Kin {
    fn of(scene: &Scene) -> Self {
        let all = &scene.spectra;
        let Some(layers) = &scene.changes.layers else {
            return Self {
                spectra: all.clone(),
                of: (0..all.len()).collect(),
                copies: None,
            };
        };
        let mut kinds: Vec<usize> = layers.kin.clone();
        kinds.sort_unstable();
        kinds.dedup();
        let of: Vec<usize> = (layers.kin.iter())
            .map(|kin| kinds.partition_point(|k| k < kin))
            .collect();
        let members = |kind: usize| of.iter().enumerate().filter(move |(_, k)| **k == kind);
        let first = |kind: usize| members(kind).next().map(|(light, _)| all[light].clone());
        Self {
            spectra: (0..kinds.len()).filter_map(first).collect(),
            copies: Some((0..kinds.len()).map(|kind| members(kind).count()).collect()),
            of,
        }
    }

    /// The cuts of the distinct spectra, given those of all.
    fn one_of_each(&self, cuts: &[Partition]) -> Vec<Partition> {
        let of = |kind| self.of.iter().position(|k| *k == kind);
        let kinds = (0..self.spectra.len()).filter_map(of);
        kinds.filter_map(|light| cuts.get(light).copied()).collect()
    }

    /// Do rows hold the lanes of all copies?
    fn fits(&self, cuts: &[Partition]) -> bool {
        let lanes = |copies: &[usize]| -> usize {
            let each = cuts.iter().zip(copies);
            each.map(|(cut, copies)| copies * cut.count()).sum()
        };
        self.copies
            .as_deref()
            .is_none_or(|copies| lanes(copies) <= BANDS)
    }
}

/// Transmittances of the tinted panes of a scene and reflectances of its tinted mirrors, each once, and the product of all of them.
fn tints(scene: &Scene) -> Vec<Spectrum> {
    let mut tints: Vec<Spectrum> = Vec::new();
    let panes = scene.panes.iter();
    let panes = panes.filter_map(|s| scene.materials[s.material].pane.as_ref());
    let panes = panes.filter(|pane| !pane.is_neutral());
    let mirrors = scene.surfaces.iter();
    let mirrors = mirrors.filter_map(|s| scene.materials[s.material].mirror.as_ref());
    let mirrors = mirrors.filter(|mirror| !mirror.is_neutral());
    let all = panes.map(|pane| pane.normal());
    for tint in all.chain(mirrors.map(|mirror| mirror.reflectance)) {
        if tints.len() < TINTS && !tints.contains(&tint) {
            tints.push(tint);
        }
    }
    if tints.len() > 1 {
        let together = |all: Spectrum, one: &Spectrum| std::array::from_fn(|k| all[k] * one[k]);
        tints.push(tints.iter().fold([1.0; BANDS], together));
    }
    tints
}

/// Does every lamp shine with the very spectrum of its light? Then its direct light is one number for each light, on
/// any cut.
fn lamps_are_flat(scene: &Scene) -> bool {
    let flat = |shape: &Spectrum| shape.iter().all(|&x| x == shape[0]);
    let mut emissions = scene.materials.iter().filter_map(|m| m.emission.as_ref());
    emissions.all(|e| e.texture.is_none() && flat(&e.shape))
        && scene.lights.iter().all(|l| flat(&l.shape))
}

/// Distinct reflectances of a scene, in order of its materials.
fn paints(scene: &Scene) -> Vec<Spectrum> {
    let mut paints: Vec<Spectrum> = Vec::new();
    for material in &scene.materials {
        if paints.len() < MATERIALS && !paints.contains(&material.reflectance) {
            paints.push(material.reflectance);
        }
    }
    paints
}

/// Union of the cuts that the paper's control gives every light and its first and second reflections; `tolerance` is the
/// colour difference (CIELUV) that spectra may cause.
fn paper_cut(scene: &Scene, weights: &[Spectrum; 3], tolerance: f64) -> Partition {
    let cmf = CmfTree::new(*weights);
    let scale = tolerance / PAPER_DE_LUV;
    let rules = Control {
        eps_min: scale * Control::PAPER.eps_min,
        eps_max: scale * Control::PAPER.eps_max,
        ..Control::PAPER
    };
    let paints: Vec<DyadicTree<Estimate>> = paints(scene)
        .iter()
        .map(|r| DyadicTree::new(r, &cmf))
        .collect();
    let mut union = Partition::ROOT;
    for LightSpectrum { power, .. } in &scene.spectra {
        let k = normalization(power, weights);
        if !k.is_finite() {
            continue;
        }
        let source = DyadicTree::<Estimate>::new(&power.map(|x| k * x), &cmf);
        let light = represent(&source, &cmf, &Metric::Xyz, rules.eps_max);
        union = union.union(light.partition());
        let (mut once, mut twice) = (List::black(), List::black());
        for first in &paints {
            light.reflect(first, &cmf, &mut once);
            let mut path = [first; 2];
            let mut reflect = |list: &mut List<Estimate>, path: &[&DyadicTree<Estimate>]| {
                let path = Path {
                    source: &source,
                    reflections: path,
                };
                control(list, &path, &cmf, &Metric::Xyz, &rules);
                union = union.union(list.partition());
            };
            reflect(&mut once, &path[..1]);
            for second in &paints {
                path[1] = second;
                once.reflect(second, &cmf, &mut twice);
                reflect(&mut twice, &path);
            }
        }
    }
    union
}
