//! Edges of shadows are lines of the mesh that is written: light on either side of them is its own.

use crate::common::built;

use built::Room;
use glam::{DVec3, dvec3};
use haarlight::gather::Baked;
use haarlight::gather::refined::position;
use haarlight::mesh::Limits;
use haarlight::scene::{LightKind, Scene};
use haarlight::solve::Bake;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// How far from the edge a point may be on its wrong side.
const NEAR: f64 = 0.02;

fn baked(scene: Scene) -> (Bake, Baked) {
    baked_to(1.0, scene)
}

fn baked_to(error: f64, scene: Scene) -> (Bake, Baked) {
    let bake = built::baked_to(error, scene);
    let baked = bake.baked(&|_, _| {});
    (bake, baked)
}

fn vertices(baked: &Baked) -> usize {
    baked.surfaces.iter().map(|s| s.vertices.len()).sum()
}

/// What is written in a plane through the origin: corners of the triangles that face as it does, and irradiance there.
struct Plane {
    normal: DVec3,
    triangles: Vec<[(DVec3, f64); 3]>,
}

impl Plane {
    fn of(bake: &Bake, baked: &Baked, normal: DVec3) -> Self {
        let all = baked.surfaces.iter().flat_map(|part| {
            let surface = &bake.scene().surfaces[part.surface];
            let corner = move |v: u32| {
                let v = &part.vertices[v as usize];
                (position(surface, v), f64::from(v.irradiance[1]))
            };
            part.triangles.iter().map(move |t| t.map(corner))
        });
        let lies_in_it = |corners: &[(DVec3, f64); 3]| {
            let [a, b, c] = corners.map(|corner| corner.0);
            let n = (b - a).cross(c - a);
            n.dot(normal) >= 0.99 * n.length() && a.dot(normal).abs() <= 1e-6
        };
        Self {
            normal,
            triangles: all.filter(lies_in_it).collect(),
        }
    }

    /// The triangle that holds a place, and how much each of its corners counts there.
    fn held(&self, at: DVec3) -> (&[(DVec3, f64); 3], [f64; 3]) {
        let all = self.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| corner.0);
            let n = (b - a).cross(c - a);
            let weight = |p: DVec3, q: DVec3| (p - at).cross(q - at).dot(n) / n.length_squared();
            let weights = [weight(b, c), weight(c, a), weight(a, b)];
            let least = weights.into_iter().fold(f64::INFINITY, f64::min);
            (least, corners, weights)
        });
        let (_, corners, weights) = all.reduce(|x, y| if y.0 > x.0 { y } else { x }).unwrap();
        (corners, weights)
    }

    /// Irradiance at a place as a viewer draws it.
    fn drawn(&self, at: DVec3) -> f64 {
        let (corners, weights) = self.held(at);
        (0..3).map(|k| weights[k] * corners[k].1).sum()
    }

    fn show(&self, at: DVec3) {
        eprintln!("   in {:.4?}", self.held(at).0);
    }
}

type Ends = [[u32; 3]; 2];

/// The ends of an edge whichever way it runs, and its way.
fn ends_of(p: DVec3, q: DVec3) -> (Ends, i32) {
    let bits = |p: DVec3| (p.as_vec3() + 0.0).to_array().map(f32::to_bits);
    let mut ends = [bits(p), bits(q)];
    let way = if ends[0] < ends[1] { 1 } else { -1 };
    ends.sort_unstable();
    (ends, way)
}

/// Edges of triangles that are not shared by two which run along it in opposite ways.
fn borders(triangles: impl Iterator<Item = [DVec3; 3]>) -> Vec<(i32, DVec3, DVec3)> {
    let mut edges: HashMap<Ends, (i32, DVec3, DVec3)> = HashMap::new();
    for at in triangles {
        for k in 0..3 {
            let (p, q) = (at[k], at[(k + 1) % 3]);
            let (ends, way) = ends_of(p, q);
            edges.entry(ends).or_insert((0, p, q)).0 += way;
        }
    }
    edges.into_values().filter(|(sum, ..)| *sum != 0).collect()
}

/// Is every edge shared by two triangles that was no border of the input surface?
fn no_cracks(bake: &Bake, baked: &Baked) {
    for part in &baked.surfaces {
        let surface = &bake.scene().surfaces[part.surface];
        let written = part.triangles.iter();
        let written = written.map(|t| t.map(|v| position(surface, &part.vertices[v as usize])));
        let input = surface.triangles.iter();
        let input: Vec<_> = borders(input.map(|t| t.map(|v| surface.positions[v as usize])))
            .into_iter()
            .collect();
        for (sum, p, q) in borders(written) {
            let on_border = input.iter().any(|(_, a, b)| {
                let off = |x: DVec3| {
                    let t = ((x - *a).dot(*b - *a) / (*b - *a).length_squared()).clamp(0.0, 1.0);
                    a.lerp(*b, t).distance(x)
                };
                off(p) < 1e-6 && off(q) < 1e-6
            });
            assert!(
                on_border && sum.abs() == 1,
                "{sum} {p} {q} of {}",
                surface.name
            );
        }
    }
}

/// A floor of 4 m by 4 m and a square of 1 m by 1 m at a height of 1 m, turned.
fn square_above_floor() -> (Room, [DVec3; 4]) {
    let mut room = Room::new();
    let (floor, shade) = (room.paint(0.3), room.paint(0.0));
    room.two_sided(shade);
    let corner = dvec3(-2.0, 0.0, -2.0);
    room.quad(corner, 4.0 * DVec3::Z, 4.0 * DVec3::X, floor);
    let (u, v) = (dvec3(0.9, 0.0, 0.43), dvec3(-0.43, 0.0, 0.9));
    let low = dvec3(-0.31, 1.0, -0.73);
    let corners = [low, low + v, low + u + v, low + u];
    room.quad(low, v, u, shade);
    (room, corners)
}

/// How far inside a convex outline on the floor a place is; below 0 outside.
fn inside(outline: &[DVec3], at: DVec3) -> f64 {
    let middle = outline.iter().sum::<DVec3>() / outline.len() as f64;
    let of = |k: usize| {
        let (a, b) = (outline[k], outline[(k + 1) % outline.len()]);
        let across = DVec3::Y.cross(b - a).normalize();
        (at - a).dot(across) * (middle - a).dot(across).signum()
    };
    (0..outline.len()).map(of).fold(f64::INFINITY, f64::min)
}

/// Places on the floor further than [`NEAR`] from all outlines whose light is nearer to that of the other side. `expected` tells light
/// without shadows of each lamp at a place.
fn wrong(
    (bake, baked): &(Bake, Baked),
    outlines: &[Vec<DVec3>],
    expected: impl Fn(usize, DVec3) -> f64,
) -> usize {
    let (floor, mut wrong) = (Plane::of(bake, baked, DVec3::Y), 0);
    for k in 0..160 * 160 {
        let (x, z) = (f64::from(k % 160) + 0.37, f64::from(k / 160) + 0.61);
        let at = dvec3(-2.0 + x / 40.0, 0.0, -2.0 + z / 40.0);
        let depths: Vec<f64> = outlines.iter().map(|o| inside(o, at)).collect();
        if depths.iter().any(|d| d.abs() < NEAR) {
            continue;
        }
        let all: Vec<f64> = (0..outlines.len()).map(|l| expected(l, at)).collect();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let truth: f64 = (0..all.len())
            .map(|l| if depths[l] > 0.0 { 0.0 } else { all[l] })
            .sum();
        let light = floor.drawn(at);
        if (light - truth).abs() > 0.5 * least {
            eprintln!("{at} drawn {light} true {truth}");
            floor.show(at);
            wrong += 1;
        }
    }
    wrong
}

fn thrown(corners: &[DVec3; 4], lamp: DVec3) -> Vec<DVec3> {
    let to_floor = |c: &DVec3| lamp + (*c - lamp) * (lamp.y / (lamp.y - c.y));
    corners.iter().map(to_floor).collect()
}

/// The square's shadow under parallel light, a point and a spot, one line for each side, and few vertices.
#[test]
fn the_shadow_of_a_square() {
    let toward = dvec3(-0.4, -1.0, 0.3).normalize();
    let lamp = dvec3(0.6, 2.7, -0.5);
    let cone = LightKind::Spot {
        inner: 1.2,
        outer: 1.4,
    };
    for kind in [LightKind::Directional, LightKind::Point, cone] {
        let (mut room, corners) = square_above_floor();
        let place = if kind.is_parallel() {
            DVec3::ZERO
        } else {
            lamp
        };
        let direction = if kind.is_parallel() {
            toward
        } else {
            DVec3::NEG_Y
        };
        room.punctual(kind, place, direction, 1000.0);
        let outline = match kind.is_parallel() {
            true => corners.map(|c| c - toward * (c.y / toward.y)).to_vec(),
            false => thrown(&corners, lamp),
        };
        let light = |_: usize, at: DVec3| match kind {
            LightKind::Directional => -1000.0 * toward.y,
            _ => {
                let d = lamp - at;
                let along = d.y / d.length();
                let spot = match kind {
                    LightKind::Spot { inner, outer } => {
                        let share = (along - outer.cos()) / (inner.cos() - outer.cos());
                        share.clamp(0.0, 1.0).powi(2)
                    }
                    _ => 1.0,
                };
                1000.0 * spot * along / d.length_squared()
            }
        };
        let out = baked(room.scene());
        let count = vertices(&out.1);
        let wrong = wrong(&out, &[outline], light);
        eprintln!("{kind:?}: {count} vertices, {wrong} places wrong");
        no_cracks(&out.0, &out.1);
        assert_eq!(wrong, 0, "{kind:?}");
        assert!(count < 2000, "{kind:?}: {count}");
    }
}

/// The round shadow of a disc of 32 corners, where growing ends before it has found them all: lines are carried on around it. A limit
/// of vertices that is not reached changes nothing.
#[test]
fn the_shadow_of_a_disc() {
    let mut room = Room::new();
    let (floor, shade) = (room.paint(0.3), room.paint(0.0));
    room.two_sided(shade);
    room.quad(
        dvec3(-2.0, 0.0, -2.0),
        4.0 * DVec3::Z,
        4.0 * DVec3::X,
        floor,
    );
    let turn = |k: u32| {
        let (sin, cos) = (f64::from(k) * TAU / 32.0).sin_cos();
        dvec3(cos, 0.0, sin)
    };
    let corners: Vec<DVec3> = (0..32)
        .map(|k| dvec3(-0.2, 1.0, -0.4) + 0.7 * turn(k))
        .collect();
    room.polygon(&corners, shade);
    let toward = dvec3(-0.4, -1.0, 0.3).normalize();
    room.punctual(LightKind::Directional, DVec3::ZERO, toward, 1000.0);
    let outline = corners.iter().map(|c| c - toward * (c.y / toward.y));
    let out = baked_to(8.0, room.scene());
    let wrong = wrong(&out, &[outline.collect()], |_, _| -1000.0 * toward.y);
    let count = vertices(&out.1);
    eprintln!("{count} vertices, {wrong} places wrong");
    no_cracks(&out.0, &out.1);
    assert_eq!(wrong, 0);
    assert!(count < 2000, "{count}");
    let limits = Limits {
        vertices: Some(10 * count),
        ..Limits::default()
    };
    let limited = out.0.baked_within(&limits, &|_, _| {});
    for (free, limited) in out.1.surfaces.iter().zip(&limited.surfaces) {
        assert_eq!(free.triangles, limited.triangles);
    }
}

/// Shadows of one square from two lamps cross.
#[test]
fn two_shadows_cross() {
    let (mut room, corners) = square_above_floor();
    let lamps = [dvec3(0.6, 2.7, -0.5), dvec3(-0.5, 2.4, 0.1)];
    for lamp in lamps {
        room.punctual(LightKind::Point, lamp, DVec3::NEG_Y, 1000.0);
    }
    let outlines: Vec<Vec<DVec3>> = lamps.iter().map(|l| thrown(&corners, *l)).collect();
    let light = |l: usize, at: DVec3| {
        let d = lamps[l] - at;
        1000.0 * d.y / d.length().powi(3)
    };
    let out = baked(room.scene());
    let count = vertices(&out.1);
    let wrong = wrong(&out, &outlines, light);
    eprintln!("two lamps: {count} vertices, {wrong} places wrong");
    no_cracks(&out.0, &out.1);
    assert_eq!(wrong, 0);
    assert!(count < 2000, "{count}");
}

/// Light at random places of a floor and a wall that lie further than [`NEAR`] from where light ends, for a ray tells which.
fn agrees(
    out: &(Bake, Baked),
    places: &[(DVec3, DVec3)],
    hidden: impl Fn(DVec3) -> bool,
    full: impl Fn(DVec3) -> f64,
) -> usize {
    let around = [DVec3::X, DVec3::Y, DVec3::Z].map(|d| [NEAR * d, -NEAR * d]);
    let even = |p: DVec3, n: DVec3| {
        let near = around.iter().flatten().filter(|d| d.dot(n) == 0.0);
        near.map(|d| hidden(p + *d)).all(|h| h == hidden(p))
    };
    let planes = [DVec3::Y, DVec3::Z].map(|n| Plane::of(&out.0, &out.1, n));
    let wrong = places.iter().filter(|(p, n)| {
        let plane = planes.iter().find(|plane| plane.normal == *n).unwrap();
        let truth = if hidden(*p) { 0.0 } else { full(*n) };
        let light = plane.drawn(*p);
        let off = even(*p, *n) && (light - truth).abs() > 0.25 * full(*n);
        if off {
            eprintln!("{p} facing {n}: drawn {light}, true {truth}");
            plane.show(*p);
        }
        off
    });
    wrong.count()
}

/// A column that stands before a wall: its shadow begins at its base without a comb, runs over the floor and up the wall.
#[test]
fn from_the_base_of_a_column_around_the_corner() {
    let mut room = Room::new();
    let paint = room.paint(0.0);
    room.quad(dvec3(-2.0, 0.0, 0.0), 3.0 * DVec3::Z, 4.0 * DVec3::X, paint);
    room.quad(dvec3(-2.0, 0.0, 0.0), 4.0 * DVec3::X, 2.5 * DVec3::Y, paint);
    let (low, high) = (dvec3(0.3, 0.0, 1.1), dvec3(0.55, 2.0, 1.37));
    room.block(low, high, paint);
    let toward = dvec3(-0.45, -0.5, -0.9).normalize();
    room.punctual(LightKind::Directional, DVec3::ZERO, toward, 1000.0);
    let out = baked(room.scene());
    let count = vertices(&out.1);
    // Slabs of the box that the ray to the sun passes.
    let hidden = |p: DVec3| {
        let d = -toward;
        let (mut from, mut to) = (0.0f64, f64::INFINITY);
        for k in 0..3 {
            let (a, b) = ((low[k] - p[k]) / d[k], (high[k] - p[k]) / d[k]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        from < to
    };
    let mut places = Vec::new();
    for k in 0..120 * 75 {
        let (u, v) = (f64::from(k % 120) + 0.41, f64::from(k / 120) + 0.53);
        let (x, y) = (-2.0 + u / 30.0, v / 30.0);
        places.push((dvec3(x, y, 0.0), DVec3::Z));
        let floor = dvec3(x, 0.0, y);
        let below = floor.x > low.x && floor.x < high.x && floor.z > low.z && floor.z < high.z;
        if !below {
            places.push((floor, DVec3::Y));
        }
    }
    let wrong = agrees(&out, &places, hidden, |n| -1000.0 * toward.dot(n));
    eprintln!(
        "column: {count} vertices, {wrong} of {} places wrong",
        places.len()
    );
    no_cracks(&out.0, &out.1);
    assert_eq!(wrong, 0);
    assert!(count < 2000, "{count}");
}

/// A wall that runs on above the ceiling, out of the light: no vertex of the room is dark for it, and none above is lit. Both see the
/// same wall outside, so that they are one space.
fn lit_below((corners, triangles): (Vec<DVec3>, Vec<[u32; 3]>), wall_first: bool) {
    let mut room = Room::new();
    let paint = room.paint(0.3);
    room.two_sided(paint);
    let (x, z) = (4.0 * DVec3::X, 4.0 * DVec3::Z);
    for wall in [wall_first, !wall_first] {
        match wall {
            true => room.mesh(corners.clone(), triangles.clone(), paint),
            false => room.quad(dvec3(0.0, 3.0, 0.0), x, z, paint),
        }
    }
    room.quad(DVec3::ZERO, z, x, paint);
    room.quad(DVec3::ZERO, x, 3.0 * DVec3::Y, paint);
    room.quad(z, 3.0 * DVec3::Y, x, paint);
    room.quad(dvec3(6.0, 0.0, 0.0), z, 5.0 * DVec3::Y, paint);
    let lamp = dvec3(1.7, 1.9, 2.2);
    room.punctual(LightKind::Point, lamp, DVec3::NEG_Y, 1000.0);
    let (bake, baked) = baked(room.scene());
    no_cracks(&bake, &baked);
    let wall = usize::from(!wall_first);
    let mut seen = [0; 2];
    for part in baked
        .surfaces
        .iter()
        .filter(|p| p.surface == wall && !p.back)
    {
        let surface = &bake.scene().surfaces[part.surface];
        for t in &part.triangles {
            let at = t.map(|v| position(surface, &part.vertices[v as usize]));
            let is_above = at.iter().map(|p| p.y).sum::<f64>() > 9.0;
            seen[usize::from(is_above)] += 1;
            for (k, p) in at.into_iter().enumerate() {
                let light = f64::from(part.vertices[t[k] as usize].irradiance[1]);
                let d = lamp - p;
                let direct = 1000.0 * d.x / d.length().powi(3);
                match is_above {
                    true => assert!(light < 0.1 * direct, "{p} is lit by {light}"),
                    false => assert!(light > 0.98 * direct, "{p} has {light} for {direct}"),
                }
            }
        }
    }
    assert!(seen[0] > 2 && seen[1] > 1, "{seen:?}");
    assert!(vertices(&baked) < 1000, "{}", vertices(&baked));
}

#[test]
fn a_wall_that_runs_on_above_a_ceiling_is_lit_below() {
    let at = |y: f64, z: f64| dvec3(0.0, y, z);
    // Cut in parts that are no parts of the ceiling's edge, and along the very edge.
    let cut = vec![
        at(0.0, 0.0),
        at(3.0, 0.0),
        at(3.0, 1.3),
        at(3.0, 4.0),
        at(0.0, 4.0),
        at(4.0, 0.0),
        at(4.0, 4.0),
    ];
    let below = [[0, 1, 2], [0, 2, 4], [2, 3, 4]];
    let above = [[1, 5, 2], [2, 5, 6], [2, 6, 3]];
    lit_below((cut, [below, above].concat()), false);
    let same = vec![
        at(0.0, 0.0),
        at(3.0, 0.0),
        at(3.0, 4.0),
        at(0.0, 4.0),
        at(4.0, 0.0),
        at(4.0, 4.0),
    ];
    let triangles = vec![[0, 1, 2], [0, 2, 3], [1, 4, 2], [4, 5, 2]];
    for wall_first in [false, true] {
        lit_below((same.clone(), triangles.clone()), wall_first);
    }
}

/// A board that stands on an inner edge of a floor, so that both ends of the edge are in the open: what lies on the edge is lit on one
/// side and dark on the other.
#[test]
fn a_board_on_an_edge_parts_its_light() {
    let mut room = Room::new();
    let paint = room.paint(0.0);
    room.two_sided(paint);
    let grid = (0..16).map(|k| dvec3(f64::from(k % 4), 0.0, f64::from(k / 4)));
    let cells = (0..9).map(|k| k % 3 + k / 3 * 4);
    let triangles = cells.flat_map(|a: u32| [[a, a + 4, a + 5], [a, a + 5, a + 1]]);
    room.mesh(grid.collect(), triangles.collect(), paint);
    room.quad(dvec3(1.0, 0.0, 1.0), DVec3::Z, 0.5 * DVec3::Y, paint);
    let lamp = dvec3(0.4, 1.5, 1.5);
    room.punctual(LightKind::Point, lamp, DVec3::NEG_Y, 1000.0);
    let (bake, baked) = baked(room.scene());
    no_cracks(&bake, &baked);
    // Along the board, length by length: vertices may stand off their own light, lines are right in the mean.
    let (mut drawn, mut there, mut dark) = (0.0, 0.0, 0);
    for part in baked.surfaces.iter().filter(|p| p.surface == 0 && !p.back) {
        let surface = &bake.scene().surfaces[0];
        for t in &part.triangles {
            let at = t.map(|v| position(surface, &part.vertices[v as usize]));
            let is_behind = at.iter().map(|p| p.x).sum::<f64>() > 3.0;
            for (k, j) in [(0, 1), (1, 2), (2, 0)] {
                let is_on = |p: DVec3| (p.x - 1.0).abs() < 1e-9 && (1.0..=2.0).contains(&p.z);
                if !is_on(at[k]) || !is_on(at[j]) {
                    continue;
                }
                for (v, p) in [(t[k], at[k]), (t[j], at[j])] {
                    let light = f64::from(part.vertices[v as usize].irradiance[1]);
                    let d = lamp - p;
                    let direct = 1000.0 * d.y / d.length().powi(3);
                    match is_behind {
                        true if (1.01..1.99).contains(&p.z) => {
                            assert!(light < 0.05 * direct, "{p}: {light}");
                            dark += 1;
                        }
                        true => {}
                        false => {
                            drawn += at[k].distance(at[j]) * light;
                            there += at[k].distance(at[j]) * direct;
                        }
                    }
                }
            }
        }
    }
    assert!((drawn - there).abs() < 0.05 * there, "{drawn} for {there}");
    assert!(dark > 0);
}

/// A plate of 3 mm on a floor darkens a centimetre around it, and not everything as far as the next vertex: rays ran from its corners.
#[test]
fn no_dark_rays_run_from_a_plate_on_a_floor() {
    let mut room = Room::new();
    let (wall, lamp, black) = (room.paint(0.5), room.lamp(0.5, 1000.0), room.paint(0.02));
    let size = dvec3(5.0, 2.5, 6.0);
    room.hollow(DVec3::ZERO, size, [wall, wall, wall, lamp, wall, wall]);
    let corner = |k: u32, far: f64| {
        let (sin, cos) = ((f64::from(k) + 0.3) * TAU / 9.0).sin_cos();
        let r = far * (0.5 + 0.1 * f64::from(k * 5 % 3));
        dvec3(2.6 + r * cos, 0.0, 3.1 + 0.8 * r * sin)
    };
    let (foot, up): (Vec<DVec3>, DVec3) =
        ((0..9).map(|k| corner(k, 1.0)).collect(), 0.003 * DVec3::Y);
    let mut positions = foot.clone();
    positions.extend(foot.iter().map(|p| *p + up));
    positions.push(dvec3(2.6, 0.003, 3.1));
    let triangles = (0..9).flat_map(|k| {
        let next = (k + 1) % 9;
        [
            [k, 9 + k, next],
            [next, 9 + k, 9 + next],
            [9 + k, 18, 9 + next],
        ]
    });
    room.mesh(positions, triangles.collect(), black);
    let (bake, baked) = baked(room.scene());
    let (floor, mut least) = (Plane::of(&bake, &baked, DVec3::Y), f64::INFINITY);
    for k in 0..9 {
        for t in 0..8 {
            let on = corner(k, 1.0).lerp(corner((k + 1) % 9, 1.0), f64::from(t) / 8.0);
            let out = (on - dvec3(2.6, 0.0, 3.1)).normalize();
            let light = |far: f64| floor.drawn(on + far * out);
            least = least.min(light(0.06) / light(0.3));
        }
    }
    eprintln!("{} vertices, {least:.3}", vertices(&baked));
    assert!(least > 0.9, "{least}");
}

/// The half shadow of a table by a lamp of 1.2 m: its legs are small on a large floor, and needles ran from them through the shadow, whose edge
/// looked like a comb.
#[test]
fn no_comb_at_the_half_shadow_of_a_table() {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(0.5), room.lamp(0.0, 1500.0));
    room.hollow(DVec3::ZERO, dvec3(8.0, 3.0, 8.0), [wall; 6]);
    let tube = dvec3(2.6, 2.95, 3.4);
    room.quad(tube, 1.2 * DVec3::X, 0.15 * DVec3::Z, lamp);
    let (low, high) = (dvec3(2.1, 0.75, 3.1), dvec3(4.2, 0.8, 4.5));
    room.block(low, high, wall);
    for (x, z) in [(2.2, 3.2), (4.1, 3.2), (2.2, 4.4), (4.1, 4.4)] {
        let corner = |k: usize, y: f64| {
            let (sin, cos) = (TAU * k as f64 / 8.0).sin_cos();
            dvec3(x + 0.04 * cos, y, z + 0.04 * sin)
        };
        for k in 0..8 {
            let [a, b] = [k, (k + 1) % 8];
            room.polygon(
                &[
                    corner(b, 0.0),
                    corner(a, 0.0),
                    corner(a, 0.75),
                    corner(b, 0.75),
                ],
                wall,
            );
        }
    }
    let (bake, baked) = baked(room.scene());
    no_cracks(&bake, &baked);
    // Along the long sides of the shadow light hardly changes: steps between neighbours are teeth.
    let (floor, mut worst) = (Plane::of(&bake, &baked, DVec3::Y), 0.0_f64);
    for z in (0..40).map(|k| 2.9 + 0.05 * f64::from(k)) {
        let at = |k: i32| dvec3(2.6 + 0.01 * f64::from(k), 0.0, z);
        let light = |k: i32| floor.drawn(at(k));
        let row: Vec<f64> = (0..120).map(light).collect();
        for nine in row.windows(9) {
            worst = worst.max((nine[4] - 0.5 * (nine[0] + nine[8])).abs());
        }
    }
    let open = floor.drawn(dvec3(3.2, 0.0, 2.4));
    eprintln!("{} vertices, {worst:.2} of {open:.1} lx", vertices(&baked));
    // .15 of it; .31 without turned edges.
    assert!(worst < 0.2 * open, "{worst} of {open} lx");
}

/// Panels and small lamps on a wall: the wall is cut along them, and bisection joined their corners by needles that drew hairs over the bare wall.
#[test]
fn no_hairs_between_panels_on_a_wall() {
    let mut room = Room::new();
    let (wall, panel) = (room.paint(0.6), room.paint(0.3));
    let (sconce, lamp) = (room.lamp(0.0, 52.0), room.lamp(0.0, 25.0));
    room.hollow(DVec3::ZERO, dvec3(6.0, 2.4, 5.0), [wall; 6]);
    for x in [0.4, 1.7, 3.0, 4.3] {
        room.block(dvec3(x, 0.0, 0.0), dvec3(x + 0.77, 1.9, 0.03), panel);
    }
    for x in [1.43, 2.73, 4.03] {
        room.block(
            dvec3(x - 0.05, 1.4, 0.0),
            dvec3(x + 0.05, 1.55, 0.1),
            sconce,
        );
    }
    room.quad(dvec3(2.5, 2.39, 2.0), DVec3::X, 0.5 * DVec3::Z, lamp);
    let (bake, baked) = baked(room.scene());
    no_cracks(&bake, &baked);
    // A decimetre above the panels light changes slowly along the wall.
    let (wall, mut worst) = (Plane::of(&bake, &baked, DVec3::Z), 0.0_f64);
    for y in (0..19).map(|k| 2.0 + 0.02 * f64::from(k)) {
        let light = |k: i32| wall.drawn(dvec3(0.1 + 0.01 * f64::from(k), y, 0.0));
        let row: Vec<f64> = (0..580).map(light).collect();
        for nine in row.windows(9) {
            worst = worst.max((nine[4] / (0.5 * (nine[0] + nine[8])) - 1.0).abs());
        }
    }
    eprintln!("{} vertices, {worst:.3}", vertices(&baked));
    // .05; .08 where parts of a triangle are not turned against each other.
    assert!(worst < 0.075, "{worst}");
}
