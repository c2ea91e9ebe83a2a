//! From the document to surfaces, images and cameras: every primitive at every node of the scene, in world space.
//!
//! Everything is counted before anything is placed, so that a small file with many instances cannot ask for more
//! memory than [`MAX_VERTICES`], [`MAX_CORNERS`] and [`MAX_SURFACES`] allow.

use crate::error::{Error, Problem, Result};
use crate::scene::accessor::Accessors;
use crate::scene::check::{Check, Tally};
use crate::scene::document::Document;
use crate::scene::json::{self, Item};
use crate::scene::nodes::PlacedNode;
use crate::scene::primitive::{self, MAX_TEXCOORDS, Outcome, Primitive};
use crate::scene::{Camera, Image, Surface, camera, image, instances, world};
use glam::DMat4;
use gltf::json::{Node, mesh};
use serde_json::Value;
use std::collections::BTreeMap;

/// Vertices of the whole room, instances counted: 64 bytes each, about 1 GB.
pub const MAX_VERTICES: usize = 1 << 24;
/// Corners of all triangles of the room, instances counted.
pub const MAX_CORNERS: usize = 3 << 24;
/// Primitives at nodes and instances.
pub const MAX_SURFACES: usize = 1 << 20;
const AGAIN: &str = "export the file again";

/// What a document holds besides paint and light. Of no use where `problems` is not empty.
#[derive(Debug)]
#[non_exhaustive]
pub struct Geometry {
    /// Every primitive with an area at every node (and instance) of the scene.
    pub surfaces: Vec<Surface>,
    /// The images that materials use; `Texture::image` is an index in here.
    pub images: Vec<Image>,
    /// The cameras of the scene.
    pub cameras: Vec<Camera>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Everything that is wrong with the file, also what was found when it was opened.
    pub problems: Vec<Problem>,
}

impl Geometry {
    /// The geometry, or all its problems as one error.
    ///
    /// # Errors
    /// [`Error::Input`] where there is any problem.
    pub fn check(self) -> Result<Self> {
        if self.problems.is_empty() {
            Ok(self)
        } else {
            Err(Error::Input(self.problems))
        }
    }
}

impl Document {
    /// Reads all geometry, images and cameras; goes on after a problem, so that all are found together.
    pub fn load_geometry(&self) -> Geometry {
        let mut check = self.check.clone();
        let json = &self.source.json;
        let mut reader = GeometryReader {
            document: self,
            json,
            accessors: Accessors::new(json, &self.buffers),
            primitives: BTreeMap::new(),
            tally: Tally::default(),
            unpacked: MAX_VERTICES,
            placed: MAX_VERTICES,
        };
        let mut surfaces = Vec::new();
        if reader.fits(&mut check) {
            for placed in &self.placed {
                if check.is_full() {
                    break;
                }
                reader.place(placed, &mut surfaces, &mut check);
            }
        }
        reader.tally.report(&mut check);
        let cameras = camera::cameras(json, &self.placed, &mut check);
        // Images cost the most; where the room cannot be used anyway they are not decoded.
        let images = if check.has_problems() {
            Vec::new()
        } else {
            self.images(&mut check)
        };
        let (problems, warnings) = check.into_parts();
        Geometry {
            surfaces,
            images,
            cameras,
            warnings,
            problems,
        }
    }

    fn images(&self, check: &mut Check) -> Vec<Image> {
        let count = self.slots.images.len();
        let mut images = Vec::with_capacity(count);
        let mut pixels = image::MAX_PIXELS;
        for slot in &self.slots.images {
            let Some(index) = *slot else {
                images.push(image::neutral(""));
                continue;
            };
            let item = json::item(&self.source.json, "images", "image", index);
            let (name, place) = item.map_or_else(Default::default, |i| (i.name(), i.place));
            let bytes = self.source.image_bytes(index).map_err(|e| e.to_string());
            let decoded = bytes.and_then(|bytes| {
                image::decode(name, &bytes, count, &mut pixels)
                    .map_err(|why| format!("{place}: {why}"))
            });
            images.push(decoded.unwrap_or_else(|why| {
                check.warn(format!("{why}; grey stands in for the image"));
                image::neutral(name)
            }));
        }
        images
    }
}

struct GeometryReader<'a> {
    document: &'a Document,
    json: &'a Value,
    accessors: Accessors<'a>,
    /// Read primitives with their materials, by mesh and index; none: without area, or broken and reported.
    primitives: BTreeMap<(usize, usize), Option<(usize, Primitive)>>,
    tally: Tally,
    /// Vertices and triangles that primitives may still have before they are placed. The claims bound plain ones; what
    /// Draco unpacks to is known only then.
    unpacked: usize,
    /// Vertices and triangles that may still be placed.
    placed: usize,
}

impl<'a> GeometryReader<'a> {
    /// Adds up what the scene claims to hold before anything is read.
    fn fits(&self, check: &mut Check) -> bool {
        let mut by_mesh: BTreeMap<usize, [usize; 3]> = BTreeMap::new();
        let mut total = [0usize; 3];
        for placed in &self.document.placed {
            // Whatever is broken is reported when it is read.
            let mut silent = Check::new("");
            let Some(node) = json::item(self.json, "nodes", "node", placed.node) else {
                continue;
            };
            let read = node.read::<Node>(&mut silent);
            let Some(mesh) = read.and_then(|node| node.mesh) else {
                continue;
            };
            let mesh = mesh.value();
            let claims = by_mesh.entry(mesh).or_insert_with(|| self.claims(mesh));
            let copies = instances::count(&node, &self.accessors, &mut silent).unwrap_or(1);
            for (total, claim) in total.iter_mut().zip(claims) {
                *total = total.saturating_add(claim.saturating_mul(copies));
            }
        }
        let limits = [MAX_VERTICES, MAX_CORNERS, MAX_SURFACES];
        let names = ["vertices", "corners of triangles", "primitives at nodes"];
        let mut fits = true;
        for ((total, limit), name) in total.into_iter().zip(limits).zip(names) {
            if total > limit {
                let what =
                    format!("claims {total} {name}, instances counted; {limit} are read at most");
                check.problem("", what, "split or simplify the room");
                fits = false;
            }
        }
        fits
    }

    /// Vertices, corners and primitives that a mesh claims.
    fn claims(&self, mesh: usize) -> [usize; 3] {
        let mut silent = Check::new("");
        let Some(item) = json::item(self.json, "meshes", "mesh", mesh) else {
            return [0; 3];
        };
        let mut claims = [0usize; 3];
        for primitive in item.list("primitives", &mut silent) {
            let Some(map) = primitive.as_object() else {
                continue;
            };
            let place = String::new();
            let (vertices, corners) = primitive::claimed(&Item { map, place }, &self.accessors);
            for (sum, more) in claims.iter_mut().zip([vertices, corners, 1]) {
                *sum = sum.saturating_add(more);
            }
        }
        claims
    }

    fn place(&mut self, placed: &PlacedNode, surfaces: &mut Vec<Surface>, check: &mut Check) {
        let Some(node) = json::item(self.json, "nodes", "node", placed.node) else {
            return;
        };
        let read = node.read::<Node>(check);
        let Some(mesh) = read.and_then(|node| node.mesh) else {
            return;
        };
        let mesh = mesh.value();
        let item = json::referred(self.json, "meshes", "mesh", mesh, &node.place, check);
        let Some(mut item) = item else { return };
        item.place = format!("{}, {}", node.place, item.place);
        if node.has("skin") {
            let what = "nodes have a skin; their meshes are taken as they stand, unbent";
            self.tally.count(what, 1, &node.place);
        }
        let primitives = item.list("primitives", check);
        if primitives.is_empty() {
            return;
        }
        let copies = match instances::read(&node, &mut self.accessors, check) {
            None => return,
            Some(None) => vec![(None, placed.to_world)],
            Some(Some(instances)) => {
                let placed = |(i, m): (usize, DMat4)| (Some(i), placed.to_world * m);
                instances.into_iter().enumerate().map(placed).collect()
            }
        };
        for (index, primitive) in primitives.iter().enumerate() {
            let place = format!("{}, primitive {index}", item.place);
            let Some(map) = primitive.as_object() else {
                check.problem(&place, "is not an object", AGAIN);
                continue;
            };
            let primitive = Item { map, place };
            // Once for all nodes that use the mesh.
            if !self.primitives.contains_key(&(mesh, index)) {
                let read = self.read(&primitive, check);
                self.primitives.insert((mesh, index), read);
            }
            let Some((material, read)) = &self.primitives[&(mesh, index)] else {
                continue;
            };
            let size = read.size().saturating_mul(copies.len());
            if size > self.placed {
                let what = format!("with it the room has more than {MAX_VERTICES} vertices");
                check.problem(&primitive.place, what, "split or simplify the room");
                return;
            }
            self.placed -= size;
            for (instance, to_world) in &copies {
                let mut name = primitive.place.clone();
                if let Some(instance) = instance {
                    name = format!("{name}, instance {instance}");
                }
                let surface = Surface {
                    name,
                    node: placed.node,
                    mesh,
                    primitive: index,
                    instance: *instance,
                    material: *material,
                    to_world: *to_world,
                    positions: Vec::new(),
                    normals: None,
                    texcoords: Vec::new(),
                    colors: None,
                    triangles: Vec::new(),
                };
                surfaces.extend(world::in_world(surface, read, &mut self.tally, check));
            }
        }
    }

    /// Index in the document's materials of what a primitive is made of.
    fn material(
        &self,
        item: &Item<'_>,
        primitive: &mesh::Primitive,
        check: &mut Check,
    ) -> Option<usize> {
        let Some(index) = primitive.material.map(|index| index.value()) else {
            // The default one stands at the end of the list as soon as one primitive needs it.
            let last = self.document.materials.len().checked_sub(1);
            return last.filter(|_| !item.has("material"));
        };
        json::referred(
            self.json,
            "materials",
            "material",
            index,
            &item.place,
            check,
        )?;
        Some(index)
    }

    /// Reads a primitive: its material, and what it is in its own space.
    fn read(&mut self, item: &Item<'a>, check: &mut Check) -> Option<(usize, Primitive)> {
        let given = item.read::<mesh::Primitive>(check)?;
        let material = self.material(item, &given, check);
        match primitive::read(item, &given, &mut self.accessors, self.unpacked, check) {
            Outcome::Sound(mut read) => {
                self.unpacked = self.unpacked.saturating_sub(read.size());
                if item.has("targets") {
                    let what = "primitives have morph targets; their base shape is taken";
                    self.tally.count(what, 1, &item.place);
                }
                self.fill_texcoords(item, material?, &mut read, check);
                Some((material?, read))
            }
            Outcome::NoArea => {
                let what = "primitives are points or lines and are left out";
                self.tally.count(what, 1, &item.place);
                None
            }
            Outcome::Bad => None,
        }
    }

    /// A texture may ask for coordinates that the primitive does not have: then they are 0.
    fn fill_texcoords(
        &mut self,
        item: &Item<'_>,
        material: usize,
        read: &mut Primitive,
        check: &mut Check,
    ) {
        let material = &self.document.materials[material];
        let sheet = material.sheet.as_ref();
        let textures = [
            material.base_color_texture.as_ref(),
            material.emissive_texture.as_ref(),
            material.transmission_texture.as_ref(),
            sheet.and_then(|sheet| sheet.strength_texture.as_ref()),
            sheet.and_then(|sheet| sheet.color_texture.as_ref()),
        ];
        let sets = textures.into_iter().flatten().map(|t| t.texcoord);
        let Some(last) = sets.max() else { return };
        if last < read.texcoords.len() {
            return;
        }
        if last >= MAX_TEXCOORDS {
            let what = format!("its material's texture uses TEXCOORD_{last}");
            check.problem(&item.place, what, "use fewer sets of texture coordinates");
            return;
        }
        let what = "primitives lack texture coordinates that their material's texture uses";
        self.tally.count(what, 1, &item.place);
        let zeros = vec![[0.0; 2]; read.positions.len()];
        read.texcoords.resize(last + 1, zeros);
    }
}
