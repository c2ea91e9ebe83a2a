//! Lamps of many faces from afar: each is one lamp, whose faces are points with a normal and an area.

use super::gatherer::{Gatherer, Memory, SourceElement};
use super::receiver::Receiver;

/// Beyond this many radii of its largest face a lamp's faces count as points: the irradiance by a triangle then differs from that by its
/// middle by less than 1 % (half the second derivatives of the kernel, 10 over the square of the distance, times the mean square of its
/// extent), and for all faces of a bulb by less than .5 %.
const AFAR: f64 = 12.0;
/// A lamp of at least this many faces has many. Fewer are divided and clipped exactly.
const MANY: usize = 16;

impl Gatherer<'_> {
    /// Is a cluster a lamp of many faces that count as points from here?
    pub(super) fn is_fixture(&self, to: &Receiver, id: u32) -> bool {
        let (fixtures, node) = (&self.light.fixtures, self.tree.node(id));
        let gap = (node.centre - to.point).length() - node.radius;
        gap > AFAR * fixtures.grain(id) && fixtures.below(self.tree, id).len() >= MANY
    }

    /// Puts such a lamp in the list of lamps that rays decide together.
    pub(super) fn put_off(&self, to: &Receiver, id: u32, memory: &mut Memory) {
        let fixtures = &self.light.fixtures;
        let faces = memory.faces.len();
        let factor = self.faces_of(to, id, memory);
        if factor > 0.0 {
            let element = fixtures.element(fixtures.below(self.tree, id).start);
            let emitted = f64::from(self.light.bright_emitted[element as usize]);
            memory.sources.push(SourceElement {
                id: element,
                fixture: id,
                faces,
                factor,
                carries: factor * emitted,
            });
        }
    }

    /// Adds the factors of a lamp's faces to the memory; returns their sum.
    fn faces_of(&self, to: &Receiver, id: u32, memory: &mut Memory) -> f64 {
        let fixtures = &self.light.fixtures;
        let faces = fixtures.below(self.tree, id);
        fixtures.factors(faces, to.point, to.normal, &mut memory.faces)
    }

    /// The face of such a lamp that a number in [0, 1) selects by the factors in the memory: its element, its share of the whole, and
    /// the rest of the number. `upto`: the face selected last and the sum of factors before it; numbers must ascend.
    pub(super) fn face_of(
        &self,
        lamp: &SourceElement,
        u: f64,
        upto: &mut (usize, f64),
        memory: &Memory,
    ) -> (u32, f64, f64) {
        let faces = self.light.fixtures.below(self.tree, lamp.fixture);
        let factors = &memory.faces[lamp.faces..][..faces.len()];
        let (face, before) = upto;
        while *face + 1 < factors.len() && *before + factors[*face] <= u * lamp.factor {
            *before += factors[*face];
            *face += 1;
        }
        let rest = ((u * lamp.factor - *before) / factors[*face]).clamp(0.0, 1.0);
        let share = factors[*face] / lamp.factor;
        let element = self.light.fixtures.element(faces.start + *face);
        (element, share, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lambert_triangles_x8;
    use crate::hierarchy::{Element, NONE};
    use crate::light::Fixtures;
    use crate::link::in_front_of;
    use crate::transport::tests::{baked, middle};

    /// Clusters below the lit root that count as lamps of many faces from a point.
    fn fixtures(gatherer: &Gatherer, to: &Receiver) -> Vec<u32> {
        let (mut found, mut open) = (Vec::new(), vec![gatherer.light.lit[0]]);
        while let Some(id) = open.pop() {
            let node = gatherer.tree.node(id);
            if gatherer.is_fixture(to, id) {
                found.push(id);
            } else if node.element == NONE {
                let parts = node.child_range().map(|c| gatherer.light.lit[c as usize]);
                open.extend(parts.filter(|&c| c != NONE));
            }
        }
        found
    }

    /// Each face against its exact form factor, and all of them together.
    #[test]
    fn faces_of_a_bulb_are_points_from_afar() {
        let bake = baked("mirrored.glb", 1);
        let (mut seen, mut worst) = (0, 0.0_f64);
        bake.room.with_sight(|sight| {
            let gatherer = bake.gatherer(sight);
            let mut memory = Memory::default();
            for leaf in bake.tree().leaves().step_by(7) {
                let to = middle(bake.tree(), leaf);
                for id in fixtures(&gatherer, &to) {
                    memory.faces.clear();
                    let sum = gatherer.faces_of(&to, id, &mut memory);
                    let faces = gatherer.light.fixtures.below(gatherer.tree, id);
                    let exact: Vec<f64> = faces
                        .map(|face| {
                            let node = gatherer.tree.node(gatherer.light.fixtures.element(face));
                            let Element { corners, face, .. } =
                                *gatherer.tree.element(node).unwrap();
                            let (point, plane) = (to.point, to.plane);
                            if !in_front_of(gatherer.tree, &corners, face as usize, point, plane) {
                                return 0.0;
                            }
                            let corners = [corners].into_iter();
                            lambert_triangles_x8(point, to.normal, corners)[0]
                        })
                        .collect();
                    let whole: f64 = exact.iter().sum();
                    // Where the horizon of the point cuts the bulb, faces on the horizon are in or out as a whole.
                    let node = gatherer.tree.node(id);
                    let above = (node.centre - to.point).dot(to.normal) > node.radius;
                    if above {
                        let largest = exact.iter().copied().fold(0.0, f64::max);
                        for (fast, exact) in memory.faces.iter().zip(&exact) {
                            assert!((fast - exact).abs() <= 0.01 * largest, "{fast} {exact}");
                        }
                        worst = worst.max((sum / whole - 1.0).abs());
                        seen += 1;
                    }
                }
            }
        });
        println!("{seen} bulbs, worst {worst}");
        assert!(seen > 100 && worst < 5e-3, "{seen} {worst}");
    }

    /// The light of lamps with and without their hierarchy.
    #[test]
    fn a_lamp_of_many_faces_is_all_its_faces() {
        for room in ["mirrored.glb", "curtained.glb"] {
            let bake = baked(room, 1);
            let mut plain = bake.light().clone();
            plain.fixtures = Fixtures::none(bake.tree());
            let (mut off, mut all, mut rays) = (0.0, 0.0, [0, 0]);
            bake.room.with_sight(|sight| {
                // So many rays that their noise is small.
                let fast = Gatherer {
                    tolerance: 1e-6,
                    ..bake.gatherer(sight)
                };
                let slow = Gatherer {
                    light: &plain,
                    tolerance: 1e-6,
                    ..bake.gatherer(sight)
                };
                for leaf in bake.tree().leaves().step_by(31) {
                    let to = middle(bake.tree(), leaf);
                    let bright = |gatherer: &Gatherer, rays: &mut u64| {
                        let mut memory = Memory::default();
                        let row = gatherer.direct(&to, &mut memory);
                        *rays += memory.rays;
                        bake.lanes().tristimulus(&row)[1]
                    };
                    let [a, b] = [(&fast, 0), (&slow, 1)].map(|(g, k)| bright(g, &mut rays[k]));
                    off += (a - b).abs();
                    all += b;
                }
            });
            assert!(all > 0.0 && off < 0.01 * all, "{room}: {off} of {all}");
            assert_ne!(rays[0], 0);
        }
    }
}
