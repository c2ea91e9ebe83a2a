//! Light maps: what an engine reads back from the files is the light that `probe` finds, within the error that is stated.

pub(crate) mod file;
mod room;
mod shown;

use crate::common::built;
use crate::report::three;

use built::baked_to;
use file::{Mapped, Texels};
use glam::{DVec2, DVec3, dvec3};
use haarlight::audit::{PathReference, Report};
use haarlight::color::{LinearSrgb, de2000};
use haarlight::hierarchy::Face;
use haarlight::lightmap::{LightMaps, MapLimits};
use haarlight::output::maps::{self, Precision};
use haarlight::output::{BakedGlb, Exposure, mapped_glb};
use haarlight::scene::{Options, Scene};
use haarlight::solve::Bake;
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;
use tempfile::TempDir;

/// Display value of 1 lm/m2 in these tests.
const SCALE: f64 = 0.005;

/// A room with its maps, written and read back.
struct Written<'a> {
    bake: &'a Bake,
    maps: LightMaps,
    glb: BakedGlb,
    index: Value,
    pages: Vec<Texels>,
}

fn room() -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    std::fs::write(&path, room::room()).unwrap();
    Scene::load(path, &Options::default()).unwrap()
}

/// The room to an error of 1, and of 2.
static FINE: LazyLock<Bake> = LazyLock::new(|| baked_to(1.0, room()));
static COARSE: LazyLock<Bake> = LazyLock::new(|| baked_to(2.0, room()));
/// With their maps.
static FINE_MAPS: LazyLock<Written> = LazyLock::new(|| written(&FINE, &MapLimits::default()));
static COARSE_MAPS: LazyLock<Written> = LazyLock::new(|| written(&COARSE, &MapLimits::default()));

fn written<'a>(bake: &'a Bake, limits: &MapLimits) -> Written<'a> {
    let maps = bake.light_maps(limits, &|_, _| {});
    let look = Exposure::new(SCALE);
    let glb = mapped_glb(bake.scene(), &maps, &look).unwrap();
    let name = |k: usize, _: Option<usize>, ending: &str| format!("room.map-{k}.{ending}");
    let index = maps::index(bake.scene(), &maps, &glb, &look, true, &name).unwrap();
    let mut file = Written {
        bake,
        maps,
        glb,
        index: serde_json::to_value(&index).unwrap(),
        pages: Vec::new(),
    };
    file.pages = file::pages(file.folder().path(), &file.index);
    file
}

impl Written<'_> {
    /// A folder with the room and its pages.
    fn folder(&self) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let names = self.index["pages"].as_array().unwrap().iter();
        let unit = self.index["lux_per_unit"].as_f64().unwrap();
        for (page, name) in self.maps.pages.iter().zip(names) {
            let exr = maps::to_exr(page, unit, Precision::Half).unwrap();
            std::fs::write(folder.path().join(name["exr"].as_str().unwrap()), exr).unwrap();
        }
        std::fs::write(folder.path().join("room.glb"), &self.glb.bytes).unwrap();
        folder
    }

    fn triangles(&self) -> Vec<Mapped> {
        file::triangles(&self.glb.bytes, &self.index)
    }

    fn look_up(&self, of: &Mapped, uv: DVec2) -> [f64; 3] {
        LinearSrgb::standard().to_xyz(self.pages[of.page].look_up(uv))
    }

    fn difference(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        de2000(a, b, self.bake.light().white)
    }

    /// Colour differences to `probe` at random points of triangles, by area, with the triangle's node.
    fn off(&self, of: &[&Mapped], count: usize) -> Vec<(String, f64)> {
        let points = random(of, count);
        let places: Vec<(DVec3, DVec3)> = points.iter().map(|p| (p.at, p.normal)).collect();
        let probed = self.bake.probe(&places);
        let off = points.iter().zip(probed).map(|(p, probed)| {
            let off = self.difference(self.look_up(p.of, p.uv), probed.xyz);
            (p.of.node.clone(), off)
        });
        off.collect()
    }
}

/// A place on a triangle.
struct Point<'a> {
    of: &'a Mapped,
    at: DVec3,
    normal: DVec3,
    uv: DVec2,
}

/// Random points of triangles, by area.
fn random<'a>(of: &[&'a Mapped], count: usize) -> Vec<Point<'a>> {
    let area = |t: &Mapped| {
        let [a, b, c] = t.corners;
        (b - a).cross(c - a).length()
    };
    let whole: f64 = of.iter().map(|t| area(t)).sum();
    let mut random = Random(1);
    let mut point = || {
        let mut left = random.next() * whole;
        let mut all = of.iter();
        let triangle = all.find(|t| {
            left -= area(t);
            left <= 0.0
        });
        let of = triangle.unwrap_or(&of[0]);
        let (u, v) = (random.next().sqrt(), random.next());
        let w = [1.0 - u, u * (1.0 - v), u * v];
        let mix = |x: &[DVec3; 3]| x[0] * w[0] + x[1] * w[1] + x[2] * w[2];
        Point {
            of,
            at: mix(&of.corners),
            normal: mix(&of.normals).normalize(),
            uv: of.uv[0] * w[0] + of.uv[1] * w[1] + of.uv[2] * w[2],
        }
    };
    (0..count).map(|_| point()).collect()
}

/// A plain generator of numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn mean(off: &[(String, f64)]) -> f64 {
    off.iter().map(|(_, d)| d).sum::<f64>() / off.len() as f64
}

#[test]
fn light_read_back_is_what_probe_finds() {
    let file = &*FINE_MAPS;
    let stated = file.maps.baked.interpolation.unwrap();
    assert!(stated.is_met(), "{stated:?}");
    let triangles = file.triangles();
    let all: Vec<&Mapped> = triangles.iter().collect();
    for uv in all.iter().flat_map(|t| t.uv) {
        assert!(
            uv.cmpgt(DVec2::ZERO).all() && uv.cmplt(DVec2::ONE).all(),
            "{uv}"
        );
    }
    let off = file.off(&all, 1000);
    // Both are means over a thousand random points; half floats and chance add to what is stated.
    let found = mean(&off);
    assert!(
        found < 1.25 * stated.mean + 0.05,
        "{found} where {stated:?}"
    );
    // Each kind of mesh by itself, the sides of the sheet apart.
    for name in ["floor", "right, mirrored", "left", "tubes", "sheet"] {
        for back in [false, true] {
            let of = |t: &&Mapped| t.node.starts_with(name) && t.back == back;
            let some: Vec<&Mapped> = triangles.iter().filter(of).collect();
            assert_eq!(some.is_empty(), back && name != "sheet", "{name}");
            if !some.is_empty() {
                let found = mean(&file.off(&some, 200));
                assert!(found < 1.0, "{name}, back {back}: {found}");
            }
        }
    }
}

#[test]
fn three_js_shows_what_probe_finds() {
    if !three::is_there() {
        return;
    }
    let file = &*FINE_MAPS;
    let triangles = file.triangles();
    let all: Vec<&Mapped> = triangles.iter().collect();
    let points = random(&all, 1000);
    let places: Vec<_> = points
        .iter()
        .map(|p| (p.of.entry, p.at, shown::facing(p.of)))
        .collect();
    let seen = shown::shown(file.folder().path(), &file.index, &places);
    let places: Vec<_> = points.iter().map(|p| (p.at, p.normal)).collect();
    let probed = file.bake.probe(&places);
    let off = seen.iter().zip(probed).map(|(rgb, probed)| {
        let xyz = LinearSrgb::standard().to_xyz(*rgb);
        (String::new(), file.difference(xyz, probed.xyz))
    });
    let found = mean(&off.collect::<Vec<_>>());
    let stated = file.maps.baked.interpolation.unwrap();
    assert!(
        found < 1.25 * stated.mean + 0.05,
        "{found} where {stated:?}"
    );
}

#[test]
fn the_stated_error_is_what_the_audit_measures() {
    let file = &*FINE_MAPS;
    let reference = PathReference::new(file.bake, 200, 4096, 5);
    let report = Report::of_maps(file.bake, &file.maps, &reference);
    assert!(
        report.de2000.mean.low < file.bake.error_of(&file.maps.baked).unwrap(),
        "{report:?}"
    );
}

/// Charts of the tube meet over edges across which its light runs on.
#[test]
fn seams_do_not_show() {
    let file = &*FINE_MAPS;
    let triangles = file.triangles();
    let tube: Vec<&Mapped> = triangles
        .iter()
        .filter(|t| t.node.starts_with("tubes"))
        .collect();
    let (mut seams, mut sum, mut worst) = (0, 0.0, 0.0_f64);
    for (k, a) in tube.iter().enumerate() {
        for b in &tube[k + 1..] {
            for i in 0..3 {
                for j in 0..3 {
                    let (p, q) = ([i, (i + 1) % 3], [(j + 1) % 3, j]);
                    let near = |n: usize| a.corners[p[n]].distance(b.corners[q[n]]) < 1e-5;
                    if !near(0) || !near(1) {
                        continue;
                    }
                    let same = |n: usize| a.uv[p[n]].distance(b.uv[q[n]]) < 1e-6;
                    if same(0) && same(1) && a.page == b.page {
                        continue;
                    }
                    for along in [0.1, 0.35, 0.6, 0.9] {
                        let [x, y] = [(a, p), (b, q)]
                            .map(|(t, e)| file.look_up(t, t.uv[e[0]].lerp(t.uv[e[1]], along)));
                        let step = file.difference(x, y);
                        (seams, sum, worst) = (seams + 1, sum + step, worst.max(step));
                    }
                }
            }
        }
    }
    assert!(seams > 0, "the tubes have no seam");
    let error = file.maps.baked.interpolation.unwrap().mean;
    assert!(
        sum / f64::from(seams) < error,
        "mean step {}",
        sum / f64::from(seams)
    );
    assert!(worst < 1.0, "step {worst}");
}

#[test]
fn sets_that_are_in_use_stay() {
    let file = &*COARSE_MAPS;
    let (json, _) = file::chunks(&file.glb.bytes);
    let (input, _) = (file::chunks(&room::room()).0, ());
    let sets = |primitive: &Value| {
        let names = primitive["attributes"].as_object().unwrap().keys();
        names.filter(|n| n.starts_with("TEXCOORD_")).count()
    };
    for entry in file.index["meshes"].as_array().unwrap() {
        let number = |key: &str| entry[key].as_u64().unwrap() as usize;
        let primitive = &json["meshes"][number("mesh")]["primitives"][number("primitive")];
        let before = match entry["name"].as_str().unwrap() {
            "floor" | "ceiling" => 0,
            "back" | "front" | "left" | "right, mirrored" => 2,
            _ => 1,
        };
        assert_eq!(number("texcoord"), before.max(1), "{entry}");
        assert_eq!(sets(primitive), before.max(1) + 1, "{entry}");
        let material = &json["materials"][primitive["material"].as_u64().unwrap() as usize];
        let map = &material["extensions"]["MOZ_lightmap"];
        assert_eq!(map["texCoord"], entry["texcoord"]);
        assert_eq!(material["emissiveTexture"]["texCoord"], entry["texcoord"]);
        assert!(material["extensions"]["KHR_materials_unlit"].is_object());
    }
    // The room's own paint stays.
    let colors = |json: &Value| {
        let materials = json["materials"].as_array().unwrap().clone();
        materials
            .into_iter()
            .map(|m| m["pbrMetallicRoughness"]["baseColorFactor"].clone())
            .collect::<Vec<_>>()
    };
    let (before, after) = (colors(&input), colors(&json));
    assert!(after.iter().all(|c| before.contains(c)), "{after:?}");
}

/// In the glb, base colour x texel x intensity / pi is the exposed radiosity.
#[test]
fn the_glb_shows_the_radiosity() {
    let file = &*FINE_MAPS;
    let (json, bin) = file::chunks(&file.glb.bytes);
    let materials = json["materials"].as_array().unwrap();
    let map = &materials
        .iter()
        .find(|m| m["extensions"]["MOZ_lightmap"].is_object())
        .unwrap()["extensions"]["MOZ_lightmap"];
    let intensity = map["intensity"].as_f64().unwrap();
    let image = &json["textures"][map["index"].as_u64().unwrap() as usize]["source"];
    let view = &json["images"][image.as_u64().unwrap() as usize]["bufferView"];
    let view = &json["bufferViews"][view.as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let bytes = &bin[start..start + view["byteLength"].as_u64().unwrap() as usize];
    let image = image::load_from_memory(bytes).unwrap().into_rgb16();
    let mut compared = 0;
    for (k, texel) in image.pixels().enumerate() {
        let wanted = file.pages[0].rgb[k];
        for c in 0..3 {
            // All paints are grey: light over base colour is irradiance, but for 16 bits and half floats.
            let shown = f64::from(texel[c]) / 65535.0 * intensity / std::f64::consts::PI;
            let wanted = (SCALE * wanted[c]).min(4.0);
            assert!(
                (shown - wanted).abs() < 2e-3 * wanted + 2e-4,
                "{k}: {shown} {wanted}"
            );
            compared += usize::from(wanted > 0.01);
        }
    }
    assert!(compared > 1000);
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let bake = baked_to(2.0, room());
            let file = written(&bake, &MapLimits::default());
            let exr = maps::to_exr(&file.maps.pages[0], 1.0, Precision::Half).unwrap();
            (file.glb.bytes, exr, file.index.to_string())
        })
    };
    assert!(bytes(1) == bytes(16));
}

#[test]
fn small_pages_are_several() {
    let limits = MapLimits {
        page: 32,
        ..MapLimits::default()
    };
    let file = written(&COARSE, &limits);
    assert!(file.pages.len() > 1);
    assert!(file.pages.iter().all(|p| p.width <= 32 && p.height <= 32));
    let triangles = file.triangles();
    let all: Vec<&Mapped> = triangles.iter().collect();
    assert!(mean(&file.off(&all, 300)) < 2.0);
}

/// No more texels than are allowed, whichever charts ask for them, save what each needs in any case.
#[test]
fn texels_stay_within_their_number() {
    let texels = |limit: usize| {
        let limits = MapLimits {
            texels: Some(limit),
            ..MapLimits::default()
        };
        let maps = FINE.light_maps(&limits, &|_, _| {});
        let used = |page: &haarlight::lightmap::MapPage| {
            page.surfaces.iter().filter(|s| **s != u32::MAX).count()
        };
        (
            maps.pages.iter().map(used).sum::<usize>(),
            maps.baked.interpolation.unwrap().mean,
        )
    };
    let least = texels(1).0;
    let few = texels(least + 200);
    let more = texels(least + 2000);
    assert!(
        few.0 <= least + 200 && more.0 <= least + 2000,
        "{least} {few:?} {more:?}"
    );
    assert!(more.0 > few.0 && more.1 < few.1, "{few:?} {more:?}");
}

/// A square's shadow from a point lamp: the texels along its edge are mixed as the edge divides them.
#[test]
fn edges_of_shadows_have_no_steps() {
    let mut room = built::Room::new();
    let black = room.paint(0.0);
    room.quad(
        dvec3(-2.0, 0.0, 2.0),
        4.0 * DVec3::X,
        -4.0 * DVec3::Z,
        black,
    );
    let turn = |x: f64, z: f64| {
        let (sin, cos) = 0.35_f64.sin_cos();
        dvec3(cos * x - sin * z, 0.5, sin * x + cos * z)
    };
    let corners = [
        turn(-0.4, -0.4),
        turn(0.4, -0.4),
        turn(0.4, 0.4),
        turn(-0.4, 0.4),
    ];
    room.polygon(&corners, black);
    let lamp = dvec3(0.0, 2.0, 0.0);
    room.point(lamp, 1000.0);
    let bake = baked_to(1.0, room.scene());
    let maps = bake.light_maps(&MapLimits::default(), &|_, _| {});
    let mesh = bake.mesh();
    let at = |p: DVec3| {
        let p = p - mesh.centre;
        // The floor's two triangles come first.
        let inside = (0..2).find(|t| {
            let [a, b, c] = mesh.triangles[*t].map(|v| mesh.positions[v as usize]);
            let left = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).y >= -1e-12;
            left(a, b, p) && left(b, c, p) && left(c, a, p)
        });
        let face = Face {
            triangle: inside.unwrap() as u32,
            back: false,
        };
        maps.drawn(mesh, &[(face, p)])[0].unwrap()[1]
    };
    let shadow = corners.map(|c| lamp + (c - lamp) * 2.0 / 1.5);
    let (mut squares, mut count) = (0.0, 0.0);
    for k in 0..4 {
        let (p, q) = (shadow[k], shadow[(k + 1) % 4]);
        for step in 5..95 {
            let edge = p.lerp(q, f64::from(step) / 100.0) * dvec3(1.0, 0.0, 1.0);
            let lit = at(edge * 1.3);
            let share = at(edge) / lit;
            squares += (share - 0.5).powi(2);
            count += 1.0;
        }
    }
    let off: f64 = squares / count;
    let off = off.sqrt();
    // The nearest texel alone, lit or dark, is off by .5; interpolated between such texels by about .3.
    assert!(off < 0.2, "{off}");
}

#[test]
fn indirect_light_is_what_lamps_do_not_send_straight() {
    let limits = MapLimits {
        indirect: true,
        ..MapLimits::default()
    };
    let indirect = FINE.light_maps(&limits, &|_, _| {});
    let sum = |maps: &LightMaps| {
        let texels = maps.baked.surfaces.iter().flat_map(|s| &s.vertices);
        texels.map(|v| f64::from(v.irradiance[1])).sum::<f64>()
    };
    let share = sum(&indirect) / sum(&FINE_MAPS.maps);
    // The paint reflects about half: direct light is about half of all.
    assert!((0.2..0.8).contains(&share), "{share}");
}

/// With the npm module gltf-validator at hand: no errors. It warns of unlit materials that have another extension beside, as
/// light maps on unlit materials must.
#[test]
fn the_validator_has_nothing_to_say() {
    let file = &*COARSE_MAPS;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/validate.mjs");
    let folder = file.folder();
    let path = folder.path().join("room.glb");
    let Ok(output) = Command::new("node").arg(script).arg(path).output() else {
        eprintln!("skipped: node is not installed");
        return;
    };
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    eprintln!("{text}");
    assert!(
        text.starts_with("skipped") || text.contains(": 0 errors"),
        "{text}"
    );
    let other = |line: &&str| line.contains(" warning ") && !line.contains("MULTIPLE_EXTENSIONS");
    assert_eq!(text.lines().find(other), None);
}

#[test]
fn options_that_do_not_go_together_are_refused() {
    let run = |options: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.glb");
        std::fs::write(&path, room::room()).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .arg("bake")
            .arg(path)
            .args(options)
            .output()
            .unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    let (code, said) = run(&[
        "--light",
        "maps",
        "--xyz",
        "--vertices",
        "9",
        "--compress",
        "quantize",
        "--npz",
        "x.npz",
    ]);
    assert_eq!(code, Some(2), "{said}");
    for option in ["--xyz", "--vertices", "--compress", "--npz"] {
        assert!(said.contains(option), "{said}");
    }
    for option in [
        &["--texels", "900"][..],
        &["--only", "indirect"],
        &["--ktx2"],
        &["--map-size", "512"],
    ] {
        let (code, said) = run(option);
        assert_eq!(code, Some(2), "{said}");
        assert!(
            said.contains(option[0]) && said.contains("--light maps"),
            "{said}"
        );
    }
    let (code, said) = run(&["--light", "maps", "--map-size", "3"]);
    assert_eq!(code, Some(2), "{said}");
}
