//! A solution: the reflected and emitted light of every patch, in rows, with what the gather and refinement need of it.

use super::descent::Descent;
use super::fixtures::Fixtures;
use super::lanes::Lanes;
use super::rows::Rows;
use super::through::Through;
use super::tilts::Tilts;
use crate::hierarchy::{Mesh, NONE, Tree};
use crate::link::{Graph, Occlusion};
use rayon::prelude::*;

/// The light in a room after a round.
#[derive(Debug, Clone, Default)]
pub struct Light {
    /// Reflected radiosity of every node (area mean), by lane.
    pub reflected: Rows,
    /// Exitance of every node (area mean), by lane.
    pub emitted: Rows,
    /// Radiosity of every leaf that is a mirror, by node, for rays that met too many mirrors; for all other light mirrors are dark.
    /// Empty in a room without mirrors.
    pub mirrors: Rows,
    /// Irradiance of every leaf of the hierarchy, in order of `leaves`; for diffuse sheets as shown, see [`Through`].
    pub irradiance: Rows,
    /// What the sides of diffuse sheets show of each other's light.
    pub through: Through,
    /// Leaves of the hierarchy, ascending.
    pub leaves: Vec<u32>,
    /// Brightness of each node's reflected radiosity, share of the white's.
    pub bright_reflected: Vec<f32>,
    /// Brightness of each node's exitance.
    pub bright_emitted: Vec<f32>,
    /// Greatest brightness of reflected radiosity on any leaf below each node.
    pub brightest: Vec<f32>,
    /// Standard deviation of brightness over the leaves of a node.
    pub deviation: Vec<f32>,
    /// Brightness of the light that arrives on every node that is a leaf, share of the white's; 0 elsewhere.
    pub arrival: Vec<f32>,
    /// Of nodes that are leaves of sheets: the brightness of the light that arrives on the side itself, and the share of its light as
    /// shown that comes from behind. Empty in a room without sheets.
    pub sides: Vec<[f32; 2]>,
    /// The hierarchy as rays need it.
    pub descent: Descent,
    /// For each node the first node, itself or below, that is an emitting element or has several children with emission below;
    /// [`NONE`] where nothing emits.
    pub lit: Vec<u32>,
    /// Lamps of many faces.
    pub fixtures: Fixtures,
    /// Brightness of a punctual light's intensity (of its normal irradiance where it is directional).
    pub bright_lamps: Vec<f32>,
    /// Where leaves are brighter, as rays find it; even elsewhere.
    pub(crate) tilts: Tilts,
    /// The links of each node.
    pub neighbours: Neighbours,
    /// Irradiance of the adaptation white, tristimulus.
    pub white: [f64; 3],
    /// Half the diagonal of the room.
    pub half_size: f64,
    /// Does light count by what it excites as well as by being visible? Then light that is faint by both together may be bright
    /// by one.
    pub apart: bool,
}

impl Light {
    /// Lanes in a row, padding included.
    pub fn width(&self) -> usize {
        self.reflected.width()
    }

    /// Bytes held, except for the other ends of links.
    pub fn bytes(&self) -> usize {
        let scalars = [
            &self.bright_reflected,
            &self.bright_emitted,
            &self.brightest,
            &self.deviation,
            &self.arrival,
        ];
        let rows = [
            &self.reflected,
            &self.emitted,
            &self.mirrors,
            &self.irradiance,
        ];
        rows.iter().map(|rows| rows.bytes()).sum::<usize>()
            + scalars.iter().map(|list| 4 * list.len()).sum::<usize>()
            + 8 * self.sides.len()
            + size_of_val(self.tilts.0.as_slice())
            + self.descent.bytes()
            + self.through.bytes()
            + self.fixtures.bytes()
            + 4 * (self.bright_lamps.len() + self.leaves.len() + self.lit.len())
    }

    /// Works out brightness and its deviation from the rows, and what rays need of the nodes.
    pub fn measure(&mut self, tree: &Tree, mesh: &Mesh, lanes: &Lanes) {
        let white = self.white;
        let scalar = |row: &[f32]| brightness(lanes.notice(row), white) as f32;
        let n = tree.nodes.len();
        self.descent = Descent::new(tree);
        let each = |rows: &Rows| -> Vec<f32> {
            let all = (0..n).into_par_iter();
            all.map(|k| scalar(rows.row(k))).collect()
        };
        self.bright_reflected = each(&self.reflected);
        self.bright_emitted = each(&self.emitted);
        self.lit = vec![NONE; n];
        for k in (0..n).rev().filter(|&k| self.bright_emitted[k] > 0.0) {
            let node = &tree.nodes[k];
            let mut children = node.child_range().filter(|&c| self.lit[c as usize] != NONE);
            self.lit[k] = match (children.next(), children.next()) {
                (Some(only), None) if node.element == NONE => self.lit[only as usize],
                _ => k as u32,
            };
        }
        self.fixtures = Fixtures::new(tree, mesh, &self.bright_emitted);
        self.brightest = self.bright_reflected.clone();
        for k in (0..n).rev() {
            let below = tree.nodes[k]
                .child_range()
                .map(|c| self.brightest[c as usize]);
            self.brightest[k] = below.fold(self.brightest[k], f32::max);
        }
        let both = |k: usize| f64::from(self.bright_reflected[k] + self.bright_emitted[k]);
        let mut square: Vec<f64> = (0..n).map(|k| both(k) * both(k)).collect();
        self.deviation = vec![0.0; n];
        for k in (0..n).rev() {
            let node = &tree.nodes[k];
            if node.is_leaf() {
                continue;
            }
            square[k] = node
                .child_range()
                .map(|c| square[c as usize] * tree.node(c).area)
                .sum::<f64>()
                / node.area;
            let mean = both(k);
            // Differences below rounding of f32 rows are no deviation.
            let variance = square[k] - mean * mean;
            self.deviation[k] = if variance > 1e-12 * square[k] {
                variance.sqrt() as f32
            } else {
                0.0
            };
        }
    }
}

/// Anything darker than this share of white counts as this dark: nobody sees differences below.
const DARKEST: f64 = 0.02;

/// How much a change of light changes lightness at a brightness, as a multiple of that at white.
pub(crate) fn lightness_sensitivity(bright: f64) -> f64 {
    bright.max(DARKEST).powf(-2.0 / 3.0)
}

/// Brightness of a colour relative to white: the mean of the three ratios, so that no colour counts for nothing.
pub(crate) fn brightness(xyz: [f64; 3], white: [f64; 3]) -> f64 {
    (0..3)
        .map(|k| {
            if white[k] > 0.0 {
                xyz[k] / white[k]
            } else {
                0.0
            }
        })
        .sum::<f64>()
        / 3.0
}

/// A row as one number, by the weight of each lane.
pub(crate) fn weighed(row: &[f32], weights: &[f64]) -> f64 {
    let lanes = row.iter().zip(weights);
    lanes.map(|(x, w)| f64::from(*x) * w).sum()
}

/// For each node, the other ends of its links and what may stand between. Links found blocked are included: a point may
/// see what the few rays of a link did not.
#[derive(Debug, Clone, Default)]
pub struct Neighbours {
    start: Vec<u32>,
    ends: Vec<(u32, Occlusion, f32)>,
    /// Lists that [`Occlusion::Listed`] points into.
    pub blockers: Vec<u32>,
}

impl Neighbours {
    /// Sorts links into rows.
    pub fn new(nodes: usize, graph: &Graph) -> Self {
        let links = &graph.links;
        let mut start = vec![0_u32; nodes + 1];
        for link in links {
            start[link.a as usize + 1] += 1;
            start[link.b as usize + 1] += 1;
        }
        for k in 0..nodes {
            start[k + 1] += start[k];
        }
        let mut next = start.clone();
        let mut ends = vec![(0, Occlusion::Clear, 1.0); start[nodes] as usize];
        for link in links {
            for (end, other) in [(link.a, link.b), (link.b, link.a)] {
                ends[next[end as usize] as usize] = (other, link.occlusion, link.visibility());
                next[end as usize] += 1;
            }
        }
        Self {
            start,
            ends,
            blockers: graph.blockers.clone(),
        }
    }

    /// Other ends of a node's links.
    pub fn row(&self, node: u32) -> &[(u32, Occlusion, f32)] {
        let k = node as usize;
        // Elements split after the links were made have no links of their own.
        if k + 1 >= self.start.len() {
            return &[];
        }
        &self.ends[self.start[k] as usize..self.start[k + 1] as usize]
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * self.start.len()
            + size_of::<(u32, Occlusion, f32)>() * self.ends.len()
            + 4 * self.blockers.len()
    }
}
