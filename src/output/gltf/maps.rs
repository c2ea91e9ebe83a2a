//! Light maps in the glb: MOZ_lightmap on unlit materials, and what readers without the unlit extension show.
//!
//! A viewer shows `base colour * texel * intensity / pi`, as three.js' lightMap and the extension's own viewers do: texels are irradiance
//! in units of `intensity`. Here `base * irradiance / pi` times `pi * scale` is the exposed radiosity, so
//! `texel * intensity = pi * shown(light) / base`, where `light` is the radiosity over texture and vertex colours: colours are
//! those of the spectra, whatever the base colour in the file. Pages are PNG of 16 bits, linear, without negative numbers, and
//! end at `MOST` times what shows as white on a white surface.
//! The emissive slot holds the light as it shows on the mean of the paint's texture, in sRGB: unlit viewers ignore it, the others need it.

use super::buffer::Use;
use super::json::list;
use super::writer::Writer;
use crate::color::encode;
use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::lightmap::{LightMaps, MapPage, Texel};
use crate::output::curve;
use glam::Vec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// The extension's name.
const LIGHTMAP: &str = "MOZ_lightmap";
/// Light up to this many times what makes a white surface white is kept: grey surfaces of a quarter of it are white then.
const MOST: f64 = 4.0;
/// Base colours below this are black: what times them should show the light is taken from white.
const BLACK: f64 = 1.0 / 255.0;

impl Writer<'_> {
    /// Adds the pages' images and textures.
    pub(super) fn pages(&mut self, maps: &LightMaps) -> Result<()> {
        // CLAMP_TO_EDGE and LINEAR: what a texel shows between centres is what the error is measured of.
        let sampler =
            json!({ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 });
        let sampler = self.append("samplers", sampler);
        let bases = self.bases();
        let light = |page: &MapPage| -> Vec<[f64; 3]> {
            let shown = |(texel, surface): (&Texel, &u32)| {
                let base = bases.get(*surface as usize).copied().unwrap_or([1.0; 3]);
                let light = self.look.shown(texel.light.map(f64::from));
                [0, 1, 2].map(|c| (light[c] / base[c]).max(0.0))
            };
            page.texels.iter().zip(&page.surfaces).map(shown).collect()
        };
        let pages: Vec<Vec<[f64; 3]>> = maps.pages.iter().map(light).collect();
        let brightest = pages
            .iter()
            .flatten()
            .flatten()
            .copied()
            .fold(0.0, f64::max);
        let range = if brightest > 0.0 {
            brightest.min(MOST)
        } else {
            1.0
        };
        self.maps.intensity = PI * range;
        for (k, (page, light)) in maps.pages.iter().zip(pages).enumerate() {
            let linear = light.iter().flatten().map(|c| (c / range).min(1.0));
            let linear: Vec<u8> = (linear.map(|c| (c * 65535.0).round() as u16))
                .flat_map(u16::to_ne_bytes)
                .collect();
            let shown = |t: &Texel| curve::into_display(self.look.shown(t.light.map(f64::from)));
            let shown: Vec<u8> = (page.texels.iter().flat_map(shown))
                .map(|c| (encode(c) * 255.0).round() as u8)
                .collect();
            let both = [
                (linear, ExtendedColorType::Rgb16, "light"),
                (shown, ExtendedColorType::Rgb8, "shown"),
            ];
            let mut textures = [0; 2];
            for (texture, (bytes, kind, what)) in textures.iter_mut().zip(both) {
                let bytes = png(&bytes, page, kind)?;
                let view = self.bin.view(&bytes, Use::Data);
                let name = format!("light map {k} ({what})");
                let image = json!({ "name": name, "bufferView": view, "mimeType": "image/png" });
                let image = self.append("images", image);
                *texture = self.append("textures", json!({ "sampler": sampler, "source": image }));
            }
            self.maps.textures.push(textures);
        }
        Ok(())
    }

    /// Base colour in the file of each surface, as a viewer multiplies it; what is black counts as white.
    fn bases(&self) -> Vec<[f64; 3]> {
        let materials = list(&self.scene.source.json, "materials");
        let base = |material: usize| {
            let json = self.scene.materials[material]
                .index
                .and_then(|i| materials.get(i));
            let factor = json.map(|json| &json["pbrMetallicRoughness"]["baseColorFactor"]);
            [0, 1, 2].map(|c| {
                let value = factor
                    .and_then(|f| f.get(c))
                    .and_then(Value::as_f64)
                    .unwrap_or(1.0);
                if value > BLACK { value } else { 1.0 }
            })
        };
        let surfaces = self.scene.surfaces.iter();
        surfaces.map(|surface| base(surface.material)).collect()
    }

    /// The set of texture coordinates for the map: the first that is free, but not 0, for engines look in 1 at the earliest.
    pub(super) fn free_set(primitive: &Value) -> usize {
        let has = |n: &usize| {
            primitive["attributes"]
                .get(format!("TEXCOORD_{n}"))
                .is_some()
        };
        (1..).find(|n| !has(n)).unwrap_or(1)
    }

    /// The output material of a surface on a page.
    pub(super) fn mapped(&mut self, material: usize, page: usize, set: usize) -> usize {
        if let Some(&done) = self.maps.materials.get(&(material, page, set)) {
            return done;
        }
        let place = self.scene.materials[material].index;
        let materials = list(&self.scene.source.json, "materials");
        let input = place
            .and_then(|i| materials.get(i))
            .cloned()
            .unwrap_or_else(|| json!({}));
        let base = input["pbrMetallicRoughness"]
            .get("baseColorFactor")
            .cloned();
        let mut json = self.unlit_copy(material, input);
        if let Some(base) = base {
            json["pbrMetallicRoughness"]["baseColorFactor"] = base;
        }
        let [light, shown] = self.maps.textures[page];
        json["extensions"][LIGHTMAP] =
            json!({ "index": light, "texCoord": set, "intensity": self.maps.intensity });
        let texture = self.scene.materials[material].paint.as_ref();
        let mean = texture.map_or(Vec3::ONE, |texture| {
            let pixels = &self.scene.images[texture.image].pixels;
            let sum: Vec3 = pixels.iter().map(|p| Vec3::new(p[0], p[1], p[2])).sum();
            (sum / pixels.len().max(1) as f32).clamp(Vec3::ZERO, Vec3::ONE)
        });
        json["emissiveTexture"] = json!({ "index": shown, "texCoord": set });
        json["emissiveFactor"] = json!(mean.to_array());
        let index = self.place_material(place, json);
        self.maps.materials.insert((material, page, set), index);
        index
    }

    /// Vertex colours of the paint, which the map's light is multiplied with; none where the input has none.
    pub(super) fn vertex_paint(&mut self, baked: &BakedSurface) -> Option<usize> {
        let surface = &self.scene.surfaces[baked.surface];
        surface.colors.as_ref()?;
        let paints = self.scene.materials[surface.material].vertex_paint;
        let color = |vertex| {
            let [r, g, b, a] = crate::gather::refined::vertex_color(surface, vertex);
            let rgb = if paints { [r, g, b] } else { [1.0; 3] };
            [rgb[0], rgb[1], rgb[2], a].map(|c| c.clamp(0.0, 1.0))
        };
        let colors: Vec<[f32; 4]> = baked.vertices.iter().map(color).collect();
        Some(self.bin.shares(&colors))
    }
}

/// The page's bytes as PNG.
fn png(bytes: &[u8], page: &MapPage, kind: ExtendedColorType) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut out, CompressionType::Best, FilterType::Adaptive);
    // Pages are 16,384 texels wide at the most.
    let [width, height] = [page.width, page.height].map(|n| n as u32);
    encoder
        .write_image(bytes, width, height, kind)
        .map_err(|problem| Error::Internal(format!("PNG of a light map: {problem}")))?;
    Ok(out)
}
