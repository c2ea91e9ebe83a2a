//! Pictures of all directions as skies, and skies of several colours: closed forms, quadrature, and the audit.

use crate::common::built;
use crate::common::daylit;

use built::{Room, sun};
use daylit::{LUX, bake, cie, glanced, points, roof, room, through, traced, wish};
use exr::prelude::*;
use glam::{DVec3, dvec3};
use haarlight::color::{KM, Observer, Upsampler};
use haarlight::data::{Outside, Spectrum, daylight};
use haarlight::scene::LightKind;
use haarlight::scene::sky::{
    Distribution, SkyBrightness, SkyType, SkyWish, SunPlace, SunWish, direction,
};
use haarlight::solve::{Bake, Settings};
use haarlight::spectrum::Grid;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Greatest error of a point.
const POINT: f64 = 5e-3;

/// The direction of the middle of a texel.
fn toward(width: usize, x: usize, y: usize) -> DVec3 {
    let azimuth = 360.0 * ((x as f64 + 0.5) / width as f64 - 0.5) + 90.0;
    direction(
        90.0 - 360.0 * (y as f64 + 0.5) / width as f64,
        azimuth.rem_euclid(360.0),
    )
}

/// Writes an OpenEXR map of the light from each direction.
fn exr(folder: &TempDir, width: usize, light: impl Fn(DVec3) -> [f64; 3] + Sync) -> PathBuf {
    let path = folder.path().join("map.exr");
    let texel = |x: usize, y: usize| {
        let [r, g, b] = light(toward(width, x, y)).map(|x| x as f32);
        (r, g, b)
    };
    write_rgb_file(&path, width, width / 2, texel).unwrap();
    path
}

/// Writes a Radiance map.
fn hdr(folder: &TempDir, width: usize, light: impl Fn(DVec3) -> [f64; 3]) -> PathBuf {
    let path = folder.path().join("map.hdr");
    let places = (0..width / 2).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels: Vec<image::Rgb<f32>> = places
        .map(|(x, y)| image::Rgb(light(toward(width, x, y)).map(|x| x as f32)))
        .collect();
    let file = std::fs::File::create(&path).unwrap();
    let encoder = image::codecs::hdr::HdrEncoder::new(file);
    encoder.encode(&texels, width, width / 2).unwrap();
    path
}

fn of_map(path: &Path) -> SkyWish {
    SkyWish {
        map: Some(path.to_owned()),
        ..SkyWish::default()
    }
}

fn lux(bake: &Bake, places: &[(DVec3, DVec3)]) -> Vec<f64> {
    bake.probe(places).iter().map(|p| p.xyz[1]).collect()
}

/// 5.9 under a picture of its sky.
#[test]
fn a_map_of_a_sky_gives_the_light_of_that_sky() {
    let folder = TempDir::new().unwrap();
    for (kind, opening, cuts) in [(1, 1.0, 1), (12, 1.0, 1), (12, 4.0, 1), (12, 1.0, 6)] {
        let sky = Distribution::new(kind, direction(60.0, 0.0));
        let map = exr(&folder, 1024, |d| {
            [if d.y > 0.0 { sky.radiance(d) } else { 0.0 }; 3]
        });
        let wish = SkyWish {
            brightness: Some(SkyBrightness::Illuminance(LUX)),
            ..of_map(&map)
        };
        let bake = glanced(room(0.0, opening, cuts), &wish);
        let mut squares = 0.0;
        for (got, at) in lux(&bake, &points()).iter().zip(points()) {
            let want = LUX * through(|d| sky.radiance(d), 0.0, roof(opening), at);
            println!("type {kind}, {opening} m, cuts {cuts}: {got:.4} for {want:.4}");
            // Chance has a part in it, as in the same rooms of many triangles under the sky itself.
            assert!((got / want - 1.0).abs() < 3.0 * POINT, "{got} {want}");
            squares += (got / want - 1.0).powi(2);
        }
        let rms = (squares / points().len() as f64).sqrt();
        println!("mean square {rms:.5}");
        assert!(rms < POINT, "{rms}");
    }
}

/// Both formats; what is above and below the horizon each by itself; a wall that stands alone sees half of each.
#[test]
fn an_even_map_over_an_open_floor_is_exact() {
    let folder = TempDir::new().unwrap();
    let light = |d: DVec3| [if d.y > 0.0 { 100.0 } else { 25.0 }; 3];
    let plain = hdr(&folder, 64, light);
    // As other programs begin the same format.
    let other = folder.path().join("other.hdr");
    let bytes = std::fs::read(&plain).unwrap();
    let rest = bytes.strip_prefix(b"#?RADIANCE").unwrap();
    std::fs::write(&other, [b"#?RGBE", rest].concat()).unwrap();
    for map in [exr(&folder, 64, light), plain, other] {
        let mut room = Room::new();
        let paint = room.paint(0.5);
        room.quad(DVec3::ZERO, DVec3::Z * 5.0, DVec3::X * 5.0, paint);
        let bake = glanced(room, &of_map(&map));
        let places = [DVec3::Y, DVec3::NEG_Y].map(|n| (dvec3(2.0, -1.0, 1.3), n));
        let [down, up] = [25.0 * PI, 100.0 * PI];
        let got = lux(&bake, &[(dvec3(2.0, 0.0, 1.3), DVec3::Y), places[1]]);
        assert!((got[0] / up - 1.0).abs() < 1e-5, "{got:?} {up}");
        assert!((got[1] / down - 1.0).abs() < 1e-5, "{got:?} {down}");
        let sky = bake.scene().sky_illuminance().unwrap();
        assert!((sky / up - 1.0).abs() < 1e-9, "{sky}");
        // White is D65.
        let xyz = bake.probe(&[(dvec3(2.0, 0.0, 1.3), DVec3::Y)])[0].xyz;
        let white = Upsampler::new(&Grid::default()).white();
        for (got, want) in xyz.iter().zip(white) {
            assert!((got / xyz[1] - want).abs() < 1e-4, "{xyz:?} {white:?}");
        }
    }
}

/// The northern half red, the southern blue: a wall that looks north is red. With north at +X it is the one that looks there.
#[test]
fn a_map_lights_the_walls_that_look_at_its_colours() {
    let folder = TempDir::new().unwrap();
    let light = |d: DVec3| match d.z < 0.0 {
        true => [10.0, 0.0, 0.0],
        false => [0.0, 0.0, 10.0],
    };
    let map = exr(&folder, 256, light);
    let upsampler = Upsampler::new(&Grid::default());
    let luminance = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].map(|c| upsampler.luminance(c));
    for (north, red) in [(0.0, DVec3::NEG_Z), (90.0, DVec3::X)] {
        let wish = SkyWish {
            north: Some(north),
            ..of_map(&map)
        };
        let mut room = Room::new();
        let paint = room.paint(0.5);
        room.quad(DVec3::ZERO, DVec3::Z * 0.01, DVec3::X * 0.01, paint);
        let bake = glanced(room, &wish);
        let at = dvec3(0.0, 1.0, 0.0);
        let got = lux(&bake, &[(at, red), (at, -red)]);
        for (got, luminance) in got.iter().zip(luminance) {
            let want = 10.0 * PI * luminance;
            assert!((got / want - 1.0).abs() < POINT, "{north}: {got} {want}");
        }
    }
}

/// One texel as bright as the sun, 40 degrees high in the west: on a floor beside a wall, in the light and in the shade. In the larger map it
/// is small enough to be the sun, in the other it is a spot of the sky.
#[test]
fn one_bright_texel_is_a_sun() {
    let folder = TempDir::new().unwrap();
    for (width, cuts) in [(256, 1), (256, 12), (1024, 1), (1024, 12)] {
        let row = 35 * width / 256;
        let bright = toward(width, 2 * width / 256, row);
        let light = |d: DVec3| [if d.dot(bright) > 1.0 - 1e-9 { 1e6 } else { 1.0 }; 3];
        let map = exr(&folder, width, light);
        let edge = |k: usize| (TAU * k as f64 / width as f64).cos();
        let solid = TAU / width as f64 * (edge(row) - edge(row + 1));
        let mut room = Room::new();
        let paint = room.paint(0.0);
        let size = 8.0 / f64::from(cuts);
        for (i, j) in (0..cuts).flat_map(|i| (0..cuts).map(move |j| (i, j))) {
            let corner = dvec3(size * f64::from(i), 0.0, size * f64::from(j));
            room.quad(corner, DVec3::Z * size, DVec3::X * size, paint);
        }
        room.two_sided(paint);
        room.quad(dvec3(2.0, 0.0, 0.0), DVec3::Y, DVec3::Z * 8.0, paint);
        let bake = glanced(room, &of_map(&map));
        let lights = bake.scene().lights.iter();
        let suns = lights.filter(|light| light.kind == LightKind::Sun);
        assert_eq!(suns.count(), usize::from(width == 1024));
        let sun = 1e6 * solid * bright.y;
        let places = [
            (dvec3(1.5, 0.0, 4.0), DVec3::Y),
            (dvec3(6.5, 0.0, 4.0), DVec3::Y),
            (dvec3(2.5, 0.0, 4.0), DVec3::Y),
        ];
        let got = lux(&bake, &places);
        println!("{width}, {cuts}: {got:.3?}, sun {sun:.3}");
        // The even rest of the sky is less than pi.
        for lit in &got[..2] {
            let rest = lit - sun;
            assert!(rest > 0.0 && rest < 1.02 * PI + POINT * sun, "{lit} {sun}");
        }
        assert!(got[2] > 0.5 * PI && got[2] < PI, "{}", got[2]);
        assert!(((got[1] - PI) / sun - 1.0).abs() < POINT, "{got:?} {sun}");
    }
}

/// A sun of one degree in a blue sky: a lamp of its light, which the sky has no more; as bright as it is asked to be.
#[test]
fn the_sun_of_a_map_shines_by_itself() {
    let folder = TempDir::new().unwrap();
    let sun = direction(35.0, 160.0);
    let radius = 0.5_f64.to_radians();
    let map = exr(&folder, 2048, |d| match d.dot(sun) > radius.cos() {
        true => [2e6, 1.8e6, 1.4e6],
        false => [0.5, 1.0, 2.0],
    });
    let scene = |wish: SkyWish| room(0.5, 1.0, 1).scene().under(&wish).unwrap();
    let upsampler = Upsampler::new(&Grid::default());
    let size = |scene: &haarlight::scene::Scene| {
        let lamp = scene.lights.iter().find(|l| l.kind == LightKind::Sun)?;
        let y = Observer::cie1931().weights(&scene.grid)[1];
        let power = &scene.spectra[lamp.light].power;
        let bands = power.iter().zip(&lamp.shape).zip(&y);
        let lux: f64 = bands.map(|((p, s), y)| KM * p * s * y).sum();
        Some((lux, lamp.direction))
    };
    let plain = scene(of_map(&map));
    let (lux, way) = size(&plain).unwrap();
    let edge = |y: usize| (TAU * y as f64 / 2048.0).cos();
    let solid: f64 = (0..512)
        .flat_map(|y| (0..2048).map(move |x| (x, y)))
        .filter(|&(x, y)| toward(2048, x, y).dot(sun) > radius.cos())
        .map(|(_, y)| TAU / 2048.0 * (edge(y) - edge(y + 1)))
        .sum();
    let want = upsampler.luminance([2e6, 1.8e6, 1.4e6]) * solid;
    assert!((lux / want - 1.0).abs() < 1e-4, "{lux} {want}");
    assert!((way + sun).length() < 0.1_f64.to_radians(), "{way}");
    let sky = PI * upsampler.luminance([0.5, 1.0, 2.0]);
    let got = plain.sky_illuminance().unwrap();
    assert!((got / sky - 1.0).abs() < 1e-6, "{got} {sky}");
    let asked = |illuminance: f64, place: Option<SunPlace>| {
        let sun = SunWish {
            illuminance: Some(illuminance),
            place,
            ..SunWish::default()
        };
        scene(SkyWish {
            sun,
            ..of_map(&map)
        })
    };
    assert!((size(&asked(1234.0, None)).unwrap().0 / 1234.0 - 1.0).abs() < 1e-9);
    assert!(size(&asked(0.0, None)).is_none());
    // A sun that is placed takes nothing out of the map.
    let place = SunPlace::Angles {
        elevation: 20.0,
        azimuth: 0.0,
    };
    let two = asked(0.0, Some(place));
    assert!(size(&two).is_none() && two.sky_illuminance().unwrap() > 10.0 * sky);
}

/// A sun and clouds through an opening, passed on by grey walls, beside paths: summed over the points.
#[test]
fn reflected_light_of_a_map_agrees_with_paths() {
    let folder = TempDir::new().unwrap();
    let sun = direction(75.0, 100.0);
    let map = exr(&folder, 512, |d| {
        let cloud = 1.0 + (5.0 * d.x).sin() * (7.0 * d.z).cos();
        match d.dot(sun) > 0.9995 {
            true => [900.0, 800.0, 600.0],
            false => [0.5 * cloud, 0.8 * cloud, 1.2 * cloud],
        }
    });
    // Cut into more triangles the room is the same: its paths are traced once.
    let mut found = None;
    for cuts in [1, 6] {
        let bake = bake(room(0.5, 1.0, cuts), &of_map(&map));
        let probed = bake.probe(&points());
        let scene = bake.scene();
        let answers = found.get_or_insert_with(|| traced(&bake, points(), 65_536));
        for (channel, weights) in Observer::cie1931().weights(&scene.grid).iter().enumerate() {
            let weights = weights.map(|y| KM * y);
            let got: f64 = probed.iter().map(|p| p.xyz[channel]).sum();
            let truth: f64 = answers.iter().map(|answer| answer.linear(&weights).0).sum();
            println!("{cuts}, {channel}: {got:.3} for {truth:.3}");
            assert!((got / truth - 1.0).abs() < 0.01, "{cuts}: {got} {truth}");
        }
    }
}

/// Ground that is asked for takes the place of what a map shows below the horizon; an illuminance scales the map.
#[test]
fn a_map_can_have_open_ground() {
    let folder = TempDir::new().unwrap();
    let map = exr(&folder, 64, |d| [if d.y > 0.0 { 3.0 } else { 77.0 }; 3]);
    let wish = SkyWish {
        brightness: Some(SkyBrightness::Illuminance(LUX)),
        ground: Some(0.3),
        ..of_map(&map)
    };
    let mut room = Room::new();
    let paint = room.paint(0.5);
    room.quad(DVec3::ZERO, DVec3::Z, DVec3::X, paint);
    let bake = glanced(room, &wish);
    let got = lux(
        &bake,
        &[
            (dvec3(0.5, 0.0, 0.5), DVec3::Y),
            (dvec3(0.5, -1.0, 0.5), DVec3::NEG_Y),
        ],
    );
    assert!((got[0] / LUX - 1.0).abs() < 1e-5, "{got:?}");
    assert!((got[1] / (0.3 * LUX) - 1.0).abs() < 1e-5, "{got:?}");
}

/// Irradiance in each band through an opening, by quadrature over the directions.
fn spectral(
    colours: [&Spectrum; 3],
    sky: &Distribution,
    opening: f64,
    (point, normal): (DVec3, DVec3),
) -> Spectrum {
    const N: usize = 600;
    let [corner, u, v] = roof(opening);
    let [_, b, c, d, e] = [-1.0, -0.32, 10.0, -3.0, 0.45];
    let mut sum = [0.0; 3];
    for (j, i) in (0..N).flat_map(|j| (0..N).map(move |i| (j, i))) {
        let at = |k: usize| (k as f64 + 0.5) / N as f64;
        let way = corner + u * at(i) + v * at(j) - point;
        let r2 = way.length_squared();
        let way = way / r2.sqrt();
        let chi = way.dot(sky.sun()).acos();
        let haze = (c * ((d * chi).exp() - (d * FRAC_PI_2).exp())).max(0.0);
        let about = haze / (1.0 + haze + e * chi.cos().powi(2));
        let low = 1.0 - (b / way.y - b).exp();
        let brings = sky.radiance(way) * normal.dot(way).max(0.0) * way.y / r2;
        let shares = [(1.0 - low) * (1.0 - about), low * (1.0 - about), about];
        sum = std::array::from_fn(|k| sum[k] + brings * shares[k]);
    }
    let area = u.length() * v.length() / (N * N) as f64;
    std::array::from_fn(|l| LUX * area * (0..3).map(|k| sum[k] * colours[k][l]).sum::<f64>())
}

/// A clear sky that is blue overhead, whiter at the horizon and yellow about the sun: its colours at the points of 5.9.
#[test]
fn the_colour_of_a_sky_varies_as_asked() {
    let grid = Grid::default();
    let observer = Observer::cie1931().weights(&grid);
    let luminous = &observer[1];
    let kelvins = [20_000.0, 6500.0, 4500.0];
    let colours = kelvins.map(|kelvin| {
        let power = grid.means(&daylight(kelvin), Outside::Hold);
        let size: f64 = power.iter().zip(luminous).map(|(p, y)| KM * p * y).sum();
        power.map(|p| p / size)
    });
    let sky = Distribution::new(12, direction(60.0, 0.0));
    let truth: Vec<Spectrum> = (points().into_iter())
        .map(|at| spectral(colours.each_ref(), &sky, 4.0, at))
        .collect();
    for cuts in [1, 6] {
        let wish = SkyWish {
            kelvin: Some(kelvins[0]),
            horizon_kelvin: Some(kelvins[1]),
            sunward_kelvin: Some(kelvins[2]),
            ..wish(12)
        };
        let bake = glanced(room(0.0, 4.0, cuts), &wish);
        for ((probed, at), want) in bake.probe(&points()).iter().zip(points()).zip(&truth) {
            for (channel, weights) in observer.iter().enumerate() {
                let sum = want.iter().zip(weights).map(|(w, y)| KM * w * y);
                let (got, want) = (probed.xyz[channel], sum.sum::<f64>());
                println!("{cuts} {at:?}, {channel}: {got:.4} for {want:.4}");
                assert!((got / want - 1.0).abs() < POINT, "{at:?}: {got} {want}");
            }
        }
    }
    // One colour said three times is that colour.
    let places = points();
    let once = glanced(
        room(0.0, 1.0, 1),
        &SkyWish {
            kelvin: Some(7000.0),
            ..wish(12)
        },
    );
    let thrice = SkyWish {
        kelvin: Some(7000.0),
        horizon_kelvin: Some(7000.0),
        sunward_kelvin: Some(7000.0),
        ..wish(12)
    };
    let thrice = glanced(room(0.0, 1.0, 1), &thrice);
    for (a, b) in once.probe(&places).iter().zip(thrice.probe(&places)) {
        // Three parts are cut more finely than one.
        let (a, b) = (a.xyz, b.xyz);
        assert!((a[0] / b[0] - 1.0).abs() < 0.5 * POINT, "{a:?} {b:?}");
    }
}

/// What is wrong with a map is said, with what to do.
#[test]
fn bad_maps_are_refused_in_words() {
    let folder = TempDir::new().unwrap();
    let refused = |wish: SkyWish| {
        let scene = room(0.5, 1.0, 1).scene().under(&wish);
        scene.map(|_| ()).unwrap_err().to_string()
    };
    let told = |path: &Path, text: &str| {
        let said = refused(of_map(path));
        assert!(
            said.contains(text) && said.contains("map '"),
            "{text}: {said}"
        );
    };
    let good = exr(&folder, 64, |_| [1.0; 3]);
    let bytes = std::fs::read(&good).unwrap();
    let other = folder.path().join("other.exr");
    for end in [0, 3, 4, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&other, &bytes[..end]).unwrap();
        told(&other, if end < 4 { "neither" } else { "is cut short" });
    }
    let whole = hdr(&folder, 64, |d| [1.0, 2.0 + d.x, 3.0]);
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(&whole, &bytes[..bytes.len() / 2]).unwrap();
    told(&whole, "is cut short");
    told(&folder.path().join("nowhere.hdr"), "cannot be read");
    told(folder.path(), "not a regular file");
    told(
        &exr(&folder, 64, |d| [if d.y > 0.9 { f64::NAN } else { 1.0 }; 3]),
        "texel",
    );
    told(
        &exr(&folder, 64, |d| {
            [if d.y > 0.9 { f64::INFINITY } else { 1.0 }; 3]
        }),
        "no end",
    );
    told(&exr(&folder, 64, |_| [0.0; 3]), "is black");
    told(&exr(&folder, 64, |_| [1e30; 3]), "say how bright");
    write_rgb_file(&other, 64, 64, |_, _| (1.0_f32, 1.0_f32, 1.0_f32)).unwrap();
    told(&other, "twice as wide as high");
    let claims = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 8000\n";
    std::fs::write(&other, claims).unwrap();
    told(&other, "claims 8000 x 4000");
    let claims = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 40000 +X 80000\n";
    std::fs::write(&other, claims).unwrap();
    told(&other, "scale it down");
    let negative = exr(&folder, 64, |d| {
        [1.0, 1.0, if d.y < 0.0 { -1.0 } else { 1.0 }]
    });
    let scene = room(0.5, 1.0, 1).scene().under(&of_map(&negative)).unwrap();
    let warned = scene.warnings.join("\n");
    assert!(
        warned.contains("1024 texels have negative numbers"),
        "{warned}"
    );
    let sunward = SkyWish {
        kind: Some(SkyType(1)),
        sunward_kelvin: Some(4000.0),
        ..SkyWish::default()
    };
    assert!(refused(sunward).contains("not brighter about the sun"));
}

/// Whatever bytes stand in a map: words or light, no panic.
#[test]
fn broken_maps_are_no_panic() {
    let folder = TempDir::new().unwrap();
    for good in [
        exr(&folder, 32, |d| [d.y.abs(), 1.0, 2.0]),
        hdr(&folder, 32, |d| [d.y.abs(), 1.0, 2.0]),
    ] {
        let bytes = std::fs::read(&good).unwrap();
        let mut state = 1_u64;
        let mut random = |below: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as usize % below
        };
        for _ in 0..400 {
            let mut broken = bytes.clone();
            for _ in 0..1 + random(4) {
                let k = random(broken.len().min(700));
                broken[k] = random(256) as u8;
            }
            std::fs::write(&good, &broken).unwrap();
            let _ = room(0.5, 1.0, 1).scene().under(&of_map(&good));
        }
    }
}

/// A sun beside a map: the map keeps its light, the sun shines besides.
#[test]
fn a_sun_can_be_added_to_a_map() {
    let folder = TempDir::new().unwrap();
    let map = hdr(&folder, 64, |_| [5.0; 3]);
    let wish = SkyWish {
        sun: sun([30.0, 45.0], 1000.0),
        ..of_map(&map)
    };
    let mut room = Room::new();
    let paint = room.paint(0.5);
    room.quad(DVec3::ZERO, DVec3::Z, DVec3::X, paint);
    let bake = glanced(room, &wish);
    let got = lux(&bake, &[(cie(0.5, -0.5, 0.0), DVec3::Y)])[0];
    let want = 5.0 * PI + 500.0;
    assert!((got / want - 1.0).abs() < 1e-5, "{got} {want}");
}

/// The same light to the last bit with one thread and with four.
#[test]
fn threads_change_nothing_under_a_map() {
    let folder = TempDir::new().unwrap();
    let sun = direction(50.0, 200.0);
    let map = exr(&folder, 256, |d| match d.dot(sun) > 0.999 {
        true => [900.0, 800.0, 600.0],
        false => [d.y.abs(), 0.5, 1.0 - d.x],
    });
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let scene = room(0.5, 1.0, 6).scene().under(&of_map(&map)).unwrap();
            let settings = Settings {
                error: 2.0,
                rounds: 2,
                ..Settings::default()
            };
            let probed = built::run(scene, settings).probe(&points());
            probed
                .iter()
                .flat_map(|p| p.spectrum)
                .map(f64::to_bits)
                .collect::<Vec<_>>()
        })
    };
    assert_eq!(with(1), with(4));
}

/// The command takes a map, and the side file does; daylight factors are those of the map's own sky.
#[test]
fn the_command_takes_maps() {
    let folder = TempDir::new().unwrap();
    let map = hdr(&folder, 64, |d| [if d.y > 0.0 { 8.0 } else { 0.0 }; 3]);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let there = folder.path().join("room.glb");
    std::fs::copy(root.join("scenes/cornell.glb"), &there).unwrap();
    let side = folder.path().join("room.spectra.json");
    let csv = folder.path().join("points.csv");
    std::fs::write(
        &csv,
        "x,y,z,nx,ny,nz\n0.278,0.25,-0.3,0,1,0\n0.278,-5,0.5,0,1,0\n",
    )
    .unwrap();
    let probed = |options: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_haarlight"));
        command.args([
            "probe",
            there.to_str().unwrap(),
            "--points",
            csv.to_str().unwrap(),
        ]);
        let out = command
            .args(["--error", "2", "--metrics", "--json"])
            .args(options)
            .output();
        let out = out.unwrap();
        let [text, said] =
            [&out.stdout, &out.stderr].map(|b| String::from_utf8_lossy(b).into_owned());
        assert!(out.status.success(), "{said}");
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        value["metrics"]["points"][0].clone()
    };
    std::fs::write(
        &side,
        r#"{"sky": {"type": "uniform", "illuminance_lx": 500, "ground_reflectance": 0}}"#,
    )
    .unwrap();
    let plain = probed(&[]);
    let by_option = probed(&["--sky", map.to_str().unwrap()]);
    std::fs::write(
        &side,
        r#"{"sky": {"map": "map.hdr", "illuminance_lx": 500}}"#,
    )
    .unwrap();
    let by_file = probed(&[]);
    for other in [&by_option, &by_file] {
        for key in ["lux", "DF_percent"] {
            let [want, got] = [&plain, other].map(|p| p[key]["value"].as_f64().unwrap());
            assert!((got / want - 1.0).abs() < 0.01, "{key}: {got} {want}");
        }
    }
}
