//! Meshes and the nodes that show them: a mesh of its own for each node (the light differs), a child node for each
//! instance of EXT_mesh_gpu_instancing.

use super::accessor;
use super::json::{extension, index, list, put_list, remove_below};
use super::keep::Role;
use super::packing::Packing;
use super::writer::{MapPart, Writer};
use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use glam::DQuat;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Many copies of a node's mesh.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// TRIANGLES.
const TRIANGLES: u64 = 4;

impl<'a> Writer<'a> {
    /// Replaces the document's meshes.
    pub(super) fn meshes(&mut self) -> Result<()> {
        self.find_kept_materials();
        let source = &self.scene.source.json;
        let mut meshes = Vec::new();
        let mut kept = BTreeMap::new();
        let mut nodes = list(source, "nodes").to_vec();
        for node in 0..nodes.len() {
            let Some(mesh) = index(&nodes[node], "mesh") else {
                continue;
            };
            if !self.is_baked(node) {
                let new = match kept.get(&mesh) {
                    Some(&new) => Some(new),
                    None => self.mesh(mesh, node, None, &mut meshes)?,
                };
                kept.extend(new.map(|new| (mesh, new)));
                show(&mut nodes[node], new);
                continue;
            }
            if let Some(object) = nodes[node].as_object_mut() {
                // The bake holds for the pose as read.
                object.shift_remove("skin");
                object.shift_remove("weights");
            }
            match extension(&nodes[node], INSTANCING).cloned() {
                None => {
                    let new = self.mesh(mesh, node, None, &mut meshes)?;
                    self.show(&mut nodes, node, new);
                }
                Some(instancing) => {
                    for (instance, mut child) in
                        self.instances(node, &instancing)?.into_iter().enumerate()
                    {
                        let new = self.mesh(mesh, node, Some(instance), &mut meshes)?;
                        show(&mut child, None);
                        let place = add_child(&mut nodes, node, child);
                        self.show(&mut nodes, place, new);
                    }
                    remove_below(&mut nodes[node], "extensions", INSTANCING);
                    show(&mut nodes[node], None);
                }
            }
        }
        nodes
            .iter_mut()
            .chain(&mut meshes)
            .for_each(|json| self.move_views(json));
        put_list(&mut self.json, "nodes", nodes);
        put_list(&mut self.json, "meshes", meshes);
        Ok(())
    }

    /// Sets or removes the mesh of a node; one on a grid gets a node of its own, which undoes the grid.
    fn show(&self, nodes: &mut Vec<Value>, node: usize, mesh: Option<usize>) {
        match (&self.grid, mesh) {
            (Some(grid), Some(mesh)) => {
                show(&mut nodes[node], None);
                let mut child = grid.node();
                child["mesh"] = json!(mesh);
                add_child(nodes, node, child);
            }
            _ => show(&mut nodes[node], mesh),
        }
    }

    pub(super) fn is_baked(&self, node: usize) -> bool {
        self.baked
            .range((node, None)..=(node, Some(usize::MAX)))
            .next()
            .is_some()
    }

    /// Materials of primitives that go over as they are must not be changed in place.
    fn find_kept_materials(&mut self) {
        let source = &self.scene.source.json;
        for (node, json) in list(source, "nodes").iter().enumerate() {
            let mesh = index(json, "mesh").and_then(|mesh| list(source, "meshes").get(mesh));
            for (p, primitive) in mesh
                .map_or(&[][..], |mesh| list(mesh, "primitives"))
                .iter()
                .enumerate()
            {
                let mut drawn = self
                    .baked
                    .range((node, None)..=(node, Some(usize::MAX)))
                    .peekable();
                let all_baked = drawn.peek().is_some()
                    && drawn.all(|(_, primitives)| primitives.contains_key(&p));
                if !all_baked {
                    self.keep_materials(primitive);
                }
            }
        }
    }

    /// Adds the mesh as shown at a node and instance; none if nothing of it can be shown.
    fn mesh(
        &mut self,
        mesh: usize,
        node: usize,
        instance: Option<usize>,
        meshes: &mut Vec<Value>,
    ) -> Result<Option<usize>> {
        let Some(input) = list(&self.scene.source.json, "meshes").get(mesh) else {
            return Ok(None);
        };
        let baked = self
            .baked
            .get(&(node, instance))
            .cloned()
            .unwrap_or_default();
        self.grid = None;
        if self.writing.packing != Packing::Floats {
            let all = list(input, "primitives").iter().enumerate();
            let parts: Option<Vec<_>> = all.map(|(p, json)| Some((json, baked.get(&p)?))).collect();
            // Lines and points would be moved with what is put on a grid.
            if let Some(parts) = parts {
                let each = |(json, surfaces): (_, &Vec<&'a BakedSurface>)| {
                    surfaces.iter().map(move |s| (json, *s)).collect::<Vec<_>>()
                };
                let parts: Vec<_> = parts.into_iter().flat_map(each).collect();
                self.grid = self.grid(&parts)?;
            }
        }
        let mut primitives = Vec::new();
        for (p, primitive) in list(input, "primitives").iter().enumerate() {
            match baked.get(&p) {
                Some(surfaces) => {
                    for surface in surfaces {
                        if let Some(map) = &surface.map {
                            self.maps.parts.push(MapPart {
                                surface: surface.surface,
                                back: surface.back,
                                mesh: meshes.len(),
                                primitive: primitives.len(),
                                page: map.page,
                                texcoord: Self::free_set(primitive),
                            });
                        }
                        primitives.push(self.baked_primitive(primitive, surface)?);
                    }
                }
                None => primitives.extend(self.kept_primitive(primitive)),
            }
        }
        if primitives.is_empty() {
            return Ok(None);
        }
        let mut out = input.clone();
        out["primitives"] = json!(primitives);
        if let Some(out) = out.as_object_mut()
            && !baked.is_empty()
        {
            out.shift_remove("weights");
        }
        meshes.push(out);
        Ok(Some(meshes.len() - 1))
    }

    fn baked_primitive(&mut self, primitive: &Value, baked: &BakedSurface) -> Result<Value> {
        let surface = &self.scene.surfaces[baked.surface];
        let mut out = primitive.clone();
        out["attributes"] = self.attributes(primitive, baked)?;
        // A viewer turns the triangles of mirrored nodes; the refined mesh is turned already, so turn it back.
        let mirrored = surface.to_world.determinant() < 0.0;
        let local = |&[a, b, c]: &[u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        let triangles: Vec<[u32; 3]> = baked.triangles.iter().map(local).collect();
        out["indices"] = json!(self.bin.triangles(&triangles, baked.vertices.len()));
        out["mode"] = json!(TRIANGLES);
        out["material"] = json!(match &baked.map {
            Some(map) => self.mapped(surface.material, map.page, Self::free_set(primitive)),
            None => self.unlit(surface.material),
        });
        if let Some(out) = out.as_object_mut() {
            out.shift_remove("targets");
        }
        remove_below(&mut out, "extensions", "KHR_draco_mesh_compression");
        remove_below(&mut out, "extensions", "KHR_materials_variants");
        self.vertices += baked.vertices.len();
        self.triangles += triangles.len();
        Ok(out)
    }

    /// A primitive without light (points, lines): carried over with its data. None: its data is only in a Draco stream.
    fn kept_primitive(&mut self, primitive: &Value) -> Option<Value> {
        if accessor::is_draco(primitive) {
            let material = index(primitive, "material").and_then(|m| self.scene.materials.get(m));
            if let Some(material) = material.filter(|m| m.pane.is_some()) {
                let name = crate::scene::short(&material.name);
                let what =
                    "is only in a Draco stream and is not written: save the room without Draco";
                self.warnings.push(format!("a pane of '{name}' {what}"));
            }
            return None;
        }
        let mut out = primitive.clone();
        for target in out
            .get_mut("targets")
            .and_then(Value::as_array_mut)
            .into_iter()
            .flatten()
        {
            self.move_accessors(target);
        }
        self.move_accessors(out.get_mut("attributes")?);
        if let Some(indices) = index(&out, "indices") {
            out["indices"] = json!(self.keep_accessor(indices, Role::Indices));
        }
        Some(out)
    }

    fn move_accessors(&mut self, attributes: &mut Value) {
        for (name, accessor) in attributes.as_object_mut().into_iter().flatten() {
            if let Some(old) = accessor.as_u64().and_then(|a| usize::try_from(a).ok()) {
                self.quantized |= accessor::is_quantized(&self.scene.source, name, old);
                *accessor = json!(self.keep_accessor(old, Role::Vertices));
            }
        }
    }

    /// One node for each instance: its transform, without a mesh yet.
    fn instances(&mut self, node: usize, instancing: &Value) -> Result<Vec<Value>> {
        let source = &self.scene.source;
        let name = source.json["nodes"][node]["name"]
            .as_str()
            .unwrap_or("instance")
            .to_owned();
        let attributes = &instancing["attributes"];
        let accessors = list(&source.json, "accessors");
        let counts = |key| {
            index(attributes, key)
                .and_then(|a| accessors.get(a))
                .and_then(|a| index(a, "count"))
        };
        let keys = ["TRANSLATION", "ROTATION", "SCALE"];
        let count = keys.into_iter().find_map(counts).unwrap_or(0);
        let mut tables = Vec::new();
        for (key, json_key, components) in [
            (keys[0], "translation", 3),
            (keys[1], "rotation", 4),
            (keys[2], "scale", 3),
        ] {
            let Some(accessor) = index(attributes, key) else {
                continue;
            };
            match self.data.read(accessor, count) {
                Some(table) if table.components == components => tables.push((json_key, table)),
                _ => {
                    return Err(Error::input(
                        format!("{}: node {node} '{name}'", source.path.display()),
                        format!("the instances' {key} cannot be read"),
                        "save the room without EXT_mesh_gpu_instancing",
                    ));
                }
            }
        }
        let child = |instance: usize| {
            let mut child = json!({ "name": format!("{name} {instance}") });
            for (key, table) in &tables {
                let row = table.row(instance);
                child[*key] = match *key {
                    // Quantised rotations are not of unit length; a null one turns nothing.
                    "rotation" => {
                        let length = row.iter().map(|c| c * c).sum::<f64>().sqrt();
                        let unit = DQuat::from_slice(row) / length;
                        json!(if length > 0.0 { unit } else { DQuat::IDENTITY }.to_array())
                    }
                    _ => json!(row),
                };
            }
            child
        };
        Ok((0..count).map(child).collect())
    }
}

/// Sets or removes the node's mesh (and what only goes with one).
fn show(node: &mut Value, mesh: Option<usize>) {
    let Some(node) = node.as_object_mut() else {
        return;
    };
    match mesh {
        Some(mesh) => {
            node.insert("mesh".into(), json!(mesh));
        }
        None => {
            for key in ["mesh", "skin", "weights"] {
                node.shift_remove(key);
            }
        }
    }
}

fn add_child(nodes: &mut Vec<Value>, parent: usize, child: Value) -> usize {
    let place = nodes.len();
    let new = json!(place);
    nodes.push(child);
    match nodes[parent]
        .get_mut("children")
        .and_then(Value::as_array_mut)
    {
        Some(children) => children.push(new),
        None => nodes[parent]["children"] = json!([new]),
    }
    place
}
