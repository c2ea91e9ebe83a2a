//! What is changed in a room on the user's wish once it is read: its scale, and faces that look the wrong way.
//!
//! The document stays as it is, so that what is written has the file's units; turned faces are written turned.

use super::pane::PaneKind;
use super::{Projection, Scene, luminaires};
use glam::{DMat4, DVec3};
use std::collections::BTreeSet;

/// What was changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// Metres for each unit of the file, as the user says.
    pub scale: f64,
    /// Surfaces whose faces were turned.
    pub flipped: BTreeSet<usize>,
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            scale: 1.0,
            flipped: BTreeSet::new(),
        }
    }
}

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
