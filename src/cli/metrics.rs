//! `probe --metrics`: what a lighting designer asks of the light at points, each figure with the range that the stated error
//! of the light allows (an *estimate*, see [`Range`]).
//!
//! | name | what |
//! |---|---|
//! | `lux` | illuminance |
//! | `CCT_K`, `Duv` | correlated colour temperature and distance from the Planckian locus (Ohno 2014) |
//! | `Ra`, `R9` | colour rendering (CIE 13.3-1995) |
//! | `Rf`, `Rg` | colour fidelity and gamut (ANSI/IES TM-30-20; Rf is CIE 224:2017) |
//! | `DF_percent` | daylight factor, where there is a sky: illuminance under the sky alone (no sun, no lamps), over that of open level ground |
//! | `EDI_sc`, `_mc`, `_lc`, `_rh`, `_mel` | alpha-opic equivalent daylight illuminance of the S-, M-, L-cones, rods, melanopsin, lx (CIE S 026) |
//!
//! The CSV has `NAME,NAME_low,NAME_high` of each after `place`, without a second `lux`; what is not defined is an empty cell. The
//! JSON has `metrics`: `{"kind": "estimate", "relative_error": r, "chromaticity_error": e, "points": [{NAME: {"value", "low",
//! "high"}}], "uniformity": {...}}`, where what has no value has a `reason`, and Ra of a light further from its reference than
//! the CIE vouches for has a `note`. Uniformity is that of the points in the room.
//!
//! The verdict of a bake's log has the same figures, `metrics`, of the mean light on all surfaces, and beside them
//!
//! | field | what |
//! |---|---|
//! | `working_plane` | a horizontal grid `height_m` above the floor at `floor_m` (see [`WorkingPlane`]), of its points those in the room and not in hollows, `left_out`: `points`, `spacing_m`, `mean_lux`, `min_lux`, `max_lux`, `min_over_mean`, `min_over_max`; with a sky `DF_percent`, its `mean` and `median`. Null without a floor |
//! | `ugr` | what `probe --ugr` tells, from the place of each camera, of the file or chosen, along its view, with the `camera`'s name |
//!
//! Ranges are those of a point; means err less. The daylight factor is taken from the rows that hold the light of the sky by themselves, and
//! its range is as if all of the light's error were the sky's; where rows do not keep it apart there is a `reason` instead, and
//! `probe --metrics` finds it by a bake of its own.
//!
//! Light is held on 64 bands. Against tables at 5 nm, over all 48 illuminants of the CIE, that shifts colour temperature by
//! up to .5 %, Duv by .0003, Ra by 1.3, R9 by 5, Rf and Rg by .9 and alpha-opic daylight by .5 %, most of it in lamps of
//! lines; the ranges do not hold this.

use super::glare::{self, Viewpoint};
use crate::color::{
    Bands, GREATEST_DISTANCE, LightMeasures, MEASURES, Meter, NAMES, Range, Stated, Uniformity,
};
use crate::gather::{Probed, WorkingPlane};
use crate::scene::Camera;
use crate::solve::{Bake, Round};
use crate::spectrum::{Grid, Spectrum};
use crate::survey::{PointLocation, places};
use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Name of the daylight factor.
const DAYLIGHT: &str = "DF_percent";
/// A part of a working plane with less light in the mean than this share of the brightest part lies in a hollow or behind a closed door, and
/// is left out: in walls of sheets that let light in at their joints it is 5e-4 of that of the room.
const HOLLOW: f64 = 1e-3;
/// So is one with a smaller share of the points than this, in a cupboard or a pillar: a room of a flat has more.
const PART: f64 = 0.05;
/// Place of Ra among the measures.
const RA: usize = 3;

/// The figures of all points.
pub(super) struct Metrics {
    stated: Option<Stated>,
    points: Vec<(LightMeasures, [Option<Range>; MEASURES])>,
    /// Over the points in the room, and how many they are.
    uniformity: Option<(Uniformity, usize)>,
    /// Daylight factors, per cent, and the relative error of the light under the sky, where there is one.
    daylight: Option<(Vec<f64>, Option<f64>)>,
}

impl Metrics {
    /// Measures the light at points; its error is what the last round states.
    pub(super) fn new(
        grid: &Grid,
        probed: &[Probed],
        places: &[PointLocation],
        last: Option<&Round>,
    ) -> Self {
        let meter = Meter::new(&Bands::of(grid));
        let stated = stated(last);
        let points: Vec<_> = (probed.par_iter())
            .map(|light| measured(&meter, &light.spectrum, stated))
            .collect();
        let inside = probed.iter().zip(places);
        let lux: Vec<f64> = inside
            .filter(|(_, place)| **place == PointLocation::Room)
            .map(|(light, _)| light.xyz[1])
            .collect();
        Self {
            stated,
            points,
            uniformity: Uniformity::of(&lux).map(|all| (all, lux.len())),
            daylight: None,
        }
    }

    /// The same with daylight factors, per cent, and the relative error of what they were taken from.
    pub(super) fn with_daylight(self, factors: Vec<f64>, relative: Option<f64>) -> Self {
        Self {
            daylight: Some((factors, relative)),
            ..self
        }
    }

    /// Daylight factor of a point and its range.
    fn daylight(&self, point: usize) -> Option<(f64, Option<Range>)> {
        let (factors, relative) = self.daylight.as_ref()?;
        let factor = factors[point];
        let range = relative.map(|relative| Range {
            low: factor * (1.0 - relative).max(0.0),
            high: factor * (1.0 + relative),
        });
        Some((factor, range))
    }

    /// Columns of the CSV.
    pub(super) fn columns(&self) -> Vec<String> {
        let of = |name: &str| {
            [
                name.to_owned(),
                format!("{name}_low"),
                format!("{name}_high"),
            ]
        };
        // Illuminance has its column already.
        let daylight = self.daylight.iter().flat_map(|_| of(DAYLIGHT));
        let all = NAMES.iter().flat_map(|name| of(name)).skip(1);
        all.chain(daylight).collect()
    }

    /// Cells of the CSV of a point.
    pub(super) fn cells(&self, point: usize) -> Vec<String> {
        let (measured, ranges) = &self.points[point];
        let cell = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        (measured.values.iter().zip(ranges))
            .flat_map(|(value, range)| {
                [
                    cell(value.ok()),
                    cell(range.map(|r| r.low)),
                    cell(range.map(|r| r.high)),
                ]
            })
            .skip(1)
            .chain(
                self.daylight(point)
                    .into_iter()
                    .flat_map(|(factor, range)| {
                        [Some(factor), range.map(|r| r.low), range.map(|r| r.high)].map(cell)
                    }),
            )
            .collect()
    }

    /// Uniformity in a line; none without points in the room.
    pub(super) fn line(&self) -> Option<String> {
        let (all, count) = self.uniformity?;
        let (Some(mean), Some(max)) = (all.min_over_mean(), all.min_over_max()) else {
            return Some(format!("uniformity over {count} points: no light"));
        };
        let range = |ratio: f64| match self.stated {
            Some(stated) => {
                let range = Uniformity::range(ratio, stated.relative);
                format!(" ({:.3} to {:.3}, estimate)", range.low, range.high)
            }
            None => String::new(),
        };
        Some(format!(
            "uniformity over {count} points: min/mean {mean:.3}{}, min/max {max:.3}{}, mean {:.1} lx",
            range(mean),
            range(max),
            all.mean
        ))
    }

    /// All as JSON.
    pub(super) fn json(&self) -> Value {
        let points = self
            .points
            .iter()
            .enumerate()
            .map(|(k, (measured, ranges))| {
                let mut point = point(measured, ranges);
                if let Some((factor, range)) = self.daylight(k) {
                    point[DAYLIGHT] = figure(Ok::<_, String>(factor), range);
                }
                point
            });
        let points: Vec<Value> = points.collect();
        let uniformity = self.uniformity.map(|(all, count)| {
            let mut uniformity = uniform(&all, self.stated);
            uniformity["points"] = json!(count);
            uniformity
        });
        json!({
            "kind": "estimate",
            "relative_error": self.stated.map(|s| s.relative),
            "chromaticity_error": self.stated.map(|s| s.chromaticity),
            "points": points,
            "uniformity": uniformity,
        })
    }
}

/// Uniformity as JSON.
fn uniform(all: &Uniformity, stated: Option<Stated>) -> Value {
    let ratio = |ratio: Option<f64>| {
        let range =
            (ratio.zip(stated)).map(|(ratio, stated)| Uniformity::range(ratio, stated.relative));
        figure(ratio.ok_or("no light"), range)
    };
    json!({
        "min_lux": all.min,
        "mean_lux": all.mean,
        "max_lux": all.max,
        "min_over_mean": ratio(all.min_over_mean()),
        "min_over_max": ratio(all.min_over_max()),
    })
}

/// What a round says of the error at points.
fn stated(last: Option<&Round>) -> Option<Stated> {
    let error = &last?.error;
    Some(Stated {
        relative: error.total_relative.value?,
        chromaticity: error.geometry_chromaticity.value?,
    })
}

/// The figures of the mean light on all surfaces of a room, as JSON; ranges are those of a point, and the mean errs less.
pub(super) fn of_room(bake: &Bake) -> Value {
    let meter = Meter::new(&Bands::of(&bake.scene().grid));
    let stated = stated(bake.rounds().last());
    let (measured, ranges) = measured(&meter, &bake.mean_spectrum(), stated);
    point(&measured, &ranges)
}

/// The same with those of the working plane, and glare as the cameras see it.
pub(super) fn of_bake(bake: &Bake, cameras: &[Camera]) -> Value {
    let stated = stated(bake.rounds().last());
    let relative = stated.map(|stated| stated.relative);
    let mut all = of_room(bake);
    let plane = bake
        .working_plane()
        .and_then(|plane| on_plane(bake, &plane, stated));
    all["working_plane"] = plane.unwrap_or(Value::Null);
    let scale = bake.scene().changes.scale;
    let views = cameras.iter().map(|camera| {
        let (place, back) = (camera.to_world.w_axis, camera.to_world.z_axis);
        let place = place.truncate();
        let direction = -back.truncate().normalize_or(DVec3::Z);
        let view = Viewpoint {
            eye: place / scale,
            direction,
        };
        let mut entry = glare::entry(&view, &bake.glare(place, direction), relative);
        entry["camera"] = json!(camera.name);
        entry
    });
    all["ugr"] = views.collect();
    all
}

/// The figures of a working plane; none where no point of it is in the room.
fn on_plane(bake: &Bake, plane: &WorkingPlane, stated: Option<Stated>) -> Option<Value> {
    let scene = bake.scene();
    let places = places(scene, &plane.points).into_iter().enumerate();
    let inside = |(k, place): (usize, PointLocation)| (place == PointLocation::Room).then_some(k);
    let inside: Vec<usize> = places.filter_map(inside).collect();
    let points: Vec<(DVec3, DVec3)> = inside.iter().map(|&k| plane.points[k]).collect();
    let (probed, mut by_sky) = bake.probe_with_sky(&points);
    let mut lux: Vec<f64> = probed.iter().map(|light| light.xyz[1]).collect();
    let mut parts: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
    for (&k, lux) in inside.iter().zip(&lux) {
        let of = parts.entry(plane.parts[k]).or_default();
        *of = [of[0] + lux, of[1] + 1.0];
    }
    parts.retain(|_, [_, n]| *n >= PART * inside.len() as f64);
    let mean = |[sum, n]: &[f64; 2]| sum / n;
    let brightest = parts.values().map(mean).fold(0.0, f64::max);
    parts.retain(|_, of| mean(of) >= HOLLOW * brightest);
    let counts = |k: &usize| parts.contains_key(&plane.parts[*k]);
    let counts: Vec<bool> = inside.iter().map(counts).collect();
    let keep = |values: &mut Vec<f64>| {
        let mut counts = counts.iter();
        values.retain(|_| counts.next() == Some(&true));
    };
    keep(&mut lux);
    by_sky.iter_mut().for_each(keep);
    let all = Uniformity::of(&lux)?;
    let mut out = uniform(&all, stated);
    let mean = stated.map(|stated| Range::of(all.mean).scaled(stated.relative));
    out["mean_lux"] = figure(Ok::<_, String>(all.mean), mean);
    out["points"] = json!(lux.len());
    out["left_out"] = json!(points.len() - lux.len());
    out["spacing_m"] = json!(plane.spacing);
    out["floor_m"] = json!(plane.floor);
    out["height_m"] = json!(plane.height);
    if let Some(outside) = scene.sky_illuminance().filter(|&lux| lux > 0.0) {
        let factors = by_sky.map(|lux| lux.iter().map(|lux| 100.0 * lux / outside).collect());
        // As if all of the error were the sky's.
        let may_err = stated.map(|stated| 100.0 * stated.relative * all.mean / outside);
        out[DAYLIGHT] = daylight_of(factors, may_err);
    }
    Some(out)
}

/// Mean and median of daylight factors, per cent, that may be wrong by so much in the mean.
fn daylight_of(factors: Option<Vec<f64>>, may_err: Option<f64>) -> Value {
    let Some(mut factors) = factors else {
        let reason =
            "the light of the sky is not kept apart from other light here: see probe --metrics";
        return json!({ "value": null, "reason": reason });
    };
    factors.sort_by(f64::total_cmp);
    let count = factors.len();
    let mean = factors.iter().sum::<f64>() / count as f64;
    let median = 0.5 * (factors[(count - 1) / 2] + factors[count / 2]);
    let told = |factor: f64| {
        let range = may_err.map(|error| Range {
            low: (factor - error).max(0.0),
            high: factor + error,
        });
        figure(Ok::<_, String>(factor), range)
    };
    json!({ "mean": told(mean), "median": told(median) })
}

/// The figures of a light, and the ranges that the stated error allows.
fn measured(
    meter: &Meter,
    light: &Spectrum,
    stated: Option<Stated>,
) -> (LightMeasures, [Option<Range>; MEASURES]) {
    let measured = meter.measure(light);
    let ranges = stated.map_or([None; MEASURES], |stated| {
        meter.ranges(light, &measured, stated)
    });
    (measured, ranges)
}

fn point(measured: &LightMeasures, ranges: &[Option<Range>; MEASURES]) -> Value {
    let mut out = Map::new();
    for (k, name) in NAMES.into_iter().enumerate() {
        let value = measured.values[k].map_err(|reason| reason.to_string());
        let mut figure = figure(value, ranges[k]);
        if let Some(distance) = measured.reference_distance
            && k == RA
            && distance > GREATEST_DISTANCE
        {
            figure["note"] = json!(format!(
                "the light is {distance:.4} from its reference in (u, v); CIE 13.3 vouches for up to {GREATEST_DISTANCE}"
            ));
        }
        out.insert(name.into(), figure);
    }
    Value::Object(out)
}

fn figure(value: Result<f64, impl Into<String>>, range: Option<Range>) -> Value {
    match value {
        Ok(value) => json!({
            "value": value,
            "low": range.map(|r| r.low),
            "high": range.map(|r| r.high),
        }),
        Err(reason) => json!({ "value": null, "reason": reason.into() }),
    }
}
