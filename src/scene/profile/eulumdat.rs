//! EULUMDAT, the file format of European photometry (A. Stockmar, 1990): one value a line, in a settled order.
//!
//! | line | what |
//! |---|---|
//! | 1 | maker |
//! | 2 to 7 | type indicator, symmetry, planes Mc and their step, angles Ng and their step |
//! | 8 to 12 | report, name, number, file, date |
//! | 13 to 21 | length, width and height of the luminaire and of its luminous area, mm |
//! | 22 to 25 | share downwards, light output ratio (%), factor of the intensities, tilt when measured |
//! | 26 | sets of lamps, then six lines for each: lamps, type, lumens of all, colour, rendering, watts |
//! | then | ten direct ratios, Mc planes, Ng angles, intensities in cd for 1000 lm of the lamps, plane by plane |
//!
//! Symmetry 0: all Mc planes are there; 1: one; 2: those from 0 to 180; 3: from 270 over 0 to 90; 4: from 0 to 90 degrees. A
//! number of lamps below 0 means absolute photometry; the lumens then are those of the luminaire. Of several sets of lamps
//! the first counts, which a warning says.

use super::Fault;
use super::numbers::Lines;
use super::table::{Angles, BRIGHTEST, MOST_ANGLES, MeasuredTable, Profile, Symmetry};

/// Greatest type indicator: 0 point source, 1 one that is alike all around, 2 linear, 3 any other; nothing follows from it here.
const MOST_TYPE: usize = 3;
/// Planes are where they should be within this, degrees.
const SAME: f64 = 0.1;
/// Metres in a millimetre.
const MM: f64 = 1e-3;
/// Sets of lamps at the most (the format says 20).
const MOST_SETS: usize = 100;
/// By how much the light may differ from what the light output ratio says before a warning does: files give it in whole per cents
/// or tenths.
const OFF: f64 = 0.03;

/// Reads a file.
pub(super) fn parse(text: &str) -> Result<Profile, Fault> {
    let mut lines = Lines::new(text);
    lines.next_line("the maker's name")?;
    let kind = lines.line_number("the type indicator")?;
    lines.count(kind, MOST_TYPE, "the type indicator")?;
    let symmetry = lines.line_number("the symmetry")?;
    let symmetry = lines.count(symmetry, 4, "the symmetry")?;
    let planes = lines.line_number("the number of C planes")?;
    let planes = lines.count(planes, MOST_ANGLES, "the number of C planes")?;
    lines.line_number("the step of the C planes")?;
    let rows = lines.line_number("the number of angles in a plane")?;
    let rows = lines.count(rows, MOST_ANGLES, "the number of angles in a plane")?;
    if planes < 1 || rows < 2 {
        let what = format!("has {planes} planes of {rows} angles");
        return Err(lines.fault(what, "give at least one plane of two angles"));
    }
    if symmetry >= 2 && planes % 2 == 1 || symmetry == 4 && planes % 4 != 0 {
        let what = format!("has {planes} planes, which symmetry {symmetry} cannot be");
        return Err(lines.fault(
            what,
            "count all planes of the circle, also those that are left out",
        ));
    }
    lines.line_number("the step of the angles")?;
    lines.next_line("the number of the report")?;
    let luminaire = lines.next_line("the luminaire's name")?.to_owned();
    for what in ["the luminaire's number", "the file's name", "the date"] {
        lines.next_line(what)?;
    }
    let sizes = lines.column(9, "a length")?;
    let shares = lines.column(2, "a share of the light")?;
    let factor = lines.line_number("the factor of the intensities")?;
    lines.next_line("the tilt when measured")?;
    let lamps = lamps(&mut lines)?;
    lines.column(10, "a direct ratio")?;
    let scale = factor * lamps.lumens / 1000.0;
    // Written so that NaN fails.
    if !(scale > 0.0 && scale.is_finite()) {
        let what = format!("intensities are for {} lm times {factor}", lamps.lumens);
        return Err(lines.fault(what, "give a flux and a factor above 0"));
    }
    let measured = table(&mut lines, symmetry, planes, rows, scale)?;
    lines.end("give as many intensities as symmetry, planes and angles say")?;
    let mut profile = Profile::new(measured);
    profile.luminaire = luminaire;
    profile.format = "EULUMDAT".into();
    profile.lamps_lm = (!lamps.absolute).then_some(lamps.lumens);
    let area = |k: usize| MM * sizes[k].max(0.0);
    // Length lies along the lamps, in C90-C270; a width of 0 is a round one.
    let width = if sizes[4] > 0.0 { area(4) } else { area(3) };
    profile.opening_m = [
        width,
        area(3),
        area(5).max(area(6)).max(area(7)).max(area(8)),
    ];
    if lamps.sets > 1 {
        let what = format!(
            "has {} sets of lamps; the first counts, {} lm",
            lamps.sets, lamps.lumens
        );
        profile.warnings.push(what);
    }
    let told = 0.01 * shares[1] * factor * lamps.lumens;
    if told > 0.0 && (profile.flux() - told).abs() > OFF * told {
        profile.warnings.push(format!(
            "intensities make {:.0} lm, and {} % of {} lm are {told:.0} lm; the intensities count",
            profile.flux(),
            shares[1],
            lamps.lumens
        ));
    }
    Ok(profile)
}

/// The first set of lamps.
struct LampSet {
    sets: usize,
    /// Of the set, lm.
    lumens: f64,
    absolute: bool,
}

fn lamps(lines: &mut Lines) -> Result<LampSet, Fault> {
    let sets = lines.line_number("the number of sets of lamps")?;
    let sets = lines.count(sets, MOST_SETS, "the number of sets of lamps")?;
    if sets == 0 {
        return Err(lines.fault("has no set of lamps", "give at least one"));
    }
    let mut first = None;
    for _ in 0..sets {
        let count = lines.line_number("the number of lamps")?;
        lines.next_line("the type of the lamps")?;
        let lumens = lines.line_number("the lumens of the lamps")?;
        for what in [
            "the colour of the light",
            "the colour rendering",
            "the watts",
        ] {
            lines.next_line(what)?;
        }
        first.get_or_insert(LampSet {
            sets,
            lumens,
            absolute: count < 0.0,
        });
    }
    Ok(first.expect("there is at least one set"))
}

/// Planes, angles and intensities.
fn table(
    lines: &mut Lines,
    symmetry: usize,
    planes: usize,
    rows: usize,
    scale: f64,
) -> Result<MeasuredTable, Fault> {
    let mut circle = Vec::new();
    for _ in 0..planes {
        let angle = lines.line_number("a C plane")?;
        rising(lines, &circle, angle, 360.0, "a C plane")?;
        if circle.is_empty() && angle > SAME {
            let what = format!("the first C plane is {angle}");
            return Err(lines.fault(what, "count planes from 0 degrees"));
        }
        circle.push(angle);
    }
    let mut polar = Vec::new();
    for _ in 0..rows {
        let angle = lines.line_number("an angle")?;
        rising(lines, &polar, angle, 180.0, "an angle")?;
        polar.push(angle);
    }
    // Which of the planes are there, the symmetry they have, and whether 0 stands for 360 as well.
    let (first, count, kind) = match symmetry {
        1 => (0, 1, Symmetry::Axial),
        2 => (0, planes / 2 + 1, Symmetry::Plane0),
        3 => (3 * planes / 4, planes / 2 + 1, Symmetry::Plane90),
        4 => (0, planes / 4 + 1, Symmetry::Quadrant),
        _ => (0, planes, Symmetry::None),
    };
    let mut azimuth = Vec::new();
    let mut candela = Vec::new();
    for k in first..first + count {
        let mut plane = lines.column(rows, "an intensity")?;
        for value in &mut plane {
            *value *= scale;
            if !(0.0..=BRIGHTEST).contains(value) {
                let what = format!("an intensity is {value} cd");
                return Err(lines.fault(
                    what,
                    "give intensities of at least 0, and no more than 1e12 cd",
                ));
            }
        }
        let turns = if symmetry == 3 && k < planes {
            -360.0
        } else {
            0.0
        };
        azimuth.push(circle[k % planes] + turns);
        candela.push(plane);
    }
    if kind == Symmetry::None && planes > 1 && circle[planes - 1] < 360.0 {
        azimuth.push(azimuth[0] + 360.0);
        candela.push(candela[0].clone());
    }
    reaches(lines, kind, [azimuth[0], azimuth[azimuth.len() - 1]])?;
    Ok(MeasuredTable {
        angles: Angles::C,
        symmetry: kind,
        polar,
        azimuth,
        candela,
    })
}

/// What a symmetry folds must reach to where it folds.
fn reaches(lines: &Lines, kind: Symmetry, ends: [f64; 2]) -> Result<(), Fault> {
    let (number, folds) = match kind {
        Symmetry::Plane0 => (2, [0.0, 180.0]),
        Symmetry::Plane90 => (3, [-90.0, 90.0]),
        Symmetry::Quadrant => (4, [0.0, 90.0]),
        Symmetry::None | Symmetry::Axial => return Ok(()),
    };
    if (0..2).all(|k| (ends[k] - folds[k]).abs() <= SAME) {
        return Ok(());
    }
    let [from, to] = ends;
    let what = format!("planes with symmetry {number} reach from {from} to {to}");
    let next = format!("they must reach from {} to {}", folds[0], folds[1]);
    Err(lines.fault(what, next))
}

fn rising(lines: &Lines, before: &[f64], angle: f64, most: f64, what: &str) -> Result<(), Fault> {
    if !(0.0..=most).contains(&angle) {
        let what = format!("{what} is {angle}");
        return Err(lines.fault(what, format!("give degrees from 0 to {most}")));
    }
    match before.last() {
        Some(last) if angle <= *last => {
            let what = format!("{what}, {angle}, does not follow on {last}");
            Err(lines.fault(what, "give angles in ascending order"))
        }
        _ => Ok(()),
    }
}
