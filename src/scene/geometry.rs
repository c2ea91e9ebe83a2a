//! From the document to surfaces, images and cameras: every primitive at every node of the scene, in world space.
//!
//! A position p becomes M p; a normal n becomes the unit vector of sign(det M) cof(M) n, which is M^-T n up to length and
//! stands for singular M too; where det M < 0 the triangles are turned, so that fronts stay fronts
//! (glTF 2.0, section 3.7.4).
//!
//! Everything is counted before anything is placed, so that a small file with many instances cannot ask for more
//! memory than [`MAX_VERTICES`], [`MAX_CORNERS`] and [`MAX_SURFACES`] allow.

use crate::error::{Error, Problem, Result};
use crate::scene::accessor::{Accessors, Buffers};
use crate::scene::check::Check;
use crate::scene::document::Document;
use crate::scene::json::{self, Item};
use crate::scene::nodes::{self, Placed};
use crate::scene::primitive::{self, Outcome, Primitive};
use crate::scene::{Camera, Image, Projection, Surface, image};
use glam::{DMat3, DMat4, DVec3, Vec3};
use serde_json::Value;
use std::collections::BTreeMap;

/// Vertices of the whole room, instances counted: 64 bytes each, about 1 GB.
pub const MAX_VERTICES: usize = 1 << 24;
/// Corners of all triangles of the room, instances counted.
pub const MAX_CORNERS: usize = 3 << 24;
/// Primitives at nodes and instances.
pub const MAX_SURFACES: usize = 1 << 20;
/// Twice the area of a triangle counts as nothing below this, times its longest edge and its farthest coordinate:
/// a few roundings of its corners.
const AREA_ROUNDING: f64 = 16.0 * f64::EPSILON;
const AGAIN: &str = "export the file again";

/// What a document holds besides paint and light. Of no use where `problems` is not empty.
#[derive(Debug)]
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
        let mut reader = Reader {
            document: self,
            json,
            accessors: Accessors::new(json, &self.buffers),
            primitives: BTreeMap::new(),
            tally: Tally::default(),
        };
        let mut surfaces = Vec::new();
        if reader.fits(&mut check) {
            for placed in &self.placed {
                reader.place(placed, &mut surfaces, &mut check);
            }
        }
        reader.tally.report(&mut check);
        let cameras = cameras(json, &self.placed, &mut check);
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
        for slot in &self.slots.images {
            let Some(index) = *slot else {
                images.push(image::neutral(""));
                continue;
            };
            let item = json::item(&self.source.json, "images", "image", index);
            let (name, place) = item.map_or_else(Default::default, |i| (i.name(), i.place));
            let bytes = self.source.image_bytes(index).map_err(|e| e.to_string());
            let decoded = bytes.and_then(|bytes| {
                image::decode(name, &bytes, count).map_err(|why| format!("{place}: {why}"))
            });
            images.push(decoded.unwrap_or_else(|why| {
                check.warn(format!("{why}; grey stands in for the image"));
                image::neutral(name)
            }));
        }
        images
    }
}

/// What is counted over the whole document and said once.
#[derive(Debug, Default)]
struct Tally {
    counts: BTreeMap<&'static str, (usize, String)>,
}

impl Tally {
    fn count(&mut self, what: &'static str, how_many: usize, first: &str) {
        if how_many > 0 {
            let entry = self
                .counts
                .entry(what)
                .or_insert_with(|| (0, first.to_owned()));
            entry.0 += how_many;
        }
    }

    fn report(&self, check: &mut Check) {
        for (what, (count, first)) in &self.counts {
            check.warn(format!("{count} {what} (first: {first})"));
        }
    }
}

struct Reader<'a> {
    document: &'a Document,
    json: &'a Value,
    accessors: Accessors<'a>,
    /// Read primitives by mesh and index; none: without area, or broken and reported.
    primitives: BTreeMap<(usize, usize), Option<Primitive>>,
    tally: Tally,
}

impl<'a> Reader<'a> {
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
            let Some(mesh) = node.index("mesh", &mut silent) else {
                continue;
            };
            let claims = by_mesh.entry(mesh).or_insert_with(|| self.claims(mesh));
            let copies = self.instance_count(&node, &mut silent).unwrap_or(1);
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

    fn place(&mut self, placed: &Placed, surfaces: &mut Vec<Surface>, check: &mut Check) {
        let Some(node) = json::item(self.json, "nodes", "node", placed.node) else {
            return;
        };
        let Some(mesh) = node.index("mesh", check) else {
            return;
        };
        let item = json::referred(self.json, "meshes", "mesh", mesh, &node.place, check);
        let Some(mut item) = item else { return };
        item.place = format!("{}, {}", node.place, item.place);
        if node.map.contains_key("skin") {
            let what = "nodes have a skin; their meshes are taken as they stand, unbent";
            self.tally.count(what, 1, &node.place);
        }
        let copies = match self.instances(&node, check) {
            None => return,
            Some(None) => vec![(None, placed.to_world)],
            Some(Some(instances)) => {
                let placed = |(i, m): (usize, DMat4)| (Some(i), placed.to_world * m);
                instances.into_iter().enumerate().map(placed).collect()
            }
        };
        let primitives = item.list("primitives", check);
        for (index, primitive) in primitives.iter().enumerate() {
            let place = format!("{}, primitive {index}", item.place);
            let Some(map) = primitive.as_object() else {
                check.problem(&place, "is not an object", AGAIN);
                continue;
            };
            let primitive = Item { map, place };
            let material = self.material(&primitive, check);
            self.read(mesh, index, &primitive, check);
            let (Some(material), Some(Some(read))) =
                (material, self.primitives.get(&(mesh, index)))
            else {
                continue;
            };
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
                    material,
                    to_world: *to_world,
                    positions: Vec::new(),
                    normals: None,
                    texcoords: Vec::new(),
                    colors: None,
                    triangles: Vec::new(),
                };
                surfaces.extend(in_world(surface, read, &mut self.tally, check));
            }
        }
    }

    /// Index in the document's materials of what a primitive is made of.
    fn material(&self, primitive: &Item<'_>, check: &mut Check) -> Option<usize> {
        let materials = &self.document.materials;
        if !primitive.map.contains_key("material") {
            // The default one stands at the end of the list as soon as one primitive needs it.
            return materials.len().checked_sub(1);
        }
        let index = primitive.index("material", check)?;
        let known = json::len(self.json, "materials");
        json::referred(
            self.json,
            "materials",
            "material",
            index,
            &primitive.place,
            check,
        )?;
        (index < known).then_some(index)
    }

    /// Reads a primitive, once for all nodes that use its mesh.
    fn read(&mut self, mesh: usize, index: usize, primitive: &Item<'a>, check: &mut Check) {
        if self.primitives.contains_key(&(mesh, index)) {
            return;
        }
        let outcome = primitive::read(primitive, &mut self.accessors, MAX_VERTICES, check);
        let read = match outcome {
            Outcome::Sound(mut read) => {
                if primitive.map.contains_key("targets") {
                    let what = "primitives have morph targets; their base shape is taken";
                    self.tally.count(what, 1, &primitive.place);
                }
                self.fill_texcoords(primitive, &mut read, check);
                Some(read)
            }
            Outcome::NoArea => {
                let what = "primitives are points or lines and are left out";
                self.tally.count(what, 1, &primitive.place);
                None
            }
            Outcome::Bad => None,
        };
        self.primitives.insert((mesh, index), read);
    }

    /// A texture may ask for coordinates that the primitive does not have: then they are 0.
    fn fill_texcoords(&mut self, item: &Item<'_>, read: &mut Primitive, check: &mut Check) {
        let Some(material) = self.material(item, check) else {
            return;
        };
        let material = &self.document.materials[material];
        let textures = [&material.base_color_texture, &material.emissive_texture];
        let sets = textures.into_iter().flatten().map(|t| t.texcoord);
        let Some(last) = sets.max() else { return };
        if last < read.texcoords.len() {
            return;
        }
        const MOST: usize = 16;
        if last >= MOST {
            let what = format!("its material's texture uses TEXCOORD_{last}");
            check.problem(&item.place, what, "use fewer sets of texture coordinates");
            return;
        }
        let what = "primitives lack texture coordinates that their material's texture uses";
        self.tally.count(what, 1, &item.place);
        let zeros = vec![[0.0; 2]; read.positions.len()];
        read.texcoords.resize(last + 1, zeros);
    }

    /// How many instances a node has by EXT_mesh_gpu_instancing.
    fn instance_count(&self, node: &Item<'a>, check: &mut Check) -> Option<usize> {
        let attributes = instancing(node, check)?;
        let each = INSTANCE_ATTRIBUTES.iter().filter_map(|semantic| {
            let accessor = attributes.index(semantic, check)?;
            let (_, layout) = self.accessors.layout(accessor, "", check)?;
            Some(layout.count)
        });
        each.max()
    }

    /// The transforms of a node's instances; the inner none: it has none, the outer: they are broken, which was reported.
    fn instances(&mut self, node: &Item<'a>, check: &mut Check) -> Option<Option<Vec<DMat4>>> {
        let Some(attributes) = instancing(node, check) else {
            return Some(None);
        };
        let [translation, rotation, scale] = INSTANCE_ATTRIBUTES;
        let translations = self.instance_values::<3>(&attributes, translation, check)?;
        let rotations = self.instance_values::<4>(&attributes, rotation, check)?;
        let scales = self.instance_values::<3>(&attributes, scale, check)?;
        let counts = [
            translations.as_ref().map(Vec::len),
            rotations.as_ref().map(Vec::len),
            scales.as_ref().map(Vec::len),
        ];
        let mut counts = counts.into_iter().flatten();
        let Some(count) = counts.next() else {
            return Some(None);
        };
        if counts.any(|other| other != count) {
            check.problem(
                &attributes.place,
                "has attributes of different lengths",
                AGAIN,
            );
            return None;
        }
        let pick = |values: &Option<Vec<[f32; 3]>>, i: usize, otherwise: DVec3| {
            values
                .as_ref()
                .map_or(otherwise, |v| Vec3::from(v[i]).as_dvec3())
        };
        let matrix = |i: usize| {
            let turn = rotations
                .as_ref()
                .map_or([0.0, 0.0, 0.0, 1.0], |r| r[i].map(f64::from));
            DMat4::from_scale_rotation_translation(
                pick(&scales, i, DVec3::ONE),
                nodes::rotation(turn),
                pick(&translations, i, DVec3::ZERO),
            )
        };
        let matrices: Vec<DMat4> = (0..count).map(matrix).collect();
        if let Some(bad) = matrices.iter().position(|m| !m.is_finite()) {
            let what = format!("has a transform that is not finite, at instance {bad}");
            check.problem(&attributes.place, what, AGAIN);
            return None;
        }
        Some(Some(matrices))
    }

    fn instance_values<const N: usize>(
        &mut self,
        attributes: &Item<'_>,
        semantic: &str,
        check: &mut Check,
    ) -> Option<Option<Vec<[f32; N]>>> {
        if !attributes.map.contains_key(semantic) {
            return Some(None);
        }
        let place = format!("{}, {semantic}", attributes.place);
        let accessor = attributes.index(semantic, check)?;
        self.accessors
            .vectors::<N>(accessor, &place, check)
            .map(Some)
    }
}

const INSTANCE_ATTRIBUTES: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];

fn instancing<'a>(node: &Item<'a>, check: &mut Check) -> Option<Item<'a>> {
    const NAME: &str = "EXT_mesh_gpu_instancing";
    if !node.map.contains_key("extensions") {
        return None;
    }
    let mut attributes = node.extension(NAME, check)?.child("attributes", check)?;
    attributes.place = format!("{}, {NAME}", node.place);
    Some(attributes)
}

/// Places a primitive; none if nothing of it has an area, or it is out of all bounds (which is reported).
fn in_world(
    mut surface: Surface,
    read: &Primitive,
    tally: &mut Tally,
    check: &mut Check,
) -> Option<Surface> {
    let to_world = surface.to_world;
    let place = |p: &[f32; 3]| to_world.transform_point3(Vec3::from(*p).as_dvec3());
    surface.positions = read.positions.iter().map(place).collect();
    if !surface.positions.iter().all(|p| p.is_finite()) {
        check.problem(
            &surface.name,
            "has a position that is not finite in the world",
            AGAIN,
        );
        return None;
    }
    let linear = DMat3::from_mat4(to_world);
    let mirrored = linear.determinant() < 0.0;
    let positions = &surface.positions;
    surface.triangles = read
        .triangles
        .iter()
        .map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] })
        .filter(|triangle| has_area(triangle.map(|i| positions[i as usize])))
        .collect();
    let lost = read.triangles.len() - surface.triangles.len();
    tally.count(
        "triangles have no area and are left out",
        lost,
        &surface.name,
    );
    if surface.triangles.is_empty() {
        return None;
    }
    if let Some(normals) = &read.normals {
        let mut turned = normals_in_world(normals, &linear);
        let bad = replace_bad(&mut turned, &surface);
        tally.count(
            "normals have no direction and were replaced",
            bad,
            &surface.name,
        );
        surface.normals = Some(turned);
    }
    surface.texcoords.clone_from(&read.texcoords);
    surface.colors.clone_from(&read.colors);
    Some(surface)
}

fn has_area([a, b, c]: [DVec3; 3]) -> bool {
    let edges = [b - a, c - b, a - c];
    let longest = edges.iter().map(|e| e.length()).fold(0.0, f64::max);
    let farthest = [a, b, c]
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max);
    // Scaled first, so that neither tiny nor huge triangles leave the range of numbers.
    if longest <= 0.0 || !longest.is_finite() {
        return false;
    }
    let twice = (edges[0] / longest).cross(edges[2] / longest).length();
    twice > AREA_ROUNDING * (farthest / longest)
}

/// Unit normals; zero where there is no direction.
fn normals_in_world(normals: &[[f32; 3]], linear: &DMat3) -> Vec<Vec3> {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let sign = if linear.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let turn = |n: &[f32; 3]| {
        let n = cofactor * Vec3::from(*n).as_dvec3();
        // Scaled first: a cofactor is of the size of the matrix squared.
        let scale = n.abs().max_element();
        if scale > 0.0 && scale.is_finite() {
            ((n / scale).normalize() * sign).as_vec3()
        } else {
            Vec3::ZERO
        }
    };
    normals.iter().map(turn).collect()
}

/// Gives vertices without a direction the normal of a triangle there; returns how many (used ones) there were.
fn replace_bad(normals: &mut [Vec3], surface: &Surface) -> usize {
    let mut count = 0;
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|i| surface.positions[i as usize]);
        for &corner in triangle {
            let normal = &mut normals[corner as usize];
            if *normal == Vec3::ZERO {
                *normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
                count += 1;
            }
        }
    }
    for normal in normals.iter_mut().filter(|n| **n == Vec3::ZERO) {
        // No triangle uses it (or its cross product underflows): any unit vector keeps the promise of unit length.
        *normal = Vec3::Z;
    }
    count
}

fn cameras(json: &Value, placed: &[Placed], check: &mut Check) -> Vec<Camera> {
    let mut cameras = Vec::new();
    for placed in placed {
        let Some(node) = json::item(json, "nodes", "node", placed.node) else {
            continue;
        };
        let Some(index) = node.index("camera", check) else {
            continue;
        };
        let item = json::referred(json, "cameras", "camera", index, &node.place, check);
        let Some(item) = item else { continue };
        match lens(&item, check) {
            Some((projection, aspect)) => {
                let names = [item.name(), node.name()];
                let name = names.into_iter().find(|name| !name.is_empty());
                cameras.push(Camera {
                    name: name.map_or_else(|| format!("camera {index}"), str::to_owned),
                    to_world: placed.to_world,
                    projection,
                    aspect,
                });
            }
            None => check.warn(format!("{} has no view and is left out", item.place)),
        }
    }
    cameras
}

fn lens(item: &Item<'_>, check: &mut Check) -> Option<(Projection, Option<f64>)> {
    match item.text("type", check)? {
        "perspective" => {
            let lens = item.child("perspective", check)?;
            let angle = lens.number("yfov", check)?;
            let aspect = lens.number("aspectRatio", check).filter(|&a| a > 0.0);
            let sound = angle > 0.0 && angle < std::f64::consts::PI;
            sound.then_some((Projection::Perspective(angle), aspect))
        }
        "orthographic" => {
            let lens = item.child("orthographic", check)?;
            let (x, y) = (
                lens.number("xmag", check)?.abs(),
                lens.number("ymag", check)?.abs(),
            );
            (x > 0.0 && y > 0.0).then_some((Projection::Orthographic(y), Some(x / y)))
        }
        _ => None,
    }
}

/// Buffers that are all there.
pub(crate) fn sound(bytes: Vec<std::sync::Arc<[u8]>>) -> Buffers {
    let sound = vec![true; bytes.len()];
    Buffers { bytes, sound }
}
