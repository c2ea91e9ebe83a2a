//! Light of the spectral sky of Hosek and Wilkie. Its radiance itself is tested where it is worked out (`scene/sky/hosek.rs`).

use crate::common::built;
use crate::common::daylit;

use built::{Room, sun};
use daylit::{LUX, bake, beside, glanced, places_beside, points, roof, room, through, traced};
use glam::{DVec3, dvec3};
use haarlight::color::{KM, Observer};
use haarlight::scene::Scene;
use haarlight::scene::sky::{Dome, SkyBrightness, SkyWish};
use haarlight::spectrum::Spectrum;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A sky with the sun over y = 4 of the room, without its direct light.
fn wish(turbidity: f64, elevation: f64) -> SkyWish {
    SkyWish {
        turbidity: Some(turbidity),
        ground: Some(0.3),
        sun: sun([elevation, 0.0], 0.0),
        ..SkyWish::default()
    }
}

/// Tristimulus radiance by the formula, linear between its wavelengths.
fn formula(scene: &Scene) -> impl Fn(DVec3) -> DVec3 + Sync {
    let Dome::Spectral(sky) = &scene.sky.as_ref().unwrap().dome else {
        panic!("no spectral sky");
    };
    let model = sky.model().clone();
    let mut colours = [DVec3::ZERO; 11];
    let observer = Observer::cie1931().weights(&scene.grid);
    for band in 0..64 {
        let at = ((scene.grid.middle(band) - 320.0) / 40.0).min(10.0);
        let (low, share) = (at.min(9.0).floor(), at - at.min(9.0).floor());
        let colour = KM * DVec3::from_array(observer.each_ref().map(|weights| weights[band]));
        colours[low as usize] += (1.0 - share) * colour;
        colours[low as usize + 1] += share * colour;
    }
    move |d| {
        let each = model.radiance(d).into_iter().zip(colours);
        each.map(|(x, colour)| x * colour).sum()
    }
}

/// Tristimulus value of the light on open ground.
fn ground(sky: impl Fn(DVec3) -> DVec3) -> DVec3 {
    let (up, around) = (120, 240);
    let mut sum = DVec3::ZERO;
    for k in 0..up {
        let (height, out) = (FRAC_PI_2 * (f64::from(k) + 0.5) / f64::from(up)).sin_cos();
        for j in 0..around {
            let (sin, cos) = (TAU * (f64::from(j) + 0.5) / f64::from(around)).sin_cos();
            sum += height * out * sky(dvec3(out * cos, height, out * sin));
        }
    }
    sum * FRAC_PI_2 * TAU / f64::from(up * around)
}

/// An open floor has what the model gives it, in watts, or what is asked for.
#[test]
fn open_ground_has_the_light_of_the_model() {
    let floor = || {
        let mut room = Room::new();
        let paint = room.paint(0.5);
        room.quad(DVec3::ZERO, DVec3::Z * 5.0, DVec3::X * 5.0, paint);
        room
    };
    let at = [(dvec3(2.0, 0.0, 1.3), DVec3::Y)];
    for (turbidity, elevation) in [(2.0, 60.0), (6.0, 20.0)] {
        let bake = glanced(floor(), &wish(turbidity, elevation));
        let want = ground(formula(bake.scene()));
        let got = DVec3::from_array(bake.probe(&at)[0].xyz);
        println!("{turbidity}, {elevation}: {got:.1} for {want:.1}");
        assert!(
            (got / want - 1.0).abs().max_element() < 2e-3,
            "{got} {want}"
        );
        let said = bake.scene().sky_illuminance().unwrap();
        assert!((said / want.y - 1.0).abs() < 1e-3, "{said} {want}");
    }
    let given = SkyWish {
        brightness: Some(SkyBrightness::Illuminance(LUX)),
        ..wish(6.0, 20.0)
    };
    let lux = glanced(floor(), &given).probe(&at)[0].xyz[1];
    assert!((lux / LUX - 1.0).abs() < 2e-3, "{lux}");
}

/// A window toward the sun, whose glow is seen through it, sky above the horizon and ground below: by polygons; and an opening in
/// the roof of a room of many triangles, by rays.
#[test]
fn light_through_openings_has_the_colour_of_the_model() {
    let mut few = Room::new();
    let window = beside(&mut few);
    let [a, .., b, _] = places_beside();
    let seen = points();
    for (bake, opening, places, slack) in [
        (glanced(few, &wish(4.0, 25.0)), window, vec![a, b], 5e-3),
        (
            glanced(room(0.0, 1.0, 6), &wish(6.0, 60.0)),
            roof(1.0),
            vec![seen[2]],
            0.01,
        ),
    ] {
        let sky = formula(bake.scene());
        let level = 0.3 * ground(&sky);
        for (probed, place) in bake.probe(&places).iter().zip(places) {
            for (channel, got) in [(1, probed.xyz[1]), (2, probed.xyz[2])] {
                let want = through(|d| sky(d)[channel], level[channel], opening, place);
                println!("{place:?}: {got:.2} for {want:.2}");
                assert!((got / want - 1.0).abs() <= slack, "{got} should be {want}");
            }
        }
    }
}

/// Beside paths, which know the model itself and nothing of the three spectra that stand for it, summed over the points: colours, and the
/// blue, the green and the red by themselves, of which the spectra of single openings are .7 % off in the mean.
#[test]
fn reflected_light_agrees_with_paths() {
    let bake = bake(room(0.5, 1.0, 1), &wish(3.0, 50.0));
    let probed = bake.probe(&points());
    let scene = bake.scene();
    let answers = traced(&bake, points(), 65_536);
    let agree = |weights: &Spectrum, slack: f64| {
        let sum = |bands: &Spectrum| -> f64 { bands.iter().zip(weights).map(|(x, w)| x * w).sum() };
        let got: f64 = probed.iter().map(|p| sum(&p.spectrum)).sum();
        let truth: f64 = answers.iter().map(|answer| answer.linear(weights).0).sum();
        println!("{got:.4} for {truth:.4}");
        assert!((got / truth - 1.0).abs() < slack, "{got} should be {truth}");
    };
    for weights in Observer::cie1931().weights(&scene.grid) {
        agree(&weights, 0.01);
    }
    for (first, last) in [(420.0, 490.0), (500.0, 590.0), (600.0, 690.0)] {
        let within = |band: usize| (first..last).contains(&scene.grid.middle(band));
        agree(
            &std::array::from_fn(|band| f64::from(u8::from(within(band)))),
            0.015,
        );
    }
}

#[test]
fn what_does_not_go_together_is_told() {
    let asked = |wish: SkyWish| {
        let error = room(0.5, 1.0, 1).scene().under(&wish).unwrap_err();
        error.to_string()
    };
    let alone = SkyWish {
        turbidity: Some(3.0),
        ..SkyWish::default()
    };
    assert!(asked(alone).contains("say where the sun stands"));
    assert!(asked(wish(3.0, -3.0)).contains("3.0 deg below the horizon"));
    assert!(asked(wish(0.5, 30.0)).contains("turbidity of 0.5"));
    assert!(asked(wish(f64::NAN, 30.0)).contains("turbidity of NaN"));
    let coloured = SkyWish {
        kelvin: Some(8000.0),
        ..wish(3.0, 30.0)
    };
    assert!(asked(coloured).contains("colours of its own"));
}
