//! Where a point's light comes from, kept so that lamps and paints can be changed without casting a ray.
//!
//! Light is linear: with the patches k that a point gathered and their visible factors w_k frozen,
//! `H(p) = scale sum (w_k + s_k) R_k + sum w_k E_k + sum f_l I_l + share sum n_j R_j` over patches (reflected R, emitted E,
//! slopes s over their siblings), lamps (factor f, intensity I) and the leaves j that n_j of its rays over the hemisphere met. Where leaves are
//! tilted a ray counts as much as the leaf is bright there.
//!
//! Each term of light that came through panes or by way of mirrors is multiplied by what these leave; see [`tinted`].
//!
//! In the packed form ids are sorted and stored as differences in base 128: a patch takes about 6 bytes, a leaf that
//! rays met about 2, if it is tilted about 4.

mod bytes;
mod tinted;

use crate::light::{Light, Passage};
use crate::scene::PunctualLight;
use crate::store::codec::Read;
use bytes::{TraceReader, broken, number};
pub(crate) use tinted::Stains;
use tinted::{Entry, EntryKind, TintedEntries};

/// Rays are written down in these parts, fewer than 2 rays in 3 bytes. A vertex that has nearly all its light by one ray is off by up to half
/// a part, and more of its light if the ray meets a leaf where it is dark: in a furnished room that was relit as it was, one was off by 7e-6 with 65,536
/// parts, by 5e-5 with 8,192; with as few as 64 rays a vertex by 2.3e-5 with 262,144.
const PARTS: f32 = 1_048_576.0;

/// Weights of patches, lamps and rays, as they are gathered.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trace {
    patches: Vec<(u32, f32)>,
    lamps: Vec<(u32, f32)>,
    /// Patches of which only reflected light counts.
    slopes: Vec<(u32, f32)>,
    /// Leaves that rays met, and how bright they are there.
    hits: Vec<(u32, f32)>,
    /// Weight of one ray.
    share: f32,
    /// Final factor of the patches' reflected light.
    scale: f32,
    /// Light that came through panes or by way of mirrors.
    tinted: TintedEntries,
}

impl Trace {
    /// Nothing yet.
    pub(crate) fn new() -> Self {
        Self {
            scale: 1.0,
            ..Self::default()
        }
    }

    /// Adds a patch with its visible factor. `tint`: what is left of the light on its way, for this and the following;
    /// none: all.
    pub(super) fn patch(&mut self, id: u32, seen: f32, tint: Option<&Passage>) {
        self.add(EntryKind::Patch, id, seen, tint);
    }

    /// Adds the emission of a patch with its visible factor.
    pub(super) fn emitted(&mut self, id: u32, seen: f32, tint: Option<&Passage>) {
        self.add(EntryKind::Emitted, id, seen, tint);
    }

    /// Adds a punctual light with the factor from its intensity to irradiance.
    pub(super) fn lamp(&mut self, lamp: usize, factor: f32, tint: Option<&Passage>) {
        self.add(EntryKind::Lamp, lamp as u32, factor, tint);
    }

    /// Adds to (or takes from) the reflected light of a patch.
    pub(super) fn slope(&mut self, id: u32, more: f32, tint: Option<&Passage>) {
        self.add(EntryKind::Slope, id, more, tint);
    }

    /// Adds a ray of weight `share` that met a leaf, which is `bright` there as a share of its mean.
    pub(super) fn hit(&mut self, leaf: u32, share: f32, bright: f32, tint: Option<&Passage>) {
        self.share = share;
        self.add(EntryKind::Hit, leaf, bright, tint);
    }

    /// Adds a ray of weight `share` that met a leaf of a mirror, one mirror too many.
    pub(super) fn mirror(&mut self, leaf: u32, share: f32, tint: &Passage) {
        self.share = share;
        self.add(EntryKind::Mirror, leaf, 1.0, Some(tint));
    }

    fn add(&mut self, kind: EntryKind, id: u32, weight: f32, tint: Option<&Passage>) {
        match tint.map(|tint| &*tint.by).filter(|by| !by.is_empty()) {
            None => self.add_plain(kind, id, weight),
            Some(by) => {
                for (passed, share) in by {
                    let weight = weight * share;
                    match passed.is_empty() {
                        true => self.add_plain(kind, id, weight),
                        false => self.tinted.add(passed, Entry { kind, id, weight }),
                    }
                }
            }
        }
    }

    fn add_plain(&mut self, kind: EntryKind, id: u32, weight: f32) {
        match kind {
            EntryKind::Patch => self.patches.push((id, weight)),
            EntryKind::Emitted => {
                self.patches.push((id, weight));
                self.slopes.push((id, -weight));
            }
            EntryKind::Lamp => self.lamps.push((id, weight)),
            EntryKind::Slope => self.slopes.push((id, weight)),
            EntryKind::Hit => self.hits.push((id, weight)),
            // A ray that ends on a mirror has met others before, so it is never plain.
            EntryKind::Mirror => {}
        }
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
        self.tinted.absorb(&other.tinted, weight);
    }

    /// Multiplies all weights of patches and lamps by `factor`.
    pub(crate) fn times(mut self, factor: f32) -> Self {
        for (_, w) in self.patches.iter_mut().chain(&mut self.lamps) {
            *w *= factor;
        }
        self.tinted.times(factor);
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
        self.hits.sort_by_key(|hit| hit.0);
        let groups = || self.hits.chunk_by(|a, b| a.0 == b.0);
        number(groups().count() as u64, &mut out);
        let mut last = 0;
        for group in groups() {
            let rays: f32 = group.iter().map(|hit| hit.1).sum();
            let parts = (rays * PARTS).round();
            let other = parts != PARTS;
            number(
                u64::from(group[0].0 - last) << 1 | u64::from(other),
                &mut out,
            );
            if other {
                number(parts as u64, &mut out);
            }
            last = group[0].0;
        }
        self.tinted.pack(&mut out);
        out.into_boxed_slice()
    }
}

/// Two packed traces in one: of a point of a diffuse sheet and of the point behind.
pub(crate) fn joined(own: &[u8], behind: &[u8]) -> Box<[u8]> {
    let mut out = Vec::with_capacity(own.len() + behind.len() + 4);
    number(own.len() as u64, &mut out);
    out.extend(own);
    out.extend(behind);
    out.into_boxed_slice()
}

/// The two traces that [`joined`] packed.
///
/// # Errors
/// [`Broken`]: the bytes are not two traces.
pub(crate) fn parted(both: &[u8]) -> Read<[&[u8]; 2]> {
    let mut from = TraceReader { rest: both };
    let own = usize::try_from(from.number()?).unwrap_or(usize::MAX);
    let (own, behind) = from.rest.split_at_checked(own).ok_or_else(broken)?;
    Ok([own, behind])
}

/// Irradiance of a packed trace under a light, `L` lanes wide; `stains` hold the filters of panes and mirrors. Where nothing is reflected yet
/// `light.reflected` may be empty.
///
/// # Errors
/// [`Broken`]: the bytes are not a trace of this room.
pub(crate) fn replay<const L: usize>(
    packed: &[u8],
    light: &Light,
    lamps: &[(PunctualLight, Vec<f32>)],
    stains: &Stains,
) -> Read<[f32; L]> {
    let (reflected, emitted) = (light.reflected.all::<L>(), light.emitted.all::<L>());
    let dark = reflected.is_empty();
    let mut from = TraceReader { rest: packed };
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
        let rays = match word & 1 {
            0 => 1.0,
            _ => from.number()? as f32 / PARTS,
        };
        if id >= emitted.len() as u64 {
            return Err(broken());
        }
        if !dark {
            add(&mut met, &reflected[id as usize], rays);
        }
    }
    let mut sums = tinted::TraceSums {
        bounced,
        straight,
        met,
    };
    tinted::replay(&mut from, light, lamps, stains, &mut sums)?;
    if !from.rest.is_empty() {
        return Err(broken());
    }
    Ok(std::array::from_fn(|l| {
        scale * sums.bounced[l] + sums.straight[l] + share * sums.met[l]
    }))
}

fn add<const L: usize>(sum: &mut [f32; L], row: &[f32; L], w: f32) {
    for l in 0..L {
        sum[l] += w * row[l];
    }
}

/// Weights of the lamps of a packed trace: (lamp, factor), in order, as if panes and mirrors left all light.
///
/// # Errors
/// As [`replay`].
pub(crate) fn lamps_of(packed: &[u8], nodes: usize, lamps: usize) -> Read<Vec<(u32, f32)>> {
    let mut from = TraceReader { rest: packed };
    from.float()?;
    from.weights(nodes, |_, _| {})?;
    let mut list = Vec::new();
    from.weights(lamps, |lamp, w| list.push((lamp as u32, w)))?;
    from.weights(nodes, |_, _| {})?;
    from.float()?;
    for _ in 0..from.number()? {
        if from.number()? & 1 == 1 {
            from.number()?;
        }
    }
    tinted::entries(&mut from, |entry| {
        if let EntryKind::Lamp = entry.kind {
            list.push((entry.id, entry.weight));
        }
        Ok(())
    })?;
    if list.iter().any(|&(lamp, _)| lamp as usize >= lamps) {
        return Err(broken());
    }
    list.sort_by_key(|lamp| lamp.0);
    list.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::passed::Passed;
    use crate::light::{Filters, Rows};
    use crate::scene::{LightKind, Options, Scene};
    use crate::solve::{Bake, Settings};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// The filters of the panes of a room.
    static FILTERS: LazyLock<Filters> = LazyLock::new(|| {
        let room = Scene::load("scenes/glazed.glb", &Options::default()).unwrap();
        let filters = Bake::new(room, Settings::default())
            .solution
            .filters
            .clone();
        assert!(!PASSED[1].is_empty() && filters.knows(&PASSED[1]) && filters.knows(&PASSED[3]));
        filters
    });

    /// Ways past nothing, one pane at two angles, and two panes.
    static PASSED: LazyLock<[Passed; 4]> = LazyLock::new(|| {
        let room = Scene::load("scenes/glazed.glb", &Options::default()).unwrap();
        let [a, b] = [0, 1].map(|k| room.panes[k].material as i32);
        let one = |cosine: i32| [a, 0, 2048, cosine];
        let two = vec![one(77), [b, i32::MIN, 3, 2047]];
        [Vec::new(), vec![one(77)], vec![one(1500)], two]
    });

    fn passage(by: &[(usize, f32)]) -> Passage {
        let by = by.iter().map(|&(k, share)| (PASSED[k].clone(), share));
        Passage {
            by: by.collect(),
            ..Passage::free()
        }
    }

    const NODES: usize = 400;

    fn light() -> (Light, Vec<(PunctualLight, Vec<f32>)>) {
        let mut light = Light {
            reflected: Rows::zero(NODES, 8),
            emitted: Rows::zero(NODES, 8),
            mirrors: Rows::zero(NODES, 8),
            bright_emitted: vec![0.0; NODES],
            ..Light::default()
        };
        for k in 0..NODES {
            for l in 0..8 {
                light.reflected.row_mut(k)[l] = (k + 3 * l) as f32;
                light.emitted.row_mut(k)[l] = (2 * k + l) as f32;
                light.mirrors.row_mut(k)[l] = (k + l) as f32;
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
        /// A packed trace gives the sum that it was made from, in any order.
        #[test]
        fn a_trace_gives_its_sum(
            patches in prop::collection::vec((0..NODES as u32, 0.0_f32..1.0), 0..60),
            lamps in prop::collection::vec((0_u32..3, 0.0_f32..1.0), 0..5),
            slopes in prop::collection::vec((0..NODES as u32, -1.0_f32..1.0), 0..9),
            hits in prop::collection::vec((0..NODES as u32, (0_u8..192).prop_map(|b| f32::from(b) / 64.0)), 0..300),
            scale in 0.5_f32..2.0,
        ) {
            let (light, all) = light();
            let stains = Stains::new(&FILTERS);
            let mut expected = [0.0_f64; 8];
            let mut trace = Trace::new();
            trace.scale(scale);
            for &(id, w) in &patches {
                trace.patch(id, w, None);
                for (l, x) in expected.iter_mut().enumerate() {
                    let k = id as usize;
                    *x += f64::from(w * scale * light.reflected.row(k)[l]);
                    if light.bright_emitted[k] > 0.0 {
                        *x += f64::from(w * light.emitted.row(k)[l]);
                    }
                }
            }
            for &(lamp, w) in &lamps {
                trace.lamp(lamp as usize, w, None);
                for x in &mut expected[..5] {
                    *x += f64::from(w) * f64::from(lamp + 1);
                }
            }
            for &(id, more) in &slopes {
                trace.slope(id, more, None);
                for (l, x) in expected.iter_mut().enumerate() {
                    *x += f64::from(more * scale * light.reflected.row(id as usize)[l]);
                }
            }
            for &(leaf, bright) in &hits {
                trace.hit(leaf, 0.25, bright, None);
                for (l, x) in expected.iter_mut().enumerate() {
                    *x += 0.25 * f64::from(bright * light.reflected.row(leaf as usize)[l]);
                }
            }
            let packed = trace.pack();
            let got = replay::<8>(&packed, &light, &all, &stains).unwrap();
            for (got, want) in got.iter().zip(expected) {
                prop_assert!((f64::from(*got) - want).abs() <= 0.02 + 1e-5 * want.abs(), "{got} {want}");
            }
            // Nothing reflected: only the light of lamps.
            let unlit = Light { reflected: Rows::zero(NODES, 8), ..light.clone() };
            let unknown = Light { reflected: Rows::zero(0, 8), ..light.clone() };
            prop_assert_eq!(replay::<8>(&packed, &unlit, &all, &stains), replay::<8>(&packed, &unknown, &all, &stains));
            let factors = lamps_of(&packed, NODES, 3).unwrap();
            let sum: f32 = factors.iter().map(|f| f.1).sum();
            prop_assert!((sum - lamps.iter().map(|l| l.1).sum::<f32>()).abs() < 1e-5);
            // A room with fewer patches, or a part of the trace, is refused.
            let fewer = Light {
                reflected: Rows::zero(1, 8),
                emitted: Rows::zero(1, 8),
                ..light.clone()
            };
            let named = patches.iter().chain(&slopes).chain(&hits);
            let beyond = named.map(|p| p.0).any(|k| k > 0);
            prop_assert_eq!(replay::<8>(&packed, &fewer, &all, &stains).is_err(), beyond);
            prop_assert!(replay::<8>(&packed[..packed.len() - 1], &light, &all, &stains).is_err());
        }

        /// Light that came past panes is filtered, term by term.
        #[test]
        fn a_trace_knows_what_was_passed(
            terms in prop::collection::vec((0_usize..6, 0..NODES as u32, 0.1_f32..1.0, 1_usize..4, 0.0_f32..1.0), 1..40),
            cut in any::<prop::sample::Index>(),
            flip in any::<u8>(),
        ) {
            let (light, all) = light();
            let stains = Stains::new(&FILTERS);
            let mut trace = Trace::new();
            trace.scale(0.5);
            let mut expected = [0.0_f64; 8];
            for &(kind, id, w, passed, share) in &terms {
                let (k, lamp) = (id as usize, id as usize % 3);
                // A ray takes one way, all other terms are means of several ways.
                let ways = match kind {
                    0 | 1 => vec![(passed, 1.0)],
                    _ => vec![(passed, share), (0, 1.0 - share)],
                };
                let tint = passage(&ways);
                match kind {
                    0 => trace.hit(id, 0.25, w, Some(&tint)),
                    1 => trace.mirror(id, 0.25, &tint),
                    2 => trace.patch(id, w, Some(&tint)),
                    3 => trace.slope(id, w, Some(&tint)),
                    4 => trace.emitted(id, w, Some(&tint)),
                    _ => trace.lamp(lamp, w, Some(&tint)),
                }
                for (l, x) in expected.iter_mut().enumerate() {
                    let left: f32 = ways.iter().map(|&(k, share)| share * FILTERS.of(&PASSED[k])[l]).sum();
                    let emits = light.emitted.row(k)[l] * f32::from(u8::from(light.bright_emitted[k] > 0.0));
                    let brings = match kind {
                        0 => 0.25 * w * light.reflected.row(k)[l],
                        1 => 0.25 * light.mirrors.row(k)[l],
                        2 => w * (0.5 * light.reflected.row(k)[l] + emits),
                        3 => w * 0.5 * light.reflected.row(k)[l],
                        4 => w * emits,
                        _ => w * all[lamp].1.get(l).copied().unwrap_or(0.0),
                    };
                    *x += f64::from(left * brings);
                }
            }
            let packed = trace.pack();
            let got = replay::<8>(&packed, &light, &all, &stains).unwrap();
            for (got, want) in got.iter().zip(expected) {
                prop_assert!((f64::from(*got) - want).abs() <= 0.02 + 1e-5 * want.abs(), "{got} {want}");
            }
            // Lamps count as if panes left all light.
            let lamps: f32 = terms.iter().filter(|t| t.0 == 5).map(|t| t.2).sum();
            let found: f32 = lamps_of(&packed, NODES, 3).unwrap().iter().map(|f| f.1).sum();
            prop_assert!((found - lamps).abs() < 1e-4 * lamps.max(1.0));
            // A part of the bytes is refused, other bytes do no harm, and a room without panes does not know these.
            prop_assert!(replay::<8>(&packed[..packed.len() - 1], &light, &all, &stains).is_err());
            let none = Filters::default();
            prop_assert!(replay::<8>(&packed, &light, &all, &Stains::new(&none)).is_err());
            let mut other = packed.to_vec();
            let at = cut.index(other.len());
            other[at] ^= flip;
            let _ = replay::<8>(&other, &light, &all, &stains);
            let _ = lamps_of(&other, NODES, 3);
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let (light, lamps) = light();
            let _ = replay::<8>(&bytes, &light, &lamps, &Stains::new(&FILTERS));
            let _ = lamps_of(&bytes, NODES, 3);
        }
    }
}
