//! Flattening of curved surfaces, behind a trait of our own: the method may change, charts do not.

use glam::{DVec2, DVec3};

/// A chart's triangles never turn further than this from its mean normal, degrees: a texel's area on the surface then varies by
/// less than two within a chart.
const CONE_DEG: f32 = 60.0;
/// The unwrapper lays its charts out on a page where the surface's diagonal is this many texels; only their shapes are used.
const LAYOUT: f32 = 256.0;

/// A triangle in the plane: number of its chart, corners in metres, counter-clockwise.
pub(super) type Flat = (u32, [DVec2; 3]);

/// Lays curved surfaces flat.
pub(super) trait Unwrap {
    /// For each triangle its chart and corners, keeping lengths as well as it can; none: a triangle without area. Charts do
    /// not overlap themselves. None at all if the surface cannot be unwrapped.
    fn flatten(&self, positions: &[DVec3], triangles: &[[u32; 3]]) -> Option<Vec<Option<Flat>>>;
}

/// By the crate `uvunwrap`: segmentation by normal cones, least squares conformal maps refined to be as rigid as possible.
pub(super) struct Conformal;

impl Unwrap for Conformal {
    fn flatten(&self, positions: &[DVec3], triangles: &[[u32; 3]]) -> Option<Vec<Option<Flat>>> {
        let low = positions.iter().fold(DVec3::INFINITY, |l, p| l.min(*p));
        let high = positions.iter().fold(DVec3::NEG_INFINITY, |h, p| h.max(*p));
        let diagonal = (high - low).length();
        // Written so that NaN fails.
        if !(diagonal > 0.0 && diagonal.is_finite()) {
            return None;
        }
        // Of size 1, whatever the file's unit: the unwrapper works in single precision.
        let scaled = |p: &DVec3| ((*p - low) / diagonal).as_vec3().to_array();
        let scaled: Vec<[f32; 3]> = positions.iter().map(scaled).collect();
        let mesh = uvunwrap::MeshInput::new(&scaled, triangles.as_flattened());
        let options = uvunwrap::Options {
            max_chart_angle: CONE_DEG,
            packing: uvunwrap::Packing::Fast,
            padding: 1,
            allow_rotation: false,
            density: uvunwrap::Density::Fixed {
                texels_per_unit: LAYOUT,
                page_size: None,
            },
            ..uvunwrap::Options::default()
        };
        let atlas = uvunwrap::generate(&[mesh], &options).ok()?;
        let out = atlas.meshes.first()?;
        let size = DVec2::new(f64::from(atlas.width), f64::from(atlas.height));
        let size = size * (diagonal / f64::from(atlas.texels_per_unit));
        let (corners, _) = out.indices.as_chunks::<3>();
        let flat = |corners: &[u32; 3]| {
            let at = corners.map(|v| &out.vertices[v as usize]);
            let chart = at[0].chart?;
            let corners = at.map(|v| DVec2::from(v.uv.map(f64::from)) * size);
            let turns = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]);
            (turns > 0.0 && at.iter().all(|v| v.chart == Some(chart))).then_some((chart, corners))
        };
        Some(corners.iter().map(flat).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_tube_keeps_its_lengths() {
        let (sides, length) = (24_u32, 2.0);
        let ring = |z: f64| {
            (0..sides).map(move |k| {
                let angle = TAU * f64::from(k) / f64::from(sides);
                DVec3::new(0.5 * angle.cos(), 0.5 * angle.sin(), z)
            })
        };
        let positions: Vec<DVec3> = ring(0.0).chain(ring(length)).collect();
        let triangles: Vec<[u32; 3]> = (0..sides)
            .flat_map(|k| {
                let next = (k + 1) % sides;
                [[k, next, k + sides], [next, next + sides, k + sides]]
            })
            .collect();
        let flat = Conformal.flatten(&positions, &triangles).unwrap();
        assert_eq!(flat.len(), triangles.len());
        for (flat, triangle) in flat.iter().zip(&triangles) {
            let (_, at) = flat.unwrap();
            for k in 0..3 {
                let [a, b] = [k, (k + 1) % 3].map(|k| positions[triangle[k] as usize]);
                let ratio = at[k].distance(at[(k + 1) % 3]) / a.distance(b);
                assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
            }
        }
    }
}
