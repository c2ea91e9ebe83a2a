//! The room from above, as SVG: outlines, lamps and cameras, with metres along both sides. x runs to the right, z down the
//! page (towards the viewer in glTF). Same input, same bytes.

use super::axis::{Axis, Scale, label};
use super::svg::{Anchor, Svg, text_width};
use crate::output::camera;
use crate::scene::facts::{Facts, LightFact};
use crate::scene::{LightKind, Projection, Scene};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// The drawn room is as large as fits in here, pixels.
const ROOM: [f64; 2] = [640.0, 560.0];
/// Free space left, top, bottom, and between the room and the names.
const LEFT: f64 = 66.0;
const TOP: f64 = 56.0;
const BOTTOM: f64 = 58.0;
const GAP: f64 = 28.0;
const TITLE: f64 = 18.0;
const LABEL: f64 = 14.0;
const SMALL: f64 = 13.0;
/// From name to name, pixels.
const LINE: f64 = 19.0;
/// The longest name that is written out.
const LETTERS: usize = 44;
const GRID: &str = "#ececec";
const OUTLINE: &str = "#4d4d4d";
const GLOW: &str = "#e69f00";
const EYE: &str = "#0072b2";
/// Normals on both sides of an edge that is drawn have less than this cosine: 20 degrees.
const CREASE: f64 = 0.94;
/// Lines at the most, the longest first: a furnished room has 10 000, and more are a blot.
const MOST_LINES: usize = 20_000;
/// Length of an arrow, pixels.
const ARROW: f64 = 34.0;

/// The plan of a room.
pub fn svg(scene: &Scene, title: &str) -> String {
    let facts = Facts::of(scene);
    let [low, high] = facts.bounds_m.map(|p| [p[0], p[2]]);
    let eyes = camera::cameras(scene);
    // Cameras may stand outside.
    let places = eyes
        .iter()
        .map(|c| c.to_world.transform_point3(DVec3::ZERO));
    let reach = |k: usize| {
        let own = places.clone().map(move |p| [p.x, p.z][k]);
        let all = own.chain([low[k], high[k]]).filter(|x| x.is_finite());
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        })
    };
    let ((x0, x1), (z0, z1)) = (reach(0), reach(1));
    let least = 1e-6_f64.max(1e-3 * (x1 - x0).max(z1 - z0));
    let (width, depth) = ((x1 - x0).max(least), (z1 - z0).max(least));
    let scale = (ROOM[0] / width).min(ROOM[1] / depth);
    let (right, bottom) = (LEFT + scale * width, TOP + scale * depth);
    let x = Axis::new(Scale::Fitted, [x0, x0 + width].into_iter(), [LEFT, right]);
    let z = Axis::new(Scale::Fitted, [z0, z0 + depth].into_iter(), [TOP, bottom]);
    let at = |p: DVec3| [LEFT + scale * (p.x - x0), TOP + scale * (p.z - z0)];

    let names = names(
        &facts.lights,
        &eyes.iter().map(|e| e.name.clone()).collect::<Vec<_>>(),
    );
    let widest = names
        .iter()
        .map(|(_, name)| text_width(name, SMALL))
        .fold(140.0, f64::max);
    let height = (bottom + BOTTOM).max(TOP + LINE * (names.len() as f64 + 2.0));
    let mut svg = Svg::new(right + GAP + widest + 40.0, height);
    svg.bold([LEFT, 30.0], title, TITLE);
    grid(&mut svg, &x, &z, [LEFT, right], [TOP, bottom]);
    svg.lines(outlines(scene, &at).into_iter(), OUTLINE, 0.8);
    let numbered = lamps(&mut svg, scene, &at);
    for (number, spot) in numbered {
        svg.bold([spot[0] + 7.0, spot[1] - 5.0], &number.to_string(), SMALL);
    }
    for (k, eye) in eyes.iter().enumerate() {
        let place = eye.to_world.transform_point3(DVec3::ZERO);
        let ahead = eye.to_world.transform_vector3(DVec3::NEG_Z);
        let half = match eye.projection {
            Projection::Perspective(angle) => {
                0.5 * angle * eye.aspect.unwrap_or(4.0 / 3.0).clamp(0.5, 2.0)
            }
            Projection::Orthographic(_) => 0.0,
        };
        cone(&mut svg, at(place), ahead, half);
        svg.bold([at(place)[0] + 7.0, at(place)[1] - 7.0], &letter(k), SMALL);
    }
    for (row, (mark, name)) in names.iter().enumerate() {
        let y = TOP + LINE * (row as f64 + 0.5);
        svg.bold([right + GAP, y], mark, SMALL);
        svg.text([right + GAP + 26.0, y], name, SMALL, Anchor::Start);
    }
    svg.finish()
}

fn grid(svg: &mut Svg, x: &Axis, z: &Axis, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) {
    for tick in x.ticks() {
        let Some(at) = x.pixel(tick.value) else {
            continue;
        };
        svg.line([at, top], [at, bottom], GRID, 1.0);
        svg.text(
            [at, bottom + 20.0],
            &label(tick.value),
            SMALL,
            Anchor::Middle,
        );
    }
    for tick in z.ticks() {
        let Some(at) = z.pixel(tick.value) else {
            continue;
        };
        svg.line([left, at], [right, at], GRID, 1.0);
        svg.text(
            [left - 8.0, at + 4.5],
            &label(tick.value),
            SMALL,
            Anchor::End,
        );
    }
    svg.text(
        [0.5 * (left + right), bottom + 44.0],
        "x, m",
        LABEL,
        Anchor::Middle,
    );
    svg.upright([20.0, 0.5 * (top + bottom)], "z, m", LABEL);
}

/// Marks and names: lamps by number, cameras by letter.
fn names(lights: &[LightFact], eyes: &[String]) -> Vec<(String, String)> {
    let short = |text: String| match text.chars().count() > LETTERS {
        true => text.chars().take(LETTERS - 1).collect::<String>() + "…",
        false => text,
    };
    let lamp = |(k, light): (usize, &LightFact)| {
        let flux = light.flux_lm.map(|f| format!("{f:.0} lm"));
        let lux = light.illuminance_lx.map(|e| format!("{e:.0} lx"));
        let size = flux.or(lux).unwrap_or_default();
        let name = short(format!("{}: {}, {size}", light.name, light.kind));
        ((k + 1).to_string(), name)
    };
    let eye = |(k, name): (usize, &String)| {
        let name = if name.is_empty() { "camera" } else { name };
        (letter(k), short(name.to_owned()))
    };
    lights
        .iter()
        .enumerate()
        .map(lamp)
        .chain(eyes.iter().enumerate().map(eye))
        .collect()
}

/// A, B, ... Z, A1, B1, ...
fn letter(k: usize) -> String {
    let letter = char::from(b'A' + (k % 26) as u8);
    match k / 26 {
        0 => letter.to_string(),
        round => format!("{letter}{round}"),
    }
}

/// Edges where a surface ends or bends, from above, none twice.
fn outlines(scene: &Scene, at: &impl Fn(DVec3) -> [f64; 2]) -> Vec<[[f64; 2]; 2]> {
    let mut seen: BTreeSet<[[i64; 2]; 2]> = BTreeSet::new();
    for surface in &scene.surfaces {
        let key = |p: DVec3| p.to_array().map(f64::to_bits);
        let mut edges: BTreeMap<[[u64; 3]; 2], (DVec3, DVec3, DVec3, bool)> = BTreeMap::new();
        for triangle in &surface.triangles {
            let corners = triangle.map(|v| surface.positions[v as usize]);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for k in 0..3 {
                let (p, q) = (corners[k], corners[(k + 1) % 3]);
                let mut ends = [key(p), key(q)];
                ends.sort_unstable();
                edges
                    .entry(ends)
                    .and_modify(|edge| edge.3 = edge.2.dot(normal) < CREASE)
                    .or_insert((p, q, normal, true));
            }
        }
        for (p, q, _, drawn) in edges.into_values() {
            let mut ends = [at(p), at(q)].map(|p| p.map(|x| (10.0 * x).round() as i64));
            ends.sort_unstable();
            if drawn && ends[0] != ends[1] {
                seen.insert(ends);
            }
        }
    }
    let length = |[[x, y], [u, v]]: &[[i64; 2]; 2]| (u - x).pow(2) + (v - y).pow(2);
    let mut all: Vec<_> = seen.into_iter().collect();
    all.sort_by_key(|ends| (std::cmp::Reverse(length(ends)), *ends));
    all.truncate(MOST_LINES);
    all.into_iter()
        .map(|ends| ends.map(|p| p.map(|x| 0.1 * x as f64)))
        .collect()
}

/// Draws the lamps; where their numbers go. Numbers are those of the facts: materials that shine, then lights.
fn lamps(svg: &mut Svg, scene: &Scene, at: &impl Fn(DVec3) -> [f64; 2]) -> Vec<(usize, [f64; 2])> {
    let mut numbers = Vec::new();
    let mut number = 0;
    for (m, material) in scene.materials.iter().enumerate() {
        let parts = || scene.surfaces.iter().filter(move |s| s.material == m);
        if material.emission.is_none() || parts().all(|s| s.triangles.is_empty()) {
            continue;
        }
        number += 1;
        for surface in parts() {
            let corners = |t: &[u32; 3]| t.map(|v| at(surface.positions[v as usize]));
            svg.triangles(surface.triangles.iter().map(corners), GLOW);
            let used = surface.triangles.iter().flatten();
            let points = used.map(|&v| surface.positions[v as usize]);
            let (sum, count) = points.fold((DVec3::ZERO, 0.0), |(s, n), p| (s + p, n + 1.0));
            if count > 0.0 {
                svg.mark(at(sum / count), GLOW, 0);
                numbers.push((number, at(sum / count)));
            }
        }
    }
    for light in &scene.lights {
        // A surface that shines by a profile was drawn.
        if light.kind == LightKind::Surface {
            continue;
        }
        number += 1;
        // What is infinitely far away has no place; the list names it.
        if light.kind.is_dome() || light.kind == LightKind::Sun {
            continue;
        }
        let place = at(light.position);
        if !matches!(light.kind, LightKind::Point) {
            let way = light.direction * ARROW;
            svg.line(place, [place[0] + way.x, place[1] + way.z], GLOW, 2.5);
        }
        svg.mark(place, GLOW, 3);
        numbers.push((number, place));
    }
    numbers
}

/// A camera and the sides of what it sees.
fn cone(svg: &mut Svg, place: [f64; 2], ahead: DVec3, half: f64) {
    let way = ahead.z.atan2(ahead.x);
    let side = |angle: f64| {
        let (sin, cos) = (way + angle).sin_cos();
        [place, [place[0] + ARROW * cos, place[1] + ARROW * sin]]
    };
    svg.lines([side(-half), side(half)].into_iter(), EYE, 1.8);
    svg.mark(place, EYE, 0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Options;
    use std::path::Path;

    fn plan(room: &str) -> String {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        let scene = Scene::load(folder.join(room), &Options::default()).unwrap();
        svg(&scene, room)
    }

    #[test]
    fn lamps_and_cameras_are_named_and_sides_have_units() {
        let text = plan("cornell.glb");
        assert_eq!(text, plan("cornell.glb"));
        for part in ["x, m", "z, m", " lm<", ">1<", ">A<", GLOW, EYE] {
            assert!(text.contains(part), "{part}\n{text}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"));
    }

    #[test]
    fn rooms_without_depth_are_drawn() {
        for room in ["furnace.glb", "cie171-5.2.glb"] {
            assert!(!plan(room).contains("NaN"), "{room}");
        }
    }
}
