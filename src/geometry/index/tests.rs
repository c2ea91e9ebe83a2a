use super::*;
use crate::geometry::sampling::{Pcg, cosine_direction, sequence02, sphere_direction};
use glam::DVec3;

/// Two squares in one place that look opposite ways, cut along different diagonals: each ray meets a front.
#[test]
fn sheets_of_two_faces_show_a_front_to_both_sides() {
    let corners = [
        Vec3::new(0.1, 0.3, 0.0),
        Vec3::new(1.2, 0.3, 0.0),
        Vec3::new(1.2, 1.1, 0.0),
        Vec3::new(0.1, 1.1, 0.0),
    ];
    let positions: Vec<Vec3> = corners
        .iter()
        .map(|c| Vec3::new(c.x, c.y, 0.3 * c.x + 0.7 * c.y))
        .collect();
    for triangles in [
        vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
        vec![[0, 3, 1], [1, 3, 2], [0, 1, 2], [0, 2, 3]],
    ] {
        let index = RayIndex::build(&positions, &triangles, &[0; 4], &[false; 4]);
        let mut random = Pcg::new(3);
        for k in 0..1000 {
            let from =
                point(&mut random) + Vec3::new(0.6, 0.7, if k % 2 == 0 { 3.0 } else { -3.0 });
            let to = Vec3::new(0.2 + 0.9 * random.f32(), 0.4 + 0.6 * random.f32(), 0.0);
            let to = Vec3::new(to.x, to.y, 0.3 * to.x + 0.7 * to.y);
            let hit = index.closest(from, to - from, 2.0, NO_PLANE).unwrap();
            assert!(!hit.from_behind, "{from} {to}: {hit:?}");
        }
    }
}

fn point(random: &mut Pcg) -> Vec3 {
    Vec3::new(random.f32(), random.f32(), random.f32()) * 2.0 - 1.0
}

/// Triangles of some size strewn about.
fn clutter(count: u32, size: f32, random: &mut Pcg) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for _ in 0..count {
        let at = point(random);
        positions.extend([0; 3].map(|_| at + point(random) * size));
    }
    let triangles = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    (positions, triangles)
}

/// A box of `n` by `n` squares a side, closed.
fn closed_box(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let base = positions.len() as u32;
            for i in 0..=n {
                for j in 0..=n {
                    let mut p = Vec3::ZERO;
                    p[axis] = side;
                    p[(axis + 1) % 3] = 2.0 * i as f32 / n as f32 - 1.0;
                    p[(axis + 2) % 3] = 2.0 * j as f32 / n as f32 - 1.0;
                    positions.push(p * Vec3::new(3.1, 2.3, 1.7) + Vec3::new(0.3, -0.2, 0.1));
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let a = base + i * (n + 1) + j;
                    let (b, c, d) = (a + n + 1, a + n + 2, a + 1);
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
    }
    (positions, triangles)
}

#[test]
fn tree_packets_and_plain_loop_agree() {
    let mut random = Pcg::new(1);
    for (count, size) in [(1, 0.5), (7, 0.5), (40, 0.5), (300, 0.2), (3_000, 0.05)] {
        let (positions, triangles) = clutter(count, size, &mut random);
        // The first two have no plane, and must block even a segment without.
        let planes: Vec<u32> = (0..count)
            .map(|k| if k < 2 { NO_PLANE } else { k })
            .collect();
        let masked: Vec<bool> = (0..count).map(|k| k % 3 == 0).collect();
        let index = RayIndex::build(&positions, &triangles, &planes, &masked);
        let opaque = |triangle: u32, u: f32, v: f32| {
            (triangle + (u * 8.0) as u32 + (v * 8.0) as u32).is_multiple_of(2)
        };
        let mut segments = Vec::new();
        for _ in 0..120 {
            // Coherent sixteens, wild sixteens, and some from one point.
            let (a, b) = (point(&mut random), point(&mut random));
            for k in 0..16 {
                let spread = [0.0, 0.05, 1.0][k % 3];
                let from = a + point(&mut random) * spread;
                let to = if k % 5 == 0 {
                    a
                } else {
                    b + point(&mut random) * spread
                };
                let planes = [
                    random.below(count),
                    if k % 2 == 0 {
                        NO_PLANE
                    } else {
                        random.below(count)
                    },
                ];
                segments.push(Segment { from, to, planes });
            }
        }
        segments.truncate(segments.len() - 5);
        let mut many = vec![false; segments.len()];
        index.occluded_many_with(&segments, &mut many, &opaque);
        let mut blocked = 0;
        let all: Vec<u32> = (0..count).collect();
        let mut listed = vec![false; segments.len()];
        index.occluded_by(&all, &segments, &mut listed, &opaque);
        for (k, segment) in segments.iter().enumerate() {
            let plain = index.occluded_plain(segment, &opaque);
            assert_eq!(index.occluded_with(segment, &opaque), plain, "{segment:?}");
            assert_eq!(many[k], plain, "{segment:?}");
            assert_eq!(listed[k], plain, "{segment:?}");
            assert!(!plain || index.occluded(segment), "masks only open");
            blocked += usize::from(plain);
        }
        assert!(blocked > 10, "{blocked} of {count}");
    }
}

#[test]
fn closest_agrees_with_the_plain_loop() {
    let mut random = Pcg::new(2);
    let (positions, triangles) = clutter(500, 0.2, &mut random);
    let index = RayIndex::build(&positions, &triangles, &[], &[]);
    for _ in 0..2_000 {
        let (from, direction) = (point(&mut random), point(&mut random));
        let line = Shear::new(from, direction, [index.gap / direction.length(), 2.0]);
        let plain = (0u32..)
            .zip(&triangles)
            .filter_map(|(id, t)| line.meet(t.map(|k| positions[k as usize])).map(|m| (m, id)))
            .min_by(|a, b| a.0.t.total_cmp(&b.0.t).then(a.1.cmp(&b.1)));
        let hit = index.closest(from, direction, 2.0, NO_PLANE);
        assert_eq!(
            hit.map(|h| (h.t, h.uv, h.triangle)),
            plain.map(|(m, id)| (m.t, m.uv, id))
        );
        if let Some(hit) = hit {
            let [a, b, c] = triangles[hit.triangle as usize].map(|k| positions[k as usize]);
            let at = a + (b - a) * hit.uv[0] + (c - a) * hit.uv[1];
            assert!(at.distance(from + direction * hit.t) < 1e-5);
            assert_eq!(hit.from_behind, (b - a).cross(c - a).dot(direction) > 0.0);
        }
    }
}

#[test]
fn beams_hit_what_single_rays_hit() {
    let mut random = Pcg::new(5);
    for count in [5, 30, 2_000] {
        let (positions, triangles) = clutter(count, 0.3, &mut random);
        let planes: Vec<u32> = (0..count).collect();
        let masked: Vec<bool> = (0..count).map(|k| k % 3 == 0).collect();
        let opaque = |triangle: u32, u: f32, v: f32| {
            (triangle + (u * 8.0) as u32 + (v * 8.0) as u32).is_multiple_of(2)
        };
        let index = RayIndex::build(&positions, &triangles, &planes, &masked);
        let mut hits = 0;
        for k in 0..600 {
            let around = point(&mut random) * 1.5;
            let axis = point(&mut random);
            let spread = [0.1, 0.5, 3.0][k % 3];
            let directions: Vec<Vec3> = (0..1 + k % 16)
                .map(|_| (axis + spread * point(&mut random)).normalize())
                .collect();
            let from: Vec<Vec3> = directions
                .iter()
                .map(|_| around + [0.0, 0.01][k % 2] * point(&mut random))
                .collect();
            let ignored = random.below(count);
            let mut out = vec![None; directions.len()];
            index.closest_many_with(&from, &directions, ignored, &mut out, &opaque);
            for ((hit, &d), &from) in out.iter().zip(&directions).zip(&from) {
                let single = index.closest_with(from, d, f32::INFINITY, ignored, &opaque);
                assert_eq!(hit.map(|h| h.triangle), single.map(|h| h.triangle));
                if let (Some(a), Some(b)) = (hit, single) {
                    assert!((a.t - b.t).abs() < 1e-4 * (1.0 + b.t), "{a:?} {b:?}");
                    assert_eq!(a.from_behind, b.from_behind);
                    hits += 1;
                }
            }
        }
        assert!(hits > 10, "{hits} of {count}");
    }
}

#[test]
fn no_ray_leaves_a_closed_box() {
    let (positions, triangles) = closed_box(7);
    let index = RayIndex::build(&positions, &triangles, &[], &[]);
    let mut random = Pcg::new(3);
    let mut segments = Vec::new();
    let inside =
        |random: &mut Pcg| point(random) * Vec3::new(3.0, 2.2, 1.6) + Vec3::new(0.3, -0.2, 0.1);
    for round in 0..200_000 {
        let from = inside(&mut random);
        let t =
            triangles[random.below(triangles.len() as u32) as usize].map(|k| positions[k as usize]);
        let at = match round % 3 {
            0 => t[0],
            1 => t[0].lerp(t[1], random.f32()),
            _ => t[0].midpoint(t[2]),
        };
        segments.push(Segment {
            from,
            to: from + (at - from) * 1.5,
            planes: [NO_PLANE; 2],
        });
    }
    let mut hidden = vec![false; segments.len()];
    index.occluded_many(&segments, &mut hidden);
    assert_eq!(
        hidden.iter().filter(|&&h| !h).count(),
        0,
        "leaks in packets"
    );
    let leaks = segments.iter().filter(|s| !index.occluded(s)).count();
    assert_eq!(leaks, 0, "leaks one by one");
    let leaks = segments
        .iter()
        .filter(|s| {
            index
                .closest(s.from, s.to - s.from, f32::INFINITY, NO_PLANE)
                .is_none()
        })
        .count();
    assert_eq!(leaks, 0, "leaks of nearest hits");
}

#[test]
fn ends_on_surfaces_are_not_hidden_by_them() {
    // Between points of two walls of an empty convex room, corners and edges included.
    let (positions, triangles) = closed_box(4);
    let wall = |k: usize| (k / 32) as u32;
    let planes: Vec<u32> = (0..triangles.len()).map(wall).collect();
    let index = RayIndex::build(&positions, &triangles, &planes, &[]);
    let mut segments = Vec::new();
    for (k, a) in triangles.iter().enumerate() {
        for (l, b) in triangles.iter().enumerate() {
            if wall(k) != wall(l) {
                let on = |t: &[u32; 3], which: usize| {
                    let [a, b, c] = t.map(|k| positions[k as usize]);
                    [a, b, a.midpoint(b), (a + b + c) / 3.0][which % 4]
                };
                segments.push(Segment {
                    from: on(a, k + l),
                    to: on(b, l / 3),
                    planes: [wall(k), wall(l)],
                });
            }
        }
    }
    let mut hidden = vec![false; segments.len()];
    index.occluded_many(&segments, &mut hidden);
    assert_eq!(hidden.iter().filter(|&&h| h).count(), 0);
}

#[test]
fn directions_over_a_floor_see_the_share_of_a_screen() {
    // Rays leave the centre of a square's shadow: the blocked share is the form factor, 0.239456 for a unit square at height 1.
    let square =
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| Vec3::new(x, y, 1.0));
    let index = RayIndex::build(&square, &[[0, 1, 2], [0, 2, 3]], &[0, 0], &[]);
    let n = 1 << 14;
    let segments: Vec<_> = (0..n)
        .map(|k| Segment {
            from: Vec3::ZERO,
            to: cosine_direction(DVec3::Z, sequence02(k, 1)).as_vec3() * 10.0,
            planes: [NO_PLANE; 2],
        })
        .collect();
    let mut hidden = vec![false; segments.len()];
    index.occluded_many(&segments, &mut hidden);
    let share = hidden.iter().filter(|&&h| h).count() as f64 / f64::from(n);
    assert!((share - 0.239_456_470_460_774).abs() < 2e-3, "{share}");
}

#[test]
fn nothing_to_index_blocks_nothing() {
    let bad = RayIndex::build(
        &[Vec3::ZERO, Vec3::X, Vec3::NAN],
        &[[0, 1, 2], [0, 1, 9]],
        &[],
        &[],
    );
    let sliver = RayIndex::build(
        &[Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
        &[[0, 1, 2], [0, 0, 0]],
        &[],
        &[],
    );
    for index in [RayIndex::build(&[], &[], &[], &[]), bad, sliver] {
        let mut random = Pcg::new(9);
        for _ in 0..64 {
            let to = sphere_direction([random.f64(), random.f64()]).as_vec3();
            let segment = Segment {
                from: Vec3::X * 0.5,
                to,
                planes: [NO_PLANE; 2],
            };
            let mut out = [true];
            index.occluded_many(&[segment], &mut out);
            assert_eq!((index.occluded(&segment), out[0]), (false, false));
            assert_eq!(index.closest(segment.from, to, 9.0, NO_PLANE), None);
        }
    }
}
