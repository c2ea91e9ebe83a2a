//! The tree of patches: clusters of faces above, faces in the middle, elements (quarters of quarters) below.
//!
//! Nodes lie in an arena in which children come after their parent and side by side, so that *pull* (leaves to root) is
//! one backward and *push* one forward sweep. Elements split one to four at their edge midpoints
//! (Hanrahan, Salzman and Aupperle 1991); clusters split as built.

use super::mesh::{Face, Mesh};
use crate::geometry::sampling::triangle_weights;
use crate::geometry::{Hit, quarters};
use glam::DVec3;

/// No node.
pub const NONE: u32 = u32::MAX;

/// A patch: a cluster of faces, a face, or a part of one.
#[derive(Debug, Clone)]
pub struct Node {
    /// Node above; [`NONE`] for the root.
    pub parent: u32,
    /// First of the children, which are contiguous; [`NONE`] for a leaf.
    pub child: u32,
    /// How many children: 0, 2 (cluster) or 4 (element).
    pub children: u8,
    /// Is every face below in one plane and facing one way?
    pub flat: bool,
    /// Index of the node's element; [`NONE`] for a cluster.
    pub element: u32,
    /// First of the node's faces in [`Tree::faces`], and how many (1 for elements).
    pub faces: (u32, u32),
    /// Least corner of the bounding box.
    pub low: DVec3,
    /// Greatest corner of the bounding box.
    pub high: DVec3,
    /// Middle of the bounding box.
    pub centre: DVec3,
    /// Radius of a sphere about `centre` that holds the node.
    pub radius: f64,
    /// Surface area.
    pub area: f64,
    /// The part of the area that counts, see `counted`: errors are averaged over this.
    pub counted: f64,
    /// Area-weighted mean normal, unit length.
    pub normal: DVec3,
    /// Cosine of the half angle of a cone about `normal` that holds every normal below; -1: all directions.
    pub cone: f64,
}

impl Node {
    /// A leaf of some area, without position or element.
    pub fn bare(parent: u32, area: f64) -> Self {
        Self {
            parent,
            child: NONE,
            children: 0,
            flat: false,
            element: NONE,
            faces: (0, 0),
            low: DVec3::ZERO,
            high: DVec3::ZERO,
            centre: DVec3::ZERO,
            radius: 0.0,
            area,
            counted: area,
            normal: DVec3::ZERO,
            cone: -1.0,
        }
    }

    /// Has the node no children?
    pub fn is_leaf(&self) -> bool {
        self.children == 0
    }

    /// The node with its box and sphere set around some points.
    pub(super) fn around(self, points: &[DVec3]) -> Self {
        let (low, high) = points
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
                (l.min(*p), h.max(*p))
            });
        let centre = 0.5 * (low + high);
        let radius = points
            .iter()
            .map(|p| p.distance(centre))
            .fold(0.0, f64::max);
        Self {
            low,
            high,
            centre,
            radius,
            ..self
        }
    }

    /// Could a normal below come within a right angle of a direction that lies within `reach` of the end of `way`?
    pub fn may_face(&self, way: DVec3, reach: f64) -> bool {
        let distance = way.length();
        if distance <= reach || self.cone <= 0.0 {
            return true;
        }
        // Half angles of the bundle of directions and of the cone, as sine and cosine.
        let [bundle, cone] = [
            reach / distance,
            (1.0 - self.cone * self.cone).max(0.0).sqrt(),
        ];
        let along = [(1.0 - bundle * bundle).sqrt(), self.cone];
        // Together a right angle or more, or at least what is missing to one.
        along[0] * along[1] <= bundle * cone
            || self.normal.dot(way) > -distance * (bundle * along[1] + along[0] * cone)
    }

    /// Indices of the children.
    pub fn child_range(&self) -> std::ops::Range<u32> {
        if self.is_leaf() {
            0..0
        } else {
            self.child..self.child + u32::from(self.children)
        }
    }
}

/// The triangle of an element.
#[derive(Debug, Clone, Copy)]
pub struct Element {
    /// Corners, counter-clockwise from the side it faces.
    pub corners: [DVec3; 3],
    /// Position in [`Tree::faces`] of the element's face.
    pub face: u32,
    /// Number of splits between the face and this element.
    pub depth: u8,
}

impl Element {
    /// A point by barycentric weights.
    pub fn at(&self, w: [f64; 3]) -> DVec3 {
        self.corners[0] * w[0] + self.corners[1] * w[1] + self.corners[2] * w[2]
    }
}

/// A point of a node that represents a share of its area.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// The point.
    pub point: DVec3,
    /// Unit normal there.
    pub normal: DVec3,
    /// Plane id of the face.
    pub plane: u32,
    /// Area that the sample represents.
    pub area: f64,
}

/// The hierarchy of one room.
#[derive(Debug, Default)]
pub struct Tree {
    /// All nodes; the root is node 0; children after parents.
    pub nodes: Vec<Node>,
    /// Triangles of the element nodes.
    pub elements: Vec<Element>,
    /// Faces in tree order: every cluster holds a contiguous range.
    pub faces: Vec<Face>,
    /// Node of each entry of `faces`.
    pub face_node: Vec<u32>,
    /// Plane id of each entry of `faces`.
    pub face_plane: Vec<u32>,
    /// Unit normal of each entry of `faces`.
    pub face_normal: Vec<DVec3>,
    /// Running sum of areas over `faces`, starting with 0: one longer than `faces`.
    pub face_area: Vec<f64>,
    /// For each triangle of the mesh, the entries of `faces` that are its front and its back.
    pub entry: Vec<[u32; 2]>,
    /// For each element of a diffuse sheet the one on the other side of the same triangle; [`NONE`] for other nodes. Empty in
    /// a room without sheets.
    pub behind: Vec<u32>,
    /// Running sum of counted areas over `faces`, like `face_area`; empty where all area counts.
    pub face_counted: Vec<f64>,
    /// Number of nodes when counted areas were found: parts of these nodes count in the same proportion.
    pub known: u32,
}

/// Size of a hierarchy: nodes are only ever appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TreeSize {
    nodes: usize,
    elements: usize,
    behind: usize,
}

impl Tree {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>()
            + self.elements.len() * size_of::<Element>()
            + self.faces.len() * 64
    }

    /// A node by index.
    pub fn node(&self, id: u32) -> &Node {
        &self.nodes[id as usize]
    }

    /// Nodes without children, ascending.
    pub fn leaves(&self) -> impl Iterator<Item = u32> {
        (0..self.nodes.len() as u32).filter(|&k| self.node(k).is_leaf())
    }

    /// Entry of the face at which the running sum of areas, over all faces, passes `area`; clamped against rounding at
    /// the end.
    pub fn entry_at(&self, area: f64) -> usize {
        (self.face_area.partition_point(|&a| a <= area).max(1) - 1).min(self.faces.len() - 1)
    }

    /// The element of a node; none for a cluster.
    pub fn element(&self, node: &Node) -> Option<&Element> {
        self.elements.get(node.element as usize)
    }

    /// The element on the other side of a diffuse sheet, with the same corners, facing the other way; [`NONE`] where light does not
    /// pass. Both are leaves, or neither is.
    pub fn behind(&self, id: u32) -> u32 {
        self.behind.get(id as usize).copied().unwrap_or(NONE)
    }

    /// Pairs the two faces of triangles that light passes through.
    pub(super) fn pair_sheets(&mut self, mesh: &Mesh) {
        if mesh.sheets.is_empty() {
            return;
        }
        self.behind = vec![NONE; self.nodes.len()];
        for (entries, material) in self.entry.iter().zip(&mesh.material) {
            if mesh.sheets.contains(material) && !entries.contains(&NONE) {
                let [front, back] = entries.map(|entry| self.face_node[entry as usize]);
                self.behind[front as usize] = back;
                self.behind[back as usize] = front;
            }
        }
    }

    /// Splits a leaf element into four, together with the one on the other side of a diffuse sheet; does nothing for a node with children. Every
    /// child is similar to its parent.
    pub fn subdivide(&mut self, id: u32) {
        let behind = self.behind(id);
        let first = self.quarter(id);
        if behind == NONE || first == NONE {
            return;
        }
        let other = self.quarter(behind);
        self.behind.resize(self.nodes.len(), NONE);
        // Seen from the other side, corners run the other way round: the children at the second and third corner are
        // exchanged.
        for (k, part) in [0, 2, 1, 3].into_iter().enumerate() {
            let [one, two] = [first + k as u32, other + part];
            self.behind[one as usize] = two;
            self.behind[two as usize] = one;
        }
    }

    /// The size of the hierarchy, for [`Tree::shrink`].
    pub fn grown(&self) -> TreeSize {
        TreeSize {
            nodes: self.nodes.len(),
            elements: self.elements.len(),
            behind: self.behind.len(),
        }
    }

    /// Takes back every split since `to`.
    pub fn shrink(&mut self, to: &TreeSize) {
        self.nodes.truncate(to.nodes);
        self.elements.truncate(to.elements);
        self.behind.truncate(to.behind);
        for node in &mut self.nodes {
            if node.child != NONE && node.child as usize >= to.nodes {
                (node.child, node.children) = (NONE, 0);
            }
        }
    }

    /// Splits a leaf element; returns the first of its four children, or [`NONE`] if it cannot be split.
    fn quarter(&mut self, id: u32) -> u32 {
        let node = self.node(id).clone();
        if !node.is_leaf() || node.element == NONE {
            return NONE;
        }
        let Element {
            corners,
            face,
            depth,
        } = self.elements[node.element as usize];
        let first = self.nodes.len() as u32;
        for corners in quarters(corners) {
            let element = self.elements.len() as u32;
            self.elements.push(Element {
                corners,
                face,
                depth: depth + 1,
            });
            let part = Node {
                parent: id,
                child: NONE,
                children: 0,
                element,
                area: 0.25 * node.area,
                counted: 0.25 * node.counted,
                ..node.clone()
            };
            self.nodes.push(part.around(&corners));
        }
        let node = &mut self.nodes[id as usize];
        node.child = first;
        node.children = 4;
        first
    }

    /// Gives every node without a number ([`NONE`]) the number of its nearest ancestor that has one.
    pub fn inherit(&self, number: &mut [u32]) {
        for id in 1..number.len() {
            if number[id] == NONE {
                number[id] = number[self.nodes[id].parent as usize];
            }
        }
    }

    /// The face that an element is part of.
    pub fn face_of(&self, leaf: u32) -> Face {
        let element = &self.elements[self.node(leaf).element as usize];
        self.faces[element.face as usize]
    }

    /// Entry of the face that a ray met; [`NONE`] for a black back.
    pub fn met(&self, hit: &Hit) -> u32 {
        self.entry[hit.triangle as usize][usize::from(hit.from_behind)]
    }

    /// The leaf element that holds a point of a face, given by barycentric weights on the whole face.
    pub fn leaf_at(&self, entry: u32, weights: [f64; 3]) -> u32 {
        place_below(self.face_node[entry as usize], weights, |k| {
            self.node(k).child
        })
        .0
    }

    /// `count` points of a node, each representing an equal share of its area, stratified over the faces of a cluster.
    /// `u` shifts the pattern: a pair of numbers in [0, 1).
    pub fn samples(&self, id: u32, count: usize, u: [f64; 2], out: &mut Vec<Sample>) {
        let node = self.node(id);
        out.clear();
        let share = node.area / count as f64;
        if let Some(element) = self.element(node) {
            let (normal, plane) = (
                self.face_normal[element.face as usize],
                self.face_plane[element.face as usize],
            );
            for k in 0..count {
                let point = element.at(stratified(k, count, u));
                out.push(Sample {
                    point,
                    normal,
                    plane,
                    area: share,
                });
            }
            return;
        }
        let (first, n) = (node.faces.0 as usize, node.faces.1 as usize);
        let areas = &self.face_area[first..=first + n];
        for k in 0..count {
            let target = areas[0] + (k as f64 + u[0]) * share;
            // The entry whose area interval holds the target; clamped against rounding at the end.
            let entry = first + (areas.partition_point(|&a| a <= target).max(1) - 1).min(n - 1);
            let element = &self.elements[self.node(self.face_node[entry]).element as usize];
            let point = element.at(stratified(k, count, u));
            out.push(Sample {
                point,
                normal: self.face_normal[entry],
                plane: self.face_plane[entry],
                area: share,
            });
        }
    }
}

/// The leaf that contains a point of a face, and the weights of the point on it; `first` gives the first child of a node, [`NONE`] for a leaf.
pub(crate) fn place_below(
    face: u32,
    mut weights: [f64; 3],
    first: impl Fn(u32) -> u32,
) -> (u32, [f64; 3]) {
    let mut id = face;
    loop {
        match first(id) {
            NONE => return (id, weights),
            child => id = child + quarter(&mut weights),
        }
    }
}

/// The child of an element that contains a point, given by barycentric weights, which become weights on the child.
pub(crate) fn quarter(w: &mut [f64; 3]) -> u32 {
    // Children 0, 1, 2 have the corners, child 3 is the middle (rotated).
    match w.iter().position(|&x| x >= 0.5) {
        Some(k) => {
            *w = std::array::from_fn(|i| if i == k { 2.0 * w[i] - 1.0 } else { 2.0 * w[i] });
            k as u32
        }
        None => {
            // Middle child [bc, ca, ab]: a weight w_a there lies 1 - 2 w_a from the opposite midpoint.
            *w = w.map(|x| 1.0 - 2.0 * x);
            3
        }
    }
}

/// Barycentric weights of point `k` of `count`: an R2 sequence (Roberts 2018) shifted by `u`, folded into the triangle.
pub(crate) fn stratified(k: usize, count: usize, u: [f64; 2]) -> [f64; 3] {
    if count == 1 {
        return [1.0 / 3.0; 3];
    }
    if count == 3 {
        // Strang and Fix (1973): exact for quadratic functions.
        return std::array::from_fn(|c| if c == k { 2.0 / 3.0 } else { 1.0 / 6.0 });
    }
    // 1/p and 1/p^2 for the plastic number p = 1.3247...
    let x = (u[0] + 0.754_877_666_246_692_8 * (k as f64 + 1.0)).fract();
    let y = (u[1] + 0.569_840_290_998_053_3 * (k as f64 + 1.0)).fract();
    triangle_weights([x, y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, sphere_direction};
    use std::f64::consts::FRAC_PI_2;

    /// Against the angles themselves.
    #[test]
    fn cones_that_may_face() {
        let mut random = Pcg::new(4);
        let mut facing = 0;
        for round in 0..20_000 {
            let mut direction = || sphere_direction([random.f64(), random.f64()]);
            let (normal, way) = (direction(), direction());
            let way = way * (0.1 + random.f64());
            let node = Node {
                normal,
                cone: 1.2 * random.f64() - 0.2,
                ..Node::bare(NONE, 1.0)
            };
            let reach = if round % 9 == 0 { 0.0 } else { random.f64() };
            let may = node.may_face(way, reach);
            if node.cone <= 0.0 || reach >= way.length() {
                assert!(may);
                continue;
            }
            let spare = (reach / way.length()).asin() + node.cone.acos();
            let missing = normal.angle_between(way) - spare - FRAC_PI_2;
            if missing.abs() > 1e-9 {
                assert_eq!(may, missing < 0.0, "{node:?} {way} {reach}");
            }
            facing += usize::from(may);
        }
        assert!((2_000..14_000).contains(&facing), "{facing}");
    }
}
