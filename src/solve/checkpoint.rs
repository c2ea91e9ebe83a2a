//! Writing a bake between two rounds to a file, and resuming it.
//!
//! A checkpoint holds what the room does not give without rays: which elements were split (in order, so that the hierarchy grows again node by
//! node), the links with their blockers, the lanes, how leaves look out and where their rays end, balance, light and direct light of the
//! leaves, the light at the watched points, and the records. A bake that is resumed ends with the same bytes as one that was never stopped; so
//! a checkpoint is refused unless room, settings and program are the same, and the message names what changed.
//!
//! Bytes: 4 a split, 22 a link and 4 for each of its blockers, 12 a node (16 and 8 a ray where leaves look for themselves, 12 in rooms with panes or mirrors),
//! `4 (2 padded lanes + lanes) + 4` a leaf; a cache for relighting has 4 (8) a ray and `4 padded lanes` a leaf: the rest follows from where light comes from.

use super::leaf_rays::LeafRays;
use super::sources::Sources;
use super::{Bake, NOBODY, Representation, direct};
use crate::error::{Error, Result};
use crate::hierarchy::{NONE, Tree};
use crate::light::lanes::{self, Lanes};
use crate::light::{Filters, Light, Neighbours, Rows, Through, padded};
use crate::link::{Graph, Link, MAX_DEPTH, Occlusion, RowBalance};
use crate::spectrum::BANDS;
use crate::store::codec::Read;
use crate::store::{Broken, Decoder, Encoder, FileKind, Fingerprint, Packs, container};
use std::borrow::Cow;
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

/// Ways in a file: clear, crowded, and then lists by their length.
const CLEAR: u16 = 0;
const CROWDED: u16 = 1;
const LISTED: u16 = 2;

impl Bake {
    /// Writes a checkpoint (the first rank alone does). Returns its size in bytes, 0 on other ranks.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<u64> {
        let print = self.fingerprint();
        let body = |out: &mut Encoder| {
            print.encode(out)?;
            self.encode_state(true, out)?;
            out.put_all(&self.solution.seen)?;
            out.put(self.elapsed().as_secs_f64())
        };
        match self.room.team.is_first() {
            true => container::write(path, FileKind::Checkpoint, body),
            false => container::unwritten(path, body).map(|()| 0),
        }
    }

    /// Resumes from a checkpoint: this bake, which has done no round, goes on where the saved one stood.
    ///
    /// # Errors
    /// The file cannot be read, is not one of ours, is damaged, or belongs to another room or other settings.
    pub fn resume(&mut self, path: &Path) -> Result<()> {
        let now = self.fingerprint();
        let mut changed = None;
        container::read(path, FileKind::Checkpoint, |from| {
            changed = Fingerprint::decode(from)?.change(&now);
            if changed.is_some() {
                // The rest belongs to something else.
                from.skip();
                return Ok(());
            }
            let (reflected, traces) = self.decode_state(true, from)?;
            self.light_up(&reflected);
            self.light_arrives();
            self.refinement
                .direct
                .keep(&self.solution.light.leaves, traces.to_vec()?);
            self.solution.light.neighbours =
                Neighbours::new(self.refinement.tree.nodes.len(), &self.refinement.graph);
            let seen: Vec<[f64; 3]> = from.get_all()?;
            if !seen.is_empty() && seen.len() != self.watched_gathers() {
                return Err(Broken::new("has another number of watched points"));
            }
            self.solution.seen = seen;
            let elapsed: f64 = from.get()?;
            let elapsed = Duration::try_from_secs_f64(elapsed)
                .map_err(|_| Broken::new("has been worked on for no time"))?;
            if let Some(started) = Instant::now().checked_sub(elapsed) {
                self.started = started;
            }
            Ok(())
        })?;
        match changed {
            None => Ok(()),
            Some(what) => Err(Error::input(
                path.display().to_string(),
                format!("belongs to another bake: {what}"),
                FileKind::Checkpoint.next(),
            )),
        }
    }

    /// What panes and mirrors leave of light; none in a room without them.
    fn filtered(&self) -> Option<&Filters> {
        let any = self.room.panes.is_some() || self.room.mirrors.is_some();
        any.then_some(&self.solution.filters)
    }

    /// Everything that the result depends on.
    fn fingerprint(&self) -> Fingerprint {
        let mut print = Fingerprint::default();
        print.set_text("program", crate::PROGRAM);
        print.set("--cache", &[u8::from(self.room.keep)]);
        print.set("error asked for", &[self.room.settings.error]);
        print.set("seed", &[self.room.settings.seed]);
        let representation = format!("{:?}", self.room.settings.representation);
        print.set_text("representation", &representation);
        print.set(
            "share of spectra",
            &[self.room.settings.spectrum.unwrap_or(f64::NAN)],
        );
        print.set("white", &self.room.settings.white.unwrap_or([f64::NAN; 3]));
        print.extend(Fingerprint::shape(&self.room.scene));
        print.extend(Fingerprint::paint(&self.room.scene));
        print
    }

    fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Writes hierarchy, links and the last solution; `whole`: with what further rounds need.
    pub(crate) fn encode_state(&self, whole: bool, out: &mut Encoder) -> io::Result<()> {
        out.put_all(&splits(&self.refinement.tree))?;
        encode_graph(&self.refinement.graph, out)?;
        // Lanes that are not intervals follow from the room.
        let intervals = self.solution.lanes.lanes();
        out.put_list(
            intervals.len(),
            intervals.iter().map(|l| {
                let light = l.light.map_or(u32::MAX, |light| light as u32);
                [light, l.first as u32, l.count as u32]
            }),
        )?;
        out.put(self.solution.spectrum_error.unwrap_or(f64::NAN))?;
        out.put(self.solution.light.white)?;
        self.refinement
            .leaf_rays
            .encode(whole, self.filtered(), out)?;
        out.put_all(&self.refinement.balance.factor)?;
        out.put([
            self.refinement.balance.defect_before,
            self.refinement.balance.defect_after,
        ])?;
        out.put(self.refinement.balance.limited as u64)?;
        let leaves = &self.solution.light.leaves;
        let (reflected, irradiance) = (
            &self.solution.light.reflected,
            &self.solution.light.irradiance,
        );
        // The light by which rays take mirrors for matt surfaces is kept apart.
        let row = |&leaf: &u32| match self.is_mirror(leaf) {
            true => self.solution.light.mirrors.row(leaf as usize),
            false => reflected.row(leaf as usize),
        };
        out.put_list(
            leaves.len() * reflected.width(),
            leaves.iter().flat_map(row).copied(),
        )?;
        if whole {
            put_rows(irradiance, out)?;
            put_rows(&self.solution.light.through.met, out)?;
            out.put_list(
                leaves.len() * self.solution.lanes.len(),
                leaves
                    .iter()
                    .flat_map(|&k| self.refinement.direct.row(k).iter().copied()),
            )?;
            out.put_list(
                leaves.len(),
                leaves.iter().map(|&k| self.refinement.direct.figures(k)),
            )?;
        }
        out.put(self.refinement.direct.rays)?;
        let traces: Vec<_> = leaves
            .iter()
            .map(|&k| self.refinement.direct.trace(k))
            .collect();
        Packs::encode(&traces, out)?;
        for round in &self.solution.watched {
            let traces: Vec<_> = round.iter().map(Option::as_deref).collect();
            Packs::encode(&traces, out)?;
        }
        let rounds = serde_json::to_string(&self.rounds).map_err(io::Error::other)?;
        out.put_text(&rounds)
    }

    /// Reads lanes and their error. Returns whether lamps are gone since, and how many lanes were written.
    fn take_up_lanes(&mut self, whole: bool, from: &mut Decoder) -> Read<(bool, usize)> {
        let (lanes, written) = self.read_lanes(whole, from)?;
        let gone = lanes.len() < written;
        self.solution.lanes = match self.room.settings.representation {
            Representation::Rgb | Representation::Characteristic(_) if lanes.is_empty() => {
                self.chosen_lanes().expect(NOBODY)
            }
            _ if lanes.is_empty() && !gone => return Err(Broken::new("has no lanes")),
            _ if lanes.is_empty() => Lanes::dense(&self.room.scene.spectra, &self.room.weights),
            _ => self.guided(Lanes::with(
                lanes,
                &self.room.scene.spectra,
                &self.room.weights,
            )),
        };
        self.solution.list_limit = self.list_limit();
        self.solution.filters = Filters::new(&self.room.scene, &self.solution.lanes);
        let error: f64 = from.get()?;
        self.solution.spectrum_error = (!error.is_nan()).then_some(error);
        Ok((
            gone,
            if gone {
                written
            } else {
                self.solution.lanes.len()
            },
        ))
    }

    /// Reads what [`Self::encode_state`] wrote, except for the light beyond `light.irradiance` (if `whole`) and `light.leaves`. Returns
    /// what the leaves reflect, and where the direct light of each leaf comes from, if kept. If lamps are gone since, what leaves reflect
    /// is unknown.
    pub(crate) fn decode_state(&mut self, whole: bool, from: &mut Decoder) -> Read<(Rows, Packs)> {
        let splits = from.get_list::<u32>()?;
        self.refinement.tree.nodes.reserve(4 * splits.len());
        self.refinement.tree.elements.reserve(4 * splits.len());
        for id in splits {
            split(&mut self.refinement.tree, id)?;
        }
        let nodes = self.refinement.tree.nodes.len();
        self.refinement.graph = decode_graph(nodes, self.room.mesh.triangles.len(), from)?;
        let (gone, kept) = self.take_up_lanes(whole, from)?;
        let white = from.get()?;
        self.refinement.leaf_rays = LeafRays::decode(
            &self.refinement.tree,
            self.room.team,
            whole,
            self.filtered(),
            from,
        )?;
        let factor: Vec<f32> = from.get_all()?;
        // Where leaves look for themselves nothing is balanced.
        let by_rays = self.room.by_rays();
        let wanted = if by_rays { 0 } else { nodes };
        if factor.len() != wanted || self.refinement.leaf_rays.looks() != by_rays {
            return Err(Broken::new("does not know what its leaves see"));
        }
        let [defect_before, defect_after] = from.get()?;
        self.refinement.balance = RowBalance {
            factor,
            defect_before,
            defect_after,
            limited: from.get::<u64>()? as usize,
        };
        self.refinement.areas = self.refinement.leaf_rays.areas(&self.refinement.tree);
        let leaves: Vec<u32> = self.refinement.leaves();
        let (count, width) = (leaves.len(), padded(kept));
        let mut reflected = rows(from, count, width)?;
        if gone {
            reflected = Rows::default();
        }
        let (mut irradiance, mut through) = (Rows::default(), Through::default());
        if whole {
            irradiance = rows(from, count, width)?;
            let tree = &self.refinement.tree;
            let of_sheets = leaves.iter().filter(|&&leaf| tree.behind(leaf) != NONE);
            through.met = rows(from, of_sheets.count(), width)?;
            let lanes = self.solution.lanes.len();
            let known: Vec<f32> = from.get_exactly(count * lanes)?;
            let figures: Vec<[f32; 3]> = from.get_exactly(count)?;
            self.refinement.direct = direct::Direct::known(&leaves, nodes, lanes, &known, &figures);
        }
        self.refinement.direct.rays = from.get()?;
        let traces = Packs::decode(from)?;
        for round in &mut self.solution.watched {
            *round = Packs::decode(from)?.to_vec()?;
        }
        if traces.len() != count {
            return Err(Broken::new("has another number of leaves"));
        }
        self.rounds = serde_json::from_str(&from.get_text()?)
            .map_err(|problem| Broken::new(format!("has records that do not read: {problem}")))?;
        self.solution.light = Light {
            irradiance,
            leaves,
            white,
            through,
            tilts: self.refinement.leaf_rays.tilts.clone(),
            ..Light::default()
        };
        Ok((reflected, traces))
    }

    /// Reads the lanes. Returns those whose lamps are still there, and how many were written.
    fn read_lanes(&self, whole: bool, from: &mut Decoder) -> Read<(Vec<lanes::Lane>, usize)> {
        let mut lanes = from
            .get_all::<[u32; 3]>()?
            .into_iter()
            .map(lane_of)
            .collect::<Read<Vec<lanes::Lane>>>()?;
        let written = lanes.len();
        if written > BANDS {
            return Err(Broken::new("has an impossible number of lanes"));
        }
        let there =
            |lane: &lanes::Lane| lane.light.is_none_or(|k| k < self.room.scene.spectra.len());
        if whole && !lanes.iter().all(there) {
            return Err(Broken::new("has lanes of light that is not there"));
        }
        // Lamps may have gone since the file was written.
        lanes.retain(there);
        Ok((lanes, written))
    }

    /// Finds the last solution again from what the leaves reflect.
    pub(crate) fn light_up(&mut self, reflected: &Rows) {
        match reflected.width() {
            4 => self.light_up_lanes::<4>(reflected),
            8 => self.light_up_lanes::<8>(reflected),
            16 => self.light_up_lanes::<16>(reflected),
            32 => self.light_up_lanes::<32>(reflected),
            _ => self.light_up_lanes::<64>(reflected),
        }
    }

    fn light_up_lanes<const L: usize>(&mut self, reflected: &Rows) {
        let mut light = std::mem::take(&mut self.solution.light);
        let painter = self.room.painter();
        let Sources {
            emission, sheets, ..
        } = painter.paint(&self.refinement.tree, &light.leaves, &self.solution.lanes);
        let met = std::mem::take(&mut light.through.met);
        light.through = sheets.map_or_else(Through::default, |sheets| sheets.shown);
        light.through.met = met;
        let on_nodes = self.refinement.on_nodes::<L>(reflected, &light.leaves);
        light.reflected =
            self.without_mirrors::<L>(Cow::Borrowed(reflected), on_nodes, &light.leaves);
        light.mirrors = std::mem::take(&mut self.solution.light.mirrors);
        light.emitted = self.refinement.on_nodes::<L>(&emission, &light.leaves);
        light.apart = self.solution.lanes.excites().is_some();
        light.measure(&self.refinement.tree, &self.room.mesh, &self.solution.lanes);
        self.solution.light = light;
        self.solution.light_lamps(&self.room);
    }
}

/// Elements that were split, in the order of splitting.
fn splits(tree: &Tree) -> Vec<u32> {
    // An element on the other side of a sheet is split together with its counterpart.
    let leads = |k: u32| match tree.behind(k) {
        NONE => true,
        behind => tree.node(k).child < tree.node(behind).child,
    };
    let mut split: Vec<u32> = (0..tree.nodes.len() as u32)
        .filter(|&k| tree.node(k).element != NONE && !tree.node(k).is_leaf() && leads(k))
        // Elements split because only a part of them counts are split anyway.
        .filter(|&k| tree.node(k).child >= tree.known)
        .collect();
    split.sort_unstable_by_key(|&k| tree.node(k).child);
    split
}

fn split(tree: &mut Tree, id: u32) -> Read<()> {
    let possible = tree.nodes.get(id as usize).is_some_and(|node| {
        node.is_leaf()
            && tree
                .element(node)
                .is_some_and(|element| element.depth < MAX_DEPTH)
    });
    if !possible {
        return Err(Broken::new("splits an element that cannot be split"));
    }
    tree.subdivide(id);
    Ok(())
}

fn encode_graph(graph: &Graph, out: &mut Encoder) -> io::Result<()> {
    let links = &graph.links;
    out.put_list(links.len(), links.iter().map(|l| [l.a, l.b]))?;
    out.put_list(
        links.len(),
        links
            .iter()
            .map(|l| [l.exchange, l.open_exchange, l.variation]),
    )?;
    out.put_list(
        links.len(),
        links.iter().map(|l| match l.occlusion {
            Occlusion::Clear => CLEAR,
            Occlusion::Crowded => CROWDED,
            Occlusion::Listed { count, .. } => LISTED + u16::from(count),
        }),
    )?;
    let starts: Vec<u32> = links
        .iter()
        .filter_map(|l| match l.occlusion {
            Occlusion::Listed { start, .. } => Some(start),
            _ => None,
        })
        .collect();
    out.put_all(&starts)?;
    out.put_all(&graph.blockers)
}

fn decode_graph(nodes: usize, triangles: usize, from: &mut Decoder) -> Read<Graph> {
    let ends = from.get_list::<[u32; 2]>()?;
    let figures = from.get_list::<[f32; 3]>()?;
    let occlusions = from.get_list::<u16>()?;
    if figures.len() != ends.len() || occlusions.len() != ends.len() {
        return Err(Broken::new("has links in parts that do not fit"));
    }
    let mut starts = from.get_list::<u32>()?;
    let blockers: Vec<u32> = from.get_all()?;
    if blockers.iter().any(|&t| t as usize >= triangles) {
        return Err(Broken::new("lists a triangle that does not exist"));
    }
    let mut links = Vec::with_capacity(ends.len());
    for (([a, b], [exchange, open_exchange, variation]), code) in ends.zip(figures).zip(occlusions)
    {
        if a as usize >= nodes || b as usize >= nodes {
            return Err(Broken::new("links a patch that does not exist"));
        }
        let occlusion = match code {
            CLEAR => Occlusion::Clear,
            CROWDED => Occlusion::Crowded,
            listed => {
                let count = u8::try_from(listed - LISTED).ok();
                let list = starts.next().zip(count);
                let there = |&(start, count): &(u32, u8)| {
                    start as usize + usize::from(count) <= blockers.len()
                };
                let (start, count) = list
                    .filter(there)
                    .ok_or_else(|| Broken::new("lists blockers that are not there"))?;
                Occlusion::Listed { start, count }
            }
        };
        links.push(Link {
            a,
            b,
            exchange,
            open_exchange,
            variation,
            occlusion,
        });
    }
    Ok(Graph { links, blockers })
}

fn lane_of([light, first, count]: [u32; 3]) -> Read<lanes::Lane> {
    let (first, count) = (first as usize, count as usize);
    let light = (light != u32::MAX).then_some(light as usize);
    if count == 0 || first >= BANDS || count > BANDS - first {
        return Err(Broken::new("has an impossible lane"));
    }
    Ok(lanes::Lane {
        light,
        first,
        count,
    })
}

fn put_rows(rows: &Rows, out: &mut Encoder) -> io::Result<()> {
    out.put_list(
        rows.len() * rows.width(),
        (0..rows.len()).flat_map(|k| rows.row(k).iter().copied()),
    )
}

fn rows(from: &mut Decoder, count: usize, width: usize) -> Read<Rows> {
    let mut flat = from.get_list::<f32>()?;
    if flat.len() != count * width {
        return Err(Broken::new("has rows that do not fit"));
    }
    let mut rows = Rows::zero(count, width);
    for k in 0..count {
        for x in rows.row_mut(k) {
            *x = flat.next().unwrap_or(0.0);
        }
    }
    Ok(rows)
}
