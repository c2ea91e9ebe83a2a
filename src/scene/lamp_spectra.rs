//! The distinct light spectra of a room, and the part that each lamp has in them.
//!
//! A lamp is `power(band) * shape(band)`: `power` is shared by all lamps of one kind ([`LightSpectrum`], here always of
//! luminous size 1: `683 lm/W * sum power * y_bar = 1`), `shape` is the lamp's own. A lamp with a measured or named
//! spectrum has a constant shape, its luminance (cd/m2), intensity (cd) or illuminance (lx). A lamp given by a colour
//! is D65 shaped by the upsampled colour; its luminous size is glTF's strength or intensity times the luminance Y of
//! the linear colour, so that a lamp keeps its brightness when it gets a spectrum instead. If all lamps given by
//! colour have one and the same colour, the colour goes into the shared power: one kind of lamp, one light spectrum.

use super::check::Check;
use super::reader::Sampled;
use super::{LightSpectrum, Material, PunctualLight};
use crate::color::{KM, Observer, Upsampler};
use crate::data::{BANDS, Grid, Outside, Spectrum, named};

/// Name of the spectrum of all lamps that are given by colour.
const BY_COLOUR: &str = "cie/D65";

/// Greatest component of a lamp's colour before it is upsampled. An emission has no bound of 1, and darker colours have
/// smoother spectra: at 1 a saturated lamp would come out as a box.
const LAMP_BRIGHTNESS: f64 = 0.5;

/// Brighter lamps (cd/m2, cd, lx) are an input fault. Light is carried in f32, up to 3e38; squares of it are summed, and
/// near a lamp, or where an albedo of .999 holds the light, it is a thousand times as strong. The sun has 2e9 cd/m2.
pub(crate) const GREATEST_SIZE: f64 = 1e15;

/// Says so where a lamp's luminous size is not one that can be carried; true where it is.
pub(crate) fn bearable(size: f64, unit: &str, place: &str, check: &mut Check) -> bool {
    // Written so that NaN fails.
    let bears = size <= GREATEST_SIZE;
    if !bears {
        let what = format!("gives out {size:.3e} {unit}, more than can be reckoned with");
        let next = format!("give at most {GREATEST_SIZE:e} {unit} (the sun has 2e9 cd/m2)");
        check.problem(place, what, next);
    }
    bears
}

/// Shapes of one colour differ by no more than this, relative.
const SAME_SHAPE: f64 = 1e-9;

/// A lamp's part: which spectrum, and what to multiply it by.
#[derive(Debug, Clone)]
pub(crate) struct ScaledSpectrum {
    /// Index in [`LampSpectra::spectra`].
    pub(crate) light: usize,
    /// Multiplier for each band.
    pub(crate) shape: Spectrum,
    /// The colour that was upsampled, greatest component 0.5.
    pub(crate) color: [f32; 3],
    /// Multiplier of the upsampled `color`.
    pub(crate) scale: f64,
    /// In words.
    pub(crate) from: String,
}

/// The distinct light spectra of a room, in order of first use.
pub(crate) struct LampSpectra<'a> {
    pub(crate) grid: &'a Grid,
    upsampler: &'a Upsampler,
    /// KM times the nm-integrals of y_bar.
    luminous: Spectrum,
    spectra: Vec<LightSpectrum>,
    /// What materials fluoresce: no lamp's, and not of size 1.
    pub(crate) excited: Vec<LightSpectrum>,
}

impl<'a> LampSpectra<'a> {
    /// None yet.
    pub(crate) fn new(grid: &'a Grid, upsampler: &'a Upsampler) -> Self {
        let luminous = Observer::cie1931().weights(grid)[1].map(|y| KM * y);
        Self {
            grid,
            upsampler,
            luminous,
            spectra: Vec::new(),
            excited: Vec::new(),
        }
    }

    /// A lamp of a linear colour (components at least 0, one above) and a luminous size for (1, 1, 1).
    pub(crate) fn by_colour(&mut self, color: [f32; 3], size: f64) -> ScaledSpectrum {
        let brightest = color.iter().fold(0.0f32, |m, &c| m.max(c));
        let scale = f64::from(brightest) / LAMP_BRIGHTNESS;
        let color = color.map(|c| (f64::from(c) / scale) as f32);
        let scale = scale * size;
        let d65 = named(BY_COLOUR).expect("D65 is built in").table;
        let (light, _) = self.add(BY_COLOUR, self.grid.means(&d65, Outside::Hold));
        let shape = self.upsampler.reflectance(color).map(|r| r * scale);
        let [r, g, b] = color.map(|c| c / LAMP_BRIGHTNESS as f32);
        ScaledSpectrum {
            light,
            shape,
            color,
            scale,
            from: format!("colour {r:.3} {g:.3} {b:.3} of {BY_COLOUR}"),
        }
    }

    /// A lamp of a known spectrum and luminous size; none: the size of the spectrum itself.
    pub(crate) fn by_spectrum(&mut self, spectrum: &Sampled, size: Option<f64>) -> ScaledSpectrum {
        let (light, own) = self.add(&spectrum.from, spectrum.spectrum);
        let size = size.unwrap_or(own);
        let color = [LAMP_BRIGHTNESS as f32; 3];
        ScaledSpectrum {
            light,
            shape: [size; BANDS],
            color,
            scale: size / LAMP_BRIGHTNESS,
            from: spectrum.from.clone(),
        }
    }

    /// The luminous size that a spectrum has by itself.
    pub(crate) fn own_size(&self, spectrum: &Sampled) -> f64 {
        self.size_of(&spectrum.spectrum)
    }

    fn size_of(&self, power: &Spectrum) -> f64 {
        power.iter().zip(&self.luminous).map(|(p, y)| p * y).sum()
    }

    /// Shares `power`, brought to luminous size 1, among the lamps of the same spectrum; returns the size it had.
    fn add(&mut self, name: &str, power: Spectrum) -> (usize, f64) {
        let size = self.size_of(&power);
        let unit = power.map(|p| p / size);
        let same = self.spectra.iter().position(|s| s.power == unit);
        let light = same.unwrap_or_else(|| {
            self.spectra.push(LightSpectrum {
                name: name.into(),
                power: unit,
            });
            self.spectra.len() - 1
        });
        (light, size)
    }

    /// Luminance Y of a linear colour, (1, 1, 1) has 1.
    pub(crate) fn luminance(&self, color: [f32; 3]) -> f64 {
        self.upsampler.luminance(color.map(f64::from))
    }

    /// The spectra, when all lamps are known. Where all that are given by colour have one colour, it becomes part of
    /// the spectrum and their shapes become constants.
    pub(crate) fn finish(
        mut self,
        materials: &mut [Material],
        lights: &mut [PunctualLight],
    ) -> Vec<LightSpectrum> {
        let Some(light) = self.spectra.iter().position(|s| s.name == BY_COLOUR) else {
            return self.spectra;
        };
        let emissions = || {
            materials
                .iter()
                .filter_map(|m| m.emission.as_ref())
                .filter(|e| e.light == light)
        };
        if emissions().any(|e| e.texture.is_some()) {
            return self.spectra;
        }
        let shapes: Vec<Spectrum> = emissions()
            .map(|e| e.shape)
            .chain(lights.iter().filter(|l| l.light == light).map(|l| l.shape))
            .collect();
        let Some(first) = shapes.first() else {
            return self.spectra;
        };
        let one = self.luminous_size(light, first);
        let unit = first.map(|s| s / one);
        let alike = |shape: &Spectrum, size: f64| {
            shape
                .iter()
                .zip(&unit)
                .all(|(s, u)| (s - u * size).abs() <= SAME_SHAPE * size * u)
        };
        let sizes: Vec<f64> = shapes
            .iter()
            .map(|s| self.luminous_size(light, s))
            .collect();
        if shapes
            .iter()
            .zip(&sizes)
            .any(|(shape, size)| !alike(shape, *size))
        {
            return self.spectra;
        }
        let mut sizes = sizes.into_iter();
        for emission in materials
            .iter_mut()
            .filter_map(|m| m.emission.as_mut())
            .filter(|e| e.light == light)
        {
            let size = sizes.next().expect("one size for each lamp");
            emission.shape = [size; BANDS];
            emission.color = [LAMP_BRIGHTNESS as f32; 3];
            emission.scale = size / LAMP_BRIGHTNESS;
        }
        for (lamp, size) in lights.iter_mut().filter(|l| l.light == light).zip(sizes) {
            lamp.shape = [size; BANDS];
        }
        if unit.iter().any(|u| *u != unit[0]) {
            self.spectra[light].name = format!("{BY_COLOUR} in one colour");
        }
        self.spectra[light]
            .power
            .iter_mut()
            .zip(unit)
            .for_each(|(p, u)| *p *= u);
        self.spectra
    }

    /// Tells the luminous size of a finished spectrum under a shape.
    pub(crate) fn luminous(&self) -> impl Fn(&LightSpectrum, &Spectrum) -> f64 + use<> {
        let luminous = self.luminous;
        move |spectrum, shape| {
            let bands = spectrum.power.iter().zip(shape).zip(&luminous);
            bands.map(|((p, s), y)| p * s * y).sum()
        }
    }

    /// Luminous size of a spectrum under a shape.
    fn luminous_size(&self, light: usize, shape: &Spectrum) -> f64 {
        let power = &self.spectra[light].power;
        (0..BANDS)
            .map(|band| power[band] * shape[band] * self.luminous[band])
            .sum()
    }
}
