//! Finds on few patches what sweeps over all leaves would find slowly: the two-grid method for equations of the second
//! kind (Atkinson 1976; Hackbusch, Multi-Grid Methods and Applications, 1985, chapter 16).
//!
//! A sweep turns R into `G(R) = rho (f + K R)` and leaves the error e, `e = d + A e` with the change `d = G(R) - R` and
//! `A = rho K`. So the solution is `G(R) + A e`, and of `A e = rho (K e)` the part in brackets is smooth: that is worked
//! out on a cut of the hierarchy, `u = K_c e_c`, `e_c = d_c + rho_c u` (means over patches, K_c from the same rays), and
//! every leaf reflects its patch's u. The next sweep finds the errors of the cut; the sweeps alone tell when to stop.

use super::outlook::Outlook;
use crate::hierarchy::{NONE, Tree};
use crate::light::rows::Rows;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use wide::f32x16;

/// Patches of the cut at the most.
const PATCHES: usize = 2560;
/// Sweeps over the cut at the most, and the relative change after which more are not worth while: the cut errs by more.
const SWEEPS: usize = 100;
const ENOUGH: f32 = 0.02;
/// Lanes that are solved together.
const BLOCK: usize = 16;

/// The least reflected light, as a share of the mean, that the error of a patch is related to.
const DARK: f64 = 0.05;

/// The cut, and who sees whom on it.
pub(crate) struct TwoGrid {
    /// Patch of each leaf, by leaf.
    patch: Vec<u32>,
    /// The leaves of each patch, as positions in the list of leaves.
    members: Vec<Vec<u32>>,
    /// Area of each patch that takes part.
    areas: Vec<f64>,
    /// For each patch, which patches its rays met and their shares.
    seen: Vec<Vec<(u32, f32)>>,
}

impl TwoGrid {
    /// Sums over the patches that the rays of the leaves met.
    pub(crate) fn new(tree: &Tree, outlook: &Outlook, leaves: &[u32], areas: &[f64]) -> Self {
        let of_node = cut(tree, PATCHES);
        let patch: Vec<u32> = leaves.iter().map(|&k| of_node[k as usize]).collect();
        let count = patch.iter().map(|&p| p as usize + 1).max().unwrap_or(0);
        let mut members = vec![Vec::new(); count];
        for (k, &p) in (0_u32..).zip(&patch) {
            members[p as usize].push(k);
        }
        let (areas, seen) = members
            .par_iter()
            .map(|members| {
                let (mut sums, mut area) = (vec![0.0_f64; count], 0.0);
                for leaf in members.iter().map(|&k| leaves[k as usize]) {
                    let (met, fronts) = outlook.met(leaf);
                    area += areas[leaf as usize];
                    let each = areas[leaf as usize] / f64::from(fronts);
                    for node in met {
                        if let Some(sum) = sums.get_mut(of_node[node as usize] as usize) {
                            *sum += each;
                        }
                    }
                }
                let row = (0_u32..).zip(sums).filter(|&(_, sum)| sum > 0.0);
                let row = row.map(|(k, sum)| (k, (sum / area) as f32)).collect();
                (area, row)
            })
            .unzip();
        Self {
            patch,
            members,
            areas,
            seen,
        }
    }

    /// Number of patches.
    pub(super) fn len(&self) -> usize {
        self.areas.len()
    }

    /// Rows of leaves times their areas, summed over each patch; `area` and `row` by position in the list of leaves.
    pub(super) fn sums<const L: usize>(
        &self,
        area: impl Fn(usize) -> f64 + Sync,
        row: impl Fn(usize) -> [f32; L] + Sync,
    ) -> Vec<[f64; L]> {
        let sum = |members: &Vec<u32>| {
            members.iter().fold([0.0; L], |mut sum, &k| {
                let (a, row) = (area(k as usize), row(k as usize));
                for (s, x) in sum.iter_mut().zip(row) {
                    *s += a * f64::from(x);
                }
                sum
            })
        };
        self.members.par_iter().map(sum).collect()
    }

    /// Means over the patches.
    pub(super) fn means<const L: usize>(&self, sums: &[[f64; L]]) -> Rows {
        let mut means = Rows::zero(self.areas.len(), L);
        let rows = means.all_mut::<L>().iter_mut();
        for ((mean, sum), area) in rows.zip(sums).zip(&self.areas) {
            *mean = sum.map(|s| (s / area) as f32);
        }
        means
    }

    /// Tristimulus values of sums over patches.
    pub(super) fn seen<const L: usize>(
        &self,
        sums: &[[f64; L]],
        xyz: &[[f64; 3]],
    ) -> Vec<[f64; 3]> {
        let seen = |row: &[f64; L]| {
            let lanes = row.iter().zip(xyz);
            lanes.fold([0.0; 3], |sum, (x, xyz)| {
                std::array::from_fn(|c| sum[c] + x * xyz[c])
            })
        };
        sums.par_iter().map(seen).collect()
    }

    /// Greatest relative error that remains in any patch, if changes go on to shrink by `ratio` per sweep. `before` and
    /// `change` are the changes of the last two sweeps (one may pass through zero), `all` is what patches reflect.
    pub(super) fn left(
        &self,
        before: &[[f64; 3]],
        change: &[[f64; 3]],
        all: &[[f64; 3]],
        ratio: f64,
    ) -> f64 {
        let area: f64 = self.areas.iter().sum();
        let mut greatest = 0.0_f64;
        for c in 0..3 {
            let mean = all.iter().map(|x| x[c]).sum::<f64>() / area;
            for ((before, change), (all, area)) in
                before.iter().zip(change).zip(all.iter().zip(&self.areas))
            {
                let change = change[c].abs().max(ratio * before[c].abs());
                let whole = all[c].max(DARK * mean * area);
                if whole > 0.0 {
                    greatest = greatest.max(change / whole);
                }
            }
        }
        greatest * ratio / (1.0 - ratio)
    }

    /// Adds to what leaves reflect the light that the error of a sweep sends them. `change` is the mean change by the sweep,
    /// `mean_reflectance` that of each patch. What leaves have `received`, by leaf and as means over the patches, tells how
    /// open each is to the light sent to its patch: in a closed pocket a correction meant for the room would put out the light,
    /// and sweeps bring it back only slowly.
    pub(super) fn correct<const L: usize>(
        &self,
        change: &Rows,
        mean_reflectance: &Rows,
        received: [&Rows; 2],
        reflectance: &Rows,
        reflected: &mut Rows,
    ) {
        let blocks: Vec<Vec<f32x16>> = (0..L.div_ceil(BLOCK))
            .into_par_iter()
            .map(|b| {
                let part = |rows: &Rows| -> Vec<f32x16> {
                    rows.all::<L>().iter().map(|row| block(row, b)).collect()
                };
                self.sent(&part(change), &part(mean_reflectance))
            })
            .collect();
        let mut sent = Rows::zero(self.len(), L);
        for (k, row) in sent.all_mut::<L>().iter_mut().enumerate() {
            for (to, block) in row.chunks_mut(BLOCK).zip(&blocks) {
                to.copy_from_slice(&block[k].to_array()[..to.len()]);
            }
        }
        let sent = sent.all::<L>();
        reflected
            .all_mut::<L>()
            .par_iter_mut()
            .zip(
                reflectance
                    .all::<L>()
                    .par_iter()
                    .zip(received[0].all::<L>()),
            )
            .zip(&self.patch)
            .for_each(|((r, (rho, h)), &p)| {
                let (sent, mean) = (&sent[p as usize], &received[1].all::<L>()[p as usize]);
                for l in 0..L {
                    let open = if h[l] < mean[l] { h[l] / mean[l] } else { 1.0 };
                    // Too great a correction must not make light negative.
                    r[l] = (r[l] + open * rho[l] * sent[l]).max(0.0);
                }
            });
    }
}

impl TwoGrid {
    /// The error that patches send each other, a block of lanes at a time: sweeps in place.
    fn sent(&self, change: &[f32x16], reflectance: &[f32x16]) -> Vec<f32x16> {
        let mut error = change.to_vec();
        let mut sent = vec![f32x16::ZERO; error.len()];
        for _ in 0..SWEEPS {
            let (mut moved, mut total) = (f32x16::ZERO, f32x16::ZERO);
            for (k, row) in self.seen.iter().enumerate() {
                // Several sums, so that none waits for another.
                let mut sums = [f32x16::ZERO; 4];
                let of =
                    |&(source, share): &(u32, f32)| f32x16::splat(share) * error[source as usize];
                let (fours, rest) = row.as_chunks::<4>();
                for four in fours {
                    sums = std::array::from_fn(|k| sums[k] + of(&four[k]));
                }
                for (sum, one) in sums.iter_mut().zip(rest) {
                    *sum += of(one);
                }
                let [a, b, c, d] = sums;
                sent[k] = (a + b) + (c + d);
                let next = change[k] + reflectance[k] * sent[k];
                let area = f32x16::splat(self.areas[k] as f32);
                moved += area * (next - error[k]).abs();
                total += area * next.abs();
                error[k] = next;
            }
            let lanes = moved.to_array().into_iter().zip(total.to_array());
            if lanes
                .into_iter()
                .all(|(moved, total)| moved <= ENOUGH * total)
            {
                break;
            }
        }
        sent
    }
}

/// Lanes of a block; those beyond the last are zero.
fn block(row: &[f32], b: usize) -> f32x16 {
    let lanes = &row[b * BLOCK..row.len().min((b + 1) * BLOCK)];
    let mut all = [0.0; BLOCK];
    all[..lanes.len()].copy_from_slice(lanes);
    f32x16::from(all)
}

/// Patch of each node at and below the cut; [`NONE`] above. Clusters of several planes are opened first, then nodes of
/// the greatest counted area.
fn cut(tree: &Tree, patches: usize) -> Vec<u32> {
    let key = |id: u32| {
        let node = tree.node(id);
        // Areas are positive: their bits sort as they do.
        (!node.flat, node.counted.to_bits(), Reverse(id))
    };
    let mut open = BinaryHeap::from([(key(0), 0)]);
    let mut patch = vec![NONE; tree.nodes.len()];
    let mut count = 0;
    while let Some((_, id)) = open.pop() {
        let children = tree.node(id).child_range();
        if children.is_empty() || count + open.len() + children.len() > patches {
            patch[id as usize] = count as u32;
            count += 1;
        } else {
            open.extend(children.map(|child| (key(child), child)));
        }
    }
    tree.inherit(&mut patch);
    patch
}

#[cfg(test)]
mod tests {
    use super::super::rays::RaySystem;
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::hierarchy::Node;

    const CLUSTERS: u32 = 40;
    const LEAVES: u32 = 30;
    const RAYS: usize = 64;

    /// A root, clusters, and leaves below these.
    fn tree() -> Tree {
        let mut tree = Tree::default();
        let mut push = |parent: u32, child: u32, children: u32, area: f64| {
            tree.nodes.push(Node {
                child: if children > 0 { child } else { NONE },
                children: children as u8,
                flat: parent != NONE,
                ..Node::bare(parent, area)
            });
        };
        push(NONE, 1, CLUSTERS, f64::from(CLUSTERS * LEAVES));
        for k in 0..CLUSTERS {
            push(0, 1 + CLUSTERS + k * LEAVES, LEAVES, f64::from(LEAVES));
        }
        for k in 0..CLUSTERS * LEAVES {
            push(1 + k / LEAVES, NONE, 0, 1.0);
        }
        tree
    }

    /// Clusters see themselves and their neighbours in a row: light goes slowly through such a room.
    #[test]
    fn sweeps_and_few_patches_find_what_sweeps_find() {
        const L: usize = 4;
        let tree = tree();
        let nodes = tree.nodes.len();
        let leaves: Vec<u32> = (1 + CLUSTERS..nodes as u32).collect();
        let mut random = Pcg::new(3);
        let mut below = |n: u32| random.below(n);
        let seen: Vec<Vec<u32>> = (0..leaves.len() as u32)
            .map(|k| {
                let own = k / LEAVES;
                let some = (0..RAYS).map(|_| {
                    let other = (own + below(3)).saturating_sub(1).min(CLUSTERS - 1);
                    1 + CLUSTERS + other * LEAVES + below(LEAVES)
                });
                some.collect()
            })
            .collect();
        let outlook = Outlook::of(nodes, &leaves, &seen);
        let areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        let (mut reflectance, mut first) =
            (Rows::zero(leaves.len(), L), Rows::zero(leaves.len(), L));
        for k in 0..leaves.len() {
            for l in 0..L {
                reflectance.row_mut(k)[l] = [0.3, 0.6, 0.9, 0.95][l];
                first.row_mut(k)[l] = if k < 100 { 1.0 + below(5) as f32 } else { 0.0 };
            }
        }
        let grid = TwoGrid::new(&tree, &outlook, &leaves, &areas);
        // The patches' rays sum to 1.
        for row in &grid.seen {
            let sum: f32 = row.iter().map(|x| x.1).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
        let xyz = [[1.0; 3]; L];
        let solved = |two_grid| {
            let system = RaySystem {
                tree: &tree,
                outlook: &outlook,
                leaves: &leaves,
                areas: &areas,
                reflectance: &reflectance,
                greatest: &[0.3, 0.6, 0.9, 0.95],
                two_grid,
                interrupt: &crate::team::NEVER,
            };
            let mut reflected = Rows::zero(leaves.len(), L);
            let (done, _) = system.solve::<L>(&first, &mut reflected, 1e-5);
            (done, reflected)
        };
        let (plain, expected) = solved(None);
        let (done, reflected) = solved(Some((&grid, &xyz[..])));
        assert!(done.iterations * 3 < plain.iterations, "{done:?} {plain:?}");
        for l in 0..L {
            let rows = (0..leaves.len()).map(|k| (reflected.row(k)[l], expected.row(k)[l]));
            let (mut gap, mut all) = (0.0, 0.0);
            for (a, b) in rows {
                gap += f64::from((a - b).abs());
                all += f64::from(b);
            }
            assert!(gap < 1e-4 * all, "{l}: {gap} {all}");
        }
    }
}
