//! The tree over the triangles: eight children a node, up to eight triangles a leaf.
//!
//! The binary tree is built by `obvhs` (PLOC and reinsertion) and known to this file only; it is then collapsed to eight
//! children. Boxes are padded by [`PAD`] of the scene's half size: the slab test rounds, and with exact boxes a few in
//! a thousand of the lines aimed at edges slip between two of them.

use super::triangle::{BLOCK, Block};
use super::vectors::Octet;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;

/// Padding of every box, of the scene's half size. Measured: of 4 million segments aimed at edges and corners of a closed box, none leaks.
pub(crate) const PAD: f32 = 1e-5;

/// Set in [`BvhNode::children`] for a leaf; the rest is the index of a block.
pub(crate) const LEAF: u32 = 1 << 31;

/// Eight boxes, coordinate by coordinate, and what is in them.
#[derive(Clone, Debug)]
pub(crate) struct BvhNode {
    /// `bounds[0]` the low and `bounds[1]` the high sides, by axis.
    pub(crate) bounds: [[Octet; 3]; 2],
    /// A node, or a block with [`LEAF`] set.
    pub(crate) children: [u32; WIDTH],
    /// How many children there are.
    pub(crate) count: u32,
}

/// The nodes, root first, and the blocks of triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh {
    /// Empty when there is no triangle.
    pub(crate) nodes: Vec<BvhNode>,
    /// The leaves.
    pub(crate) blocks: Vec<Block>,
    /// Low and high corner of everything, unpadded.
    pub(crate) bounds: [Vec3; 2],
}

/// What a leaf needs to know of a triangle.
#[derive(Clone, Copy)]
pub(crate) struct Input<'a> {
    pub(crate) positions: &'a [Vec3],
    pub(crate) triangles: &'a [[u32; 3]],
    pub(crate) planes: &'a [u32],
    pub(crate) masked: &'a [bool],
}

impl Input<'_> {
    /// The corners of a triangle; none if an index is out of range or a coordinate not finite.
    fn corners(&self, id: u32) -> Option<[Vec3; 3]> {
        let [a, b, c] = self
            .triangles
            .get(id as usize)?
            .map(|k| self.positions.get(k as usize).copied());
        let corners = [a?, b?, c?];
        corners.iter().all(|p| p.is_finite()).then_some(corners)
    }

    fn block(&self, ids: impl Iterator<Item = u32>) -> Block {
        Block::new(ids.filter_map(|id| {
            let plane = self.planes.get(id as usize).copied();
            let masked = self.masked.get(id as usize).copied();
            Some((
                id,
                self.corners(id)?,
                plane.unwrap_or(super::NO_PLANE),
                masked.unwrap_or(false),
            ))
        }))
    }
}

impl Bvh {
    /// Builds the tree over all triangles with an extent; the others can block nothing.
    pub(crate) fn build(input: Input<'_>) -> Self {
        let mut ids = Vec::new();
        let mut boxes = Vec::new();
        let mut all = Aabb::INVALID;
        for id in 0..input.triangles.len() as u32 {
            if let Some(corners) = input.corners(id) {
                let one = Aabb::from_points(&corners.map(Vec3A::from));
                all = all.union(&one);
                ids.push(id);
                boxes.push(one);
            }
        }
        if ids.is_empty() {
            return Self::default();
        }
        let parameters = BvhBuildParams {
            pre_split: false,
            max_prims_per_leaf: 1,
            reinsertion_batch_ratio: 0.1,
            post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
            ..BvhBuildParams::medium_build()
        };
        let binary = build_bvh2(&boxes, parameters, &mut std::time::Duration::default());
        let pad = Vec3A::splat(PAD * 0.5 * all.diagonal().max_element());
        let mut tree = Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            bounds: [all.min.into(), all.max.into()],
        };
        Collapse {
            binary: &binary,
            counts: counts(&binary),
            input,
            ids: &ids,
            pad,
        }
        .run(&mut tree);
        tree
    }
}

/// Number of triangles below each binary node.
fn counts(binary: &Bvh2) -> Vec<u32> {
    let mut counts = vec![0; binary.nodes.len()];
    let mut order = vec![0usize];
    let mut next = 0;
    while let Some(&node) = order.get(next) {
        next += 1;
        let node = &binary.nodes[node];
        if !node.is_leaf() {
            order.extend([node.first_index as usize, node.first_index as usize + 1]);
        }
    }
    for &k in order.iter().rev() {
        let node = &binary.nodes[k];
        let first = node.first_index as usize;
        counts[k] = if node.is_leaf() {
            node.prim_count
        } else {
            counts[first] + counts[first + 1]
        };
    }
    counts
}

struct Collapse<'a> {
    binary: &'a Bvh2,
    counts: Vec<u32>,
    input: Input<'a>,
    ids: &'a [u32],
    pad: Vec3A,
}

impl Collapse<'_> {
    /// Turns the binary tree into nodes of eight, with a stack of its own.
    fn run(&self, tree: &mut Bvh) {
        tree.nodes.push(empty_node());
        let mut todo = vec![(0usize, 0usize)];
        while let Some((binary, place)) = todo.pop() {
            let children = self.children(binary);
            let mut lanes = [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]];
            for (lane, &child) in children.iter().enumerate() {
                let aabb = self.binary.nodes[child].aabb();
                let sides = [aabb.min - self.pad, aabb.max + self.pad];
                for (lanes, side) in lanes.iter_mut().zip(sides) {
                    for (lanes, x) in lanes.iter_mut().zip(side.to_array()) {
                        lanes[lane] = x;
                    }
                }
                tree.nodes[place].children[lane] = if self.counts[child] as usize <= BLOCK {
                    tree.blocks
                        .push(self.input.block(self.below(child).into_iter()));
                    (tree.blocks.len() - 1) as u32 | LEAF
                } else {
                    tree.nodes.push(empty_node());
                    todo.push((child, tree.nodes.len() - 1));
                    (tree.nodes.len() - 1) as u32
                };
            }
            tree.nodes[place].bounds = lanes.map(|side| side.map(Octet));
            tree.nodes[place].count = children.len() as u32;
        }
    }

    /// Up to eight binary nodes that together make up `node`: always the largest one is opened.
    fn children(&self, node: usize) -> Vec<usize> {
        let mut children = vec![node];
        while children.len() < WIDTH {
            let area = |k: usize| self.binary.nodes[k].aabb().half_area();
            let largest = (0..children.len())
                .filter(|&k| self.counts[children[k]] as usize > BLOCK)
                .max_by(|&a, &b| area(children[a]).total_cmp(&area(children[b])));
            let Some(open) = largest else { break };
            let first = self.binary.nodes[children[open]].first_index as usize;
            children[open] = first;
            children.push(first + 1);
        }
        children
    }

    /// The triangles below a binary node.
    fn below(&self, node: usize) -> Vec<u32> {
        let mut found = Vec::new();
        let mut todo = vec![node];
        while let Some(k) = todo.pop() {
            let node = &self.binary.nodes[k];
            let first = node.first_index as usize;
            if node.is_leaf() {
                found.extend(
                    self.binary.primitive_indices[first..first + node.prim_count as usize]
                        .iter()
                        .map(|&k| self.ids[k as usize]),
                );
            } else {
                todo.extend([first + 1, first]);
            }
        }
        found
    }
}

fn empty_node() -> BvhNode {
    BvhNode {
        bounds: [[Octet([0.0; WIDTH]); 3]; 2],
        children: [0; WIDTH],
        count: 0,
    }
}
