//! How much of each face counts as room, found by where light lands.
//!
//! Errors are averaged, points are watched and patches are refined by counted area: a plain around a house has a thousand times the area of
//! the house and none of its light. Light that goes from surface to surface lands about evenly everywhere in a room; where it lands less
//! than [`DARK`] times as densely as usual, area counts in proportion, elsewhere in full. So a dark corner of a room counts like the rest,
//! and what no light reaches counts for nothing, the outsides of walls as well as the plain. Faces that lie partly in the room are split.

use super::tree::{NONE, Tree, quarter};
use crate::geometry::quarters;
use crate::geometry::sampling::triangle_weights;
use glam::DVec3;

/// Share of the usual density of landings from which on area counts in full.
const DARK: f64 = 0.02;
/// Least number of landings on a piece that just counts in full: smaller pieces are not distinguished. Of light at four times the
/// least density less than one part in 10^11 is taken for darker than the least by chance (Poisson, 64 expected).
const EVIDENCE: f64 = 16.0;
/// Landings in a piece whose density is determined.
const PIECE: usize = 16;
/// An element is split for its dark part only if that is more than this share of the room.
const WORTH: f64 = 0.01;

/// Where light landed: the entry of a face, and weights of its corners.
pub(crate) type LandingPoint = (u32, [f64; 3]);

/// How much of a hierarchy counts; empty where everything does.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Counted {
    /// Elements that were split for this, in order.
    pub(crate) splits: Vec<u32>,
    /// Share of each node that is a leaf after these splits, ascending; in [0, 1].
    pub(crate) shares: Vec<f32>,
}

/// The state of finding what counts.
struct SplitSearch {
    /// Least density of landings that counts in full, 1/m2.
    full: f64,
    /// Dark parts below this area are not worth a split.
    worth: f64,
    splits: Vec<u32>,
    /// Shares found so far by node; NaN where none is known.
    shares: Vec<f32>,
}

impl Tree {
    /// Finds what counts, and splits elements that lie partly in the room.
    pub(crate) fn count(&mut self, mut landings: Vec<LandingPoint>) -> Counted {
        landings.sort_by_key(|landing| landing.0);
        let mut pieces = Vec::new();
        self.pieces(0, &mut landings.clone(), &mut pieces);
        let Some(usual) = usual(pieces) else {
            return Counted::default();
        };
        let mut finder = SplitSearch {
            full: DARK * usual,
            worth: WORTH * landings.len() as f64 / usual,
            splits: Vec::new(),
            shares: vec![f32::NAN; self.nodes.len()],
        };
        finder.find(self, 0, &mut landings);
        let mut shares = finder.shares;
        shares.resize(self.nodes.len(), f32::NAN);
        for k in 1..shares.len() {
            if shares[k].is_nan() {
                shares[k] = shares[self.nodes[k].parent as usize];
            }
        }
        let shares: Vec<f32> = self.leaves().map(|k| shares[k as usize]).collect();
        if shares.iter().all(|&share| share == 1.0) {
            return Counted::default();
        }
        Counted {
            splits: finder.splits,
            shares,
        }
    }

    /// Lets only `counted` count; the hierarchy is the one it was found for, before or after its splits.
    pub(crate) fn weigh(&mut self, counted: &Counted) {
        for &id in &counted.splits {
            // A file may name any number.
            if (id as usize) < self.nodes.len() {
                self.subdivide(id);
            }
        }
        self.known = self.nodes.len() as u32;
        if counted.shares.is_empty() {
            return;
        }
        let leaves: Vec<u32> = self.leaves().collect();
        for (&leaf, &share) in leaves.iter().zip(&counted.shares) {
            let node = &mut self.nodes[leaf as usize];
            node.counted = node.area * f64::from(share);
        }
        for k in (0..self.nodes.len()).rev() {
            if !self.nodes[k].is_leaf() {
                let children = self.nodes[k].child_range();
                self.nodes[k].counted = children.map(|c| self.node(c).counted).sum();
            }
        }
        self.face_counted = vec![0.0];
        for &node in &self.face_node {
            let sum = self.face_counted[self.face_counted.len() - 1];
            self.face_counted.push(sum + self.node(node).counted);
        }
    }

    /// The area that counts; 0 for a room without faces.
    pub fn counted(&self) -> f64 {
        self.nodes.first().map_or(0.0, |root| root.counted)
    }

    /// A node's share of the area that counts.
    pub fn share(&self, id: u32) -> f64 {
        self.node(id).counted / self.counted()
    }

    /// The box around all leaves of which more than half counts, recentred; none where there are none.
    pub(crate) fn counted_box(&self) -> Option<[DVec3; 2]> {
        let nodes = self.leaves().map(|k| self.node(k));
        let some = nodes.filter(|node| node.counted > 0.5 * node.area);
        some.map(|node| [node.low, node.high])
            .reduce(|[low, high], [a, b]| [low.min(a), high.max(b)])
    }

    /// A random point by counted area, from a `share` of this area in [0, 1) and a point of the unit square: entry of a face,
    /// and weights of its corners.
    pub(crate) fn random(&self, share: f64, square: [f64; 2]) -> (usize, [f64; 3]) {
        let sums = match self.face_counted.is_empty() {
            true => &self.face_area,
            false => &self.face_counted,
        };
        let target = share * self.counted();
        let entry = sums.partition_point(|&a| a <= target).max(1) - 1;
        let entry = entry.min(self.faces.len() - 1);
        let mut corners = [DVec3::X, DVec3::Y, DVec3::Z];
        let (mut id, mut left) = (self.face_node[entry], target - sums[entry]);
        while (self.node(id).child) < self.known {
            let mut part = 0;
            let child = |part: usize| self.node(self.node(id).child + part as u32).counted;
            while part < 3 && left >= child(part) {
                left -= child(part);
                part += 1;
            }
            corners = quarters(corners)[part];
            id = self.node(id).child + part as u32;
        }
        let weights = triangle_weights(square);
        let point: DVec3 = (0..3).map(|k| corners[k] * weights[k]).sum();
        (entry, point.to_array())
    }

    /// Children of a node that have landings, each with these.
    fn by_child<'a>(
        &self,
        id: u32,
        landings: &'a mut [LandingPoint],
    ) -> Vec<(u32, &'a mut [LandingPoint])> {
        let node = self.node(id);
        if node.element != NONE {
            let parts = by_quarter(landings);
            let children = node.child_range();
            return children.zip(parts).collect();
        }
        let mut rest = landings;
        let mut found = Vec::new();
        for child in node.child_range() {
            let (first, count) = self.node(child).faces;
            let here = rest.partition_point(|landing| landing.0 < first + count);
            let (own, others) = rest.split_at_mut(here);
            found.push((child, own));
            rest = others;
        }
        found
    }

    /// Area and landings of pieces, each as large as needed to hold some.
    fn pieces(&self, id: u32, landings: &mut [LandingPoint], pieces: &mut Vec<(f64, usize)>) {
        let node = self.node(id);
        if node.element != NONE {
            pieces_of_element(node.area, landings, pieces);
        } else if landings.len() <= PIECE {
            pieces.push((node.area, landings.len()));
        } else {
            for (child, landings) in self.by_child(id, landings) {
                self.pieces(child, landings, pieces);
            }
        }
    }
}

fn pieces_of_element(area: f64, landings: &mut [LandingPoint], pieces: &mut Vec<(f64, usize)>) {
    if landings.len() <= PIECE || area < f64::MIN_POSITIVE {
        pieces.push((area, landings.len()));
        return;
    }
    for part in by_quarter(landings) {
        pieces_of_element(0.25 * area, part, pieces);
    }
}

/// Landings on the quarters of an element, with their weights there.
fn by_quarter(landings: &mut [LandingPoint]) -> [&mut [LandingPoint]; 4] {
    let mut tagged: Vec<(u32, LandingPoint)> = (landings.iter())
        .map(|&(entry, mut weights)| (quarter(&mut weights), (entry, weights)))
        .collect();
    tagged.sort_by_key(|(part, _)| *part);
    for (landing, (_, moved)) in landings.iter_mut().zip(&tagged) {
        *landing = *moved;
    }
    let mut rest = landings;
    [0, 1, 2, 3].map(|part| {
        let count = tagged.iter().filter(|(of, _)| *of == part).count();
        let (own, others) = std::mem::take(&mut rest).split_at_mut(count);
        rest = others;
        own
    })
}

/// The density that half of all landings exceed; none without landings.
fn usual(pieces: Vec<(f64, usize)>) -> Option<f64> {
    let pieces = (pieces.into_iter()).filter(|&(area, count)| count > 0 && area > 0.0);
    median(pieces.map(|(area, count)| (count as f64 / area, count as f64)))
}

/// The number that those with half of all weight do not exceed, from numbers and their weights; none without weight.
pub(crate) fn median(weighted: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let mut all: Vec<(f64, f64)> = weighted.collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * all.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut passed = 0.0;
    let middle = all.iter().find(|(_, weight)| {
        passed += weight;
        passed > half
    });
    middle.map(|(number, _)| *number)
}

impl SplitSearch {
    /// Is an area large enough for landings to tell whether it counts?
    fn tells(&self, area: f64) -> bool {
        area * self.full >= EVIDENCE
    }

    fn share(&self, area: f64, landings: usize) -> f64 {
        (landings as f64 / (area * self.full)).min(1.0)
    }

    /// How much of an element's area counts.
    fn lit(&self, area: f64, landings: &mut [LandingPoint]) -> f64 {
        if landings.is_empty() {
            return 0.0;
        }
        if !self.tells(0.25 * area) {
            return area * self.share(area, landings.len());
        }
        let parts = by_quarter(landings);
        parts
            .into_iter()
            .map(|part| self.lit(0.25 * area, part))
            .sum()
    }

    fn set(&mut self, tree: &Tree, id: u32, share: f64) {
        self.shares.resize(tree.nodes.len(), f32::NAN);
        self.shares[id as usize] = share as f32;
    }

    fn find(&mut self, tree: &mut Tree, id: u32, landings: &mut [LandingPoint]) {
        let node = tree.node(id).clone();
        if node.element == NONE {
            let told = node
                .child_range()
                .any(|child| self.tells(tree.node(child).area));
            if !told {
                // Children too small to tell, and too small together: they count.
                let share = match self.tells(node.area) {
                    true => self.share(node.area, landings.len()),
                    false => 1.0,
                };
                return self.set(tree, id, share);
            }
            for (child, landings) in tree.by_child(id, landings) {
                match self.tells(tree.node(child).area) {
                    true => self.find(tree, child, landings),
                    false => self.set(tree, child, 1.0),
                }
            }
            return;
        }
        let dark = node.area - self.lit(node.area, &mut landings.to_vec());
        let split = dark > self.worth && dark < (1.0 - 1e-9) * node.area;
        if node.is_leaf() && !split {
            let share = 1.0 - dark / node.area;
            return self.set(tree, id, if share > 1.0 - 1e-9 { 1.0 } else { share });
        }
        if node.is_leaf() {
            tree.subdivide(id);
            self.splits.push(id);
        }
        for (child, landings) in tree.by_child(id, landings) {
            self.find(tree, child, landings);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::hierarchy::Node;

    /// A root over two faces of areas 1 and 10^6, corners at (0, 0), (1, 0), (0, 1) and a thousand times as far.
    fn tree() -> Tree {
        let mut tree = Tree {
            faces: Vec::new(),
            face_node: vec![1, 2],
            face_area: vec![0.0, 1.0, 1e6 + 1.0],
            ..Tree::default()
        };
        tree.nodes.push(Node {
            child: 1,
            children: 2,
            faces: (0, 2),
            ..Node::bare(NONE, 1e6 + 1.0)
        });
        for (k, area) in [(0, 1.0), (1, 1e6)] {
            let size = f64::sqrt(2.0 * area);
            tree.elements.push(crate::hierarchy::Element {
                corners: [DVec3::ZERO, DVec3::X * size, DVec3::Y * size],
                face: k,
                depth: 0,
            });
            tree.nodes.push(Node {
                element: k,
                faces: (k, 1),
                flat: true,
                ..Node::bare(0, area)
            });
            tree.faces.push(crate::hierarchy::Face {
                triangle: k,
                back: false,
            });
        }
        tree
    }

    /// Landings all over the first face, and on a corner of the second that is as large as the first.
    fn landings(on: [usize; 2]) -> Vec<LandingPoint> {
        let mut random = Pcg::new(7);
        let mut all = Vec::new();
        for (entry, count) in [(0, on[0]), (1, on[1])] {
            for _ in 0..count {
                let [_, v, w] = triangle_weights([random.f64(), random.f64()]);
                let [v, w] = [v, w].map(|x| if entry == 1 { 1e-3 * x } else { x });
                all.push((entry, [1.0 - v - w, v, w]));
            }
        }
        all
    }

    #[test]
    fn a_corner_of_a_large_face_counts() {
        let mut tree = tree();
        let counted = tree.count(landings([20_000, 20_000]));
        tree.weigh(&counted);
        // 1 m2 of each. Parts are distinguished down to legs of .35 m (2^-12 of the face), and parts that the border of 2 m passes through
        // count.
        let all = tree.counted();
        assert!((2.0..2.5).contains(&all), "{all}");
        assert_eq!(tree.node(1).counted, 1.0);
        let [low, high] = tree.counted_box().unwrap();
        assert!(low.length() < 1e-9 && high.max_element() < 1.8, "{high}");
        // Random points lie where area counts.
        let mut random = Pcg::new(9);
        let mut on = [0.0_f64; 2];
        for k in 0..1000 {
            let (entry, weights) = tree.random(f64::from(k) / 1000.0, [random.f64(), random.f64()]);
            on[entry] += 1e-3;
            assert!(entry == 0 || weights[0] > 1.0 - 2e-3, "{weights:?}");
        }
        assert!((on[0] - 1.0 / all).abs() < 0.01, "{on:?}");
    }

    #[test]
    fn what_is_lit_about_evenly_counts_in_full() {
        let mut tree = tree();
        tree.nodes[2].area = 1.0;
        tree.nodes[0].area = 2.0;
        let mut even = landings([20_000, 0]);
        // A tenth as bright.
        let dim = landings([2_000, 0]).into_iter().map(|(_, w)| (1, w));
        even.extend(dim);
        assert_eq!(tree.count(even), Counted::default());
        assert_eq!(tree.count(Vec::new()), Counted::default());
        // A two-hundredth counts for a quarter.
        let mut dim = landings([20_000, 0]);
        dim.extend(landings([100, 0]).into_iter().map(|(_, w)| (1, w)));
        let counted = tree.count(dim);
        tree.weigh(&counted);
        assert!(
            (tree.node(2).counted - 0.25).abs() < 0.05,
            "{}",
            tree.node(2).counted
        );
    }
}
