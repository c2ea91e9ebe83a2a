//! What lines miss in the middles of edges, derived from what they miss in those of a larger triangle.

/// What lines miss in the middles of the edges of both halves (a, m, c) and (m, b, c) of a triangle (a, b, c), where m is at a share `t`
/// from a to b, from what they miss in those of the triangle: in proportion to lengths squared, if light bends evenly.
pub(super) fn missed_by_halves([ab, bc, ca]: [Option<f32>; 3], t: f32) -> [[Option<f32>; 3]; 2] {
    let mc = || Some((1.0 - t) * ca? + t * bc? - t * (1.0 - t) * ab?);
    let part = |share: f32| ab.map(|ab| share * share * ab);
    [[part(t), mc(), ca], [part(1.0 - t), bc, mc()]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, vec2};

    #[test]
    fn halves_miss_what_a_curve_of_the_second_degree_says() {
        let light = |p: Vec2| 3.0 * p.x * p.x - 2.0 * p.x * p.y + 0.5 * p.y * p.y + p.x + 7.0;
        let missed = |corners: [Vec2; 3]| {
            [0, 1, 2].map(|k| {
                let [a, b] = [corners[k], corners[(k + 1) % 3]];
                light(0.5 * (a + b)) - 0.5 * (light(a) + light(b))
            })
        };
        let [a, b, c] = [vec2(0.2, -0.4), vec2(2.0, 0.3), vec2(-0.7, 1.9)];
        for t in [0.5, 0.3] {
            let m = a.lerp(b, t);
            let halves = missed_by_halves(missed([a, b, c]).map(Some), t);
            for (half, corners) in halves.into_iter().zip([[a, m, c], [m, b, c]]) {
                for (inferred, there) in half.into_iter().zip(missed(corners)) {
                    assert!(
                        (inferred.unwrap() - there).abs() < 1e-5,
                        "{inferred:?} {there}"
                    );
                }
            }
        }
        // From an edge that was not looked at nothing follows.
        assert_eq!(
            missed_by_halves([None, Some(1.0), None], 0.5),
            [[None; 3], [None, Some(1.0), None]]
        );
    }
}
