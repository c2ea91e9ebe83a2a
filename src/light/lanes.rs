//! The working partition: what each lane of a row stands for.
//!
//! Each light spectrum S(lambda) of the room is kept exactly; a lane holds the *ratio* radiosity / S on one interval of
//! that light's dyadic cut. Reflectances are averaged by the paper's eq. 3 with `S abar` in place of `abar`, so that a
//! grey room needs one lane a light, whatever its lines, and a first reflection keeps its tristimulus values. Where all
//! lights together would need more than 64 lanes, the rows hold the 64 bands.
//!
//! Other ways to hold spectra serve for comparison: radiosity itself on intervals (the paper's way), linear sRGB, and
//! coordinates in a trained basis (the paper's 2.2.2), under which a reflectance is a matrix.
//!
//! Where surfaces fluoresce, light also counts by what it excites: see [`Lanes::guided`].
//!
//! Units: ratio lanes are numbers that multiply S (W/m2/nm of radiosity per unit of `LightSpectrum::power`);
//! absolute lanes are W/m2/nm; lanes of linear sRGB are W/m2 weighted by the observer, (1, 1, 1) has Y = 1 / KM lm/m2.

use crate::color::{KM, LinearSrgb, Upsampler};
use crate::scene::{Emission, GREATEST_ALBEDO, LightSpectrum};
use crate::spectrum::{BANDS, Partition, Spectrum};
use nalgebra::Matrix3;

/// One lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lane {
    /// The light whose ratio the lane holds; none: absolute.
    pub light: Option<usize>,
    /// First band of the interval.
    pub first: usize,
    /// Bands in the interval.
    pub count: usize,
}

/// What lanes hold.
#[derive(Debug, Clone, PartialEq)]
enum Base {
    /// Values on intervals.
    Intervals(Vec<Lane>),
    /// Linear sRGB: the contribution of each band of a reflectance under D65, and of each band of a radiosity.
    Rgb {
        paint: Box<[Spectrum; 3]>,
        light: Box<[Spectrum; 3]>,
    },
    /// Coordinates in an orthonormal basis.
    Vectors(Vec<Spectrum>),
}

/// The lanes of all rows.
#[derive(Debug, Clone)]
pub struct Lanes {
    base: Base,
    /// Tristimulus value of a lane at 1: `Km integral of S abar`, or of `abar` alone.
    xyz: Vec<[f64; 3]>,
    power: Vec<Spectrum>,
    weights: [Spectrum; 3],
    /// How light counts besides being visible.
    guide: Option<Box<Guide>>,
}

/// How light counts by what it excites.
#[derive(Debug, Clone)]
struct Guide {
    /// Weights like the observer's.
    weights: [Spectrum; 3],
    /// Tristimulus value of each lane at 1 by these weights.
    xyz: Vec<[f64; 3]>,
    /// A share of that, plus the visible tristimulus value.
    both: Vec<[f64; 3]>,
}

impl Lanes {
    /// One cut for each light; falls back to [`Lanes::dense`] beyond 64 lanes. `weights` are the integrals of the
    /// colour matching functions over the bands, nm.
    pub fn ratio(spectra: &[LightSpectrum], cuts: &[Partition], weights: &[Spectrum; 3]) -> Self {
        assert_eq!(spectra.len(), cuts.len(), "a cut for each light");
        if cuts.iter().map(|c| c.count()).sum::<usize>() > BANDS {
            return Self::dense(spectra, weights);
        }
        let lanes = cuts.iter().enumerate().flat_map(|(light, cut)| {
            cut.iter().map(move |(first, count)| Lane {
                light: Some(light),
                first,
                count,
            })
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// The ratio to one light on every band; other lights are left out.
    pub fn only(spectra: &[LightSpectrum], light: usize, weights: &[Spectrum; 3]) -> Self {
        let lanes = (0..BANDS).map(|first| Lane {
            light: Some(light),
            first,
            count: 1,
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// The 64 bands, all lights together.
    pub fn dense(spectra: &[LightSpectrum], weights: &[Spectrum; 3]) -> Self {
        Self::absolute(spectra, Partition::BANDS, weights)
    }

    /// Radiosity itself on the intervals of a cut, all lights together.
    pub fn absolute(spectra: &[LightSpectrum], cut: Partition, weights: &[Spectrum; 3]) -> Self {
        let lanes = cut.iter().map(|(first, count)| Lane {
            light: None,
            first,
            count,
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// The ratio to each light on `count` intervals of equal width as far as bands allow; falls back to
    /// [`Lanes::dense`] beyond 64 lanes.
    pub fn uniform(spectra: &[LightSpectrum], count: usize, weights: &[Spectrum; 3]) -> Self {
        let count = count.clamp(1, BANDS);
        if count * spectra.len() > BANDS {
            return Self::dense(spectra, weights);
        }
        let edge = |k: usize| k * BANDS / count;
        let lanes = (0..spectra.len()).flat_map(|light| {
            (0..count).map(move |k| Lane {
                light: Some(light),
                first: edge(k),
                count: edge(k + 1) - edge(k),
            })
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// Linear sRGB: reflectances by their colour under D65, lamps by their own. Three numbers, and no way back.
    pub fn rgb(spectra: &[LightSpectrum], upsampler: &Upsampler, weights: &[Spectrum; 3]) -> Self {
        let one = |band: usize| -> Spectrum { std::array::from_fn(|k| f64::from(k == band)) };
        let display = LinearSrgb::standard();
        let (mut paint, mut light) = ([[0.0; BANDS]; 3], [[0.0; BANDS]; 3]);
        for band in 0..BANDS {
            let colours = [
                upsampler.rgb(&one(band)),
                display.from_xyz(weights.each_ref().map(|w| w[band])),
            ];
            for c in 0..3 {
                paint[c][band] = colours[0][c];
                light[c][band] = colours[1][c];
            }
        }
        let xyz = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|rgb| display.to_xyz(rgb).map(|x| KM * x));
        Self {
            base: Base::Rgb {
                paint: Box::new(paint),
                light: Box::new(light),
            },
            xyz: xyz.to_vec(),
            power: spectra.iter().map(|s| s.power).collect(),
            weights: *weights,
            guide: None,
        }
    }

    /// Coordinates in an orthonormal basis. Lanes then do not reflect one by one: see [`Lanes::matrix`].
    pub fn vectors(spectra: &[LightSpectrum], basis: Vec<Spectrum>, cmf: &[Spectrum; 3]) -> Self {
        let xyz = basis
            .iter()
            .map(|e| cmf.each_ref().map(|w| KM * dot(e, w)))
            .collect();
        Self {
            base: Base::Vectors(basis),
            xyz,
            power: spectra.iter().map(|s| s.power).collect(),
            weights: *cmf,
            guide: None,
        }
    }

    /// The given lanes.
    pub(crate) fn with(lanes: Vec<Lane>, spectra: &[LightSpectrum], cmf: &[Spectrum; 3]) -> Self {
        let power: Vec<Spectrum> = spectra.iter().map(|s| s.power).collect();
        let xyz = lanes
            .iter()
            .map(|lane| {
                let bands = lane.first..lane.first + lane.count;
                cmf.each_ref().map(|w| {
                    KM * bands
                        .clone()
                        .map(|k| w[k] * lane.light.map_or(1.0, |l| power[l][k]))
                        .sum::<f64>()
                })
            })
            .collect();
        Self {
            base: Base::Intervals(lanes),
            xyz,
            power,
            weights: *cmf,
            guide: None,
        }
    }

    /// These lanes, whose averages also follow `weights` besides the observer's: what a surface emits at other wavelengths per unit of
    /// each band. A `share` of that is added to brightness.
    #[must_use]
    pub fn guided(mut self, weights: &[Spectrum; 3], share: f64) -> Self {
        let of = |lane: &Lane, w: &Spectrum| {
            let bands = lane.first..lane.first + lane.count;
            KM * bands.map(|k| w[k] * self.shape(lane, k)).sum::<f64>()
        };
        let xyz = self.lanes().iter();
        let xyz: Vec<_> = xyz.map(|l| weights.each_ref().map(|w| of(l, w))).collect();
        let both = xyz.iter().zip(&self.xyz);
        let both = both.map(|(a, b)| std::array::from_fn(|c| share * a[c] + b[c]));
        self.guide = (!xyz.is_empty()).then(|| {
            Box::new(Guide {
                weights: *weights,
                both: both.collect(),
                xyz: xyz.clone(),
            })
        });
        self
    }

    /// Number of lanes in use.
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Is there no lane (in a room without light)?
    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }

    /// The intervals that lanes stand for; empty where lanes are not intervals (sRGB, a basis).
    pub fn lanes(&self) -> &[Lane] {
        match &self.base {
            Base::Intervals(lanes) => lanes,
            _ => &[],
        }
    }

    /// Does each lane hold the ratio to one light?
    pub fn is_ratio(&self) -> bool {
        !self.lanes().is_empty() && self.lanes().iter().all(|lane| lane.light.is_some())
    }

    /// The cut of each light, if each lane holds the ratio to one light on a dyadic interval.
    pub fn cuts(&self) -> Option<Vec<Partition>> {
        if !self.is_ratio() {
            return None;
        }
        (0..self.power.len())
            .map(|light| {
                let own = self.lanes().iter().filter(|l| l.light == Some(light));
                Partition::new(own.fold(0_u64, |bits, lane| bits | 1 << lane.first))
            })
            .collect()
    }

    /// For each lane, the lane of `other` that holds the ratio to the same light on its first band; none unless both
    /// hold ratios.
    pub fn places_in(&self, other: &Self) -> Option<Vec<usize>> {
        if !(self.is_ratio() && other.is_ratio()) {
            return None;
        }
        let holds = |a: &Lane, b: &Lane| {
            a.light == b.light && (b.first..b.first + b.count).contains(&a.first)
        };
        self.lanes()
            .iter()
            .map(|a| other.lanes().iter().position(|b| holds(a, b)))
            .collect()
    }

    /// Do lanes reflect into each other?
    pub fn is_mixed(&self) -> bool {
        matches!(self.base, Base::Vectors(_))
    }

    /// Do lanes mean the same as in `other`?
    pub fn same_meaning(&self, other: &Self) -> bool {
        self.base == other.base
    }

    /// Tristimulus value of each lane at 1 (lm/m2 for radiosity).
    pub fn xyz(&self) -> &[[f64; 3]] {
        &self.xyz
    }

    /// Weight of each lane at 1 in brightness: its tristimulus value, plus a share of what it excites.
    pub fn noticed(&self) -> &[[f64; 3]] {
        self.guide.as_ref().map_or(&self.xyz, |guide| &guide.both)
    }

    /// Tristimulus value excited by each lane at 1; none where nothing fluoresces.
    pub fn excites(&self) -> Option<&[[f64; 3]]> {
        self.guide.as_ref().map(|guide| &*guide.xyz)
    }

    /// Tristimulus values of a row, weighted for brightness.
    pub fn notice(&self, row: &[f32]) -> [f64; 3] {
        summed(row, self.noticed())
    }

    /// Tristimulus values that a row excites; 0 where nothing fluoresces.
    pub fn excited(&self, row: &[f32]) -> [f64; 3] {
        summed(row, self.excites().unwrap_or_default())
    }

    /// Power that a surface takes from each lane at 1, given the share it takes of each band and the `width` of a band in nm: W/m2. Empty
    /// where lanes are not intervals.
    pub fn taken(&self, share: &Spectrum, width: f64) -> Vec<f32> {
        let lanes = self.lanes().iter().map(|lane| {
            let bands = lane.first..lane.first + lane.count;
            let sum: f64 = bands.map(|k| share[k] * self.shape(lane, k)).sum();
            (sum * width) as f32
        });
        lanes.collect()
    }

    /// Average of a smooth factor (a reflectance, a lamp's shape) on each lane: eq. 3 under the lane's light. Where
    /// lanes mix, only [`Lanes::matrix`] is meaningful.
    pub fn averages(&self, f: &Spectrum, out: &mut [f32]) {
        match &self.base {
            Base::Intervals(lanes) => {
                for (out, lane) in out.iter_mut().zip(lanes) {
                    *out = self.average(f, lane) as f32;
                }
            }
            Base::Rgb { paint, .. } => {
                for (out, w) in out.iter_mut().zip(paint.iter()) {
                    *out = dot(f, w).clamp(0.0, GREATEST_ALBEDO) as f32;
                }
            }
            Base::Vectors(_) => {}
        }
    }

    /// Reflection where lanes mix: `R_ij = sum over bands of rho E_i E_j`, row by row (paper 2.2.2). Symmetric, its
    /// eigenvalues lie in the range of rho.
    pub fn matrix(&self, reflectance: &Spectrum) -> Vec<f64> {
        let Base::Vectors(basis) = &self.base else {
            return Vec::new();
        };
        let through = |i: &Spectrum, j: &Spectrum| -> f64 {
            (0..BANDS).map(|k| reflectance[k] * i[k] * j[k]).sum()
        };
        basis
            .iter()
            .flat_map(|i| basis.iter().map(move |j| through(i, j)))
            .collect()
    }

    fn average(&self, f: &Spectrum, lane: &Lane) -> f64 {
        let bands = lane.first..lane.first + lane.count;
        let first = f[lane.first];
        // Exactly flat stays exactly flat: a grey room must not pick up rounding.
        if bands.clone().all(|k| f[k] == first) {
            return first;
        }
        let (mut over, mut under) = (0.0, 0.0);
        let more = self.guide.iter().flat_map(|guide| &guide.weights);
        for w in self.weights.iter().chain(more) {
            let (mut whole, mut part) = (0.0, 0.0);
            for k in bands.clone() {
                let weight = w[k] * lane.light.map_or(1.0, |l| self.power[l][k]);
                whole += weight;
                part += weight * f[k];
            }
            over += whole * part;
            under += whole * whole;
        }
        if under > 0.0 {
            over / under
        } else {
            bands.map(|k| f[k]).sum::<f64>() / lane.count as f64
        }
    }

    /// Tristimulus values of an emission: `scale` times `shape` of a light.
    pub(crate) fn emission(&self, light: usize, shape: &Spectrum, scale: f64) -> [f64; 3] {
        let mut row = [0.0_f32; BANDS];
        self.add_emission(light, shape, scale, &mut row);
        self.tristimulus(&row)
    }

    /// Tristimulus exitance of a surface: pi times its radiance; 0 where it does not emit.
    pub(crate) fn exitance(&self, emission: Option<&Emission>) -> [f64; 3] {
        emission.map_or([0.0; 3], |e| {
            self.emission(e.light, &e.shape, std::f64::consts::PI)
        })
    }

    /// Adds an emission of `light` with a shape (see [`crate::scene::Emission`]).
    pub fn add_emission(&self, light: usize, shape: &Spectrum, scale: f64, out: &mut [f32]) {
        let radiosity =
            || -> Spectrum { std::array::from_fn(|k| scale * self.power[light][k] * shape[k]) };
        match &self.base {
            Base::Intervals(lanes) => {
                let absolute = lanes
                    .iter()
                    .any(|lane| lane.light.is_none())
                    .then(radiosity);
                for (out, lane) in out.iter_mut().zip(lanes) {
                    match (lane.light, &absolute) {
                        (Some(l), _) if l == light => {
                            *out += (scale * self.average(shape, lane)) as f32;
                        }
                        (None, Some(all)) => *out += self.average(all, lane) as f32,
                        _ => {}
                    }
                }
            }
            Base::Rgb { light: rows, .. } => {
                let all = radiosity();
                for (out, w) in out.iter_mut().zip(rows.iter()) {
                    *out += dot(&all, w) as f32;
                }
            }
            Base::Vectors(basis) => {
                let all = radiosity();
                for (out, e) in out.iter_mut().zip(basis) {
                    *out += dot(&all, e) as f32;
                }
            }
        }
    }

    /// Tristimulus values of a row.
    pub fn tristimulus(&self, row: &[f32]) -> [f64; 3] {
        summed(row, &self.xyz)
    }

    /// Tristimulus values of each lane at 1 after one more reflection, with the reflectance at full resolution as far
    /// as lanes can resolve it.
    pub fn reflected(&self, reflectance: &Spectrum) -> Vec<[f64; 3]> {
        let through = |spectrum: &dyn Fn(usize) -> f64| {
            self.weights.each_ref().map(|w| {
                KM * (0..BANDS)
                    .map(|k| reflectance[k] * w[k] * spectrum(k))
                    .sum::<f64>()
            })
        };
        match &self.base {
            Base::Intervals(lanes) => lanes
                .iter()
                .map(|lane| through(&|k| self.shape(lane, k)))
                .collect(),
            Base::Rgb { .. } => {
                let mut rho = [0.0; 3];
                self.averages(reflectance, &mut rho);
                self.xyz
                    .iter()
                    .zip(rho)
                    .map(|(xyz, rho)| xyz.map(|x| x * f64::from(rho)))
                    .collect()
            }
            Base::Vectors(basis) => basis.iter().map(|e| through(&|k| e[k])).collect(),
        }
    }

    /// Value of an interval lane at 1 on a band.
    fn shape(&self, lane: &Lane, band: usize) -> f64 {
        if (lane.first..lane.first + lane.count).contains(&band) {
            lane.light.map_or(1.0, |l| self.power[l][band])
        } else {
            0.0
        }
    }

    /// The 64 band values of a row, W/m2/nm. For linear sRGB the shortest of the many spectra of that colour.
    pub fn spectrum(&self, row: &[f32]) -> Spectrum {
        let mut out = [0.0; BANDS];
        match &self.base {
            Base::Intervals(lanes) => {
                for (x, lane) in row.iter().zip(lanes) {
                    for (k, out) in out.iter_mut().enumerate().skip(lane.first).take(lane.count) {
                        *out += f64::from(*x) * lane.light.map_or(1.0, |l| self.power[l][k]);
                    }
                }
            }
            Base::Rgb { .. } => {
                let w = &self.weights;
                let products = Matrix3::from_fn(|a, b| KM * dot(&w[a], &w[b]));
                let xyz = self.tristimulus(row);
                if let Some(inverse) = products.try_inverse() {
                    let c = inverse * nalgebra::Vector3::from(xyz);
                    out = std::array::from_fn(|k| (0..3).map(|a| c[a] * w[a][k]).sum());
                }
            }
            Base::Vectors(basis) => {
                for (x, e) in row.iter().zip(basis) {
                    for (out, e) in out.iter_mut().zip(e) {
                        *out += f64::from(*x) * e;
                    }
                }
            }
        }
        out
    }
}

/// Sum of a row's lanes by tristimulus values.
fn summed(row: &[f32], xyz: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (x, w) in row.iter().zip(xyz) {
        for (s, w) in sum.iter_mut().zip(w) {
            *s += f64::from(*x) * w;
        }
    }
    sum
}

fn dot(a: &Spectrum, b: &Spectrum) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Observer;
    use crate::data::{Outside, named};
    use crate::spectrum::Grid;

    fn light(name: &str) -> LightSpectrum {
        let power = Grid::default().means(&named(name).unwrap().table, Outside::Zero);
        LightSpectrum {
            name: name.into(),
            power,
        }
    }

    /// Every way to hold spectra keeps the colour of the lamp, whatever its lines, except the paper's on a coarse cut.
    #[test]
    fn lamps_keep_their_colour() {
        let weights = Observer::cie1931().weights(&Grid::default());
        let upsampler = Upsampler::new(&Grid::default());
        let spectra = [light("cie/F2"), light("cie/A")];
        let unit = |l: &LightSpectrum| {
            let length = dot(&l.power, &l.power).sqrt();
            l.power.map(|x| x / length)
        };
        let first = unit(&spectra[0]);
        let part = dot(&first, &spectra[1].power);
        let rest: Spectrum = std::array::from_fn(|k| spectra[1].power[k] - part * first[k]);
        let length = dot(&rest, &rest).sqrt();
        let all = [
            Lanes::ratio(
                &spectra,
                &[Partition::ROOT, Partition::uniform(2)],
                &weights,
            ),
            Lanes::uniform(&spectra, 7, &weights),
            Lanes::dense(&spectra, &weights),
            Lanes::rgb(&spectra, &upsampler, &weights),
            Lanes::vectors(&spectra, vec![first, rest.map(|x| x / length)], &weights),
        ];
        for (k, spectrum) in spectra.iter().enumerate() {
            let exact = weights.map(|w| KM * dot(&w, &spectrum.power));
            for lanes in &all {
                let mut row = vec![0.0; lanes.len()];
                lanes.add_emission(k, &[1.0; BANDS], 1.0, &mut row);
                let close = |xyz: [f64; 3]| (0..3).all(|c| (xyz[c] / exact[c] - 1.0).abs() < 1e-5);
                assert!(close(lanes.tristimulus(&row)), "{lanes:?}");
                let spectrum = lanes.spectrum(&row);
                assert!(close(weights.map(|w| KM * dot(&w, &spectrum))), "{lanes:?}");
            }
        }
    }

    /// A grey wall reflects grey, a wall of linear sRGB colour c under D65 gives c.
    #[test]
    fn srgb_reflects_as_its_definition_says() {
        let grid = Grid::default();
        let weights = Observer::cie1931().weights(&grid);
        let upsampler = Upsampler::new(&grid);
        let lanes = Lanes::rgb(&[light("cie/D65")], &upsampler, &weights);
        let mut row = [0.0; 3];
        lanes.averages(&[0.5; BANDS], &mut row);
        assert!(row.iter().all(|x| (x - 0.5).abs() < 1e-6), "{row:?}");
        let brick = upsampler.reflectance([0.45, 0.12, 0.08]);
        lanes.averages(&brick, &mut row);
        let [r, g, b] = row;
        assert!((r - 0.45).abs() < 1e-4 && (g - 0.12).abs() < 1e-4 && (b - 0.08).abs() < 1e-4);
    }

    /// Reflection in a basis is exact for spectra that the basis holds.
    #[test]
    fn a_whole_basis_reflects_exactly() {
        let weights = Observer::cie1931().weights(&Grid::default());
        let basis: Vec<Spectrum> = (0..BANDS)
            .map(|i| std::array::from_fn(|k| f64::from(i == k)))
            .collect();
        let lanes = Lanes::vectors(&[light("cie/A")], basis, &weights);
        let rho: Spectrum = std::array::from_fn(|k| 0.01 * k as f64);
        let matrix = lanes.matrix(&rho);
        for i in 0..BANDS {
            for j in 0..BANDS {
                let expected = if i == j { rho[i] } else { 0.0 };
                assert!((matrix[i * BANDS + j] - expected).abs() < 1e-15);
            }
        }
    }
}
