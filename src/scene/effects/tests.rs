use super::*;
use crate::scene::Options;
use std::path::Path;

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

fn running(scene: &Scene) -> Vec<String> {
    let plan = Plan::of(scene);
    plan.effects()
        .iter()
        .filter(|e| e.runs)
        .map(|e| e.name.clone())
        .collect()
}

#[test]
fn a_cornell_box_calls_for_colour_and_occlusion() {
    let plan = [
        "interreflection",
        "occlusion",
        "colour",
        "emissive surfaces",
    ];
    for name in ["cornell.glb", "cornell-closed.glb", "cornell-d65.glb"] {
        assert_eq!(running(&room(name)), plan, "{name}");
    }
}

#[test]
fn a_convex_empty_room_has_nothing_to_block() {
    assert_eq!(
        running(&room("convex.glb")),
        ["interreflection", "colour", "emissive surfaces"]
    );
}

#[test]
fn black_walls_pass_nothing_on_and_grey_ones_need_one_band() {
    assert_eq!(running(&room("cie171-5.4.glb")), ["point lights"]);
    assert_eq!(running(&room("cie171-5.3.glb")), ["emissive surfaces"]);
    assert_eq!(
        running(&room("cie171-5.7.glb")),
        ["occlusion", "emissive surfaces"]
    );
    assert_eq!(
        running(&room("cie171-5.8.glb")),
        ["interreflection", "point lights"]
    );
    assert_eq!(
        running(&room("furnace.glb")),
        ["interreflection", "emissive surfaces"]
    );
}

#[test]
fn two_lamps_are_two_light_spectra() {
    let scene = room("two-rooms.glb");
    assert!(Plan::of(&scene).runs(EffectKind::LightSpectra));
    assert_eq!(scene.spectra.len(), 2);
}

#[test]
fn a_lamp_outside_of_a_convex_room_is_blocked_by_its_walls() {
    let mut scene = room("cie171-5.4.glb");
    assert!(!Plan::of(&scene).runs(EffectKind::Occlusion));
    scene.lights[0].position = DVec3::new(2.0, 5.0, -2.0);
    assert!(Plan::of(&scene).runs(EffectKind::Occlusion));
    // Sunlight meets the backs of a closed room.
    scene.lights[0].kind = LightKind::Directional;
    assert!(Plan::of(&scene).runs(EffectKind::Occlusion));
    // But an open floor it lights without anything between.
    let mut floor = room("cie171-5.2-isotropic.glb");
    floor.lights[0].kind = LightKind::Directional;
    floor.lights[0].direction = DVec3::NEG_Y;
    assert!(!Plan::of(&floor).runs(EffectKind::Occlusion));
}

#[test]
fn a_dent_or_an_object_is_no_convex_room() {
    let mut scene = room("cie171-5.4.glb");
    // A corner drawn in by more than rounding.
    scene.surfaces[0].positions[0] += DVec3::splat(0.01);
    assert!(Plan::of(&scene).runs(EffectKind::Occlusion));
    assert!(Plan::of(&room("corridor.glb")).runs(EffectKind::Occlusion));
    // A single floor from which the walls were taken has nothing before it.
    assert!(!Plan::of(&room("cie171-5.2.glb")).runs(EffectKind::Occlusion));
}

#[test]
fn grey_paint_with_grey_texture_and_vertices_stays_one_band() {
    let mut scene = room("furnace.glb");
    scene
        .images
        .push(Image::new("t", 1, vec![[0.3, 0.3, 0.3, 1.0]]));
    scene.materials[0].paint = Some(super::super::Texture {
        image: 0,
        texcoord: 0,
        transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        wrap: [super::super::Wrap::Repeat; 2],
    });
    let plan = Plan::of(&scene);
    assert!(plan.runs(EffectKind::Textures) && !plan.runs(EffectKind::Colour));
    scene.surfaces[0].colors = Some(vec![
        [0.5, 0.5, 0.5, 1.0];
        scene.surfaces[0].positions.len()
    ]);
    assert!(!Plan::of(&scene).runs(EffectKind::Colour));
    scene.surfaces[0].colors.as_mut().unwrap()[0][0] = 0.6;
    assert!(Plan::of(&scene).runs(EffectKind::Colour));
    scene.surfaces[0].colors = None;
    scene.images[0].pixels[0][2] = 0.2;
    assert!(Plan::of(&scene).runs(EffectKind::Colour));
}

#[test]
fn the_plan_reads_as_a_table_and_as_json() {
    let plan = Plan::of(&room("convex.glb"));
    let text = plan.to_string();
    assert!(
        text.contains("occlusion              off      the room is convex and empty"),
        "{text}"
    );
    let json = serde_json::to_value(&plan).unwrap();
    assert_eq!(json[1]["name"], "occlusion");
    assert_eq!(json[1]["runs"], false);
}
