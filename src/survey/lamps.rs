//! Do all lamps shine away from the room? A common fault of exports: faces whose corners run the wrong way round.
//!
//! Rays from each lamp tell. A lamp lights the room if one of them meets a front that is not a lamp's own. If no lamp
//! does, a lamp's surface is reversed if rays from its *backs* meet other things; if those are mostly backs, all faces
//! of the room are reversed, and not the lamps alone. Rooms where everything glows (a furnace, a scan whose picture is
//! its emission) light themselves.
//!
//! Sky, sun and parallel light come from outside: rays from fronts find the way to them, also through an opening that hardly any ray
//! from outside would meet. Where no ray leaves the room it is closed to them, whichever way its faces look.

use super::eyes::{Eyes, SurveyHit};
use super::openings::Fronts;
use crate::error::Problem;
use crate::geometry::sampling::{
    Pcg, around, cosine_direction, hash, on_triangle, sequence02, sphere_direction, tangents,
};
use crate::scene::{LightKind, PunctualLight, Scene, Sides, listed, short};
use glam::DVec3;
use std::f64::consts::TAU;

/// Rays of a lamp: a few for the first look, which most rooms pass with their first lamp, and many before a room is
/// refused. A lamp deep in a housing shows through an opening that one ray in a thousand finds.
const RAYS: [u32; 2] = [64, 8192];
/// Rays from fronts for each of these: with as many as the bake looks for openings with (`transport/openings.rs`) it finds those that are
/// found here.
const FROM_FRONTS: u32 = 64;

/// No lamp lights the room.
#[derive(Debug)]
pub(super) struct Away {
    /// Surfaces of lamps that look reversed.
    lamps: Vec<usize>,
    /// Lights without extent.
    lights: Vec<usize>,
    /// Lights that the room is closed to.
    shut_out: Vec<usize>,
    /// Is the whole room reversed?
    room: bool,
    /// Surfaces to turn.
    pub(super) turned: Vec<usize>,
}

/// What rays met.
#[derive(Debug, Default, Clone, Copy)]
struct RayCounts {
    /// Fronts of what is no lamp.
    things: usize,
    /// Fronts of other lamps.
    lamps: usize,
    /// Black backs of others.
    backs: usize,
    /// The lamp's own sides that take part.
    own: usize,
}

impl RayCounts {
    fn add(&mut self, scene: &Scene, lamp: Option<usize>, met: SurveyHit) {
        match met {
            SurveyHit::Front(s) | SurveyHit::Behind(s) if Some(s) == lamp => self.own += 1,
            SurveyHit::Front(s) | SurveyHit::Behind(s) if emits(scene, s) => self.lamps += 1,
            SurveyHit::Front(_) | SurveyHit::Behind(_) => self.things += 1,
            SurveyHit::Back(s) if Some(s) != lamp => self.backs += 1,
            SurveyHit::Back(_) | SurveyHit::Nothing => {}
        }
    }
}

fn emits(scene: &Scene, surface: usize) -> bool {
    scene.materials[scene.surfaces[surface].material]
        .emission
        .is_some()
}

/// None if some lamp lights the room, or there is nothing that it could light.
pub(super) fn away(eyes: &Eyes) -> Option<Away> {
    if (0..eyes.scene.surfaces.len()).all(|s| emits(eyes.scene, s)) {
        return None;
    }
    let [few, many] = RAYS;
    look(eyes, few).and_then(|_| look(eyes, many))
}

fn look(eyes: &Eyes, rays: u32) -> Option<Away> {
    let scene = eyes.scene;
    let mut found = Away {
        lamps: Vec::new(),
        lights: Vec::new(),
        shut_out: Vec::new(),
        room: false,
        turned: Vec::new(),
    };
    let (mut fronts, mut backs) = (0, 0);
    let outside = scene.lights.iter().filter(|l| is_outside(l));
    let (is_open, is_lit) = reached(eyes, &outside.collect::<Vec<_>>(), rays);
    if is_lit {
        return None;
    }
    for (k, light) in scene.lights.iter().enumerate() {
        // What shines from a surface is looked at with the surfaces.
        if light.kind == LightKind::Surface {
            continue;
        }
        if is_outside(light) && !is_open {
            found.shut_out.push(k);
            continue;
        }
        let seen = of_light(eyes, light, rays);
        if seen.things + seen.lamps > 0 {
            return None;
        }
        backs += seen.backs;
        found.lights.push(k);
    }
    for surface in (0..scene.surfaces.len()).filter(|&s| emits(scene, s)) {
        let ahead = of_surface(eyes, surface, Facing::Ahead, rays);
        if ahead.things > 0 {
            return None;
        }
        let behind = of_surface(eyes, surface, Facing::Behind, rays);
        let one_sided = scene.sides(surface) == Sides::Front;
        if !one_sided && behind.things > 0 {
            return None;
        }
        // A shell that glows within, all around, with nothing outside: a furnace.
        if ahead.lamps + ahead.own > 0 && behind.things + behind.backs == 0 {
            return None;
        }
        if one_sided && behind.things + behind.backs > 0 {
            fronts += behind.things;
            backs += behind.backs;
            found.lamps.push(surface);
        }
    }
    if found.lamps.is_empty() && found.lights.is_empty() && found.shut_out.is_empty() {
        return None;
    }
    found.room = backs > fronts;
    found.turned = if found.room {
        (0..scene.surfaces.len()).collect()
    } else {
        found.lamps.clone()
    };
    Some(found)
}

/// Does a light shine from outside, wherever the room ends?
fn is_outside(light: &PunctualLight) -> bool {
    light.kind.is_dome() || light.kind.is_parallel()
}

/// Does a ray from a front leave the room, and does one get to what shines outside?
fn reached(eyes: &Eyes, outside: &[&PunctualLight], rays: u32) -> (bool, bool) {
    if outside.is_empty() {
        return (false, false);
    }
    let fronts = Fronts::new(eyes);
    let mut is_open = false;
    let is_lit = fronts.rays((rays * FROM_FRONTS) as usize).any(|ray| {
        let away = fronts.leaves(&ray, ray.direction);
        is_open |= away;
        outside.iter().any(|light| match light.kind.is_dome() {
            true => away && ray.direction.dot(light.direction) < 0.0,
            false => {
                let toward = -light.direction;
                ray.normal.dot(toward) > 0.0 && fronts.leaves(&ray, toward)
            }
        })
    });
    (is_open, is_lit)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Facing {
    Ahead,
    Behind,
}

/// What a surface's faces shine on, or would if they were turned.
fn of_surface(eyes: &Eyes, surface: usize, facing: Facing, rays: u32) -> RayCounts {
    let mesh = &eyes.mesh;
    let range = mesh.first_triangle[surface] as usize..mesh.first_triangle[surface + 1] as usize;
    let total: f64 = mesh.area[range.clone()].iter().sum();
    let mut seen = RayCounts::default();
    let shift = hash(surface as u64, u64::from(facing == Facing::Behind));
    let (mut triangle, mut passed) = (range.start, 0.0);
    for k in 0..rays {
        // Rays in steps of area, so that every part of the lamp has its share.
        let target = total * (f64::from(k) + 0.5) / f64::from(rays);
        while passed + mesh.area[triangle] < target && triangle + 1 < range.end {
            passed += mesh.area[triangle];
            triangle += 1;
        }
        let corners = mesh.triangles[triangle].map(|v| mesh.positions[v as usize] + mesh.centre);
        let from = on_triangle(&corners, sequence02(k, shift));
        let normal = match facing {
            Facing::Ahead => mesh.normal[triangle],
            Facing::Behind => -mesh.normal[triangle],
        };
        let direction = cosine_direction(normal, sequence02(k, hash(shift, 1)));
        let met = eyes.look(from, direction, mesh.plane[triangle]);
        seen.add(eyes.scene, Some(surface), met);
    }
    seen
}

/// What a light without extent shines on.
fn of_light(eyes: &Eyes, light: &PunctualLight, rays: u32) -> RayCounts {
    let mut seen = RayCounts::default();
    for k in 0..rays {
        let (from, direction, _) = ray_of(eyes, light, k);
        seen.add(eyes.scene, None, eyes.look_around(from, direction));
    }
    seen
}

/// A ray of a light that is no surface of a file: where it starts, its direction, and how much of the light goes along it, in any unit.
pub(super) fn ray_of(eyes: &Eyes, light: &PunctualLight, k: u32) -> (DVec3, DVec3, f64) {
    let [x, y] = sequence02(k, 0);
    match light.kind {
        LightKind::Point => (light.position, sphere_direction([x, y]), 1.0),
        LightKind::Spot { outer, .. } => {
            // Evenly over the cone.
            let cosine = 1.0 - y * (1.0 - outer.cos());
            let way = around(light.direction, cosine, x);
            (light.position, way, light.kind.fall_off(cosine))
        }
        LightKind::Profile | LightKind::Surface => {
            // Two shifts of one sequence depend on each other.
            let mut random = Pcg::new(hash(2, u64::from(k)));
            let way = light.luminaire.as_ref();
            let ray = way.and_then(|l| l.ray([x, y], [random.f64(), random.f64()]));
            let (from, direction, weight) = ray.unwrap_or((DVec3::ZERO, light.direction, 0.0));
            (light.position + from, direction, weight)
        }
        LightKind::Directional | LightKind::Sun | LightKind::Sky(_) | LightKind::Ground(_) => {
            let from = if light.kind.is_dome() {
                // Two shifts of one sequence depend on each other.
                let mut random = Pcg::new(hash(1, u64::from(k)));
                cosine_direction(-light.direction, [random.f64(), random.f64()])
            } else {
                -light.direction
            };
            let away = -from;
            // From outside, on a disc that covers the room.
            let (size, [u, v]) = (eyes.mesh.half_size, tangents(away));
            let (radius, angle) = (size * y.sqrt(), TAU * x);
            let across = radius * (angle.cos() * u + angle.sin() * v);
            let from = eyes.mesh.centre - 1.1 * size * away + across;
            (from, away, 1.0)
        }
    }
}

impl Away {
    /// The problem in words.
    pub(super) fn problem(&self, scene: &Scene) -> Problem {
        let mut what = Vec::new();
        if !self.lamps.is_empty() {
            what.push(format!("faces look reversed: {}", self.named(scene)));
        }
        let named = |lights: &[usize]| {
            let name = |&k: &usize| {
                let light = &scene.lights[k];
                format!("{} light '{}'", kind(light), short(&light.name))
            };
            listed(&lights.iter().map(name).collect::<Vec<_>>())
        };
        if !self.lights.is_empty() {
            let names = named(&self.lights);
            what.push(format!("no front of a surface is met by {names}"));
        }
        if !self.shut_out.is_empty() {
            what.push(format!(
                "no front of a surface is reached by {}: the room is closed, no ray leaves it",
                named(&self.shut_out)
            ));
        }
        if self.room {
            what.push("the room's surfaces are seen from behind, their faces look reversed".into());
        }
        let all_outside = self.lights.iter().all(|&k| is_outside(&scene.lights[k]));
        let next = match (self.turned.is_empty(), self.room) {
            (true, _) if !self.shut_out.is_empty() => {
                "give it an opening, or a pane where there is glass, or a lamp inside"
            }
            (true, _) if scene.sky.is_some() && all_outside => {
                "let the sun stand where it shines in, or give the sky light"
            }
            (true, _) => {
                "turn the lights' nodes (they shine along their -Z), or move them into the room"
            }
            (false, false) => {
                "turn the faces in the modelling program (Blender: Mesh > Normals > Flip), or give --flip"
            }
            (false, true) => {
                "recalculate the normals in the modelling program, or give --flip, which turns all faces"
            }
        };
        let head = match self.lamps.is_empty() && self.lights.is_empty() {
            true => "no lamp lights the room",
            false => "all lamps shine away from the room",
        };
        Problem::new(
            scene.source.place(),
            format!("{head}: {}", what.join("; ")),
            format!("{next}; --allow-dark bakes it as it is"),
        )
    }

    /// What was turned, in words.
    pub(super) fn turning(&self, scene: &Scene) -> String {
        if self.room {
            return format!(
                "--flip: the faces of all {} surfaces are turned",
                self.turned.len()
            );
        }
        format!("--flip: turned {}", self.named(scene))
    }

    /// Node, mesh and material of the lamps.
    fn named(&self, scene: &Scene) -> String {
        let name = |&s: &usize| {
            let surface = &scene.surfaces[s];
            let material = &scene.materials[surface.material].name;
            format!("{}, material '{}'", surface.name, short(material))
        };
        listed(&self.lamps.iter().map(name).collect::<Vec<_>>())
    }
}

fn kind(light: &PunctualLight) -> &'static str {
    match light.kind {
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Directional => "directional",
        LightKind::Profile => "measured",
        LightKind::Surface => "surface",
        LightKind::Sun => "sun",
        LightKind::Sky(_) => "sky",
        LightKind::Ground(_) => "ground",
    }
}
