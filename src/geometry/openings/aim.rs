//! Rays that are aimed where others left.

use super::gaps::{Gap, across};
use super::sides::{KINDS, Openings, PLACES};
use crate::geometry::sampling::Pcg;
use glam::DVec3;

/// Rays are aimed beside a gap by so many cells, as often by each power of two.
const BESIDE: [f64; 2] = [0.125, 4.0];

/// Where rays are aimed: beside gaps.
pub(super) struct Aim<'a> {
    gaps: &'a [Gap],
    /// Their numbers, by cells that hold them, and where each cell starts, one more at the end.
    by_cell: Vec<u32>,
    cells: Vec<u32>,
    /// The same by kinds of places, where each of all starts.
    by_place: Vec<u32>,
    places: Vec<u32>,
}

impl<'a> Aim<'a> {
    pub(super) fn new(openings: &Openings, gaps: &'a [Gap]) -> Self {
        let size = openings.cell();
        let cell = |g: &Gap| ((g.at - openings.low) / size).as_u16vec3().to_array();
        let numbers = || (0..gaps.len() as u32).collect::<Vec<u32>>();
        let (mut by_cell, mut by_place) = (numbers(), numbers());
        by_cell.sort_by_cached_key(|&k| cell(&gaps[k as usize]));
        by_place.sort_by_key(|&k| gaps[k as usize].place);
        let same = |a: &u32, b: &u32| cell(&gaps[*a as usize]) == cell(&gaps[*b as usize]);
        let mut cells = vec![0];
        for group in by_cell.chunk_by(same) {
            cells.push(cells[cells.len() - 1] + group.len() as u32);
        }
        let place = |kind: usize| by_place.partition_point(|&k| gaps[k as usize].place < kind);
        let places = (0..=KINDS).map(|kind| place(kind) as u32).collect();
        Self {
            gaps,
            by_cell,
            cells,
            by_place,
            places,
        }
    }

    /// The gaps that a kind of place found.
    fn of(&self, place: usize) -> &[u32] {
        &self.by_place[self.places[place] as usize..self.places[place + 1] as usize]
    }

    /// A point beside a gap that was found from this place, from one beside it, or from anywhere, each cell as often, by turns.
    pub(super) fn at(
        &self,
        openings: &Openings,
        place: usize,
        turn: usize,
        random: &mut Pcg,
    ) -> DVec3 {
        let mut among: &[u32] = match turn % 4 {
            0 => &[],
            1 => {
                let near: Vec<usize> = beside(place).filter(|&k| !self.of(k).is_empty()).collect();
                match near.len() {
                    0 => &[],
                    n => self.of(near[random.below(n as u32) as usize]),
                }
            }
            _ => self.of(place),
        };
        if among.is_empty() {
            let cell = random.below(self.cells.len() as u32 - 1) as usize;
            among = &self.by_cell[self.cells[cell] as usize..self.cells[cell + 1] as usize];
        }
        let Gap { mut at, axis, .. } =
            self.gaps[among[random.below(among.len() as u32) as usize] as usize];
        let [least, most] = BESIDE.map(f64::log2);
        for other in across(axis) {
            let cells = (least + (most - least) * random.f64()).exp2();
            at[other] += (2.0 * random.f64() - 1.0) * cells * openings.cell()[other];
        }
        at.clamp(openings.low, openings.high)
    }
}

/// Places beside one, whichever way they look, itself too.
fn beside(place: usize) -> impl Iterator<Item = usize> {
    let n = PLACES as i64;
    let at = (place % PLACES.pow(3)) as i64;
    let [x, y, z] = [at / (n * n), at / n % n, at % n];
    let near = move |c: i64| (c - 1).max(0)..=(c + 1).min(n - 1);
    (0..6).flat_map(move |side| {
        near(x).flat_map(move |x| {
            near(y).flat_map(move |y| {
                near(z).map(move |z| (((side * n + x) * n + y) * n + z) as usize)
            })
        })
    })
}
