//! Probes: the KTX2 volume through the arithmetic of bevy_pbr's irradiance volumes (`irradiance_volume.wgsl`).

use crate::file::{Glb, number};
use crate::load::{Assets, Texture};
use crate::{Findings, apart};
use bevy_math::DVec3;
use serde_json::Value;
use std::f64::consts::PI;

/// A volume as it is placed in the world: `Transform` with `box.centre` and the scale `box.size`.
struct Volume {
    texture: Texture,
    centre: DVec3,
    size: DVec3,
    intensity: f64,
}

impl Volume {
    /// What the shader finds for a surface: light over pi, cd/m2 for a white one.
    fn light(&self, at: DVec3, normal: DVec3) -> [f64; 3] {
        let atlas = DVec3::from_array(self.texture.sides.map(|n| n as f64));
        let resolution = atlas / DVec3::new(1.0, 2.0, 3.0);
        let unit = (at - self.centre) / self.size;
        let stp = ((unit + 0.5) * resolution).clamp(DVec3::splat(0.5), resolution - 0.5);
        let uvw = stp / atlas;
        let mut sum = [0.0; 3];
        for axis in 0..3 {
            let negative = if normal[axis] < 0.0 { 0.5 } else { 0.0 };
            let side = uvw + DVec3::new(0.0, negative, axis as f64 / 3.0);
            let weight = normal[axis] * normal[axis] * self.intensity;
            let texel = self.texture.sample(side.to_array());
            (0..3).for_each(|c| sum[c] += weight * texel[c]);
        }
        sum
    }
}

fn vector(of: &Value) -> DVec3 {
    let numbers = of.as_array().expect("three numbers").iter();
    let numbers: Vec<f64> = numbers.filter_map(Value::as_f64).collect();
    DVec3::from_slice(&numbers)
}

pub(crate) fn check(
    file: &Glb,
    index: &Value,
    assets: &mut Assets,
    options: &[String],
    findings: &mut Findings,
) {
    let units = index["lux_per_unit"].as_f64().expect("a number");
    let volume = Volume {
        texture: assets.texture(index["ktx2"].as_str().expect("a name")),
        centre: vector(&index["box"]["centre"]),
        size: vector(&index["box"]["size"]),
        intensity: units / PI,
    };
    let counts: Vec<usize> = index["counts"]
        .as_array()
        .expect("counts")
        .iter()
        .map(number)
        .collect();
    let (origin, step) = (vector(&index["origin"]), vector(&index["step"]));
    let place = |k: usize| {
        let n = DVec3::new(
            (k % counts[0]) as f64,
            (k / counts[0] % counts[1]) as f64,
            (k / (counts[0] * counts[1])) as f64,
        );
        origin + n * step
    };
    let sides = [
        DVec3::X,
        -DVec3::X,
        DVec3::Y,
        -DVec3::Y,
        DVec3::Z,
        -DVec3::Z,
    ];
    let all = 0..counts.iter().product();
    let places: Vec<(usize, usize)> = all
        .clone()
        .flat_map(|k| (0..6).map(move |s| (k, s)))
        .collect();
    let irradiance = |at: DVec3, n: DVec3| volume.light(at, n).map(|x| PI * x);
    let found: Vec<[f64; 3]> = places
        .iter()
        .map(|&(k, s)| irradiance(place(k), sides[s]))
        .collect();
    let cube = |k: usize, s: usize| {
        [0, 1, 2].map(|c| units * index["cube"][k][3 * s + c].as_f64().expect("a number"))
    };
    let wanted: Vec<[f64; 3]> = places.iter().map(|&(k, s)| cube(k, s)).collect();
    let (mean, most) = apart(&found, &wanted);
    let text = format!(
        "{} sides of probes differ from the JSON's by {:.4} % in the mean, {:.4} % at most",
        found.len(),
        100.0 * mean,
        100.0 * most
    );
    // Half floats, and the brightest probe is some times the mean.
    findings.say("IrradianceVolume", mean < 1e-3, &text);
    let inside: Vec<usize> = all.filter(|&k| index["places"][k] == "room").collect();
    let some: Vec<usize> = inside
        .iter()
        .copied()
        .step_by(inside.len().div_ceil(30).max(1))
        .collect();
    let corner = DVec3::ONE.normalize();
    for (name, ways, limit) in [
        ("sides", &sides[..], 1e-2),
        ("diagonals", &[corner, -corner][..], f64::INFINITY),
    ] {
        let points: Vec<(DVec3, DVec3)> = some
            .iter()
            .flat_map(|&k| ways.iter().map(move |&n| (place(k), n)))
            .collect();
        let Some(wanted) = file.probed(&points, options) else {
            println!("SKIPPED: no HAARLIGHT to compare light with");
            return;
        };
        let found: Vec<[f64; 3]> = points.iter().map(|&(p, n)| irradiance(p, n)).collect();
        let (mean, most) = apart(&found, &wanted);
        let text = format!(
            "{} {name} differ by {:.3} % in the mean, {:.3} % at most",
            points.len(),
            100.0 * mean,
            100.0 * most
        );
        findings.say("IrradianceVolume and probe", mean < limit, &text);
    }
}
