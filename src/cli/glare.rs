//! `probe --ugr EYE`: discomfort glare at viewpoints, the unified glare rating (CIE 117:1995).
//!
//! JSON: `"ugr": [{"eye": [x, y, z], "direction": [x, y, z], "background_cd_m2": L, "rating": {"value", "low", "high"} (an
//! estimate: the background is what is estimated), "luminaires": [{"name", "luminance_cd_m2", "solid_angle_sr", "position_index"}],
//! "left_out": [names]}]`.

use crate::color::{Range, glare_range};
use crate::gather::Glare;
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::str::FromStr;

/// Where somebody looks from and which way, in the file's units and glTF space.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Viewpoint {
    /// The eye.
    pub eye: DVec3,
    /// Direction, of any length.
    pub direction: DVec3,
}

impl FromStr for Viewpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> = text
            .split(',')
            .map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        let Some(&[x, y, z, dx, dy, dz]) = numbers.as_deref() else {
            return Err(
                "a viewpoint is X,Y,Z,DX,DY,DZ: where the eye is and which way it looks".into(),
            );
        };
        let direction = dvec3(dx, dy, dz);
        match direction.try_normalize() {
            Some(_) => Ok(Self {
                eye: dvec3(x, y, z),
                direction,
            }),
            None => Err("the direction has no length".into()),
        }
    }
}

/// Where a rating lies by the stated error of the light.
fn range(glare: &Glare, relative: Option<f64>) -> Option<(f64, Option<Range>)> {
    let rating = glare.rating.filter(|rating| rating.is_finite())?;
    Some((
        rating,
        relative.map(|relative| glare_range(rating, relative)),
    ))
}

/// Why there is no rating.
fn reason(glare: &Glare) -> &'static str {
    match glare.rating {
        None => "the background is black",
        Some(_) => "no luminaire is seen",
    }
}

/// A viewpoint in a line.
pub(super) fn line(view: &Viewpoint, glare: &Glare, relative: Option<f64>) -> String {
    let rating = match range(glare, relative) {
        Some((rating, Some(range))) => {
            format!(
                "{rating:.1} ({:.1} to {:.1}, estimate)",
                range.low, range.high
            )
        }
        Some((rating, None)) => format!("{rating:.1}"),
        None => format!("not defined: {}", reason(glare)),
    };
    let mut line = format!(
        "UGR at {} looking along {}: {rating}; background {:.1} cd/m2",
        view.eye, view.direction, glare.background
    );
    for (name, bright) in &glare.luminaires {
        line += &format!(
            "; {name} {:.0} cd/m2, {:.4} sr, p {:.2}",
            bright.luminance,
            bright.solid_angle,
            bright.position()
        );
    }
    for what in &glare.left_out {
        line += &format!("; left out: {what}");
    }
    line
}

/// A viewpoint as JSON.
pub(super) fn entry(view: &Viewpoint, glare: &Glare, relative: Option<f64>) -> Value {
    let rating = match range(glare, relative) {
        Some((rating, range)) => json!({
            "value": rating,
            "low": range.map(|r| r.low),
            "high": range.map(|r| r.high).filter(|high| high.is_finite()),
        }),
        None => json!({ "value": null, "reason": reason(glare) }),
    };
    let luminaires = glare.luminaires.iter().map(|(name, bright)| {
        json!({
            "name": name,
            "luminance_cd_m2": bright.luminance,
            "solid_angle_sr": bright.solid_angle,
            "position_index": bright.position(),
        })
    });
    json!({
        "eye": view.eye.to_array(),
        "direction": view.direction.to_array(),
        "background_cd_m2": glare.background,
        "rating": rating,
        "luminaires": luminaires.collect::<Vec<_>>(),
        "left_out": glare.left_out,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viewpoints_read_or_say_what_they_are() {
        let view: Viewpoint = "1, 1.2,3,0,0,-1".parse().unwrap();
        assert_eq!(view.eye, dvec3(1.0, 1.2, 3.0));
        assert_eq!(view.direction, DVec3::NEG_Z);
        for wrong in ["", "1,2,3", "1,2,3,0,0,0", "1,2,3,a,0,1", "1,2,3,inf,0,1"] {
            assert!(wrong.parse::<Viewpoint>().is_err(), "{wrong}");
        }
    }
}
