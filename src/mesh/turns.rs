//! Growing and measuring take turns until the error is met; meshes and light maps alike.

use crate::gather::Interpolation;

/// Measurements of the error at the most.
const MEASURED: u64 = 10;
/// Growing ends where this many times the cells leave more than this share of the error.
const GROWN: f64 = 1.5;
const STALLED: f64 = 0.93;
/// The allowed error is a mean; the mean square of the measured error is at least this many times its square: 1.9 in the Cornell box, 2.4 in two
/// rooms, 4 in a flat, 14 in a living room, 20 in a sunlit one.
pub(super) const SQUARE: f64 = 2.0;
/// After a measurement that exceeds what is allowed, growing aims at this part of what the measured error asks for.
const BELOW: f64 = 0.8;
/// And at no less than this part of its last aim.
const STEP: f64 = 0.2;
/// Shares down to this part of the largest are dealt with together, and at least one triangle of so many, which bounds the number of passes. At `--error 1` a
/// garage, a sunlit room, a living room and a gallery of wide spaces end with as many vertices within 3 %, and with mean errors of .39 for .43, .14,
/// .47 for .46 and .33 for .37.
const ALIKE: f64 = 1.0 / 16.0;
const TOGETHER: usize = 32;
/// This many times the excess is dealt with at a time: not everything that is split becomes as good as expected.
pub(crate) const EXCESS: f64 = 1.2;
/// Edges that bend by this share of the worst are split with it.
pub(crate) const BENDS: f64 = 0.5;
/// Looks differ by chance: squares of differences up to this many times what chance makes of them are ignored.
pub(crate) const BY_CHANCE: f64 = 4.0 / 3.0;
/// Until it is looked at, a triangle is expected to err by at least this share of the difference between its corners. When only triangles of the
/// input expected that, light stayed unseen inside their halves: with it for all, and [`SQUARE`], the error of `--error 1` between vertices is .14,
/// .36 and .48 in a sunlit room, a flat and a living room (root mean square .6, .7, 1.8) with 10,700, 3,100 and 71,000 vertices, without .18, .27 and
/// .43 (2.0, .7, 1.7) with 12,100, 3,800 and 79,000.
pub(crate) const RANGE: f64 = 0.1;

/// How growing ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum GrowthOutcome {
    /// The expected error is within the goal.
    Reached,
    /// No remaining cell can be split.
    Smallest,
    /// The limit of vertices is reached.
    Most,
    /// There is no time left.
    Late,
}

/// The state of growing and measuring.
pub(crate) struct Turns {
    /// What the sum of all cells' shares (mean square times area) is to come down to.
    pub(crate) aim: f64,
    /// The number of this turn, from 1.
    pub(crate) turn: u64,
    /// Number of cells and the measurement when there were last [`GROWN`] times as many as before.
    cells: usize,
    before: Interpolation,
}

impl Turns {
    /// Starts with the area that is seen, and the measurement at a number of cells.
    pub(crate) fn new(area: f64, cells: usize, before: Interpolation) -> Self {
        Self {
            aim: SQUARE * before.may_bend * before.may_bend * area,
            turn: 1,
            cells,
            before,
        }
    }

    /// Is growing over, given the measurement after growing to a number of cells? If not, the next turn has a new aim,
    /// below the `sum` of shares that growing believes in.
    pub(crate) fn is_over(
        &mut self,
        found: Interpolation,
        cells: usize,
        (end, is_late): (GrowthOutcome, bool),
        sum: f64,
    ) -> bool {
        let has_grown = cells as f64 > GROWN * self.cells as f64;
        let stalled = self.turn > 1 && has_grown && found.excess() > STALLED * self.before.excess();
        if has_grown {
            (self.cells, self.before) = (cells, found);
        }
        if found.is_met()
            || end != GrowthOutcome::Reached
            || self.turn == MEASURED
            || stalled
            || is_late
        {
            return true;
        }
        let wrong = found.excess().powi(2);
        self.aim = sum.min(self.aim) * (BELOW / wrong).clamp(STEP, BELOW);
        self.turn += 1;
        false
    }
}

/// Cells with the largest shares, of similar size, in descending order; equal ones in their own order.
pub(crate) fn largest(mut shares: Vec<(f64, usize)>) -> Vec<(f64, usize)> {
    let order = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    let largest = shares.iter().map(|s| s.0).fold(0.0, f64::max);
    let alike = shares.iter().filter(|s| s.0 >= ALIKE * largest).count();
    let count = alike.max(shares.len() / TOGETHER);
    if count < shares.len() {
        shares.select_nth_unstable_by(count, order);
        shares.truncate(count);
    }
    shares.sort_unstable_by(order);
    shares
}
