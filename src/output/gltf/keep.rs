//! Carrying over what the bake does not touch: accessors of points, lines, animations and skins, raw buffer views of
//! unknown extensions; and the lists of extensions brought in line with what is left.
//!
//! Data is copied without the gaps and neighbours of its old view, so nothing of the replaced meshes is dragged along.

use super::accessor::ElementLayout;
use super::buffer::Use;
use super::json::{extension, index, list};
use super::writer::Writer;
use crate::scene::buffers::Span;
use serde_json::{Map, Value, json};

/// Vertex strides are multiples of four (glTF 2.0, section 3.6.2.4).
const STRIDE: usize = 4;

/// Extensions that the writer dissolves.
const DISSOLVED: [&str; 3] = [
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
];

/// What an accessor is for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Vertices,
    Indices,
    Data,
}

impl Writer<'_> {
    /// Copies an accessor with its data, once; returns its new index.
    pub(super) fn keep_accessor(&mut self, old: usize, role: Role) -> usize {
        if let Some(&new) = self.accessors.get(&old) {
            return new;
        }
        let source = &self.scene.source;
        let mut accessor = list(&source.json, "accessors")
            .get(old)
            .cloned()
            .unwrap_or_else(|| json!({}));
        let layout = ElementLayout::of(&accessor);
        let count = index(&accessor, "count").unwrap_or(0);
        let bytes = layout
            .zip(index(&accessor, "bufferView"))
            .and_then(|(layout, view)| {
                self.data.packed(
                    view,
                    index(&accessor, "byteOffset").unwrap_or(0),
                    layout.size,
                    count,
                )
            });
        if bytes.is_none() && accessor.get("bufferView").is_some() {
            self.warnings.push(format!(
                "accessor {old} cannot be read; the baked room has zeros for it"
            ));
        }
        if let Some(object) = accessor.as_object_mut() {
            object.shift_remove("byteOffset");
            object.shift_remove("bufferView");
        }
        if let Some((bytes, layout)) = bytes.zip(layout) {
            let view = match role {
                Role::Vertices => {
                    let stride = layout.size.next_multiple_of(STRIDE);
                    let mut padded = Vec::with_capacity(count * stride);
                    for element in bytes.chunks(layout.size) {
                        padded.extend_from_slice(element);
                        padded.resize(padded.len().next_multiple_of(STRIDE), 0);
                    }
                    self.bin.view(&padded, Use::Vertices { stride })
                }
                Role::Indices => self.bin.view(&bytes, Use::Indices),
                Role::Data => self.bin.view(&bytes, Use::Data),
            };
            accessor["bufferView"] = json!(view);
        }
        self.keep_sparse(&mut accessor, layout);
        let new = self.bin.accessor(accessor);
        self.accessors.insert(old, new);
        new
    }

    fn keep_sparse(&mut self, accessor: &mut Value, layout: Option<ElementLayout>) {
        let (Some(sparse), Some(layout)) = (accessor.get_mut("sparse"), layout) else {
            return;
        };
        let count = index(sparse, "count").unwrap_or(0);
        let index_size = match sparse["indices"]["componentType"].as_u64() {
            Some(5121) => 1,
            Some(5123) => 2,
            _ => 4,
        };
        for (key, size) in [("indices", index_size), ("values", layout.size)] {
            let part = &sparse[key];
            let offset = index(part, "byteOffset").unwrap_or(0);
            let bytes = index(part, "bufferView")
                .and_then(|view| self.data.packed(view, offset, size, count))
                .unwrap_or_else(|| vec![0; count.min(1) * size]);
            sparse[key]["bufferView"] = json!(self.bin.view(&bytes, Use::Data));
            sparse[key]["byteOffset"] = json!(0);
        }
    }

    /// Key frames; channels that move morph targets of baked meshes go, for the targets are gone.
    pub(super) fn animations(&mut self) {
        let morphs = |node: Option<usize>| !node.is_some_and(|node| self.is_baked(node));
        let mut animations = list(&self.scene.source.json, "animations").to_vec();
        for animation in &mut animations {
            if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
                channels.retain(|channel| {
                    let target = &channel["target"];
                    target["path"] != "weights" || morphs(index(target, "node"))
                });
            }
        }
        animations.retain(|animation| !list(animation, "channels").is_empty());
        for sampler in animations
            .iter_mut()
            .filter_map(|a| a["samplers"].as_array_mut())
            .flatten()
        {
            for key in ["input", "output"] {
                if let Some(old) = index(sampler, key) {
                    sampler[key] = json!(self.keep_accessor(old, Role::Data));
                }
            }
        }
        super::json::put_list(&mut self.json, "animations", animations);
    }

    /// Skins, and the instances of unbaked meshes.
    pub(super) fn other_accessors(&mut self) {
        let mut skins = list(&self.scene.source.json, "skins").to_vec();
        for skin in &mut skins {
            if let Some(old) = index(skin, "inverseBindMatrices") {
                skin["inverseBindMatrices"] = json!(self.keep_accessor(old, Role::Data));
            }
        }
        super::json::put_list(&mut self.json, "skins", skins);
        let mut nodes = self
            .json
            .get("nodes")
            .and_then(Value::as_array)
            .cloned()
            .unwrap_or_default();
        for node in &mut nodes {
            if extension(node, "EXT_mesh_gpu_instancing").is_none() {
                continue;
            }
            let attributes = &mut node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
            for (_, accessor) in attributes.as_object_mut().into_iter().flatten() {
                if let Some(old) = accessor.as_u64().and_then(|a| usize::try_from(a).ok()) {
                    *accessor = json!(self.keep_accessor(old, Role::Data));
                }
            }
        }
        super::json::put_list(&mut self.json, "nodes", nodes);
    }

    /// Copies what anything but accessors names by buffer view (images, unknown extensions).
    pub(super) fn raw_views(&mut self) {
        // These lists are written anew, from the input's.
        for key in ["accessors", "bufferViews", "nodes", "meshes"] {
            if let Some(list) = self.json.get_mut(key) {
                list.take();
            }
        }
        let mut json = Value::Object(std::mem::take(&mut self.json));
        self.move_views(&mut json);
        if let Value::Object(json) = json {
            self.json = json;
        }
    }

    /// Copies every view named by a `bufferView` key (images, unknown extensions) and renames it.
    pub(super) fn move_views(&mut self, json: &mut Value) {
        match json {
            Value::Array(items) => items.iter_mut().for_each(|item| self.move_views(item)),
            Value::Object(object) => {
                for (key, value) in object.iter_mut().filter(|(key, _)| *key != "extras") {
                    match value.as_u64().and_then(|v| usize::try_from(v).ok()) {
                        Some(old) if key == "bufferView" => {
                            let view = self.data.view(old);
                            let bytes = view.as_ref().map(Span::bytes);
                            *value = json!(self.bin.view(bytes.unwrap_or(&[0]), Use::Data));
                        }
                        _ => self.move_views(value),
                    }
                }
            }
            _ => {}
        }
    }

    /// `extensionsUsed` and `extensionsRequired`: the input's, less what is dissolved or gone, plus unlit.
    pub(super) fn extensions(&mut self) {
        let mut before = Vec::new();
        names(&self.scene.source.json, &mut before);
        let json = Value::Object(std::mem::take(&mut self.json));
        let mut after = Vec::new();
        names(&json, &mut after);
        if let Value::Object(json) = json {
            self.json = json;
        }
        let quantized = self.quantized;
        let stays = |name: &str| match name {
            _ if DISSOLVED.contains(&name) => false,
            "KHR_mesh_quantization" => quantized,
            // Some extensions never show up as an object: those stay as listed.
            _ => !before.iter().any(|b| b == name) || after.iter().any(|a| a == name),
        };
        for key in ["extensionsUsed", "extensionsRequired"] {
            let mut kept: Vec<Value> = list(&self.scene.source.json, key).to_vec();
            kept.retain(|name| name.as_str().is_some_and(stays));
            if key == "extensionsUsed" {
                let missing = after
                    .iter()
                    .filter(|name| !kept.iter().any(|k| k.as_str() == Some(name)));
                let missing: Vec<Value> = missing.map(|name| json!(name)).collect();
                kept.extend(missing);
            }
            super::json::put_list(&mut self.json, key, kept);
        }
    }
}

/// Names of all extension objects in a document, each once, in order of appearance.
fn names(json: &Value, found: &mut Vec<String>) {
    match json {
        Value::Array(items) => items.iter().for_each(|item| names(item, found)),
        Value::Object(object) => {
            let extensions = object.get("extensions").and_then(Value::as_object);
            for name in extensions.into_iter().flat_map(Map::keys) {
                if !found.contains(name) {
                    found.push(name.clone());
                }
            }
            object
                .iter()
                .filter(|(key, _)| *key != "extras")
                .for_each(|(_, value)| names(value, found));
        }
        _ => {}
    }
}
