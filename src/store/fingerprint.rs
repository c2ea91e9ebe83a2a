//! What a room is made of, part by part, as hashes: is it the same room, and if not, what changed?
//!
//! Two lists: *shape* is what decides who sees whom (surfaces in world space with their normals, sides and holes, which of them are
//! mirrors, panes and their thickness, places and cones of lights); *paint* is everything else that decides the light
//! (reflectances, textures, spectra of panes and lights, powers, wavelengths). Names are kept for messages only: a part that was renamed
//! is the same part.

use super::codec::{Decoder, Encoder, Plain, Read};
use crate::scene::pane::{Pane, PaneKind};
use crate::scene::sky::Dome;
use crate::scene::{Alpha, LightKind, Scene, Sides, Surface, Texture};
use std::collections::BTreeMap;
use std::io;
use xxhash_rust::xxh64::Xxh64;

/// Changes that a message names; the others are counted.
const NAMED: usize = 4;

/// The parts of something and their hashes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Fingerprint {
    parts: Vec<(String, u64)>,
}

/// A hash of plain numbers.
#[derive(Default)]
struct Mix(Xxh64);

impl Mix {
    fn add<T: Plain>(&mut self, x: T) -> &mut Self {
        self.all(&[x])
    }

    fn all<T: Plain>(&mut self, list: &[T]) -> &mut Self {
        let mut buffer = [0; 4096];
        let each = buffer.len() / T::SIZE;
        for part in list.chunks(each) {
            for (x, to) in part.iter().zip(buffer.chunks_exact_mut(T::SIZE)) {
                x.store(to);
            }
            self.0.update(&buffer[..part.len() * T::SIZE]);
        }
        // Lists that follow each other must not run together.
        self.0.update(&(list.len() as u64).to_le_bytes());
        self
    }

    fn text(&mut self, text: &str) -> &mut Self {
        self.all(text.as_bytes())
    }

    fn texture(&mut self, texture: &Texture, images: &[u64]) -> &mut Self {
        let wrap = texture.wrap.map(|w| w as u8);
        self.add(images[texture.image])
            .add(texture.texcoord as u64)
            .add(texture.transform)
            .add(wrap)
    }
}

impl Mix {
    /// How light of a kind is spread by a sky.
    fn dome(&mut self, kind: LightKind, dome: &Dome) {
        match (kind, dome) {
            (LightKind::Sky(_), Dome::Cie(sky)) => {
                let luminance = sky.luminance();
                self.add(luminance.kind()).add(luminance.sun().to_array());
            }
            (LightKind::Sky(_), Dome::Spectral(sky)) => {
                self.add(sky.model().air())
                    .add(sky.model().sun().to_array());
            }
            (LightKind::Sky(_) | LightKind::Ground(_), Dome::Map(map)) => {
                self.all(map.texels()).add(map.north());
            }
            _ => {}
        }
    }

    /// What of a pane is found where a ray passes it: thickness, value of the texture.
    fn pane_places(&mut self, pane: &Pane, surface: &Surface, images: &[u64]) {
        match &pane.kind {
            // How far light goes through a solid depends on how it is refracted.
            PaneKind::Glass {
                ior,
                unit,
                thickness,
                ..
            } => self.add([*ior, unit.unwrap_or(0.0), *thickness]),
            PaneKind::Cover { .. } => {
                let alpha = surface.colors.iter().flatten().map(|c| c[3]);
                self.all(&alpha.collect::<Vec<f32>>())
            }
        };
        if let Some(texture) = &pane.texture {
            self.texture(texture, images);
            if let Some(uvs) = surface.texcoords.get(texture.texcoord) {
                self.all(uvs);
            }
        }
    }

    /// What a pane leaves of light that passes it there.
    fn pane_colour(&mut self, pane: &Pane) {
        self.add(*pane.spectrum());
        match pane.kind {
            PaneKind::Glass { share, .. } => self.add(share),
            PaneKind::Cover { alpha, .. } => self.add(alpha),
        };
    }
}

impl Fingerprint {
    /// What decides who sees whom.
    pub fn shape(scene: &Scene) -> Self {
        let mut print = Self::default();
        let images = images(scene);
        for (k, surface) in scene.surfaces.iter().enumerate() {
            let material = &scene.materials[surface.material];
            let mut mix = Mix::default();
            let positions: Vec<[f64; 3]> = surface.positions.iter().map(|p| p.to_array()).collect();
            mix.all(&positions).all(&surface.triangles);
            if let Some(normals) = &surface.normals {
                let normals: Vec<[f32; 3]> = normals.iter().map(|n| n.to_array()).collect();
                mix.all(&normals);
            }
            mix.add(u8::from(scene.sides(k) == Sides::Both));
            // Both sides of a sheet are split together.
            if material.sheet.is_some() {
                mix.add(2_u8);
            }
            if let Alpha::Mask {
                cutoff,
                factor,
                texture,
            } = &material.alpha
            {
                mix.add([*cutoff, *factor]);
                let alpha = surface.colors.iter().flatten().map(|c| c[3]);
                mix.all(&alpha.collect::<Vec<f32>>());
                if let Some(texture) = texture {
                    mix.texture(texture, &images);
                    if let Some(uvs) = surface.texcoords.get(texture.texcoord) {
                        mix.all(uvs);
                    }
                }
            }
            // What light passes is kept by the numbers of materials.
            if material.mirror.is_some() {
                mix.add(3_u8).add(surface.material as u64);
            }
            print.add(format!("surface {}", surface.name), &mix);
        }
        print.panes(scene, &images);
        for light in &scene.lights {
            let mut mix = Mix::default();
            let kind = match light.kind {
                LightKind::Point => [0.0; 3],
                LightKind::Spot { inner, outer } => [1.0, inner, outer],
                LightKind::Directional => [2.0, 0.0, 0.0],
                LightKind::Profile => [6.0, 0.0, 0.0],
                LightKind::Surface => [7.0, 0.0, 0.0],
                LightKind::Sun => [3.0, 0.0, 0.0],
                LightKind::Sky(part) => [4.0, f64::from(part), 0.0],
                LightKind::Ground(part) => [5.0, f64::from(part), 0.0],
            };
            mix.add(kind).add(light.direction.to_array());
            if !light.kind.is_parallel() {
                mix.add(light.position.to_array());
            }
            if let Some(sky) = &scene.sky {
                mix.dome(light.kind, &sky.dome);
            }
            let mut what = "place";
            if let Some(luminaire) = &light.luminaire {
                what = "place or profile";
                mix.all(&luminaire.numbers());
                mix.add(luminaire.profile.angles.letter() as u8);
                for numbers in luminaire.profile.numbers() {
                    mix.all(numbers);
                }
            }
            print.add(format!("{what} of light '{}'", light.name), &mix);
        }
        print
    }

    /// Adds where panes are, and what of them is found where a ray passes them.
    fn panes(&mut self, scene: &Scene, images: &[u64]) {
        for pane in &scene.panes {
            let mut mix = Mix::default();
            let positions: Vec<[f64; 3]> = pane.positions.iter().map(|p| p.to_array()).collect();
            mix.all(&positions)
                .all(&pane.triangles)
                .add(pane.material as u64);
            if let Some(of) = &scene.materials[pane.material].pane {
                mix.pane_places(of, pane, images);
            }
            self.add(format!("pane {}", pane.name), &mix);
        }
    }

    /// What else decides the light.
    pub fn paint(scene: &Scene) -> Self {
        let mut print = Self::default();
        let images = images(scene);
        print.set("wavelengths", &[scene.grid.start(), scene.grid.end()]);
        for spectrum in &scene.spectra {
            print.set(&format!("spectrum '{}'", spectrum.name), &spectrum.power);
        }
        for m in &scene.materials {
            let mut mix = Mix::default();
            mix.add(m.reflectance)
                .add(m.base_color)
                .add(u8::from(m.vertex_paint));
            if let Some(texture) = &m.paint {
                mix.texture(texture, &images);
            }
            if let Some(sheet) = &m.sheet {
                mix.add(sheet.transmittance)
                    .add(sheet.strength)
                    .add(u8::from(sheet.shares))
                    .add(sheet.color.unwrap_or_default());
                if let Some(back) = sheet.back {
                    mix.add(back);
                }
                for texture in [&sheet.strength_texture, &sheet.color_texture] {
                    // Which of the two it is shows by its place.
                    mix.add(u8::from(texture.is_some()));
                    if let Some(texture) = texture {
                        mix.texture(texture, &images);
                    }
                }
            }
            if let Some(e) = &m.emission {
                mix.add(e.light as u64)
                    .add(e.shape)
                    .add(e.color)
                    .add(e.scale);
                if let Some(texture) = &e.texture {
                    mix.texture(texture, &images);
                }
            }
            for term in m.fluorescence.iter().flat_map(|f| &f.terms) {
                mix.add(term.light as u64).add(term.excitation);
            }
            if let Some(pane) = &m.pane {
                mix.pane_colour(pane);
            }
            if let Some(mirror) = &m.mirror {
                mix.add(mirror.reflectance);
            }
            print.add(format!("material '{}'", m.name), &mix);
        }
        for light in &scene.lights {
            let mut mix = Mix::default();
            mix.add(light.light as u64).add(light.shape);
            print.add(format!("light '{}'", light.name), &mix);
        }
        for surface in &scene.surfaces {
            let mut mix = Mix::default();
            mix.add(surface.material as u64);
            for uvs in &surface.texcoords {
                mix.all(uvs);
            }
            if let Some(colors) = &surface.colors {
                mix.all(colors);
            }
            print.add(format!("paint of surface {}", surface.name), &mix);
        }
        print
    }

    /// Adds a part made of numbers.
    pub fn set<T: Plain>(&mut self, name: &str, numbers: &[T]) {
        let mut mix = Mix::default();
        mix.all(numbers);
        self.add(name.to_owned(), &mix);
    }

    /// Adds a part made of text.
    pub fn set_text(&mut self, name: &str, text: &str) {
        let mut mix = Mix::default();
        mix.text(text);
        self.add(name.to_owned(), &mix);
    }

    /// Adds all parts of another.
    pub fn extend(&mut self, other: Self) {
        self.parts.extend(other.parts);
    }

    fn add(&mut self, name: String, mix: &Mix) {
        self.parts.push((name, mix.0.digest()));
    }

    /// What is different in `now`, in words; none if it is the same.
    pub fn change(&self, now: &Self) -> Option<String> {
        let hashes = |print: &Self| print.parts.iter().map(|p| p.1).collect::<Vec<u64>>();
        if hashes(self) == hashes(now) {
            return None;
        }
        let (before, after) = (self.by_name(), now.by_name());
        let mut changes: Vec<String> = Vec::new();
        for (name, hash) in &after {
            match before.get(name) {
                None => changes.push(format!("{name} is new")),
                Some(old) if old != hash => changes.push(format!("{name} changed")),
                Some(_) => {}
            }
        }
        let gone = before.keys().filter(|name| !after.contains_key(*name));
        changes.extend(gone.map(|name| format!("{name} is gone")));
        if changes.is_empty() {
            changes.push("the order of its parts changed".into());
        }
        let more = changes.len().saturating_sub(NAMED);
        changes.truncate(NAMED);
        let mut text = changes.join(", ");
        if more > 0 {
            text.push_str(&format!(" and {more} more"));
        }
        Some(text)
    }

    /// Hashes by name; parts of one name are numbered.
    fn by_name(&self) -> BTreeMap<String, u64> {
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        let mut all = BTreeMap::new();
        for (name, hash) in &self.parts {
            let n = count.entry(name).or_default();
            *n += 1;
            let name = if *n == 1 {
                name.clone()
            } else {
                format!("{name} ({n})")
            };
            all.insert(name, *hash);
        }
        all
    }

    /// Writes it down.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn encode(&self, out: &mut Encoder) -> io::Result<()> {
        out.put(self.parts.len() as u64)?;
        for (name, hash) in &self.parts {
            out.put_text(name)?;
            out.put(*hash)?;
        }
        Ok(())
    }

    /// Reads it back.
    ///
    /// # Errors
    /// [`Broken`](super::Broken).
    pub fn decode(from: &mut Decoder) -> Read<Self> {
        let count: u64 = from.get()?;
        let mut parts = Vec::new();
        for _ in 0..count {
            parts.push((from.get_text()?, from.get()?));
        }
        Ok(Self { parts })
    }
}

/// A hash of each image.
fn images(scene: &Scene) -> Vec<u64> {
    scene
        .images
        .iter()
        .map(|image| {
            let mut mix = Mix::default();
            mix.add([image.width as u64, image.height as u64])
                .all(&image.pixels);
            mix.0.digest()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Options;
    use crate::scene::sky::{SkyBrightness, SkyWish, SunWish};
    use proptest::prelude::*;

    fn room() -> Scene {
        Scene::load("scenes/furnished.glb", &Options::default()).unwrap()
    }

    #[test]
    fn shape_and_paint_are_told_apart() {
        let (shape, paint) = (Fingerprint::shape(&room()), Fingerprint::paint(&room()));
        assert_eq!(shape.change(&Fingerprint::shape(&room())), None);
        let seen = |scene: &Scene| {
            (
                shape.change(&Fingerprint::shape(scene)),
                paint.change(&Fingerprint::paint(scene)),
            )
        };

        let mut moved = room();
        moved.surfaces[3].positions[0].x += 1e-9;
        let (what, nothing) = seen(&moved);
        assert!(what.unwrap().contains(&moved.surfaces[3].name));
        assert_eq!(nothing, None);

        let mut painted = room();
        painted.materials[1].reflectance[30] += 1e-6;
        painted.lights[0].shape[3] *= 2.0;
        let (nothing, what) = seen(&painted);
        assert_eq!(nothing, None);
        let name = &painted.materials[1].name;
        assert_eq!(
            what.unwrap(),
            format!(
                "light '{}' changed, material '{name}' changed",
                painted.lights[0].name
            )
        );

        let mut turned = room();
        turned.lights[1].direction = glam::DVec3::X;
        let (what, nothing) = seen(&turned);
        assert!(what.unwrap().contains(&turned.lights[1].name));
        assert_eq!(nothing, None);

        let mut fewer = room();
        let gone = fewer.surfaces.pop().unwrap();
        assert!(
            seen(&fewer)
                .0
                .unwrap()
                .contains(&format!("surface {} is gone", gone.name))
        );

        let mut texel = room();
        texel.images[0].pixels[7][1] += 0.25;
        assert!(seen(&texel).1.is_some());

        let mut renamed = room();
        renamed.surfaces[0].name = "other".into();
        assert_eq!(seen(&renamed), (None, None));
    }

    /// How a sky spreads its light is shape, with the same light on open ground.
    #[test]
    fn another_turbidity_is_another_shape() {
        let shape = |turbidity: f64| {
            let wish = SkyWish {
                turbidity: Some(turbidity),
                brightness: Some(SkyBrightness::Illuminance(100.0)),
                sun: SunWish {
                    place: Some("40,200".parse().unwrap()),
                    ..SunWish::default()
                },
                ..SkyWish::default()
            };
            Fingerprint::shape(&room().under(&wish).unwrap())
        };
        assert_eq!(shape(3.0).change(&shape(3.0)), None);
        let what = shape(3.0).change(&shape(4.0)).unwrap();
        assert!(what.contains("light 'sky, bluest'"), "{what}");
    }

    /// Where panes and mirrors are is shape, what they do to light is paint.
    #[test]
    fn panes_and_mirrors_are_known() {
        let of = |name: &str| Scene::load(name, &Options::default()).unwrap();
        let changes = |name: &str, change: &dyn Fn(&mut Scene)| {
            let mut other = of(name);
            change(&mut other);
            let shape = Fingerprint::shape(&of(name)).change(&Fingerprint::shape(&other));
            let paint = Fingerprint::paint(&of(name)).change(&Fingerprint::paint(&other));
            [shape.is_some(), paint.is_some()]
        };
        let glazed = |change: &dyn Fn(&mut Pane)| {
            changes("scenes/glazed.glb", &|scene| {
                let used = scene.panes[0].material;
                change(scene.materials[used].pane.as_mut().unwrap());
            })
        };
        let moved = |scene: &mut Scene| scene.panes[0].positions[1].y += 0.1;
        assert_eq!(changes("scenes/glazed.glb", &moved), [true, false]);
        let tinted = glazed(&|pane| match &mut pane.kind {
            PaneKind::Glass { inside, .. } => inside[7] *= 0.5,
            PaneKind::Cover { colour, .. } => colour[7] *= 0.5,
        });
        assert_eq!(tinted, [false, true]);
        let dull = |scene: &mut Scene| scene.materials.iter_mut().for_each(|m| m.mirror = None);
        assert_eq!(changes("scenes/mirrored.glb", &dull), [true, true]);
        let dim = |scene: &mut Scene| {
            for mirror in scene.materials.iter_mut().filter_map(|m| m.mirror.as_mut()) {
                mirror.reflectance[7] *= 0.5;
            }
        };
        assert_eq!(changes("scenes/mirrored.glb", &dim), [false, true]);
    }

    proptest! {
        #[test]
        fn it_survives_being_written(names in prop::collection::vec(("\\PC{0,8}", any::<u64>()), 0..9)) {
            let mut print = Fingerprint::default();
            for (name, number) in &names {
                print.set(name, &[*number]);
            }
            let mut bytes = Vec::new();
            print.encode(&mut Encoder::new(&mut bytes)).unwrap();
            prop_assert_eq!(Fingerprint::decode(&mut Decoder::new(&bytes)).unwrap(), print);
        }
    }
}
