//! A room under its sky alone: what daylight factors are taken from.

use super::LIT_GROUND;
use crate::color::{KM, Observer};
use crate::data::LEAVES;
use crate::scene::{LightKind, PunctualLight, Scene};

/// Is a light the sky, or the ground that the sky lights?
fn is_of_sky(light: &PunctualLight) -> bool {
    light.kind.is_dome() && light.name != LIT_GROUND
}

impl Scene {
    /// Illuminance of open level ground by the sky without the sun, lx; none without a sky.
    pub fn sky_illuminance(&self) -> Option<f64> {
        self.sky.as_ref()?;
        let y = Observer::cie1931().weights(&self.grid)[1];
        let lux = |light: &PunctualLight| {
            let power = &self.spectra[light.light].power;
            let leaves = power.iter().zip(&light.shape).zip(&y);
            leaves.map(|((p, s), y)| KM * p * s * y).sum::<f64>()
        };
        let is_sky = |light: &&PunctualLight| matches!(light.kind, LightKind::Sky(_));
        let parts: Vec<f64> = self.lights.iter().filter(is_sky).map(lux).collect();
        (!parts.is_empty()).then(|| parts.iter().sum())
    }

    /// The room with all lamps dark but the sky and the ground that it lights; none where there are no others.
    #[must_use]
    pub fn under_sky_alone(&self) -> Option<Self> {
        let mut scene = self.clone();
        let mut others = false;
        for light in scene.lights.iter_mut().filter(|l| !is_of_sky(l)) {
            others |= light.shape.iter().any(|&x| x > 0.0);
            light.shape = [0.0; LEAVES];
        }
        for emission in scene
            .materials
            .iter_mut()
            .filter_map(|m| m.emission.as_mut())
        {
            others |= emission.shape.iter().any(|&x| x > 0.0);
            emission.shape = [0.0; LEAVES];
            emission.scale = 0.0;
        }
        others.then_some(scene)
    }
}
