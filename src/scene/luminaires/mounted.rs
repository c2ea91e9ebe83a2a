//! A profile in its place: the way it looks, and the surface that it shines from, if there is one.
//!
//! A surface element dA with normal n sends `I(d) max(0, n.d) / P(d) dA` toward d, where `P(d) = sum max(0, n.d) dA` is what the
//! surface shows to that side: from far away it has the intensity of the profile, whatever its form. A flat panel's is
//! `I(d) / A`, without a pole at grazing angles. Directions to which the surface shows nothing get no light; what is left
//! is brought up so that the flux is the file's ([`Luminaire::reach`]).

use super::super::profile::Profile;
use super::super::{Sides, Surface};
use glam::{DMat3, DMat4, DVec3};
use std::sync::Arc;

/// Mean normals shorter than this (share of the area) are those of a closed body.
const ONE_WAY: f64 = 0.1;
/// A surface that shows less than this share of its area shows nothing.
const SHOWS: f64 = 1e-6;
/// Normals are sorted into so many squares along each axis: a sphere's projected area is then right within .3 %.
const BINS: f64 = 8.0;
/// Directions, squared, that tell how much of a profile's light leaves a surface: the share is right within .2 %.
const DIRECTIONS: usize = 64;

/// A profile, mounted.
#[derive(Debug, Clone)]
pub struct Luminaire {
    /// How its light is spread.
    pub profile: Arc<Profile>,
    /// Turned about nadir by so many degrees, from C0 toward C90.
    pub turn_deg: f64,
    /// From the space of the light (aim -Z, C0 +X, C90 +Y) to the world: orthogonal, perhaps mirrored.
    frame: DMat3,
    body: Option<Body>,
}

/// What shines.
#[derive(Debug, Clone)]
struct Body {
    /// Index in [`Scene::surfaces`](super::super::Scene::surfaces).
    surface: usize,
    /// Corners less the light's position; those of two-sided surfaces twice.
    triangles: Vec<[DVec3; 3]>,
    /// Sums of area times normal, of faces that look about the same way.
    facets: Vec<DVec3>,
    area: f64,
    /// Greatest distance of a corner from the light's position.
    radius: f64,
    reach: f64,
}

/// Axes of a light's space in the world, from its matrix; none where that has no direction.
pub(super) fn axes(to_world: &DMat4) -> Option<DMat3> {
    let axis = |v: DVec3| to_world.transform_vector3(v);
    let z = axis(DVec3::Z).try_normalize()?;
    let across = |v: DVec3| (v - z * v.dot(z)).try_normalize();
    let x = across(axis(DVec3::X)).or_else(|| across(z.any_orthonormal_vector()))?;
    let y = z.cross(x);
    let mirrored = y.dot(axis(DVec3::Y)) < 0.0;
    Some(DMat3::from_cols(x, if mirrored { -y } else { y }, z))
}

impl Luminaire {
    /// A profile on a light without extent; none where its node is scaled to nothing.
    pub(in crate::scene) fn at_node(
        profile: Arc<Profile>,
        to_world: &DMat4,
        turn_deg: f64,
    ) -> Option<Self> {
        Some(Self {
            profile,
            turn_deg,
            frame: axes(to_world)? * DMat3::from_rotation_z(turn_deg.to_radians()),
            body: None,
        })
    }

    /// A profile on a surface, and where the light stands: in the middle of it. None where it has no area, or shows nothing where
    /// the profile shines.
    pub(super) fn on_surface(
        profile: Arc<Profile>,
        (index, surface): (usize, &Surface),
        sides: Sides,
        turn_deg: f64,
    ) -> Option<(Self, DVec3)> {
        let corners = |t: &[u32; 3]| t.map(|v| surface.positions[v as usize]);
        let mut triangles: Vec<[DVec3; 3]> = surface.triangles.iter().map(corners).collect();
        let (mut area, mut middle, mut mean) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for t in &triangles {
            let normal = normal(t);
            area += normal.length();
            middle += normal.length() * (t[0] + t[1] + t[2]) / 3.0;
            mean += normal;
        }
        let middle = (middle / area).is_finite().then_some(middle / area)?;
        triangles.iter_mut().flatten().for_each(|p| *p -= middle);
        let frame = match mean.length() > ONE_WAY * area {
            true => facing(mean.normalize(), &surface.to_world)?,
            false => hanging(&surface.to_world)?,
        };
        if sides == Sides::Both {
            let backs: Vec<[DVec3; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
            triangles.extend(backs);
            area *= 2.0;
        }
        let corners = triangles.iter().flatten().map(|p| p.length());
        let radius = corners.fold(0.0, f64::max);
        let mut luminaire = Self {
            profile,
            turn_deg,
            frame: frame * DMat3::from_rotation_z(turn_deg.to_radians()),
            body: None,
        };
        let mut body = Body {
            surface: index,
            facets: facets(&triangles),
            triangles,
            area,
            radius,
            reach: 1.0,
        };
        body.reach = luminaire.reaching(&body);
        luminaire.body = Some(body);
        (luminaire.reach() > SHOWS).then_some((luminaire, middle))
    }

    /// Intensity toward a unit direction of the world over the flux, 1/sr.
    pub fn per_lumen(&self, direction: DVec3) -> f64 {
        self.profile.toward(self.frame.transpose() * direction) / self.profile.flux()
    }

    /// Nadir of the profile (its aim, for types A and B) in the world.
    pub fn nadir(&self) -> DVec3 {
        -self.frame.z_axis
    }

    /// Numbers that make its place and direction what they are, for fingerprints.
    pub fn numbers(&self) -> [f64; 9] {
        self.frame.to_cols_array()
    }

    /// The surface that it shines from, an index in [`Scene::surfaces`](super::super::Scene::surfaces).
    pub fn surface(&self) -> Option<usize> {
        self.body.as_ref().map(|body| body.surface)
    }

    /// Triangles that shine, corners less the light's position; empty for a light without extent.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        self.body.as_ref().map_or(&[], |body| &body.triangles)
    }

    /// Greatest distance of what shines from the light's position, m.
    pub fn radius(&self) -> f64 {
        self.body.as_ref().map_or(0.0, |body| body.radius)
    }

    /// Extent of what shines along C0 and along C90, m.
    pub fn extent(&self) -> [f64; 2] {
        [self.frame.x_axis, self.frame.y_axis].map(|axis| {
            let along = self.triangles().iter().flatten().map(|p| p.dot(axis));
            2.0 * along.fold(0.0, |most, x| x.abs().max(most))
        })
    }

    /// Area that shines, m2.
    pub fn area(&self) -> f64 {
        self.body.as_ref().map_or(0.0, |body| body.area)
    }

    /// Share of the profile's flux that goes where the surface shows anything.
    pub fn reach(&self) -> f64 {
        self.body.as_ref().map_or(1.0, |body| body.reach)
    }

    /// What an element of the surface with a unit normal sends toward a unit direction: intensity over flux and area, 1/(sr m2).
    pub fn per_area(&self, direction: DVec3, normal: DVec3) -> f64 {
        let Some(body) = &self.body else { return 0.0 };
        let cosine = normal.dot(direction);
        if cosine <= 0.0 {
            return 0.0;
        }
        let shown = shown(&body.facets, direction);
        // An element shows at least itself; a bin's mean may show less.
        if shown <= SHOWS * body.area {
            return 0.0;
        }
        self.per_lumen(direction) / body.reach * cosine / shown
    }

    /// A ray of its light: start less the light's position, unit direction, and its weight, 1 in the mean.
    pub fn ray(&self, u: [f64; 2], v: [f64; 2]) -> Option<(DVec3, DVec3, f64)> {
        let (d, weight) = self.profile.direction(u)?;
        let direction = self.frame * d;
        let Some(body) = &self.body else {
            return Some((DVec3::ZERO, direction, weight));
        };
        let shows = |t: &[DVec3; 3]| normal(t).dot(direction).max(0.0);
        let all: f64 = body.triangles.iter().map(shows).sum();
        if all <= SHOWS * body.area {
            return Some((DVec3::ZERO, direction, 0.0));
        }
        let mut left = v[0] * all;
        let mut chosen = None;
        for t in body.triangles.iter().filter(|t| shows(t) > 0.0) {
            chosen = Some((t, (left / shows(t)).clamp(0.0, 1.0)));
            if left < shows(t) {
                break;
            }
            left -= shows(t);
        }
        let ([a, b, c], share) = chosen?;
        // Even over the triangle.
        let root = share.sqrt();
        let start = *a * (1.0 - root) + *b * (root * (1.0 - v[1])) + *c * (root * v[1]);
        Some((start, direction, weight / body.reach))
    }

    fn reaching(&self, body: &Body) -> f64 {
        let (mut all, mut reaches) = (0.0, 0.0);
        for k in 0..DIRECTIONS * DIRECTIONS {
            let at = |k: usize| (k as f64 + 0.5) / DIRECTIONS as f64;
            // The first number is finer: it runs over all cells of the table.
            let u = (k as f64 + 0.5) / (DIRECTIONS * DIRECTIONS) as f64;
            let Some((d, weight)) = self.profile.direction([u, at(k * 37 % DIRECTIONS)]) else {
                continue;
            };
            all += weight;
            if shown(&body.facets, self.frame * d) > SHOWS * body.area {
                reaches += weight;
            }
        }
        if all > 0.0 { reaches / all } else { 0.0 }
    }
}

/// Share of its light that a lamp has left, hung as it is.
pub(in crate::scene) fn tilt_share(luminaire: &Luminaire) -> f64 {
    let cosine = luminaire.nadir().dot(DVec3::NEG_Y).clamp(-1.0, 1.0);
    luminaire.profile.at_tilt(cosine.acos().to_degrees())
}

/// Area times normal.
fn normal(&[a, b, c]: &[DVec3; 3]) -> DVec3 {
    0.5 * (b - a).cross(c - a)
}

fn shown(facets: &[DVec3], direction: DVec3) -> f64 {
    facets.iter().map(|f| f.dot(direction).max(0.0)).sum()
}

/// Axes of a panel that looks along `nadir`.
fn facing(nadir: DVec3, to_world: &DMat4) -> Option<DMat3> {
    let across = |v: DVec3| {
        let v = to_world.transform_vector3(v).try_normalize()?;
        let across = v - nadir * v.dot(nadir);
        (across.length() > 1e-3).then(|| across.normalize())
    };
    let x = across(DVec3::X).or_else(|| across(DVec3::Z))?;
    Some(DMat3::from_cols(x, x.cross(nadir), -nadir))
}

/// Axes of a body that hangs: nadir along its node's -Y.
fn hanging(to_world: &DMat4) -> Option<DMat3> {
    let down = to_world.transform_vector3(DVec3::NEG_Y).try_normalize()?;
    facing(down, to_world)
}

/// Faces that look the same way, or about so, as one.
fn facets(triangles: &[[DVec3; 3]]) -> Vec<DVec3> {
    let mut bins = std::collections::BTreeMap::<[i64; 3], DVec3>::new();
    for t in triangles {
        let n = normal(t);
        if let Some(unit) = n.try_normalize() {
            let bin = (BINS * unit).round().to_array().map(|x| x as i64);
            *bins.entry(bin).or_default() += n;
        }
    }
    bins.into_values().collect()
}
