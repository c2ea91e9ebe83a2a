//! What the lanes of a bake stand for: the choice behind each [`Representation`].
//!
//! Perceptual and guaranteed control choose on a model of the room (`coarse`, `bounded`); the others follow from the
//! lights and materials alone.

use super::sources::DenseSources;
use super::{Bake, Representation, Rows, SPECTRUM_SHARE, coarse, direct, punctual};
use crate::color::normalization;
use crate::light::Filters;
use crate::light::lanes::Lanes;
use crate::link::{LinkRows, balance};
use crate::scene::{LightSpectrum, Scene};
use crate::spectrum::methods::basis;
use crate::spectrum::{
    CmfTree, Control, Estimate, LEAVES, Leaves, List, Metric, Partition, Path, Tree, control,
    represent,
};

/// The paper's error limits leave its light sources (Table 1) this colour difference, CIELUV: mean of .26, .33 and .27.
const PAPER_DE_LUV: f64 = 0.29;
/// Materials whose first and second reflections the paper's control looks at, and that train a basis.
const MATERIALS: usize = 32;
/// Tinted panes that the choice of lanes looks at.
const TINTS: usize = 8;
/// Patches of the model on which bounds are worked out: they take a dozen numbers a lane and a hundred bounces.
const BOUNDED_PATCHES: usize = 48;

impl Bake {
    /// Chooses the lanes of the rounds to come.
    pub(crate) fn choose_lanes(&mut self) {
        let lanes = self.chosen_lanes();
        if !lanes.same_meaning(&self.lanes) {
            // The lanes of an earlier round mean something else: the next solve starts afresh.
            self.light.reflected = Rows::default();
            match lanes.places_in(&self.lanes) {
                Some(places) if lamps_are_flat(&self.scene) => self.direct.relabel(&places),
                _ => self.direct = direct::Direct::default(),
            }
        }
        self.lanes = lanes;
        self.filters = Filters::new(&self.scene, &self.lanes);
    }

    pub(super) fn chosen_lanes(&mut self) -> Lanes {
        self.spectrum_error = None;
        let (spectra, weights) = (&self.scene.spectra, &self.weights);
        let none = spectra.is_empty() || self.tree.nodes.is_empty();
        let share = SPECTRUM_SHARE * self.settings.error;
        let tolerance = self.settings.spectrum.unwrap_or(share);
        match self.settings.representation {
            Representation::Uniform(n) if !none => Lanes::uniform(spectra, n.into(), weights),
            Representation::Rgb if !none => Lanes::rgb(spectra, &self.upsampler, weights),
            Representation::Paper if !none => {
                let cut = paper_cut(&self.scene, weights, tolerance);
                Lanes::absolute(spectra, cut, weights)
            }
            // A filter would have to be a matrix there.
            Representation::Characteristic(_) if self.panes.is_some() => {
                Lanes::dense(spectra, weights)
            }
            Representation::Characteristic(n) if !none => {
                let lights: Vec<Leaves> = spectra.iter().map(|s| s.power).collect();
                let basis = basis(&lights, &paints(&self.scene), n.into());
                Lanes::vectors(spectra, basis, weights)
            }
            Representation::Adaptive if !none => {
                let mut model = self.model(coarse::PATCHES);
                let (spectra, weights) = (&self.scene.spectra, &self.weights);
                let (known, white) = (self.lanes.cuts(), self.light.white);
                let choose = |model: &coarse::Coarse| {
                    model.choose(spectra, weights, white, tolerance, known.clone())
                };
                let mut choice = choose(&model);
                // What lies behind a pane has light of its own spectra: lanes serve all of them.
                let plain = (model.emission.clone(), model.punctual.clone());
                for filter in tints(&self.scene) {
                    (model.emission, model.punctual) = plain.clone();
                    model.behind(&filter);
                    let other = choose(&model);
                    for (cut, more) in choice.cuts.iter_mut().zip(other.cuts) {
                        *cut = cut.union(more);
                    }
                }
                // Without light there is no white to see an error by.
                self.spectrum_error = Some(choice.error).filter(|e| e.is_finite());
                Lanes::ratio(&self.scene.spectra, &choice.cuts, &self.weights)
            }
            Representation::Guaranteed if !none => {
                let model = self.model(BOUNDED_PATCHES);
                let (spectra, weights) = (&self.scene.spectra, &self.weights);
                let choice = model.choose_bounded(spectra, weights, self.light.white, tolerance);
                // Without light there is no white to see an error by.
                self.spectrum_error = Some(choice.error).filter(|e| e.is_finite());
                Lanes::ratio(&self.scene.spectra, &choice.cuts, &self.weights)
            }
            _ => {
                self.spectrum_error = Some(0.0);
                Lanes::dense(spectra, weights)
            }
        }
    }

    /// The model of the room on its present links.
    fn model(&mut self, patches: usize) -> coarse::Coarse {
        let leaves: Vec<u32> = self.tree.leaves().collect();
        let (shadowed, factor) = match self.frozen.take() {
            Some(known) => known,
            None => {
                let shadowed = self.with_sight(|bake, sight| {
                    punctual::factors(
                        &bake.tree,
                        &leaves,
                        sight,
                        &bake.scene,
                        &bake.mesh,
                        bake.outside.as_ref(),
                    )
                });
                let rows = LinkRows::new(self.tree.nodes.len(), &self.graph.links);
                self.look_out();
                let balance = balance(&self.tree, &rows, &self.areas, &self.outlook.target);
                (shadowed, balance.factor)
            }
        };
        let painter = self.painter();
        let dense = DenseSources::new(&painter, &self.tree, &shadowed, &leaves);
        coarse::Coarse::new(
            &self.tree,
            &self.graph.links,
            &factor,
            &self.areas,
            &leaves,
            &dense,
            self.scene.spectra.len(),
            patches,
        )
    }
}

/// What the tinted panes of a scene let through, without those that come twice, and what all of them do together.
fn tints(scene: &Scene) -> Vec<Leaves> {
    let mut tints: Vec<Leaves> = Vec::new();
    let panes = scene.panes.iter();
    for pane in panes.filter_map(|s| scene.materials[s.material].pane.as_ref()) {
        let normal = pane.normal();
        if tints.len() < TINTS && !pane.is_neutral() && !tints.contains(&normal) {
            tints.push(normal);
        }
    }
    if tints.len() > 1 {
        let together = |all: Leaves, one: &Leaves| std::array::from_fn(|k| all[k] * one[k]);
        tints.push(tints.iter().fold([1.0; LEAVES], together));
    }
    tints
}

/// Does every lamp shine with just its light's spectrum? Its direct light is then one number a light, on any cut.
fn lamps_are_flat(scene: &Scene) -> bool {
    let flat = |shape: &Leaves| shape.iter().all(|&x| x == shape[0]);
    let mut emissions = scene.materials.iter().filter_map(|m| m.emission.as_ref());
    emissions.all(|e| e.texture.is_none() && flat(&e.shape))
        && scene.lights.iter().all(|l| flat(&l.shape))
}

/// Different reflectances of a scene in order of its materials.
fn paints(scene: &Scene) -> Vec<Leaves> {
    let mut paints: Vec<Leaves> = Vec::new();
    for material in &scene.materials {
        if paints.len() < MATERIALS && !paints.contains(&material.reflectance) {
            paints.push(material.reflectance);
        }
    }
    paints
}

/// Union of the cuts that the paper's control gives every light and its first and second reflections; `tolerance` is the
/// colour difference (CIELUV) that spectra may cause.
fn paper_cut(scene: &Scene, weights: &[Leaves; 3], tolerance: f64) -> Partition {
    let cmf = CmfTree::new(*weights);
    let scale = tolerance / PAPER_DE_LUV;
    let rules = Control {
        eps_min: scale * Control::PAPER.eps_min,
        eps_max: scale * Control::PAPER.eps_max,
        ..Control::PAPER
    };
    let paints: Vec<Tree<Estimate>> = paints(scene).iter().map(|r| Tree::new(r, &cmf)).collect();
    let mut union = Partition::ROOT;
    for LightSpectrum { power, .. } in &scene.spectra {
        let k = normalization(power, weights);
        if !k.is_finite() {
            continue;
        }
        let source = Tree::<Estimate>::new(&power.map(|x| k * x), &cmf);
        let light = represent(&source, &cmf, &Metric::Xyz, rules.eps_max);
        union = union.union(light.partition());
        let (mut once, mut twice) = (List::black(), List::black());
        for first in &paints {
            light.reflect(first, &cmf, &mut once);
            let mut path = [first; 2];
            let mut reflect = |list: &mut List<Estimate>, path: &[&Tree<Estimate>]| {
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
