//! What a document asks for and the program lacks, by the extensions in use.
//!
//! Known are the extensions that change the light. Nothing of them is worked out: each is named, with its materials.

use super::check::listed;
use super::json::short;
use serde_json::Value;
use std::collections::BTreeMap;

/// Something that a document asks for and the program lacks.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Lacking {
    /// The effect.
    pub effect: String,
    /// Extension and materials.
    pub reason: String,
}

/// Extensions that change the light and that the program lacks, with what they mean.
const LACKING: &[(&str, &str)] = &[
    ("EXT_lights_image_based", "sky"),
    ("EXT_lights_image_based_environment", "sky"),
    ("KHR_environment_map", "sky"),
    ("KHR_lights_environment", "sky"),
    ("KHR_materials_anisotropy", "gloss"),
    ("KHR_materials_clearcoat", "gloss (coat)"),
    ("KHR_materials_dispersion", "dispersion"),
    ("KHR_materials_iridescence", "iridescence"),
    ("KHR_materials_sheen", "sheen"),
    ("KHR_materials_specular", "gloss"),
    ("KHR_materials_subsurface", "light below the surface"),
    ("KHR_materials_volume_scatter", "scattering in volumes"),
    ("MSFT_lod", "levels of detail"),
];

/// What a document asks for and the program lacks: by the extensions in use, with the materials that carry them.
pub fn lacking(document: &Value) -> Vec<Lacking> {
    let mut carriers: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for name in document["extensionsUsed"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
    {
        carriers.entry(name).or_default();
    }
    for (index, material) in document["materials"]
        .as_array()
        .into_iter()
        .flatten()
        .enumerate()
    {
        let name = material["name"].as_str().filter(|n| !n.is_empty());
        let name = name.map_or_else(
            || format!("material {index}"),
            |n| format!("'{}'", short(n)),
        );
        for extension in material["extensions"]
            .as_object()
            .into_iter()
            .flat_map(|o| o.keys())
        {
            carriers.entry(extension).or_default().push(name.clone());
        }
    }
    let mut found = Vec::new();
    for (extension, materials) in carriers {
        if let Some((_, effect)) = LACKING.iter().find(|(name, _)| *name == extension) {
            let reason = match materials.is_empty() {
                true => extension.to_string(),
                false => format!("{extension} ({})", listed(&materials)),
            };
            found.push(Lacking {
                effect: effect.to_string(),
                reason,
            });
        }
    }
    found
}

/// The same as warnings.
pub(crate) fn warnings(document: &Value) -> Vec<String> {
    lacking(document)
        .into_iter()
        .map(|l| format!("{}: {} is left out", l.reason, l.effect))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_lacking_is_named_with_its_material() {
        let document = json!({
            "extensionsUsed": ["EXT_lights_image_based", "KHR_materials_unlit", "KHR_materials_clearcoat"],
            "materials": [{}, {"name": "glass", "extensions": {"KHR_materials_clearcoat": {}}},
                          {"extensions": {"KHR_materials_unlit": {}, "KHR_materials_sheen": {}}}],
        });
        let found: Vec<String> = lacking(&document)
            .iter()
            .map(|l| format!("{}: {}", l.effect, l.reason))
            .collect();
        assert_eq!(
            found,
            [
                "sky: EXT_lights_image_based",
                "gloss (coat): KHR_materials_clearcoat ('glass')",
                "sheen: KHR_materials_sheen (material 2)",
            ]
        );
    }
}
