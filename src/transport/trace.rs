//! What a point gets its light from, kept so that lamps and paints can be changed without casting a ray.
//!
//! Light is linear: with the patches k that a point gathered and their visible factors w_k frozen,
//! `H(p) = scale sum (w_k + s_k) R_k + sum w_k E_k + sum f_l I_l + share sum n_j R_j` over patches (reflected R, emitted E,
//! slopes s over their siblings), lamps (factor f, intensity I) and the leaves j that n_j of its rays over the hemisphere met.
//!
//! Packed, ids stand sorted as differences in base 128: a patch takes about 6 bytes, a leaf that rays met about 2.

use crate::light::Light;
use crate::scene::PunctualLight;
use crate::store::Broken;
use crate::store::codec::Read;

/// Weights of patches, lamps and rays, as they are gathered.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trace {
    patches: Vec<(u32, f32)>,
    lamps: Vec<(u32, f32)>,
    /// Patches of which only reflected light counts.
    slopes: Vec<(u32, f32)>,
    hits: Vec<u32>,
    /// What one ray carries.
    share: f32,
    /// What reflected light of patches is multiplied by at last.
    scale: f32,
}

impl Trace {
    /// Nothing yet.
    pub(crate) fn new() -> Self {
        Self {
            scale: 1.0,
            ..Self::default()
        }
    }

    /// A patch with its visible factor.
    pub(super) fn patch(&mut self, id: u32, seen: f32) {
        self.patches.push((id, seen));
    }

    /// A punctual light with what turns its intensity into irradiance.
    pub(super) fn lamp(&mut self, lamp: usize, factor: f32) {
        self.lamps.push((lamp as u32, factor));
    }

    /// More (or less) of what a patch reflects.
    pub(super) fn slope(&mut self, id: u32, more: f32) {
        self.slopes.push((id, more));
    }

    /// A ray that carries `share` met a leaf.
    pub(super) fn hit(&mut self, leaf: u32, share: f32) {
        self.hits.push(leaf);
        self.share = share;
    }

    /// Reflected light of patches is multiplied by this.
    pub(super) fn scale(&mut self, scale: f32) {
        self.scale = scale;
    }

    /// Adds `weight` times the patches and lamps of another point.
    pub(crate) fn absorb(&mut self, other: &Self, weight: f32) {
        let times = |&(id, w): &(u32, f32)| (id, weight * w);
        self.patches.extend(other.patches.iter().map(times));
        self.lamps.extend(other.lamps.iter().map(times));
    }

    /// All weights of patches and lamps times `factor`.
    pub(crate) fn times(mut self, factor: f32) -> Self {
        for (_, w) in self.patches.iter_mut().chain(&mut self.lamps) {
            *w *= factor;
        }
        self
    }

    /// As bytes.
    pub(crate) fn pack(mut self) -> Box<[u8]> {
        let mut out = Vec::with_capacity(16 + 6 * self.patches.len() + 2 * self.hits.len());
        out.extend(self.scale.to_le_bytes());
        for list in [&mut self.patches, &mut self.lamps, &mut self.slopes] {
            // Stable, so that sums do not depend on the sort.
            list.sort_by_key(|e| e.0);
            list.dedup_by(|next, kept| {
                let same = next.0 == kept.0;
                if same {
                    kept.1 += next.1;
                }
                same
            });
            number(list.len() as u64, &mut out);
            let mut last = 0;
            for &(id, weight) in &*list {
                number(u64::from(id - last), &mut out);
                out.extend(weight.to_le_bytes());
                last = id;
            }
        }
        out.extend(self.share.to_le_bytes());
        self.hits.sort_unstable();
        let groups = || self.hits.chunk_by(|a, b| a == b);
        number(groups().count() as u64, &mut out);
        let mut last = 0;
        for group in groups() {
            let more = group.len() > 1;
            number(u64::from(group[0] - last) << 1 | u64::from(more), &mut out);
            if more {
                number(group.len() as u64, &mut out);
            }
            last = group[0];
        }
        out.into_boxed_slice()
    }
}

/// A number in base 128, least digits first; the high bit says that more follow.
fn number(mut x: u64, out: &mut Vec<u8>) {
    while x >= 128 {
        out.push(x as u8 | 128);
        x >>= 7;
    }
    out.push(x as u8);
}

/// A packed trace being read.
struct Packed<'a> {
    rest: &'a [u8],
}

impl Packed<'_> {
    #[inline]
    fn number(&mut self) -> Read<u64> {
        // Nearly all differences take one byte or two.
        match *self.rest {
            [a @ 0..128, ref rest @ ..] => {
                self.rest = rest;
                Ok(a.into())
            }
            [a, b @ 0..128, ref rest @ ..] => {
                self.rest = rest;
                Ok(u64::from(b) << 7 | u64::from(a & 127))
            }
            _ => self.long_number(),
        }
    }

    #[cold]
    fn long_number(&mut self) -> Read<u64> {
        let mut x = 0;
        for (k, &byte) in self.rest.iter().enumerate().take(9) {
            x |= u64::from(byte & 127) << (7 * k);
            if byte < 128 {
                self.rest = &self.rest[k + 1..];
                return Ok(x);
            }
        }
        Err(broken())
    }

    fn float(&mut self) -> Read<f32> {
        let (bytes, rest) = self.rest.split_first_chunk::<4>().ok_or_else(broken)?;
        self.rest = rest;
        Ok(f32::from_le_bytes(*bytes))
    }

    /// Calls `each` with the ids (below `end`) and weights of a list.
    fn weights(&mut self, end: usize, mut each: impl FnMut(usize, f32)) -> Read<()> {
        let mut id = 0;
        for _ in 0..self.number()? {
            id += self.number()?;
            if id >= end as u64 {
                return Err(broken());
            }
            each(id as usize, self.float()?);
        }
        Ok(())
    }
}

fn broken() -> Broken {
    Broken::new("has weights that do not read")
}

/// Two packed traces as one: of a point of a diffuse sheet and of the point behind it.
pub(crate) fn joined(own: &[u8], behind: &[u8]) -> Box<[u8]> {
    let mut out = Vec::with_capacity(own.len() + behind.len() + 4);
    number(own.len() as u64, &mut out);
    out.extend(own);
    out.extend(behind);
    out.into_boxed_slice()
}

/// The two of [`joined`].
///
/// # Errors
/// [`Broken`]: the bytes are no two traces.
pub(crate) fn parted(both: &[u8]) -> Read<[&[u8]; 2]> {
    let mut from = Packed { rest: both };
    let own = usize::try_from(from.number()?).unwrap_or(usize::MAX);
    let (own, behind) = from.rest.split_at_checked(own).ok_or_else(broken)?;
    Ok([own, behind])
}

/// Irradiance of a packed trace under a light, `L` lanes wide. Where nothing is reflected yet `light.reflected` may be empty.
///
/// # Errors
/// [`Broken`]: the bytes are no trace of this room.
pub(crate) fn replay<const L: usize>(
    packed: &[u8],
    light: &Light,
    lamps: &[(PunctualLight, Vec<f32>)],
) -> Read<[f32; L]> {
    let (reflected, emitted) = (light.reflected.all::<L>(), light.emitted.all::<L>());
    let dark = reflected.is_empty();
    let mut from = Packed { rest: packed };
    let scale = from.float()?;
    let (mut bounced, mut straight) = ([0.0_f32; L], [0.0_f32; L]);
    from.weights(emitted.len(), |id, w| {
        if !dark {
            add(&mut bounced, &reflected[id], w);
        }
        if light.bright_emitted[id] > 0.0 {
            add(&mut straight, &emitted[id], w);
        }
    })?;
    from.weights(lamps.len(), |lamp, w| {
        for (x, r) in straight.iter_mut().zip(&lamps[lamp].1) {
            *x += w * r;
        }
    })?;
    from.weights(emitted.len(), |id, w| {
        if !dark {
            add(&mut bounced, &reflected[id], w);
        }
    })?;
    let share = from.float()?;
    let mut met = [0.0_f32; L];
    let mut id = 0;
    for _ in 0..from.number()? {
        let word = from.number()?;
        id += word >> 1;
        let count = if word & 1 == 1 { from.number()? } else { 1 };
        if id >= emitted.len() as u64 {
            return Err(broken());
        }
        if !dark {
            add(&mut met, &reflected[id as usize], count as f32);
        }
    }
    if !from.rest.is_empty() {
        return Err(broken());
    }
    Ok(std::array::from_fn(|l| {
        scale * bounced[l] + straight[l] + share * met[l]
    }))
}

fn add<const L: usize>(sum: &mut [f32; L], row: &[f32; L], w: f32) {
    for l in 0..L {
        sum[l] += w * row[l];
    }
}

/// Weights of the lamps of a packed trace: (lamp, factor), in order.
///
/// # Errors
/// As [`replay`].
pub(crate) fn lamps_of(packed: &[u8], nodes: usize, lamps: usize) -> Read<Vec<(u32, f32)>> {
    let mut from = Packed { rest: packed };
    from.float()?;
    from.weights(nodes, |_, _| {})?;
    let mut list = Vec::new();
    from.weights(lamps, |lamp, w| list.push((lamp as u32, w)))?;
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Rows;
    use crate::scene::LightKind;
    use proptest::prelude::*;

    const NODES: usize = 400;

    fn light() -> (Light, Vec<(PunctualLight, Vec<f32>)>) {
        let mut light = Light {
            reflected: Rows::zero(NODES, 8),
            emitted: Rows::zero(NODES, 8),
            bright_emitted: vec![0.0; NODES],
            ..Light::default()
        };
        for k in 0..NODES {
            for l in 0..8 {
                light.reflected.row_mut(k)[l] = (k + 3 * l) as f32;
                light.emitted.row_mut(k)[l] = (2 * k + l) as f32;
            }
            light.bright_emitted[k] = (k % 3) as f32;
        }
        let lamp = |k: usize| {
            let lamp = PunctualLight {
                name: String::new(),
                kind: LightKind::Point,
                node: None,
                position: glam::DVec3::ZERO,
                direction: glam::DVec3::X,
                light: 0,
                shape: [0.0; 64],
                luminaire: None,
            };
            (lamp, vec![k as f32; 5])
        };
        (light, (1..4).map(lamp).collect())
    }

    proptest! {
        /// A packed trace gives the sum that it was made of, in any order.
        #[test]
        fn a_trace_gives_its_sum(
            patches in prop::collection::vec((0..NODES as u32, 0.0_f32..1.0), 0..60),
            lamps in prop::collection::vec((0_u32..3, 0.0_f32..1.0), 0..5),
            slopes in prop::collection::vec((0..NODES as u32, -1.0_f32..1.0), 0..9),
            hits in prop::collection::vec(0..NODES as u32, 0..300),
            scale in 0.5_f32..2.0,
        ) {
            let (light, all) = light();
            let mut expected = [0.0_f64; 8];
            let mut trace = Trace::new();
            trace.scale(scale);
            for &(id, w) in &patches {
                trace.patch(id, w);
                for (l, x) in expected.iter_mut().enumerate() {
                    let k = id as usize;
                    *x += f64::from(w * scale * light.reflected.row(k)[l]);
                    if light.bright_emitted[k] > 0.0 {
                        *x += f64::from(w * light.emitted.row(k)[l]);
                    }
                }
            }
            for &(lamp, w) in &lamps {
                trace.lamp(lamp as usize, w);
                for x in &mut expected[..5] {
                    *x += f64::from(w) * f64::from(lamp + 1);
                }
            }
            for &(id, more) in &slopes {
                trace.slope(id, more);
                for (l, x) in expected.iter_mut().enumerate() {
                    *x += f64::from(more * scale * light.reflected.row(id as usize)[l]);
                }
            }
            for &leaf in &hits {
                trace.hit(leaf, 0.25);
                for (l, x) in expected.iter_mut().enumerate() {
                    *x += 0.25 * f64::from(light.reflected.row(leaf as usize)[l]);
                }
            }
            let packed = trace.pack();
            let got = replay::<8>(&packed, &light, &all).unwrap();
            for (got, want) in got.iter().zip(expected) {
                prop_assert!((f64::from(*got) - want).abs() <= 0.02 + 1e-5 * want.abs(), "{got} {want}");
            }
            // Nothing reflected: what comes from lamps alone.
            let unlit = Light { reflected: Rows::zero(NODES, 8), ..light.clone() };
            let unknown = Light { reflected: Rows::zero(0, 8), ..light.clone() };
            prop_assert_eq!(replay::<8>(&packed, &unlit, &all), replay::<8>(&packed, &unknown, &all));
            let factors = lamps_of(&packed, NODES, 3).unwrap();
            let sum: f32 = factors.iter().map(|f| f.1).sum();
            prop_assert!((sum - lamps.iter().map(|l| l.1).sum::<f32>()).abs() < 1e-5);
            // A room with fewer patches, or a part of the trace, is refused.
            let fewer = Light {
                reflected: Rows::zero(1, 8),
                emitted: Rows::zero(1, 8),
                ..light.clone()
            };
            let both = patches.iter().chain(&slopes).map(|p| p.0);
            let beyond = both.chain(hits.iter().copied()).any(|k| k > 0);
            prop_assert_eq!(replay::<8>(&packed, &fewer, &all).is_err(), beyond);
            prop_assert!(replay::<8>(&packed[..packed.len() - 1], &light, &all).is_err());
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let (light, lamps) = light();
            let _ = replay::<8>(&bytes, &light, &lamps);
            let _ = lamps_of(&bytes, NODES, 3);
        }
    }
}
