//! Light and error at all vertices, packed for the page.
//!
//! Bytes in planes, so that they deflate well. For each step (rounds, then the file): high bytes and low bytes of the
//! illuminance's logarithm, u', v' (CIE 1976). A step holds what has to be added, byte by byte, to the step after it. Then, if
//! it is known, the error; then high and low bytes of each component of the spectrum, and of each layer's share.
//!
//! | what | coded as | resolution |
//! |---|---|---|
//! | illuminance | `1 + (log10 E - low) / (high - low) 65534`; 0: none | 1e-4 of itself |
//! | u', v' | 255ths of the room's range | a 255th of it |
//! | error | `255 sqrt(e / most)` | .4 % of the most |
//! | illuminance of each layer | 65535ths of that of the file | a 65535th of it |
//! | spectrum for each lux | mean and principal components, 65535ths of a component's range | stated in the page |

use super::history::{History, OutputCorner, corners};
use crate::color::seen_difference;
use crate::gather::Baked;
use crate::solve::Bake;
use crate::spectrum::{BANDS, Spectrum};
use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

/// Principal components at the most.
const COMPONENTS: usize = 8;
/// What they may leave out: root of the mean square, as a share of the mean spectrum's.
const LEFT_OUT: f64 = 2e-3;
/// How often a vertex's difference of two rounds is evened out with its neighbours': one difference is as good as chance, a
/// few rings of them tell where the error is.
const EVENED: usize = 3;
/// Illuminance below this share of the greatest is drawn as this much.
const FLOOR: f32 = 1e-7;

/// What the page is told of the planes.
#[derive(Debug, Serialize)]
pub(super) struct LightIndex {
    vertices: usize,
    /// For each primitive with light, in the order of the file: does it shine itself?
    glows: Vec<bool>,
    /// Numbers of the rounds whose light is there; the file's own comes after them.
    rounds: Vec<usize>,
    /// Decadic logarithm of lux.
    lux_log10: [f64; 2],
    /// Least and greatest u', v'.
    uv: [[f64; 2]; 2],
    /// The greatest error at a vertex, CIEDE2000; none if it is not known.
    error_most_de2000: Option<f64>,
    /// What the error's mean over the room is.
    error_mean_de2000: Option<f64>,
    spectrum: Components,
    /// Names of the layers.
    layers: Vec<String>,
    /// Mean illuminance of the surfaces by area, and the values that 2 and 98 % of the area stay below, lx.
    mean_lx: f64,
    usual_lx: [f64; 2],
}

/// Spectra of irradiance for each lux: `mean + sum of coefficient * component`, W/m2/nm/lx.
#[derive(Debug, Serialize)]
struct Components {
    mean: Vec<f64>,
    components: Vec<Vec<f64>>,
    /// Least and greatest coefficient of each.
    ranges: Vec<[f64; 2]>,
    /// What is left out, as a share: root of the mean square.
    left_out: f64,
}

/// Index and planes of a baked mesh. `order`: its surfaces as the file has them.
pub(super) fn pack(
    bake: &Bake,
    baked: &Baked,
    history: &History,
    order: &[usize],
) -> (LightIndex, Vec<u8>) {
    let corners = corners(bake, baked, order);
    let drawn = order
        .iter()
        .flat_map(|&k| baked.surfaces[k].vertices.iter());
    let file: Vec<[f32; 3]> = drawn.map(|v| v.irradiance).collect();
    let count = file.len();
    let mut area = vec![0.0; count];
    corners.iter().for_each(|c| area[c.vertex] += c.area);

    let mut steps = history.at(bake.tree(), &corners, count);
    let error = errors(bake, &steps, &corners, &area);
    let rounds = steps.iter().map(|(round, _)| *round).collect();
    steps.push((0, file));
    let coding = Coding::of(steps.iter().flat_map(|(_, light)| light));
    let coded: Vec<Vec<u8>> = steps
        .iter()
        .map(|(_, light)| coding.planes(light))
        .collect();
    let mut bytes = Vec::new();
    for (k, planes) in coded.iter().enumerate() {
        match coded.get(k + 1) {
            Some(next) => bytes.extend(planes.iter().zip(next).map(|(a, b)| a.wrapping_sub(*b))),
            None => bytes.extend(planes),
        }
    }
    let most = error
        .as_ref()
        .map(|(error, _)| error.iter().copied().fold(0.0, f64::max));
    if let (Some((error, _)), Some(most)) = (&error, most) {
        let code = |e: &f64| (255.0 * (e / most.max(f64::MIN_POSITIVE)).sqrt()).round() as u8;
        bytes.extend(error.iter().map(code));
    }
    let spectrum = spectra(bake, baked, order, &mut bytes);
    let layers = layers(bake, baked, order, &mut bytes);
    let lux: Vec<f64> = steps
        .last()
        .map_or(&[][..], |(_, light)| light)
        .iter()
        .map(|xyz| f64::from(xyz[1]).max(0.0))
        .collect();
    let index = LightIndex {
        vertices: count,
        glows: order.iter().map(|&k| glows(bake, baked, k)).collect(),
        rounds,
        lux_log10: coding.lux,
        uv: coding.uv,
        error_most_de2000: most,
        error_mean_de2000: error.map(|(_, mean)| mean),
        spectrum,
        layers,
        mean_lx: mean(&lux, &area),
        usual_lx: [0.02, 0.98].map(|share| below(&lux, &area, share)),
    };
    (index, bytes)
}

fn glows(bake: &Bake, baked: &Baked, part: usize) -> bool {
    let scene = bake.scene();
    let surface = &scene.surfaces[baked.surfaces[part].surface];
    scene.materials[surface.material].emission.is_some()
}

/// Error of the light at each vertex of a baked mesh, CIEDE2000, and its mean by area; `order`: its surfaces as the file has
/// them. None where it is not known.
#[cfg(feature = "cli")]
pub(crate) fn error_map(
    bake: &Bake,
    baked: &Baked,
    history: &History,
    order: &[usize],
) -> Option<(Vec<f64>, f64)> {
    let corners = corners(bake, baked, order);
    let count = order.iter().map(|&k| baked.surfaces[k].vertices.len());
    let mut area = vec![0.0; count.sum()];
    corners.iter().for_each(|c| area[c.vertex] += c.area);
    let steps = history.at(bake.tree(), &corners, area.len());
    errors(bake, &steps, &corners, &area)
}

/// Error of the light at each vertex, and its mean by area: how far the last two rounds are from each other there, evened out
/// and scaled to have the mean that the last round states. None where a round has no estimate.
fn errors(
    bake: &Bake,
    steps: &[(usize, Vec<[f32; 3]>)],
    corners: &[OutputCorner],
    area: &[f64],
) -> Option<(Vec<f64>, f64)> {
    let [.., (_, before), (_, last)] = steps else {
        return None;
    };
    let stated = bake.rounds().last()?.error.total_de2000.value?;
    let white = bake.light().white;
    let differ =
        |(a, b): (&[f32; 3], &[f32; 3])| seen_difference(a.map(f64::from), b.map(f64::from), white);
    let mut error: Vec<f64> = before.iter().zip(last).map(differ).collect();
    for _ in 0..EVENED {
        even_out(&mut error, corners, area);
    }
    let found = mean(&error, area);
    let scale = if found > 0.0 { stated / found } else { 0.0 };
    let sound = scale.is_finite() && found.is_finite();
    sound.then(|| (error.into_iter().map(|e| scale * e).collect(), stated))
}

/// Gives every vertex the mean of the triangles around it. Corners come three to a triangle.
fn even_out(values: &mut [f64], corners: &[OutputCorner], area: &[f64]) {
    let mut sums = vec![0.0; values.len()];
    for triangle in corners.chunks_exact(3) {
        let mean = triangle.iter().map(|c| values[c.vertex]).sum::<f64>() / 3.0;
        triangle
            .iter()
            .for_each(|c| sums[c.vertex] += c.area * mean);
    }
    for ((value, sum), area) in values.iter_mut().zip(sums).zip(area) {
        if *area > 0.0 {
            *value = sum / area;
        }
    }
}

fn mean(values: &[f64], area: &[f64]) -> f64 {
    let sum: f64 = values.iter().zip(area).map(|(v, a)| v * a).sum();
    sum / area.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// The value that a share of the area stays below.
fn below(values: &[f64], area: &[f64], share: f64) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut left = share * area.iter().sum::<f64>();
    let found = order.iter().find(|&&k| {
        left -= area[k];
        left <= 0.0
    });
    found.or(order.last()).map_or(0.0, |&k| values[k])
}

/// u', v' of a colour (CIE 15:2018); none of what is black.
fn chromaticity(xyz: &[f32; 3]) -> Option<[f64; 2]> {
    let [x, y, z] = xyz.map(f64::from);
    let sum = x + 15.0 * y + 3.0 * z;
    (y > 0.0 && sum > 0.0).then(|| [4.0 * x / sum, 9.0 * y / sum])
}

/// How light becomes bytes.
struct Coding {
    lux: [f64; 2],
    uv: [[f64; 2]; 2],
}

impl Coding {
    fn of<'a>(light: impl Iterator<Item = &'a [f32; 3]> + Clone) -> Self {
        let most = light.clone().map(|xyz| xyz[1]).fold(0.0, f32::max);
        let lit = light.filter(|xyz| xyz[1] > FLOOR * most);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for xyz in lit {
            let Some([u, v]) = chromaticity(xyz) else {
                continue;
            };
            let all = [f64::from(xyz[1]).log10(), u, v];
            low = std::array::from_fn(|c| low[c].min(all[c]));
            high = std::array::from_fn(|c| high[c].max(all[c]));
        }
        if low[0] > high[0] {
            (low, high) = ([0.0; 3], [1.0; 3]);
        }
        let range = |c: usize| {
            [
                low[c],
                if high[c] > low[c] {
                    high[c]
                } else {
                    low[c] + 1e-3
                },
            ]
        };
        Self {
            lux: range(0),
            uv: [range(1), range(2)],
        }
    }

    fn planes(&self, light: &[[f32; 3]]) -> Vec<u8> {
        let share = |x: f64, [low, high]: [f64; 2]| ((x - low) / (high - low)).clamp(0.0, 1.0);
        let n = light.len();
        let mut out = vec![0; 4 * n];
        for (k, xyz) in light.iter().enumerate() {
            let Some([u, v]) = chromaticity(xyz) else {
                continue;
            };
            let lux = 1 + (65534.0 * share(f64::from(xyz[1]).log10(), self.lux)).round() as u16;
            let [high, low] = lux.to_be_bytes();
            let [u, v] = [(u, self.uv[0]), (v, self.uv[1])]
                .map(|(x, range)| (255.0 * share(x, range)).round() as u8);
            for (plane, byte) in [high, low, u, v].into_iter().enumerate() {
                out[plane * n + k] = byte;
            }
        }
        out
    }
}

/// What each layer brings of the illuminance of the vertices, as a share, goes to `bytes`; names of the layers.
fn layers(bake: &Bake, baked: &Baked, order: &[usize], bytes: &mut Vec<u8>) -> Vec<String> {
    let rows = || order.iter().flat_map(|&k| &baked.irradiance[k]);
    let lux = |row: &[f32; BANDS]| bake.lanes().tristimulus(row)[1];
    for lanes in bake.layer_lanes() {
        let code = |row: &[f32; BANDS]| {
            let share = lux(&lanes.of(row)) / lux(row);
            // In the dark none brings anything.
            (65535.0 * share.clamp(0.0, 1.0)).round() as u16
        };
        let codes: Vec<u16> = rows().map(code).collect();
        bytes.extend(codes.iter().map(|c| c.to_be_bytes()[0]));
        bytes.extend(codes.iter().map(|c| c.to_be_bytes()[1]));
    }
    bake.layers().map_or(Vec::new(), |l| l.names.clone())
}

/// Principal components of the vertices' spectra; their coefficients go to `bytes`.
fn spectra(bake: &Bake, baked: &Baked, order: &[usize], bytes: &mut Vec<u8>) -> Components {
    // Worked out again for every sum: a large room has a gigabyte of them.
    let rows = || order.iter().flat_map(|&k| &baked.irradiance[k]);
    let shape = |row: &[f32; BANDS]| -> Option<Spectrum> {
        let lux = bake.lanes().tristimulus(row)[1];
        (lux > 0.0).then(|| bake.lanes().spectrum(row).map(|x| x / lux))
    };
    let lit = || rows().filter_map(shape);
    let n = lit().count().max(1) as f64;
    let mut mean = [0.0; BANDS];
    lit().for_each(|s| mean.iter_mut().zip(s).for_each(|(m, x)| *m += x / n));
    let mut covariance = DMatrix::<f64>::zeros(BANDS, BANDS);
    for shape in lit() {
        for i in 0..BANDS {
            let a = shape[i] - mean[i];
            for j in 0..=i {
                covariance[(i, j)] += a * (shape[j] - mean[j]) / n;
            }
        }
    }
    covariance.fill_upper_triangle_with_lower_triangle();
    let eigen = SymmetricEigen::new(covariance);
    let mut rank: Vec<usize> = (0..BANDS).collect();
    rank.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let size: f64 = mean
        .iter()
        .map(|m| m * m)
        .sum::<f64>()
        .max(f64::MIN_POSITIVE);
    let left = |k: usize| {
        let rest = rank[k..].iter().map(|&i| eigen.eigenvalues[i].max(0.0));
        (rest.sum::<f64>() / size).sqrt()
    };
    let kept = (0..COMPONENTS).find(|&k| left(k) <= LEFT_OUT);
    let kept = kept.unwrap_or(COMPONENTS);
    let mut out = Components {
        mean: mean.to_vec(),
        components: Vec::new(),
        ranges: Vec::new(),
        left_out: left(kept),
    };
    for &i in &rank[..kept] {
        let axis: Vec<f64> = eigen.eigenvectors.column(i).iter().copied().collect();
        let along = |row| {
            let s = shape(row)?;
            Some((0..BANDS).map(|k| axis[k] * (s[k] - mean[k])).sum::<f64>())
        };
        let values: Vec<f64> = rows().map(|row| along(row).unwrap_or(0.0)).collect();
        let low = values.iter().copied().fold(0.0, f64::min);
        let high = values
            .iter()
            .copied()
            .fold(low + f64::MIN_POSITIVE, f64::max);
        let code = |v: &f64| (65535.0 * ((v - low) / (high - low))).round() as u16;
        let codes: Vec<u16> = values.iter().map(code).collect();
        bytes.extend(codes.iter().map(|c| c.to_be_bytes()[0]));
        bytes.extend(codes.iter().map(|c| c.to_be_bytes()[1]));
        out.components.push(axis);
        out.ranges.push([low, high]);
    }
    out
}
