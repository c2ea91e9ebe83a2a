//! Light in the air on a grid of points, for objects that move: `NAME.probes.json` and `NAME.probes.ktx2`.
//!
//! The grid divides the bounds of what light reaches into equal boxes with sides of the asked-for spacing at the most; probes
//! stand in their middles. Probes in something solid or outside of the room are marked and have the mean of the probes
//! beside them, ring by ring, so that what is interpolated towards them does not turn black.
//!
//! Light is in linear sRGB, irradiance in units of `lux_per_unit` (see [`Probes`] for each field):
//!
//! - `sh`: nine coefficients of radiance, red, green, blue each, in the order of three.js' `SphericalHarmonics3`
//!   (`fromArray`), for a `LightProbe` of intensity `pi exposure lux_per_unit`: its `getIrradianceAt` is the irradiance.
//! - `cube`: irradiance of surfaces that look to +X, -X, +Y, -Y, +Z, -Z. The KTX2 file holds these as Bevy's irradiance volumes
//!   want them: a texture of (x, 2 y, 3 z) texels for a grid of (x, y, z) probes, the slabs of X, Y and Z one after the other
//!   along its depth, in each the positive side below y and the negative from y on (its documentation has them the other way
//!   round, its shader does not). `IrradianceVolume::intensity` is `lux_per_unit / pi`, and the volume's transform
//!   a translation by `box.centre` and a scale by `box.size`.

mod volume;

use super::Exposure;
use super::lit_space::LitRoom;
use crate::PROGRAM;
use crate::color::LinearSrgb;
use crate::error::{Error, Result};
use crate::gather::{Air, Around};
use crate::scene::Scene;
use crate::solve::record::Figure;
use crate::survey::PointLocation;
use glam::DVec3;
use serde::Serialize;
pub use volume::to_volume;

/// Version of the file.
pub const VERSION: u32 = 1;
/// Probes at the most: each looks in 26 directions, so many take some minutes, and a file of some 20 MB.
pub const MOST_PROBES: usize = 32_768;
/// Greatest number of half floats that is used, see [`maps`](super::maps).
const GREATEST: f64 = 32_768.0;

/// Where probes stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeGrid {
    /// Least corner of the box, world space, metres.
    pub low: DVec3,
    /// Its size.
    pub size: DVec3,
    /// Probes along each axis.
    pub counts: [usize; 3],
}

impl ProbeGrid {
    /// The grid of a room's lit space with probes `spacing` metres apart at the most.
    ///
    /// # Errors
    /// More than [`MOST_PROBES`].
    pub fn of(scene: &Scene, spacing: f64) -> Result<Self> {
        let (room, _) = LitRoom::new(scene);
        let places = || room.places.iter().map(|met| met.point);
        let low = places().fold(DVec3::INFINITY, DVec3::min);
        let high = places().fold(DVec3::NEG_INFINITY, DVec3::max);
        let bounds = if room.places.is_empty() {
            [DVec3::ZERO; 2]
        } else {
            [low + room.mesh.centre, high + room.mesh.centre]
        };
        Self::within(bounds, spacing)
    }

    /// The grid that divides a box.
    ///
    /// # Errors
    /// More than [`MOST_PROBES`].
    pub fn within([low, high]: [DVec3; 2], spacing: f64) -> Result<Self> {
        // What is flat takes one layer of probes; a millionth more than a multiple is that multiple.
        let count = |length: f64, spacing: f64| (length / spacing * (1.0 - 1e-6)).ceil().max(1.0);
        let counts = |spacing| (high - low).to_array().map(|length| count(length, spacing));
        let fits = |spacing| counts(spacing).iter().product::<f64>() <= MOST_PROBES as f64;
        if !fits(spacing) {
            let wider = std::iter::successors(Some(spacing), |s| Some(1.1 * s)).find(|s| fits(*s));
            let [x, y, z] = counts(spacing);
            return Err(Error::input(
                "--probes",
                format!(
                    "{x} x {y} x {z} probes, {spacing} m apart, are too many: there may be {MOST_PROBES}"
                ),
                format!(
                    "give a spacing of {:.3} m or more",
                    wider.unwrap_or(spacing)
                ),
            ));
        }
        let counts = counts(spacing);
        Ok(Self {
            low,
            size: high - low,
            counts: counts.map(|n| n as usize),
        })
    }

    /// The probes: x changes fastest, then y, then z.
    pub fn points(&self) -> Vec<DVec3> {
        let step = self.step();
        let at = |x: usize, y: usize, z: usize| {
            self.low + step * (DVec3::new(x as f64, y as f64, z as f64) + 0.5)
        };
        let [nx, ny, nz] = self.counts;
        let rows = (0..nz).flat_map(|z| (0..ny).map(move |y| (y, z)));
        rows.flat_map(|(y, z)| (0..nx).map(move |x| at(x, y, z)))
            .collect()
    }

    /// Distance of probes along each axis.
    pub fn step(&self) -> DVec3 {
        self.size / DVec3::from_array(self.counts.map(|n| n as f64))
    }

    /// Numbers of the probes beside one.
    fn beside(&self, k: usize) -> impl Iterator<Item = usize> {
        let [nx, ny, nz] = self.counts;
        let at = [k % nx, k / nx % ny, k / (nx * ny)];
        let strides = [(1, nx), (nx, ny), (nx * ny, nz)];
        (0..3).flat_map(move |axis| {
            let (stride, count) = strides[axis];
            let before = (at[axis] > 0).then(|| k - stride);
            let after = (at[axis] + 1 < count).then(|| k + stride);
            before.into_iter().chain(after)
        })
    }

    /// Gives probes that are not in the room the mean of those beside them, ring by ring.
    fn lend(&self, air: &mut [Air]) {
        let mut known: Vec<bool> = air.iter().map(|a| a.place == PointLocation::Room).collect();
        loop {
            let ring: Vec<(usize, Vec<usize>)> = (0..air.len())
                .filter(|&k| !known[k])
                .map(|k| (k, self.beside(k).filter(|&n| known[n]).collect()))
                .filter(|(_, near): &(usize, Vec<usize>)| !near.is_empty())
                .collect();
            if ring.is_empty() {
                return;
            }
            for (k, near) in ring {
                let of = |get: &dyn Fn(&Air) -> Around| {
                    let all: Vec<Around> = near.iter().map(|&n| get(&air[n])).collect();
                    Around::mean(&all)
                };
                let light = of(&|a| a.light);
                let layers = (0..air[k].layers.len()).map(|l| of(&|a| a.layers[l]));
                let layers = layers.collect();
                (air[k].light, air[k].layers) = (light, layers);
                known[k] = true;
            }
        }
    }
}

/// `NAME.probes.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Probes {
    /// `haarlight.probes`.
    pub format: &'static str,
    /// [`VERSION`].
    pub version: u32,
    /// Name and version of the program.
    pub program: &'static str,
    /// Always `linear sRGB`.
    pub colour: &'static str,
    /// Illuminance of an irradiance of (1, 1, 1), lx.
    pub lux_per_unit: f64,
    /// Display value (1: white) of a radiosity of 1 lm/m2 in the glb.
    pub exposure: f64,
    /// Number of probes along x, y and z.
    pub counts: [usize; 3],
    /// The first probe, the file's units.
    pub origin: [f64; 3],
    /// Distance of probes along x, y and z, the file's units.
    pub step: [f64; 3],
    /// What the probes fill.
    #[serde(rename = "box")]
    pub volume: Volume,
    /// Mean colour difference (CIEDE2000) of light at points of the room, an estimate.
    pub error_de2000: Option<Figure>,
    /// What irradiance has beyond its nine coefficients: root mean square over directions, share of the mean; measured at every
    /// probe of the room.
    pub truncation: Truncation,
    /// Where each probe is: `room`, `inside` something solid, `outside`. Probes stand x by x, then y by y, then z by z.
    pub places: Vec<&'static str>,
    /// Coefficients of each probe: nine times red, green, blue.
    pub sh: Vec<Vec<f32>>,
    /// Irradiance of each probe to +X, -X, +Y, -Y, +Z, -Z: six times red, green, blue.
    pub cube: Vec<Vec<f32>>,
    /// The same for each layer of lamps, which add up to these.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<ProbeLayer>,
    /// The ambient cubes as a texture, a file beside this one.
    pub ktx2: String,
}

/// A box along the axes, the file's units.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Volume {
    /// Its middle.
    pub centre: [f64; 3],
    /// Its sides.
    pub size: [f64; 3],
}

/// How much coefficients leave out, over the probes of the room.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Truncation {
    /// Mean.
    pub mean: f64,
    /// Greatest.
    pub max: f64,
}

/// The light of a layer at all probes.
#[derive(Debug, Clone, Serialize)]
pub struct ProbeLayer {
    /// Its name.
    pub name: String,
    /// As [`Probes::sh`].
    pub sh: Vec<Vec<f32>>,
    /// As [`Probes::cube`].
    pub cube: Vec<Vec<f32>>,
}

impl Probes {
    /// What is written of the probes of a grid; `air` are its points in order, `ktx2` the name of the texture's file.
    pub fn new(
        scene: &Scene,
        grid: &ProbeGrid,
        mut air: Vec<Air>,
        look: &Exposure,
        error_de2000: Option<Figure>,
        ktx2: String,
    ) -> Self {
        let here: Vec<f64> = (air.iter().filter(|a| a.place == PointLocation::Room))
            .map(|a| a.truncation)
            .collect();
        let truncation = Truncation {
            mean: here.iter().sum::<f64>() / here.len().max(1) as f64,
            max: here.iter().copied().fold(0.0, f64::max),
        };
        grid.lend(&mut air);
        let sides = air.iter().flat_map(|a| a.light.cube).flat_map(rgb);
        let brightest = sides.fold(0.0, f64::max);
        let lux_per_unit = match brightest > GREATEST {
            true => (brightest / GREATEST).log2().ceil().exp2(),
            false => 1.0,
        };
        let numbers = |all: &[[f64; 3]]| -> Vec<f32> {
            let numbers = all.iter().flat_map(|&xyz| rgb(xyz));
            numbers.map(|c| (c / lux_per_unit) as f32).collect()
        };
        let names = scene.changes.layers.iter().flat_map(|layers| &layers.names);
        let layer = |(l, name): (usize, &String)| ProbeLayer {
            name: name.clone(),
            sh: air.iter().map(|a| numbers(&a.layers[l].sh)).collect(),
            cube: air.iter().map(|a| numbers(&a.layers[l].cube)).collect(),
        };
        let layers = air.first().map_or(0, |a| a.layers.len());
        let of_file = |v: DVec3| (v / scene.changes.scale).to_array();
        Self {
            format: "haarlight.probes",
            version: VERSION,
            program: PROGRAM,
            colour: "linear sRGB",
            lux_per_unit,
            exposure: look.scale,
            counts: grid.counts,
            origin: of_file(grid.low + 0.5 * grid.step()),
            step: of_file(grid.step()),
            volume: Volume {
                centre: of_file(grid.low + 0.5 * grid.size),
                size: of_file(grid.size),
            },
            error_de2000,
            truncation,
            places: air.iter().map(|a| a.place.name()).collect(),
            sh: air.iter().map(|a| numbers(&a.light.sh)).collect(),
            cube: air.iter().map(|a| numbers(&a.light.cube)).collect(),
            layers: names.take(layers).enumerate().map(layer).collect(),
            ktx2,
        }
    }
}

/// Linear sRGB of tristimulus values.
fn rgb(xyz: [f64; 3]) -> [f64; 3] {
    LinearSrgb::standard().from_xyz(xyz)
}
