//! Baked rooms, looked at as a person would: no seams, no black or glaring spots, smooth walls, sensible exposure.

use haarlight::gather::refined;
use haarlight::gather::{Baked, BakedSurface};
use haarlight::output::picture::seen;
use haarlight::output::{Exposure, Format, Picture, camera};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::f64::consts::PI;
use std::path::Path;

/// Small, one sample a pixel: what is tested is light, not edges.
const FORMAT: Format = Format {
    width: 480,
    height: 360,
    grid: 1,
};

fn bake(room: &str) -> (Bake, Baked) {
    bake_to(room, Settings::default())
}

fn bake_to(room: &str, settings: Settings) -> (Bake, Baked) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(room);
    let mut bake = Bake::new(Scene::load(path, &Options::default()).unwrap(), settings);
    bake.run();
    let baked = bake.baked(&|_, _| {});
    (bake, baked)
}

fn picture((bake, baked): &(Bake, Baked), camera: usize) -> (Picture, Exposure) {
    let scene = bake.scene();
    let look = Exposure::auto(scene, &baked.surfaces);
    let camera = &camera::cameras(scene)[camera];
    let picture = Picture::draw(scene, &baked.surfaces, camera, &look, FORMAT).unwrap();
    (picture, look)
}

/// Vertices that share an edge with each vertex of a sheet.
fn neighbours(sheet: &BakedSurface) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new(); sheet.vertices.len()];
    for triangle in &sheet.triangles {
        let [a, b, c] = triangle.map(|v| v as usize);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            all[from].push(to);
            all[to].push(from);
        }
    }
    all
}

#[test]
fn a_closed_room_has_no_seam_and_no_black_spot() {
    let room = bake("cornell-closed.glb");
    // From inside, every pixel shows a wall: a crack would show the nothing behind it.
    let (picture, _) = picture(&room, 1);
    assert!(picture.pixels.iter().all(|p| p.coverage == 1.0));
    let least = picture
        .pixels
        .iter()
        .map(|p| p.xyz[1])
        .fold(f32::MAX, f32::min);
    let mean = picture.pixels.iter().map(|p| p.xyz[1]).sum::<f32>() / picture.pixels.len() as f32;
    assert!(least > 0.02 * mean, "{least} beside a mean of {mean}");

    for sheet in &room.1.surfaces {
        let surface = &room.0.scene().surfaces[sheet.surface];
        for (v, around) in neighbours(sheet).iter().enumerate() {
            let level = |v: usize| f64::from(sheet.vertices[v].irradiance[1]);
            let place = refined::position(surface, &sheet.vertices[v]);
            let levels = around.iter().map(|&n| level(n));
            let (low, high) = levels.fold((f64::MAX, 0.0f64), |(low, high), y| {
                (low.min(y), high.max(y))
            });
            assert!(level(v) > 0.0, "black: {} at {place}", surface.name);
            // Light in a corner falls off, but a single dark or glaring vertex is a defect.
            assert!(
                level(v) > 0.5 * low && level(v) < 2.0 * high,
                "{}: {} among {low} to {high} at {place}",
                surface.name,
                level(v)
            );
        }
    }
}

#[test]
fn a_plain_wall_is_smooth() {
    // The mean error of .5 leaves a bend of .034 at one place.
    let settings = Settings {
        error: 0.35,
        ..Settings::default()
    };
    let room = bake_to("cornell.glb", settings);
    let (picture, _) = picture(&room, 0);
    // The back wall above the tall block, and the ceiling's front, away from all edges.
    for (row, columns) in [(110, 150..330), (25, 100..380)] {
        let level: Vec<f64> = (columns.clone())
            .map(|x| f64::from(picture.pixels[row * FORMAT.width + x].xyz[1]))
            .collect();
        let step = 6;
        for k in step..level.len() - step {
            let bend = level[k - step] - 2.0 * level[k] + level[k + step];
            let share = bend.abs() / level[k];
            assert!(share < BEND, "{share} at {}, {row}", columns.start + k);
        }
    }
}

/// Greatest second difference over 6 pixels (1 cm on the wall), share of the level: about what an eye sees as a band.
const BEND: f64 = 0.03;

#[test]
fn exposure_keeps_the_room_below_white_and_off_black() {
    for (name, cameras) in [("cornell.glb", 1), ("two-rooms.glb", 2), ("convex.glb", 1)] {
        // Coarse light is as bright.
        let settings = Settings {
            error: 2.0,
            ..Settings::default()
        };
        let room = bake_to(name, settings);
        let mut medians = Vec::<f64>::new();
        for camera in 0..cameras {
            let (picture, look) = picture(&room, camera);
            // Lamps are far brighter than anything they light.
            let shown = |c: f32| f64::from(c) * PI * look.scale;
            let strongest = picture.pixels.iter().filter(|p| p.coverage > 0.0);
            let mut levels: Vec<f64> = strongest
                .map(|p| p.rgb.iter().map(|&c| shown(c)).fold(0.0, f64::max))
                .filter(|&level| level < 4.0)
                .collect();
            levels.sort_by(f64::total_cmp);
            // What is beyond white the curve brings back.
            let beyond = levels.iter().filter(|&&l| l > 1.0).count() as f64 / levels.len() as f64;
            assert!(beyond < 0.15, "{name}, camera {camera}: {beyond}");
            medians.push(levels[levels.len() / 2]);
        }
        let best = medians.iter().copied().fold(0.0, f64::max);
        assert!((0.15..0.75).contains(&best), "{name}: {medians:?}");
    }
}

/// Pictures on the way ask for light only where they show something, and look the same.
#[test]
fn a_sketch_of_what_is_seen_makes_the_same_picture() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two-rooms.glb");
    let scene = Scene::load(path, &Options::default()).unwrap();
    let mut bake = Bake::new(scene, Settings::default());
    bake.step();
    let scene = bake.scene();
    let camera = &camera::cameras(scene)[0];
    let seen = seen(scene, &[(camera, FORMAT)]);
    let all: Vec<Vec<bool>> = seen.iter().map(|s| vec![true; s.len()]).collect();
    let [whole, part] = [&all, &seen].map(|seen| bake.sketch(seen, &|_, _| {}));
    assert!(2 * part.rays < whole.rays, "{} {}", part.rays, whole.rays);
    let look = Exposure::auto(scene, &whole.surfaces);
    let draw = |b: &Baked| Picture::draw(scene, &b.surfaces, camera, &look, FORMAT).unwrap();
    assert_eq!(draw(&whole), draw(&part));
    // The rest is lit as well: by the leaves.
    let dark = |b: &Baked| {
        let vertices = b.surfaces.iter().flat_map(|s| &s.vertices);
        vertices.filter(|v| v.irradiance[1] <= 0.0).count()
    };
    assert!(dark(&part) <= dark(&whole));
}
