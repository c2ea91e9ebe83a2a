//! Parts the lamps of a room into [layers](super::layers): which lamp goes by which names, and whose copy of a spectrum it gets.

use super::check::{Check, Unknown};
use super::fluorescence::Term;
use super::json::short;
use super::layers::{LayerWish, Layers, MOST_LAYERS};
use super::sky::LIT_GROUND;
use super::{LightKind, LightSpectrum, PunctualLight, Scene, Surface};
use crate::data::nearest_of;
use crate::error::{Error, Result};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Sky and ground.
const SKY: &str = "sky";
/// The sun, whatever its light is called.
const SUN: &str = "sun";

/// Nodes of a document: names, and the node above each.
struct Nodes {
    names: Vec<String>,
    parent: Vec<Option<usize>>,
}

impl Nodes {
    fn new(json: &Value) -> Self {
        let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
        let name = |node: &Value| node["name"].as_str().unwrap_or_default().to_owned();
        let mut parent = vec![None; nodes.len()];
        for (k, node) in nodes.iter().enumerate() {
            for child in node["children"].as_array().into_iter().flatten() {
                let child = child.as_u64().and_then(|c| usize::try_from(c).ok());
                if let Some(slot) = child.and_then(|c| parent.get_mut(c)) {
                    *slot = Some(k);
                }
            }
        }
        let names = nodes.iter().map(name).collect();
        Self { names, parent }
    }

    /// Names of a node and of those above it that have one. A room was read, so that there is no cycle.
    fn above(&self, node: Option<usize>) -> impl Iterator<Item = &str> {
        let up = |&k: &usize| self.parent.get(k).copied().flatten();
        let chain = std::iter::successors(node, up).filter_map(|k| self.names.get(k));
        chain.map(String::as_str).filter(|name| !name.is_empty())
    }
}

/// Names that a light goes by, the one of a layer of its own first.
fn names_of_light<'a>(
    light: &'a PunctualLight,
    surfaces: &[Surface],
    nodes: &'a Nodes,
) -> Vec<&'a str> {
    let mut names: Vec<&str> = match light.kind {
        LightKind::Ground(_) if light.name == LIT_GROUND => return vec![SUN],
        LightKind::Sky(_) | LightKind::Ground(_) => return vec![SKY],
        LightKind::Sun => vec![SUN],
        _ => Vec::new(),
    };
    let body = light.luminaire.as_ref().and_then(|l| l.surface());
    match body.and_then(|k| surfaces.get(k)) {
        // A surface that shines by a profile is named as other surfaces that shine.
        Some(surface) => {
            names.push(&light.name);
            names.extend(nodes.above(Some(surface.node)));
        }
        None => {
            names.extend(nodes.above(light.node));
            let own = nodes.names.get(light.node.unwrap_or(usize::MAX));
            let nameless = own.is_none_or(String::is_empty);
            let place = if nameless { 0 } else { names.len() };
            names.insert(place, &light.name);
        }
    }
    names
}

/// Says which names of wished layers mean no lamp.
pub(super) fn check_names(
    wishes: &[LayerWish],
    json: &Value,
    (surfaces, lights): (&[Surface], &[PunctualLight]),
    materials: &[super::Material],
    unknown: Unknown,
    check: &mut Check,
) {
    let nodes = Nodes::new(json);
    let mut known: Vec<&str> = Vec::new();
    for light in lights {
        known.extend(names_of_light(light, surfaces, &nodes));
    }
    let shines = |s: &&Surface| {
        materials
            .get(s.material)
            .is_some_and(|m| m.emission.is_some())
    };
    for surface in surfaces.iter().filter(shines) {
        known.push(&materials[surface.material].name);
        known.extend(nodes.above(Some(surface.node)));
    }
    known.sort_unstable();
    known.dedup();
    let mut taken: BTreeMap<&str, &str> = BTreeMap::new();
    for (layer, lamps) in wishes {
        for lamp in lamps {
            let first = *taken.entry(lamp).or_insert(layer);
            if first != layer {
                let what = format!("'{}' is in layer '{}' already", short(lamp), short(first));
                let place = format!("layer '{}'", short(layer));
                check.stranger(
                    unknown,
                    &place,
                    what,
                    "name a lamp in one layer only".into(),
                );
            }
        }
        for lamp in lamps.iter().filter(|lamp| !known.contains(&lamp.as_str())) {
            // The sky may be left out at any time.
            if lamp == SKY || lamp == SUN {
                continue;
            }
            let place = format!("layer '{}'", short(layer));
            let what = format!("no lamp, and no node with one, is named '{}'", short(lamp));
            let near = nearest_of(lamp, &known);
            let next = match near.is_empty() {
                true => "the room has no lamps: take the layers out".to_owned(),
                false => format!("the nearest names are {}", near.join(", ")),
            };
            check.stranger(unknown, &place, what, next);
        }
    }
}

/// Layers and spectra as they are found.
struct Split<'a> {
    wishes: &'a [LayerWish],
    names: Vec<String>,
    /// Layer and spectrum of each new spectrum.
    pairs: Vec<(usize, usize)>,
}

impl Split<'_> {
    /// The spectrum of a lamp that goes by some names and has had the spectrum `light`.
    fn light(&mut self, names: &[&str], light: usize) -> usize {
        let has = |(_, lamps): &&LayerWish| lamps.iter().any(|lamp| names.contains(&lamp.as_str()));
        let wished = self.wishes.iter().find(has).map(|(name, _)| name.as_str());
        let name = wished.unwrap_or(names[0]);
        let layer = self.names.iter().position(|n| n == name);
        let layer = layer.unwrap_or_else(|| {
            self.names.push(name.to_owned());
            self.names.len() - 1
        });
        let pair = (layer, light);
        let known = self.pairs.iter().position(|p| *p == pair);
        known.unwrap_or_else(|| {
            self.pairs.push(pair);
            self.pairs.len() - 1
        })
    }
}

impl Scene {
    /// Parts the lamps into layers: those that the side file names, and one for every other lamp.
    ///
    /// ```
    /// use haarlight::scene::{Options, Scene};
    /// let mut room = Scene::load("scenes/gallery.glb", &Options::default())?;
    /// room.part_lamps()?;
    /// let layers = room.changes.layers.as_ref().unwrap();
    /// assert!(layers.names.len() > 1);
    /// assert_eq!(layers.of_light.len(), room.spectra.len());
    /// # Ok::<(), haarlight::Error>(())
    /// ```
    ///
    /// # Errors
    /// There are more than [`MOST_LAYERS`].
    pub fn part_lamps(&mut self) -> Result<()> {
        if self.changes.layers.is_some() {
            return Ok(());
        }
        let nodes = Nodes::new(&self.source.json);
        let (wishes, spectra) = (self.changes.layers_wished.clone(), self.spectra.clone());
        let mut split = Split {
            wishes: &wishes,
            names: Vec::new(),
            pairs: Vec::new(),
        };
        let unseen = self.part_surfaces(&nodes, &mut split);
        let surfaces = &self.surfaces;
        for light in &mut self.lights {
            let to = split.light(&names_of_light(light, surfaces, &nodes), light.light);
            light.light = to;
        }
        let Split {
            names, mut pairs, ..
        } = split;
        if pairs.is_empty() {
            return Ok(());
        }
        self.part_fluorescence(names.len(), &mut pairs);
        // What no surface shows gives no light: it keeps its spectrum where there is a copy of it.
        for k in unseen {
            if let Some(emission) = &mut self.materials[k].emission {
                let copy = pairs.iter().position(|pair| pair.1 == emission.light);
                emission.light = copy.unwrap_or(0);
            }
        }
        if pairs.len() > MOST_LAYERS {
            let listed: Vec<String> = names.iter().take(MOST_LAYERS).map(|n| short(n)).collect();
            return Err(Error::input(
                self.source.path.display().to_string(),
                format!(
                    "its lamps make {} layers of {} light spectra ({}, ...), and there may be {MOST_LAYERS}: a row of light has \
                     64 numbers, which all of them share",
                    names.len(),
                    pairs.len(),
                    listed.join(", ")
                ),
                "put lamps together under \"layers\" in the file of spectra: {\"layers\": {\"NAME\": [\"LAMP\", ...]}}",
            ));
        }
        let copy = |&(layer, light): &(usize, usize)| LightSpectrum {
            name: format!("{} ({})", spectra[light].name, names[layer]),
            power: spectra[light].power,
        };
        self.spectra = pairs.iter().map(copy).collect();
        let (of_light, kin) = pairs.into_iter().unzip();
        self.changes.layers = Some(Layers {
            names,
            of_light,
            kin,
        });
        Ok(())
    }

    /// What fluoresces does so for each layer by itself: with copies of its spectra, each excited by light of its layer alone.
    fn part_fluorescence(&mut self, layers: usize, pairs: &mut Vec<(usize, usize)>) {
        let materials = self.materials.iter_mut();
        for fluorescence in materials.filter_map(|m| m.fluorescence.as_mut()) {
            let as_read = std::mem::take(&mut fluorescence.terms);
            for layer in 0..layers {
                for term in &as_read {
                    let pair = (layer, term.light);
                    let known = pairs.iter().position(|p| *p == pair);
                    let light = known.unwrap_or_else(|| {
                        pairs.push(pair);
                        pairs.len() - 1
                    });
                    fluorescence.terms.push(Term {
                        light,
                        layer: Some(layer),
                        ..term.clone()
                    });
                }
            }
        }
    }

    /// Gives surfaces that shine the spectra of their layers; a material in several layers gets copies. Returns the materials
    /// that no surface shows.
    fn part_surfaces(&mut self, nodes: &Nodes, split: &mut Split) -> Vec<usize> {
        // Material as read and new spectrum to material as written.
        let mut copies: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let as_read = self.materials.len();
        for surface in &mut self.surfaces {
            let read = surface.material;
            let Some(emission) = &self.materials[read].emission else {
                continue;
            };
            let old = match copies.keys().find(|(material, _)| *material == read) {
                // Its emission was changed already.
                Some(_) => split.pairs[emission.light].1,
                None => emission.light,
            };
            let names: Vec<&str> = std::iter::once(self.materials[read].name.as_str())
                .chain(nodes.above(Some(surface.node)))
                .collect();
            let light = split.light(&names, old);
            let first = !copies.keys().any(|(material, _)| *material == read);
            let place = *copies.entry((read, light)).or_insert_with(|| {
                let place = if first { read } else { self.materials.len() };
                if !first {
                    self.materials.push(self.materials[read].clone());
                }
                if let Some(emission) = &mut self.materials[place].emission {
                    emission.light = light;
                }
                place
            });
            surface.material = place;
        }
        let shown: BTreeSet<usize> = copies.into_keys().map(|(read, _)| read).collect();
        (0..as_read).filter(|k| !shown.contains(k)).collect()
    }
}
