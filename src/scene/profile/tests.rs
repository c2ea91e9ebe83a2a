use super::*;
use glam::{DVec3, dvec3};
use proptest::prelude::*;
use std::f64::consts::PI;
use std::fmt::Write;

/// An LM-63 file of a distribution over (vertical, horizontal) angles, degrees.
fn lm63(
    first: &str,
    kind: u32,
    vertical: &[f64],
    horizontal: &[f64],
    candela: impl Fn(f64, f64) -> f64,
) -> String {
    let mut text = format!(
        "{first}\n[TEST] own\n[LUMINAIRE] Lamp, of nobody\nTILT=NONE\n1 -1 1 {} {} {kind} 2 0 0 0 1 1 10\n",
        vertical.len(),
        horizontal.len()
    );
    for list in [vertical, horizontal] {
        for angle in list {
            let _ = write!(text, "{angle} ");
        }
        text.push('\n');
    }
    for h in horizontal {
        for v in vertical {
            let _ = write!(text, "{} ", candela(*v, *h));
        }
        text.push('\n');
    }
    text
}

fn steps(low: f64, high: f64, step: f64) -> Vec<f64> {
    let count = ((high - low) / step).round() as usize;
    (0..=count).map(|k| low + step * k as f64).collect()
}

/// A EULUMDAT file of intensities for 1000 lm, of a lamp of 2000 lm whose intensities are to be taken half.
fn eulumdat(symmetry: usize, planes: usize, candela: impl Fn(f64, f64) -> f64) -> String {
    let step = 360.0 / planes as f64;
    let rows = steps(0.0, 180.0, 5.0);
    let mut lines: Vec<String> = vec![
        "nobody".into(),
        "1".into(),
        symmetry.to_string(),
        planes.to_string(),
        step.to_string(),
        rows.len().to_string(),
        "5".into(),
    ];
    lines.extend(["report", "Lamp", "1", "lamp.ldt", "today"].map(String::from));
    lines.extend(["1200", "300", "80", "1160", "260", "0", "0", "0", "0"].map(String::from));
    lines.extend(["100", "0", "0,5", "0", "1"].map(String::from));
    lines.extend(["2", "tubes", "2000", "830", "1B", "58"].map(String::from));
    lines.extend([""; 10].map(|_| "0.5".to_owned()));
    lines.extend((0..planes).map(|k| (step * k as f64).to_string()));
    lines.extend(rows.iter().map(f64::to_string));
    let (first, count) = match symmetry {
        1 => (0, 1),
        2 => (0, planes / 2 + 1),
        3 => (3 * planes / 4, planes / 2 + 1),
        4 => (0, planes / 4 + 1),
        _ => (0, planes),
    };
    for k in first..first + count {
        let c = step * k as f64;
        lines.extend(rows.iter().map(|g| candela(*g, c).to_string()));
    }
    lines.join("\r\n")
}

fn read(text: &str) -> Profile {
    Profile::parse(text.as_bytes()).unwrap()
}

/// Direction at gamma and C, degrees, by the definition of the axes: nadir -Z, C0 +X, C90 +Y.
fn at(gamma: f64, c: f64) -> DVec3 {
    let (g, c) = (gamma.to_radians(), c.to_radians());
    dvec3(g.sin() * c.cos(), g.sin() * c.sin(), -g.cos())
}

#[test]
fn flux_is_the_exact_integral_of_what_is_looked_up() {
    // I = 100 all around, and I = 100 (1 - gamma / 90): 2 pi 100 (1 - 2 / pi).
    let all = read(&lm63("IESNA91", 1, &[0.0, 180.0], &[0.0], |_, _| 100.0));
    assert!((all.flux() - 400.0 * PI).abs() < 1e-9);
    let cone = |g: f64, _: f64| 100.0 * (1.0 - g / 90.0);
    let cone = read(&lm63("IESNA91", 1, &steps(0.0, 90.0, 45.0), &[0.0], cone));
    assert!((cone.flux() - 200.0 * PI * (1.0 - 2.0 / PI)).abs() < 1e-9);
    // I = 100 cos gamma, every degree: 100 pi within what straight lines make of it.
    let lambert = |g: f64, _: f64| 100.0 * g.to_radians().cos();
    let lambert = read(&lm63("IESNA91", 1, &steps(0.0, 90.0, 1.0), &[0.0], lambert));
    assert!((lambert.flux() / (100.0 * PI) - 1.0).abs() < 1e-4);
    // Against many points of the sphere.
    let wavy = |g: f64, c: f64| 50.0 + 30.0 * (g - c / 3.0).to_radians().cos();
    let wavy = read(&lm63(
        "IESNA91",
        1,
        &steps(0.0, 180.0, 10.0),
        &steps(0.0, 360.0, 15.0),
        wavy,
    ));
    let n = 400;
    let mut sum = 0.0;
    for i in 0..n {
        let z = -1.0 + (2 * i + 1) as f64 / f64::from(n);
        for k in 0..n {
            let c = 2.0 * PI * (f64::from(k) + 0.5) / f64::from(n);
            let r = (1.0 - z * z).sqrt();
            sum += wavy.toward(dvec3(r * c.cos(), r * c.sin(), z));
        }
    }
    let flux = sum * 4.0 * PI / f64::from(n).powi(2);
    assert!(
        (flux / wavy.flux() - 1.0).abs() < 1e-5,
        "{flux} {}",
        wavy.flux()
    );
}

#[test]
fn symmetries_of_lm63_unfold() {
    // Even in C about 0, about 90, or both.
    let about_0 = |g: f64, c: f64| 100.0 + g * c.to_radians().cos();
    let about_90 = |g: f64, c: f64| 100.0 + g * c.to_radians().sin();
    let both = |g: f64, c: f64| 100.0 + g * (2.0 * c).to_radians().cos();
    let rows = steps(0.0, 90.0, 10.0);
    let whole = steps(0.0, 360.0, 15.0);
    type Shape<'a> = &'a dyn Fn(f64, f64) -> f64;
    let cases: [(Shape, [f64; 2]); 5] = [
        (&about_0, [0.0, 180.0]),
        (&about_90, [90.0, 270.0]),
        (&both, [0.0, 90.0]),
        (&|g, c| about_0(g, c) + about_90(g, c), [0.0, 360.0]),
        // 360 is left out.
        (&|g, c| about_0(g, c) + about_90(g, c), [0.0, 345.0]),
    ];
    for (shape, [low, high]) in cases {
        let part = read(&lm63("IESNA91", 1, &rows, &steps(low, high, 15.0), shape));
        let full = read(&lm63("IESNA91", 1, &rows, &whole, shape));
        assert!(
            (part.flux() / full.flux() - 1.0).abs() < 1e-12,
            "{low} {high}"
        );
        for c in whole.iter().flat_map(|c| [*c, c + 7.0]) {
            let (a, b) = (part.toward(at(40.0, c)), full.toward(at(40.0, c)));
            assert!((a - b).abs() < 1e-9, "{low} {high} {c}: {a} {b}");
            if c.fract() == 0.0 && c % 15.0 == 0.0 {
                assert!((a - shape(40.0, c)).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn symmetries_of_eulumdat_unfold() {
    let about_0 = |g: f64, c: f64| 200.0 + g * c.to_radians().cos();
    let about_90 = |g: f64, c: f64| 200.0 + g * c.to_radians().sin();
    let both = |g: f64, c: f64| 200.0 + g * (2.0 * c).to_radians().cos();
    let none = |g: f64, c: f64| about_0(g, c) + about_90(g, c);
    let axial = |g: f64, _: f64| 200.0 + g;
    type Shape<'a> = &'a dyn Fn(f64, f64) -> f64;
    let cases: [(usize, Shape); 5] = [
        (0, &none),
        (1, &axial),
        (2, &about_0),
        (3, &about_90),
        (4, &both),
    ];
    for (symmetry, shape) in cases {
        let profile = read(&eulumdat(symmetry, 24, shape));
        for c in steps(0.0, 345.0, 15.0) {
            // 2000 lm, factor .5: as many cd as cd for 1000 lm.
            let found = profile.toward(at(40.0, c));
            assert!(
                (found - shape(40.0, c)).abs() < 1e-9,
                "{symmetry} {c}: {found}"
            );
        }
        assert_eq!(
            (profile.format.as_str(), profile.luminaire.as_str()),
            ("EULUMDAT", "Lamp")
        );
        assert_eq!(profile.lamps_lm, Some(2000.0));
        assert_eq!(profile.opening_m, [0.26, 1.16, 0.0]);
    }
}

/// The same light measured on the three goniometers.
#[test]
fn types_a_b_and_c_tell_the_same_light() {
    let [aim, up, right] = [DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y];
    let light = |d: DVec3| 100.0 * d.dot(aim).max(0.0) * (2.0 + d.dot(up) + 0.6 * d.dot(right));
    let a = |v: f64, h: f64| {
        let ((sv, cv), (sh, ch)) = (v.to_radians().sin_cos(), h.to_radians().sin_cos());
        light(up * sv + (aim * ch + right * sh) * cv)
    };
    let b = |v: f64, h: f64| {
        let ((sv, cv), (sh, ch)) = (v.to_radians().sin_cos(), h.to_radians().sin_cos());
        light(right * sh + (aim * cv + up * sv) * ch)
    };
    let half = steps(-90.0, 90.0, 2.0);
    let a = read(&lm63("IESNA91", 3, &half, &half, a));
    let b = read(&lm63("IESNA91", 2, &half, &half, b));
    let c = lm63(
        "IESNA91",
        1,
        &steps(0.0, 90.0, 2.0),
        &steps(0.0, 360.0, 5.0),
        |g, c| light(at(g, c)),
    );
    let c = read(&c);
    assert_eq!(
        [a.angles, b.angles, c.angles],
        [Angles::A, Angles::B, Angles::C]
    );
    for gamma in steps(1.0, 85.0, 7.0) {
        for turn in steps(3.0, 357.0, 11.0) {
            let d = at(gamma, turn);
            for profile in [&a, &b, &c] {
                let found = profile.toward(d);
                assert!(
                    (found - light(d)).abs() < 0.6,
                    "{gamma} {turn}: {found} {}",
                    light(d)
                );
            }
        }
    }
    // int cos (2 + ...) over the hemisphere: the odd parts vanish.
    for profile in [a, b, c] {
        assert!(
            (profile.flux() / (200.0 * PI) - 1.0).abs() < 1e-3,
            "{}",
            profile.flux()
        );
    }
}

#[test]
fn multipliers_units_and_editions() {
    let text = |first: &str| {
        format!(
            "{first}\n[LUMCAT] T5\nTILT=NONE\n2, 1500, 2.0, 2, 1, 1, 1, 2, -4, 0\n.5,.9,60\n0 180\n0\n10,10\n"
        )
    };
    for (first, format, factor) in [
        ("any words", "LM-63-1986", 0.9),
        ("IESNA91", "LM-63-1991", 0.9),
        ("IESNA:LM-63-1995", "LM-63-1995", 1.0),
        ("IESNA:LM-63-2002", "LM-63-2002", 1.0),
        ("IES:LM-63-2019", "LM-63-2019", 1.0),
    ] {
        let profile = read(&text(first));
        assert_eq!(profile.format, format);
        let want = 10.0 * 2.0 * 0.5 * factor;
        assert!((profile.toward(DVec3::X) - want).abs() < 1e-12, "{first}");
        assert_eq!(profile.lamps_lm, Some(3000.0));
        assert_eq!(profile.luminaire, "T5");
        let [length, width, _] = profile.opening_m;
        assert!((width - 0.6096).abs() < 1e-12 && (length - 1.2192).abs() < 1e-12);
    }
    // Latin-1, and lines that end as they did on old machines.
    let mut latin = text("IESNA91")
        .replace("T5", "L@nge")
        .replace('\n', "\r")
        .into_bytes();
    latin
        .iter_mut()
        .filter(|b| **b == b'@')
        .for_each(|b| *b = 0xe4);
    assert_eq!(Profile::parse(&latin).unwrap().luminaire, "Länge");
    let marked = [
        b"\xef\xbb\xbf".as_slice(),
        text("IES:LM-63-2019").as_bytes(),
    ]
    .concat();
    assert_eq!(Profile::parse(&marked).unwrap().format, "LM-63-2019");
}

#[test]
fn a_tilt_that_is_included_counts() {
    let text = "IESNA91\nTILT=INCLUDE\n1\n3\n0 45 90\n1 .9 .5\n1 1000 1 2 1 1 2 0 0 0 1 1 10\n0 180 0 9 9\n";
    let profile = read(text);
    let at: Vec<f64> = [0.0, 45.0, 60.0, 90.0, 170.0]
        .map(|t| profile.at_tilt(t))
        .to_vec();
    for (found, want) in at.iter().zip([1.0, 0.9, 0.9 - 0.4 / 3.0, 0.5, 0.5]) {
        assert!((found - want).abs() < 1e-12, "{at:?}");
    }
    assert_eq!(
        read(&text.replace("1\n3\n0 45 90\n1 .9 .5\n", "1\n0\n")).at_tilt(50.0),
        1.0
    );
}

#[test]
fn faults_have_a_line_and_a_way_out() {
    let good = "IESNA91\nTILT=NONE\n1 1000 1 3 2 1 2 0 0 0\n1 1 10\n0 45 90\n0 90\n1 2 3\n4 5 6\n";
    assert!(Profile::parse(good.as_bytes()).is_ok());
    for (old, new, line, what) in [
        ("5 6", "5", 8, "ends before an intensity"),
        ("5 6", "x 6", 8, "'x' stands where an intensity should be"),
        ("5 6", "-5 6", 8, "an intensity is -5"),
        ("0 45 90", "0 95 90", 5, "90, does not follow on 95"),
        ("0 45 90", "0 45 290", 5, "a vertical angle is 290"),
        ("0 90\n", "0 91\n", 8, "reach from 0 to 91"),
        ("1 3 2 1 2", "1 3 2 7 2", 3, "7 is no photometric type"),
        ("1 3 2 1 2", "1 3 2 1 5", 3, "5 is no unit"),
        ("1 3 2 1 2", "1 2.5 2 1 2", 3, "not a whole number"),
        ("1000 1 3", "1000 0 3", 4, "multiplied by 0"),
        ("NONE", "other.tlt", 2, "OTHER.TLT"),
        ("4 5 6", "4,2 5 6", 8, "'6' follows on the last intensity"),
        ("5 6", "5 6\n\n\n7", 11, "'7' follows on the last intensity"),
        (
            "3 2 1 2 0 0 0\n1 1 10\n0 45 90\n0 90\n1 2 3\n4 5 6",
            "3 1 1 2 0 0 0\n1 1 10\n0 45 90\n10\n1 2 3",
            6,
            "its one horizontal angle is 10",
        ),
    ] {
        let fault = Profile::parse(good.replace(old, new).as_bytes()).unwrap_err();
        assert!(fault.what.contains(what) && fault.line == line, "{fault:?}");
        assert!(!fault.next.is_empty());
    }
    let euro = eulumdat(4, 24, |_, _| 100.0);
    for (old, new, line, what) in [
        ("\r\n4\r\n24", "\r\n7\r\n24", 3, "the symmetry is 7"),
        ("\r\n24\r\n15", "\r\n26\r\n15", 6, "symmetry 4 cannot be"),
        ("2000", "0", 42, "intensities are for 0 lm"),
        ("\r\n1\r\n4", "\r\n9\r\n4", 2, "the type indicator is 9"),
        (
            "\r\n0\r\n15\r\n",
            "\r\n10\r\n15\r\n",
            43,
            "the first C plane is 10",
        ),
    ] {
        let fault = Profile::parse(euro.replacen(old, new, 1).as_bytes()).unwrap_err();
        assert!(fault.what.contains(what) && fault.line == line, "{fault:?}");
    }
    let fault = Profile::parse(format!("{euro}\r\n\r\n100").as_bytes()).unwrap_err();
    assert!(fault.what.contains("'100' follows"), "{fault:?}");
    // Blank lines, the end of a file of MS-DOS, and remarks are no numbers.
    for text in [good, &euro] {
        for tail in [
            "",
            "\r\n \r\n\r\n",
            "\u{1a}",
            "\r\n\u{1a}\u{1a}",
            " ,\n",
            "\r\nEND 12",
        ] {
            let read = Profile::parse(format!("{}{tail}", text.trim_end()).as_bytes());
            assert!(read.is_ok(), "{tail:?}: {read:?}");
        }
    }
    assert_eq!(Profile::parse(b"").unwrap_err().line, 1);
}

#[test]
fn directions_are_chosen_as_the_light_is_spread() {
    let shape = |g: f64, c: f64| (g * (1.0 + c.to_radians().cos())).max(0.0);
    let profile = read(&lm63(
        "IESNA91",
        1,
        &steps(0.0, 120.0, 5.0),
        &steps(0.0, 360.0, 15.0),
        shape,
    ));
    let (fine, coarse) = (20_000, 50);
    let (mut weights, mut along, mut integral) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for i in 0..fine {
        for k in 0..coarse {
            let u = [
                (f64::from(i) + 0.5) / f64::from(fine),
                (f64::from(k) + 0.5) / f64::from(coarse),
            ];
            let (d, weight) = profile.direction(u).unwrap();
            assert!((d.length() - 1.0).abs() < 1e-12 && weight < 3.0);
            weights += weight;
            along += weight * d;
        }
    }
    // Against directions that are even over the sphere.
    for i in 0..1000 {
        for k in 0..1000 {
            let (z, c) = (
                1.0 - (2.0 * f64::from(i) + 1.0) / 1000.0,
                2.0 * PI * f64::from(k) / 1000.0,
            );
            let r = (1.0 - z * z).sqrt();
            let even = dvec3(r * c.cos(), r * c.sin(), z);
            integral += even * profile.toward(even) * 4.0 * PI / profile.flux();
        }
    }
    let (count, even) = (f64::from(fine * coarse), 1e6);
    assert!((weights / count - 1.0).abs() < 1e-3, "{}", weights / count);
    assert!((along / count - integral / even).length() < 1e-3);
}

#[test]
fn rounding_adds_nothing_to_even_light() {
    let (vertical, horizontal) = (steps(0.0, 180.0, 15.0), steps(0.0, 360.0, 45.0));
    let profile = read(&lm63("IESNA91", 1, &vertical, &horizontal, |_, _| 62.48));
    for k in 0..1000 {
        let d = at(0.17 * f64::from(k), 0.71 * f64::from(k));
        assert_eq!(profile.toward(d), profile.peak());
    }
}

proptest! {
    /// Whatever the bytes, there is a profile or a fault.
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = Profile::parse(&bytes);
        let mut ies = b"IESNA91\nTILT=NONE\n".to_vec();
        ies.extend(&bytes);
        let _ = Profile::parse(&ies);
    }

    #[test]
    fn any_numbers_are_read_or_refused(numbers in prop::collection::vec(-2_i32..9, 10..60)) {
        let words: Vec<String> = numbers.iter().map(i32::to_string).collect();
        for text in [format!("IESNA91\nTILT=INCLUDE\n{}", words.join(" ")), words.join("\n")] {
            check(&text);
        }
    }

    /// A good file with one piece exchanged.
    #[test]
    fn mutated_files_are_read_or_refused(
        which in 0_usize..3,
        place in any::<prop::sample::Index>(),
        length in 0_usize..12,
        piece in "[-+0-9., \\r\\neExN]{0,10}",
    ) {
        let shape = |g: f64, c: f64| 100.0 + g + c;
        let text = match which {
            0 => lm63("IES:LM-63-2019", 1, &steps(0.0, 90.0, 15.0), &steps(0.0, 360.0, 45.0), shape),
            1 => lm63("IESNA91", 2, &steps(-90.0, 90.0, 30.0), &steps(0.0, 90.0, 30.0), |_, _| 5.0),
            _ => eulumdat(2, 8, shape),
        };
        let start = place.index(text.len());
        let end = (start + length).min(text.len());
        check(&format!("{}{piece}{}", &text[..start], &text[end..]));
    }
}

/// A profile that was read can be used.
fn check(text: &str) {
    let Ok(profile) = Profile::parse(text.as_bytes()) else {
        return;
    };
    assert!(profile.flux() >= 0.0);
    for d in [DVec3::X, DVec3::NEG_Z, at(33.0, 200.0), -at(5.0, 5.0)] {
        assert!(profile.toward(d) >= 0.0 && profile.toward(d) <= profile.peak());
        assert!(profile.at_tilt(d.x).is_finite());
    }
    if let Some((d, weight)) = profile.direction([0.3, 0.7]) {
        assert!(d.is_finite() && weight.is_finite());
    }
}
