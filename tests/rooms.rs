//! Rooms from other tools, read whole: what stands in their notes must come out.
//!
//! They are looked for in the folder that HAARLIGHT_ROOMS names, else in `../shared/scenes`; without it these tests pass
//! without looking.

use haarlight::scene::document::{Document, RawLightKind};
use haarlight::scene::geometry::Geometry;
use std::path::PathBuf;

fn rooms() -> Option<PathBuf> {
    let named = std::env::var_os("HAARLIGHT_ROOMS").map(PathBuf::from);
    let folder =
        named.unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes"));
    folder.is_dir().then_some(folder)
}

fn load(name: &str) -> Option<(Document, Geometry)> {
    let document = Document::open(rooms()?.join(name)).unwrap();
    let geometry = document.load_geometry().check().unwrap();
    for surface in &geometry.surfaces {
        let vertices = surface.positions.len();
        assert!(
            surface
                .triangles
                .iter()
                .flatten()
                .all(|&i| (i as usize) < vertices)
        );
        assert!(surface.normals.as_ref().is_none_or(|n| n.len() == vertices));
        assert!(surface.texcoords.iter().all(|t| t.len() == vertices));
        assert!(surface.material < document.raw_materials().len());
        for normal in surface.normals.iter().flatten() {
            assert!((normal.length() - 1.0).abs() < 1e-4);
        }
    }
    Some((document, geometry))
}

fn triangles(geometry: &Geometry) -> usize {
    geometry.surfaces.iter().map(|s| s.triangles.len()).sum()
}

/// Width, height and depth of everything.
fn extent(geometry: &Geometry) -> [f64; 3] {
    let points = || geometry.surfaces.iter().flat_map(|s| &s.positions);
    [0, 1, 2].map(|k| {
        let most = points().map(|p| p[k]).fold(f64::MIN, f64::max);
        let least = points().map(|p| p[k]).fold(f64::MAX, f64::min);
        most - least
    })
}

#[test]
fn cornell_box() {
    let Some((document, geometry)) = load("cornell-bevy.glb") else {
        return;
    };
    assert_eq!(triangles(&geometry), 36);
    assert!(
        (extent(&geometry)[0] - 556.0).abs() < 1.0,
        "{:?}",
        extent(&geometry)
    );
    let lamps = document
        .raw_materials()
        .iter()
        .filter(|m| m.emissive_factor != [0.0; 3]);
    assert_eq!(lamps.count(), 1);
    assert!(document.raw_lights().is_empty());
}

#[test]
fn home_theater_from_separate_files() {
    let Some((document, geometry)) = load("home-theater/home-theater.gltf") else {
        return;
    };
    // Ten of the 7,915 triangles have three points on a line.
    assert_eq!(triangles(&geometry), 7905);
    let flat = "10 triangles have no area";
    assert!(geometry.warnings.iter().any(|w| w.starts_with(flat)));
    assert_eq!(document.raw_materials().len(), 20);
    let [x, y, z] = extent(&geometry);
    assert!((x - 6.1).abs() < 0.1 && (y - 3.3).abs() < 0.1 && (z - 7.1).abs() < 0.1);
}

#[test]
fn home_theater_lit() {
    let Some((document, geometry)) = load("home-theater-lit.glb") else {
        return;
    };
    assert_eq!(triangles(&geometry), 7905);
    let [light] = document.raw_lights() else {
        panic!("one spot")
    };
    assert_eq!(
        (light.kind, light.name.as_str()),
        (RawLightKind::Spot, "projector")
    );
    assert_eq!(
        (light.intensity, light.inner, light.outer),
        (700.0, 0.3, 0.45)
    );
}

#[test]
fn living_room_with_textures() {
    let Some((document, geometry)) = load("living-kaykit.glb") else {
        return;
    };
    assert_eq!(triangles(&geometry), 13_898);
    assert!(geometry.warnings.is_empty(), "{:?}", geometry.warnings);
    assert_eq!(geometry.images.len(), 4);
    assert!(
        geometry
            .images
            .iter()
            .all(|image| image.pixels.len() == image.width * image.height)
    );
    assert!(geometry.images.iter().all(|image| image.width > 1));
    assert_eq!(document.raw_lights().len(), 2);
}

#[test]
fn canteen_with_instances() {
    let Some((document, geometry)) = load("canteen-big.glb") else {
        return;
    };
    assert_eq!(triangles(&geometry), 260_812);
    assert_eq!(document.raw_lights().len(), 8);
}
