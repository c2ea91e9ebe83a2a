//! The point of a triangle that is nearest to some point.

use glam::DVec3;

/// The point of a triangle, border included, nearest to `p`.
pub fn nearest_point(&[a, b, c]: &[DVec3; 3], p: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let edges = [(a, b), (b, c), (c, a)];
    if edges
        .iter()
        .all(|&(from, to)| normal.cross(to - from).dot(p - from) > 0.0)
    {
        return p - normal * (normal.dot(p - a) / normal.length_squared());
    }
    edges
        .map(|(from, to)| {
            let along = to - from;
            let t = along.dot(p - from) / along.length_squared().max(f64::MIN_POSITIVE);
            from + along * t.clamp(0.0, 1.0)
        })
        .into_iter()
        .min_by(|x, y| x.distance_squared(p).total_cmp(&y.distance_squared(p)))
        .unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
    }

    proptest! {
        /// No point of the triangle is nearer, and it is one.
        #[test]
        fn nothing_is_nearer(corners in prop::array::uniform3(point()), p in point()) {
            let found = nearest_point(&corners, p);
            let at = |i: i32, j: i32| {
                let [u, v] = [i, j].map(|k| f64::from(k) / 24.0);
                corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v
            };
            let grid = (0..=24).flat_map(|i| (0..=24 - i).map(move |j| (i, j)));
            let nearest = grid.clone().map(|(i, j)| at(i, j).distance(p)).fold(f64::INFINITY, f64::min);
            prop_assert!(found.distance(p) <= nearest + 1e-9);
            let off = grid.map(|(i, j)| at(i, j).distance(found)).fold(f64::INFINITY, f64::min);
            let longest = (corners[1] - corners[0]).length() + (corners[2] - corners[0]).length();
            prop_assert!(off <= longest / 24.0 + 1e-9);
        }
    }

    #[test]
    fn of_a_triangle_without_area() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        assert_eq!(
            nearest_point(&corners, DVec3::new(1.5, 1.0, 0.0)),
            DVec3::X * 1.5
        );
        assert_eq!(nearest_point(&[DVec3::ONE; 3], DVec3::ZERO), DVec3::ONE);
    }
}
