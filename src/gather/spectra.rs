//! Spectra at the vertices of the refined mesh: `B(band) = rho(band) H(band) + pi L(band)`, W/m2/nm, plus fluorescence.
//!
//! The reflectance is the one behind [`BakedVertex::radiosity`](super::BakedVertex::radiosity): a paint texture enters
//! with its mean colour. An emissive texture is looked up at the vertex.

use super::bake::Baked;
use super::layers::LayerLanes;
use super::refined;
use super::{BakedSurface, BakedVertex};
use crate::color::Upsampler;
use crate::scene::{Material, Surface};
use crate::solve::Bake;
use crate::spectrum::{BANDS, Spectrum};
use rayon::prelude::*;
use std::f64::consts::PI;

impl Bake {
    /// Radiosity on the 64 bands at every vertex, W/m2/nm, surface by surface, own emission included.
    pub fn radiosity_spectra(&self, baked: &Baked) -> Vec<Vec<[f32; BANDS]>> {
        self.spectra_of(baked, None)
    }

    /// The part of this radiosity that is due to layer `k` of [`Bake::layers`]: all layers add up to the whole. Empty where
    /// there is no such layer.
    pub fn layer_spectra(&self, baked: &Baked, k: usize) -> Vec<Vec<[f32; BANDS]>> {
        match self.layer_lanes().get(k) {
            Some(lanes) => self.spectra_of(baked, Some((k, lanes))),
            None => Vec::new(),
        }
    }

    fn spectra_of(
        &self,
        baked: &Baked,
        layer: Option<(usize, &LayerLanes)>,
    ) -> Vec<Vec<[f32; BANDS]>> {
        let scene = self.scene();
        let upsampler = self.upsampler();
        let looks = self.looks(upsampler);
        let emits = |material: &Material| match (&material.emission, layer, self.layers()) {
            (Some(own), Some((k, _)), Some(layers)) => layers.of_light[own.light] == k,
            _ => true,
        };
        let surface = |(baked, rows): (&BakedSurface, &Vec<[f32; BANDS]>)| {
            let surface = &scene.surfaces[baked.surface];
            let (material, look) = (&scene.materials[surface.material], &looks[surface.material]);
            let emits = emits(material);
            let vertex = |(vertex, row): (&BakedVertex, &[f32; BANDS])| {
                let row = &layer.map_or(*row, |(_, lanes)| lanes.of(row));
                let irradiance = self.lanes().spectrum(row);
                let radiance = match emits {
                    true => self.radiance(surface, material, vertex, upsampler),
                    false => [0.0; BANDS],
                };
                let reflectance = look.reflectance_at(surface, vertex);
                let again = look.fluoresced(self.lanes(), row).unwrap_or([0.0; BANDS]);
                std::array::from_fn(|k| {
                    (reflectance[k] * irradiance[k] + again[k] + PI * radiance[k]) as f32
                })
            };
            baked.vertices.par_iter().zip(rows).map(vertex).collect()
        };
        baked
            .surfaces
            .iter()
            .zip(&baked.irradiance)
            .map(surface)
            .collect()
    }

    /// Emitted radiance at a vertex, W/m2/sr/nm.
    fn radiance(
        &self,
        surface: &Surface,
        material: &Material,
        vertex: &BakedVertex,
        upsampler: &Upsampler,
    ) -> Spectrum {
        let Some(emission) = &material.emission else {
            return [0.0; BANDS];
        };
        let uvs = emission
            .texture
            .as_ref()
            .and_then(|t| Some((t, surface.texcoords.get(t.texcoord)?)));
        let shape = match uvs {
            Some((texture, uvs)) => {
                let corners = refined::corners(surface, vertex);
                let uv = std::array::from_fn(|i| {
                    (0..3)
                        .map(|k| uvs[corners[k]][i] * vertex.weights[k] as f32)
                        .sum()
                });
                let [r, g, b, _] = texture.sample(&self.scene().images, uv);
                emission.shape_at([r, g, b], upsampler)
            }
            None => emission.shape,
        };
        let power = &self.scene().spectra[emission.light].power;
        std::array::from_fn(|k| shape[k] * power[k])
    }
}
