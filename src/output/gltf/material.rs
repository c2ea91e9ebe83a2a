//! Baked materials: KHR_materials_unlit, base colour white times the paint's texture.
//!
//! The light in COLOR_0 already holds the base colour factor, the emission, and the measured reflectance where there
//! is one; only a texture that the light was divided by stays in the base colour. Alpha keeps working as in the input.
//! Nothing is `doubleSided`: each side is a primitive of its own.

use super::json::{extension, index, list};
use super::writer::Writer;
use crate::scene::Alpha;
use serde_json::{Value, json};

/// The extension that makes a viewer show COLOR_0 and nothing else.
const UNLIT: &str = "KHR_materials_unlit";

/// Roughness of viewers that do not know the extension, as its text recommends (no highlights).
const FALLBACK_ROUGHNESS: f64 = 0.9;

impl Writer<'_> {
    /// The output material for a scene material: in the place of the input's where nobody else needs that, else a copy.
    pub(super) fn unlit(&mut self, material: usize) -> usize {
        if let Some(&done) = self.materials.done.get(&material) {
            return done;
        }
        let place = self.scene.materials[material].index;
        let input = place
            .and_then(|i| list(&self.scene.source.json, "materials").get(i))
            .cloned();
        let baked = self.unlit_copy(material, input.unwrap_or_else(|| json!({})));
        let index = self.place_material(place, baked);
        self.materials.done.insert(material, index);
        index
    }

    /// Puts a material in the input's place where that is free, else at the end; its number.
    pub(super) fn place_material(&mut self, place: Option<usize>, baked: Value) -> usize {
        let out = self.json.entry("materials").or_insert_with(|| json!([]));
        // A document whose materials are no list has none; the importer refuses it long before.
        let Some(out) = out.as_array_mut() else {
            return 0;
        };
        let free = place.filter(|i| {
            *i < out.len() && !self.materials.kept.contains(i) && self.materials.taken.insert(*i)
        });
        match free {
            Some(index) => {
                out[index] = baked;
                index
            }
            None => {
                out.push(baked);
                out.len() - 1
            }
        }
    }

    pub(super) fn unlit_copy(&mut self, index: usize, mut json: Value) -> Value {
        let material = &self.scene.materials[index];
        if json.get("name").is_none() && !material.name.is_empty() {
            json["name"] = json!(material.name);
        }
        let pbr = &json["pbrMetallicRoughness"];
        let alpha = pbr
            .get("baseColorFactor")
            .and_then(|f| f.get(3))
            .and_then(Value::as_f64)
            .unwrap_or(1.0);
        let mut pbr = if pbr.is_object() {
            pbr.clone()
        } else {
            json!({})
        };
        pbr["baseColorFactor"] = json!([1.0, 1.0, 1.0, alpha]);
        pbr["metallicFactor"] = json!(0.0);
        pbr["roughnessFactor"] = json!(FALLBACK_ROUGHNESS);
        if material.paint.is_none()
            && let Some(texture) = pbr.get("baseColorTexture").cloned()
        {
            // The light was not divided by this texture. Its alpha may still cut holes.
            match &material.alpha {
                Alpha::Mask {
                    texture: Some(mask),
                    ..
                } => {
                    pbr["baseColorTexture"] = self.white_with_alpha(mask.image, texture);
                }
                _ => {
                    if let Some(pbr) = pbr.as_object_mut() {
                        pbr.shift_remove("baseColorTexture");
                    }
                }
            }
        }
        json["pbrMetallicRoughness"] = pbr;
        // The back of a two-sided surface is a primitive of its own, with its own light.
        if let Some(json) = json.as_object_mut() {
            json.shift_remove("doubleSided");
        }
        let mut extensions = json
            .get("extensions")
            .and_then(Value::as_object)
            .cloned()
            .unwrap_or_default();
        // Extensions of shading contradict unlit; all others are not ours to judge.
        extensions.retain(|name, _| !name.starts_with("KHR_materials_"));
        extensions.insert(UNLIT.into(), json!({}));
        json["extensions"] = Value::Object(extensions);
        json
    }

    /// Notes which input materials an unbaked primitive shows, by itself or by a variant.
    pub(super) fn keep_materials(&mut self, primitive: &Value) {
        self.materials.kept.extend(index(primitive, "material"));
        if let Some(variants) = extension(primitive, "KHR_materials_variants") {
            self.materials.kept.extend(
                list(variants, "mappings")
                    .iter()
                    .filter_map(|m| index(m, "material")),
            );
        }
    }
}
