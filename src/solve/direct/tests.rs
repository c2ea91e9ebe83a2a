use super::*;
use crate::hierarchy::Mesh;
use crate::scene::{Options, Scene};
use std::path::Path;

/// Light and openness that depend on the place.
struct Fake {
    light: fn(&Receiver) -> f32,
    open: fn(&Receiver) -> f32,
}

fn light(to: &Receiver) -> f32 {
    if to.point.x > 0.1 { 3.0 } else { 0.0 }
}

fn open(to: &Receiver) -> f32 {
    if to.point.z > 0.0 { 1.0 } else { 0.25 }
}

impl LeafSampler for Fake {
    fn weights(&self) -> &[f64] {
        &[1.0]
    }
    fn direct(&self, _: &Tree, to: &Receiver, _: f64, _: &mut Memory) -> Option<[f32; 64]> {
        Some([(self.light)(to); 64])
    }
    fn unshadowed(&self, _: &Tree, _: u32, _: f64) -> f64 {
        3.0
    }
    fn landed(&self, _: &Tree) -> Landed {
        Landed::default()
    }
    fn by_chance(&self) -> bool {
        true
    }
    fn openness(&self, _: &Tree, to: &Receiver, _: &mut Memory) -> [f32; 2] {
        [(self.open)(to); 2]
    }
}

/// A convex room, of which every face is divided so many times.
fn divided(times: usize) -> Tree {
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/convex.glb");
    let mesh = Mesh::new(&Scene::load(&room, &Options::default()).unwrap());
    let mut tree = Tree::new(&mesh, &vec![0; mesh.faces.len()]);
    for _ in 0..times {
        for leaf in tree.leaves().collect::<Vec<_>>() {
            tree.subdivide(leaf);
        }
    }
    tree
}

/// Summed over leaves, for any number of points: a bias of 1 % would show.
#[test]
fn random_points_find_the_light_that_others_see() {
    let (tree, fake) = (divided(4), Fake { light, open });
    for flux in [0.0, 10.0] {
        let stake = Stake {
            split: 0.0,
            flux,
            tolerance: 0.1,
            may_split: true,
            tiny: false,
        };
        let (mut found, mut want) = ([0.0; 2], [0.0; 2]);
        for leaf in tree.leaves() {
            let area = tree.node(leaf).area;
            let mut memory = Memory::default();
            let mean = by_chance(&tree, leaf, &fake, &stake, &mut memory);
            let mut ended = LeafSamples::default();
            mean.end(&mut ended, 1);
            found[0] += area * f64::from(ended.rows[0]);
            found[1] += area * f64::from(ended.rows[0] * ended.whole[0]);
            let (mut seen, mut total, mut all) = (0.0, 0.0, 0.0);
            for k in 0..64 {
                let at = triangle_weights(sequence02(k, 77));
                let to = receiver(&tree, leaf, at, 0);
                seen += f64::from(open(&to) * light(&to));
                total += f64::from(open(&to));
                all += f64::from(light(&to));
            }
            want[0] += area * seen / total;
            want[1] += area * all / 64.0;
        }
        for (found, want) in found.iter().zip(want) {
            assert!((found / want - 1.0).abs() < 0.005, "{flux}: {found} {want}");
        }
    }
}

#[test]
fn points_have_a_variance_and_a_range() {
    let mean = |bright: &[f32]| {
        let mut mean = Mean::new();
        for &b in bright {
            mean.add(&[b; 64], [1.0; 2], &[1.0], &mut Memory::default());
        }
        mean
    };
    assert_eq!(mean(&[1.0, 1.0]).variance(), 0.0);
    assert!((mean(&[0.0, 2.0]).variance() - 2.0).abs() < 1e-12);
    assert_eq!(mean(&[0.0, 2.0]).half_range(), 1.0);
}

/// Light everywhere on a leaf but for spots that cover a twentieth of it.
fn spotted(to: &Receiver) -> f32 {
    let place = to.point.dot(glam::DVec3::new(997.0, 1009.0, 1013.0));
    match place.rem_euclid(1.0) < 0.05 {
        true => 0.0,
        false => 3.0,
    }
}

/// Eight points miss such a shadow on two of three leaves; where light matters there are more.
#[test]
fn shadows_on_leaves_that_matter_are_found() {
    let stake = |split: f64| Stake {
        split,
        flux: 0.0,
        tolerance: 0.1,
        may_split: true,
        tiny: false,
    };
    let points = [0.0, 1.0, 3.0, 5.0, 1e9, f64::INFINITY, f64::NAN];
    let points = points.map(|split| stake(split).deciding(3.0));
    assert_eq!(points, [8, 8, 32, 64, 64, 64, 8]);
    let tree = divided(3);
    let spotted = Fake {
        light: spotted,
        open: |_| 1.0,
    };
    let found = |split: f64| {
        let uneven = tree.leaves().filter(|&leaf| {
            let mut memory = Memory::default();
            let mean = by_chance(&tree, leaf, &spotted, &stake(split), &mut memory);
            mean.half_range * split > 1.0
        });
        uneven.count() as f64 / tree.leaves().count() as f64
    };
    let (much, little) = (found(5.0), found(1.0));
    assert!(much > 0.9 && little < 0.6, "{much} {little}");
}

/// A lamp so close to a leaf that no place of those that tell how bright it may be sees much of it: one point before the lamp must not pass for
/// all of the leaf.
#[test]
fn leaves_brighter_than_they_may_be_are_uneven() {
    let tree = divided(3);
    let lamp = Fake {
        light: |to| 30.0 * (3.0 - spotted(to)),
        open: |_| 1.0,
    };
    let stake = Stake {
        split: 0.2,
        flux: 0.0,
        tolerance: 0.1,
        may_split: true,
        tiny: false,
    };
    let (mut lit, mut dark) = (0, 0);
    for leaf in tree.leaves() {
        let mean = by_chance(&tree, leaf, &lamp, &stake, &mut Memory::default());
        let half_range = match mean.bright[1] > 0.0 {
            true => 45.0,
            false => -lamp.unshadowed(&tree, leaf, 0.1),
        };
        assert_eq!(mean.half_range, half_range);
        *if half_range > 0.0 {
            &mut lit
        } else {
            &mut dark
        } += 1;
    }
    assert!(lit > 0 && dark > lit, "{lit} {dark}");
}
