//! Form factor from an element of surface to a polygon (Lambert 1760; as in Baum, Rushmeier, Winget 1989, "Improving Radiosity
//! Solutions Through the Use of Analytically Determined Form-Factors").
//!
//! F = 1/(2 pi) | sum_i gamma_i n . (r_i x r_i+1)/|r_i x r_i+1| |, r_i the corners seen from the point, gamma_i the angle between r_i
//! and r_i+1 by atan2(|r_i x r_i+1|, r_i . r_i+1), the polygon clipped at the horizon first. No unit. This is the share of the light of the
//! element that leaves for the polygon, whichever way the polygon faces and with nothing between; who may see whom is the caller's.

use glam::DVec3;

/// A point nearer to a polygon's plane than this, of the distance to its farthest corner, is taken to lie in it: a few roundings.
pub(crate) const IN_PLANE: f64 = 1e-14;

/// Form factor, between 0 and 1, from an element at `point` with unit normal `normal` to a planar polygon.
///
/// 0 for a point in the plane of the polygon: the formula itself gives 1 inside the polygon. A point that is in the plane only up to rounding
/// is not recognised by its value; callers compare ids of planes.
pub fn lambert_polygon(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let Some(&first) = polygon.first() else {
        return 0.0;
    };
    let origin = first - point;
    let (mut area, mut reach) = (DVec3::ZERO, 0.0f64);
    for_edges(polygon, |a, b| {
        area += (a - point).cross(b - point);
        reach = reach.max((a - point).length_squared());
    });
    if area.dot(origin).abs() <= IN_PLANE * area.length() * reach.sqrt() {
        return 0.0;
    }

    let mut sum = 0.0;
    // Where the outline last went below the horizon, and where it first came up before that.
    let (mut down, mut first_up) = (None, None);
    for_edges(polygon, |a, b| {
        let (a, b) = (a - point, b - point);
        let (above, ahead) = (a.dot(normal), b.dot(normal));
        let cross = || a + (b - a) * (above / (above - ahead));
        match (above >= 0.0, ahead >= 0.0) {
            (true, true) => sum += edge(a, b, normal),
            (true, false) => {
                let end = cross();
                sum += edge(a, end, normal);
                down = Some(end);
            }
            (false, true) => {
                let start = cross();
                match down.take() {
                    Some(end) => sum += edge(end, start, normal),
                    None => first_up = Some(start),
                }
                sum += edge(start, b, normal);
            }
            (false, false) => {}
        }
    });
    if let (Some(end), Some(start)) = (down, first_up) {
        sum += edge(end, start, normal);
    }
    (sum.abs() / std::f64::consts::TAU).min(1.0)
}

/// The edges of a closed outline, from its first corner on.
pub(crate) fn edges(polygon: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    let ahead = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(ahead.copied())
}

/// The four similar parts of a triangle: those at its corners, then the middle, turned round.
pub(crate) fn quarters([a, b, c]: [DVec3; 3]) -> [[DVec3; 3]; 4] {
    let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}

/// Calls with every edge of a closed outline.
fn for_edges(polygon: &[DVec3], mut call: impl FnMut(DVec3, DVec3)) {
    let mut before = polygon[polygon.len() - 1];
    for &corner in polygon {
        call(before, corner);
        before = corner;
    }
}

/// The angle between two corners times the cosine between the normal and the edge's plane; 0 when they lie in one line.
fn edge(a: DVec3, b: DVec3, normal: DVec3) -> f64 {
    let cross = a.cross(b);
    let sine = cross.length();
    if sine > 0.0 {
        cross.dot(normal) / sine * sine.atan2(a.dot(b))
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn square(corner: DVec3, x: DVec3, y: DVec3) -> [DVec3; 4] {
        [corner, corner + x, corner + x + y, corner + y]
    }

    fn near(value: f64, exact: f64, tolerance: f64) {
        assert!((value - exact).abs() <= tolerance, "{value} {exact}");
    }

    #[test]
    fn published_configurations() {
        let unit = square(DVec3::Z, DVec3::X, DVec3::Y);
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &unit),
            0.138531605994893,
            1e-14,
        );
        let centre = DVec3::new(0.5, 0.5, 0.0);
        near(
            lambert_polygon(centre, DVec3::Z, &unit),
            0.239456470460774,
            1e-14,
        );
        let wall = square(DVec3::X, DVec3::Y, DVec3::Z);
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &wall),
            0.055734197002554,
            1e-14,
        );
        let triangle = [
            DVec3::Z,
            DVec3::new(1.0, 0.0, 1.0),
            DVec3::new(0.0, 1.0, 1.0),
        ];
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &triangle),
            0.0962250448649376,
            1e-14,
        );
    }

    #[test]
    fn horizon_cuts_exactly() {
        let whole = square(DVec3::new(1.0, -1.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0);
        let half = square(DVec3::new(1.0, -1.0, 0.0), DVec3::Y * 2.0, DVec3::Z);
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &whole),
            0.111468394005107,
            1e-14,
        );
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &half),
            0.111468394005107,
            1e-14,
        );
        assert_eq!(lambert_polygon(DVec3::ZERO, -DVec3::X, &whole), 0.0);
        // Any start and either sense of the outline.
        let mut turned = whole;
        for _ in 0..4 {
            turned.rotate_left(1);
            near(
                lambert_polygon(DVec3::ZERO, DVec3::Z, &turned),
                0.111468394005107,
                1e-14,
            );
        }
        turned.reverse();
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &turned),
            0.111468394005107,
            1e-14,
        );
    }

    #[test]
    fn close_to_a_polygon_it_stays_below_one() {
        let unit = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        for (h, exact, tolerance) in [
            (0.1, 0.968_339_56, 5e-9),
            (0.01, 0.999_672_79, 5e-9),
            (0.001, 0.999_996_73, 5e-9),
            (1e-6, 0.999_999_999_996_73, 5e-15),
        ] {
            let point = DVec3::new(0.5, 0.5, h);
            near(lambert_polygon(point, -DVec3::Z, &unit), exact, tolerance);
        }
        let inside = DVec3::new(0.3, 0.4, 0.0);
        assert_eq!(
            lambert_polygon(inside, DVec3::Z, &unit),
            0.0,
            "in the plane"
        );
        assert_eq!(lambert_polygon(DVec3::X * 2.0, DVec3::Z, &unit), 0.0);
    }

    #[test]
    fn far_away_it_is_the_point_formula() {
        let d = 1e4;
        let unit = square(DVec3::new(-0.5, -0.5, d), DVec3::X, DVec3::Y);
        let exact = 1.0 / (PI * d * d);
        near(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &unit) / exact,
            1.0,
            1e-7,
        );
    }

    #[test]
    fn faces_of_a_box_add_up_to_one() {
        let [lo, size] = [DVec3::new(-1.0, -2.0, 0.0), DVec3::new(4.0, 3.0, 2.5)];
        let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        let faces = [
            square(lo, x, y),
            square(lo + z, x, y),
            square(lo, y, z),
            square(lo + x, y, z),
            square(lo, x, z),
            square(lo + y, x, z),
        ];
        for normal in [
            DVec3::Z,
            DVec3::new(0.6, 0.0, 0.8),
            DVec3::new(-0.48, 0.6, 0.64),
        ] {
            let point = lo + size * DVec3::new(0.3, 0.01, 0.999);
            let sum: f64 = faces
                .iter()
                .map(|face| lambert_polygon(point, normal, face))
                .sum();
            near(sum, 1.0, 1e-13);
        }
    }

    #[test]
    fn degenerate_polygons_give_nothing() {
        assert_eq!(lambert_polygon(DVec3::ZERO, DVec3::Z, &[]), 0.0);
        assert_eq!(lambert_polygon(DVec3::ZERO, DVec3::Z, &[DVec3::Z; 3]), 0.0);
        assert_eq!(
            lambert_polygon(DVec3::ZERO, DVec3::Z, &[DVec3::Z, DVec3::X]),
            0.0
        );
    }
}
