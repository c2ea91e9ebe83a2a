//! IES LM-63, the file format of North American photometry: 1986, 1991, 1995, 2002 and 2019.
//!
//! A line that names the edition (not in 1986), keywords (`[LUMINAIRE] ...`; free text in 1986), a line `TILT=`, and then numbers
//! without regard to lines: lamps, lumens of a lamp (-1: absolute photometry), a multiplier of the candela, numbers of vertical
//! and horizontal angles, type (1 C, 2 B, 3 A), units (1 feet, 2 metres), width (along C90), length (along C0) and height
//! of the luminous opening, ballast factor, ballast-lamp factor (since 2002 a number for future use or the way the file was
//! made, which multiplies nothing), watts; the angles, and the candela by horizontal angle.
//!
//! How far horizontal angles reach says which symmetry there is (type C: 0 axial, 90 quadrants, 180 about C0-C180, 90 to 270
//! about C90-C270 and 360 none; types A and B: from 0 alike on both sides, from -90 none). `TILT=INCLUDE` gives the share of
//! light that is left at angles of tilt, which counts when the lamp is mounted; a file named there is not read.

use super::Fault;
use super::numbers::Lines;
use super::table::{Angles, BRIGHTEST, MOST_ANGLES, MeasuredTable, Profile, Symmetry};

/// Metres in a foot (exact, 1959).
const FOOT: f64 = 0.3048;
/// First lines of the editions that have one.
const EDITIONS: [(&str, &str); 4] = [
    ("IESNA91", "LM-63-1991"),
    ("IESNA:LM-63-1995", "LM-63-1995"),
    ("IESNA:LM-63-2002", "LM-63-2002"),
    ("IES:LM-63-2019", "LM-63-2019"),
];
/// Keywords that name a luminaire, the first that is there.
const NAMES: [&str; 2] = ["[LUMINAIRE]", "[LUMCAT]"];
/// Angles that are meant to be equal differ by less, degrees.
const SAME: f64 = 0.05;
/// A lamp that gives out this much more than what stands in it is odd.
const MORE: f64 = 1.02;

/// Is it LM-63? Every edition has a line `TILT=`.
pub(super) fn is_lm63(text: &str) -> bool {
    let start = |line: &str, what: &str| {
        line.trim_start()
            .get(..what.len())
            .is_some_and(|s| s.eq_ignore_ascii_case(what))
    };
    start(text, "IESNA")
        || start(text, "IES:LM-63")
        || text.split(['\n', '\r']).any(|line| start(line, "TILT="))
}

/// Reads a file.
pub(super) fn parse(text: &str) -> Result<Profile, Fault> {
    let mut lines = Lines::new(text);
    let head = head(&mut lines)?;
    let mut number = |what: &str| lines.number(what);
    let lamps = number("the number of lamps")?;
    let lumens = number("the lumens of a lamp")?;
    let multiplier = number("the candela multiplier")?;
    let [vertical, horizontal] = [
        number("the number of vertical angles")?,
        number("the number of horizontal angles")?,
    ];
    let rows = lines.count(vertical, MOST_ANGLES, "the number of vertical angles")?;
    let planes = lines.count(horizontal, MOST_ANGLES, "the number of horizontal angles")?;
    if rows < 2 || planes < 1 {
        let what = format!("has {rows} vertical and {planes} horizontal angles");
        return Err(lines.fault(what, "give at least two vertical angles and one horizontal"));
    }
    let kind = lines.number("the photometric type")?;
    let angles = match kind {
        1.0 => Angles::C,
        2.0 => Angles::B,
        3.0 => Angles::A,
        _ => {
            let what = format!("{kind} is no photometric type");
            return Err(lines.fault(what, "give 1 (C), 2 (B) or 3 (A)"));
        }
    };
    let unit = match lines.number("the units of length")? {
        1.0 => FOOT,
        2.0 => 1.0,
        unit => {
            let what = format!("{unit} is no unit of length");
            return Err(lines.fault(what, "give 1 (feet) or 2 (metres)"));
        }
    };
    let opening = lines.list(3, "the luminous opening")?;
    let ballast = lines.number("the ballast factor")?;
    let ballast_lamp = lines.number("the ballast-lamp factor")?;
    let factor = match head.edition.1 {
        "LM-63-1986" | "LM-63-1991" => multiplier * ballast * ballast_lamp,
        // From 1995 on the number is kept for other things.
        _ => multiplier * ballast,
    };
    // Written so that NaN fails.
    if !(factor > 0.0 && factor.is_finite()) {
        let what = format!("candela are multiplied by {factor}");
        return Err(lines.fault(what, "give multipliers and factors above 0"));
    }
    lines.number("the input watts")?;
    let measured = table(&mut lines, angles, rows, planes, factor)?;
    lines.end(
        "write decimals with a point (a comma makes two numbers of one), and as many intensities as the angles say",
    )?;
    let mut profile = Profile::new(measured);
    profile.luminaire = head.luminaire;
    profile.format = head.edition.1.into();
    profile.tilt = head.tilt;
    // Negative lengths are diameters of round openings.
    profile.opening_m = [1, 0, 2].map(|k: usize| unit * opening[k].abs());
    profile.lamps_lm = (lumens > 0.0)
        .then_some(lamps * lumens)
        .filter(|lm| *lm > 0.0);
    if let Some(lamps) = profile.lamps_lm.map(|lm| lm * ballast)
        && profile.flux() > MORE * lamps
    {
        profile.warnings.push(format!(
            "gives out {:.0} lm, and its lamps only {lamps:.0} lm",
            profile.flux()
        ));
    }
    Ok(profile)
}

/// What stands before the numbers.
struct Head {
    edition: (&'static str, &'static str),
    luminaire: String,
    tilt: Vec<[f64; 2]>,
}

fn head(lines: &mut Lines) -> Result<Head, Fault> {
    let mut names = [const { String::new() }; NAMES.len()];
    let mut edition = ("", "LM-63-1986");
    let mut first = true;
    loop {
        let line = lines.next_line("a line TILT=")?;
        if first {
            let upper = line.to_ascii_uppercase();
            let known = EDITIONS.iter().find(|(start, _)| upper.starts_with(start));
            edition = *known.unwrap_or(&edition);
            first = false;
        }
        let upper = line.to_ascii_uppercase();
        for (keyword, name) in NAMES.iter().zip(&mut names) {
            if upper.starts_with(keyword) && name.is_empty() {
                *name = line[keyword.len()..].trim().to_owned();
            }
        }
        let Some(tilt) = upper.strip_prefix("TILT=") else {
            continue;
        };
        let tilt = match tilt.trim() {
            "NONE" => Vec::new(),
            "INCLUDE" => tilts(lines)?,
            other => {
                let what = format!("takes its tilt from another file, '{other}'");
                let next = "write TILT=INCLUDE and its lines, or TILT=NONE if it hangs as measured";
                return Err(lines.fault(what, next));
            }
        };
        let luminaire = names.into_iter().find(|n| !n.is_empty());
        return Ok(Head {
            edition,
            luminaire: luminaire.unwrap_or_default(),
            tilt,
        });
    }
}

/// Lamp position, angles, shares.
fn tilts(lines: &mut Lines) -> Result<Vec<[f64; 2]>, Fault> {
    lines.number("the position of the lamp")?;
    let count = lines.number("the number of tilt angles")?;
    let count = lines.count(count, MOST_ANGLES, "the number of tilt angles")?;
    let angles = ascending(lines, count, [-180.0, 180.0], "a tilt angle")?;
    let shares = lines.list(count, "a share of light at a tilt")?;
    if shares.iter().any(|s| *s < 0.0) {
        return Err(lines.fault(
            "a share of light at a tilt is negative",
            "give shares of at least 0",
        ));
    }
    Ok(angles
        .into_iter()
        .zip(shares)
        .map(|(a, s)| [a, s])
        .collect())
}

fn ascending(
    lines: &mut Lines,
    count: usize,
    [low, high]: [f64; 2],
    what: &str,
) -> Result<Vec<f64>, Fault> {
    let mut angles: Vec<f64> = Vec::new();
    for _ in 0..count {
        let angle = lines.number(what)?;
        if !(low - SAME..=high + SAME).contains(&angle) {
            let what = format!("{what} is {angle}");
            return Err(lines.fault(what, format!("give angles from {low} to {high} degrees")));
        }
        if angles.last().is_some_and(|last| angle <= *last) {
            let what = format!(
                "{what}, {angle}, does not follow on {}",
                angles[angles.len() - 1]
            );
            return Err(lines.fault(what, "give angles in ascending order"));
        }
        angles.push(angle.clamp(low, high));
    }
    Ok(angles)
}

/// Angles and candela, brought to polar angle and azimuth.
fn table(
    lines: &mut Lines,
    angles: Angles,
    rows: usize,
    planes: usize,
    factor: f64,
) -> Result<MeasuredTable, Fault> {
    let (low, high) = match angles {
        Angles::C => ([0.0, 180.0], [0.0, 360.0]),
        Angles::A => ([-90.0, 90.0], [-180.0, 180.0]),
        Angles::B => ([-90.0, 90.0], [-90.0, 90.0]),
    };
    let vertical = ascending(lines, rows, low, "a vertical angle")?;
    let mut horizontal = ascending(lines, planes, high, "a horizontal angle")?;
    if angles == Angles::C && planes == 1 && horizontal[0] > SAME {
        let what = format!("its one horizontal angle is {}", horizontal[0]);
        return Err(lines.fault(what, "give 0 for light that is alike all around"));
    }
    let mut candela = Vec::new();
    for _ in 0..planes {
        let mut plane = lines.list(rows, "an intensity")?;
        for value in &mut plane {
            *value *= factor;
            if !(0.0..=BRIGHTEST).contains(value) {
                let what = format!("an intensity is {value} cd");
                return Err(lines.fault(what, "give candela of at least 0, and no more than 1e12"));
            }
        }
        candela.push(plane);
    }
    let (first, last) = (horizontal[0], horizontal[planes - 1]);
    let is = |angle: f64, wanted: f64| (angle - wanted).abs() < SAME;
    if angles != Angles::C {
        if planes < 2 {
            let what = format!("type {} has but one horizontal angle", angles.letter());
            return Err(lines.fault(what, "give at least two"));
        }
        if is(first, 0.0) {
            // Alike on both sides.
            let sides = |k: usize| (-horizontal[k], candela[k].clone());
            let left: Vec<(f64, Vec<f64>)> = (1..planes).rev().map(sides).collect();
            let right = horizontal.into_iter().zip(candela);
            (horizontal, candela) = left.into_iter().chain(right).unzip();
        }
        return Ok(sideways(angles, &vertical, &horizontal, candela));
    }
    let symmetry = match (planes, first, last) {
        (1, ..) => Symmetry::Axial,
        (_, f, l) if is(f, 0.0) && is(l, 90.0) => Symmetry::Quadrant,
        (_, f, l) if is(f, 0.0) && is(l, 180.0) => Symmetry::Plane0,
        (_, f, l) if is(f, 90.0) && is(l, 270.0) => Symmetry::Plane90,
        (_, f, l) if is(f, 0.0) && closes(&horizontal, l) => Symmetry::None,
        _ => {
            let what = format!("horizontal angles reach from {first} to {last} degrees");
            let next = "give 0, 0 to 90, 0 to 180, 90 to 270 or 0 to 360 degrees";
            return Err(lines.fault(what, next));
        }
    };
    Ok(MeasuredTable {
        angles,
        symmetry,
        polar: vertical,
        azimuth: horizontal,
        candela,
    })
}

/// Do planes from 0 to `last` go round? Some files leave out 360, where 0 stands already.
fn closes(horizontal: &[f64], last: f64) -> bool {
    let steps = horizontal.windows(2).map(|w| w[1] - w[0]);
    horizontal.len() > 2 && 360.0 - last <= SAME + steps.fold(0.0, f64::max)
}

/// Types A and B: which of the angles counts from the axis.
fn sideways(
    angles: Angles,
    vertical: &[f64],
    horizontal: &[f64],
    candela: Vec<Vec<f64>>,
) -> MeasuredTable {
    let from_axis = |list: &[f64]| list.iter().map(|a| 90.0 + a).collect();
    let (polar, azimuth, candela) = match angles {
        Angles::B => {
            let column = |k: usize| candela.iter().map(|plane| plane[k]).collect();
            let columns = (0..vertical.len()).map(column).collect();
            (from_axis(horizontal), vertical.to_vec(), columns)
        }
        _ => (from_axis(vertical), horizontal.to_vec(), candela),
    };
    MeasuredTable {
        angles,
        symmetry: Symmetry::None,
        polar,
        azimuth,
        candela,
    }
}
