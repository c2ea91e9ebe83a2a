//! The patches of the hierarchy as meshes that only grow: what is seen of a round before anything is looked up at vertices.
//!
//! A vertex is a corner of a patch; elements split at the midpoints of their edges, so a new corner is a midpoint of two
//! that are there. It shows the mean, by area, of the leaves around it: those of its plane, or where the file has shading
//! normals those with its normal.

use super::picture::{PartGrowth, PictureMesh};
use super::spectra::VertexSpectra;
use crate::error::Result;
use crate::gather::{BakedSurface, BakedVertex, Vertex};
use crate::hierarchy::{Face, NONE};
use crate::output::gltf;
use crate::output::{Exposure, Writing, baked_glb};
use crate::solve::{Bake, weights_of};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Steps of a unit normal's components within which two are the same.
const NORMAL: f32 = 1024.0;

/// A side of a surface.
#[derive(Debug)]
struct Part {
    surface: usize,
    back: bool,
    vertices: Vec<Vertex>,
    /// Whose light a vertex shares.
    group: Vec<u32>,
    grown: PartGrowth,
}

/// The patches as meshes.
#[derive(Debug)]
pub(super) struct Patches {
    mesh: u32,
    glb: Arc<[u8]>,
    parts: Vec<Part>,
    /// Part of each entry of the tree's faces.
    part_of: Vec<u32>,
    /// Vertices of its part that are the corners of each element node; of others nothing.
    corners: Vec<[u32; 3]>,
    groups: u32,
    midpoints: HashMap<(u32, [u32; 2]), u32>,
    group_midpoints: HashMap<[u32; 2], u32>,
    had: Vec<Vec<u32>>,
}

/// Corners that are one vertex, and those that share their light.
#[derive(Default)]
struct SharedCorners {
    vertices: HashMap<(u32, bool, u32, u32), u32>,
    groups: HashMap<(u32, u32, [i32; 3]), u32>,
}

impl Patches {
    /// The patches of a room, split as far as they are; `mesh` is their number.
    pub(super) fn new(bake: &Bake, mesh: u32) -> Result<Self> {
        let tree = bake.tree();
        let side = |face: &Face| {
            let surface = bake.mesh().origin[face.triangle as usize].0;
            (surface as usize, face.back)
        };
        let mut sides: Vec<(usize, bool)> = tree.faces.iter().map(side).collect();
        sides.sort_unstable();
        sides.dedup();
        let bare = |&(surface, back): &(usize, bool)| BakedSurface {
            surface,
            back,
            vertices: Vec::new(),
            triangles: vec![[0; 3]],
            layers: Vec::new(),
            map: None,
        };
        let bare: Vec<BakedSurface> = sides.iter().map(bare).collect();
        let order = gltf::order(bake.scene(), &bare);
        let place: HashMap<(usize, bool), u32> =
            (0..).zip(&order).map(|(at, &k)| (sides[k], at)).collect();
        let parts = order.iter().map(|&k| Part {
            surface: sides[k].0,
            back: sides[k].1,
            vertices: Vec::new(),
            group: Vec::new(),
            grown: PartGrowth::default(),
        });
        let mut out = Self {
            mesh,
            glb: Arc::new([]),
            parts: parts.collect(),
            part_of: tree.faces.iter().map(|face| place[&side(face)]).collect(),
            corners: vec![[NONE; 3]; tree.nodes.len()],
            groups: 0,
            midpoints: HashMap::new(),
            group_midpoints: HashMap::new(),
            had: Vec::new(),
        };
        let mut known = SharedCorners::default();
        for (entry, &node) in tree.face_node.iter().enumerate() {
            out.corners[node as usize] = out.face(bake, entry, &mut known);
        }
        for part in &mut out.parts {
            part.grown.base = part.vertices.len();
        }
        out.had = vec![vec![0; out.parts.len()]];
        // Splits that were there already come as midpoints, too.
        let dark = out.dark(bake);
        let writing = Writing::default();
        out.glb = baked_glb(bake.scene(), &dark, &Exposure::new(1.0), writing)?
            .bytes
            .into();
        out.grow(bake);
        Ok(out)
    }

    /// The corners of a face as vertices.
    fn face(&mut self, bake: &Bake, entry: usize, known: &mut SharedCorners) -> [u32; 3] {
        let (mesh, part) = (bake.mesh(), self.part_of[entry]);
        let face = bake.tree().faces[entry];
        let t = face.triangle as usize;
        let (s, local) = mesh.origin[t];
        let surface = &bake.scene().surfaces[s as usize];
        let order = if face.back { [0, 2, 1] } else { [0, 1, 2] };
        order.map(|k| {
            let mut weights = [0.0; 3];
            weights[k] = 1.0;
            let welded = mesh.triangles[t][k];
            let input = surface.triangles[local as usize];
            let corner = mesh.input_corner(t, k).map(|k| input[k]);
            // Without shading normals every plane is seen by itself.
            let (plane, sense) = match &surface.normals {
                None => (mesh.plane[t], [0; 3]),
                Some(normals) => {
                    let on = mesh.on_origin(t, weights);
                    let sum: glam::Vec3 = (0..3)
                        .map(|i| normals[input[i] as usize] * on[i] as f32)
                        .sum();
                    let n = sum.normalize_or_zero() * NORMAL;
                    (NONE, n.to_array().map(|x| x.round() as i32))
                }
            };
            let own = &mut self.parts[part as usize];
            let id = corner.unwrap_or(welded);
            let key = (part, corner.is_some(), id, plane);
            *known.vertices.entry(key).or_insert_with(|| {
                own.vertices.push(Vertex {
                    triangle: face.triangle,
                    weights,
                    entry: entry as u32,
                });
                let group = known.groups.entry((part, welded, sense_of(plane, sense)));
                own.group.push(*group.or_insert_with(|| {
                    self.groups += 1;
                    self.groups - 1
                }));
                own.vertices.len() as u32 - 1
            })
        })
    }

    /// Takes in what was split since.
    pub(super) fn grow(&mut self, bake: &Bake) {
        let tree = bake.tree();
        let before = self.corners.len();
        self.corners.resize(tree.nodes.len(), [NONE; 3]);
        // Children come after their parents.
        for (id, node) in tree.nodes.iter().enumerate() {
            let Some(element) = tree.element(node).filter(|_| !node.is_leaf()) else {
                continue;
            };
            if self.corners[node.child as usize] != [NONE; 3] {
                continue;
            }
            let part = self.part_of[element.face as usize];
            let [a, b, c] = self.corners[id];
            let mut middle = |k: usize, l: usize| {
                let point = 0.5 * (element.corners[k] + element.corners[l]);
                let ends = [self.corners[id][k], self.corners[id][l]];
                self.midpoint(bake, part, element.face, ends, point)
            };
            let (ab, bc, ca) = (middle(0, 1), middle(1, 2), middle(2, 0));
            // In the order in which the hierarchy has the quarters of a triangle.
            let quarters = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]];
            for (child, corners) in node.child_range().zip(quarters) {
                self.corners[child as usize] = corners;
            }
        }
        if self.corners.len() == before && self.had.len() > 1 {
            return;
        }
        let leaves = tree
            .leaves()
            .filter_map(|id| tree.element(tree.node(id)).map(|e| (id, e)));
        self.parts
            .iter_mut()
            .for_each(|p| p.grown.triangles.clear());
        for (id, element) in leaves {
            let part = self.part_of[element.face as usize] as usize;
            let triangles = &mut self.parts[part].grown.triangles;
            joined(
                &self.midpoints,
                part as u32,
                self.corners[id as usize],
                triangles,
            );
        }
        let now = self.parts.iter().map(|p| p.grown.midpoints.len() as u32);
        self.had.push(now.collect());
    }

    fn midpoint(
        &mut self,
        bake: &Bake,
        part: u32,
        entry: u32,
        mut ends: [u32; 2],
        point: glam::DVec3,
    ) -> u32 {
        ends.sort_unstable();
        let own = &mut self.parts[part as usize];
        *self.midpoints.entry((part, ends)).or_insert_with(|| {
            let face = bake.tree().faces[entry as usize];
            let [a, b, c] = bake.mesh().corners(face);
            let w = weights_of(point, a, b, c).map(|w| w.clamp(0.0, 1.0));
            own.vertices.push(Vertex {
                triangle: face.triangle,
                weights: if face.back { [w[0], w[2], w[1]] } else { w },
                entry,
            });
            let mut groups = ends.map(|v| own.group[v as usize]);
            groups.sort_unstable();
            own.group
                .push(*self.group_midpoints.entry(groups).or_insert_with(|| {
                    self.groups += 1;
                    self.groups - 1
                }));
            own.grown.midpoints.push(ends);
            own.vertices.len() as u32 - 1
        })
    }

    /// The faces of the room without light.
    fn dark(&self, bake: &Bake) -> Vec<BakedSurface> {
        let mesh = bake.mesh();
        let unlit = |v: &Vertex| BakedVertex {
            triangle: mesh.origin[v.triangle as usize].1,
            weights: mesh.on_origin(v.triangle as usize, v.weights),
            irradiance: [0.0; 3],
            radiosity: [0.0; 3],
            light: [0.0; 3],
        };
        let mut out: Vec<BakedSurface> = (self.parts.iter())
            .map(|part| BakedSurface {
                surface: part.surface,
                back: part.back,
                vertices: part.vertices.iter().map(unlit).collect(),
                triangles: Vec::new(),
                layers: Vec::new(),
                map: None,
            })
            .collect();
        let tree = bake.tree();
        for (entry, &node) in tree.face_node.iter().enumerate() {
            out[self.part_of[entry] as usize]
                .triangles
                .push(self.corners[node as usize]);
        }
        out
    }

    /// The patches under the light of a bake of this hierarchy, and its spectra.
    pub(super) fn lit(&self, bake: &Bake) -> (Vec<BakedSurface>, VertexSpectra) {
        let (tree, light) = (bake.tree(), bake.light());
        let mut sums = vec![([0.0_f32; 64], 0.0_f64); self.groups as usize];
        let known = light.irradiance.len();
        for (k, &leaf) in light.leaves.iter().enumerate().take(known) {
            let node = tree.node(leaf);
            let Some(element) = tree.element(node) else {
                continue;
            };
            let part = &self.parts[self.part_of[element.face as usize] as usize];
            let row = light.irradiance.row(k);
            for corner in self.corners[leaf as usize] {
                let (sum, area) = &mut sums[part.group[corner as usize] as usize];
                *area += node.area;
                for (s, x) in sum.iter_mut().zip(row) {
                    *s += x * node.area as f32;
                }
            }
        }
        sums.par_iter_mut().for_each(|(sum, area)| {
            let scale = if *area > 0.0 {
                (1.0 / *area) as f32
            } else {
                0.0
            };
            sum.iter_mut().for_each(|x| *x *= scale);
        });
        let looks = bake.looks(bake.upsampler());
        let of_part = |part: &Part| {
            let look = &looks[bake.scene().surfaces[part.surface].material];
            let vertices = part.vertices.par_iter().zip(&part.group);
            let vertices = vertices.map(|(vertex, &group)| {
                bake.vertex(vertex, part.back, &sums[group as usize].0, look)
            });
            BakedSurface {
                surface: part.surface,
                back: part.back,
                vertices: vertices.collect(),
                triangles: part.grown.triangles.clone(),
                layers: Vec::new(),
                map: None,
            }
        };
        let surfaces = self.parts.iter().map(of_part).collect();
        let rows = sums.into_iter().map(|(row, _)| row).collect();
        let of = self.parts.iter().map(|part| part.group.clone()).collect();
        (surfaces, VertexSpectra::shared(bake.lanes(), rows, of))
    }

    /// The mesh as it is now.
    pub(super) fn shape(&self) -> PictureMesh {
        PictureMesh {
            mesh: self.mesh,
            glb: Arc::clone(&self.glb),
            had: self.had.clone(),
            parts: self.parts.iter().map(|p| p.grown.clone()).collect(),
        }
    }
}

/// A leaf with the vertices that finer neighbours have on its edges, so that there are no cracks.
fn joined(
    midpoints: &HashMap<(u32, [u32; 2]), u32>,
    part: u32,
    corners: [u32; 3],
    out: &mut Vec<[u32; 3]>,
) {
    for k in 0..3 {
        let [a, b, c] = std::array::from_fn(|i| corners[(i + k) % 3]);
        if let Some(&m) = midpoints.get(&(part, [a.min(b), a.max(b)])) {
            joined(midpoints, part, [a, m, c], out);
            return joined(midpoints, part, [m, b, c], out);
        }
    }
    out.push(corners);
}

fn sense_of(plane: u32, normal: [i32; 3]) -> [i32; 3] {
    match plane {
        NONE => normal,
        // Longer than any normal.
        plane => [i32::MAX, plane as i32, 0],
    }
}
