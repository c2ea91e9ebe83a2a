//! A table of luminous intensities over two angles.
//!
//! Every goniometer has a polar axis: one angle counts from it (`polar`, 0 to 180 degrees), the other turns about it
//! (`azimuth`). Types A, B and C of LM-63 differ in where that axis lies, and in nothing else:
//!
//! | type | polar axis, where `polar` is 0 | azimuth 0 | azimuth 90 | `polar` | `azimuth` |
//! |---|---|---|---|---|---|
//! | C | aim (nadir) | C0 | C90 | gamma | C |
//! | A | down | aim | right | 90 + V | H |
//! | B | left | aim | up | 90 + H | V |
//!
//! In the space of a glTF light (EXT_lights_ies, "Coordinate System Mapping") the aim is -Z, C0 is +X, C90 is +Y; the
//! vertical plane of types A and B is X/Z, so that up is +X, and their horizontal angles run clockwise seen from
//! above: right is -Y.
//!
//! Between angles intensities are bilinear in both, beyond the first and last there is no light. Flux is the exact integral of
//! that: `Phi = int int I(p, a) sin p dp da`, with `sin p` times a linear function integrated in closed form.

use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Most angles of a kind in a file. The finest goniometers have steps of .1 degrees.
pub(super) const MOST_ANGLES: usize = 3601;
/// No lamp has more candela; sums of what is beyond are no numbers.
pub(super) const BRIGHTEST: f64 = 1e12;
/// Angles that differ by less are one, degrees: files round to .1 or .01.
const SAME: f64 = 1e-3;

/// The types of LM-63: where the axis of the goniometer lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Angles {
    /// Of headlamps: the axis upright, the lamp aimed across.
    A,
    /// Of floodlights: the axis lies across.
    B,
    /// Of luminaires: the axis is the nadir.
    C,
}

impl Angles {
    /// Polar axis, azimuth 0, azimuth 90 in the space of a glTF light.
    fn axes(self) -> [DVec3; 3] {
        match self {
            Self::C => [DVec3::NEG_Z, DVec3::X, DVec3::Y],
            Self::A => [DVec3::NEG_X, DVec3::NEG_Z, DVec3::NEG_Y],
            Self::B => [DVec3::Y, DVec3::NEG_Z, DVec3::X],
        }
    }

    /// Its letter.
    pub fn letter(self) -> char {
        match self {
            Self::A => 'A',
            Self::B => 'B',
            Self::C => 'C',
        }
    }
}

/// What a file leaves out because it is as the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Symmetry {
    /// Nothing.
    None,
    /// Everything but one plane.
    Axial,
    /// One side of the plane C0-C180 (types A and B: of azimuth 0).
    Plane0,
    /// One side of the plane C90-C270.
    Plane90,
    /// All but one quarter.
    Quadrant,
}

/// How a lamp's light is spread over directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Name of the luminaire, as the file has it; empty if it has none.
    pub luminaire: String,
    /// `LM-63-2002` or `EULUMDAT`.
    pub format: String,
    /// Type of the goniometer.
    pub angles: Angles,
    /// Luminous flux of the lamps in it, lm; none in absolute photometry.
    pub lamps_lm: Option<f64>,
    /// Extent along C0-C180, along C90-C270, and height of what shines, m; 0: a point. (The length of a lamp lies along C0 in LM-63, and
    /// along C90 in EULUMDAT.)
    pub opening_m: [f64; 3],
    /// Pairs of tilt (degrees from the position in which it was measured) and share of the light that is left.
    pub tilt: Vec<[f64; 2]>,
    /// What is odd about the file.
    pub warnings: Vec<String>,
    /// Radians, ascending, 0 to pi.
    polar: Vec<f64>,
    /// Radians, ascending; one: alike all around.
    azimuth: Vec<f64>,
    /// cd; all polar angles of the first azimuth, then those of the second.
    candela: Vec<f64>,
    /// Flux through all cells of the table up to and with each, lm.
    upto: Vec<f64>,
    /// lm.
    flux: f64,
}

/// What a file says of the light: angles in degrees, as measured, with what it leaves out.
pub(super) struct MeasuredTable {
    pub(super) angles: Angles,
    pub(super) symmetry: Symmetry,
    /// `polar` of the table, degrees.
    pub(super) polar: Vec<f64>,
    /// Azimuths, degrees.
    pub(super) azimuth: Vec<f64>,
    /// cd, by azimuth.
    pub(super) candela: Vec<Vec<f64>>,
}

impl Profile {
    /// A profile of nothing but its light; what the file says besides is put in afterwards.
    pub(super) fn new(measured: MeasuredTable) -> Self {
        let MeasuredTable { angles, polar, .. } = measured;
        let full = unfolded(measured.symmetry, measured.azimuth, measured.candela);
        let (azimuth, candela): (Vec<f64>, Vec<Vec<f64>>) = full.into_iter().unzip();
        let mut profile = Self {
            luminaire: String::new(),
            format: String::new(),
            angles,
            lamps_lm: None,
            opening_m: [0.0; 3],
            tilt: Vec::new(),
            warnings: Vec::new(),
            polar: polar.into_iter().map(f64::to_radians).collect(),
            azimuth: azimuth.into_iter().map(f64::to_radians).collect(),
            candela: candela.into_iter().flatten().collect(),
            upto: Vec::new(),
            flux: 0.0,
        };
        let planes = (profile.azimuth.len() - 1).max(1);
        for k in 0..planes * (profile.polar.len() - 1) {
            profile.flux += profile.cell(k).1;
            profile.upto.push(profile.flux);
        }
        profile
    }

    /// Intensity toward a unit direction in the space of a glTF light (aim -Z, C0 +X, C90 +Y), cd.
    pub fn toward(&self, direction: DVec3) -> f64 {
        let [pole, zero, quarter] = self.angles.axes();
        let (z, x, y) = (
            direction.dot(pole),
            direction.dot(zero),
            direction.dot(quarter),
        );
        // Near the pole an arc cosine loses half its digits.
        let polar = (x * x + y * y).sqrt().atan2(z);
        let Some((row, along)) = place(&self.polar, polar) else {
            return 0.0;
        };
        let column = |plane: usize| {
            let at = plane * self.polar.len() + row;
            let next = if along > 0.0 {
                self.candela[at + 1]
            } else {
                0.0
            };
            between(self.candela[at], next, along)
        };
        if self.azimuth.len() == 1 {
            return column(0);
        }
        let mut azimuth = y.atan2(x);
        if azimuth < self.azimuth[0] {
            azimuth += TAU;
        }
        match place(&self.azimuth, azimuth) {
            None => 0.0,
            Some((plane, share)) if share > 0.0 => between(column(plane), column(plane + 1), share),
            Some((plane, _)) => column(plane),
        }
    }

    /// Luminous flux, lm.
    pub fn flux(&self) -> f64 {
        self.flux
    }

    /// Greatest intensity, cd.
    pub fn peak(&self) -> f64 {
        self.candela.iter().copied().fold(0.0, f64::max)
    }

    /// Share of the light that is left when the lamp is tilted by so many degrees from where it was measured.
    pub fn at_tilt(&self, degrees: f64) -> f64 {
        let (Some(first), Some(last)) = (self.tilt.first(), self.tilt.last()) else {
            return 1.0;
        };
        let at = degrees.clamp(first[0], last[0]);
        let k = self
            .tilt
            .partition_point(|t| t[0] <= at)
            .min(self.tilt.len() - 1);
        let (a, b) = (self.tilt[k.saturating_sub(1)], self.tilt[k]);
        if b[0] <= a[0] {
            return b[1];
        }
        a[1] + (b[1] - a[1]) * (at - a[0]) / (b[0] - a[0])
    }

    /// Angles (radians) and intensities that make it what it is, for fingerprints.
    pub fn numbers(&self) -> [&[f64]; 3] {
        [&self.polar, &self.azimuth, &self.candela]
    }

    /// Cell `k` of the table: its bounds (azimuths, polar angles, radians) and the flux through it, lm.
    fn cell(&self, k: usize) -> ([f64; 4], f64) {
        let rows = self.polar.len();
        let (plane, row) = (k / (rows - 1), k % (rows - 1));
        let (next, from, to) = match self.azimuth.len() {
            1 => (plane, -PI, PI),
            _ => (plane + 1, self.azimuth[plane], self.azimuth[plane + 1]),
        };
        let mean =
            |row: usize| 0.5 * (self.candela[plane * rows + row] + self.candela[next * rows + row]);
        let (p, q) = (self.polar[row], self.polar[row + 1]);
        let flux = (to - from) * zone(p, q, mean(row), mean(row + 1));
        ([from, to, p, q], flux)
    }

    /// A direction in the space of a glTF light, chosen from two numbers in [0, 1) about as the light is spread, and what makes up
    /// for "about": intensity over density (1/sr) and flux, 1 in the mean. None of a profile without light.
    pub fn direction(&self, [u, v]: [f64; 2]) -> Option<(DVec3, f64)> {
        let target = u * self.flux;
        let k = self.upto.partition_point(|&upto| upto <= target);
        let upto = *self.upto.get(k)?;
        let ([from, to, p, q], flux) = self.cell(k);
        let azimuth = to - (to - from) * ((upto - target) / flux).clamp(0.0, 1.0);
        let (high, low) = (p.cos(), q.cos());
        // Even over the cell.
        let cosine = high + (low - high) * v;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let [pole, zero, quarter] = self.angles.axes();
        let direction = pole * cosine + (zero * azimuth.cos() + quarter * azimuth.sin()) * sine;
        let solid = (to - from) * (high - low);
        Some((direction, self.toward(direction) * solid / flux))
    }

    /// Intensities of the half plane of an azimuth (degrees) and the one opposite, as `[angle from the axis, cd]` with angles from
    /// -180 to 180 degrees, for a polar curve. Types A and B: in the vertical plane (0) or the horizontal one (90).
    pub fn curve(&self, azimuth: f64) -> Vec<[f64; 2]> {
        let across = {
            let a = azimuth.to_radians();
            DVec3::X * a.cos() + DVec3::Y * a.sin()
        };
        (-360..=360)
            .map(|k| {
                let degrees = 0.5 * f64::from(k);
                let (sin, cos) = degrees.to_radians().sin_cos();
                let d = DVec3::NEG_Z * cos + across * sin;
                [degrees, self.toward(d.normalize())]
            })
            .collect()
    }
}

/// Place of `x` between ascending numbers: the last one not above it, and how far it is to the next. None outside.
fn place(list: &[f64], x: f64) -> Option<(usize, f64)> {
    // Rounding must not lose the first and last angles.
    const SLACK: f64 = 1e-9;
    let (first, last) = (*list.first()?, *list.last()?);
    if !(first - SLACK..=last + SLACK).contains(&x) {
        return None;
    }
    let k = list.partition_point(|&y| y <= x).saturating_sub(1);
    match list.get(k + 1) {
        None => Some((k, 0.0)),
        Some(next) => Some((k, ((x - list[k]) / (next - list[k])).clamp(0.0, 1.0))),
    }
}

/// Linear from `a` to `b`, and never outside of them by rounding.
fn between(a: f64, b: f64, share: f64) -> f64 {
    (a + share * (b - a)).clamp(a.min(b), a.max(b))
}

/// `int (I_p + (I_q - I_p) (t - p) / (q - p)) sin t dt` from p to q.
fn zone(p: f64, q: f64, at_p: f64, at_q: f64) -> f64 {
    let width = q - p;
    if width <= 0.0 {
        return 0.0;
    }
    let whole = p.cos() - q.cos();
    // int (t - p) sin t dt = sin q - sin p - (q - p) cos q
    let first = q.sin() - p.sin() - width * q.cos();
    at_p * whole + (at_q - at_p) * first / width
}

/// All planes, where a file has those of a part: azimuths in degrees.
fn unfolded(symmetry: Symmetry, azimuth: Vec<f64>, candela: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
    let mut planes: Vec<(f64, Vec<f64>)> = azimuth.into_iter().zip(candela).collect();
    let mirror = |planes: &mut Vec<(f64, Vec<f64>)>, about: f64| {
        let other: Vec<(f64, Vec<f64>)> = planes
            .iter()
            .map(|(a, row)| (2.0 * about - a, row.clone()))
            .collect();
        planes.extend(other);
    };
    match symmetry {
        Symmetry::None => {}
        Symmetry::Axial => planes.truncate(1),
        Symmetry::Plane0 => mirror(&mut planes, 0.0),
        Symmetry::Plane90 => mirror(&mut planes, 90.0),
        Symmetry::Quadrant => {
            mirror(&mut planes, 90.0);
            mirror(&mut planes, 0.0);
        }
    }
    planes.sort_by(|a, b| a.0.total_cmp(&b.0));
    planes.dedup_by(|b, a| b.0 - a.0 < SAME);
    // Planes that lack only their own first one close the circle.
    if let (Some(first), Some(last)) = (planes.first(), planes.last()) {
        let gap = first.0 + 360.0 - last.0;
        let step = planes
            .windows(2)
            .map(|w| w[1].0 - w[0].0)
            .fold(0.0, f64::max);
        if planes.len() > 2 && gap > SAME && gap <= 1.5 * step {
            let closing = (first.0 + 360.0, first.1.clone());
            planes.push(closing);
        }
    }
    planes
}
