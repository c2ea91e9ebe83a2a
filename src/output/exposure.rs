//! Exposure: which radiosity shows as white, metered from the room.
//!
//! display = scale * radiosity, both linear, radiosity in lm/m2, display white = 1.
//! The meter reads `light` (radiosity over the paint's texture) and not the radiosity itself: `light` is what COLOR_0
//! holds, which glTF confines to [0, 1], so a dark texture must not push it out of range. It is the incident-light
//! metering of photography: a dark wooden room comes out dark.

use super::refined;
use crate::gather::BakedSurface;
use crate::scene::Scene;

/// Share of the lamp-free area that stays below [`METERED_LEVEL`]. Higher: darker pictures, fewer clipped spots by lamps.
const PERCENTILE: f64 = 0.96;

/// Display level that the percentile is brought to; the headroom keeps the brightest wall off pure white.
const METERED_LEVEL: f64 = 0.9;

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

    /// Meters the room: the 96th percentile by area of what does not shine itself is shown at 0.9.
    ///
    /// Lamps are left out unless there is nothing else. A black room gets a scale of 1.
    pub fn auto(scene: &Scene, surfaces: &[BakedSurface]) -> Self {
        let mut readings = readings(scene, surfaces, |emits| !emits);
        if readings.is_empty() {
            readings = self::readings(scene, surfaces, |_| true);
        }
        // Stable, so that equal readings are summed in one order on every machine.
        readings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = readings.iter().map(|r| r.1).sum();
        let mut below = 0.0;
        let reading = readings.iter().find(|r| {
            below += r.1;
            below >= PERCENTILE * total
        });
        // Darkness up to the percentile (a spot in a black hall): meter the brightest point instead.
        let level = reading
            .or(readings.last())
            .map(|r| r.0)
            .filter(|&level| level > 0.0);
        match level.or(readings.last().map(|r| r.0)) {
            Some(level) if level > 0.0 => Self::new(METERED_LEVEL / level),
            _ => Self::new(1.0),
        }
    }
}

/// (luminance of `light` in lm/m2, area in squared file units) of the surfaces picked by `pick`.
fn readings(
    scene: &Scene,
    surfaces: &[BakedSurface],
    pick: impl Fn(bool) -> bool,
) -> Vec<(f64, f64)> {
    let mut readings = Vec::new();
    for baked in surfaces {
        let Some(surface) = scene.surfaces.get(baked.surface) else {
            continue;
        };
        if !scene
            .materials
            .get(surface.material)
            .is_some_and(|m| pick(m.emission.is_some()))
        {
            continue;
        }
        for triangle in &baked.triangles {
            let corners = triangle.map(|v| &baked.vertices[v as usize]);
            let [a, b, c] = corners.map(|v| refined::position(surface, v));
            let area = 0.5 * (b - a).cross(c - a).length();
            let level = corners.iter().map(|v| luminance(v.light)).sum::<f64>() / 3.0;
            if area > 0.0 && level.is_finite() {
                readings.push((level, area));
            }
        }
    }
    readings
}

/// Luminance of a linear sRGB colour, in its own unit.
pub(crate) fn luminance(rgb: [f32; 3]) -> f64 {
    rgb.iter()
        .zip(LUMINANCE)
        .map(|(&c, w)| f64::from(c) * w)
        .sum()
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
