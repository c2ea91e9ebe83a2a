//! The hierarchy as rays need it: from the face that a ray met down to a leaf, and up again to patches that were gathered as
//! a whole.
//!
//! Every ray goes this way, and nodes lie far apart in memory: what rays need of them is kept here, 12 bytes a node.

use super::tilts::{Place, place};
use crate::hierarchy::{NONE, Tree, place_below};
use crate::link::POLYGONS;

/// Hits nearer to a leaf than this many times the square root of its area are close by.
const NEAR: f64 = 1.5;

/// Hits nearer than this to a leaf of an area are close by.
pub(crate) fn close_by(area: f64) -> f32 {
    (NEAR * area.sqrt()) as f32
}

/// What rays need of the nodes that a solution knows.
#[derive(Debug, Clone, Default)]
pub struct Descent {
    steps: Vec<Step>,
}

#[derive(Debug, Clone, Copy)]
struct Step {
    /// First of the children; [`NONE`] for a leaf.
    child: u32,
    /// Parent, if it may be gathered as a whole, as polygons; else [`NONE`].
    above: u32,
    /// Hits nearer than this are close by.
    near: f32,
}

impl Descent {
    /// For a whole hierarchy.
    pub(crate) fn new(tree: &Tree) -> Self {
        let whole = |&id: &u32| id != NONE && tree.node(id).faces.1 <= POLYGONS;
        let steps = tree.nodes.iter().map(|node| Step {
            child: node.child,
            above: Some(node.parent).filter(whole).unwrap_or(NONE),
            near: close_by(node.area),
        });
        Self {
            steps: steps.collect(),
        }
    }

    /// The leaf that contains a point of a face, as found by [`Tree::leaf_at`] when the solution was made, and where on the leaf the point
    /// lies.
    pub(crate) fn place_at(&self, tree: &Tree, entry: u32, weights: [f64; 3]) -> (u32, Place) {
        let face = tree.face_node[entry as usize];
        let (leaf, weights) = place_below(face, weights, |k| self.steps[k as usize].child);
        (leaf, place(weights))
    }

    /// A patch and its ancestors that may be gathered as a whole.
    pub(crate) fn upwards(&self, leaf: u32) -> impl Iterator<Item = u32> {
        let above = |&id: &u32| Some(self.steps[id as usize].above).filter(|&id| id != NONE);
        std::iter::successors(Some(leaf), above)
    }

    /// Hits nearer than this to a leaf are close by; 0: none is.
    pub(crate) fn near(&self, leaf: u32) -> f32 {
        self.steps[leaf as usize].near
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.steps.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, triangle_weights};
    use crate::hierarchy::Mesh;
    use crate::scene::{Options, Scene};

    /// Also where elements are split after the solution.
    #[test]
    fn it_ends_on_the_leaves_that_the_solution_knows() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.glb");
        let scene = Scene::load(&path, &Options::default()).unwrap();
        let mesh = Mesh::new(&scene);
        let mut tree = Tree::new(&mesh, &vec![0; mesh.faces.len()]);
        let mut random = Pcg::new(2);
        let mut split = |tree: &mut Tree, times: usize| {
            for _ in 0..times {
                let leaves: Vec<u32> = tree.leaves().collect();
                tree.subdivide(leaves[(random.f64() * leaves.len() as f64) as usize]);
            }
        };
        split(&mut tree, 300);
        let descent = Descent::new(&tree);
        let mut points = Pcg::new(3);
        let places: Vec<(u32, [f64; 3])> = (0..2_000)
            .map(|_| {
                let entry = points.f64() * tree.faces.len() as f64;
                (entry as u32, triangle_weights([points.f64(), points.f64()]))
            })
            .collect();
        let known: Vec<u32> = places.iter().map(|&(e, w)| tree.leaf_at(e, w)).collect();
        split(&mut tree, 100);
        for (&(entry, w), &leaf) in places.iter().zip(&known) {
            assert_eq!(descent.place_at(&tree, entry, w).0, leaf);
            // All ancestors of few faces, and no other nodes.
            let parent = |&id: &u32| Some(tree.node(id).parent).filter(|&p| p != NONE);
            let plain = std::iter::successors(Some(leaf), parent)
                .filter(|&id| tree.node(id).faces.1 <= POLYGONS);
            assert!(descent.upwards(leaf).eq(plain));
        }
    }
}
