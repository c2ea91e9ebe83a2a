//! Pictures: what a pixel holds against closed forms, and a room to look at (left in `target/tmp`).

use crate::output_room;

use ::exr::prelude::{ReadChannels, ReadLayers};
use glam::{DMat4, DVec3};
use haarlight::gather::refined;
use haarlight::gather::{BakedSurface, BakedVertex};
use haarlight::output::{Exposure, Format, Picture, camera, exr};
use haarlight::scene::*;
use haarlight::store::file;
use output_room::room;
use std::f64::consts::PI;

const SMALL: Format = Format {
    width: 64,
    height: 48,
    grid: 1,
};

/// A scene without surfaces, with the test room's materials: tiles (textured), wall, lamp.
fn empty() -> Scene {
    let mut scene = room();
    scene.surfaces.clear();
    scene.cameras.clear();
    scene
}

/// Adds a parallelogram that faces `u x v`.
fn add(scene: &mut Scene, material: usize, [corner, u, v]: [DVec3; 3]) {
    let node = scene.surfaces.len();
    scene.surfaces.push(Surface {
        name: format!("node {node}"),
        node,
        mesh: node,
        primitive: 0,
        instance: None,
        material,
        to_world: DMat4::IDENTITY,
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        normals: None,
        texcoords: vec![vec![[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]]],
        colors: None,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    });
}

/// Adds the six faces of a box; `inward` turns them to the inside.
fn add_box(scene: &mut Scene, material: usize, corner: DVec3, [a, b, c]: [DVec3; 3], inward: bool) {
    for [o, u, v] in [
        [corner, b, a],
        [corner, c, b],
        [corner, a, c],
        [corner + c, a, b],
        [corner + a, b, c],
        [corner + b, c, a],
    ] {
        add(scene, material, if inward { [o, v, u] } else { [o, u, v] });
    }
}

/// Cuts all quads into `n` by `n` cells with `light(place, normal)`.
fn lit(
    scene: &Scene,
    n: u32,
    light: impl Fn(&Surface, DVec3, DVec3) -> [f64; 3],
) -> Vec<BakedSurface> {
    let mut surfaces = output_room::refined(scene, n);
    for baked in &mut surfaces {
        let surface = &scene.surfaces[baked.surface];
        let lights: Vec<[f64; 3]> = (baked.vertices.iter())
            .map(|v| {
                let normal = refined::normal(surface, baked, v);
                light(surface, refined::position(surface, v), normal)
            })
            .collect();
        for (vertex, light) in baked.vertices.iter_mut().zip(lights) {
            vertex.light = light.map(|c| c as f32);
            vertex.radiosity = vertex.light;
        }
    }
    surfaces
}

fn eye(at: DVec3, target: DVec3, angle: f64) -> Camera {
    let back = (at - target).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let to_world = DMat4::from_cols(
        right.extend(0.0),
        up.extend(0.0),
        back.extend(0.0),
        at.extend(1.0),
    );
    Camera {
        name: "test".into(),
        to_world,
        projection: Projection::Perspective(angle),
        aspect: None,
    }
}

#[test]
fn light_is_interpolated_in_perspective_even_behind_the_eye() {
    // A floor that reaches behind the camera, cut finely, with radiosity linear in place: every pixel has a closed form.
    let mut scene = empty();
    add(
        &mut scene,
        1,
        [
            DVec3::new(-50.0, 0.0, 50.0),
            DVec3::X * 100.0,
            DVec3::NEG_Z * 100.0,
        ],
    );
    for cells in [1, 7] {
        let surfaces = lit(&scene, cells, |_, p, _| [100.0 + p.x, 100.0 + p.z, 100.0]);
        let at = DVec3::new(0.3, 2.0, 0.1);
        let camera = eye(at, DVec3::new(0.0, 0.0, -3.0), 1.0);
        let picture =
            Picture::draw(&scene, &surfaces, &camera, &Exposure::new(1e-3), SMALL).unwrap();
        let half = 0.5f64.tan();
        let mut seen = 0;
        for (i, pixel) in picture.pixels.iter().enumerate() {
            let (x, y) = ((i % 64) as f64 + 0.5, (i / 64) as f64 + 0.5);
            let way = DVec3::new(
                (x / 32.0 - 1.0) * half * 64.0 / 48.0,
                (1.0 - y / 24.0) * half,
                -1.0,
            );
            let way = camera.to_world.transform_vector3(way);
            let hit = at - way * (at.y / way.y);
            if way.y < -0.1 && hit.x.abs() < 49.0 && hit.z.abs() < 49.0 {
                seen += 1;
                assert_eq!(pixel.coverage, 1.0);
                assert!(
                    (f64::from(pixel.rgb[0]) * PI - 100.0 - hit.x).abs() < 1e-4,
                    "{pixel:?} {hit}"
                );
                assert!((f64::from(pixel.rgb[1]) * PI - 100.0 - hit.z).abs() < 1e-4);
            }
        }
        assert!(seen > 1500, "{seen}");
    }
}

#[test]
fn shared_edges_leave_no_gap() {
    // The view's axis meets vertices and edges run along pixel centres: ties everywhere.
    let mut scene = empty();
    add(
        &mut scene,
        1,
        [DVec3::new(-4.0, -3.0, 0.0), DVec3::X * 8.0, DVec3::Y * 6.0],
    );
    let surfaces = lit(&scene, 48, |_, _, _| [PI; 3]);
    let camera = Camera {
        projection: Projection::Orthographic(3.0),
        ..eye(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 1.0)
    };
    for turn in [0.0, 0.3, 1.1] {
        let mut camera = camera.clone();
        camera.to_world *= DMat4::from_rotation_z(turn);
        camera.projection = Projection::Orthographic(if turn == 0.0 { 3.0 } else { 1.5 });
        let format = Format { grid: 3, ..SMALL };
        let picture =
            Picture::draw(&scene, &surfaces, &camera, &Exposure::new(0.1), format).unwrap();
        assert!(
            picture
                .pixels
                .iter()
                .all(|p| p.coverage == 1.0 && (p.rgb[0] - 1.0).abs() < 1e-6)
        );
    }
}

#[test]
fn each_side_shows_its_own_light() {
    let mut scene = empty();
    add(
        &mut scene,
        1,
        [DVec3::new(-4.0, -3.0, 0.0), DVec3::X * 8.0, DVec3::Y * 6.0],
    );
    let mut surfaces = lit(&scene, 2, |_, _, _| [PI; 3]);
    let draw = |scene: &Scene, surfaces: &[BakedSurface], z: f64| {
        let camera = eye(DVec3::new(0.0, 0.0, z), DVec3::ZERO, 0.5);
        let picture = Picture::draw(scene, surfaces, &camera, &Exposure::new(0.1), SMALL).unwrap();
        let pixel = picture.pixels[64 * 24 + 32];
        (pixel.coverage * pixel.rgb[1]).round()
    };
    let both =
        |surfaces: &[BakedSurface]| (draw(&scene, surfaces, 5.0), draw(&scene, surfaces, -5.0));
    assert_eq!(both(&surfaces), (1.0, 0.0));
    surfaces.push(output_room::back(&surfaces[0], 3.0));
    assert_eq!(both(&surfaces), (1.0, 3.0));
    // The order of the sheets does not matter.
    surfaces.reverse();
    assert_eq!(both(&surfaces), (1.0, 3.0));
}

#[test]
fn the_nearest_surface_wins_and_masks_have_holes() {
    let mut scene = empty();
    add(
        &mut scene,
        1,
        [DVec3::new(-4.0, -3.0, -1.0), DVec3::X * 8.0, DVec3::Y * 6.0],
    );
    add(
        &mut scene,
        0,
        [DVec3::new(-4.0, -3.0, 0.0), DVec3::X * 8.0, DVec3::Y * 6.0],
    );
    let texture = scene.materials[0].paint.take();
    for (i, pixel) in scene.images[0].pixels.iter_mut().enumerate() {
        pixel[3] = if i % 8 < 4 { 1.0 } else { 0.0 };
    }
    let surfaces = lit(&scene, 2, |s, _, _| {
        [if s.material == 0 { PI } else { 2.0 * PI }; 3]
    });
    let camera = eye(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.5);
    let front = |scene: &Scene| {
        let picture = Picture::draw(scene, &surfaces, &camera, &Exposure::new(0.1), SMALL).unwrap();
        picture.pixels.iter().filter(|p| p.rgb[0] < 1.5).count() as f64 / (64.0 * 48.0)
    };
    assert_eq!(front(&scene), 1.0);
    scene.materials[0].alpha = Alpha::Mask {
        cutoff: 0.5,
        factor: 1.0,
        texture,
    };
    let share = front(&scene);
    assert!((0.3..0.7).contains(&share), "{share}");
}

#[test]
fn paint_multiplies_light() {
    let mut scene = empty();
    scene.images[0].pixels.fill([0.5, 0.25, 0.1, 1.0]);
    add(
        &mut scene,
        0,
        [DVec3::new(-4.0, -3.0, 0.0), DVec3::X * 8.0, DVec3::Y * 6.0],
    );
    let surfaces = lit(&scene, 1, |_, _, _| [PI, 2.0 * PI, PI]);
    let camera = eye(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.5);
    let picture = Picture::draw(&scene, &surfaces, &camera, &Exposure::new(0.1), SMALL).unwrap();
    let [r, g, b] = picture.pixels[0].rgb;
    assert!((r - 0.5).abs() < 1e-6 && (g - 0.5).abs() < 1e-6 && (b - 0.1).abs() < 1e-6);
    // Y of linear sRGB by IEC 61966-2-1.
    assert!((picture.pixels[0].xyz[1] - (0.2126 * 0.5 + 0.7152 * 0.5 + 0.0722 * 0.1)).abs() < 1e-4);
}

#[test]
fn exposure_meters_what_the_camera_sees_without_lamps() {
    let mut scene = empty();
    let wall = [DVec3::ZERO, DVec3::X * 10.0, DVec3::Y * 10.0];
    add(&mut scene, 1, wall);
    add(&mut scene, 2, [DVec3::Z, DVec3::X, DVec3::Y]);
    // The strongest channel rises from 0 to 1000 along x.
    let light = |s: &Surface, p: DVec3| {
        let lamp = s.material == 2;
        [1.0, 0.5, 0.2].map(|c| if lamp { 1e6 } else { c * 100.0 * p.x })
    };
    let camera = |x: f64| Camera {
        projection: Projection::Orthographic(3.75),
        ..eye(DVec3::new(x, 5.0, 20.0), DVec3::new(x, 5.0, 0.0), 1.0)
    };
    let auto = |scene: &Scene| {
        let surfaces = lit(
            scene,
            100,
            |s, p, _| if p.z < 0.0 { [0.0; 3] } else { light(s, p) },
        );
        Exposure::auto(scene, &surfaces)
    };
    scene.cameras = vec![camera(5.0)];
    let look = auto(&scene);
    assert!((look.white_luminance() * PI * look.scale - 1.0).abs() < 1e-12);
    // A fifth of what is seen may be brighter than .9 of white: of 0 to 1000, what is above 800.
    assert!(look.scale * 800.0 < 0.91, "{look:?}");
    assert!(look.compressed.unwrap() < 0.35, "{look:?}");
    // The darker half is shown brighter.
    scene.cameras = vec![camera(0.0)];
    let darker = auto(&scene);
    assert!(
        (1.2..3.0).contains(&(darker.scale / look.scale)),
        "{darker:?}"
    );
    // A large wall that no light reaches changes nothing, in sight or not.
    let unlit = [DVec3::NEG_Z, DVec3::X * 100.0, DVec3::Y * 100.0];
    add(&mut scene, 1, unlit);
    assert!((auto(&scene).scale / darker.scale - 1.0).abs() < 1e-9);
    let dark = lit(&scene, 1, |_, _, _| [0.0; 3]);
    assert_eq!(Exposure::auto(&scene, &dark).scale, 1.0);
}

/// A furnished room lit by the exact light of a small square lamp, without interreflection.
fn furnished(inward_walls_only: bool) -> (Scene, Vec<BakedSurface>) {
    let mut scene = empty();
    let size = [DVec3::X * 5.0, DVec3::Y * 2.8, DVec3::Z * 4.0];
    add_box(&mut scene, 1, DVec3::ZERO, size, true);
    if !inward_walls_only {
        let thick = DVec3::splat(0.2);
        add_box(
            &mut scene,
            1,
            -thick,
            size.map(|s| s + 0.4 * s.normalize()),
            false,
        );
    }
    // Floor tiles just above the floor, a cupboard and a turned box.
    add(
        &mut scene,
        0,
        [
            DVec3::new(0.0, 0.001, 4.0),
            DVec3::X * 5.0,
            DVec3::NEG_Z * 4.0,
        ],
    );
    add_box(
        &mut scene,
        1,
        DVec3::new(0.3, 0.0, 0.1),
        [DVec3::X * 1.2, DVec3::Y * 1.9, DVec3::Z * 0.5],
        false,
    );
    let (u, w) = (DVec3::new(0.8, 0.0, 0.3), DVec3::new(-0.3, 0.0, 0.8));
    add_box(
        &mut scene,
        1,
        DVec3::new(3.0, 0.0, 1.2),
        [u, DVec3::Y * 0.7, w],
        false,
    );
    add(
        &mut scene,
        2,
        [DVec3::new(2.2, 2.79, 1.7), DVec3::X * 0.6, DVec3::Z * 0.6],
    );
    let lamp = DVec3::new(2.5, 2.79, 2.0);
    let surfaces = lit(&scene, 40, |surface, p, normal| {
        let outside =
            p.cmplt(DVec3::splat(-0.01)).any() || p.cmpgt(DVec3::new(5.01, 2.81, 4.01)).any();
        if surface.material == 2 {
            return [20000.0; 3];
        }
        let way = lamp - p;
        let direct = way.normalize().dot(normal).max(0.0) * (way.y / way.length())
            / way.length_squared().max(0.05);
        let color = if p.x < 0.001 {
            [0.6, 0.1, 0.08]
        } else if p.x > 4.999 {
            [0.1, 0.4, 0.15]
        } else {
            [0.7; 3]
        };
        color.map(|c| {
            if outside {
                0.0
            } else {
                c * (60.0 + 800.0 * direct)
            }
        })
    });
    (scene, surfaces)
}

#[test]
fn a_closed_room_is_seen_from_a_camera_of_our_own() {
    for (name, thin) in [("thin", true), ("thick", false)] {
        let (scene, surfaces) = furnished(thin);
        let look = Exposure::auto(&scene, &surfaces);
        let camera = camera::own(&scene).swap_remove(0);
        let picture = Picture::draw(&scene, &surfaces, &camera, &look, Format::default()).unwrap();
        let png = picture.to_png().unwrap();
        let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
        file::write_atomic(&folder.join(format!("output_{name}.png")), None, |w| {
            w.write_all(&png)
        })
        .unwrap();
        let lit = picture.pixels.iter().filter(|p| p.rgb[1] > 1.0).count() as f64;
        assert!(lit > 0.5 * picture.pixels.len() as f64, "{name}: {lit}");
        assert_eq!(
            image::load_from_memory(&png)
                .unwrap()
                .to_rgb8()
                .dimensions(),
            (960, 720)
        );
    }
}

#[test]
fn a_camera_of_the_file_is_used() {
    let scene = room();
    assert_eq!(camera::cameras(&scene).len(), 1);
    assert_eq!(camera::cameras(&scene)[0].name, "eye");
}

#[test]
fn pictures_are_the_same_on_one_and_two_threads() {
    let (scene, surfaces) = furnished(true);
    let camera = camera::own(&scene).swap_remove(0);
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let format = Format {
            width: 160,
            height: 120,
            grid: 2,
        };
        let picture = pool.install(|| {
            Picture::draw(&scene, &surfaces, &camera, &Exposure::new(1e-3), format).unwrap()
        });
        (picture.to_png().unwrap(), exr::to_exr(&picture).unwrap())
    };
    assert!(draw(1) == draw(2));
}

#[test]
fn exr_holds_radiance_by_named_channels() {
    let (scene, surfaces) = furnished(true);
    let camera = camera::own(&scene).swap_remove(0);
    let format = Format {
        width: 40,
        height: 30,
        grid: 1,
    };
    let picture = Picture::draw(&scene, &surfaces, &camera, &Exposure::new(1e-3), format).unwrap();
    let bytes = exr::to_exr(&picture).unwrap();
    let read = ::exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer();
    let read = read
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .unwrap();
    let list = &read.layer_data.channel_data.list;
    let names: Vec<String> = list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "R", "xyz.X", "xyz.Y", "xyz.Z"]);
    let green: Vec<f32> = list[2].sample_data.values_as_f32().collect();
    assert!(
        green
            .iter()
            .zip(&picture.pixels)
            .all(|(g, p)| *g == p.rgb[1])
    );
    let y: Vec<f32> = list[5].sample_data.values_as_f32().collect();
    assert!(y.iter().zip(&picture.pixels).all(|(y, p)| *y == p.xyz[1]));
}

#[test]
fn a_broken_mesh_or_format_is_refused() {
    let (scene, mut surfaces) = furnished(true);
    let camera = camera::own(&scene).swap_remove(0);
    let bad = Format { width: 0, ..SMALL };
    assert_eq!(
        Picture::draw(&scene, &surfaces, &camera, &Exposure::new(1.0), bad)
            .unwrap_err()
            .exit_code(),
        2
    );
    surfaces[0].vertices[0] = BakedVertex {
        triangle: 99,
        ..surfaces[0].vertices[0]
    };
    assert_eq!(
        Picture::draw(&scene, &surfaces, &camera, &Exposure::new(1.0), SMALL)
            .unwrap_err()
            .exit_code(),
        3
    );
}
