//! How fast are visibility queries? Rays a second on one core, in a Cornell box (34 triangles) and in a furnished room
//! (about 350 000), one at a time and in batches, against the plain use of the `obvhs` index with the same watertight test.
//!
//! `cargo bench --bench rays`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::{DVec3, Mat4, Vec3, Vec3A, vec3};
use haarlight::geometry::sampling::{Pcg, hash, sequence02, triangle_weights};
use haarlight::geometry::{NO_PLANE, RayIndex, Segment, Shaft, ShaftContents, ShaftEnd};
use haarlight::geometry::{lambert_visible, lanes, plane_ids};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::Ray;
use std::sync::LazyLock;

fn main() {
    divan::main();
}

/// Triangles and everything made from them once.
struct Room {
    triangles: Vec<[Vec3; 3]>,
    planes: Vec<u32>,
    index: RayIndex,
    peer: CwBvh,
    wild: Vec<Segment>,
    pairs: Vec<Segment>,
    fans: Vec<Segment>,
    patches: Vec<[[DVec3; 3]; 2]>,
}

#[derive(Default)]
struct Mesh(Vec<[Vec3; 3]>);

impl Mesh {
    fn quad(&mut self, p: [Vec3; 4]) {
        self.0.push([p[0], p[1], p[2]]);
        self.0.push([p[0], p[2], p[3]]);
    }

    /// A box; faces outwards.
    fn block(&mut self, low: Vec3, high: Vec3) {
        let p = |k: usize| {
            Vec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 1 { high[a] } else { low[a] }))
        };
        for f in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            self.quad(f.map(p));
        }
    }

    /// A sphere of `n` by `2n` squares.
    fn sphere(&mut self, centre: Vec3, radius: Vec3, n: u32) {
        let p = |i: u32, j: u32| {
            let (a, b) = (
                std::f32::consts::PI * i as f32 / n as f32,
                std::f32::consts::PI * j as f32 / n as f32,
            );
            centre + radius * vec3(a.sin() * b.cos(), a.cos(), a.sin() * b.sin())
        };
        for i in 0..n {
            for j in 0..2 * n {
                self.quad([p(i, j), p(i, j + 1), p(i + 1, j + 1), p(i + 1, j)]);
            }
        }
    }

    fn placed(&mut self, other: &Self, place: Mat4) {
        self.0
            .extend(other.0.iter().map(|t| t.map(|p| place.transform_point3(p))));
    }
}

/// The Cornell box (Cornell University Program of Computer Graphics, published coordinates, mm).
fn cornell() -> Mesh {
    let mut mesh = Mesh::default();
    let quads: [[[f32; 3]; 4]; 16] = [
        [
            [552.8, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 559.2],
            [549.6, 0.0, 559.2],
        ],
        [
            [343.0, 548.8, 227.0],
            [343.0, 548.8, 332.0],
            [213.0, 548.8, 332.0],
            [213.0, 548.8, 227.0],
        ],
        [
            [556.0, 548.8, 0.0],
            [556.0, 548.8, 559.2],
            [0.0, 548.8, 559.2],
            [0.0, 548.8, 0.0],
        ],
        [
            [549.6, 0.0, 559.2],
            [0.0, 0.0, 559.2],
            [0.0, 548.8, 559.2],
            [556.0, 548.8, 559.2],
        ],
        [
            [0.0, 0.0, 559.2],
            [0.0, 0.0, 0.0],
            [0.0, 548.8, 0.0],
            [0.0, 548.8, 559.2],
        ],
        [
            [552.8, 0.0, 0.0],
            [549.6, 0.0, 559.2],
            [556.0, 548.8, 559.2],
            [556.0, 548.8, 0.0],
        ],
        [
            [130.0, 165.0, 65.0],
            [82.0, 165.0, 225.0],
            [240.0, 165.0, 272.0],
            [290.0, 165.0, 114.0],
        ],
        [
            [290.0, 0.0, 114.0],
            [290.0, 165.0, 114.0],
            [240.0, 165.0, 272.0],
            [240.0, 0.0, 272.0],
        ],
        [
            [130.0, 0.0, 65.0],
            [130.0, 165.0, 65.0],
            [290.0, 165.0, 114.0],
            [290.0, 0.0, 114.0],
        ],
        [
            [82.0, 0.0, 225.0],
            [82.0, 165.0, 225.0],
            [130.0, 165.0, 65.0],
            [130.0, 0.0, 65.0],
        ],
        [
            [240.0, 0.0, 272.0],
            [240.0, 165.0, 272.0],
            [82.0, 165.0, 225.0],
            [82.0, 0.0, 225.0],
        ],
        [
            [423.0, 330.0, 247.0],
            [265.0, 330.0, 296.0],
            [314.0, 330.0, 456.0],
            [472.0, 330.0, 406.0],
        ],
        [
            [423.0, 0.0, 247.0],
            [423.0, 330.0, 247.0],
            [472.0, 330.0, 406.0],
            [472.0, 0.0, 406.0],
        ],
        [
            [472.0, 0.0, 406.0],
            [472.0, 330.0, 406.0],
            [314.0, 330.0, 456.0],
            [314.0, 0.0, 456.0],
        ],
        [
            [314.0, 0.0, 456.0],
            [314.0, 330.0, 456.0],
            [265.0, 330.0, 296.0],
            [265.0, 0.0, 296.0],
        ],
        [
            [265.0, 0.0, 296.0],
            [265.0, 330.0, 296.0],
            [423.0, 330.0, 247.0],
            [423.0, 0.0, 247.0],
        ],
    ];
    for quad in quads {
        mesh.quad(quad.map(|p| (Vec3::from_array(p) - 278.0) * 0.01));
    }
    // The front is open in the published box; closed here.
    let front = [
        [0.0, 0.0, 0.0],
        [552.8, 0.0, 0.0],
        [556.0, 548.8, 0.0],
        [0.0, 548.8, 0.0],
    ];
    mesh.quad(front.map(|p| (Vec3::from_array(p) - 278.0) * 0.01));
    mesh
}

/// A canteen of 20 m by 12 m by 3 m: tables, chairs with upholstery, lamps, crockery.
fn canteen() -> Mesh {
    let mut mesh = Mesh::default();
    // High corner first: the faces look inwards.
    mesh.block(vec3(10.0, 3.0, 6.0), vec3(-10.0, 0.0, -6.0));
    let mut chair = Mesh::default();
    for (x, z) in [(-0.2, -0.2), (0.2, -0.2), (-0.2, 0.2), (0.2, 0.2)] {
        chair.block(
            vec3(x - 0.02, 0.0, z - 0.02),
            vec3(x + 0.02, 0.45, z + 0.02),
        );
    }
    chair.sphere(vec3(0.0, 0.47, 0.0), vec3(0.24, 0.05, 0.24), 16);
    chair.sphere(vec3(0.0, 0.8, 0.22), vec3(0.22, 0.2, 0.03), 12);
    let mut table = Mesh::default();
    table.block(vec3(-0.8, 0.72, -0.5), vec3(0.8, 0.75, 0.5));
    table.block(vec3(-0.05, 0.0, -0.05), vec3(0.05, 0.72, 0.05));
    for k in 0..4 {
        let x = 0.4 * k as f32 - 0.6;
        table.sphere(vec3(x, 0.80, 0.25), vec3(0.04, 0.05, 0.04), 10);
        table.sphere(vec3(x, 0.76, -0.25), vec3(0.12, 0.01, 0.12), 10);
    }
    let mut random = Pcg::new(1);
    for i in 0..8 {
        for j in 0..4 {
            let at = vec3(i as f32 * 2.4 - 8.4, 0.0, j as f32 * 2.8 - 4.2);
            mesh.placed(&table, Mat4::from_translation(at));
            for (x, z, turn) in [
                (-0.4, 0.75, 0.0),
                (0.4, 0.75, 0.1),
                (-0.4, -0.75, 3.1),
                (0.4, -0.75, 3.3),
            ] {
                let turn = turn + 0.3 * random.f32();
                let place =
                    Mat4::from_translation(at + vec3(x, 0.0, z)) * Mat4::from_rotation_y(turn);
                mesh.placed(&chair, place);
            }
            mesh.sphere(at + vec3(0.0, 2.2, 0.0), vec3(0.2, 0.15, 0.2), 16);
        }
    }
    mesh
}

/// A point on the surface, uniform by area, with the triangle.
fn surface_point(triangles: &[[Vec3; 3]], areas: &[f32], random: &mut Pcg) -> (usize, Vec3) {
    let x = random.f32() * areas[areas.len() - 1];
    let k = areas.partition_point(|&a| a <= x).min(areas.len() - 1);
    (k, weigh(&triangles[k], [random.f64(), random.f64()]))
}

fn weigh(t: &[Vec3; 3], square: [f64; 2]) -> Vec3 {
    let [a, b, c] = triangle_weights(square).map(|w| w as f32);
    t[0] * a + t[1] * b + t[2] * c
}

/// The part of a triangle within `size` of a point of it: what an element of the solver looks like.
fn element(t: &[Vec3; 3], at: Vec3, size: f32) -> [Vec3; 3] {
    let extent = t[0]
        .distance(t[1])
        .max(t[1].distance(t[2]))
        .max(t[2].distance(t[0]));
    t.map(|corner| at + (corner - at) * (size / extent).min(1.0))
}

impl Room {
    fn new(mesh: Mesh, size: f32) -> Self {
        let triangles = mesh.0;
        let positions: Vec<Vec3> = triangles.iter().flatten().copied().collect();
        let exact: Vec<DVec3> = positions.iter().map(|p| p.as_dvec3()).collect();
        let ids: Vec<[u32; 3]> = (0..triangles.len() as u32)
            .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        let planes = plane_ids(&exact, &ids);
        let index = RayIndex::build(&positions, &ids, &planes, &[]);
        let [low, high] = index.bounds();
        let pad = Vec3A::splat(0.5e-5 * (high - low).max_element());
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| {
                let aabb = Aabb::from_points(&t.map(Vec3A::from));
                Aabb::new(aabb.min - pad, aabb.max + pad)
            })
            .collect();
        let peer = build_cwbvh(
            &boxes,
            BvhBuildParams::medium_build(),
            &mut Default::default(),
        );

        let mut sum = 0.0;
        let areas: Vec<f32> = triangles
            .iter()
            .map(|t| {
                sum += (t[1] - t[0]).cross(t[2] - t[0]).length();
                sum
            })
            .collect();
        let mut random = Pcg::new(2);
        let (mut wild, mut pairs, mut fans, mut patches) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        while patches.len() < 4096 {
            let (a, p) = surface_point(&triangles, &areas, &mut random);
            let (b, q) = surface_point(&triangles, &areas, &mut random);
            let front =
                |t: &[Vec3; 3], x: Vec3| (t[1] - t[0]).cross(t[2] - t[0]).dot(x - t[0]) > 0.0;
            if planes[a] == planes[b] || !front(&triangles[a], q) || !front(&triangles[b], p) {
                continue;
            }
            let planes = [planes[a], planes[b]];
            wild.push(Segment {
                from: p,
                to: q,
                planes,
            });
            let (ea, eb) = (
                element(&triangles[a], p, size),
                element(&triangles[b], q, size),
            );
            let shift = hash(a as u64, b as u64);
            for k in 0..16 {
                let [from, to] = [
                    weigh(&ea, sequence02(k, shift)),
                    weigh(&eb, sequence02(k, !shift)),
                ];
                pairs.push(Segment { from, to, planes });
            }
            if patches.len() % 4 == 0 {
                for k in 0..64 {
                    fans.push(Segment {
                        from: p,
                        to: weigh(&eb, sequence02(k, shift)),
                        planes,
                    });
                }
            }
            patches.push([ea.map(|p| p.as_dvec3()), eb.map(|p| p.as_dvec3())]);
        }
        Self {
            triangles,
            planes,
            index,
            peer,
            wild,
            pairs,
            fans,
            patches,
        }
    }

    fn report(&self, name: &str) {
        let blocked = |s: &[Segment]| {
            let mut out = vec![false; s.len()];
            self.index.occluded_many(s, &mut out);
            100 * out.iter().filter(|&&h| h).count() / s.len()
        };
        eprintln!(
            "{name}: {} triangles, {} bytes each, blocked: wild {} %, pairs {} %, fans {} %",
            self.triangles.len(),
            self.index.bytes() / self.triangles.len(),
            blocked(&self.wild),
            blocked(&self.pairs),
            blocked(&self.fans),
        );
    }

    /// What a program does with `obvhs` alone: its compressed tree, one ray at a time, and the watertight test.
    fn peer_occluded(&self, s: &Segment) -> bool {
        let d = s.to - s.from;
        let z = if d.z.abs() >= d.x.abs() && d.z.abs() >= d.y.abs() {
            2
        } else if d.y.abs() >= d.x.abs() {
            1
        } else {
            0
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let slope = [d[x] / d[z], d[y] / d[z], 1.0 / d[z]];
        let ray = Ray::new(s.from.into(), d.into(), 0.0, 1.0);
        !self.peer.ray_traverse_miss(ray, |_, k| {
            let id = self.peer.primitive_indices[k] as usize;
            if s.planes.contains(&self.planes[id]) {
                return f32::INFINITY;
            }
            let [a, b, c] = self.triangles[id].map(|p| {
                let p = p - s.from;
                [
                    p[x] - slope[0] * p[z],
                    p[y] - slope[1] * p[z],
                    slope[2] * p[z],
                ]
            });
            let u = c[0] * b[1] - c[1] * b[0];
            let v = a[0] * c[1] - a[1] * c[0];
            let w = b[0] * a[1] - b[1] * a[0];
            if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
                return f32::INFINITY;
            }
            let det = u + v + w;
            let t = (u * a[2] + v * b[2] + w * c[2]) / det;
            if t > 1e-6 && t < 1.0 - 1e-6 {
                t
            } else {
                f32::INFINITY
            }
        })
    }
}

static CORNELL: LazyLock<Room> = LazyLock::new(|| {
    let room = Room::new(cornell(), 1.0);
    room.report("Cornell box");
    room
});

static CANTEEN: LazyLock<Room> = LazyLock::new(|| {
    let room = Room::new(canteen(), 0.3);
    room.report("canteen");
    room
});

#[derive(Clone, Copy, Debug)]
enum Where {
    Cornell,
    Canteen,
}

impl Where {
    fn room(self) -> &'static Room {
        match self {
            Self::Cornell => &CORNELL,
            Self::Canteen => &CANTEEN,
        }
    }
}

const ROOMS: [Where; 2] = [Where::Cornell, Where::Canteen];

fn one_by_one(
    bencher: Bencher<'_, '_>,
    segments: &[Segment],
    ask: impl Fn(&Segment) -> bool + Sync,
) {
    bencher
        .counter(ItemsCount::new(segments.len()))
        .bench(|| segments.iter().filter(|s| ask(black_box(s))).count());
}

/// Random pairs of surface points, one at a time.
#[divan::bench(args = ROOMS)]
fn wild_single(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    one_by_one(bencher, &room.wild, |s| room.index.occluded(s));
}

/// The same by `obvhs`.
#[divan::bench(args = ROOMS)]
fn wild_obvhs(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    one_by_one(bencher, &room.wild, |s| room.peer_occluded(s));
}

/// The same in batches that have nothing in common.
#[divan::bench(args = ROOMS)]
fn wild_many(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    many(bencher, room, &room.wild, 16);
}

/// 16 rays between two elements, one at a time.
#[divan::bench(args = ROOMS)]
fn pairs_single(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    one_by_one(bencher, &room.pairs, |s| room.index.occluded(s));
}

/// The same by `obvhs`.
#[divan::bench(args = ROOMS)]
fn pairs_obvhs(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    one_by_one(bencher, &room.pairs, |s| room.peer_occluded(s));
}

fn many(bencher: Bencher<'_, '_>, room: &Room, segments: &[Segment], batch: usize) {
    bencher.counter(ItemsCount::new(segments.len())).bench(|| {
        let mut out = [false; 64];
        let mut hidden = 0;
        for batch in black_box(segments).chunks(batch) {
            room.index.occluded_many(batch, &mut out[..batch.len()]);
            hidden += out[..batch.len()].iter().filter(|&&h| h).count();
        }
        hidden
    });
}

/// 16 rays between two elements in one batch.
#[divan::bench(args = ROOMS)]
fn pairs_many(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    many(bencher, room, &room.pairs, 16);
}

/// 64 rays from one point to one element in one batch.
#[divan::bench(args = ROOMS)]
fn fans_many(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    many(bencher, room, &room.fans, 64);
}

/// The same, one at a time.
#[divan::bench(args = ROOMS)]
fn fans_single(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    one_by_one(bencher, &room.fans, |s| room.index.occluded(s));
}

fn shaft(room: &Room, k: usize) -> Shaft {
    let planes = room.pairs[16 * k].planes;
    let [a, b] = room.patches[k];
    Shaft::between(
        &ShaftEnd::Triangle {
            corners: a,
            plane: planes[0],
        },
        &ShaftEnd::Triangle {
            corners: b,
            plane: planes[1],
        },
    )
}

/// Shafts a second: what is between two elements?
#[divan::bench(args = ROOMS)]
fn shafts(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    let mut kinds = [0; 3];
    for k in 0..room.patches.len() {
        kinds[match room.index.blockers(&shaft(room, k), None, 16) {
            ShaftContents::Clear => 0,
            ShaftContents::Few(_) => 1,
            ShaftContents::Many => 2,
        }] += 1;
    }
    eprintln!("{at:?}: clear, few, many: {kinds:?}");
    bencher
        .counter(ItemsCount::new(room.patches.len()))
        .bench(|| {
            (0..room.patches.len())
                .filter(|&k| {
                    room.index.blockers(&shaft(room, black_box(k)), None, 16)
                        == ShaftContents::Clear
                })
                .count()
        });
}

/// 16 rays between two elements by the shaft's list, given the list.
#[divan::bench(args = ROOMS)]
fn pairs_by_list(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    let lists: Vec<_> = (0..room.patches.len())
        .filter_map(|k| match room.index.blockers(&shaft(room, k), None, 16) {
            ShaftContents::Few(list) => Some((k, list)),
            _ => None,
        })
        .collect();
    bencher
        .counter(ItemsCount::new(16 * lists.len()))
        .bench(|| {
            let mut out = [false; 16];
            let mut hidden = 0;
            for (k, list) in black_box(&lists) {
                room.index
                    .occluded_by(list, &room.pairs[16 * k..][..16], &mut out, &|_, _, _| true);
                hidden += out.iter().filter(|&&h| h).count();
            }
            hidden
        });
}

/// Seconds to build the index.
#[divan::bench(args = ROOMS, sample_count = 3)]
fn build(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    let positions: Vec<Vec3> = room.triangles.iter().flatten().copied().collect();
    let ids: Vec<[u32; 3]> = (0..room.triangles.len() as u32)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    bencher.bench(|| RayIndex::build(black_box(&positions), &ids, &room.planes, &[]));
}

/// Seconds to find the planes.
#[divan::bench(args = ROOMS, sample_count = 3)]
fn planes(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    let positions: Vec<DVec3> = room
        .triangles
        .iter()
        .flatten()
        .map(|p| p.as_dvec3())
        .collect();
    let ids: Vec<[u32; 3]> = (0..room.triangles.len() as u32)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    bencher.bench(|| plane_ids(black_box(&positions), &ids));
}

/// Rays to the nearest hit, as the audit casts them.
#[divan::bench(args = ROOMS)]
fn closest(bencher: Bencher<'_, '_>, at: Where) {
    let room = at.room();
    bencher.counter(ItemsCount::new(room.wild.len())).bench(|| {
        room.wild
            .iter()
            .filter(|s| {
                room.index
                    .closest(s.from, s.to - s.from, f32::INFINITY, black_box(NO_PLANE))
                    .is_some()
            })
            .count()
    });
}

fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize()
}

/// The visible form factor of the Cornell box's light from points on all surfaces: list of blockers, clipping, and factor.
#[divan::bench]
fn light_from_points(bencher: Bencher<'_, '_>) {
    let room: &Room = &CORNELL;
    let light = [2, 3].map(|k| room.triangles[k].map(|p| p.as_dvec3()));
    bencher
        .counter(ItemsCount::new(2 * room.patches.len()))
        .bench(|| {
            let mut sum = 0.0;
            for (k, [a, _]) in black_box(&room.patches).iter().enumerate() {
                let (at, normal) = ((a[0] + a[1] + a[2]) / 3.0, normal(a));
                let from = ShaftEnd::Point {
                    at,
                    normal,
                    plane: room.pairs[16 * k].planes[0],
                };
                for light in &light {
                    let to = ShaftEnd::Triangle {
                        corners: *light,
                        plane: room.planes[2],
                    };
                    let list = match room.index.blockers(&Shaft::between(&from, &to), None, 16) {
                        ShaftContents::Few(list) => list,
                        _ => Vec::new(),
                    };
                    let blockers: Vec<[DVec3; 3]> = list
                        .iter()
                        .filter_map(|&k| Some(room.index.triangle(k)?.map(|p| p.as_dvec3())))
                        .collect();
                    sum += lambert_visible(at, normal, light, &blockers, 64).unwrap_or(0.0);
                }
            }
            sum
        });
}

/// Sums a form factor from points to triangles, one at a time.
fn factors(bencher: Bencher<'_, '_>, factor: fn(DVec3, DVec3, &[DVec3]) -> f64) {
    let pairs = &CORNELL.patches;
    bencher.counter(ItemsCount::new(8 * pairs.len())).bench(|| {
        let mut sum = 0.0;
        for [a, b] in black_box(pairs) {
            let normal = normal(a);
            for k in 0..8 {
                let point = a[0].lerp(a[1], f64::from(k) / 8.0);
                sum += factor(point, normal, b);
            }
        }
        sum
    });
}

/// Form factors from points to triangles, one at a time.
#[divan::bench]
fn lambert_single(bencher: Bencher<'_, '_>) {
    factors(bencher, haarlight::geometry::lambert_polygon);
}

/// The same, the edges side by side.
#[divan::bench]
fn lambert_edges(bencher: Bencher<'_, '_>) {
    factors(bencher, lanes::lambert_edges_x8);
}

/// The same, eight at a time.
#[divan::bench]
fn lambert_x8(bencher: Bencher<'_, '_>) {
    let pairs = &CORNELL.patches;
    bencher.counter(ItemsCount::new(8 * pairs.len())).bench(|| {
        let mut sum = 0.0;
        for [a, b] in black_box(pairs) {
            let points: [DVec3; 8] = std::array::from_fn(|k| a[0].lerp(a[1], k as f64 / 8.0));
            let normals = lanes::all_lanes(normal(a));
            let factors = lanes::lambert_x8(&lanes::lanes_of(points), &normals, b);
            sum += factors.iter().sum::<f64>();
        }
        sum
    });
}
