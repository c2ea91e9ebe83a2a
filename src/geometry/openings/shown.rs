//! Which parts of openings are seen from where: asked by rays, once.
//!
//! Parts overlap: through a window in a house that stands in a yard rays leave by the window and by the sides of the yard. A ray is shared
//! out among the parts that it crosses as they would have found it, again and again by the shares that come out (expectation and
//! maximisation, Dempster, Laird and Rubin 1977): inside of the house the window takes all, and outside the sides of the yard.

use super::distribution::OpeningDistribution;
use super::sides::{BEAM, KINDS, Openings, RayStart, Wall};
use crate::geometry::sampling::{Pcg, hash};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// What all places know of a part as small as a cell counts for this many rays of one, of a larger one for fewer by as much: rays all over
/// the hemisphere meet that, too. With as many for all, points that see a slit in an inner wall were 9 % off.
const PRIOR: f64 = 0.25;
/// Of a part that is open for a smaller share than this little is seen.
const MUCH: f64 = 0.1;
/// So many times rays are shared out: each time divides what lies behind a window by the ratio of their sizes.
const TIMES: usize = 6;

/// A ray that left: what it stands for, and the parts that it crossed with their density.
#[derive(Debug)]
struct Ray {
    place: usize,
    brings: f64,
    crossed: Vec<(usize, f64)>,
}

/// What points asked of a part: what it would bring if it were open, and rays to it.
#[derive(Debug, Clone, Copy, Default)]
struct PartRequest {
    worth: f64,
    rays: f64,
}

/// What is known of a part: the share that is open, and how many rays that counts for.
#[derive(Debug, Clone, Copy, Default)]
struct PartOpenness {
    open: f64,
    counts: f64,
}

/// What a point asked: of each part from each place, and the rays that left.
type Answers = (Vec<(usize, usize, PartRequest)>, Vec<Ray>);

impl Openings {
    /// Finds which share of each part is open, seen from each kind of place, by rays from points to the parts.
    pub(super) fn look_at_parts(
        &mut self,
        (starts, places): (&[RayStart], &[usize]),
        meet: &(impl Fn(&RayStart, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
        seed: u64,
    ) {
        let parts = self.parts.len();
        if parts == 0 {
            return;
        }
        self.shown = vec![1.0; KINDS * parts];
        let look = |k: usize| self.ask(&starts[k], places[k], meet, hash(seed, k as u64));
        let answers: Vec<Answers> = (0..starts.len()).into_par_iter().map(look).collect();
        let mut asked = vec![PartRequest::default(); KINDS * parts];
        let mut rays = Vec::new();
        for (some, left) in answers {
            for (place, part, by) in some {
                let all = &mut asked[place * parts + part];
                all.worth += by.worth;
                all.rays += by.rays;
            }
            rays.extend(left);
        }
        rays.sort_by_key(|ray| ray.place);
        let places: Vec<(&[Ray], &[PartRequest])> = (0..KINDS)
            .map(|place| {
                let [first, end] =
                    [place, place + 1].map(|p| rays.partition_point(|r| r.place < p));
                (&rays[first..end], &asked[place * parts..][..parts])
            })
            .collect();
        // What is known of a part: how open it is to the places that see much of it.
        let alone: Vec<PartShares> = places
            .par_iter()
            .map(|(rays, asked)| share_out(rays, asked, |_| PartOpenness::default()))
            .collect();
        let open = |part: usize| {
            let seeing = places.iter().zip(&alone).filter(|(_, s)| s[part][0] > MUCH);
            let [brings, worth] = seeing.fold([0.0, 1e-300], |[brings, worth], ((_, asked), s)| {
                [brings + s[part][1], worth + asked[part].worth]
            });
            (brings / worth).min(1.0)
        };
        let cell = self.cell();
        let cell = (cell.x * cell.y).max(cell.y * cell.z).max(cell.z * cell.x);
        let known: Vec<PartOpenness> = (0..parts)
            .map(|part| {
                let small = (cell / self.parts[part].area()).min(1.0);
                let open = open(part);
                PartOpenness {
                    open,
                    counts: PRIOR * small,
                }
            })
            .collect();
        let shown: Vec<Vec<f32>> = places
            .par_iter()
            .map(|(rays, asked)| {
                let shares = share_out(rays, asked, |part| known[part]);
                shares.into_iter().map(|[share, _]| share as f32).collect()
            })
            .collect();
        self.shown = shown.concat();
    }

    /// Rays from a point to the parts as if all were open.
    fn ask(
        &self,
        start: &RayStart,
        place: usize,
        meet: &(impl Fn(&RayStart, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
        seed: u64,
    ) -> Answers {
        let (point, normal) = (start.point, start.normal);
        let mut choice = OpeningDistribution::default();
        self.weigh(f64::INFINITY, (point, normal), |_| 1.0, &mut choice);
        let total = choice.total();
        let asked = choice.worths().map(|(part, worth)| {
            let rays = BEAM as f64 * worth / total.max(1e-300);
            (place, part, PartRequest { worth, rays })
        });
        let mut random = Pcg::new(seed);
        let chosen: [Option<DVec3>; BEAM] = std::array::from_fn(|_| {
            let at = self.choose(&choice, [random.f64(), random.f64()])?;
            Some((at - point).normalize_or_zero()).filter(|way| normal.dot(*way) > 0.0)
        });
        let met = meet(start, &chosen.map(|way| way.unwrap_or(normal)));
        let left = chosen.into_iter().zip(met).filter_map(|(way, met)| {
            let way = way.filter(|_| met.is_none())?;
            let mut crossed = Vec::new();
            self.crossed(&choice, point, way, |part, density| {
                crossed.push((part, density));
            });
            let density: f64 = crossed.iter().map(|(_, density)| density).sum();
            let brings = normal.dot(way) / PI * total / (density * BEAM as f64).max(1e-300);
            Some(Ray {
                place,
                brings,
                crossed,
            })
        });
        (asked.collect(), left.collect())
    }
}

/// Of each part what it brings, as a share of what it would if it were open, and as it is.
type PartShares = Vec<[f64; 2]>;

/// Shares out rays by what is known of the parts before.
fn share_out(
    rays: &[Ray],
    asked: &[PartRequest],
    known: impl Fn(usize) -> PartOpenness,
) -> PartShares {
    let mut shares = vec![[1.0, 0.0]; asked.len()];
    for _ in 0..TIMES {
        let mut brings = vec![0.0; asked.len()];
        for ray in rays {
            let by = |&(part, density): &(usize, f64)| shares[part][0] * density;
            let all: f64 = ray.crossed.iter().map(by).sum();
            for each in &ray.crossed {
                brings[each.0] += ray.brings * by(each) / all.max(1e-300);
            }
        }
        for (part, share) in shares.iter_mut().enumerate() {
            let PartRequest { worth, rays } = asked[part];
            let PartOpenness { open, counts } = known(part);
            let found = if worth > 0.0 {
                brings[part] / worth
            } else {
                0.0
            };
            let found = (found * rays + counts * open) / (rays + counts).max(1e-300);
            *share = [found.min(1.0), brings[part]];
        }
    }
    shares
}
