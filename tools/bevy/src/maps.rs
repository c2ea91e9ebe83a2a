//! Light maps: `Lightmap { image, uv_rect }` as the shader of bevy_pbr reads it, from pages in EXR and KTX2.

use crate::file::{Glb, number};
use crate::load::{Assets, Texture};
use crate::vertices::{corners, primitive};
use crate::{Findings, apart};
use bevy_camera::Exposure;
use bevy_gltf::Gltf;
use bevy_math::{DVec2, DVec3};
use bevy_mesh::{Mesh, VertexAttributeValues};
use serde_json::Value;
use std::f64::consts::PI;

/// Points that are looked at.
const POINTS: usize = 1000;

/// A triangle with light, by what Bevy loaded.
struct Lit {
    corners: [DVec3; 3],
    /// -1: of a mirrored node, which turns triangles over.
    turn: f64,
    uv: [DVec2; 3],
    page: usize,
    rect: [f64; 4],
}

/// Triangles of an entry of the index. Bevy has two sets of coordinates, and takes the second for light maps.
fn triangles(file: &Glb, assets: &Assets, gltf: &Gltf, entry: &Value) -> Option<Vec<Lit>> {
    let of = |key: &str| number(&entry[key]);
    if of("texcoord") != 1 {
        return None;
    }
    let (mesh, _) = primitive(assets, gltf, of("mesh"), of("primitive"));
    let Some(VertexAttributeValues::Float32x3(places)) = mesh.attribute(Mesh::ATTRIBUTE_POSITION)
    else {
        return None;
    };
    let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_1) else {
        return None;
    };
    let world = file.world(of("node"));
    let rect: Vec<f64> = entry["uv_rect"]
        .as_array()?
        .iter()
        .filter_map(Value::as_f64)
        .collect();
    // Bevy hands the rectangle to its shader in 16 bits.
    let rect = [0, 1, 2, 3].map(|k| (rect[k] * 65535.0).round() / 65535.0);
    let lit = |t: &[usize]| Lit {
        corners: [0, 1, 2]
            .map(|k| world.transform_point3(DVec3::from_array(places[t[k]].map(f64::from)))),
        turn: world.matrix3.determinant().signum(),
        uv: [0, 1, 2].map(|k| DVec2::from_array(uvs[t[k]].map(f64::from))),
        page: of("page"),
        rect,
    };
    Some(corners(mesh).chunks(3).map(lit).collect())
}

/// A plain generator of numbers in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

/// Random points of triangles by area: place, normal, page and place on it, `mix(uv_rect.xy, uv_rect.zw, uv)` in the shader.
fn points(of: &[Lit]) -> Vec<(DVec3, DVec3, usize, [f64; 3])> {
    let facing = |t: &Lit| {
        let [a, b, c] = t.corners;
        t.turn * (b - a).cross(c - a)
    };
    let whole: f64 = of.iter().map(|t| facing(t).length()).sum();
    let mut state = 1;
    let mut point = || {
        let mut left = random(&mut state) * whole;
        let found = of.iter().find(|t| {
            left -= facing(t).length();
            left <= 0.0
        });
        let t = found.unwrap_or(&of[0]);
        let (u, v) = (random(&mut state).sqrt(), random(&mut state));
        let w = [1.0 - u, u * (1.0 - v), u * v];
        let at = t.corners[0] * w[0] + t.corners[1] * w[1] + t.corners[2] * w[2];
        let uv = t.uv[0] * w[0] + t.uv[1] * w[1] + t.uv[2] * w[2];
        let [x0, y0, x1, y1] = t.rect;
        let on_page = [x0 + (x1 - x0) * uv.x, y0 + (y1 - y0) * uv.y, 0.5];
        (at, facing(t).normalize(), t.page, on_page)
    };
    (0..POINTS).map(|_| point()).collect()
}

pub(crate) fn check(
    file: &Glb,
    index: &Value,
    assets: &mut Assets,
    options: &[String],
    findings: &mut Findings,
) {
    let pages = index["pages"].as_array().expect("pages");
    let mut read = |ending: &str| -> Option<Vec<Texture>> {
        let names = pages.iter().map(|p| p[ending].as_str());
        let names: Option<Vec<&str>> = names.collect();
        Some(
            names?
                .into_iter()
                .map(|name| assets.texture(name))
                .collect(),
        )
    };
    let exr = read("exr").expect("pages have a name");
    if let Some(ktx2) = read("ktx2") {
        let texels = |of: &[Texture]| -> Vec<[f64; 3]> {
            of.iter().flat_map(|t| t.texels.clone()).collect()
        };
        let (mean, most) = apart(&texels(&exr), &texels(&ktx2));
        findings.say(
            "pages",
            most == 0.0,
            &format!("EXR and KTX2 differ by {mean} in the mean, {most} at most"),
        );
    }
    let handle = assets.load::<Gltf>(&file.name());
    let gltf = assets.get(&handle);
    let entries = index["meshes"].as_array().expect("meshes");
    let parts: Vec<Option<Vec<Lit>>> = entries
        .iter()
        .map(|e| triangles(file, assets, gltf, e))
        .collect();
    let without = parts.iter().filter(|p| p.is_none()).count();
    findings.say(
        "UV_1",
        without == 0,
        &format!(
            "{without} of {} meshes have their light elsewhere",
            parts.len()
        ),
    );
    let lit: Vec<Lit> = parts.into_iter().flatten().flatten().collect();
    let points = points(&lit);
    // What the camera makes of a luminance is what the glb shows of that light.
    let display = index["exposure"].as_f64().expect("a number");
    let ev100 = (1.0 / (1.2 * PI * display)).log2() as f32;
    let shown = f64::from(Exposure { ev100 }.exposure()) / (PI * display);
    findings.say(
        "Exposure",
        (shown - 1.0).abs() < 1e-5,
        &format!("ev100 {ev100}: {shown} of the glb's brightness"),
    );
    // On a white surface: luminance is the texel times lightmap_exposure, irradiance pi times that.
    let units = index["lux_per_unit"].as_f64().expect("a number");
    let exposure = units / PI;
    let found: Vec<[f64; 3]> = points
        .iter()
        .map(|(_, _, page, uv)| exr[*page].sample(*uv).map(|t| PI * exposure * t))
        .collect();
    let places: Vec<(DVec3, DVec3)> = points.iter().map(|(p, n, ..)| (*p, *n)).collect();
    match file.probed(&places, options) {
        // At --error 1 rooms are off by 1 to 5 %, most at edges of shadows; a page turned over by tens.
        Some(wanted) => {
            let (mean, _) = apart(&found, &wanted);
            let text = format!(
                "{POINTS} points differ by {:.3} % in the mean",
                100.0 * mean
            );
            findings.say("Lightmap and probe", mean < 0.1, &text);
        }
        None => println!("SKIPPED: no HAARLIGHT to compare light with"),
    }
}
