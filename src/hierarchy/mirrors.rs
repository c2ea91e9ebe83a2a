//! Where mirrors are, and in which sequences of them things have images.
//!
//! All triangles of a material that lie in one plane and face the same way are one plane mirror. What a point sees by way of plane
//! mirrors `m1, m2, ..` it would see straight from its mirror image `.. R2 R1 p`, `Ri` being the reflection in `mi`, with the mirrors as
//! windows. So lamps are gathered from the image, with the factors that they have for any other point. Which mirrors may follow one
//! another is found once; a [`MirrorImage`] is such a sequence.
//!
//! Surfaces of many small planes are curved mirrors: rays find the light in them, and things have no images there.

use super::{Mesh, NONE};
use crate::geometry::Hit;
use crate::scene::{Scene, Sides};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Mirrors that light meets in sequence; the next is taken for a matt surface.
pub const BOUNCES: usize = 4;
/// Least share of the mirroring area of a surface that makes a plane a mirror of its own: beyond 16 sides a prism
/// counts as a tube.
const PLANE_SHARE: f64 = 1.0 / 16.0;
/// Plane mirrors at the most, the largest.
const PLANES: usize = 32;
/// Images at the most, those of few mirrors first: a box of six mirrors has 156 of up to three.
const IMAGES: usize = 256;
/// In [`Mirrors::of`]: a mirror in which things have no image.
const CURVED: u32 = NONE - 1;
/// A point nearer than this to a plane, share of the room's half size, lies in the plane: ten roundings of f32.
const IN_PLANE: f64 = 1e-6;

/// Mirrors in the order in which a ray from a point meets them; the rest [`NONE`].
type Sequence = [u32; BOUNCES];

/// A plane mirror, or its own image in other mirrors.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: DVec3,
    /// `normal . x = offset` on the plane.
    offset: f64,
    /// Centre and radius of a sphere that contains the mirror.
    centre: DVec3,
    radius: f64,
    material: u32,
}

impl Plane {
    fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }

    fn reflected(&self, p: DVec3) -> DVec3 {
        p - 2.0 * self.height(p) * self.normal
    }

    /// The image of this plane in a mirror.
    fn seen_in(&self, mirror: &Self) -> Self {
        let normal = self.normal - 2.0 * self.normal.dot(mirror.normal) * mirror.normal;
        let on = mirror.reflected(self.offset * self.normal);
        Self {
            normal,
            offset: normal.dot(on),
            centre: mirror.reflected(self.centre),
            ..*self
        }
    }
}

/// A sequence of plane mirrors in which something may be seen.
#[derive(Debug, Clone)]
pub struct MirrorImage {
    planes: Sequence,
    /// Takes a receiving point to its mirror image.
    turn: DMat3,
    shift: DVec3,
    /// The mirrors as windows, as seen from the point's mirror image.
    windows: Vec<Plane>,
}

impl MirrorImage {
    /// The image in no mirrors, to be continued.
    fn straight() -> Self {
        Self {
            planes: [NONE; BOUNCES],
            turn: DMat3::IDENTITY,
            shift: DVec3::ZERO,
            windows: Vec::new(),
        }
    }

    /// The mirror image from which a point receives as if there were no mirrors.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.shift
    }

    /// [`Self::point`] for a direction.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.turn * d
    }

    /// Number of mirrors.
    pub fn depth(&self) -> usize {
        self.windows.len()
    }

    /// Where a place appears to be for one who looks into the mirrors.
    fn appears(&self, p: DVec3) -> DVec3 {
        self.turn.transpose() * (p - self.shift)
    }

    /// Could a point with a normal see anything this way? It must lie before all windows, these must be above its horizon, and
    /// any two of them in one line of sight.
    fn is_open_to(&self, point: DVec3, normal: DVec3, least: f64) -> bool {
        let mut cones = [Cone::default(); BOUNCES];
        for (k, window) in self.windows.iter().enumerate() {
            let way = window.centre - point;
            if window.height(point) <= least || normal.dot(way) + window.radius <= 0.0 {
                return false;
            }
            cones[k] = Cone::new(point, window.centre, window.radius);
            if cones[..k].iter().any(|cone| cone.is_apart(&cones[k])) {
                return false;
            }
        }
        true
    }
}

/// The directions from a point to a sphere.
#[derive(Debug, Clone, Copy, Default)]
struct Cone {
    axis: DVec3,
    half: f64,
}

impl Cone {
    fn new(point: DVec3, centre: DVec3, radius: f64) -> Self {
        let way = centre - point;
        let distance = way.length().max(f64::MIN_POSITIVE);
        Self {
            axis: way / distance,
            half: (radius / distance).min(1.0).asin(),
        }
    }

    /// Have two cones no direction in common?
    fn is_apart(&self, other: &Self) -> bool {
        let both = self.half + other.half;
        both < std::f64::consts::PI && self.axis.dot(other.axis) < both.cos()
    }
}

/// The path of light by mirrors.
#[derive(Debug, Clone, Copy)]
pub struct Route {
    points: [DVec3; BOUNCES + 2],
    bounces: [(u32, f32); BOUNCES],
    count: usize,
}

impl Route {
    /// Begins at a point.
    pub(crate) fn new(start: DVec3) -> Self {
        Self {
            points: [start; BOUNCES + 2],
            bounces: [(NONE, 0.0); BOUNCES],
            count: 0,
        }
    }

    /// Adds a mirror of a material, met at a place under a cosine.
    pub(crate) fn bounce(&mut self, at: DVec3, material: u32, cosine: f64) {
        self.bounces[self.count] = (material, cosine as f32);
        self.count += 1;
        self.points[self.count] = at;
    }

    /// Ends at a point.
    pub(crate) fn end(&mut self, at: DVec3) {
        self.points[self.count + 1] = at;
    }

    /// Can the path meet another mirror?
    pub(crate) fn goes_on(&self) -> bool {
        self.count < BOUNCES
    }

    /// Material of each mirror on the path, and the cosine of incidence.
    pub fn bounces(&self) -> &[(u32, f32)] {
        &self.bounces[..self.count]
    }

    /// Start of the path, its points on mirrors, and its end.
    pub fn points(&self) -> &[DVec3] {
        &self.points[..self.count + 2]
    }
}

/// All mirrors of a room.
#[derive(Debug, Clone)]
pub struct Mirrors {
    /// By triangle, for its front and its back: number of the plane, [`CURVED`], or [`NONE`] where it is no mirror.
    of: Vec<[u32; 2]>,
    planes: Vec<Plane>,
    images: Vec<MirrorImage>,
    numbers: BTreeMap<Sequence, u32>,
    left_out: usize,
    curved: bool,
    least: f64,
}

/// A plane mirror being assembled.
#[derive(Default)]
struct Part {
    area: f64,
    /// Its greatest share in the mirroring area of a surface.
    share: f64,
    sides: Vec<(usize, usize)>,
}

impl Mirrors {
    /// The mirrors of a scene; none where there are none.
    pub fn new(scene: &Scene, mesh: &Mesh) -> Option<Self> {
        let is_mirror = |m: &u32| scene.materials[*m as usize].mirror.is_some();
        if !mesh.material.iter().any(is_mirror) {
            return None;
        }
        let mut mirrors = Self {
            of: vec![[NONE; 2]; mesh.triangles.len()],
            planes: Vec::new(),
            images: Vec::new(),
            numbers: BTreeMap::new(),
            left_out: 0,
            curved: false,
            least: IN_PLANE * mesh.half_size,
        };
        let mut parts: BTreeMap<(u32, u32, bool), Part> = BTreeMap::new();
        let mut surfaces: BTreeMap<u32, f64> = BTreeMap::new();
        let all = || (0..mesh.triangles.len()).filter(|&t| is_mirror(&mesh.material[t]));
        let mut within: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        let mut towards: BTreeMap<u32, DVec3> = BTreeMap::new();
        for t in all() {
            *surfaces.entry(mesh.origin[t].0).or_default() += mesh.area[t];
            *within.entry((mesh.origin[t].0, mesh.plane[t])).or_default() += mesh.area[t];
            towards.entry(mesh.plane[t]).or_insert(mesh.normal[t]);
        }
        for t in all() {
            let both = scene.sides(mesh.origin[t].0 as usize) == Sides::Both;
            let surface = mesh.origin[t].0;
            let share = within[&(surface, mesh.plane[t])] / surfaces[&surface];
            for side in 0..1 + usize::from(both) {
                mirrors.of[t][side] = CURVED;
                let normal = mesh.normal[t] * [1.0, -1.0][side];
                let along = normal.dot(towards[&mesh.plane[t]]) > 0.0;
                let key = (mesh.material[t], mesh.plane[t], along);
                let part = parts.entry(key).or_default();
                part.area += mesh.area[t];
                part.share = part.share.max(share);
                part.sides.push((t, side));
            }
        }
        mirrors.find_planes(mesh, parts.into_values().collect());
        mirrors.find_images(mesh);
        Some(mirrors)
    }

    /// Keeps the largest planes.
    fn find_planes(&mut self, mesh: &Mesh, mut parts: Vec<Part>) {
        let all = parts.len();
        parts.retain(|part| part.share >= PLANE_SHARE && part.area > 0.0);
        parts.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.sides.cmp(&b.sides)));
        parts.truncate(PLANES);
        self.curved = parts.len() < all;
        for part in parts {
            let corners = || {
                let triangles = part.sides.iter().map(|&(t, _)| mesh.triangles[t]);
                triangles.flatten().map(|v| mesh.positions[v as usize])
            };
            let turned =
                |&(t, side): &(usize, usize)| mesh.area[t] * mesh.normal[t] * [1.0, -1.0][side];
            let normal = part
                .sides
                .iter()
                .map(turned)
                .sum::<DVec3>()
                .normalize_or_zero();
            let low = corners().fold(DVec3::INFINITY, DVec3::min);
            let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
            let centre = 0.5 * (low + high);
            let radius = corners().map(|p| p.distance(centre)).fold(0.0, f64::max);
            let heights = corners().map(|p| normal.dot(p));
            let offset = heights.sum::<f64>() / corners().count().max(1) as f64;
            for &(t, side) in &part.sides {
                self.of[t][side] = self.planes.len() as u32;
            }
            self.planes.push(Plane {
                normal,
                offset,
                centre,
                radius,
                material: mesh.material[part.sides[0].0],
            });
        }
    }

    /// Finds which mirrors may follow one another.
    fn find_images(&mut self, mesh: &Mesh) {
        let mut corners = vec![Vec::new(); self.planes.len()];
        for (t, sides) in self.of.iter().enumerate() {
            for &k in sides {
                if let Some(corners) = corners.get_mut(k as usize) {
                    corners.extend(mesh.triangles[t].map(|v| mesh.positions[v as usize]));
                }
            }
        }
        let sees = |a: usize, b: usize| {
            let before = |p: &DVec3| self.planes[a].height(*p) > self.least;
            corners[b].iter().any(before)
        };
        let count = self.planes.len();
        let meet: Vec<Vec<bool>> = (0..count)
            .map(|a| {
                (0..count)
                    .map(|b| a != b && sees(a, b) && sees(b, a))
                    .collect()
            })
            .collect();
        let mut images: Vec<MirrorImage> = Vec::new();
        let start = MirrorImage::straight();
        let mut level = vec![start];
        for depth in 0..BOUNCES {
            let mut next = Vec::new();
            for image in &level {
                let after = |k: &usize| {
                    let last = depth.checked_sub(1).map(|last| image.planes[last] as usize);
                    last.is_none_or(|last| meet[last][*k])
                };
                let more = (0..count).filter(after);
                next.extend(more.filter_map(|k| self.followed(image, k as u32)));
            }
            let room = IMAGES - images.len();
            self.left_out += next.len().saturating_sub(room);
            next.truncate(room);
            images.extend(next.iter().cloned());
            level = next;
        }
        let numbers = images.iter().zip(0..).map(|(image, k)| (image.planes, k));
        self.numbers = numbers.collect();
        self.images = images;
    }

    /// A sequence with one more mirror, if light can go that way.
    fn followed(&self, image: &MirrorImage, k: u32) -> Option<MirrorImage> {
        let mirror = &self.planes[k as usize];
        let depth = image.depth();
        let earlier = image.planes[..depth].iter().rev();
        let window = earlier.fold(*mirror, |seen, &k| seen.seen_in(&self.planes[k as usize]));
        // The new mirror must lie behind all windows before it.
        let behind = |w: &Plane| w.height(window.centre) - window.radius < -self.least;
        if !image.windows.iter().all(behind) {
            return None;
        }
        let mut planes = image.planes;
        planes[depth] = k;
        let mut windows = image.windows.clone();
        windows.push(window);
        let n = mirror.normal;
        let across = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        let turn = DMat3::IDENTITY - 2.0 * across;
        Some(MirrorImage {
            planes,
            turn: turn * image.turn,
            shift: turn * image.shift + 2.0 * mirror.offset * n,
            windows,
        })
    }

    /// Does a ray meet a mirror there?
    pub fn is_mirror(&self, hit: &Hit) -> bool {
        self.side(hit) != NONE
    }

    /// Does a ray meet a mirror in which things have no image?
    pub fn is_curved(&self, hit: &Hit) -> bool {
        self.side(hit) == CURVED
    }

    /// Are there any such mirrors?
    pub fn has_curved(&self) -> bool {
        self.curved
    }

    /// Number of the plane that a ray met; [`CURVED`] or [`NONE`] for others.
    fn side(&self, hit: &Hit) -> u32 {
        self.of[hit.triangle as usize][usize::from(hit.from_behind)]
    }

    /// Is a triangle a mirror, from its front or its back?
    pub fn is_side(&self, triangle: u32, back: bool) -> bool {
        self.of[triangle as usize][usize::from(back)] != NONE
    }

    /// All images in which something may be seen.
    pub fn images(&self) -> &[MirrorImage] {
        &self.images
    }

    /// Number of the image in the mirrors that were met, in order; none if things have no image there.
    pub fn image_of(&self, met: &[Hit]) -> Option<u32> {
        let mut planes = [NONE; BOUNCES];
        for (plane, hit) in planes.iter_mut().zip(met) {
            *plane = self.side(hit);
        }
        self.numbers.get(&planes).copied()
    }

    /// Numbers of the images in which a point with a normal may see something.
    pub fn seen_from(&self, point: DVec3, normal: DVec3) -> impl Iterator<Item = u32> {
        let open = move |image: &MirrorImage| image.is_open_to(point, normal, self.least);
        let images = (0..).zip(&self.images);
        images.filter(move |(_, image)| open(image)).map(|(k, _)| k)
    }

    /// Could any part of a sphere be seen from a point by an image's mirrors?
    pub fn may_show(&self, image: u32, from: DVec3, (centre, radius): (DVec3, f64)) -> bool {
        let image = &self.images[image as usize];
        let ball = Cone::new(from, image.appears(centre), radius);
        let cone = |window: &Plane| Cone::new(from, window.centre, window.radius);
        let mut windows = image.windows.iter().map(cone);
        windows.all(|window| !window.is_apart(&ball))
    }

    /// The path from a point by an image's mirrors to a place, ignoring blockers; none where it misses a mirror.
    pub fn route(&self, image: u32, from: DVec3, to: DVec3) -> Option<Route> {
        let image = &self.images[image as usize];
        let plane = |k: usize| &self.planes[image.planes[k] as usize];
        // Where the place appears to be, mirror by mirror from the last.
        let mut aims = [to; BOUNCES + 1];
        for k in (0..image.depth()).rev() {
            aims[k] = plane(k).reflected(aims[k + 1]);
        }
        let mut route = Route::new(from);
        let mut at = from;
        for (k, aim) in aims.into_iter().take(image.depth()).enumerate() {
            let plane = plane(k);
            let (here, there) = (plane.height(at), plane.height(aim));
            if here <= 0.0 || there >= 0.0 {
                return None;
            }
            let way = aim - at;
            at += way * (here / (here - there));
            if at.distance_squared(plane.centre) > plane.radius * plane.radius {
                return None;
            }
            route.bounce(at, plane.material, -plane.normal.dot(way) / way.length());
        }
        route.end(to);
        Some(route)
    }

    /// Is this the `k`-th mirror of an image?
    pub fn is_next(&self, image: u32, k: usize, hit: &Hit) -> bool {
        self.images[image as usize].planes[k] == self.side(hit)
    }

    /// The numbers of planes and images, in words.
    pub fn said(&self) -> String {
        let (planes, images) = (self.planes.len(), self.images.len());
        let mut said = format!("{planes} plane mirrors, {images} images");
        if self.curved {
            said +=
                "; in curved ones rays alone find lamps, and lights without extent are not found";
        }
        if self.left_out > 0 {
            let more = self.left_out;
            said += &format!("; {more} further images and those behind them are left to rays");
        }
        said
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At x = 0 and x = 2, facing each other.
    fn parallel() -> Mirrors {
        let plane = |x: f64, way: f64| Plane {
            normal: way * DVec3::X,
            offset: way * x,
            centre: x * DVec3::X,
            radius: 1.0,
            material: 7,
        };
        Mirrors {
            of: Vec::new(),
            planes: vec![plane(0.0, 1.0), plane(2.0, -1.0)],
            images: Vec::new(),
            numbers: BTreeMap::new(),
            left_out: 0,
            curved: false,
            least: 1e-9,
        }
    }

    #[test]
    fn images_between_parallel_mirrors_stand_in_a_row() {
        let mut mirrors = parallel();
        let start = MirrorImage::straight();
        let once = mirrors.followed(&start, 0).unwrap();
        let twice = mirrors.followed(&once, 1).unwrap();
        let (eye, place) = (0.5 * DVec3::X, DVec3::new(1.0, 0.7, 0.0));
        let near = |a: DVec3, b: DVec3| assert!(a.distance(b) < 1e-12, "{a} {b}");
        near(once.point(eye), -0.5 * DVec3::X);
        near(twice.point(eye), 4.5 * DVec3::X);
        near(twice.appears(place), DVec3::new(-3.0, 0.7, 0.0));
        near(twice.windows[1].centre, -2.0 * DVec3::X);
        assert!(twice.is_open_to(eye, DVec3::NEG_X, 1e-9));
        assert!(
            !twice.is_open_to(-eye, DVec3::NEG_X, 1e-9),
            "behind the mirror"
        );
        assert!(
            !twice.is_open_to(eye - 9.0 * DVec3::Y, DVec3::NEG_Y, 1e-9),
            "looks away"
        );
        mirrors.images = vec![twice];
        // As long as the unfolded path.
        let route = mirrors.route(0, eye, place).unwrap();
        assert_eq!(route.bounces().len(), 2);
        let legs = route
            .points()
            .windows(2)
            .map(|ends| ends[0].distance(ends[1]));
        assert!((legs.sum::<f64>() - 3.5_f64.hypot(0.7)).abs() < 1e-12);
        assert!(mirrors.route(0, eye, place + 9.0 * DVec3::Y).is_none());
        assert!(mirrors.may_show(0, eye, (place, 0.1)));
        assert!(!mirrors.may_show(0, eye, (place + 9.0 * DVec3::Y, 0.1)));
    }
}
