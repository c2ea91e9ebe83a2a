//! Panes: filters on every ray, neither blockers nor receivers.

#[path = "common/built.rs"]
mod built;

use built::Room;
use glam::{DVec3, dvec3};
use haarlight::audit::Audit;
use haarlight::color::{KM, Observer};
use haarlight::geometry::NO_PLANE;
use haarlight::scene::LightKind;
use haarlight::scene::pane::slab;
use haarlight::solve::{Bake, Settings};
use haarlight::spectrum::{LEAVES, Leaves};

const CLEAR: Leaves = [1.0; LEAVES];

/// A glass that lets through long wavelengths.
fn amber() -> Leaves {
    std::array::from_fn(|k| 0.05 + 0.9 / (1.0 + (-(k as f64 - 34.0) / 3.0).exp()))
}

/// And one for short ones.
fn blue() -> Leaves {
    std::array::from_fn(|k| 0.9 - 0.85 / (1.0 + (-(k as f64 - 24.0) / 3.0).exp()))
}

/// A black box of 4 m x 3 m x 4 m, open at one side, with a point light of 1000 lm at its middle.
fn lit(rho: f64) -> Room {
    let mut room = Room::new();
    let paint = room.paint(rho);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), [paint; 6]);
    room.point(dvec3(2.0, 2.0, 2.0), 1000.0);
    room
}

/// A level pane over the whole floor at a height.
fn level(room: &mut Room, height: f64, pane: usize) {
    let (x, z) = (DVec3::X * 4.0, DVec3::Z * 4.0);
    room.quad(dvec3(0.0, height, 0.0), z, x, pane);
}

fn baked(room: Room) -> Bake {
    let mut bake = Bake::new(room.scene(), Settings::default());
    bake.run();
    bake
}

fn leaves(bake: &Bake, points: &[DVec3]) -> Vec<Leaves> {
    let up: Vec<_> = points.iter().map(|p| (*p, DVec3::Y)).collect();
    bake.probe(&up).iter().map(|p| p.leaves).collect()
}

fn places() -> Vec<DVec3> {
    [(2.0, 2.0), (1.0, 2.0), (0.3, 0.4), (3.1, 2.7)]
        .map(|(x, z)| dvec3(x, 0.0, z))
        .to_vec()
}

fn close(a: f64, b: f64, tolerance: f64, what: &str) {
    assert!((a - b).abs() <= tolerance * b.abs(), "{what}: {a} for {b}");
}

/// Index 1 and nothing absorbed: the room is as it was.
#[test]
fn a_loss_free_pane_changes_nothing() {
    let without = baked(lit(0.5));
    let mut room = lit(0.5);
    let pane = room.pane(1.0, CLEAR);
    level(&mut room, 1.0, pane);
    let with = baked(room);
    println!(
        "{:?}",
        places()
            .iter()
            .zip(
                leaves(&with, &places())
                    .iter()
                    .zip(leaves(&without, &places()))
            )
            .map(|(_, (a, b))| a[30] / b[30])
            .collect::<Vec<_>>()
    );
    for (a, b) in leaves(&with, &places())
        .iter()
        .zip(leaves(&without, &places()))
    {
        close(a[30], b[30], 4e-3, "lux");
    }
}

/// Light of a lamp by the formula of a slab, wherever its faces are.
#[test]
fn lamps_shine_through_slabs() {
    for inside in [1.0, 0.9] {
        let mut room = lit(0.0);
        let power = room.power(0)[30];
        let pane = room.pane(1.5, [inside; LEAVES]);
        level(&mut room, 1.0, pane);
        let bake = baked(room);
        for (place, got) in places().iter().zip(leaves(&bake, &places())) {
            let d = dvec3(2.0, 2.0, 2.0) - *place;
            let cosine = d.y / d.length();
            let open = power * 1000.0 / (4.0 * std::f64::consts::PI) * cosine / d.length_squared();
            close(
                got[30],
                open * slab(1.5, inside, 1.0, cosine),
                1e-5,
                "through the pane",
            );
        }
    }
    // Fresnel at normal incidence by hand: .04 a face, (1 - .04) / (1 + .04).
    close(
        slab(1.5, 1.0, 1.0, 1.0),
        0.96 / 1.04,
        1e-12,
        "normal incidence",
    );
}

#[test]
fn three_panes_in_a_row_multiply() {
    let [one, three] = [1, 3].map(|count| {
        let mut room = lit(0.0);
        let panes = [amber(), blue(), [0.8; LEAVES]].map(|inside| room.pane(1.0, inside));
        for (k, pane) in panes.into_iter().enumerate().take(count) {
            level(&mut room, 0.5 + 0.2 * k as f64, pane);
        }
        leaves(&baked(room), &places()[..1])[0]
    });
    let plain = leaves(&baked(lit(0.0)), &places()[..1])[0];
    let (amber, blue) = (amber(), blue());
    let xyz = |leaves: &dyn Fn(usize) -> f64| {
        Observer::cie1931()
            .weights(&Default::default())
            .map(|w| (0..LEAVES).map(|k| KM * w[k] * leaves(k)).sum::<f64>())
    };
    let got = [xyz(&|k| one[k]), xyz(&|k| three[k])];
    let want = [
        xyz(&|k| plain[k] * amber[k]),
        xyz(&|k| plain[k] * amber[k] * blue[k] * 0.8),
    ];
    println!("{got:?} {want:?}");
    for (got, want) in got.iter().flatten().zip(want.iter().flatten()) {
        close(*got, *want, 5e-3, "tristimulus");
    }
}

/// One quad, a quad and its back, a thin box: one pane.
#[test]
fn however_it_is_modelled_a_pane_is_one() {
    let got: Vec<Leaves> = (0..4)
        .map(|how| {
            let mut room = lit(0.0);
            let pane = room.pane(1.5, [0.7; LEAVES]);
            let (x, z) = (DVec3::X * 4.0, DVec3::Z * 4.0);
            let at = dvec3(0.0, 1.0, 0.0);
            match how {
                0 => room.quad(at, z, x, pane),
                1 => {
                    room.quad(at, z, x, pane);
                    room.quad(at, x, z, pane);
                }
                2 => room.block(at, at + dvec3(4.0, 0.006, 4.0), pane),
                // A box of one mesh, a little apart from the walls.
                _ => {
                    let faces = built::faces(dvec3(0.01, 1.0, 0.01), dvec3(3.99, 1.006, 3.99));
                    let corners = faces.into_iter().flat_map(|mut face| {
                        face.reverse();
                        face
                    });
                    let quads =
                        (0..6).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| 4 * k + i)));
                    room.mesh(corners.collect(), quads.collect(), pane);
                }
            }
            leaves(&baked(room), &places()[1..2])[0]
        })
        .collect();
    for other in &got[1..] {
        close(other[30], got[0][30], 1e-5, "lux");
    }
}

/// Light that is passed on goes through panes as a path tracer has it.
#[test]
fn the_path_tracer_agrees() {
    let mut room = lit(0.7);
    let pane = room.pane(1.5, amber());
    // An upright pane between two halves, the lamp in one of them.
    room.quad(dvec3(2.5, 0.0, 0.0), DVec3::Y * 3.0, DVec3::Z * 4.0, pane);
    let bake = baked(room);
    let points: Vec<_> = [(1.0, 2.0), (3.2, 2.0), (3.6, 0.7)]
        .map(|(x, z)| (dvec3(x, 0.0, z), DVec3::Y))
        .to_vec();
    let places: Vec<_> = (points.iter())
        .map(|&(p, n)| (p - bake.mesh().centre, n, NO_PLANE))
        .collect();
    let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
    let answers = audit.irradiance(&places, &[1 << 15; 3], 3);
    for (probed, answer) in bake.probe(&points).iter().zip(answers) {
        for (c, weights) in Observer::cie1931()
            .weights(&bake.scene().grid)
            .iter()
            .enumerate()
        {
            let (truth, error) = answer.linear(&weights.map(|w| KM * w));
            let got = probed.xyz[c];
            println!("{c}: {got:.3} for {truth:.3} +- {error:.3}");
            assert!(
                (got - truth).abs() < 3.0 * error + 0.01 * truth,
                "{got} {truth} {error}"
            );
        }
    }
}

/// The sun through a pane, and a spot.
#[test]
fn parallel_light_and_spots_pass() {
    for kind in [
        LightKind::Directional,
        LightKind::Spot {
            inner: 0.6,
            outer: 0.8,
        },
    ] {
        let of = |pane: bool| {
            let mut room = Room::new();
            let paint = room.paint(0.0);
            room.quad(DVec3::ZERO, DVec3::Z * 4.0, DVec3::X * 4.0, paint);
            room.punctual(kind, dvec3(2.0, 3.0, 2.0), dvec3(0.2, -1.0, 0.1), 500.0);
            if pane {
                let pane = room.pane(1.5, [0.9; LEAVES]);
                level(&mut room, 1.5, pane);
            }
            leaves(&baked(room), &[dvec3(2.4, 0.0, 2.2)])[0][30]
        };
        let cosine = match kind {
            LightKind::Spot { .. } => 3.0 / dvec3(0.4, 3.0, 0.2).length(),
            _ => 1.0 / dvec3(0.2, 1.0, 0.1).length(),
        };
        let want = slab(1.5, 0.9, 1.0, cosine);
        close(of(true) / of(false), want, 1e-5, "transmittance");
    }
}
