//! A room under its sky alone: what daylight factors are taken from.

use super::LIT_GROUND;
use crate::color::{KM, Observer};
use crate::data::{BANDS, Spectrum};
use crate::scene::{LightKind, Material, PunctualLight, Scene};

/// Is a light the sky, or the ground that the sky lights?
fn is_of_sky(light: &PunctualLight) -> bool {
    light.kind.is_dome() && light.name != LIT_GROUND
}

impl Scene {
    /// Illuminance of open level ground by the sky without the sun, lx; none without a sky.
    pub fn sky_illuminance(&self) -> Option<f64> {
        self.sky.as_ref()?;
        let lux = |light: &PunctualLight| self.tristimulus(light)[1];
        let is_sky = |light: &&PunctualLight| matches!(light.kind, LightKind::Sky(_));
        let parts: Vec<f64> = self.lights.iter().filter(is_sky).map(lux).collect();
        (!parts.is_empty()).then(|| parts.iter().sum())
    }

    /// Tristimulus value of what a light's [`shape`](PunctualLight::shape) says, Y in its photometric unit.
    pub(crate) fn tristimulus(&self, light: &PunctualLight) -> [f64; 3] {
        let power = &self.spectra[light.light].power;
        Observer::cie1931().weights(&self.grid).map(|weights| {
            let bands = power.iter().zip(&light.shape).zip(weights);
            bands.map(|((p, s), weight)| KM * p * s * weight).sum()
        })
    }

    /// Light spectra that only the sky and the ground that it lights shine by; none where other lamps share one of them, and where
    /// something fluoresces: what it gives out is not told apart by what excites it.
    pub(crate) fn spectra_of_sky_alone(&self) -> Option<Vec<usize>> {
        let of_sky = |own: bool| {
            let lights = self.lights.iter().filter(move |l| is_of_sky(l) == own);
            lights.map(|l| l.light)
        };
        let emitted = (self.materials.iter()).filter_map(|m| Some(m.emission.as_ref()?.light));
        let others: Vec<usize> = of_sky(false).chain(emitted).collect();
        let own: Vec<usize> = of_sky(true).collect();
        let fluoresces = self.materials.iter().any(|m| m.fluorescence.is_some());
        let apart = !fluoresces && !own.iter().any(|light| others.contains(light));
        apart.then_some(own)
    }

    /// Does anything shine but the sky and the ground that it lights?
    pub(crate) fn shines_beside_sky(&self) -> bool {
        let bright = |shape: &Spectrum| shape.iter().any(|&x| x > 0.0);
        let emission = |m: &Material| m.emission.as_ref().is_some_and(|e| bright(&e.shape));
        (self.lights.iter()).any(|l| !is_of_sky(l) && bright(&l.shape))
            || self.materials.iter().any(emission)
    }

    /// The room with all lamps dark but the sky and the ground that it lights; none where there are no others.
    #[must_use]
    pub fn under_sky_alone(&self) -> Option<Self> {
        if !self.shines_beside_sky() {
            return None;
        }
        let mut scene = self.clone();
        for light in scene.lights.iter_mut().filter(|l| !is_of_sky(l)) {
            light.shape = [0.0; BANDS];
        }
        let emissions = scene
            .materials
            .iter_mut()
            .filter_map(|m| m.emission.as_mut());
        for emission in emissions {
            emission.shape = [0.0; BANDS];
            emission.scale = 0.0;
        }
        Some(scene)
    }
}
