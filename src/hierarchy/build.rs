//! Clusters of faces: a binary tree, split top down where surface area times normal spread falls most.
//!
//! The cost is the orientation-aware heuristic of Conty Estevez and Kulla (2018) on bins: a cluster is good if it is
//! small *and* faces one way, because a link treats it as one diffuse patch with one mean normal.

use super::mesh::Mesh;
use super::tree::{Element, NONE, Node, Tree};
use glam::DVec3;

/// Candidate planes per axis. More changes the trees of the test rooms by less than 1 % in links.
const BINS: usize = 8;

/// What the builder knows of a face.
struct BuildFace {
    face: u32,
    centre: DVec3,
    low: DVec3,
    high: DVec3,
    normal: DVec3,
    area: f64,
    plane: u32,
    space: u32,
}

/// A box, a sum of normals, an area: enough for the cost.
#[derive(Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
    normal: DVec3,
    area: f64,
    count: usize,
}

impl Bounds {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        normal: DVec3::ZERO,
        area: 0.0,
        count: 0,
    };

    fn add(&mut self, item: &BuildFace) {
        self.low = self.low.min(item.low);
        self.high = self.high.max(item.high);
        self.normal += item.normal * item.area;
        self.area += item.area;
        self.count += 1;
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            normal: self.normal + other.normal,
            area: self.area + other.area,
            count: self.count + other.count,
        }
    }

    /// Area times box surface times spread of normals.
    fn cost(&self) -> f64 {
        let d = (self.high - self.low).max(DVec3::ZERO);
        let surface = d.x * d.y + d.y * d.z + d.z * d.x;
        // 1 where all normals agree, 0 where they cancel: spread 0..1; a flat cluster still has a cost by its size.
        let agreement = if self.area > 0.0 {
            self.normal.length() / self.area
        } else {
            1.0
        };
        self.area * surface * (0.02 + (1.0 - agreement))
    }
}

impl Tree {
    /// Builds the clusters over all faces of `mesh`; only the topmost hold faces of more than one space. `spaces` has
    /// the space of each face.
    pub fn new(mesh: &Mesh, spaces: &[u32]) -> Self {
        let mut items: Vec<BuildFace> = mesh
            .faces
            .iter()
            .enumerate()
            .map(|(k, &face)| {
                let corners = mesh.corners(face);
                let low = corners[0].min(corners[1]).min(corners[2]);
                let high = corners[0].max(corners[1]).max(corners[2]);
                let t = face.triangle as usize;
                let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
                BuildFace {
                    face: k as u32,
                    centre,
                    low,
                    high,
                    normal: mesh.face_normal(face),
                    area: mesh.area[t],
                    plane: mesh.plane[t],
                    space: spaces[k],
                }
            })
            .collect();
        // Spaces first; within one, in the order of the file.
        items.sort_by_key(|item| item.space);
        let mut tree = Tree {
            nodes: Vec::with_capacity(2 * items.len()),
            elements: Vec::with_capacity(items.len()),
            faces: Vec::new(),
            face_node: vec![NONE; items.len()],
            face_plane: Vec::new(),
            face_normal: Vec::new(),
            face_area: vec![0.0],
            entry: vec![[NONE; 2]; mesh.triangles.len()],
            ..Tree::default()
        };
        if items.is_empty() {
            return tree;
        }
        tree.nodes.push(placeholder(NONE, 0, items.len()));
        // A stack instead of recursion: depth is bounded only by the number of faces.
        let mut open = vec![0_u32];
        while let Some(id) = open.pop() {
            let (first, count) = (
                tree.node(id).faces.0 as usize,
                tree.node(id).faces.1 as usize,
            );
            if count == 1 {
                continue;
            }
            let part = &mut items[first..first + count];
            let half = between_spaces(part).unwrap_or_else(|| split(part));
            let child = tree.nodes.len() as u32;
            tree.nodes.push(placeholder(id, first, half));
            tree.nodes.push(placeholder(id, first + half, count - half));
            let node = &mut tree.nodes[id as usize];
            node.child = child;
            node.children = 2;
            open.push(child + 1);
            open.push(child);
        }
        for (k, item) in items.iter().enumerate() {
            let face = mesh.faces[item.face as usize];
            tree.faces.push(face);
            tree.face_plane.push(item.plane);
            tree.face_normal.push(item.normal);
            tree.face_area.push(tree.face_area[k] + item.area);
            tree.entry[face.triangle as usize][usize::from(face.back)] = k as u32;
        }
        finish(mesh, &mut tree);
        tree.pair_sheets(mesh);
        tree
    }
}

fn placeholder(parent: u32, first: usize, count: usize) -> Node {
    Node {
        faces: (first as u32, count as u32),
        ..Node::bare(parent, 0.0)
    }
}

/// Where to split items of several spaces, ordered by space: between two spaces, near the middle.
fn between_spaces(items: &[BuildFace]) -> Option<usize> {
    let (first, last) = (items.first()?.space, items.last()?.space);
    if first == last {
        return None;
    }
    let middle = items[items.len() / 2].space;
    // Before the middle item's space, or after this where it is the first of all.
    let before = items.partition_point(|item| item.space < middle);
    let after = items.partition_point(|item| item.space <= middle);
    Some(if before > 0 { before } else { after })
}

/// Reorders `items` into two parts and returns the size of the first.
fn split(items: &mut [BuildFace]) -> usize {
    let mut best = (f64::INFINITY, 0, 0.0);
    for axis in 0..6 {
        let key = |item: &BuildFace| {
            if axis < 3 {
                item.centre[axis]
            } else {
                item.normal[axis - 3]
            }
        };
        let (low, high) = items
            .iter()
            .map(key)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            });
        if high - low <= 1e-9 * (low.abs() + high.abs()) {
            continue;
        }
        let scale = BINS as f64 / (high - low);
        let bin = |item: &BuildFace| (((key(item) - low) * scale) as usize).min(BINS - 1);
        let mut bins = [Bounds::EMPTY; BINS];
        for item in items.iter() {
            bins[bin(item)].add(item);
        }
        let mut right = [Bounds::EMPTY; BINS];
        for k in (0..BINS - 1).rev() {
            right[k] = right[k + 1].union(&bins[k + 1]);
        }
        let mut left = Bounds::EMPTY;
        for k in 0..BINS - 1 {
            left = left.union(&bins[k]);
            if left.count == 0 || right[k].count == 0 {
                continue;
            }
            let cost = left.cost() + right[k].cost();
            if cost < best.0 {
                best = (cost, axis, low + (k + 1) as f64 / scale);
            }
        }
    }
    let (cost, axis, at) = best;
    if cost.is_finite() {
        let mut first = 0;
        for k in 0..items.len() {
            let x = if axis < 3 {
                items[k].centre[axis]
            } else {
                items[k].normal[axis - 3]
            };
            if x < at {
                items.swap(first, k);
                first += 1;
            }
        }
        if first > 0 && first < items.len() {
            return first;
        }
    }
    // All centres and normals are equal: halve by order.
    items.len() / 2
}

/// Boxes, areas, normals and cones from the bottom up; element nodes for the faces.
fn finish(mesh: &Mesh, tree: &mut Tree) {
    for id in (0..tree.nodes.len()).rev() {
        let (first, count) = (
            tree.nodes[id].faces.0 as usize,
            tree.nodes[id].faces.1 as usize,
        );
        if count == 1 {
            let corners = mesh.corners(tree.faces[first]);
            let element = tree.elements.len() as u32;
            tree.elements.push(Element {
                corners,
                face: first as u32,
                depth: 0,
            });
            tree.face_node[first] = id as u32;
            let normal = tree.face_normal[first];
            let area = tree.face_area[first + 1] - tree.face_area[first];
            // The prefix sum loses digits for small faces; the mesh has the exact area.
            let area = if area > 0.0 {
                mesh.area[tree.faces[first].triangle as usize]
            } else {
                f64::MIN_POSITIVE
            };
            let node = Node {
                element,
                normal,
                cone: 1.0,
                area,
                counted: area,
                flat: true,
                ..tree.nodes[id].clone()
            };
            tree.nodes[id] = node.around(&corners);
            continue;
        }
        let (a, b) = (
            tree.node(tree.nodes[id].child).clone(),
            tree.node(tree.nodes[id].child + 1).clone(),
        );
        let area = a.area + b.area;
        let normal = (a.normal * a.area + b.normal * b.area).normalize_or(DVec3::Z);
        let half_angle = |n: &Node| normal.angle_between(n.normal) + n.cone.clamp(-1.0, 1.0).acos();
        let angle = half_angle(&a).max(half_angle(&b));
        let flat = a.flat && b.flat && a.normal.dot(b.normal) > 0.0 && {
            let plane = tree.face_plane[first];
            tree.face_plane[a.faces.0 as usize] == plane
                && tree.face_plane[b.faces.0 as usize] == plane
        };
        let cone = if flat {
            1.0
        } else if angle >= std::f64::consts::PI {
            -1.0
        } else {
            angle.cos()
        };
        let (low, high) = (a.low.min(b.low), a.high.max(b.high));
        let centre = 0.5 * (low + high);
        let radius = [&a, &b]
            .map(|c| c.centre.distance(centre) + c.radius)
            .into_iter()
            .fold(0.0, f64::max);
        let radius = radius.min(0.5 * low.distance(high));
        let node = &mut tree.nodes[id];
        *node = Node {
            low,
            high,
            centre,
            radius,
            normal,
            cone,
            area,
            counted: area,
            flat,
            ..node.clone()
        };
    }
}
