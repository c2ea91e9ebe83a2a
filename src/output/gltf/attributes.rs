//! Vertex attributes of the refined mesh, in the primitive's local space.
//!
//! Input attributes are interpolated from the document's own data in f64; from the scene's world-space copy (brought
//! back by the inverse transform) where the data sits in a Draco stream. Everything is written as f32.

use super::accessor::{self, AttributeTable, Data};
use super::json::index;
use super::packing::QuantizationGrid;
use super::writer::Writer;
use crate::error::{Error, Result};
use crate::gather::refined;
use crate::gather::{BakedSurface, BakedVertex};
use crate::output::{Exposure, curve};
use crate::scene::{Alpha, Material, Scene, Surface};
use glam::{DMat3, DVec3};
use serde_json::{Map, Value, json};

/// glTF component type of f32.
const FLOAT: u64 = 5126;

impl Writer<'_> {
    /// Adds all attributes of one refined primitive to the buffer; returns its `attributes` object.
    pub(super) fn attributes(&mut self, primitive: &Value, baked: &BakedSurface) -> Result<Value> {
        let scene = self.scene;
        let surface = &scene.surfaces[baked.surface];
        let turned = scene.is_flipped(baked.surface);
        let input = PrimitiveInput::new(primitive, surface, turned, &mut self.data)?;
        let mut out = Map::new();

        let positions = input.positions(baked, self.apart);
        let accessor = match &self.grid {
            Some(grid) => self.bin.on_grid(grid, &positions),
            None => self.bin.positions(&positions),
        };
        out.insert("POSITION".into(), json!(accessor));
        if let Some(normals) = input.normals(baked) {
            out.insert("NORMAL".into(), json!(self.bin.units(&normals)));
            if let Some(tangents) = input.tangents(baked, &normals) {
                out.insert("TANGENT".into(), json!(self.bin.units(&tangents)));
            }
        }
        for name in input.names() {
            let accessor = match name.split_once('_') {
                Some(("TEXCOORD", _)) => input
                    .rows::<2>(baked, &name)
                    .map(|rows| self.bin.shares(&rows)),
                Some(("COLOR", set)) if set != "0" && baked.layers.is_empty() => {
                    self.any_width(&input, baked, &name)
                }
                Some(("", _)) if name != "_XYZ" && input.is_float(&name) => {
                    self.any_width(&input, baked, &name)
                }
                _ => None,
            };
            if let Some(accessor) = accessor {
                out.insert(name, json!(accessor));
            }
        }
        match &baked.map {
            Some(map) => {
                let name = format!("TEXCOORD_{}", Self::free_set(primitive));
                let accessor = self.bin.floats(&map.uv);
                // Sets must be numbered without gaps.
                out.entry("TEXCOORD_0").or_insert(json!(accessor));
                out.insert(name, json!(accessor));
                if let Some(colors) = self.vertex_paint(baked) {
                    out.insert("COLOR_0".into(), json!(colors));
                }
            }
            None => {
                out.insert("COLOR_0".into(), json!(self.light(surface, baked)));
                for (k, set) in self.layer_sets(surface, baked).into_iter().enumerate() {
                    out.insert(format!("COLOR_{}", k + 1), json!(set));
                }
            }
        }
        if self.writing.xyz {
            let radiosity: Vec<[f32; 3]> = baked.vertices.iter().map(|v| v.radiosity).collect();
            out.insert("_XYZ".into(), json!(self.bin.floats(&radiosity)));
        }
        Ok(Value::Object(out))
    }

    /// The grid that the positions of some refined primitives of a mesh lie on.
    pub(super) fn grid(
        &mut self,
        parts: &[(&Value, &BakedSurface)],
    ) -> Result<Option<QuantizationGrid>> {
        let mut all = Vec::new();
        for (primitive, baked) in parts {
            let surface = &self.scene.surfaces[baked.surface];
            let turned = self.scene.is_flipped(baked.surface);
            let input = PrimitiveInput::new(primitive, surface, turned, &mut self.data)?;
            all.extend(input.positions(baked, self.apart));
        }
        Ok(QuantizationGrid::around(&all))
    }

    fn any_width(
        &mut self,
        input: &PrimitiveInput,
        baked: &BakedSurface,
        name: &str,
    ) -> Option<usize> {
        match input.table(name)?.components {
            1 => input
                .rows::<1>(baked, name)
                .map(|rows| self.bin.floats(&rows)),
            2 => input
                .rows::<2>(baked, name)
                .map(|rows| self.bin.floats(&rows)),
            3 => input
                .rows::<3>(baked, name)
                .map(|rows| self.bin.floats(&rows)),
            _ => input
                .rows::<4>(baked, name)
                .map(|rows| self.bin.floats(&rows)),
        }
    }

    /// COLOR_0: exposed light times vertex paint; with alpha where the input's vertex alpha makes holes or blends.
    fn light(&mut self, surface: &Surface, baked: &BakedSurface) -> usize {
        let material = &self.scene.materials[surface.material];
        let mut colors = Vec::with_capacity(baked.vertices.len());
        for vertex in &baked.vertices {
            let alpha = refined::vertex_color(surface, vertex)[3];
            let wanted = exposed(material, surface, vertex, self.look);
            let shown = curve::into_display(wanted).map(|c| c as f32);
            self.clipped += usize::from(wanted.iter().any(|&c| !(0.0..=1.0).contains(&c)));
            self.compressed += usize::from(curve::is_compressed(wanted));
            colors.push([shown[0], shown[1], shown[2], alpha.clamp(0.0, 1.0)]);
        }
        let blends =
            matches!(material.alpha, Alpha::Mask { .. }) || colors.iter().any(|c| c[3] < 1.0);
        if surface.colors.is_some() && blends {
            self.bin.shares(&colors)
        } else {
            let opaque: Vec<[f32; 3]> = colors.iter().map(|c| [c[0], c[1], c[2]]).collect();
            self.bin.shares(&opaque)
        }
    }
}

/// Exposed light times vertex paint, before the curve.
pub(super) fn exposed(
    material: &Material,
    surface: &Surface,
    vertex: &BakedVertex,
    look: &Exposure,
) -> [f64; 3] {
    let [r, g, b, _] = refined::vertex_color(surface, vertex);
    let paint = if material.vertex_paint {
        [r, g, b]
    } else {
        [1.0; 3]
    };
    let light = look.shown(vertex.light.map(f64::from));
    std::array::from_fn(|i| light[i] * f64::from(paint[i]))
}

/// What COLOR_0 holds at a vertex of a surface: linear sRGB.
pub fn color_0(
    scene: &Scene,
    surface: &Surface,
    vertex: &BakedVertex,
    look: &Exposure,
) -> [f32; 3] {
    let material = &scene.materials[surface.material];
    curve::into_display(exposed(material, surface, vertex, look)).map(|c| c as f32)
}

/// The attributes of an input primitive, by name.
struct PrimitiveInput<'a> {
    surface: &'a Surface,
    primitive: &'a Value,
    tables: Vec<(String, AttributeTable)>,
    /// Were its faces turned since the document was read?
    turned: bool,
    /// World to local, where it exists and the document's own positions cannot be read.
    to_local: Option<glam::DMat4>,
}

impl<'a> PrimitiveInput<'a> {
    fn new(
        primitive: &'a Value,
        surface: &'a Surface,
        turned: bool,
        data: &mut Data,
    ) -> Result<Self> {
        let mut tables = Vec::new();
        if let Some(attributes) = primitive.get("attributes").and_then(Value::as_object)
            && !accessor::is_draco(primitive)
        {
            for name in attributes.keys() {
                let count = surface.positions.len();
                let table = index(&primitive["attributes"], name).and_then(|a| data.read(a, count));
                tables.extend(table.map(|table| (name.clone(), table)));
            }
        }
        let mut input = Self {
            surface,
            primitive,
            tables,
            turned,
            to_local: None,
        };
        if input.vectors("POSITION").is_none() {
            if surface.to_world.determinant() == 0.0 {
                return Err(Error::input(
                    &surface.name,
                    "compressed vertices under a transform that flattens them cannot be written back",
                    "save the room without compression",
                ));
            }
            input.to_local = Some(surface.to_world.inverse());
        }
        Ok(input)
    }

    /// Attribute names other than POSITION, NORMAL and TANGENT, in the document's order.
    fn names(&self) -> Vec<String> {
        let attributes = self.primitive.get("attributes").and_then(Value::as_object);
        attributes
            .into_iter()
            .flatten()
            .map(|(name, _)| name.clone())
            .collect()
    }

    fn table(&self, name: &str) -> Option<&AttributeTable> {
        self.tables
            .iter()
            .find(|(n, _)| n == name)
            .map(|(_, table)| table)
    }

    /// Three-component data.
    fn vectors(&self, name: &str) -> Option<&AttributeTable> {
        self.table(name).filter(|t| t.components == 3)
    }

    /// Custom attributes are interpolated only where they are floats: whole numbers are ids.
    fn is_float(&self, name: &str) -> bool {
        self.table(name).is_some_and(|t| t.component == FLOAT)
    }

    /// Positions; backs are drawn `apart` (world units) from the fronts that they would coincide with: path tracers, which
    /// know no culling, could not tell them apart. Fronts stay, so that they meet their neighbours.
    fn positions(&self, baked: &BakedSurface, apart: f64) -> Vec<[f32; 3]> {
        let place = |v| match (self.vectors("POSITION"), self.to_local) {
            (Some(local), _) => self.blend(local, v),
            (None, Some(to_local)) => to_local.transform_point3(refined::position(self.surface, v)),
            // `new` sets `to_local` where there are no positions.
            (None, None) => DVec3::ZERO,
        };
        let to_local = self.surface.to_world.inverse();
        let lift: Vec<DVec3> = match baked.back && to_local.is_finite() {
            true => (refined::outward(self.surface, baked).into_iter())
                .map(|out| to_local.transform_vector3(apart * out))
                .collect(),
            false => vec![DVec3::ZERO; baked.vertices.len()],
        };
        (baked.vertices.iter().zip(lift))
            .map(|(v, lift)| (place(v) + lift).as_vec3().to_array())
            .collect()
    }

    /// Unit normals; none: the input has none and its triangles are flat.
    fn normals(&self, baked: &BakedSurface) -> Option<Vec<[f32; 3]>> {
        // Normals go to world by the inverse transpose, so they come back by the transpose.
        let back = DMat3::from_mat4(self.surface.to_world).transpose();
        let local = self.vectors("NORMAL");
        if local.is_none() && (self.surface.normals.is_none() || self.to_local.is_none()) {
            return None;
        }
        let normal = |v| {
            let smooth = local.and_then(|table| self.blend(table, v).try_normalize());
            let smooth = smooth.map(|n| if baked.back != self.turned { -n } else { n });
            let world = || (back * refined::normal(self.surface, baked, v)).normalize_or(DVec3::Y);
            smooth.unwrap_or_else(world).as_vec3().to_array()
        };
        Some(baked.vertices.iter().map(normal).collect())
    }

    fn tangents(&self, baked: &BakedSurface, normals: &[[f32; 3]]) -> Option<Vec<[f32; 4]>> {
        let table = self.table("TANGENT").filter(|t| t.components == 4)?;
        let tangent = |(vertex, normal): (&BakedVertex, &[f32; 3])| {
            // Opposite tangents cancel: any direction across the normal will do there.
            let across = || DVec3::from(normal.map(f64::from)).any_orthonormal_vector();
            let direction = self
                .blend(table, vertex)
                .try_normalize()
                .unwrap_or_else(across);
            // The handedness is +1 or -1 and is not interpolated: the nearest corner's.
            let weights = vertex.weights;
            let nearest = (0..3).fold(
                0,
                |best, k| if weights[k] > weights[best] { k } else { best },
            );
            let hand = table.row(refined::corners(self.surface, vertex)[nearest])[3];
            let [x, y, z] = direction.as_vec3().to_array();
            // The bitangent, normal x tangent * hand, runs along the texture and stays; the back's normal is turned.
            let left = (hand < 0.0) != (baked.back != self.turned);
            [x, y, z, if left { -1.0 } else { 1.0 }]
        };
        Some(baked.vertices.iter().zip(normals).map(tangent).collect())
    }

    /// Interpolated data of `N` components; texture coordinates fall back on the scene's. Numbers that are none
    /// become zero.
    fn rows<const N: usize>(&self, baked: &BakedSurface, name: &str) -> Option<Vec<[f32; N]>> {
        if let Some(table) = self.table(name).filter(|t| t.components == N) {
            return Some(self.mixed(baked, |corner, i| table.row(corner)[i]));
        }
        let set: usize = name.strip_prefix("TEXCOORD_")?.parse().ok()?;
        let set = self.surface.texcoords.get(set)?;
        let fits = N == 2 && set.len() == self.surface.positions.len();
        fits.then(|| self.mixed(baked, |corner, i| f64::from(set[corner][i])))
    }

    /// Component `i` of input vertex `c` is `value(c, i)`.
    fn mixed<const N: usize>(
        &self,
        baked: &BakedSurface,
        value: impl Fn(usize, usize) -> f64,
    ) -> Vec<[f32; N]> {
        let row = |vertex: &BakedVertex| {
            let corners = refined::corners(self.surface, vertex);
            let at = |k: usize, i: usize| vertex.weights[k] * value(corners[k], i);
            std::array::from_fn(|i| {
                let mean = (at(0, i) + at(1, i) + at(2, i)) as f32;
                if mean.is_finite() { mean } else { 0.0 }
            })
        };
        baked.vertices.iter().map(row).collect()
    }

    /// First three components, interpolated.
    fn blend(&self, table: &AttributeTable, vertex: &BakedVertex) -> DVec3 {
        let corners = refined::corners(self.surface, vertex);
        let at = |k: usize| vertex.weights[k] * DVec3::from_slice(table.row(corners[k]));
        at(0) + at(1) + at(2)
    }
}
