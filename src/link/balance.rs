//! Makes every row of form factors sum to what it must, symmetrically.
//!
//! Finds factors `d_i` on the leaves such that `d_i * sum_j G_ij d_j = target_i A_i` (Sinkhorn and Knopp 1967, in the
//! symmetric form of Knight 2008): reciprocity stays exact, and with target 1 light is neither made nor lost. In a
//! closed room of albedo .95, rows that miss 1 % make it 16 % too dark. Where the room is open, rows above 1 are
//! brought down to 1 and the others left as they are.

use super::LinkRows;
use crate::hierarchy::Tree;

/// Rows are balanced to this relative accuracy.
const TOLERANCE: f64 = 1e-6;
/// Steps at the most; compact rooms take under 20.
const STEPS: usize = 200;
/// A leaf is corrected by this much at the most: a patch that sees next to nothing must not be blown up.
const RANGE: [f64; 2] = [0.5, 2.0];

/// Row factors and what the rows summed to before.
#[derive(Debug, Clone, Default)]
pub struct Balance {
    /// Factor of each node that is a leaf (1 elsewhere).
    pub factor: Vec<f32>,
    /// Area-weighted mean and greatest distance of row sums from 1 before balancing.
    pub defect_before: [f64; 2],
    /// The same after.
    pub defect_after: [f64; 2],
    /// Leaves whose factor met the limit.
    pub limited: usize,
}

/// Balances the rows of a hierarchy. `closed`: does light leaving any face always meet a face?
pub fn balance(tree: &Tree, rows: &LinkRows, closed: Closed) -> Balance {
    let leaves: Vec<usize> = (0..tree.nodes.len()).filter(|&k| tree.nodes[k].is_leaf()).collect();
    let mut factor = vec![1.0_f64; tree.nodes.len()];
    let mut sums = row_sums(tree, rows, &factor);
    let defect_before = defect(tree, &leaves, &sums, closed);
    for _ in 0..STEPS {
        let mut worst = 0.0_f64;
        for &k in &leaves {
            let wrong = match closed {
                Closed::Yes => sums[k],
                Closed::No => sums[k].max(1.0),
            };
            if wrong <= 0.0 {
                continue;
            }
            let next = (factor[k] / wrong.sqrt()).clamp(RANGE[0], RANGE[1]);
            worst = worst.max((next / factor[k] - 1.0).abs());
            factor[k] = next;
        }
        sums = row_sums(tree, rows, &factor);
        if worst < TOLERANCE {
            break;
        }
    }
    Balance {
        defect_before,
        defect_after: defect(tree, &leaves, &sums, closed),
        limited: leaves.iter().filter(|&&k| RANGE.contains(&factor[k])).count(),
        factor: factor.into_iter().map(|f| f as f32).collect(),
    }
}

/// Can light leave the room, or be lost on a black back?
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Closed {
    /// No: every row must sum to 1.
    Yes,
    /// Yes: rows may sum to less.
    No,
}

/// Sum of form factors of every leaf, scaled: `d_i / A_i * sum over links of i and its ancestors of G_ab mean_b(d)`.
pub(crate) fn row_sums(tree: &Tree, rows: &LinkRows, factor: &[f64]) -> Vec<f64> {
    let nodes = &tree.nodes;
    let mut mean = factor.to_vec();
    for k in (0..nodes.len()).rev() {
        if !nodes[k].is_leaf() {
            let children = nodes[k].child_range().map(|c| c as usize);
            mean[k] = children.map(|c| nodes[c].area * mean[c]).sum::<f64>() / nodes[k].area;
        }
    }
    let mut sums = vec![0.0; nodes.len()];
    for k in 0..nodes.len() {
        let own: f64 = rows.row(k).iter().map(|&(source, g)| f64::from(g) * mean[source as usize]).sum();
        let above = if k == 0 { 0.0 } else { sums[nodes[k].parent as usize] };
        sums[k] = above + own / nodes[k].area;
    }
    for (k, sum) in sums.iter_mut().enumerate() {
        *sum *= factor[k];
    }
    sums
}

/// Mean and greatest distance of row sums from 1 (open rooms: above 1).
fn defect(tree: &Tree, leaves: &[usize], sums: &[f64], closed: Closed) -> [f64; 2] {
    let (mut mean, mut worst, mut area) = (0.0, 0.0_f64, 0.0);
    for &k in leaves {
        let wrong = match closed {
            Closed::Yes => (sums[k] - 1.0).abs(),
            Closed::No => (sums[k] - 1.0).max(0.0),
        };
        mean += wrong * tree.nodes[k].area;
        area += tree.nodes[k].area;
        worst = worst.max(wrong);
    }
    [if area > 0.0 { mean / area } else { 0.0 }, worst]
}
