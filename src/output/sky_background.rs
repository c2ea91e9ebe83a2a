//! What pictures show where no surface is: the sky and the ground below it, where a sky is described. Panes before them are looked past.

use crate::scene::Scene;
use crate::scene::sky::{PLACES, Sky};
use glam::DVec3;

/// What is seen beyond a room.
pub(super) struct SkyBackground<'a> {
    sky: &'a Sky,
    /// Tristimulus value of the lamp of each part.
    parts: [[f64; 3]; PLACES],
}

impl<'a> SkyBackground<'a> {
    /// None where no sky is described.
    pub(super) fn new(scene: &'a Scene) -> Option<Self> {
        let sky = scene.sky.as_ref()?;
        let mut parts = [[0.0; 3]; PLACES];
        for light in &scene.lights {
            if let Some(place) = light.kind.place() {
                parts[place] = scene.tristimulus(light);
            }
        }
        Some(Self { sky, parts })
    }

    /// Tristimulus radiance from a direction, Y in cd/m2. The sun's disc is not drawn.
    pub(super) fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let (first, radiance) = self.sky.radiance(direction);
        let parts = self.parts[first..].iter().zip(radiance);
        parts.fold([0.0; 3], |sum, (part, radiance)| {
            [0, 1, 2].map(|c| sum[c] + radiance * part[c])
        })
    }
}
