//! Places a primitive in the world.
//!
//! A position p becomes M p; a normal n becomes the unit vector of sign(det M) cof(M) n, which is M^-T n up to length and
//! stands for singular M too; where det M < 0 the triangles are turned, so that fronts stay fronts
//! (glTF 2.0, section 3.7.4).

use crate::scene::Surface;
use crate::scene::check::{Check, Tally};
use crate::scene::primitive::Primitive;
use glam::{DMat3, DVec3, Vec3};

/// Twice the area of a triangle counts as nothing below this, times its longest edge and its farthest coordinate:
/// a few roundings of its corners.
const AREA_ROUNDING: f64 = 16.0 * f64::EPSILON;
const AGAIN: &str = "export the file again";

/// Places a primitive; none if nothing of it has an area, or it is out of all bounds (which is reported).
pub(crate) fn in_world(
    mut surface: Surface,
    read: &Primitive,
    tally: &mut Tally,
    check: &mut Check,
) -> Option<Surface> {
    let to_world = surface.to_world;
    let place = |p: &[f32; 3]| to_world.transform_point3(Vec3::from(*p).as_dvec3());
    surface.positions = read.positions.iter().map(place).collect();
    if !surface.positions.iter().all(|p| p.is_finite()) {
        check.problem(
            &surface.name,
            "has a position that is not finite in the world",
            AGAIN,
        );
        return None;
    }
    let linear = DMat3::from_mat4(to_world);
    let mirrored = linear.determinant() < 0.0;
    let positions = &surface.positions;
    surface.triangles = read
        .triangles
        .iter()
        .map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] })
        .filter(|triangle| has_area(triangle.map(|i| positions[i as usize])))
        .collect();
    let lost = read.triangles.len() - surface.triangles.len();
    tally.count(
        "triangles have no area and are left out",
        lost,
        &surface.name,
    );
    if surface.triangles.is_empty() {
        return None;
    }
    if let Some(normals) = &read.normals {
        let mut turned = normals_in_world(normals, &linear);
        let bad = replace_bad(&mut turned, &surface);
        tally.count(
            "normals have no direction and were replaced",
            bad,
            &surface.name,
        );
        surface.normals = Some(turned);
    }
    surface.texcoords.clone_from(&read.texcoords);
    surface.colors.clone_from(&read.colors);
    Some(surface)
}

fn has_area([a, b, c]: [DVec3; 3]) -> bool {
    let edges = [b - a, c - b, a - c];
    let longest = edges.iter().map(|e| e.length()).fold(0.0, f64::max);
    let farthest = [a, b, c]
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max);
    // Scaled first, so that neither tiny nor huge triangles leave the range of numbers.
    if longest <= 0.0 || !longest.is_finite() {
        return false;
    }
    let twice = (edges[0] / longest).cross(edges[2] / longest).length();
    twice > AREA_ROUNDING * (farthest / longest)
}

/// Unit normals; zero where there is no direction.
fn normals_in_world(normals: &[[f32; 3]], linear: &DMat3) -> Vec<Vec3> {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let sign = if linear.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let turn = |n: &[f32; 3]| {
        let n = cofactor * Vec3::from(*n).as_dvec3();
        // Scaled first: a cofactor is of the size of the matrix squared.
        let scale = n.abs().max_element();
        if scale > 0.0 && scale.is_finite() {
            ((n / scale).normalize() * sign).as_vec3()
        } else {
            Vec3::ZERO
        }
    };
    normals.iter().map(turn).collect()
}

/// Gives vertices without a direction the normal of a triangle there; returns how many (used ones) there were.
fn replace_bad(normals: &mut [Vec3], surface: &Surface) -> usize {
    let mut count = 0;
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|i| surface.positions[i as usize]);
        for &corner in triangle {
            let normal = &mut normals[corner as usize];
            if *normal == Vec3::ZERO {
                *normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
                count += 1;
            }
        }
    }
    for normal in normals.iter_mut().filter(|n| **n == Vec3::ZERO) {
        // No triangle uses it (or its cross product underflows): any unit vector keeps the promise of unit length.
        *normal = Vec3::Z;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;
    use proptest::prelude::*;

    fn surface(to_world: DMat4) -> Surface {
        Surface {
            name: "s".into(),
            node: 0,
            mesh: 0,
            primitive: 0,
            instance: None,
            material: 0,
            to_world,
            positions: Vec::new(),
            normals: None,
            texcoords: Vec::new(),
            colors: None,
            triangles: Vec::new(),
        }
    }

    #[test]
    fn what_counts_as_an_area_does_not_depend_on_the_unit() {
        for scale in [1e-150, 1e-9, 1.0, 1e9, 1e150] {
            let at = |x: f64, y: f64| DVec3::new(x, y, 0.0) * scale;
            // A sliver of aspect a million stays, a line and a point go.
            assert!(has_area([at(0.0, 0.0), at(1.0, 0.0), at(0.5, 1e-6)]));
            assert!(!has_area([at(0.0, 0.0), at(1.0, 1.0), at(3.0, 3.0)]));
            assert!(!has_area([at(0.0, 0.0), at(0.0, 0.0), at(1.0, 0.0)]));
            assert!(!has_area([at(1.0, 2.0); 3]));
        }
        // Details of a millimetre a thousand kilometres away.
        let far = DVec3::splat(1e6);
        let corner = |x: f64, y: f64| far + DVec3::new(x, y, 0.0);
        assert!(has_area([
            corner(0.0, 0.0),
            corner(1e-3, 0.0),
            corner(0.0, 1e-3)
        ]));
        assert!(!has_area([
            corner(0.0, 0.0),
            corner(1e-3, 1e-3),
            corner(2e-3, 2e-3)
        ]));
    }

    #[test]
    fn a_flattened_mesh_is_left_out_whole() {
        let read = Primitive {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            ..Primitive::default()
        };
        let (mut tally, mut check) = (Tally::default(), Check::new("f"));
        let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
        assert!(in_world(surface(flat), &read, &mut tally, &mut check).is_none());
        // Flat across its own plane it is the same triangle.
        let flat = DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0));
        assert!(in_world(surface(flat), &read, &mut tally, &mut check).is_some());
        let huge = DMat4::from_scale(DVec3::splat(f64::MAX));
        let read = Primitive {
            positions: vec![[9.0; 3]; 3],
            ..read
        };
        assert!(in_world(surface(huge), &read, &mut tally, &mut check).is_none());
        assert!(check.has_problems());
    }

    proptest! {
        /// Under any matrix the normal of a plane stays upright on it, on the side that the triangle shows.
        #[test]
        fn normals_stay_upright(m in prop::array::uniform9(-2.0f64..2.0), a in prop::array::uniform9(-1.0f32..1.0)) {
            let linear = glam::DMat3::from_cols_array(&m);
            prop_assume!(linear.determinant().abs() > 0.05);
            let positions: Vec<[f32; 3]> = a.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
            let [p, q, r] = [0, 1, 2].map(|i: usize| Vec3::from(positions[i]));
            let normal = (q - p).cross(r - p);
            prop_assume!(normal.length() > 0.05);
            let read = Primitive {
                positions,
                normals: Some(vec![normal.to_array(); 3]),
                triangles: vec![[0, 1, 2]],
                ..Primitive::default()
            };
            let (mut tally, mut check) = (Tally::default(), Check::new("f"));
            let placed = in_world(surface(DMat4::from_mat3(linear)), &read, &mut tally, &mut check).unwrap();
            let [a, b, c] = placed.triangles[0].map(|i| placed.positions[i as usize]);
            let front = (b - a).cross(c - a).normalize();
            let shading = placed.normals.unwrap()[0].as_dvec3();
            prop_assert!((front - shading).length() < 1e-3, "{front} {shading}");
        }
    }
}
