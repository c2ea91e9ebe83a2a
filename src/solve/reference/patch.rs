//! Patches of the reference, and rules over them.

use crate::spectrum::Spectrum;
use glam::DVec3;

/// A flat triangular patch, one side.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Corners, counter-clockwise from the front; recentred as in [`Mesh`](crate::hierarchy::Mesh).
    pub corners: [DVec3; 3],
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Plane id of the patch's triangle.
    pub plane: u32,
    /// Area.
    pub area: f64,
    /// Albedo.
    pub reflectance: Spectrum,
    /// Exitance, W/m2/nm.
    pub exitance: Spectrum,
    /// Irradiance from punctual lights, W/m2/nm.
    pub punctual: Spectrum,
    /// Index of the material.
    pub material: usize,
    /// Share of the light on the patch's other side that leaves this one.
    pub transmittance: Spectrum,
    /// The patch on the other side, if the material lets light through.
    pub behind: Option<usize>,
}

/// Radon's rule of degree 5 on a triangle (1948; Abramowitz and Stegun 1964, 25.4.63): weight, and weights of corners.
pub(super) fn radon() -> [(f64, [f64; 3]); 7] {
    let root = 15.0_f64.sqrt();
    let corner = |w: f64, a: f64| {
        let b = 1.0 - 2.0 * a;
        [(w, [b, a, a]), (w, [a, b, a]), (w, [a, a, b])]
    };
    let near = corner((155.0 - root) / 1200.0, (6.0 - root) / 21.0);
    let far = corner((155.0 + root) / 1200.0, (6.0 + root) / 21.0);
    [
        (9.0 / 40.0, [1.0 / 3.0; 3]),
        near[0],
        near[1],
        near[2],
        far[0],
        far[1],
        far[2],
    ]
}

pub(super) fn add(sum: &mut Spectrum, x: &Spectrum, weight: f64) {
    for (s, x) in sum.iter_mut().zip(x) {
        *s += weight * x;
    }
}

/// Where light is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct PatchPoint {
    pub(super) at: DVec3,
    pub(super) normal: DVec3,
    /// Plane that the place lies in: nothing in this plane blocks.
    pub(super) plane: u32,
}

impl Patch {
    /// A place on the patch, by weights of its corners.
    pub(super) fn place(&self, w: [f64; 3]) -> PatchPoint {
        PatchPoint {
            at: self.corners[0] * w[0] + self.corners[1] * w[1] + self.corners[2] * w[2],
            normal: self.normal,
            plane: self.plane,
        }
    }
}
