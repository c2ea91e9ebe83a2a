//! What the page is told of a room besides its light: spectra of lamps and materials, viewpoints, the observer.

use crate::color::{KM, LinearSrgb, Observer};
use crate::scene::facts::Facts;
use crate::scene::{Camera, LightKind, Projection, Scene};
use crate::solve::Bake;
use crate::spectrum::Spectrum;
use serde_json::{Value, json};

/// The room of a bake.
pub fn of(bake: &Bake, cameras: &[Camera]) -> Value {
    let scene = bake.scene();
    let grid = &scene.grid;
    let facts = Facts::of(scene);
    let weights = Observer::cie1931().weights(grid);
    let upsampler = bake.upsampler();
    let display = LinearSrgb::standard();
    let looks = bake.looks(upsampler);
    let materials: Vec<Value> = looks
        .iter()
        .zip(&facts.materials)
        .filter(|(_, fact)| fact.triangles > 0)
        .map(|(look, fact)| {
            let rgb = display.from_xyz(upsampler.xyz(look.reflectance()));
            json!({
                "fact": fact,
                "reflectance": rounded(look.reflectance()),
                "rgb": rgb,
            })
        })
        .collect();
    json!({
        "nm": (0..64).map(|k| grid.middle(k)).collect::<Vec<_>>(),
        "observer": weights.map(|w| w.map(|x| KM * x).to_vec()),
        "lamps": lamps(scene, &facts),
        "materials": materials,
        "views": views(cameras),
    })
}

/// What lamps give, in the order of the facts: emissive materials, then punctual lights. W/m2/sr/nm, W/sr/nm or W/m2/nm;
/// that of a textured surface where the texture is white.
pub fn lamp_spectra(scene: &Scene) -> Vec<Spectrum> {
    let power = |light: usize, shape: &Spectrum| -> Spectrum {
        let power = &scene.spectra[light].power;
        std::array::from_fn(|k| power[k] * shape[k])
    };
    let used = |m: usize| {
        let mut surfaces = scene.surfaces.iter();
        surfaces.any(|s| s.material == m && !s.triangles.is_empty())
    };
    let surfaces = (scene.materials.iter().enumerate())
        .filter(|(m, _)| used(*m))
        .filter_map(|(_, material)| material.emission.as_ref())
        .map(|e| power(e.light, &e.shape));
    // A surface that shines by a profile is among the surfaces.
    let lights = (scene.lights.iter())
        .filter(|l| l.kind != LightKind::Surface)
        .map(|l| power(l.light, &l.shape));
    surfaces.chain(lights).collect()
}

fn lamps(scene: &Scene, facts: &Facts) -> Vec<Value> {
    let lamps = facts.lights.iter().zip(lamp_spectra(scene));
    lamps
        .map(|(fact, power)| json!({ "fact": fact, "power": rounded(&power) }))
        .collect()
}

/// Cameras of the file, or the program's own: matrix to world, half the height of the view.
fn views(cameras: &[Camera]) -> Vec<Value> {
    let view = |c: &Camera| {
        let (perspective, size) = match c.projection {
            Projection::Perspective(angle) => (true, angle),
            Projection::Orthographic(half) => (false, half),
        };
        json!({
            "name": c.name,
            "matrix": c.to_world.to_cols_array(),
            "perspective": perspective,
            "size": size,
            "aspect": c.aspect,
        })
    };
    cameras.iter().map(view).collect()
}

/// Six digits are as many as a plot shows.
fn rounded(spectrum: &Spectrum) -> Vec<f64> {
    let most = spectrum.iter().copied().fold(0.0_f64, f64::max);
    if most <= 0.0 {
        return spectrum.to_vec();
    }
    let scale = 10f64.powi(5 - most.log10().floor() as i32);
    spectrum
        .iter()
        .map(|x| (x * scale).round() / scale)
        .collect()
}
