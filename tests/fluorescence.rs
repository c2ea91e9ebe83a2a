//! Fluorescence: light that comes at some wavelengths leaves at others, and no more of it.

use crate::common;
use crate::common::built;
use crate::common::desk;

use built::{Room, close, sphere};
use glam::{DVec3, dvec3};
use haarlight::audit::{Audit, PathReference as Traced, Report};
use haarlight::color::{KM, Observer};
use haarlight::gather::Baked;
use haarlight::keep::Relighter;
use haarlight::scene::effects::EffectKind;
use haarlight::scene::{Options, Scene};
use haarlight::solve::reference::Reference;
use haarlight::solve::{Bake, Representation, Settings, Verdict};
use haarlight::spectrum::{BANDS, Grid, Spectrum};
use serde_json::{Value, json};
use std::path::PathBuf;

/// From where D65 and A are tabulated.
fn ultraviolet() -> Grid {
    Grid::new(300.0, 780.0)
}

/// A bell on the bands.
fn bell(grid: &Grid, height: f64, middle: f64, wide: f64) -> Spectrum {
    std::array::from_fn(|k| height * (-0.5 * ((grid.middle(k) - middle) / wide).powi(2)).exp())
}

/// Brought to an integral of 1.
fn unit(grid: &Grid, spectrum: Spectrum) -> Spectrum {
    let sum = spectrum.iter().sum::<f64>() * grid.width();
    spectrum.map(|x| x / sum)
}

fn named(grid: &Grid, name: &str) -> Spectrum {
    let table = haarlight::data::named(name).unwrap().table;
    grid.means(&table, haarlight::data::Outside::Zero)
}

fn settings(error: f64) -> Settings {
    Settings {
        error,
        ..Settings::default()
    }
}

fn baked(scene: Scene, error: f64) -> Bake {
    built::run(scene, settings(error))
}

/// Three tristimulus values.
fn alike(got: [f64; 3], want: [f64; 3], tolerance: f64, what: &str) {
    for (got, want) in got.into_iter().zip(want) {
        close(got, want, tolerance, what);
    }
}

fn xyz(grid: &Grid, bands: &Spectrum) -> [f64; 3] {
    let weights = Observer::cie1931().weights(grid);
    weights.map(|w| KM * w.iter().zip(bands).map(|(w, x)| w * x).sum::<f64>())
}

fn scene(name: &str, options: &Options) -> Scene {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes");
    Scene::load(path.join(name), options).unwrap()
}

/// `scenes/brightened.glb` with its ultraviolet light.
fn brightened() -> Scene {
    let options = Options {
        grid: ultraviolet(),
        ..Options::default()
    };
    scene("brightened.glb", &options)
}

/// A closed room all of whose walls are alike: light is even, and every band has a closed form,
/// `E = (L + e q) / (1 - rho)` with `q = w sum g E`. The emission excites itself, too. By polygons and by rays, and on the bands.
#[test]
fn a_furnace_has_the_gain_of_its_walls() {
    let grid = ultraviolet();
    let w = grid.width();
    let emission = unit(&grid, bell(&grid, 1.0, 440.0, 25.0));
    let rho: Spectrum = std::array::from_fn(|k| 0.15 + 0.5 * k as f64 / 63.0);
    for (height, crowded) in [(0.3, false), (0.7, false), (0.7, true)] {
        let excitation = bell(&grid, height, 395.0, 30.0);
        let mut room = Room::over(grid);
        let lamp = room.spectrum("D65", named(&grid, "cie/D65"));
        let wall = room.spectral_paint(rho);
        room.glow(wall, lamp, 100.0);
        room.fluoresces(wall, emission, excitation);
        room.hollow(DVec3::ZERO, dvec3(3.0, 2.5, 3.0), [wall; 6]);
        if crowded {
            let (corners, triangles) = sphere(dvec3(0.6, 1.0, 1.5), 0.3, 2);
            room.mesh(corners, triangles, wall);
        }
        let lit = room.power(lamp).map(|p| 100.0 * p);
        let sum = |f: &dyn Fn(usize) -> f64| (0..BANDS).map(f).sum::<f64>();
        let first = w * sum(&|k| excitation[k] * lit[k] / (1.0 - rho[k]));
        let again = w * sum(&|k| excitation[k] * emission[k] / (1.0 - rho[k]));
        let q = first / (1.0 - again);
        let want: Spectrum = std::array::from_fn(|k| (lit[k] + emission[k] * q) / (1.0 - rho[k]));
        let bake = baked(room.scene(), 0.2);
        let round = bake.rounds().last().unwrap();
        let rounds = round.fluorescence_rounds;
        assert!(rounds > 2, "it excites itself: {rounds}, {again}");
        let mut mean = [0.0; BANDS];
        for k in 0..16 {
            let (x, z) = (0.35 + 0.77 * f64::from(k % 4), 0.3 + 0.8 * f64::from(k / 4));
            let light = bake.probe(&[(dvec3(x, 0.0, z), DVec3::Y)])[0].spectrum;
            mean = std::array::from_fn(|k| mean[k] + light[k] / 16.0);
        }
        let (got, want) = (xyz(&grid, &mean), xyz(&grid, &want));
        alike(got, want, 2e-3, &format!("{height} {crowded}"));
        // Every wall shows what it sends out: E, without what it gives out of itself as a lamp that is E again.
        let written = built::baked_within(4000, &bake);
        let (mut room, mut squares, mut count) = ([0.0; 3], 0.0, 0.0);
        for part in written.surfaces.iter().filter(|part| part.surface < 6) {
            let sum = part.vertices.iter().fold([0.0; 3], |sum, vertex| {
                std::array::from_fn(|c| sum[c] + f64::from(vertex.radiosity[c]))
            });
            let shown = sum.map(|x| x / part.vertices.len() as f64);
            // All vertices of a wall look in the same directions.
            alike(shown, want, 1e-2, &format!("wall {}", part.surface));
            room = std::array::from_fn(|c| room[c] + shown[c] / 6.0);
            let shares = part
                .vertices
                .iter()
                .flat_map(|vertex| (0..3).map(|c| f64::from(vertex.radiosity[c]) / want[c] - 1.0));
            squares += shares.map(|off| off * off).sum::<f64>();
            count += 3.0 * part.vertices.len() as f64;
        }
        alike(room, want, 4e-3, "all walls");
        // Paths beside the ball choose among lamps that are everywhere: single vertices are noisy.
        let each = f64::sqrt(squares / count);
        let most = if crowded { 7e-3 } else { 2e-3 };
        assert!(each < most, "vertices are off by {each}");
        let flux = round.flux;
        assert!(
            flux.fluoresced_lm > 0.0 && flux.worst_band < 0.02,
            "{flux:?}"
        );
    }
}

/// A desk with a sheet of brightened paper, half of it not brightened, below a lamp in a coloured room.
fn desk(light: Spectrum, grid: Grid) -> (Room, [Spectrum; 3]) {
    let mut room = Room::over(grid);
    let lamp = room.spectrum("lamp", light);
    let rise = |low: f64, high: f64, middle: f64| -> Spectrum {
        std::array::from_fn(|k| {
            low + (high - low) / (1.0 + ((middle - grid.middle(k)) / 15.0).exp())
        })
    };
    let paper = rise(0.1, 0.85, 390.0);
    let (sheet, plain) = (room.spectral_paint(paper), room.spectral_paint(paper));
    let excitation = bell(&grid, 0.6, 370.0, 25.0);
    let emission = unit(&grid, bell(&grid, 1.0, 440.0, 22.0));
    room.fluoresces(sheet, emission, excitation);
    let glow = room.paint(0.6);
    room.glow(glow, lamp, 5000.0);
    let (red, blue) = (
        room.spectral_paint(rise(0.05, 0.7, 590.0)),
        room.spectral_paint(rise(0.6, 0.1, 500.0)),
    );
    let white = room.spectral_paint(rise(0.06, 0.8, 400.0));
    desk::furnish(&mut room, [sheet, plain, glow], [red, blue, white, white]);
    (room, [paper, emission, excitation])
}

/// White paper with and without a brightener under D65, and under A without ultraviolet, against the dense reference with the whole
/// 64 x 64 matrix: irradiance at points, and what the paper shows.
#[test]
fn white_paper_agrees_with_the_whole_matrix() {
    let grid = ultraviolet();
    let cut: Spectrum = {
        let a = named(&grid, "cie/A");
        std::array::from_fn(|k| if grid.left(k) < 435.0 { 0.0 } else { a[k] })
    };
    let mut blueness = Vec::new();
    for (light, what) in [(named(&grid, "cie/D65"), "D65"), (cut, "A, cut")] {
        let (room, [paper, emission, excitation]) = desk(light, grid);
        let scene = room.scene();
        let reference = Reference::new(&scene, 3, 1).unwrap();
        let solution = reference.solve();
        let points = desk::points();
        let truth = reference.gather(&scene, &solution, &points, 1);
        for representation in [Representation::Adaptive, Representation::Dense] {
            let settings = Settings {
                representation,
                ..settings(0.1)
            };
            let bake = built::run(scene.clone(), settings);
            if representation == Representation::Adaptive {
                assert!(bake.lanes().is_ratio(), "{} lanes", bake.lanes().len());
            }
            for (got, truth) in bake.probe(&points).iter().zip(&truth) {
                let want = xyz(&grid, truth);
                alike(got.xyz, want, 5e-3, what);
            }
            // Every vertex is held to its own light, however few there are.
            let written = built::baked_within(4000, &bake);
            let mut seen = 0;
            // Blue of the brightened half as it is, and as it would be without what it fluoresces.
            let mut blue = [0.0; 2];
            for surface in [0, 1] {
                let paint = &scene.surfaces[surface];
                let part = written
                    .surfaces
                    .iter()
                    .find(|s| s.surface == surface)
                    .unwrap();
                for vertex in part.vertices.iter().step_by(5) {
                    let corners = paint.triangles[vertex.triangle as usize];
                    let place: DVec3 = (0..3)
                        .map(|k| paint.positions[corners[k] as usize] * vertex.weights[k])
                        .sum();
                    // In corners the reference's patches, of an eighth of a metre, are too coarse.
                    let inside = |x: f64| x > 0.3 && x < 1.7;
                    let own = (place.x - 1.0).abs() > 0.05;
                    if !(inside(place.x) && inside(place.z) && own) {
                        continue;
                    }
                    let light = &reference.gather(&scene, &solution, &[(place, DVec3::Y)], 1)[0];
                    let taken = excitation.iter().zip(light).map(|(g, e)| g * e);
                    let q = taken.sum::<f64>() * grid.width();
                    let q = if surface == 0 { q } else { 0.0 };
                    let sent: Spectrum =
                        std::array::from_fn(|k| paper[k] * light[k] + emission[k] * q);
                    let want = xyz(&grid, &sent);
                    alike(vertex.radiosity.map(f64::from), want, 5e-3, what);
                    if surface == 0 {
                        let plain = std::array::from_fn(|k| paper[k] * light[k]);
                        blue[0] += want[2];
                        blue[1] += xyz(&grid, &plain)[2];
                    }
                    seen += 1;
                }
            }
            assert!(seen > 4, "{seen}");
            blueness.push(blue[0] / blue[1]);
        }
    }
    // Under daylight the brightened half is bluer for it, without ultraviolet it is not.
    let differs = blueness[0] > 1.05 && (blueness[2] - 1.0).abs() < 0.01;
    assert!(differs, "{blueness:?}");
}

/// The path tracer changes wavelength by rules of its own, and finds the furnace's closed form and what the dense reference finds.
#[test]
fn paths_change_their_wavelength() {
    let grid = ultraviolet();
    let (room, _) = desk(named(&grid, "cie/D65"), grid);
    let scene = room.scene();
    let reference = Reference::new(&scene, 2, 1).unwrap();
    let solution = reference.solve();
    let points = desk::points();
    let truth = reference.gather(&scene, &solution, &points, 1);
    let bake = Bake::new(scene, Settings::default());
    let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
    let starts: Vec<(DVec3, DVec3, u32)> = points
        .iter()
        .map(|&(at, normal)| {
            let centred = at - bake.mesh().centre;
            let near = |t: &usize| {
                let [a, ..] = bake.mesh().triangles[*t].map(|v| bake.mesh().positions[v as usize]);
                let n = bake.mesh().normal[*t];
                n.dot(normal) > 0.999 && n.dot(centred - a).abs() < 1e-9
            };
            let triangle = (0..bake.mesh().triangles.len()).find(near).unwrap();
            (centred, normal, bake.mesh().plane[triangle])
        })
        .collect();
    let answers = audit.irradiance(&starts, &vec![1 << 14; starts.len()], 7);
    // The blue that is fluoresced among it: 440 nm.
    let blue = grid.band_of(440.0).unwrap();
    let mut chi = [0.0; 2];
    for (answer, truth) in answers.iter().zip(&truth) {
        let luminous = Observer::cie1931().weights(&grid)[1].map(|y| KM * y);
        let band: Spectrum = std::array::from_fn(|k| f64::from(u8::from(k == blue)));
        for (chi, weights) in chi.iter_mut().zip([luminous, band]) {
            let (mean, error) = answer.linear(&weights);
            let want: f64 = truth.iter().zip(&weights).map(|(x, w)| x * w).sum();
            *chi += ((mean - want) / error.max(2e-3 * want)).powi(2);
            close(mean, want, 0.05, "a path");
        }
    }
    // 16 points: a mean square of 2 has a chance of 1 in 100.
    assert!(chi.iter().all(|c| *c / 16.0 < 2.0), "{chi:?}");
}

/// Power that surfaces absorb, less what they give out again, is what lamps give out: nothing is made.
#[test]
fn no_more_power_leaves_than_comes() {
    let grid = ultraviolet();
    let w = grid.width();
    for (height, rho, middle) in [(0.5, 0.4, 380.0), (0.95, 0.04, 500.0), (0.09, 0.9, 420.0)] {
        let emission = unit(&grid, bell(&grid, 1.0, middle + 60.0, 25.0));
        let excitation = bell(&grid, height, middle, 40.0);
        let mut room = Room::over(grid);
        let lamp = room.spectrum("D65", named(&grid, "cie/D65"));
        let (wall, paint) = (room.paint(0.6), room.paint(rho));
        room.fluoresces(paint, emission, excitation);
        let glow = room.paint(0.5);
        room.glow(glow, lamp, 1000.0);
        room.hollow(
            DVec3::ZERO,
            dvec3(3.0, 2.5, 3.0),
            [wall, paint, paint, glow, wall, wall],
        );
        let input: f64 = room.power(lamp).iter().sum::<f64>() * 1000.0 * w * 9.0;
        let bake = baked(room.scene(), 0.5);
        let light = bake.light();
        let (mut absorbed, mut again) = (0.0, 0.0);
        for (row, &leaf) in light.leaves.iter().enumerate() {
            let node = bake.tree().node(leaf);
            let triangle = bake.tree().faces[node.faces.0 as usize].triangle;
            let material =
                &bake.scene().materials[bake.mesh().material[triangle as usize] as usize];
            let e = bake.lanes().spectrum(light.irradiance.row(row));
            let taken = (0..BANDS).map(|k| (1.0 - material.reflectance[k]) * e[k]);
            absorbed += node.area * w * taken.sum::<f64>();
            if material.fluorescence.is_some() {
                let given = (0..BANDS).map(|k| excitation[k] * e[k]);
                again += node.area * w * given.sum::<f64>();
            }
        }
        // What of the emission lies beyond the bands is lost.
        close(absorbed - again, input, 5e-3, "power");
        assert!(again > 0.0 && again < absorbed);
    }
}

/// Everything that is written of a room after two rounds.
fn written(scene: Scene) -> (Vec<Vec<haarlight::gather::BakedVertex>>, u64) {
    let mut bake = Bake::new(scene, settings(4.0));
    bake.step();
    bake.step();
    let Baked { surfaces, rays, .. } = bake.baked(&|_, _| {});
    (surfaces.into_iter().map(|s| s.vertices).collect(), rays)
}

/// A room with more said of its green wall.
fn cornell(more: Value) -> Result<Scene, String> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-d65.glb");
    let options = Options {
        said: Some(json!({"materials": {"green": more}})),
        ..Options::default()
    };
    Scene::load(path, &options).map_err(|e| e.to_string())
}

fn dye(excitation: &str, emission: &str, quantum: f64) -> Value {
    json!({"excitation": {"csv": excitation}, "emission": {"csv": emission}, "yield": quantum})
}

/// A yield of 0, and an excitation that no band holds, change no byte, cast no ray and do not run.
#[test]
fn what_nothing_excites_costs_nothing() {
    let plain = written(cornell(json!({})).unwrap());
    for (excitation, quantum) in [("400,0.5\n500,0.5", 0.0), ("300,0.5\n360,0.5", 0.9)] {
        let with = cornell(json!({"fluorescence": dye(excitation, "500,1\n600,1", quantum)}));
        let with = with.unwrap();
        let plan = haarlight::scene::effects::Plan::of(&with);
        assert!(!plan.runs(EffectKind::Fluorescence));
        let said = with.warnings.iter().any(|w| w.contains("--range 300..780"));
        assert_eq!(said, quantum > 0.0, "{:?}", with.warnings);
        assert!(written(with) == plain, "{excitation}");
    }
    let with = cornell(json!({"fluorescence": dye("400,0.5\n500,0.5", "500,1\n600,1", 0.5)}));
    let with = with.unwrap();
    let plan = haarlight::scene::effects::Plan::of(&with);
    assert!(plan.runs(EffectKind::Fluorescence));
    assert!(plan.to_string().contains("1 material: 'green'"), "{plan}");
    assert!(written(with) != plain);
}

/// The matrix of two dyes, written as a CSV per nm and per band, comes to what their two entries come to.
#[test]
fn a_matrix_of_two_dyes_is_its_two_entries() {
    let bump = |nm: f64, middle: f64, wide: f64| (-0.5 * ((nm - middle) / wide).powi(2)).exp();
    let nm: Vec<f64> = (0..=80).map(|k| 380.0 + 5.0 * f64::from(k)).collect();
    let rows = |f: &dyn Fn(f64) -> f64| {
        let row = |x: &f64| format!("{x},{:e}", f(*x));
        nm.iter().map(row).collect::<Vec<String>>().join("\n")
    };
    let dyes = [
        (420.0, 18.0, 480.0, 20.0, 0.6),
        (500.0, 25.0, 590.0, 18.0, 0.8),
    ];
    let entries: Vec<Value> = dyes
        .iter()
        .map(|&(a, da, e, de, quantum)| {
            dye(
                &rows(&|x| 0.7 * bump(x, a, da)),
                &rows(&|x| bump(x, e, de)),
                quantum,
            )
        })
        .collect();
    let two = cornell(json!({"fluorescence": entries})).unwrap();
    // By hand: emission of power 1, excitation times yield and the share of energy that a photon keeps.
    let element = |out: f64, taken: f64| -> f64 {
        let each = dyes.iter().map(|&(a, da, e, de, quantum)| {
            let sum = |power: i32| -> f64 {
                let part = |x: &f64| x.powi(power) * bump(*x, e, de);
                nm.iter().map(part).sum::<f64>() * 5.0
            };
            let mean = sum(1) / sum(0);
            bump(out, e, de) / sum(0) * 0.7 * bump(taken, a, da) * (quantum * taken / mean).min(1.0)
        });
        each.sum()
    };
    let width = two.grid.width();
    let of = |scene: &Scene| {
        let green = scene.materials.iter().find(|m| m.name == "green").unwrap();
        let f = green.fluorescence.as_ref().unwrap();
        (
            f.terms.len(),
            f.matrix(&scene.spectra, width),
            f.from.clone(),
        )
    };
    let (count, want, _) = of(&two);
    assert_eq!(count, 2);
    let most = want.iter().flatten().copied().fold(0.0, f64::max);
    for (unit, size) in [("per_nm", 1.0), ("per_band", 5.0)] {
        let head: Vec<String> = nm.iter().map(f64::to_string).collect();
        let mut text = format!("{unit},{}\n", head.join(","));
        for out in &nm {
            let cell = |taken: &f64| match taken == out {
                true => 0.0,
                false => size * element(*out, *taken),
            };
            let row: Vec<String> = nm
                .iter()
                .map(|taken| format!("{:e}", cell(taken)))
                .collect();
            text += &format!("{out},{}\n", row.join(","));
        }
        let whole = cornell(json!({"fluorescence": {"csv": text}})).unwrap();
        let (count, matrix, from) = of(&whole);
        assert_eq!(count, 2, "{from}");
        assert!(from.contains("2 spectra of emission, off by 0."), "{from}");
        for (got, want) in matrix.iter().flatten().zip(want.iter().flatten()) {
            assert!((got - want).abs() < 0.01 * most, "{got} {want} of {most}");
        }
    }
}

/// A matrix's diagonal is the reflectance.
#[test]
fn the_diagonal_is_the_reflectance() {
    let text = "per_band,400,500,600\n400,0.2,0,0\n500,0.3,0.4,0\n600,0,0.1,0.6\n";
    let scene = cornell(json!({"reflectance": null, "fluorescence": {"csv": text}})).unwrap();
    let green = scene.materials.iter().find(|m| m.name == "green").unwrap();
    let band = |nm: f64| green.reflectance[scene.grid.band_of(nm).unwrap()];
    close(band(500.0), 0.4, 0.05, "at 500 nm");
    close(band(700.0), 0.6, 1e-9, "beyond");
    assert!(green.reflectance_from.contains("diagonal"));
}

/// Whatever is wrong is told with the file, the material and the place in it.
#[test]
fn wrong_dyes_are_refused_by_name() {
    let good = ("400,0.5\n500,0.5", "500,1\n600,1");
    for (more, wanted) in [
        (
            dye(good.0, good.1, 1.5),
            "its yield is 1.5; give the quantum yield",
        ),
        (
            json!({"excitation": {"csv": good.0}, "emission": {"csv": good.1}}),
            "says no yield",
        ),
        (
            json!({"emission": {"csv": good.1}, "yield": 0.5}),
            "fluorescence, excitation: is missing",
        ),
        (
            dye("400,1.5\n500,0.5", good.1, 0.5),
            "excitation: 'rows of numbers' goes up to 1.5",
        ),
        (
            dye("400,50\n500,50", good.1, 0.5),
            "holds reflectances above 2",
        ),
        (
            dye(good.0, "200,1\n300,1", 0.5),
            "gives no light from 380 to 780 nm",
        ),
        (dye(good.0, "500,0\n600,0", 0.5), "gives no light"),
        (
            json!({"excitation": {"csv": good.0}, "emision": {}, "yield": 0.5}),
            "unknown key \"emision\"",
        ),
        (json!({"csv": "none.csv"}), "none.csv"),
        (
            json!({"csv": "nm,400,500\n400,0,0\n500,1,0"}),
            "line 1: its first cell says neither per_nm nor per_band",
        ),
        (json!(7), "is not a JSON object"),
        (
            dye("500,0.5\n600,0.5", "400,1\n500,1", 0.5),
            "100 % of what is given out has shorter wavelengths than what excites it",
        ),
        (
            json!({"csv": "per_nm,400,500,600\n400,0.5,1e-3,1e-3\n500,0,0.5,2e-3\n600,0,0,0.5"}),
            "excited at 600 nm; rows are wavelengths of emission, columns of excitation: is the matrix transposed?",
        ),
        (
            json!([dye(good.0, good.1, 0.5), dye(good.0, good.1, -1.0)]),
            "fluorescence 2: its yield is -1",
        ),
    ] {
        let text = cornell(json!({"fluorescence": more})).expect_err("is refused");
        assert!(text.contains("material 'green', fluorescence"), "{text}");
        assert!(text.contains(wanted), "{wanted}\n-- in --\n{text}");
    }
    let much = json!({
        "reflectance": {"csv": "400,0.7\n700,0.7"},
        "fluorescence": dye("400,0.9\n500,0.9", "500,1\n510,1", 0.9),
    });
    let text = cornell(much).expect_err("is refused");
    for part in [
        "material 'green'",
        "of the power that arrives between",
        "nm",
        "no more leaves than comes",
    ] {
        assert!(text.contains(part), "{part}\n-- in --\n{text}");
    }
    let matrix = json!({
        "reflectance": {"csv": "400,0.7\n700,0.7"},
        "fluorescence": {"csv": "per_nm,400,500\n400,0.5,0\n500,1e-3,0.5"},
    });
    let text = cornell(matrix).expect_err("is refused");
    assert!(text.contains("a matrix whose diagonal is one"), "{text}");
    let sheet = json!({
        "reflectance": {"csv": "400,0.2\n700,0.2"},
        "transmission": 0.3,
        "fluorescence": dye(good.0, good.1, 0.5),
    });
    let text = cornell(sheet).expect_err("is refused");
    assert!(text.contains("fluoresces and lets light through"), "{text}");
}

/// A lamp that nobody sees has no luminance to be measured by.
#[test]
fn a_lamp_of_ultraviolet_light_alone_is_refused() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-d65.glb");
    let options = Options {
        grid: ultraviolet(),
        said: Some(json!({"materials": {"light": {"emission": {"csv": "300,1\n350,1"}}}})),
        ..Options::default()
    };
    let text = Scene::load(path, &options)
        .expect_err("is refused")
        .to_string();
    assert!(text.contains("gives no light that an eye sees"), "{text}");
}

/// A base colour leaves room for what is given out, wherever a texture or vertex colours paint it.
#[test]
fn a_base_colour_leaves_room() {
    let more =
        json!({"reflectance": null, "fluorescence": dye("380,0.9\n480,0.9", "500,1\n600,1", 1.0)});
    let scene = cornell(more).unwrap();
    let green = scene.materials.iter().find(|m| m.name == "green").unwrap();
    let out = green.fluorescence.as_ref().unwrap().efficiency();
    let both = green.reflectance.iter().zip(&out);
    assert!(both.into_iter().all(|(rho, out)| rho + out <= 0.999 + 1e-9));
}

/// The path tracer in the room of `scenes`.
#[test]
fn the_path_tracer_agrees() {
    let bake = baked(brightened(), 1.0);
    // As many paths as the default asks for.
    let reference = Traced::new(&Bake::new(brightened(), settings(0.5)), 150, 1 << 14, 3);
    let points = Report::against(&bake, &reference);
    let file = Report::of_file(&bake, &bake.baked(&|_, _| {}), &reference);
    for report in [&points, &file] {
        println!(
            "dE00 {:?}, bias {:?}, noise {:.3}, estimate {:?}",
            report.de2000.mean, report.bias, report.noise_de2000, report.estimate_de2000
        );
        assert!(report.de2000.mean.value < 0.6, "{:?}", report.de2000);
        // Places that hardly any light reaches, under balls and outside, leave the relative error of the file uncertain by 9 %.
        let [low, high] = [report.bias.low, report.bias.high];
        assert!(low < 0.01 && high > -0.01, "{:?}", report.bias);
    }
    assert!(points.bias.value.abs() < 0.01, "{:?}", points.bias);
}

/// What fluoresces lights a room with a mirror, too.
#[test]
fn mirrors_and_what_fluoresces_go_together() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-d65.glb");
    let dye = dye("380,0.9\n480,0.9", "500,1\n600,1", 1.0);
    let options = Options {
        said: Some(json!({"materials": {
            "green": {"reflectance": null, "fluorescence": dye},
            "red": {"mirror": true},
        }})),
        ..Options::default()
    };
    let bake = baked(Scene::load(path, &options).unwrap(), 1.0);
    assert!(bake.plan().runs(EffectKind::Mirrors) && bake.plan().runs(EffectKind::Fluorescence));
    let flux = &bake.rounds().last().unwrap().flux;
    assert!(flux.fluoresced_lm > 0.03 * flux.emitted_lm, "{flux:?}");
    let reference = Traced::new(&bake, 100, 1 << 13, 3);
    let report = Report::against(&bake, &reference);
    println!("dE00 {:?}, bias {:?}", report.de2000.mean, report.bias);
    assert!(report.bias.value.abs() < 0.015, "{:?}", report.bias);
    assert!(report.de2000.mean.value < 0.8, "{:?}", report.de2000);
}

/// The same bytes at 1 and 4 threads.
#[test]
fn threads_change_nothing() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| written(brightened()))
    };
    assert!(run(1) == run(4));
}

/// Relit at half the brightness of all lamps all is half as bright, what fluoresces too; a checkpoint goes on to the same bytes.
#[test]
fn what_is_kept_knows_what_fluoresces() {
    let folder = tempfile::tempdir().unwrap();
    let [cache, checkpoint] = ["cache", "checkpoint"].map(|name| folder.path().join(name));
    let mut bake = Bake::new(brightened(), settings(4.0));
    bake.keep();
    bake.step();
    bake.save(&checkpoint).unwrap();
    bake.step();
    let mut resumed = Bake::new(brightened(), settings(4.0));
    resumed.keep();
    resumed.resume(&checkpoint).unwrap();
    resumed.step();
    let (one, two) = (bake.light(), resumed.light());
    assert!(one.irradiance == two.irradiance && one.reflected == two.reflected);
    assert!(one.emitted == two.emitted);
    let baked = built::baked_within(4000, &bake);
    bake.write_cache(&baked, &cache, u64::MAX).unwrap();
    let mut dimmed = brightened();
    for lamp in haarlight::scene::facts::Facts::of(&dimmed).lights {
        dimmed.dim(&lamp.name, 0.5).unwrap();
    }
    let relit = Relighter::open(&cache, dimmed).unwrap().relight().unwrap();
    let (mut gap, mut whole, mut seen) = (0.0, 0.0, 0);
    for (one, two) in baked.surfaces.iter().zip(&relit.baked.surfaces) {
        let material = bake.scene().surfaces[one.surface].material;
        if bake.scene().materials[material].fluorescence.is_none() {
            continue;
        }
        for (one, two) in one.vertices.iter().zip(&two.vertices) {
            gap += f64::from((0.5 * one.radiosity[1] - two.radiosity[1]).abs());
            whole += f64::from(two.radiosity[1]);
            seen += 1;
        }
    }
    println!("off by {:.1e} of what is relit", gap / whole);
    assert!(seen > 100 && gap < 5e-3 * whole, "{seen} {gap} {whole}");
}

/// Layers add up to the whole, what they excite included: each lamp excites for itself.
#[test]
fn layers_hold_what_they_excite() {
    let grid = ultraviolet();
    let mut scene = {
        let (mut room, _) = desk(named(&grid, "cie/D65"), grid);
        room.point(dvec3(0.5, 1.2, 0.7), 800.0);
        room.scene()
    };
    scene.part_lamps().unwrap();
    let layers = scene.changes.layers.clone().unwrap();
    assert_eq!(layers.names.len(), 2);
    assert_eq!(scene.spectra.len(), 4, "two lamps, and what each excites");
    let mut bake = Bake::new(scene, settings(2.0));
    bake.run();
    assert!(bake.layers().is_some());
    let baked = built::baked_within(4000, &bake);
    let mut lit = [0; 2];
    for surface in &baked.surfaces {
        for (k, vertex) in surface.vertices.iter().enumerate() {
            for c in 0..3 {
                let sum: f32 = surface.layers.iter().map(|layer| layer[k][c]).sum();
                let whole = vertex.light[c];
                assert!(
                    (sum - whole).abs() < 1e-4 * whole.abs().max(1.0),
                    "{sum} {whole}"
                );
            }
            for (lit, layer) in lit.iter_mut().zip(&surface.layers) {
                *lit += usize::from(layer[k][2] > 0.0);
            }
        }
    }
    assert!(lit.iter().all(|n| *n > 10), "{lit:?}");
}

/// A room where the only lamp is taken out is dark, and does not fluoresce.
#[test]
fn no_lamp_excites_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = common::Room::triangle();
    file.json["materials"] = json!([{"name": "card"}]);
    file.primitive()["material"] = json!(0);
    let path = folder.path().join("room.glb");
    std::fs::write(&path, file.glb()).unwrap();
    let side = json!({"materials": {"card": {"fluorescence": dye("380,0.5\n480,0.5", "500,1\n600,1", 1.0)}}});
    std::fs::write(folder.path().join("room.spectra.json"), side.to_string()).unwrap();
    let scene = Scene::load(&path, &Options::default()).unwrap();
    assert!(scene.spectra.is_empty());
    let mut bake = Bake::new(scene, settings(2.0));
    assert_eq!(bake.run(), Verdict::Reached);
}
