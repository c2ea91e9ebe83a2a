use super::super::profile::Profile;
use super::super::{Sides, Surface};
use super::Luminaire;
use crate::geometry::sampling::{Pcg, sequence02, sphere_direction};
use glam::{DMat4, DVec3, dvec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// 100 cd below the horizon and 50 cd above it, but for a step of half a degree: 300 pi lm.
fn both_ways() -> Arc<Profile> {
    let file =
        "IESNA91\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0 1 1 10\n0 89.75 90.25 180 0 100 100 50 50\n";
    Arc::new(Profile::parse(file.as_bytes()).unwrap())
}

/// Toward C0 only.
fn lopsided() -> Arc<Profile> {
    let file = "IESNA91\nTILT=NONE\n1 -1 1 2 5 1 2 0 0 0 1 1 10\n0 180 0 90 180 270 360 9 9 1 1 1 1 1 1 9 9\n";
    Arc::new(Profile::parse(file.as_bytes()).unwrap())
}

fn surface(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Surface {
    Surface {
        name: "lamp".into(),
        node: 0,
        mesh: 0,
        primitive: 0,
        instance: None,
        material: 0,
        to_world: DMat4::IDENTITY,
        positions,
        normals: None,
        texcoords: Vec::new(),
        colors: None,
        triangles,
    }
}

/// A square of 2 m at a height of 3 m that looks down.
fn panel() -> Surface {
    let at = |x: f64, z: f64| dvec3(x, 3.0, z);
    let corners = vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
    surface(corners, vec![[0, 1, 2], [0, 2, 3]])
}

/// An octahedron that looks out.
fn body() -> Surface {
    let ends = [DVec3::X, DVec3::Y, DVec3::Z];
    let corners: Vec<DVec3> = ends.into_iter().chain(ends.map(|e| -e)).collect();
    let triangles = (0..8_u32).map(|k| {
        let end = |axis: u32| if k >> axis & 1 == 1 { axis + 3 } else { axis };
        match k.count_ones() % 2 {
            0 => [end(0), end(1), end(2)],
            _ => [end(0), end(2), end(1)],
        }
    });
    surface(corners, triangles.collect())
}

fn mounted(profile: Arc<Profile>, surface: &Surface, sides: Sides) -> (Luminaire, DVec3) {
    Luminaire::on_surface(profile, (0, surface), sides, 0.0).unwrap()
}

/// What all of a surface sends toward a direction, over the flux.
fn sent(lamp: &Luminaire, d: DVec3) -> f64 {
    let triangles = lamp.triangles().iter();
    let each = triangles.map(|&[a, b, c]| {
        let cross = (b - a).cross(c - a);
        0.5 * cross.length() * lamp.per_area(d, cross.normalize())
    });
    each.sum()
}

#[test]
fn from_far_away_a_surface_has_the_intensity_of_its_profile() {
    let panel = mounted(lopsided(), &panel(), Sides::Front);
    assert_eq!(panel.1, dvec3(0.0, 3.0, 0.0));
    assert!((panel.0.nadir() - DVec3::NEG_Y).length() < 1e-12);
    let sheet = mounted(both_ways(), &self::panel(), Sides::Both).0;
    let body = mounted(lopsided(), &body(), Sides::Front).0;
    assert!((body.nadir() - DVec3::NEG_Y).length() < 1e-12);
    assert!((sheet.reach() - 1.0).abs() < 1e-9 && (body.reach() - 1.0).abs() < 1e-9);
    for k in 0..200 {
        let d = sphere_direction(sequence02(k, 3));
        // Seen from the side a sheet shows nothing.
        if d.y.abs() < 1e-6 {
            continue;
        }
        for lamp in [&sheet, &body] {
            let want = lamp.per_lumen(d);
            assert!((sent(lamp, d) / want - 1.0).abs() < 1e-9, "{d}");
        }
        let want = panel.0.per_lumen(d) / panel.0.reach();
        let want = if d.y < 0.0 { want } else { 0.0 };
        assert!((sent(&panel.0, d) - want).abs() < 1e-9, "{d}");
    }
    // C0 is the node's +X, C90 lies to its right as nadir is down.
    assert!(body.per_lumen(DVec3::X) > 5.0 * body.per_lumen(DVec3::NEG_X));
    let turned = Luminaire::on_surface(lopsided(), (0, &self::panel()), Sides::Front, 90.0);
    let turned = turned.unwrap().0;
    assert!(turned.per_lumen(DVec3::NEG_Z) > 5.0 * turned.per_lumen(DVec3::X));
}

#[test]
fn light_that_has_nowhere_to_go_is_counted() {
    let one_sided = mounted(both_ways(), &panel(), Sides::Front).0;
    assert!(
        (one_sided.reach() - 2.0 / 3.0).abs() < 5e-3,
        "{}",
        one_sided.reach()
    );
    // What is left is brought up: the flux is the file's.
    let n = 200_000;
    let flux = (0..n)
        .map(|k| sent(&one_sided, sphere_direction(sequence02(k, 1))))
        .sum::<f64>();
    assert!((flux * 4.0 * PI / f64::from(n) - 1.0).abs() < 5e-3);
    // A file that shines up only, on a surface that looks down.
    let up = "IESNA91\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0 1 1 10\n90 120 180 0 0 50 50\n";
    let up = Arc::new(Profile::parse(up.as_bytes()).unwrap());
    assert!(Luminaire::on_surface(up, (0, &panel()), Sides::Front, 0.0).is_none());
    let empty = surface(vec![DVec3::ZERO; 3], vec![[0, 1, 2]]);
    assert!(Luminaire::on_surface(both_ways(), (0, &empty), Sides::Front, 0.0).is_none());
}

#[test]
fn rays_of_a_lamp_are_its_light() {
    let lamps = [
        mounted(lopsided(), &body(), Sides::Front).0,
        mounted(both_ways(), &panel(), Sides::Front).0,
        Luminaire::at_node(lopsided(), &DMat4::IDENTITY, 0.0).unwrap(),
    ];
    for lamp in lamps {
        let n = 100_000;
        let (mut random, mut weights, mut along) = (Pcg::new(4), 0.0, DVec3::ZERO);
        for k in 0..n {
            let v = [random.f64(), random.f64()];
            let (start, d, weight) = lamp.ray(sequence02(k, 2), v).unwrap();
            assert!(start.length() <= lamp.radius() + 1e-12);
            weights += weight / f64::from(n);
            along += weight * d / f64::from(n);
        }
        let even = |k| sphere_direction(sequence02(k, 6));
        let toward = |d: DVec3| {
            if lamp.area() > 0.0 {
                sent(&lamp, d)
            } else {
                lamp.per_lumen(d)
            }
        };
        let want = (0..n).map(|k| toward(even(k)) * even(k) * 4.0 * PI / f64::from(n));
        let want: DVec3 = want.sum();
        assert!((weights - 1.0).abs() < 5e-3, "{weights}");
        assert!((along - want).length() < 5e-3, "{along} {want}");
    }
}

/// An untransformed light points down -Z, a scaled one too; a mirrored one mirrors its light.
#[test]
fn a_light_looks_along_its_node() {
    let lamp = |m: DMat4| Luminaire::at_node(lopsided(), &m, 0.0).unwrap();
    let plain = lamp(DMat4::IDENTITY);
    assert_eq!(plain.nadir(), DVec3::NEG_Z);
    assert!(plain.per_lumen(DVec3::X) > 5.0 * plain.per_lumen(DVec3::NEG_X));
    let scaled = lamp(DMat4::from_scale(DVec3::splat(7.0)));
    assert!((scaled.per_lumen(DVec3::X) - plain.per_lumen(DVec3::X)).abs() < 1e-12);
    let mirrored = lamp(DMat4::from_scale(dvec3(-1.0, 1.0, 1.0)));
    assert!((mirrored.per_lumen(DVec3::NEG_X) - plain.per_lumen(DVec3::X)).abs() < 1e-12);
    assert!(Luminaire::at_node(lopsided(), &DMat4::ZERO, 0.0).is_none());
}
