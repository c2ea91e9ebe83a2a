//! What is changed in a room on the user's wish once it is read: its scale, faces that look the wrong way, lamps.
//!
//! The document stays as it is, so that what is written has the file's units; turned faces are written turned.

use super::json::short;
use super::lamp_spectra::GREATEST_SIZE;
use super::pane::PaneKind;
pub use super::room::Changes;
use super::{Projection, Scene, luminaires};
use crate::color::{KM, Observer};
use crate::data::{Spectrum, nearest_of};
use crate::error::{Error, Result};
use glam::{DMat4, DVec3};

impl Scene {
    /// Multiplies all positions (surfaces, lights, cameras) by `factor`. Lamps keep their luminance and candela.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        let larger = DMat4::from_scale(DVec3::splat(factor));
        for surface in self.surfaces.iter_mut().chain(&mut self.panes) {
            surface.positions.iter_mut().for_each(|p| *p *= factor);
            surface.to_world = larger * surface.to_world;
        }
        for pane in self.materials.iter_mut().filter_map(|m| m.pane.as_mut()) {
            if let PaneKind::Glass {
                unit: Some(unit), ..
            } = &mut pane.kind
            {
                // Thicknesses of solids are measured in the room; that of a lone face keeps its number of units.
                *unit *= factor;
            }
        }
        for light in &mut self.lights {
            light.position *= factor;
        }
        let emissions = self
            .materials
            .iter_mut()
            .filter_map(|m| m.emission.as_mut());
        for emission in emissions.filter(|emission| emission.profile.is_some()) {
            // The same lumens from another area.
            emission.shape = emission.shape.map(|x| x / (factor * factor));
            emission.scale /= factor * factor;
        }
        for camera in &mut self.cameras {
            // Only its place: a camera's axes keep their length.
            let place = camera.to_world.w_axis.truncate() * factor;
            camera.to_world.w_axis = place.extend(1.0);
            if let Projection::Orthographic(half) = &mut camera.projection {
                *half *= factor;
            }
        }
        if factor != 1.0 {
            luminaires::remount(&mut self);
        }
        self.changes.scale *= factor;
        self
    }

    /// Multiplies the light of every lamp of this name (a material that gives out light, or a light) by `factor`. At 0 it is
    /// dark, but still a lamp: it may be lit again where it is not multiplied but read anew.
    ///
    /// ```
    /// use haarlight::scene::{Options, Scene, facts::Facts};
    /// let mut room = Scene::load("scenes/convex.glb", &Options::default())?;
    /// let lamp = |room: &Scene| Facts::of(room).lights[0].clone();
    /// let before = lamp(&room);
    /// room.dim(&before.name, 0.25)?;
    /// assert_eq!(lamp(&room).flux_lm, before.flux_lm.map(|lm| 0.25 * lm));
    /// assert!(room.dim("no such lamp", 0.25).is_err());
    /// # Ok::<(), haarlight::Error>(())
    /// ```
    ///
    /// # Errors
    /// There is no such lamp, or the factor is negative, not finite, or makes more light than can be reckoned with.
    pub fn dim(&mut self, name: &str, factor: f64) -> Result<()> {
        let place = format!("{}: lamp '{}'", self.source.path.display(), short(name));
        let luminous = Observer::cie1931().weights(&self.grid)[1].map(|y| KM * y);
        let (mut shapes, mut names, mut scales) = (Vec::new(), Vec::new(), Vec::new());
        for material in &mut self.materials {
            let Some(emission) = &mut material.emission else {
                continue;
            };
            if material.name == name {
                shapes.push((emission.light, &mut emission.shape));
                scales.push(&mut emission.scale);
            }
            names.push(material.name.clone());
        }
        for light in &mut self.lights {
            if light.name == name {
                shapes.push((light.light, &mut light.shape));
            }
            names.push(light.name.clone());
        }
        if shapes.is_empty() {
            let near = nearest_of(name, &names).join(", ");
            let what = "the room has no lamp of that name";
            return Err(Error::input(
                place,
                what,
                format!("the nearest names are {near}"),
            ));
        }
        let size = |(light, shape): &(usize, &mut Spectrum)| -> f64 {
            let power = self.spectra[*light].power.iter();
            let bands = power.zip(shape.iter()).zip(&luminous);
            bands.map(|((p, s), y)| p * s * y).sum()
        };
        let greatest = shapes.iter().map(size).fold(0.0, f64::max);
        // Written so that NaN fails.
        if !(factor >= 0.0 && factor * greatest.max(1.0) <= GREATEST_SIZE) {
            let what = format!("cannot be made {factor} times as bright");
            let next = "give a factor of at least 0 that leaves it below 1e15 cd/m2, cd or lx";
            return Err(Error::input(place, what, next));
        }
        for (_, shape) in shapes {
            shape.iter_mut().for_each(|s| *s *= factor);
        }
        scales.into_iter().for_each(|scale| *scale *= factor);
        Ok(())
    }

    /// Turns all faces of these surfaces round.
    pub fn flip(&mut self, surfaces: impl IntoIterator<Item = usize>) {
        for k in surfaces {
            let Some(surface) = self.surfaces.get_mut(k) else {
                continue;
            };
            surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            for normal in surface.normals.iter_mut().flatten() {
                *normal = -*normal;
            }
            self.solids.remove(&k);
            if !self.changes.flipped.remove(&k) {
                self.changes.flipped.insert(k);
            }
        }
        luminaires::remount(self);
    }

    /// Was the surface turned?
    pub fn is_flipped(&self, surface: usize) -> bool {
        self.changes.flipped.contains(&surface)
    }
}
