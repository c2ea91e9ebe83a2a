//! Measured paper that no one dye explains: what it gives out moves to longer wavelengths with what excites it. The dense reference gets the
//! matrix itself, the solver the products that stand for it.

use crate::common::built;
use crate::common::desk;

use built::{Room, close};
use glam::DVec3;
use haarlight::color::{KM, Observer};
use haarlight::scene::{Material, Options, Scene};
use haarlight::solve::reference::Reference;
use haarlight::solve::{Representation, Settings};
use haarlight::spectrum::{BANDS, Grid, Spectrum};
use serde_json::json;
use std::path::Path;

/// Greatest error of a tristimulus value.
const POINT: f64 = 5e-3;

fn grid() -> Grid {
    Grid::new(300.0, 780.0)
}

fn bell(nm: f64, middle: f64, wide: f64) -> f64 {
    (-0.5 * ((nm - middle) / wide).powi(2)).exp()
}

/// Spectral exitance, W/m2/nm, for an irradiance of 1 W/m2 at a wavelength: up to 30 % of it, around 470 nm for what comes at 380, around
/// 518 for what comes at 440.
fn given(out: f64, taken: f64) -> f64 {
    let middle = 470.0 + 0.8 * (taken - 380.0);
    let height = 1.0 / (22.0 * std::f64::consts::TAU.sqrt());
    0.3 * bell(taken, 390.0, 30.0) * height * bell(out, middle, 22.0)
}

fn reflected(nm: f64) -> f64 {
    0.1 + 0.6 / (1.0 + ((400.0 - nm) / 15.0).exp())
}

/// As a spectrophotometer writes it, every 4 nm.
fn csv() -> String {
    let nm: Vec<f64> = (0..=100).map(|k| 300.0 + 4.0 * f64::from(k)).collect();
    let head: Vec<String> = nm.iter().map(f64::to_string).collect();
    let mut text = format!("per_nm,{}\n", head.join(","));
    for out in &nm {
        let cell = |taken: &f64| match taken == out {
            true => reflected(*out),
            false => given(*out, *taken),
        };
        let row: Vec<String> = nm.iter().map(|x| format!("{:e}", cell(x))).collect();
        text += &format!("{out},{}\n", row.join(","));
    }
    text
}

/// Means over the bands by the midpoint rule.
fn mean(band: usize, f: impl Fn(f64) -> f64) -> f64 {
    const N: u32 = 8;
    let grid = grid();
    let at = |k: u32| grid.left(band) + grid.width() * (f64::from(k) + 0.5) / f64::from(N);
    (0..N).map(|k| f(at(k))).sum::<f64>() / f64::from(N)
}

/// Exitance on a band for irradiance on another, straight from the formula.
fn matrix() -> Vec<Spectrum> {
    let width = grid().width();
    let element = |i: usize, j: usize| width * mean(i, |out| mean(j, |taken| given(out, taken)));
    (0..BANDS)
        .map(|i| std::array::from_fn(|j| element(i, j)))
        .collect()
}

/// The material as it is read, with its light spectra in the scene.
fn read() -> (Scene, Material) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-d65.glb");
    let options = Options {
        grid: grid(),
        said: Some(json!({"materials": {
            "green": {"reflectance": null, "fluorescence": {"csv": csv()}},
        }})),
        ..Options::default()
    };
    let scene = Scene::load(path, &options).unwrap();
    let green = scene.materials.iter().find(|m| m.name == "green").unwrap();
    let green = green.clone();
    (scene, green)
}

fn xyz(bands: &Spectrum) -> [f64; 3] {
    let weights = Observer::cie1931().weights(&grid());
    weights.map(|w| KM * w.iter().zip(bands).map(|(w, x)| w * x).sum::<f64>())
}

fn times(matrix: &[Spectrum], light: &Spectrum) -> Spectrum {
    std::array::from_fn(|i| matrix[i].iter().zip(light).map(|(m, x)| m * x).sum())
}

/// Mean wavelength of a spectrum.
fn centre(bands: &Spectrum) -> f64 {
    let moment = (0..BANDS).map(|k| grid().middle(k) * bands[k]);
    moment.sum::<f64>() / bands.iter().sum::<f64>()
}

/// How far the products are off is what is said of them, of the matrix on the bands.
#[test]
fn products_are_as_near_as_is_said() {
    let (scene, paper) = read();
    let dye = paper.fluorescence.as_ref().unwrap();
    assert!(dye.terms.len() > 2, "{}", dye.from);
    let said = dye.from.split("off by ").nth(1).unwrap();
    let said: f64 = said.split(' ').next().unwrap().parse().unwrap();
    let found = dye.matrix(&scene.spectra, grid().width());
    let (mut missed, mut all) = (0.0, 0.0);
    for (got, want) in found.iter().flatten().zip(matrix().iter().flatten()) {
        missed += (got - want).powi(2);
        all += want * want;
    }
    let off = 100.0 * (missed / all).sqrt();
    println!("{}: {off:.2} % on the bands", dye.from);
    // Between its wavelengths, 4 nm apart, a table is linear: .2 % of bells 22 nm wide.
    assert!((off - said).abs() < 0.3, "{off} {}", dye.from);
    for (k, rho) in paper
        .reflectance
        .iter()
        .enumerate()
        .filter(|(k, _)| *k < 53)
    {
        close(*rho, mean(k, reflected), 3e-3, "the diagonal");
    }
}

/// A desk in a closed room; the paper takes half of it.
fn desk(light: Spectrum) -> (Scene, usize) {
    let (scene, paper) = read();
    let mut room = Room::over(grid());
    let lamp = room.spectrum("lamp", light);
    let sheet = room.spectral_paint(paper.reflectance);
    for term in &paper.fluorescence.as_ref().unwrap().terms {
        room.fluoresces(sheet, scene.spectra[term.light].power, term.excitation);
    }
    let (plain, glow, wall) = (room.paint(0.5), room.paint(0.6), room.paint(0.4));
    room.glow(glow, lamp, 5000.0);
    desk::furnish(&mut room, [sheet, plain, glow], [wall; 4]);
    (room.scene(), sheet)
}

/// Under ultraviolet light the paper glows blue, under violet light green: irradiance at points and what the paper shows, against the reference
/// with the matrix itself.
#[test]
fn a_matrix_of_many_products_agrees_with_itself() {
    let raw = matrix();
    let mut centres = Vec::new();
    for middle in [365.0, 430.0] {
        let lamp: Spectrum = std::array::from_fn(|k| {
            let nm = grid().middle(k);
            bell(nm, middle, 10.0) + 0.15 * bell(nm, 600.0, 60.0)
        });
        let (scene, sheet) = desk(lamp);
        let mut reference = Reference::new(&scene, 2, 1).unwrap();
        reference.donaldson[sheet] = Some(raw.clone());
        let solution = reference.solve();
        let points = desk::points();
        let truth = reference.gather(&scene, &solution, &points, 1);
        for representation in [Representation::Adaptive, Representation::Dense] {
            let settings = Settings {
                error: 0.1,
                representation,
                ..Settings::default()
            };
            let bake = built::run(scene.clone(), settings);
            let what = format!("{middle} nm, {representation:?}");
            for (got, truth) in bake.probe(&points).iter().zip(&truth) {
                for (got, want) in got.xyz.into_iter().zip(xyz(truth)) {
                    close(got, want, POINT, &what);
                }
            }
            // Every vertex is held to its own light, however few there are.
            let written = built::baked_within(4000, &bake);
            let paper = written.surfaces.iter().find(|s| s.surface == 0).unwrap();
            let surface = &scene.surfaces[0];
            let mut seen = 0;
            for vertex in paper.vertices.iter().step_by(5) {
                let corners = surface.triangles[vertex.triangle as usize];
                let place: DVec3 = (0..3)
                    .map(|k| surface.positions[corners[k] as usize] * vertex.weights[k])
                    .sum();
                // In corners the reference's patches, of 25 cm, are too coarse.
                let inside = |x: f64| x > 0.3 && x < 1.7;
                if !(inside(place.x) && inside(place.z) && place.x < 0.95) {
                    continue;
                }
                let light = &reference.gather(&scene, &solution, &[(place, DVec3::Y)], 1)[0];
                let glow = times(&raw, light);
                let rho = &scene.materials[sheet].reflectance;
                let sent: Spectrum = std::array::from_fn(|k| rho[k] * light[k] + glow[k]);
                for (got, want) in vertex.radiosity.into_iter().zip(xyz(&sent)) {
                    close(f64::from(got), want, POINT, &what);
                }
                // What fluoresces is no small part of it.
                let [of, all] = [xyz(&glow), xyz(&sent)];
                let is_much = (0..3).any(|k| of[k] > 0.1 * all[k]);
                assert!(is_much, "{of:?} of {all:?}");
                centres.push((middle, centre(&glow)));
                seen += 1;
            }
            assert!(seen > 2, "{seen}");
        }
    }
    let of = |middle: f64| centres.iter().filter(move |c| c.0 == middle).map(|c| c.1);
    let bluest = of(365.0).fold(0.0, f64::max);
    let greenest = of(430.0).fold(f64::INFINITY, f64::min);
    println!("given out at {bluest:.0} and at {greenest:.0} nm");
    assert!(greenest > bluest + 30.0, "{bluest} {greenest}");
}
