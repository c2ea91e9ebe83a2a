//! Direct light at leaves: means over points of each.

use crate::light::weighed;
use crate::store::Decoder;
use crate::store::codec::Read;
use crate::team::Packed;
use crate::transport::Memory;
use crate::transport::trace::Trace;

/// A point that sees no front has this small weight, so that a leaf which nobody sees is not without light.
pub(super) const UNSEEN: f32 = 1e-4;

/// A leaf on which a point is this many times as bright as any place was taken to be is uneven, whatever is known of it. Beside a sconce that
/// touches a home theatre's wall, one of a leaf's few points passed for all of it: with one of two seeds 2.8 % of all light in place of .25 %.
/// Points were off by .263 dE00 there, .28 % too bright in the mean; now by .178 and .15 % too dark.
const SURPRISING: f64 = 2.0;

/// Direct light at some leaves, in order.
#[derive(Debug, Default)]
pub(super) struct LeafSamples {
    /// Mean rows.
    pub(super) rows: Vec<f32>,
    /// Half the range of brightness over a leaf's points; if not measured, minus a bound of it.
    pub(super) half_range: Vec<f32>,
    /// Mean brightness of the whole leaf over that of the part others see.
    pub(super) whole: Vec<f32>,
    /// Covariance of brightness with openness, over mean brightness.
    pub(super) with_openness: Vec<f32>,
    /// Where the light comes from, if that is kept.
    pub(super) traces: Vec<Option<Box<[u8]>>>,
    pub(super) rays: u64,
}

impl Packed for LeafSamples {
    fn pack(&self, to: &mut Vec<u8>) {
        self.rows.pack(to);
        self.half_range.pack(to);
        self.whole.pack(to);
        self.with_openness.pack(to);
        self.traces.pack(to);
        self.rays.pack(to);
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok(Self {
            rows: Packed::unpack(from)?,
            half_range: Packed::unpack(from)?,
            whole: Packed::unpack(from)?,
            with_openness: Packed::unpack(from)?,
            traces: Packed::unpack(from)?,
            rays: from.get()?,
        })
    }
}

/// Direct light at points of a leaf, summed up.
pub(super) struct Mean {
    row: [f32; 64],
    pub(super) total: f32,
    /// Range of brightness, and the sums of it with weights and without.
    range: [f64; 2],
    pub(super) bright: [f64; 2],
    /// Sums of the weights of what goes far, and of brightness with them.
    far: [f64; 2],
    pub(super) points: usize,
    /// Over open points: their number, and sums of brightness, its square and the variance due to rays to lamps.
    open: [f64; 4],
    trace: Option<Trace>,
    /// Half the range of brightness, see `Direct`.
    pub(super) half_range: f64,
}

impl Mean {
    pub(super) fn new() -> Self {
        Self {
            row: [0.0; 64],
            total: 0.0,
            range: [f64::INFINITY, 0.0],
            bright: [0.0; 2],
            far: [0.0; 2],
            points: 0,
            open: [0.0; 4],
            trace: None,
            half_range: 0.0,
        }
    }

    /// Adds a point: the weight of all that it sees, and of what lies further away than close by.
    pub(super) fn add(
        &mut self,
        row: &[f32; 64],
        [weight, far]: [f32; 2],
        weights: &[f64],
        memory: &mut Memory,
    ) {
        self.total += weight;
        self.points += 1;
        if let Some(trace) = memory.trace.take() {
            self.trace
                .get_or_insert_with(Trace::new)
                .absorb(&trace, weight);
        }
        for (sum, x) in self.row[..weights.len()].iter_mut().zip(row) {
            *sum += weight * x;
        }
        let bright = weighed(row, weights);
        if weight > UNSEEN {
            self.range = [self.range[0].min(bright), self.range[1].max(bright)];
            let more = [1.0, bright, bright * bright, memory.noise];
            self.open = std::array::from_fn(|k| self.open[k] + more[k]);
        }
        let far = f64::from(far);
        self.far = [self.far[0] + far, self.far[1] + far * bright];
        self.bright = [
            self.bright[0] + f64::from(weight) * bright,
            self.bright[1] + bright,
        ];
    }

    /// Half the range of brightness.
    pub(super) fn half_range(&self) -> f64 {
        0.5 * (self.range[1] - self.range[0]).max(0.0)
    }

    /// With half a range of brightness as it is `known`, on a leaf of which no place was taken to be brighter than `most`: see [`SURPRISING`].
    pub(super) fn ranging(mut self, known: f64, most: f64) -> Self {
        let brightest = self.range[1];
        self.half_range = match brightest > SURPRISING * most {
            true => 0.5 * brightest,
            false => known,
        };
        self
    }

    /// Variance of brightness between open points, without the noise of rays.
    pub(super) fn variance(&self) -> f64 {
        let [n, sum, squares, noise] = self.open;
        if n < 2.0 {
            return 0.0;
        }
        ((squares - sum * sum / n) / (n - 1.0) - noise / n).max(0.0)
    }

    /// Appends the means to `found`.
    pub(super) fn end(self, found: &mut LeafSamples, width: usize) {
        let share = if self.total > 0.0 {
            1.0 / self.total
        } else {
            0.0
        };
        let row = &self.row[..width];
        found.rows.extend(row.iter().map(|x| x * share));
        found.half_range.push(self.half_range as f32);
        let seen = self.bright[0] * f64::from(share);
        let all = self.bright[1] / self.points.max(1) as f64;
        found
            .whole
            .push(if seen > 0.0 { (all / seen) as f32 } else { 1.0 });
        let total = f64::from(self.total) * self.bright[0];
        found.with_openness.push(if total > 0.0 {
            (self.far[1] / self.bright[0] - self.far[0] / f64::from(self.total)) as f32
        } else {
            0.0
        });
        let trace = self.trace.map(|trace| trace.times(share).pack());
        found.traces.push(trace);
    }
}
