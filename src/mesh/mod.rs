//! The mesh that is written: grown from the input's triangles, as fine as straight lines between vertices must be for the
//! asked-for error, and measured.

mod ahead;
mod along;
mod cells;
mod divided;
mod drawn;
mod edges;
mod fences;
mod fit;
mod flip;
mod grow;
mod hinges;
pub(crate) mod hints;
mod lines;
pub(crate) mod looks;
pub(crate) mod measure;
mod missed;
mod needles;
mod parts;
mod rims;
mod shades;
mod shadow;
mod sides;
mod skins;
pub(crate) mod smooth;
pub(crate) mod turns;
mod write;

use crate::gather::Baked;
use crate::solve::{Bake, Effort, GatherQuality};
use cells::Cells;
use grow::MeshGrowth;
use looks::Looks;
use measure::summed;
use shades::Shades;
use std::time::{Duration, Instant};
use turns::{GrowthOutcome, Turns};

/// Vertices at the most, besides those of the input, at an asked-for error of [`AT`]; half as many at twice the error. At 1 a
/// furnished room of 12,000 triangles ends within its error at 96,000 vertices (mean .41; with a quarter of them 1.1) and a
/// garage of 11,000 at .78 with 93,000 (1.2).
const MOST_VERTICES: f64 = 131_072.0;
const AT: f64 = 0.5;
/// For each vertex of the input so many more, as large rooms have more places where light bends. At 1 a dungeon of 70,000 triangles had
/// 223,657 vertices and a mean of 1.80 without them, 305,630 and 1.00 with them; a restaurant of 104,000 triangles 243,857 and 2.29, which left
/// its floor in folds, 331,246 and 1.45; since edges of shadows come to an end .53 and .98. Rooms of 12,000 triangles end before either limit.
const PER_VERTEX: f64 = 1.0;
/// Never more than this: the dungeon's took 3 kB each, with all that the room itself takes.
const MOST_OF_ALL: f64 = 4_194_304.0;
/// Pictures on the way may be off by this many times the error asked for, but at most by the second number: a black floor
/// below a bright wall is off by 16 on average.
const SKETCH: f64 = 4.0;
const SKETCH_MOST: f64 = 4.0;

/// Where there is no time to look, the mesh grows for this long by the solved light alone. Writing the vertices of a large room
/// takes two to four times as long.
const UNSEEN: Duration = Duration::from_millis(500);

/// What bounds the mesh of the output besides its error.
pub struct Limits<'a> {
    /// Vertices at the most; the input's own are kept in any case. None: as many as the error may need.
    pub vertices: Option<usize>,
    /// Is it time to end? Vertices without a look then show the solved light as it is.
    pub late: &'a (dyn Fn() -> bool + Sync),
}

impl Limits<'_> {
    fn is_late(&self) -> bool {
        (self.late)()
    }
}

impl Default for Limits<'_> {
    fn default() -> Self {
        Self {
            vertices: None,
            late: &|| false,
        }
    }
}

impl Bake {
    /// The mesh of the output with its light, grown until its error between vertices, measured, is within what light at points leaves of the
    /// error asked for, and what light bends by within its share. `progress` is told (done, of) in looks of the present pass.
    pub fn baked(&self, progress: &dyn Fn(usize, usize)) -> Baked {
        self.baked_within(&Limits::default(), progress)
    }

    /// [`Bake::baked`] within limits: where these end growing, with the error reached.
    pub fn baked_within(&self, limits: &Limits, progress: &dyn Fn(usize, usize)) -> Baked {
        let mut growth = self.growth(GatherQuality::Vertex(Effort::default()), limits.late);
        let allowed = self.error_between();
        growth.allowed = allowed[1];
        if let Some(vertices) = limits.vertices {
            (growth.most, growth.strict) = (vertices, true);
        }
        growth.begin(progress);
        if !growth.strict {
            // Vertices of edges on which things stand do not count among those for light: in a restaurant they took all that
            // light may have.
            let used = growth.used();
            growth.most = used + more_vertices(used, self.settings().error);
        }
        if limits.is_late() {
            growth.until = Some(Instant::now() + UNSEEN);
            self.grow_unseen(&mut growth, progress);
        }
        let area = growth.seen_area();
        let mut settled = self.settled(&growth);
        let mut samples = growth.measured(self, &settled, 0, progress);
        let before = summed(&samples, allowed, None);
        growth.noise = before.noise * before.noise;
        let mut turns = Turns::new(area, growth.cells.all.len(), before);
        loop {
            let cells = growth.cells.all.len();
            let end = growth.grow(turns.aim, progress);
            // Where there was no time to grow, the last measurement still holds.
            if end != GrowthOutcome::Late || growth.cells.all.len() != cells {
                growth.look_from_rims(progress);
                settled = self.settled(&growth);
                samples = growth.measured(self, &settled, turns.turn, progress);
            }
            let interpolation = summed(
                &samples,
                allowed,
                (end == GrowthOutcome::Most).then_some(growth.most),
            );
            let ended = (end, limits.is_late());
            if turns.is_over(interpolation, growth.cells.all.len(), ended, growth.sum()) {
                let capped = growth.unfinished(growth.allowed * growth.allowed);
                let layers = growth.of_layers(self, &settled, allowed);
                let mut out = self.write_down(growth, settled);
                out.layers = layers;
                out.capped = if interpolation.is_met() { 0 } else { capped };
                out.interpolation = Some(interpolation);
                return out;
            }
            growth.learn(&samples);
        }
    }

    /// [`Bake::baked`] for pictures on the way: as fine as the solved light tells, with few rays. Vertices of triangles of
    /// the input that no picture shows (`seen[surface][triangle]`) get the light of their leaves as it is.
    ///
    /// # Panics
    /// If `seen` lacks a triangle of the room.
    pub fn sketch(&self, seen: &[Vec<bool>], progress: &dyn Fn(usize, usize)) -> Baked {
        self.sketch_within(seen, &|| false, progress)
    }

    /// [`Bake::sketch`] until it is late: then all other vertices get the light of their leaves, too.
    ///
    /// # Panics
    /// As [`Bake::sketch`].
    pub fn sketch_within(
        &self,
        seen: &[Vec<bool>],
        late: &(dyn Fn() -> bool + Sync),
        progress: &dyn Fn(usize, usize),
    ) -> Baked {
        let mut growth = self.growth(GatherQuality::Preview, late);
        growth.believe(true);
        growth.begin(progress);
        self.grow_unseen(&mut growth, progress);
        let wanted = |triangle: u32| {
            let (surface, local) = self.mesh().origin[triangle as usize];
            seen[surface as usize][local as usize]
        };
        growth.believe(false);
        growth.look_again(wanted, progress);
        let settled = self.settled(&growth);
        self.write_down(growth, settled)
    }

    /// Grows by the solved light, without looking.
    fn grow_unseen(&self, growth: &mut MeshGrowth, progress: &dyn Fn(usize, usize)) {
        growth.believe(true);
        let allowed = (SKETCH * self.settings().error).min(SKETCH_MOST);
        let area: f64 = growth.cells.all.iter().map(|c| c.counted()).sum();
        growth.grow(allowed * allowed * area, progress);
    }

    /// Estimated error of a baked mesh, mean CIEDE2000: for light at points by the last round's estimate, between them as
    /// measured; squares add.
    pub fn error_of(&self, baked: &Baked) -> Option<f64> {
        let light = self.rounds().last()?.error.total_de2000.value?;
        Some(light.hypot(baked.interpolation.map_or(0.0, |i| i.mean)))
    }

    fn growth<'a>(
        &'a self,
        quality: GatherQuality,
        late: &'a (dyn Fn() -> bool + Sync),
    ) -> MeshGrowth<'a> {
        let spaces = self.spaces();
        let mut cells = Cells::new(self.scene(), self.mesh(), self.tree(), &spaces);
        hints::give(self, &mut cells);
        let looks = Looks::new(self, spaces, quality, late);
        MeshGrowth::new(
            cells,
            looks,
            Shades::new(self),
            self.light().white,
            self.mesh().half_size,
        )
    }
}

/// Vertices that a mesh may have besides those of the input, of which there are `first`.
fn more_vertices(first: usize, error: f64) -> usize {
    let most = (MOST_VERTICES + PER_VERTEX * first as f64) * AT / error;
    most.min(MOST_OF_ALL) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_room_may_have_more_vertices_and_none_may_have_any_number() {
        assert_eq!(more_vertices(0, AT), 131_072);
        assert_eq!(more_vertices(0, 2.0 * AT), 65_536);
        assert_eq!(more_vertices(100_000, AT), 231_072);
        assert_eq!(more_vertices(0, 1e-9), MOST_OF_ALL as usize);
        assert_eq!(more_vertices(1_000_000_000, AT), MOST_OF_ALL as usize);
    }
}
