//! Where rays leave a room: boxes about its openings, found once by rays from all surfaces.
//!
//! Rays all over the hemispheres find large openings; of some of those that leave it is asked where their way is narrowest: rays close
//! about them tell what stands beside it. Its *gap* is the point where it crosses the plane of that, or the box around the room if nothing
//! stands near. Seen from anywhere, gaps of one opening lie in that opening, in an outer wall as in an inner one, and rays from all places
//! that are aimed beside gaps find the extent of small openings. Boxes are laid about the gaps, flat for a window in a wall; rays to them
//! tell which of them are seen from where.
//!
//! A point that looks for the sky sends rays to these parts, in proportion to what they may bring, besides rays all over its
//! hemisphere. Both together are without bias, whatever was overlooked here: parts only decide where it pays to look.

mod aim;
mod boxes;
mod distribution;
mod find;
mod gaps;
mod narrow;
mod shown;
mod sides;

pub(crate) use distribution::OpeningDistribution;
pub(crate) use sides::{BEAM, Openings, RayStart, Wall};

#[cfg(test)]
mod tests {
    use super::boxes::OpeningBox;
    use super::sides::KINDS;
    use super::*;
    use crate::geometry::sampling::sequence02;
    use glam::DVec3;
    use std::f64::consts::PI;

    /// A floor of 4 m x 4 m in a box of which the lid is open by one rectangle; below it hangs a window that some places do not see, and a
    /// box that is not flat.
    fn openings() -> Openings {
        let mut openings =
            Openings::around(&[DVec3::new(-2.0, 0.0, -2.0), DVec3::new(2.0, 3.0, 2.0)]);
        let part = |low: [f64; 3], high: [f64; 3]| OpeningBox {
            low: DVec3::from(low),
            high: DVec3::from(high),
            axis: 1,
        };
        openings.parts = vec![
            part([-0.5, 2.9999, -0.2], [0.5, 3.0001, 1.3]),
            part([-0.1, 2.5, 0.0], [0.2, 2.50001, 0.4]),
            part([0.3, 2.2, -0.1], [0.6, 2.7, 0.3]),
        ];
        openings.shown = vec![1.0; 3 * KINDS];
        let above = openings.place(DVec3::new(0.1, 2.6, 0.3), DVec3::Y);
        openings.shown[3 * above + 1] = 0.02;
        openings
    }

    /// The chosen directions have the density that is said of them: the mean of f / density is the integral of f.
    #[test]
    fn directions_have_their_density() {
        let openings = openings();
        for point in [DVec3::new(0.7, 0.2, -0.4), DVec3::new(0.1, 2.6, 0.3)] {
            let normal = DVec3::Y;
            let mut choice = OpeningDistribution::default();
            openings.weigh(1e3, (point, normal), |_| 1.0, &mut choice);
            // Many sequences of few points, as points take them.
            let n = 1 << 20;
            let square = |k: u32| sequence02(k % 256, u64::from(k / 256));
            let f = |d: DVec3| d.y / PI;
            // Where a direction crosses the lid: parts reach beyond its rectangle, where it is shut.
            let open = |d: &DVec3| {
                let at = point + *d * ((3.0 - point.y) / d.y);
                d.y > 0.0 && (-0.5..=0.5).contains(&at.x) && (-0.2..=1.3).contains(&at.z)
            };
            let chosen: f64 = (0..n)
                .filter_map(|k| openings.choose(&choice, square(k)))
                .map(|at| (at - point).normalize())
                .filter(open)
                .map(|d| f(d) / openings.density(&choice, point, d))
                .sum();
            // The rectangle from below, by plain quadrature.
            let m = 400;
            let mut plain = 0.0;
            for j in 0..m {
                for i in 0..m {
                    let at = |k: i32| (f64::from(k) + 0.5) / f64::from(m);
                    let d = DVec3::new(at(i) - 0.5, 3.0, 1.5 * at(j) - 0.2) - point;
                    plain += d.y * d.y / (PI * d.length_squared().powi(2)) * 1.5 / f64::from(m * m);
                }
            }
            let ratio = chosen / f64::from(n) / plain;
            assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
        }
    }

    /// A slit of 2 cm in a wall is found to its edges from 4 m to 16 m away, though few rays all over the hemispheres leave; where the room
    /// ends there, and where it goes on outside.
    #[test]
    fn slits_are_found_to_their_edges() {
        let open = |p: DVec3| (p.x - 0.3).abs() < 0.01 && (p.y - 1.5).abs() < 1.0;
        for outside in [0.0, 2.0] {
            let corners = [DVec3::new(-2.0, 0.0, -outside), DVec3::new(2.0, 3.0, 16.0)];
            let start = |share: f64, [u, _]: [f64; 2]| {
                Some(RayStart {
                    point: DVec3::new(4.0 * u - 2.0, 0.0, 4.0 + 12.0 * share),
                    normal: DVec3::Y,
                    plane: 0,
                })
            };
            let meet = |start: &RayStart, ways: &[DVec3; BEAM]| {
                ways.map(|d| {
                    let distance = -start.point.z / d.z;
                    let is_open = d.z < 0.0 && open(start.point + d * distance);
                    let normal = DVec3::Z;
                    (!is_open).then_some(Wall { distance, normal })
                })
            };
            let openings = Openings::find(&corners, start, meet, 1);
            let mut choice = OpeningDistribution::default();
            for point in [[-1.7, 0.0, 15.0], [0.3, 0.0, 8.0], [1.2, 0.0, 4.5]].map(DVec3::from) {
                openings.weigh(1e3, (point, DVec3::Y), |_| 1.0, &mut choice);
                let n = 1000;
                // All of it is found.
                let through = |k| {
                    let [u, v] = sequence02(k, 2);
                    (DVec3::new(0.29 + 0.02 * u, 0.5 + 2.0 * v, 0.0) - point).normalize()
                };
                let found = |&k: &u32| openings.density(&choice, point, through(k)) > 0.0;
                assert!((0..n).filter(found).count() as u32 > n - n / 50);
                // And not much else.
                let chosen = (0..n).filter_map(|k| openings.choose(&choice, sequence02(k, 3)));
                let open = |at: &DVec3| {
                    let d = *at - point;
                    open(point - d * (point.z / d.z))
                };
                let open = chosen.filter(open).count();
                assert!(open as u32 > n / 2, "{open}");
            }
        }
    }
}
