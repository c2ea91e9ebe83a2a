//! What a point sees of a polygon: the polygon less the shadows of others in between, exactly.
//!
//! A point q of the polygon is hidden from p by a convex polygon T when q lies in the cone of p over T and beyond T's plane: a
//! half-space for each edge and one more. The polygon less such a region falls into as many convex pieces at the most, one outside each; each
//! blocker does so to every piece that is left (convex decomposition, as in Nishita and Nakamae 1983 for shadows of area sources).
//! Lengths in the caller's unit; nothing here knows of light.

use super::lanes::lambert_edges_x8;
use super::polygon::edges;
use glam::DVec3;

/// Pieces thinner than this are nothing, of the distance from the point to the farthest corner.
const THIN: f64 = 1e-12;

/// What is left of a polygon counts as nothing below this share of it: rounding leaves slivers along edges that blockers share, and
/// what is hidden must be exactly dark.
const SLIVER: f64 = 1e-9;

/// So does a factor below the first figure (the factor of a sliver is a difference of angles) that is less than the second of the whole
/// polygon's.
const ROUNDING: [f64; 2] = [1e-13, 1e-3];

/// The visible part of a convex polygon from a point, as convex pieces (none when all is hidden), `blockers` being the triangles and
/// convex quadrilaterals that may stand between. None when it would take more than `cap` pieces.
///
/// A blocker whose plane holds the point hides nothing; neither does one that touches the polygon from the front or lies behind it.
///
/// # Panics
/// On a blocker of other than three or four corners.
pub fn visible_part(
    point: DVec3,
    polygon: &[DVec3],
    blockers: &[impl AsRef<[DVec3]>],
    cap: usize,
) -> Option<Vec<Vec<DVec3>>> {
    let mut clipper = Clipper::default();
    clipper.begin(point, polygon);
    let pieces = clipper.clip_all(point, blockers, cap)?.pieces.iter();
    let back = |piece: &[DVec3]| piece.iter().map(|&q| q + point).collect();
    Some(pieces.map(back).collect())
}

/// Form factor from an element to the visible part of a convex polygon; None when it takes more than `cap` pieces. Panics as
/// [`visible_part`].
pub fn lambert_visible(
    point: DVec3,
    normal: DVec3,
    polygon: &[DVec3],
    blockers: &[impl AsRef<[DVec3]>],
    cap: usize,
) -> Option<f64> {
    let mut clipper = Clipper::default();
    clipper.begin(point, polygon);
    let whole = lambert_edges_x8(point, normal, polygon);
    let left = clipper.clip_all(point, blockers, cap)?;
    Some(left.factor(normal, whole))
}

/// Convex polygons in one stretch of memory.
#[derive(Debug, Default)]
struct Pieces {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
}

impl Pieces {
    fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    fn push(&mut self, piece: &[DVec3]) {
        self.corners.extend_from_slice(piece);
        self.ends.push(self.corners.len());
    }

    fn truncate(&mut self, count: usize) {
        self.ends.truncate(count);
        self.corners
            .truncate(self.ends.last().copied().unwrap_or(0));
    }

    fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.corners[start..end])
    }
}

/// What is left of a polygon while one shadow after the other is taken away, with the memory for that. Coordinates are from
/// the point that looks.
#[derive(Debug, Default)]
pub struct Clipper {
    whole: Vec<DVec3>,
    thin: f64,
    touched: bool,
    pieces: Pieces,
    left: Pieces,
    rest: Vec<DVec3>,
    inside: Vec<DVec3>,
    outside: Vec<DVec3>,
}

impl Clipper {
    /// Begins with a whole convex polygon, seen from a point.
    pub fn begin(&mut self, point: DVec3, polygon: &[DVec3]) {
        self.whole.clear();
        self.whole.extend(polygon.iter().map(|&q| q - point));
        let reach = self.whole.iter().map(|q| q.length_squared());
        self.thin = THIN * reach.fold(0.0, f64::max).sqrt();
        self.touched = false;
        self.pieces.clear();
        self.pieces.push(&self.whole);
    }

    /// Takes a shadow away, cast from the point that looks. False when more than `cap` pieces are left.
    pub fn clip(&mut self, shadow: &Shadow, cap: usize) -> bool {
        if shadow.is_edge_on(self.thin) || shadow.misses(&self.whole, 0.0) {
            return true;
        }
        self.touched = true;
        let pieces = std::mem::take(&mut self.pieces);
        self.left.clear();
        let fits = pieces.iter().all(|piece| {
            self.subtract(shadow, piece);
            self.left.ends.len() <= cap
        });
        self.pieces = std::mem::replace(&mut self.left, pieces);
        fits
    }

    /// Takes the shadows of all blockers away; none when more than `cap` pieces are left.
    fn clip_all(
        &mut self,
        point: DVec3,
        blockers: &[impl AsRef<[DVec3]>],
        cap: usize,
    ) -> Option<&Self> {
        let mut shadows = blockers.iter().map(|b| Shadow::new(point, b.as_ref()));
        shadows
            .all(|shadow| self.clip(&shadow, cap))
            .then_some(self)
    }

    /// Form factor of what is left; `whole` is that of the whole polygon.
    pub fn factor(&self, normal: DVec3, whole: f64) -> f64 {
        if !self.touched {
            return whole;
        }
        let factor = |piece| lambert_edges_x8(DVec3::ZERO, normal, piece);
        let sum: f64 = self.pieces.iter().map(factor).sum();
        if sum < SLIVER * whole || (sum < ROUNDING[0] && sum < ROUNDING[1] * whole) {
            0.0
        } else {
            sum.min(1.0)
        }
    }

    /// What is left, as convex pieces, seen from the point.
    pub fn visible(&self) -> impl Iterator<Item = &[DVec3]> {
        self.pieces.iter()
    }

    /// Pushes to `left` what is left of a piece.
    fn subtract(&mut self, shadow: &Shadow, piece: &[DVec3]) {
        // Not touched by the shadow: better whole.
        if shadow.misses(piece, self.thin) {
            self.left.push(piece);
            return;
        }
        let first = self.left.ends.len();
        self.rest.clear();
        self.rest.extend_from_slice(piece);
        for side in &shadow.sides[..shadow.count] {
            let thin = self.thin * side.normal.length();
            if self.rest.iter().all(|&q| side.outside(q) <= thin) {
                continue;
            }
            side.split(&self.rest, thin, &mut self.inside, &mut self.outside);
            if !self.outside.is_empty() {
                self.left.push(&self.outside);
            }
            std::mem::swap(&mut self.rest, &mut self.inside);
            if self.rest.is_empty() {
                self.left.truncate(first);
                self.left.push(piece);
                return;
            }
        }
    }
}

/// A half-space: inside is `normal . x <= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HalfSpace {
    pub(crate) normal: DVec3,
    pub(crate) offset: f64,
}

impl HalfSpace {
    /// Signed distance in lengths of the normal, positive outside.
    pub(crate) fn outside(&self, x: DVec3) -> f64 {
        self.normal.dot(x) - self.offset
    }

    /// The parts of a convex polygon inside and outside (Sutherland and Hodgman 1974); empty if no corner is deeper than
    /// `thin`. Corners nearer to the plane than `thin` count as on it, so that no sliver is clipped off there.
    pub(crate) fn split(
        &self,
        polygon: &[DVec3],
        thin: f64,
        inside: &mut Vec<DVec3>,
        outside: &mut Vec<DVec3>,
    ) {
        inside.clear();
        outside.clear();
        let Some(&last) = polygon.last() else { return };
        let (mut before, mut d0) = (last, self.outside(last));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for &corner in polygon {
            let d1 = self.outside(corner);
            (least, most) = (least.min(d1), most.max(d1));
            if (d0 < -thin && d1 > thin) || (d0 > thin && d1 < -thin) {
                let crossing = before + (corner - before) * (d0 / (d0 - d1));
                inside.push(crossing);
                outside.push(crossing);
            }
            if d1 <= thin {
                inside.push(corner);
            }
            if d1 >= -thin {
                outside.push(corner);
            }
            (before, d0) = (corner, d1);
        }
        if least >= -thin || inside.len() < 3 {
            inside.clear();
        }
        if most <= thin || outside.len() < 3 {
            outside.clear();
        }
    }
}

/// Corners of a blocker at the most.
const CORNERS: usize = 4;

/// Where the shadow of a blocker lies, seen from a point that is the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    /// Beyond the blocker's plane, and inside the planes through the point and an edge; normals of any length.
    sides: [HalfSpace; CORNERS + 1],
    count: usize,
}

impl Shadow {
    /// The shadow of a triangle or convex quadrilateral.
    ///
    /// # Panics
    /// On other than three or four corners.
    pub fn new(point: DVec3, blocker: &[DVec3]) -> Self {
        let [a, b, c] = [blocker[0], blocker[1], blocker[2]].map(|corner| corner - point);
        let normal = (b - a).cross(c - a);
        let way = normal.dot(a);
        // Seen from the point, the blocker runs the one or the other way round.
        let inward = -way.signum();
        let mut sides = [HalfSpace {
            normal: normal * inward,
            offset: -way.abs(),
        }; CORNERS + 1];
        for (side, (p, q)) in sides[1..].iter_mut().zip(edges(blocker)) {
            *side = HalfSpace {
                normal: (p - point).cross(q - point) * inward,
                offset: 0.0,
            };
        }
        Self {
            sides,
            count: 1 + blocker.len(),
        }
    }

    /// Does the point lie in the blocker's plane?
    fn is_edge_on(&self, thin: f64) -> bool {
        let plane = &self.sides[0];
        plane.offset * plane.offset <= thin * thin * plane.normal.length_squared()
    }

    /// Does all of a polygon lie on one outer side, or not deeper than `thin` within it?
    fn misses(&self, polygon: &[DVec3], thin: f64) -> bool {
        self.sides[..self.count].iter().any(|side| {
            let least = if thin > 0.0 {
                -thin * side.normal.length()
            } else {
                0.0
            };
            polygon.iter().all(|&q| side.outside(q) >= least)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, on_triangle, sequence02};

    /// The part of a convex polygon on one side, plainly.
    fn part(plane: &HalfSpace, sign: f64, polygon: &[DVec3], thin: f64) -> Vec<DVec3> {
        let out = |p: DVec3| sign * plane.outside(p);
        let mut part = Vec::new();
        for k in 0..polygon.len() {
            let (p, q) = (polygon[(k + polygon.len() - 1) % polygon.len()], polygon[k]);
            if out(p).abs().min(out(q).abs()) > thin && out(p) * out(q) < 0.0 {
                part.push(p + (q - p) * (out(p) / (out(p) - out(q))));
            }
            if out(q) <= thin {
                part.push(q);
            }
        }
        let deep = polygon.iter().any(|&p| out(p) < -thin);
        if deep && part.len() > 2 {
            part
        } else {
            Vec::new()
        }
    }

    /// Bit by bit, with corners on the plane and next to it.
    #[test]
    fn both_parts_are_those_of_both_sides() {
        let mut rng = Pcg::new(11);
        let mut number = || (rng.f64() * 9.0).floor() - 4.0;
        for _ in 0..4096 {
            let mut point = || DVec3::new(number(), number(), 0.0);
            let polygon = [point(), point(), point(), point()];
            let plane = HalfSpace {
                normal: point().try_normalize().unwrap_or(DVec3::X),
                offset: 0.5 * number(),
            };
            let (mut inside, mut outside) = (Vec::new(), Vec::new());
            plane.split(&polygon, 1e-9, &mut inside, &mut outside);
            assert_eq!(inside, part(&plane, 1.0, &polygon, 1e-9));
            assert_eq!(outside, part(&plane, -1.0, &polygon, 1e-9));
        }
    }

    /// Two triangles over a parallelogram.
    fn quad(corner: DVec3, x: DVec3, y: DVec3) -> [[DVec3; 3]; 2] {
        [
            [corner, corner + x, corner + x + y],
            [corner, corner + x + y, corner + y],
        ]
    }

    fn area(piece: &[DVec3]) -> f64 {
        let sum: DVec3 = (1..piece.len() - 1)
            .map(|k| (piece[k] - piece[0]).cross(piece[k + 1] - piece[0]))
            .sum();
        0.5 * sum.length()
    }

    #[test]
    fn a_square_half_way_casts_a_square_twice_as_large() {
        let floor = [
            DVec3::ZERO,
            DVec3::X * 4.0,
            DVec3::new(4.0, 4.0, 0.0),
            DVec3::Y * 4.0,
        ];
        let eye = DVec3::new(2.0, 2.0, 2.0);
        let blocker = quad(DVec3::new(1.5, 1.5, 1.0), DVec3::X, DVec3::Y);
        let pieces = visible_part(eye, &floor, &blocker, 32).unwrap();
        let visible: f64 = pieces.iter().map(|p| area(p)).sum();
        assert!((visible - 12.0).abs() < 1e-12, "{visible}");
        // From the other side of the floor, behind the eye, behind the floor: nothing.
        for z in [3.0, -1.0, 0.0] {
            let away = quad(DVec3::new(1.5, 1.5, z), DVec3::X, DVec3::Y);
            assert_eq!(
                visible_part(eye, &floor, &away, 32).unwrap(),
                [floor.to_vec()]
            );
        }
        // Edge-on.
        let edge_on = quad(DVec3::new(2.0, 0.0, 0.0), DVec3::Y * 4.0, DVec3::Z);
        assert_eq!(
            visible_part(eye, &floor, &edge_on, 32).unwrap(),
            [floor.to_vec()]
        );
        // All hidden, and too few pieces allowed.
        let lid = quad(DVec3::new(0.0, 0.0, 1.0), DVec3::X * 4.0, DVec3::Y * 4.0);
        assert!(visible_part(eye, &floor, &lid, 32).unwrap().is_empty());
        assert!(visible_part(eye, &floor, &blocker, 2).is_none());
    }

    #[test]
    fn cie_171_case_5_7() {
        // Wall at y = 4, 4 m x 3 m, uniformly bright; a black box 4 m wide, z in 0..1, y in 2.5..2.7. CIE 171:2006 5.7 with the corrected
        // Table 19 (Ashdown's errata): per cent of the wall's exitance at points on the opposite wall and on the floor.
        let wall = [
            DVec3::new(0.0, 4.0, 0.0),
            DVec3::new(0.0, 4.0, 3.0),
            DVec3::new(4.0, 4.0, 3.0),
            DVec3::new(4.0, 4.0, 0.0),
        ];
        let (x, z) = (DVec3::X * 4.0, DVec3::Z);
        let mut screen = Vec::new();
        screen.extend(quad(DVec3::new(0.0, 2.5, 0.0), x, z));
        screen.extend(quad(DVec3::new(0.0, 2.7, 0.0), x, z));
        screen.extend(quad(DVec3::new(0.0, 2.5, 1.0), x, DVec3::Y * 0.2));
        let heights = [2.75, 2.25, 1.75, 1.25, 0.75, 0.25];
        let on_wall = [16.071, 16.330, 15.399, 13.322, 10.317, 7.079];
        for (h, exact) in heights.into_iter().zip(on_wall) {
            let f = lambert_visible(DVec3::new(2.0, 0.0, h), DVec3::Y, &wall, &screen, 64).unwrap();
            assert!((100.0 * f - exact).abs() < 6e-4, "{f} {exact}");
        }
        let depths = [0.25, 0.75, 1.25, 1.75, 2.25];
        for (y, exact) in depths.into_iter().zip([3.382, 3.629, 3.013, 0.0, 0.0]) {
            let f = lambert_visible(DVec3::new(2.0, y, 0.0), DVec3::Z, &wall, &screen, 64).unwrap();
            assert!((100.0 * f - exact).abs() < 6e-4, "{f} {exact}");
        }
    }

    /// A quadrilateral hides what its halves hide, with fewer pieces.
    #[test]
    fn a_quadrilateral_hides_what_its_halves_hide() {
        let mut random = Pcg::new(8);
        let mut hidden = 0;
        for _ in 0..400 {
            let mut point = || DVec3::new(random.f64(), random.f64(), random.f64());
            let (target, eye, normal) = ([point(), point(), point()], point(), point());
            let (corner, x, y) = (point(), point() - 0.5, point() - 0.5);
            let halves = quad(corner, x, y);
            let whole = [[corner, corner + x, corner + x + y, corner + y]];
            let [all, apart, together] = [
                lambert_visible(eye, normal, &target, &[[DVec3::ZERO; 3]; 0], 9),
                lambert_visible(eye, normal, &target, &halves, 99),
                lambert_visible(eye, normal, &target, &whole, 99),
            ]
            .map(Option::unwrap);
            assert!((apart - together).abs() < 1e-12, "{apart} {together}");
            hidden += usize::from(together < all);
        }
        assert!(hidden > 40, "{hidden}");
    }

    #[test]
    fn agrees_with_rays_through_random_triangles() {
        let mut random = Pcg::new(5);
        for _ in 0..200 {
            let mut point = || DVec3::new(random.f64(), random.f64(), random.f64());
            let target = [point(), point(), point()];
            let eye = point();
            let blockers: Vec<[DVec3; 3]> = (0..4).map(|_| [point(), point(), point()]).collect();
            let Some(pieces) = visible_part(eye, &target, &blockers, 200) else {
                panic!("200 pieces are enough for four blockers");
            };
            let total: f64 = pieces.iter().map(|p| area(p)).sum();
            let n = 1024;
            let seen = (0..n)
                .filter(|&k| {
                    let q = on_triangle(&target, sequence02(k, 9));
                    let hidden = blockers.iter().any(|t| hides(t, eye, q));
                    let holds = pieces.iter().any(|p| contains(p, q));
                    // A sample on a cut may go either way; none is there in general position.
                    assert_eq!(hidden, !holds, "{eye} {q}");
                    !hidden
                })
                .count();
            let share = total / area(&target);
            assert!(
                (share - seen as f64 / f64::from(n)).abs() < 0.03,
                "{share} {seen}"
            );
        }
    }

    /// Does the segment cross the triangle? By signs of volumes.
    fn hides([a, b, c]: &[DVec3; 3], p: DVec3, q: DVec3) -> bool {
        let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
        let sides = [
            volume(p, q, *a, *b),
            volume(p, q, *b, *c),
            volume(p, q, *c, *a),
        ];
        volume(*a, *b, *c, p) * volume(*a, *b, *c, q) < 0.0
            && (sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0))
    }

    fn contains(piece: &[DVec3], q: DVec3) -> bool {
        let normal = (1..piece.len() - 1)
            .map(|k| (piece[k] - piece[0]).cross(piece[k + 1] - piece[0]))
            .sum::<DVec3>();
        (0..piece.len()).all(|k| {
            let (a, b) = (piece[k], piece[(k + 1) % piece.len()]);
            (b - a).cross(q - a).dot(normal) >= 0.0
        })
    }
}
