//! Rooms by other people, shown: no vertex brighter than lamps can make it, a camera that stands in the room, an exposure
//! that a person would choose.

use glam::{DVec3, Vec3};
use haarlight::color::{KM, Observer, encode, tristimulus};
use haarlight::gather::Baked;
use haarlight::gather::refined;
use haarlight::geometry::{NO_PLANE, nearest_point};
use haarlight::output::{Exposure, Format, Picture, camera};
use haarlight::scene::{Camera, LightKind, Options, Projection, Scene, Sides};
use haarlight::solve::{Bake, Settings};
use haarlight::spectrum::Spectrum;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A room of this repository.
fn own(name: &str) -> PathBuf {
    root("scenes").join(name)
}

fn bake(path: &Path) -> Option<(Bake, Baked)> {
    if !path.exists() {
        eprintln!("SKIPPED: there is no {}", path.display());
        return None;
    }
    let settings = Settings {
        // Coarse: what lamps can do and where cameras stand does not depend on it.
        error: 8.0,
        ..Settings::default()
    };
    let mut bake = Bake::new(Scene::load(path, &Options::default()).unwrap(), settings);
    bake.run();
    let baked = bake.baked(&|_, _| {});
    Some((bake, baked))
}

/// Vertices are drawn 2e-3 of their triangle inwards before light is looked at; share of the room's diagonal.
const BESIDE: f64 = 2e-3;

fn size(scene: &Scene) -> f64 {
    let all = || scene.surfaces.iter().flat_map(|s| &s.positions);
    let low = all().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = all().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    low.distance(high)
}

/// Lamps by what they can do at a point, unblocked: lux.
struct Lamps {
    /// Corners, luminance in cd/m2, both sides?
    areas: Vec<([DVec3; 3], f64, bool)>,
    /// Place and intensity, cd.
    points: Vec<(DVec3, f64)>,
    /// Where it shines, and lux.
    suns: Vec<(DVec3, f64)>,
    /// Vertices get the light a little beside them, up to this far.
    beside: f64,
}

impl Lamps {
    fn of(scene: &Scene) -> Self {
        let weights = Observer::cie1931().weights(&scene.grid);
        let y = |light: usize, shape: &Spectrum| {
            let power = &scene.spectra[light].power;
            let product: Spectrum = std::array::from_fn(|k| power[k] * shape[k]);
            KM * tristimulus(&product, &weights)[1]
        };
        let mut lamps = Self {
            areas: Vec::new(),
            points: Vec::new(),
            suns: Vec::new(),
            beside: BESIDE * size(scene),
        };
        for surface in &scene.surfaces {
            let material = &scene.materials[surface.material];
            let Some(emission) = &material.emission else {
                continue;
            };
            let luminance = y(emission.light, &emission.shape);
            for t in &surface.triangles {
                let corners = t.map(|c| surface.positions[c as usize]);
                lamps
                    .areas
                    .push((corners, luminance, material.sides == Sides::Both));
            }
        }
        for light in &scene.lights {
            let y = y(light.light, &light.shape);
            match light.kind {
                LightKind::Directional => lamps.suns.push((light.direction, y)),
                _ => lamps.points.push((light.position, y)),
            }
        }
        lamps
    }

    /// Illuminance at a point from all of them with nothing in the way, from above: a lamp's factor is at most pi, and at
    /// most its area over the square of the distance of its nearest point.
    fn most(&self, at: DVec3) -> f64 {
        let area = |&([a, b, c], luminance, both): &([DVec3; 3], f64, bool)| {
            let normal = (b - a).cross(c - a);
            if !both && (at - a).dot(normal.normalize_or_zero()) < -self.beside {
                return 0.0;
            }
            let near = (nearest_point(&[a, b, c], at).distance(at) - self.beside).max(0.0);
            luminance * (0.5 * normal.length() / near.powi(2)).min(PI)
        };
        let point = |(place, candela): &(DVec3, f64)| {
            candela / (place.distance(at) - self.beside).max(0.0).powi(2)
        };
        self.areas.iter().map(area).sum::<f64>()
            + self.points.iter().map(point).sum::<f64>()
            + self.suns.iter().map(|(_, lux)| lux).sum::<f64>()
    }
}

/// What the solver's leaves reflect at the most, lm/m2, and the greatest reflectance.
fn reflected(bake: &Bake) -> (f64, f64) {
    let rows = &bake.light().reflected;
    let y = |k: usize| bake.lanes().tristimulus(rows.row(k))[1];
    let leaves = bake.light().leaves.iter().map(|&leaf| y(leaf as usize));
    let rho = bake.scene().materials.iter().flat_map(|m| m.reflectance);
    (leaves.fold(0.0, f64::max), rho.fold(0.0, f64::max))
}

/// No written vertex gets more than its lamps can send it unblocked, and what the brightest surface reflects, all around it.
/// A leaf's light is a mean, so some places in it reflect more: twice is allowed. And no leaf reflects more than the
/// brightest place, lit by all lamps unblocked and by walls as bright as itself: B <= rho (D + B).
fn nothing_is_brighter_than_lamps_can_make_it(name: &str, bake: &Bake, baked: &Baked) {
    let lamps = Lamps::of(bake.scene());
    let (brightest, rho) = reflected(bake);
    let (mut most, mut wrong) = (0.0_f64, Vec::new());
    for sheet in &baked.surfaces {
        let surface = &bake.scene().surfaces[sheet.surface];
        for vertex in &sheet.vertices {
            let at = refined::position(surface, vertex);
            let direct = lamps.most(at);
            most = most.max(direct);
            let lux = f64::from(vertex.irradiance[1]);
            if lux > 1.05 * direct + 2.0 * brightest {
                wrong.push((lux, direct, at, &surface.name));
            }
        }
    }
    wrong.sort_by(|a, b| b.0.total_cmp(&a.0));
    assert!(
        wrong.is_empty(),
        "{name}: {} vertices are too bright (lux, lux from lamps, place), surfaces {brightest}: {:?}",
        wrong.len(),
        &wrong[..wrong.len().min(4)]
    );
    assert!(
        brightest <= rho / (1.0 - rho) * most,
        "{name}: a leaf reflects {brightest}, lamps bring {most}"
    );
}

/// Distances along a grid of rays of a camera, and the share of them that first meet a black back.
fn view(bake: &Bake, camera: &Camera) -> (Vec<f64>, f64) {
    let Projection::Perspective(angle) = camera.projection else {
        panic!("our cameras are perspective");
    };
    let eye = camera.to_world.w_axis.truncate() - bake.mesh().centre;
    let half = (0.5 * angle).tan();
    let (mut far, mut backs) = (Vec::new(), 0);
    for y in 0..18 {
        for x in 0..24 {
            let at = |k: i32, n: f64| (2.0 * f64::from(k) + 1.0) / n - 1.0;
            let ray = DVec3::new(at(x, 24.0) * half * 4.0 / 3.0, at(y, 18.0) * half, -1.0);
            let ray = camera.to_world.transform_vector3(ray).normalize();
            let to: Vec3 = ray.as_vec3();
            let hit = bake.rays().closest(eye.as_vec3(), to, f32::MAX, NO_PLANE);
            far.extend(hit.map(|h| f64::from(h.t)));
            let sides =
                |t: u32| bake.scene().materials[bake.mesh().material[t as usize] as usize].sides;
            backs += usize::from(
                hit.is_some_and(|h| h.from_behind && sides(h.triangle) == Sides::Front),
            );
        }
    }
    (far, backs as f64 / 432.0)
}

/// Luma of a picture as an eye sees it, 0 to 1, sorted.
fn shown(bake: &Bake, baked: &Baked, camera: &Camera, look: &Exposure) -> Vec<f64> {
    let format = Format {
        width: 160,
        height: 120,
        grid: 1,
    };
    let picture = Picture::draw(bake.scene(), &baked.surfaces, camera, look, format).unwrap();
    let luma = |rgb: [f32; 3]| {
        let linear = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        encode(f64::from(linear))
    };
    let mut all: Vec<f64> = picture.pixels.iter().map(|p| luma(p.shown)).collect();
    all.sort_by(f64::total_cmp);
    all
}

fn shown_well(name: &str, bake: &Bake, baked: &Baked) {
    let cameras = camera::cameras(bake.scene());
    let look = Exposure::metered(
        bake.scene(),
        &baked.surfaces,
        &cameras,
        Default::default(),
        Default::default(),
    );
    for camera in &cameras {
        let (mut far, backs) = view(bake, camera);
        assert!(backs < 0.05, "{name}: {backs} of the view are backs");
        assert!(
            far.len() > 300,
            "{name}: {} of 432 rays meet the room",
            far.len()
        );
        far.sort_by(f64::total_cmp);
        // Nothing right before the lens: a twentieth of the view may be nearer than a quarter of what is half way.
        let (near, middle) = (far[far.len() / 20], far[far.len() / 2]);
        assert!(near > 0.25 * middle, "{name}: {near} before {middle}");
    }
    let luma = shown(bake, baked, &cameras[0], &look);
    let at = |share: f64| luma[(share * (luma.len() - 1) as f64) as usize];
    assert!(
        (0.25..0.75).contains(&at(0.5)),
        "{name}: median {}",
        at(0.5)
    );
    assert!(
        at(0.75) < 0.92,
        "{name}: a quarter of the picture is at {}",
        at(0.75)
    );
    assert!(
        at(0.9) > 0.3,
        "{name}: 90 % of the picture are below {}",
        at(0.9)
    );
}

#[test]
fn rooms_of_this_repository() {
    for name in [
        "convex.glb",
        "cornell.glb",
        "cornell-closed.glb",
        "corridor.glb",
        "two-rooms.glb",
        "cie171-5.2.glb",
        "cie171-5.4.glb",
        "cie171-5.7.glb",
        "furnished.glb",
    ] {
        let (bake, baked) = bake(&own(name)).unwrap();
        nothing_is_brighter_than_lamps_can_make_it(name, &bake, &baked);
    }
}

/// Sun through a window, lamps in shades, lamps behind panels, spots in a gallery under a glass roof.
#[test]
fn rooms_by_others() {
    for name in [
        "sun-room",
        "vr-gallery",
        "garage",
        "living-kaykit",
        "home-theater-lit",
    ] {
        let path = root(&format!("../shared/scenes/{name}.glb"));
        if let Some((bake, baked)) = bake(&path) {
            shown_well(name, &bake, &baked);
            nothing_is_brighter_than_lamps_can_make_it(name, &bake, &baked);
        }
    }
}

/// Two rooms that do not see each other get a view each.
#[test]
fn every_space_has_its_camera() {
    let mut scene = Scene::load(own("two-rooms.glb"), &Options::default()).unwrap();
    let given = std::mem::take(&mut scene.cameras);
    let cameras = camera::cameras(&scene);
    assert!((2..=3).contains(&cameras.len()), "{}", cameras.len());
    let eye = |c: &Camera| c.to_world.w_axis.truncate();
    // Each of the file's own cameras has one of ours on its side of the wall between.
    let wall = 0.5 * (eye(&given[0]) + eye(&given[1]));
    let across = eye(&given[1]) - eye(&given[0]);
    let side = |c: &Camera| (eye(c) - wall).dot(across) > 0.0;
    assert!(cameras.iter().any(side) && !cameras.iter().all(side));
    assert_eq!(cameras[0].name, "view");
}
