//! Materials and punctual lights as the document gives them, typed and with the defaults of the standards filled in
//! (glTF 2.0 section 3.9, KHR_lights_punctual, KHR_materials_emissive_strength, KHR_materials_unlit).
//!
//! Units are glTF's: emissive strength in nits, point and spot in candela, directional in lux. What they mean as
//! spectra is decided elsewhere.

use crate::scene::Texture;
use crate::scene::check::Check;
use crate::scene::json::{self, Item, double};
use crate::scene::luminaires::{IesNode, ies_node};
use crate::scene::nodes::PlacedNode;
use crate::scene::texture_info::Slots;
use glam::DMat4;
use gltf::json::extensions::material::{
    EmissiveStrength, Ior, PbrSpecularGlossiness, Transmission, Unlit, Volume,
};
use gltf::json::extensions::scene::khr_lights_punctual::{KhrLightsPunctual, Light, Type};
pub use gltf::json::material::AlphaMode;
use gltf::json::material::Material;
use gltf::json::validation::Checked::{Invalid, Valid};
use serde::Deserialize;
use serde_json::Value;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

/// A material, before spectra.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RawMaterial {
    /// Index in the document; none for glTF's default material.
    pub index: Option<usize>,
    /// Its name; empty if it has none.
    pub name: String,
    /// Linear, each in [0, 1].
    pub base_color_factor: [f32; 4],
    /// Multiplies the base colour.
    pub base_color_texture: Option<Texture>,
    /// In [0, 1].
    pub metallic: f32,
    /// Linear, each in [0, 1].
    pub emissive_factor: [f32; 3],
    /// Nits at emissive factor 1; 1 without KHR_materials_emissive_strength.
    pub emissive_strength: f32,
    /// Multiplies the emissive factor.
    pub emissive_texture: Option<Texture>,
    /// How alpha is meant.
    pub alpha_mode: AlphaMode,
    /// Threshold of [`AlphaMode::Mask`].
    pub alpha_cutoff: f32,
    /// Does the back count too?
    pub double_sided: bool,
    /// KHR_materials_unlit is there.
    pub unlit: bool,
    /// Share that is let through, of KHR_materials_transmission.
    pub transmission: Option<f64>,
    /// Multiplies it (red).
    pub transmission_texture: Option<Texture>,
    /// KHR_materials_diffuse_transmission.
    pub sheet: Option<RawSheet>,
    /// Refractive index of KHR_materials_ior.
    pub ior: Option<f64>,
    /// KHR_materials_volume.
    pub volume: Option<RawVolume>,
    /// Roughness, if it is said.
    pub roughness: Option<f32>,
    /// Texture that multiplies metallic and roughness, of what their factors make a mirror, of panes and of diffuse sheets.
    pub metal_texture: Option<Texture>,
    /// Is there one, read or not?
    pub has_metal_texture: bool,
    /// The material's extras.
    pub extras: Option<Value>,
    /// Names of all extensions on the material, sorted.
    pub extensions: Vec<String>,
}

impl Default for RawMaterial {
    /// The material of a primitive that names none.
    fn default() -> Self {
        Self {
            index: None,
            name: String::new(),
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic: 1.0,
            emissive_factor: [0.0; 3],
            emissive_strength: 1.0,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            alpha_cutoff: 0.5,
            double_sided: false,
            unlit: false,
            transmission: None,
            transmission_texture: None,
            sheet: None,
            ior: None,
            volume: None,
            roughness: None,
            metal_texture: None,
            has_metal_texture: false,
            extras: None,
            extensions: Vec::new(),
        }
    }
}

/// Metals smoother than this are mirrors: GGX of alpha = roughness^2 = .01 has half its light within 1 degree of the mirrored
/// direction.
const SMOOTH: f32 = 0.1;
const SHEET: &str = "KHR_materials_diffuse_transmission";
const PANE: &str = "KHR_materials_transmission";
const METAL_TEXTURE: &str = "metallicRoughnessTexture";
/// Metallic from here on is a metal: bytes round 1 to no less.
pub(super) const METAL: f32 = 0.995;

impl RawMaterial {
    /// Do its factors make it a mirror?
    pub(super) fn is_smooth_metal(&self) -> bool {
        self.metallic >= METAL && self.roughness.unwrap_or(1.0) < SMOOTH
    }
}

/// KHR_materials_volume.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct RawVolume {
    /// Thickness below the surface, the file's units; 0: none.
    pub thickness: f64,
    /// Distance over which white light becomes `colour`, the file's units; none: it never does.
    pub distance: Option<f64>,
    /// Linear, each in [0, 1].
    pub colour: [f32; 3],
}

/// KHR_materials_diffuse_transmission.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RawSheet {
    /// Share that is let through instead of reflected, in [0, 1].
    pub strength: f32,
    /// Multiplies the strength (alpha).
    pub strength_texture: Option<Texture>,
    /// Linear, each in [0, 1].
    pub color: [f32; 3],
    /// Multiplies the colour.
    pub color_texture: Option<Texture>,
}

/// The extension's numbers, with its defaults.
#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct DiffuseTransmission {
    diffuse_transmission_factor: f32,
    diffuse_transmission_color_factor: [f32; 3],
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_color_factor: [1.0; 3],
        }
    }
}

/// A punctual light at a node, before spectra.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RawLight {
    /// The light's name, or the node's if it has none.
    pub name: String,
    /// Kind of light.
    pub kind: RawLightKind,
    /// Linear, each in [0, 1].
    pub color: [f32; 3],
    /// Candela (point, spot) or lux (directional).
    pub intensity: f32,
    /// Distance beyond which it gives nothing, in the file's units; none: endless.
    pub range: Option<f32>,
    /// Half angle of full intensity, radians (spot).
    pub inner: f32,
    /// Half angle where the light ends, radians, greater than `inner` (spot).
    pub outer: f32,
    /// The light's extras.
    pub extras: Option<Value>,
    /// Index of the node in the document.
    pub node: usize,
    /// Node to world; the light shines along -Z of its own space.
    pub to_world: DMat4,
    /// EXT_lights_ies of its node.
    pub ies: Option<IesNode>,
}

/// `type` of a punctual light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RawLightKind {
    /// Alike in all directions.
    Point,
    /// A cone.
    Spot,
    /// Parallel.
    Directional,
    /// As a profile of EXT_lights_ies says.
    Profile,
}

/// All materials of the document; after them the default one if some primitive names none.
pub(crate) fn materials(json: &Value, slots: &mut Slots, check: &mut Check) -> Vec<RawMaterial> {
    let mut materials = Vec::new();
    for index in 0..json::len(json, "materials") {
        if let Some(item) = json::item(json, "materials", "material", index) {
            materials.push(material(json, index, &item, slots, check));
        } else {
            let place = format!("material {index}");
            check.problem(&place, "is not an object", "export the file again");
            // Keeps the indices in step.
            materials.push(RawMaterial::default());
        }
    }
    if some_primitive_has_none(json) {
        materials.push(RawMaterial::default());
    }
    materials
}

fn some_primitive_has_none(json: &Value) -> bool {
    let meshes = json.get("meshes").and_then(Value::as_array);
    let primitives = meshes
        .into_iter()
        .flatten()
        .filter_map(|mesh| mesh.get("primitives")?.as_array());
    primitives.flatten().any(|p| p.get("material").is_none())
}

fn material(
    json: &Value,
    index: usize,
    item: &Item<'_>,
    slots: &mut Slots,
    check: &mut Check,
) -> RawMaterial {
    let given = item.read::<Material>(check).unwrap_or_default();
    let mut out = RawMaterial {
        index: Some(index),
        name: item.name().to_owned(),
        alpha_cutoff: given.alpha_cutoff.unwrap_or_default().0.max(0.0),
        double_sided: given.double_sided,
        unlit: (item.extension::<Unlit>("KHR_materials_unlit", check)).is_some(),
        extras: item.map.get("extras").cloned(),
        extensions: item.extension_names(),
        ..RawMaterial::default()
    };
    if let Some(pbr) = item.child("pbrMetallicRoughness", check) {
        let values = given.pbr_metallic_roughness;
        let factor = values.base_color_factor.0;
        out.base_color_factor = factor.map(|x| unit(x, "baseColorFactor", item, check));
        out.metallic = unit(values.metallic_factor.0, "metallicFactor", item, check);
        let rough = unit(values.roughness_factor.0, "roughnessFactor", item, check);
        out.roughness = pbr.has("roughnessFactor").then_some(rough);
        out.has_metal_texture = pbr.has(METAL_TEXTURE);
        let mut names = out.extensions.iter();
        let passes = names.any(|name| name == SHEET || name == PANE);
        if out.is_smooth_metal() || passes && out.metallic > 0.0 {
            out.metal_texture = slots.texture(json, &pbr, METAL_TEXTURE, check);
        }
        out.base_color_texture = slots.texture(json, &pbr, "baseColorTexture", check);
    }
    const DIFFUSE: &str = "KHR_materials_pbrSpecularGlossiness";
    if let Some(diffuse) = item.extended(DIFFUSE, check) {
        // Its diffuse part is all that a Lambertian surface has; glTF prefers it to the fallback beside it.
        let values = item.extension::<PbrSpecularGlossiness>(DIFFUSE, check);
        let factor = values.unwrap_or_default().diffuse_factor.0;
        out.base_color_factor = factor.map(|x| unit(x, "diffuseFactor", item, check));
        out.metallic = 0.0;
        out.base_color_texture = slots.texture(json, &diffuse, "diffuseTexture", check);
    }
    out.emissive_texture = slots.texture(json, item, "emissiveTexture", check);
    emission(item, given.emissive_factor.0, &mut out, check);
    transmission(json, item, &mut out, slots, check);
    out.sheet = sheet(json, item, slots, check);
    match given.alpha_mode {
        Valid(mode) => out.alpha_mode = mode,
        Invalid => {
            let what = format!("has the alphaMode '{}'", item.said("alphaMode"));
            let next = "use OPAQUE, MASK or BLEND";
            check.problem(&item.place, what, next);
        }
    }
    out
}

/// Emissive factor and strength. Exporters from before the extension wrote factors above 1; the excess is strength.
fn emission(item: &Item<'_>, factor: [f32; 3], out: &mut RawMaterial, check: &mut Check) {
    let strength = item.extension::<EmissiveStrength>("KHR_materials_emissive_strength", check);
    let mut strength = double(strength.unwrap_or_default().emissive_strength.0);
    let mut factor = factor.map(double);
    if strength < 0.0 || factor.iter().any(|&x| x < 0.0) {
        check.warn(format!(
            "{}: negative emission is taken as none",
            item.place
        ));
        strength = strength.max(0.0);
        factor = factor.map(|x| x.max(0.0));
    }
    let most = factor.into_iter().fold(1.0, f64::max);
    if most > 1.0 {
        let text = "emissiveFactor is above 1; the excess is taken as emissive strength";
        check.warn(format!("{}: {text}", item.place));
    }
    let brightest = (strength * most) as f32;
    if !brightest.is_finite() {
        let what = "gives out more light than a number holds";
        check.problem(&item.place, what, "lower it");
        return;
    }
    out.emissive_factor = factor.map(|x| (x / most) as f32);
    out.emissive_strength = brightest;
}

/// KHR_materials_transmission, _volume and _ior.
fn transmission(
    json: &Value,
    item: &Item<'_>,
    out: &mut RawMaterial,
    slots: &mut Slots,
    check: &mut Check,
) {
    if let Some(pane) = item.extended(PANE, check) {
        let values = item.extension::<Transmission>(PANE, check);
        let factor = values.unwrap_or_default().transmission_factor.0;
        out.transmission = Some(f64::from(unit(factor, "transmissionFactor", item, check)));
        out.transmission_texture = slots.texture(json, &pane, "transmissionTexture", check);
    }
    let ior = item.extension::<Ior>("KHR_materials_ior", check);
    out.ior = ior.map(|ior| double(ior.ior.0));
    let Some(volume) = item.extension::<Volume>("KHR_materials_volume", check) else {
        return;
    };
    let thickness = double(volume.thickness_factor.0);
    let distance = double(volume.attenuation_distance.0);
    // Written so that what a number does not hold fails.
    if !(0.0..f64::INFINITY).contains(&thickness) || distance <= 0.0 {
        let what =
            "KHR_materials_volume has a negative thickness, or a distance that is not positive";
        match out.transmission {
            Some(_) => check.problem(&item.place, what, "mend the material and export again"),
            None => check.warn(format!("{}: {what}: it is passed over", item.place)),
        }
        return;
    }
    let colour = volume.attenuation_color.0;
    out.volume = Some(RawVolume {
        thickness,
        distance: Some(distance).filter(|distance| distance.is_finite()),
        colour: colour.map(|x| unit(x, "attenuationColor", item, check)),
    });
}

/// KHR_materials_diffuse_transmission.
fn sheet(json: &Value, item: &Item<'_>, slots: &mut Slots, check: &mut Check) -> Option<RawSheet> {
    let sheet = item.extended(SHEET, check)?;
    let values = item.extension::<DiffuseTransmission>(SHEET, check)?;
    let factor = values.diffuse_transmission_factor;
    let color = values.diffuse_transmission_color_factor;
    Some(RawSheet {
        strength: unit(factor, "diffuseTransmissionFactor", item, check),
        strength_texture: slots.texture(json, &sheet, "diffuseTransmissionTexture", check),
        color: color.map(|x| unit(x, "diffuseTransmissionColorFactor", item, check)),
        color_texture: slots.texture(json, &sheet, "diffuseTransmissionColorTexture", check),
    })
}

/// Brought into [0, 1], with a warning.
fn unit(value: f32, key: &str, item: &Item<'_>, check: &mut Check) -> f32 {
    if !(0.0..=1.0).contains(&value) {
        check.warn(format!(
            "{}: {key} {value} is brought into 0 to 1",
            item.place
        ));
    }
    value.clamp(0.0, 1.0)
}

/// Bytes of names and extras that all lights together may carry.
const MAX_CARRIED: usize = 1 << 26;

/// About how many bytes a JSON value takes.
fn weight(value: &Value) -> usize {
    let inside = match value {
        Value::String(text) => text.len(),
        Value::Array(list) => list.iter().map(weight).sum(),
        Value::Object(map) => map.iter().map(|(key, v)| key.len() + weight(v)).sum(),
        _ => 0,
    };
    inside + size_of::<Value>()
}

/// The punctual lights at the nodes of the scene.
pub(crate) fn lights(json: &Value, placed: &[PlacedNode], check: &mut Check) -> Vec<RawLight> {
    const NAME: &str = "KHR_lights_punctual";
    let table = json.get("extensions").and_then(|e| e.get(NAME));
    let nothing = Value::Null;
    let table = table.unwrap_or(&nothing);
    let mut lights = Vec::new();
    let mut carried = 0usize;
    for place in placed {
        let Some(node) = json::item(json, "nodes", "node", place.node) else {
            continue;
        };
        let index = node.extension::<KhrLightsPunctual>(NAME, check);
        let index = index.map(|of| of.light.value());
        let ies = ies_node(json, &node, check);
        let light = match (index, ies) {
            (Some(index), ies) => {
                let item = json::referred(table, "lights", "light", index, &node.place, check);
                let light = item.and_then(|item| light(&item, &node, place, check));
                light.map(|light| RawLight { ies, ..light })
            }
            (None, Some(ies)) => Some(measured(ies, &node, place)),
            (None, None) => None,
        };
        let Some(light) = light else { continue };
        // Every node gets a copy of its light's name and extras.
        carried += light.name.len() + light.extras.as_ref().map_or(0, weight);
        if carried > MAX_CARRIED {
            let what = "the names and extras of the lights are too large for so many nodes";
            check.problem("", what, "shorten the extras of the lights");
            return Vec::new();
        }
        lights.push(light);
    }
    lights
}

/// A light that only EXT_lights_ies describes.
fn measured(ies: IesNode, node: &Item<'_>, placed: &PlacedNode) -> RawLight {
    let name = if ies.name.is_empty() {
        node.name()
    } else {
        &ies.name
    };
    RawLight {
        name: name.to_owned(),
        kind: RawLightKind::Profile,
        color: [1.0; 3],
        intensity: 1.0,
        range: None,
        inner: 0.0,
        outer: 0.0,
        extras: None,
        node: placed.node,
        to_world: placed.to_world,
        ies: Some(ies),
    }
}

fn light(
    item: &Item<'_>,
    node: &Item<'_>,
    placed: &PlacedNode,
    check: &mut Check,
) -> Option<RawLight> {
    let given = item.read::<Light>(check)?;
    let kind = match given.type_ {
        Valid(Type::Point) => RawLightKind::Point,
        Valid(Type::Spot) => RawLightKind::Spot,
        Valid(Type::Directional) => RawLightKind::Directional,
        Invalid => {
            check.warn(format!(
                "{}: lights of type '{}' give no light here",
                item.place,
                item.said("type")
            ));
            return None;
        }
    };
    let (inner, outer) = given.spot.map_or((0.0, FRAC_PI_4), |spot| {
        (spot.inner_cone_angle, spot.outer_cone_angle)
    });
    let straight = FRAC_PI_2 + 1e-6;
    if kind == RawLightKind::Spot && !(0.0 <= inner && inner < outer && outer <= straight) {
        let what = format!("has a cone from {inner} to {outer} radians");
        let next = "keep 0 <= innerConeAngle < outerConeAngle <= pi / 2";
        check.problem(&item.place, what, next);
    }
    let Light {
        color,
        intensity,
        range,
        ..
    } = given;
    if intensity < 0.0 || color.iter().any(|&x| x < 0.0) || range.is_some_and(|r| r <= 0.0) {
        let what = "has a negative colour or intensity, or a range that is not positive";
        check.problem(&item.place, what, "mend the light and export again");
    }
    let names = [item.name(), node.name()];
    let name = names.into_iter().find(|name| !name.is_empty());
    let mut light = RawLight {
        name: name.unwrap_or_default().to_owned(),
        kind,
        color,
        intensity,
        range,
        inner,
        outer,
        extras: item.map.get("extras").cloned(),
        node: placed.node,
        to_world: placed.to_world,
        ies: None,
    };
    let sum = light.intensity + light.color.iter().sum::<f32>();
    if !sum.is_finite() {
        check.problem(&item.place, "is brighter than a number holds", "lower it");
        light.intensity = 0.0;
    }
    Some(light)
}
