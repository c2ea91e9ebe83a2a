//! Bodies: boxes, rounded boxes, tubes and bodies of revolution.

use super::glb::Mesh;
use glam::{DVec3, dvec3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Greatest radius of a rounded edge, as a share of half the box: some flat face must be left.
const MOST_ROUND: f64 = 0.9;

/// A box between two corners. Faces without normals, corners shared.
pub(crate) fn block(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let corner = |i: usize| {
        DVec3::from_array(std::array::from_fn(|a| {
            if i >> a & 1 == 0 { low[a] } else { high[a] }
        }))
    };
    let triangles = vec![
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
    ];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles,
        ..Mesh::default()
    }
}

/// A box between two corners whose edges are rounded by `radius`, `steps` steps to a quarter of a circle;
/// 0 steps: a plain box with flat normals.
pub(crate) fn rounded(low: [f64; 3], high: [f64; 3], radius: f64, steps: usize) -> Mesh {
    let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
    let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let radius = if steps == 0 {
        0.0
    } else {
        radius.min(MOST_ROUND * half.min_element())
    };
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (across, down) = (ticks(half[u], radius, steps), ticks(half[v], radius, steps));
        for side in [-1.0, 1.0] {
            let first = mesh.positions.len() as u32;
            for y in &down {
                for x in &across {
                    let mut p = DVec3::ZERO;
                    (p[axis], p[u], p[v]) = (side * half[axis], *x, *y);
                    let inner = p.clamp(-(half - radius), half - radius);
                    let mut normal = p - inner;
                    if normal.length() < 1e-9 {
                        normal = DVec3::ZERO;
                        normal[axis] = side;
                    }
                    let normal = normal.normalize();
                    mesh.positions.push(
                        centre
                            + if radius > 0.0 {
                                inner + radius * normal
                            } else {
                                p
                            },
                    );
                    mesh.normals.push(normal);
                }
            }
            grid(
                &mut mesh,
                first,
                across.len() as u32,
                down.len() as u32,
                side > 0.0,
            );
        }
    }
    mesh
}

/// Coordinates along an edge of a rounded box: even angles over the two quarter arcs' halves, the flat between.
fn ticks(half: f64, radius: f64, steps: usize) -> Vec<f64> {
    if steps == 0 {
        return vec![-half, half];
    }
    let arc = |i: usize| half - radius + radius * (FRAC_PI_4 * i as f64 / steps as f64).tan();
    let upper: Vec<f64> = (0..=steps).map(arc).collect();
    upper
        .iter()
        .rev()
        .map(|x| -x)
        .chain(upper.iter().copied())
        .collect()
}

/// Triangles of a grid of vertices, row by row.
fn grid(mesh: &mut Mesh, first: u32, width: u32, height: u32, front: bool) {
    for y in 0..height - 1 {
        for x in 0..width - 1 {
            let a = first + y * width + x;
            let [b, c, d] = [a + 1, a + 1 + width, a + width];
            if front {
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                mesh.triangles.extend([[a, c, b], [a, d, c]]);
            }
        }
    }
}

/// A body of revolution about +Y through `base`: the profile's (radius, height) run upward outside, `around` steps.
/// Smooth. Where a radius is 0 the body is closed by a fan.
pub(crate) fn lathe(base: [f64; 3], profile: &[[f64; 2]], around: usize) -> Mesh {
    let base = DVec3::from_array(base);
    let mut mesh = Mesh::default();
    let last = profile.len() - 1;
    for (row, [radius, height]) in profile.iter().enumerate() {
        let (before, after) = (profile[row.saturating_sub(1)], profile[(row + 1).min(last)]);
        let (rise, run) = (after[1] - before[1], after[0] - before[0]);
        for i in 0..around {
            let (sin, cos) = (TAU * i as f64 / around as f64).sin_cos();
            mesh.positions
                .push(base + dvec3(radius * cos, *height, radius * sin));
            let normal = match *radius {
                0.0 => dvec3(0.0, if row == 0 { -1.0 } else { 1.0 }, 0.0),
                _ => dvec3(rise * cos, -run, rise * sin).normalize(),
            };
            mesh.normals.push(normal);
        }
    }
    let around = around as u32;
    for row in 0..last as u32 {
        for i in 0..around {
            let j = (i + 1) % around;
            let [a, b] = [i, j].map(|k| row * around + k);
            let [c, d] = [i, j].map(|k| (row + 1) * around + k);
            if profile[row as usize][0] > 0.0 {
                mesh.triangles.push([a, d, b]);
            }
            if profile[row as usize + 1][0] > 0.0 {
                mesh.triangles.push([a, c, d]);
            }
        }
    }
    mesh
}

/// A sphere, `around` steps about the equator.
pub(crate) fn sphere(centre: [f64; 3], radius: f64, around: usize) -> Mesh {
    let rows = (around / 2).max(2);
    let profile: Vec<[f64; 2]> = (0..=rows)
        .map(|i| {
            let (sin, cos) = (TAU / 2.0 * i as f64 / rows as f64).sin_cos();
            [
                if i == 0 || i == rows {
                    0.0
                } else {
                    radius * sin
                },
                -radius * cos,
            ]
        })
        .collect();
    lathe(centre, &profile, around)
}

/// An upright tube without ends: a leg between a floor and a board.
pub(crate) fn tube(base: [f64; 3], radius: f64, height: f64, around: usize) -> Mesh {
    lathe(base, &[[radius, 0.0], [radius, height]], around)
}

/// A four-sided face with the whole of a texture on it: upper left, upper right, lower right, lower left as seen.
pub(crate) fn picture(corners: [[f64; 3]; 4]) -> Mesh {
    let positions = corners.map(DVec3::from_array);
    Mesh {
        positions: positions.to_vec(),
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        ..Mesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume inside of a closed mesh whose fronts show outward.
    fn volume(mesh: &Mesh) -> f64 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.triangles
            .iter()
            .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0)
            .sum()
    }

    fn normals_show_outward(mesh: &Mesh) -> bool {
        mesh.triangles.iter().all(|t| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let flat = (b - a).cross(c - a);
            flat.length() > 0.0 && t.iter().all(|i| mesh.normals[*i as usize].dot(flat) > 0.0)
        })
    }

    #[test]
    fn boxes_hold_their_volume() {
        let (low, high) = ([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]);
        assert!((volume(&block(low, high)) - 6.0).abs() < 1e-12);
        assert!((volume(&rounded(low, high, 0.2, 0)) - 6.0).abs() < 1e-12);
        for steps in 1..5 {
            let body = rounded(low, high, 0.2, steps);
            assert!(normals_show_outward(&body));
            // Less than the box, more than the box without its rounded edges.
            assert!(
                volume(&body) < 6.0 && volume(&body) > 6.0 - 0.04 * 24.0 * (1.0 - TAU / 8.0) - 0.1
            );
        }
    }

    #[test]
    fn bodies_of_revolution_hold_their_volume() {
        let ball = sphere([1.0, 2.0, 3.0], 0.5, 64);
        assert!((volume(&ball) / (TAU * 2.0 / 3.0 * 0.125) - 1.0).abs() < 0.01);
        assert!(normals_show_outward(&ball));
        assert!(normals_show_outward(&tube([0.0; 3], 0.1, 1.0, 6)));
        let cylinder = lathe(
            [0.0; 3],
            &[[0.0, 0.0], [0.5, 0.0], [0.5, 2.0], [0.0, 2.0]],
            100,
        );
        assert!((volume(&cylinder) / (TAU / 2.0 * 0.25 * 2.0) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_picture_shows_its_front() {
        let face = picture([
            [0.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
        ]);
        let [a, b, c] = face.triangles[0].map(|i| face.positions[i as usize]);
        assert!((b - a).cross(c - a).z > 0.0);
    }
}
