//! What the file says about itself, and the file as bytes.

use super::json::{list, put_list};
use super::writer::{MapPart, Writer};
use crate::error::{Error, Result};
use serde_json::{Value, json};

/// Version of `asset.extras.haarlight`.
pub const EXTRAS_VERSION: u32 = 2;

/// A written room and what is to be said about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BakedGlb {
    /// The file.
    pub bytes: Vec<u8>,
    /// Vertices written with light.
    pub vertices: usize,
    /// Triangles written with light.
    pub triangles: usize,
    /// Vertices that were beyond white or outside of sRGB before the curve (lamps, spots beside them).
    pub clipped: usize,
    /// Vertices that the curve made darker, those beyond white among them.
    pub compressed: usize,
    /// What could not be carried over.
    pub warnings: Vec<String>,
    /// Primitives with light maps.
    pub parts: Vec<MapPart>,
}

impl Writer<'_> {
    /// What the file says about itself.
    pub(super) fn asset(&mut self) {
        let mut facts = json!({
            "version": EXTRAS_VERSION,
            "program": concat!("haarlight ", env!("CARGO_PKG_VERSION")),
            "exposure": {
                "scale": self.look.scale,
                "ev100": self.look.ev(),
                "white_luminance_cd_m2": self.look.white_luminance(),
                "white_balance": self.look.balance,
            },
            "attributes": {
                "COLOR_0": "linear sRGB, radiosity over base colour texture, times exposure.white_balance and exposure.scale; a strongest channel p above 0.8 is brought to 1 - 0.04 / (p - 0.6) and the colour mixed with white",
            },
            "clipped_vertices": self.clipped,
            "compressed_vertices": self.compressed,
        });
        if let Some(intensity) = self.maps.intensity() {
            facts["attributes"] = json!({
                "MOZ_lightmap": "linear; texel * intensity / pi * base colour * texture * vertex colour = exposed radiosity, ends at 1",
                "emissiveTexture": "sRGB; the same over the texture and vertex colours, as COLOR_0 would show it: for readers without KHR_materials_unlit",
            });
            facts["intensity"] = json!(intensity);
        }
        if let Some(layers) = self.layer_facts() {
            let what = "linear sRGB, light of one layer: COLOR_0 = curve(layers.scale * sum), the curve as above";
            facts["attributes"]["COLOR_1, ..."] = json!(what);
            facts["layers"] = layers;
        }
        if self.writing.xyz {
            let what = "CIE 1931 tristimulus radiosity, lm/m2, not clipped";
            facts["attributes"]["_XYZ"] = json!(what);
        }
        let asset = self.json.entry("asset").or_insert_with(|| json!({}));
        let Some(asset) = asset.as_object_mut() else {
            return;
        };
        asset.entry("version").or_insert_with(|| json!("2.0"));
        asset
            .entry("generator")
            .or_insert_with(|| json!(concat!("haarlight ", env!("CARGO_PKG_VERSION"))));
        match asset.get_mut("extras") {
            Some(Value::Object(extras)) => {
                extras.insert("haarlight".into(), facts);
            }
            // Extras may be anything; what is not an object moves aside.
            Some(other) => *other = json!({ "haarlight": facts, "original": other.take() }),
            None => {
                asset.insert("extras".into(), json!({ "haarlight": facts }));
            }
        }
    }

    pub(super) fn finish(mut self) -> Result<BakedGlb> {
        let (bytes, buffers, views, accessors) = self.bin.finish()?;
        let lists = [
            ("buffers", buffers),
            ("bufferViews", views),
            ("accessors", accessors),
        ];
        for (key, list) in lists {
            put_list(&mut self.json, key, list);
        }
        for name in self.bin.extensions() {
            for key in ["extensionsUsed", "extensionsRequired"] {
                let mut names = list(&Value::Object(self.json.clone()), key).to_vec();
                if !names.iter().any(|n| n == name) {
                    names.push(json!(name));
                    put_list(&mut self.json, key, names);
                }
            }
        }
        let json = serde_json::to_vec(&Value::Object(self.json))
            .map_err(|problem| Error::Internal(format!("glTF JSON: {problem}")))?;
        Ok(BakedGlb {
            bytes: container(json, bytes)?,
            vertices: self.vertices,
            triangles: self.triangles,
            clipped: self.clipped,
            compressed: self.compressed,
            warnings: self.warnings,
            parts: self.maps.parts,
        })
    }
}

/// GLB container (glTF 2.0, section 4.4): header, JSON chunk padded with spaces, BIN chunk padded with zeros.
fn container(mut json: Vec<u8>, mut bin: Vec<u8>) -> Result<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let bin_chunk = if bin.is_empty() { 0 } else { 8 + bin.len() };
    let length = 12 + 8 + json.len() + bin_chunk;
    let Ok(total) = u32::try_from(length) else {
        return Err(Error::input(
            "output",
            format!("the baked room takes {length} bytes and a GLB holds at most 4 GiB"),
            "ask for a larger --error",
        ));
    };
    // Chunks are shorter than the whole, so they fit as well.
    let size = |chunk: &[u8]| (chunk.len() as u32).to_le_bytes();
    let mut out = Vec::with_capacity(length);
    out.extend(b"glTF");
    out.extend(2u32.to_le_bytes());
    out.extend(total.to_le_bytes());
    out.extend(size(&json));
    out.extend(b"JSON");
    out.extend(&json);
    if !bin.is_empty() {
        out.extend(size(&bin));
        out.extend(b"BIN\0");
        out.extend(&bin);
    }
    Ok(out)
}
