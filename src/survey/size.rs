//! Rooms that are too large or too small: a file in centimetres or inches read as metres.

use crate::scene::Scene;
use glam::DVec3;

/// Larger than this a room is not, m, nor smaller.
const LARGEST: f64 = 300.0;
const SMALLEST: f64 = 0.3;
/// What the longest side of a room is like, m, at least, as a rule, and at most.
const LIKELY: [f64; 3] = [2.0, 6.0, 100.0];
/// Units that files are drawn in by mistake: metres in one of them, and its name.
const UNITS: [(f64, &str); 6] = [
    (0.01, "centimetres"),
    (0.001, "millimetres"),
    (0.0254, "inches"),
    (0.3048, "feet"),
    (100.0, "hundreds of metres"),
    (1000.0, "kilometres"),
];

/// What to say of the room's size, if it is strange.
pub(super) fn hint(scene: &Scene) -> Option<String> {
    let positions = || scene.surfaces.iter().flat_map(|s| &s.positions);
    let low = positions().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = positions().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    let side = (high - low).max_element();
    if (SMALLEST..=LARGEST).contains(&side) {
        return None;
    }
    let [least, usual, most] = LIKELY;
    let off = |factor: f64| (side * factor / usual).ln().abs();
    let unit = UNITS
        .iter()
        .filter(|(factor, _)| (least..=most).contains(&(side * factor)))
        .min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
    let (size, more) = (shown(side), scene.changes.scale);
    let way_out = match unit {
        Some((factor, name)) => format!(
            "if it is drawn in {name}, give --scale {}",
            shown(factor * more)
        ),
        None => "if its unit is not the metre, give --scale METRES_PER_UNIT".into(),
    };
    Some(format!(
        "the room is {size} m across (its longest side): {way_out}; lamps in candela light it by its size"
    ))
}

/// Four digits at the most.
fn shown(number: f64) -> String {
    if number >= 1000.0 {
        return format!("{number:.0}");
    }
    let digits = (3 - number.log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{number:.digits$}");
    match text.split_once('.') {
        Some(_) => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (number, text) in [
            (0.01, "0.01"),
            (560.0, "560"),
            (5600.4, "5600"),
            (0.0254, "0.0254"),
            (0.05591, "0.05591"),
            (312.55, "312.6"),
        ] {
            assert_eq!(shown(number), text);
        }
    }
}
