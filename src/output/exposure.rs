//! Exposure: which radiosity shows as white, metered from the room.
//!
//! display = scale * radiosity, both linear, radiosity in lm/m2, display white = 1.
//! The rule: of what does not shine itself, 99 % of what each camera sees and 97 % of the area that light reaches are shown
//! unclipped, in each of the three channels. What is left over is spots beside lamps and tops of cupboards below them.
//! Colours are scaled and never bent, so a coloured light (whose strongest channel is well above its luminance) gets a
//! darker picture than a white one of equal luminance.
//! The meter reads `light` (radiosity over the paint's texture) and not the radiosity itself: `light` is what COLOR_0
//! holds, which glTF confines to [0, 1], so a dark texture must not push it out of range. It is the incident-light
//! metering of photography: a dark wooden room comes out dark.

use super::camera::{self, View};
use super::raster::{self, Hit, Refined};
use crate::gather::refined;
use crate::gather::{BakedSurface, BakedVertex};
use crate::scene::{Camera, Scene, Surface};
use glam::DVec3;

/// Share of what each camera sees, lamps left out, that is shown unclipped. Higher: darker pictures, fewer clipped spots.
const SEEN: f64 = 0.99;

/// The same for the lit area, seen or not: the baked room is walked through. Lower than [`SEEN`], for the brightest
/// places of a room are small and near the ceiling, where nobody looks.
const AREA: f64 = 0.97;

/// Size of the trial pictures that are metered.
const TRIAL: [usize; 2] = [160, 120];

/// Area whose reading is below this share of the brightest is unlit: backs of walls, floors under furniture. A room
/// would be metered by what no light reaches if it counted.
const UNLIT: f64 = 1e-4;

/// Luminance weights of linear sRGB (IEC 61966-2-1, ITU-R BT.709 primaries).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// How radiosity becomes a display value.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Exposure {
    /// Display value (1 = white) for each lm/m2 of radiosity.
    pub scale: f64,
}

impl Exposure {
    /// The given factor from radiosity in lm/m2 to display value.
    pub fn new(scale: f64) -> Self {
        Self { scale }
    }

    /// Luminance of a diffuse surface that shows as white, cd/m2.
    pub fn white_luminance(&self) -> f64 {
        1.0 / (self.scale * std::f64::consts::PI)
    }

    /// Meters the room: see the module's words.
    ///
    /// Lamps are left out unless nothing else is lit. A black room gets a scale of 1.
    pub fn auto(scene: &Scene, surfaces: &[BakedSurface]) -> Self {
        let meshes = Refined { scene, surfaces };
        let cameras = camera::cameras(scene);
        let level = |lamps| {
            let seen = cameras
                .iter()
                .filter_map(|camera| percentile(seen(&meshes, camera, lamps), SEEN));
            seen.chain(percentile(areas(&meshes, lamps), AREA))
                .reduce(f64::max)
        };
        Self::new(
            level(false)
                .or(level(true))
                .map_or(1.0, |level| 1.0 / level),
        )
    }
}

/// The level that a share of the weight of all lit (level, weight) stays below; none if all is dark.
fn percentile(mut readings: Vec<(f64, f64)>, share: f64) -> Option<f64> {
    readings.retain(|r| r.0 > 0.0 && r.0.is_finite());
    // Stable, so that equal readings are summed in one order on every machine.
    readings.sort_by(|a, b| a.0.total_cmp(&b.0));
    let brightest = readings.last()?.0;
    let lit = &readings[readings.partition_point(|r| r.0 <= UNLIT * brightest)..];
    let total: f64 = lit.iter().map(|r| r.1).sum();
    let mut below = 0.0;
    let level = lit.iter().find(|r| {
        below += r.1;
        below >= share * total
    });
    // Rounding may leave the last reading out of the sum.
    level.or(lit.last()).map(|r| r.0)
}

/// Strongest channel of what COLOR_0 holds before exposure, lm/m2.
fn strongest(surface: &Surface, vertex_paint: bool, vertex: &BakedVertex) -> f64 {
    let paint = if vertex_paint {
        refined::vertex_color(surface, vertex)
    } else {
        [1.0; 4]
    };
    let channels = vertex.light.into_iter().zip(paint);
    channels.map(|(l, p)| f64::from(l * p)).fold(0.0, f64::max)
}

/// One reading for each pixel of a small picture.
fn seen(meshes: &Refined, camera: &Camera, lamps: bool) -> Vec<(f64, f64)> {
    let [width, height] = TRIAL;
    let read = |hit: &Hit| {
        let (surface, corners) = meshes.at(hit);
        let material = &meshes.scene.materials[surface.material];
        let level =
            |k: usize| hit.weights[k] * strongest(surface, material.vertex_paint, corners[k]);
        (material.emission.is_some() == lamps).then(|| (level(0) + level(1) + level(2), 1.0))
    };
    let view = View::new(meshes.scene, camera, width, height);
    let pixels = raster::draw(meshes, &view, TRIAL, 1, |row| {
        row.iter().map(|hit| hit.as_ref().and_then(read)).collect()
    });
    pixels.into_iter().flatten().collect()
}

/// One reading for each triangle, with its area in squared file units.
fn areas(meshes: &Refined, lamps: bool) -> Vec<(f64, f64)> {
    let mut readings = Vec::new();
    for baked in meshes.surfaces {
        let surface = &meshes.scene.surfaces[baked.surface];
        let material = &meshes.scene.materials[surface.material];
        if material.emission.is_some() != lamps {
            continue;
        }
        let levels: Vec<f64> = (baked.vertices.iter())
            .map(|v| strongest(surface, material.vertex_paint, v))
            .collect();
        let places: Vec<DVec3> = (baked.vertices.iter())
            .map(|v| refined::position(surface, v))
            .collect();
        for corners in baked.triangles.iter().map(|t| t.map(|v| v as usize)) {
            let [a, b, c] = corners.map(|v| places[v]);
            let level = corners.iter().map(|&v| levels[v]).sum::<f64>() / 3.0;
            readings.push((level, 0.5 * (b - a).cross(c - a).length()));
        }
    }
    readings
}

/// The nearest colour of the same luminance and hue inside [0, 1]: mixed with its grey until it fits; white if brighter.
pub(crate) fn into_display(rgb: [f64; 3]) -> [f64; 3] {
    let grey: f64 = rgb.iter().zip(LUMINANCE).map(|(c, w)| c * w).sum();
    if grey >= 1.0 {
        return [1.0; 3];
    }
    if grey <= 0.0 || grey.is_nan() {
        return [0.0; 3];
    }
    // `keep` is how much of the colour's distance from grey fits; each channel gives a limit.
    let keep = rgb.iter().fold(1.0f64, |keep, &c| {
        if c > 1.0 {
            keep.min((1.0 - grey) / (c - grey))
        } else if c < 0.0 {
            keep.min(grey / (grey - c))
        } else {
            keep
        }
    });
    rgb.map(|c| (grey + keep * (c - grey)).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_inside_are_left_alone() {
        assert_eq!(into_display([0.2, 0.5, 1.0]), [0.2, 0.5, 1.0]);
    }

    #[test]
    fn clipping_keeps_luminance_and_order() {
        let bright = [1.4, 0.6, 0.2];
        let shown = into_display(bright);
        let y = |c: [f64; 3]| c.iter().zip(LUMINANCE).map(|(c, w)| c * w).sum::<f64>();
        assert!((y(shown) - y(bright)).abs() < 1e-12);
        assert!((shown[0] - 1.0).abs() < 1e-12 && shown[0] > shown[1] && shown[1] > shown[2]);
        let outside = [-0.2, 0.5, 0.1];
        let shown = into_display(outside);
        assert!((y(shown) - y(outside)).abs() < 1e-12);
        assert!(shown[0].abs() < 1e-12);
        assert_eq!(into_display([9.0, 2.0, 1.0]), [1.0; 3]);
    }
}
