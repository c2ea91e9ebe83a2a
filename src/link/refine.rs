//! Hierarchical refinement: which links are good enough, and what the others become.
//!
//! A link is refined while the light it may misplace, weighted by the share of the room that receives it, exceeds the
//! threshold of the round (Hanrahan, Salzman and Aupperle 1991, section 4, with an error per link in place of the form
//! factor alone). Links between the children of a cluster are always opened. Every pass evaluates all new pairs in
//! parallel and splits elements in order, so the result does not depend on the number of threads.

use super::kernel::unmet;
use super::visibility::Visibility;
use super::{Link, LinkContext, Occlusion, Scratch, Sight, evaluate, facing};
use crate::hierarchy::{NONE, Node, Tree};
use crate::team::{Interrupt, Interrupted};
use rayon::prelude::*;

/// Deepest quartering of a face: edges of a kilometre become .06 mm. How small elements of a room may be follows from its area
/// ([`Demand::least_area`]).
pub const MAX_DEPTH: u8 = 24;
/// Pairs a task evaluates: enough to be worth a task, few enough to share out.
const CHUNK: usize = 64;

/// What a link's error is worth, and how much of it is allowed.
#[derive(Debug, Clone, Copy)]
pub struct Demand<'a> {
    /// Radiosity of every node, reflected and emitted, as a share of the adaptation white's.
    pub bright: &'a [f32],
    /// How much a change of irradiance changes the lightness of every node: `(H / white)^(-2/3)`, as in CIELAB; 1 at the
    /// white.
    pub sensitivity: &'a [f32],
    /// Greatest error that a link may keep: share of white, weighted by the root of the receiver's share of counted area.
    pub threshold: f64,
    /// Elements below this area are not split.
    pub least_area: f64,
    /// Does light travel by the links? Where leaves look for themselves, links need not know what hides their ends.
    pub hidden: bool,
}

impl Demand<'_> {
    /// Error that a link causes at its ends, as a share of white, weighted by receiving area; the worse end counts.
    pub fn error(&self, tree: &Tree, link: &Link) -> f64 {
        let visibility = f64::from(link.visibility());
        // An unproved visibility of 0 or 1 is right to about one in the number of rays cast; one in between misplaces
        // light like a coin toss.
        let doubt = if link.occlusion == Occlusion::Clear || !self.hidden {
            0.0
        } else {
            (visibility * (1.0 - visibility)).sqrt().max(0.1)
        };
        let met = f64::from(link.open_exchange) * (f64::from(link.variation) * visibility + doubt);
        let misplaced = match self.hidden {
            true => met.max(unmet(tree.node(link.a), tree.node(link.b))),
            false => met,
        };
        let at = |receiver: u32, source: u32| {
            let area = tree.node(receiver).area;
            // Patches made in this round have no brightness yet: refinement goes one level deeper. If they took that of
            // their ancestors, the Cornell box would take half as long again to reach the same error.
            let bright = f64::from(self.bright.get(source as usize).copied().unwrap_or(0.0));
            let sensitivity = f64::from(
                self.sensitivity
                    .get(receiver as usize)
                    .copied()
                    .unwrap_or(1.0),
            );
            misplaced / area * bright * sensitivity * tree.share(receiver).sqrt()
        };
        at(link.a, link.b).max(at(link.b, link.a))
    }
}

/// All links of a room.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    /// The links, in an order that depends on the input only.
    pub links: Vec<Link>,
    /// Lists of triangles that may block, for the links that have one.
    pub blockers: Vec<u32>,
}

/// What one refinement did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Refined {
    /// Rays cast.
    pub rays: u64,
    /// Links evaluated.
    pub evaluated: u64,
    /// Links that wanted refinement when both ends were as small as allowed.
    pub capped: u64,
}

impl Graph {
    /// The pairs that every room starts with: the two halves of each cluster.
    fn start(tree: &Tree) -> Vec<(u32, u32)> {
        let halves = |n: &Node| (n.child, n.child + 1);
        tree.nodes
            .iter()
            .filter(|n| n.element == NONE && !n.flat)
            .map(halves)
            .collect()
    }

    /// Refines until no link exceeds the demand; the first call also makes the first links.
    ///
    /// # Errors
    /// Refinement was interrupted: the links are of no use any more.
    pub fn refine(
        &mut self,
        tree: &mut Tree,
        sight: &Sight,
        seed: u64,
        demand: &Demand,
        interrupt: &Interrupt,
    ) -> Result<Refined, Interrupted> {
        let mut done = Refined::default();
        let mut open = Vec::new();
        if self.links.is_empty() {
            let pairs: Vec<(u32, u32, u32)> = Self::start(tree)
                .into_iter()
                .map(|(a, b)| (a, b, 0))
                .collect();
            let room = LinkContext { tree, sight, seed };
            let fresh = evaluate_all(&room, &pairs, &[Visibility::Crowded], interrupt, &mut done)?;
            self.sort_out(tree, demand, fresh, &mut open, &mut done);
        } else {
            open = self.open(tree, demand, &mut done);
        }
        while !open.is_empty() {
            let (pairs, views) = split(tree, demand, open);
            let room = LinkContext { tree, sight, seed };
            let fresh = evaluate_all(&room, &pairs, &views, interrupt, &mut done)?;
            open = Vec::new();
            self.sort_out(tree, demand, fresh, &mut open, &mut done);
        }
        Ok(done)
    }

    /// Takes out the links that exceed the demand and can be split, with their views.
    fn open(
        &mut self,
        tree: &Tree,
        demand: &Demand,
        done: &mut Refined,
    ) -> Vec<(Link, Visibility)> {
        let wants: Vec<bool> = self
            .links
            .par_iter()
            .map(|l| demand.error(tree, l) > demand.threshold)
            .collect();
        let mut kept = Vec::with_capacity(self.links.len());
        let mut opened = Vec::new();
        for (link, wants) in self.links.iter().zip(wants) {
            if wants && splittable(tree, link, demand).is_some() {
                opened.push(*link);
            } else {
                kept.push(*link);
                done.capped += u64::from(wants);
            }
        }
        // The lists of opened links are dropped; the others move up.
        let blockers = std::mem::take(&mut self.blockers);
        for link in &mut kept {
            if let Occlusion::Listed { count, .. } = link.occlusion {
                let start = self.blockers.len() as u32;
                self.blockers.extend(blockers_of(&blockers, link.occlusion));
                link.occlusion = Occlusion::Listed { start, count };
            }
        }
        self.links = kept;
        let view = |occlusion: Occlusion| match occlusion {
            Occlusion::Clear => Visibility::Clear,
            Occlusion::Listed { .. } => {
                Visibility::Listed(blockers_of(&blockers, occlusion).to_vec())
            }
            Occlusion::Crowded => Visibility::Crowded,
        };
        opened
            .into_par_iter()
            .map(|link| (link, view(link.occlusion)))
            .collect()
    }

    /// Keeps good links and puts the others in `open`.
    fn sort_out(
        &mut self,
        tree: &Tree,
        demand: &Demand,
        fresh: Vec<(Link, Visibility)>,
        open: &mut Vec<(Link, Visibility)>,
        done: &mut Refined,
    ) {
        for (link, view) in fresh {
            let good = demand.error(tree, &link) <= demand.threshold;
            if !good && splittable(tree, &link, demand).is_some() {
                open.push((link, view));
                continue;
            }
            done.capped += u64::from(!good);
            self.keep(link, &view);
        }
    }

    fn keep(&mut self, link: Link, view: &Visibility) {
        let occlusion = match view {
            Visibility::Clear => Occlusion::Clear,
            Visibility::Crowded => Occlusion::Crowded,
            Visibility::Listed(list) => {
                let start = self.blockers.len() as u32;
                self.blockers.extend(list);
                Occlusion::Listed {
                    start,
                    count: list.len() as u8,
                }
            }
        };
        self.links.push(Link { occlusion, ..link });
    }
}

/// The triangles listed for a way.
pub fn blockers_of(blockers: &[u32], occlusion: Occlusion) -> &[u32] {
    match occlusion {
        Occlusion::Listed { start, count } => {
            &blockers[start as usize..start as usize + usize::from(count)]
        }
        Occlusion::Clear | Occlusion::Crowded => &[],
    }
}

/// Which end of a link to split (the larger that can be), and the other end.
fn splittable(tree: &Tree, link: &Link, demand: &Demand) -> Option<(u32, u32)> {
    let can = |id: u32| {
        let node = tree.node(id);
        !node.is_leaf()
            || tree
                .element(node)
                .is_some_and(|e| e.depth < MAX_DEPTH && node.area > demand.least_area)
    };
    let (a, b) = (link.a, link.b);
    let larger_first = if tree.node(a).radius >= tree.node(b).radius {
        [(a, b), (b, a)]
    } else {
        [(b, a), (a, b)]
    };
    larger_first.into_iter().find(|&(end, _)| can(end))
}

/// Splits one end of each link. Returns the pairs (child, other end, index of the view), and the links' views.
fn split(
    tree: &mut Tree,
    demand: &Demand,
    open: Vec<(Link, Visibility)>,
) -> (Vec<(u32, u32, u32)>, Vec<Visibility>) {
    let mut pairs = Vec::with_capacity(4 * open.len());
    let mut views = Vec::with_capacity(open.len());
    for (link, view) in open {
        // Only links that can be split are opened.
        let Some((end, other)) = splittable(tree, &link, demand) else {
            continue;
        };
        tree.subdivide(end);
        let parts = tree.node(end).child_range();
        pairs.extend(parts.map(|part| (part, other, views.len() as u32)));
        views.push(view);
    }
    (pairs, views)
}

/// Evaluates pairs (a, b, index of their parents' view), in order.
fn evaluate_all(
    room: &LinkContext,
    pairs: &[(u32, u32, u32)],
    views: &[Visibility],
    interrupt: &Interrupt,
    done: &mut Refined,
) -> Result<Vec<(Link, Visibility)>, Interrupted> {
    let parts: Result<Vec<_>, _> = pairs
        .par_chunks(CHUNK)
        .map(|chunk| {
            interrupt.check()?;
            let mut scratch = Scratch::default();
            let mut out = Vec::with_capacity(chunk.len());
            for &(a, b, v) in chunk {
                let (na, nb) = (room.tree.node(a), room.tree.node(b));
                if !facing(room.tree, na, nb) {
                    continue;
                }
                out.extend(evaluate(room, a, b, &views[v as usize], &mut scratch));
            }
            Ok::<_, Interrupted>((out, scratch.rays))
        })
        .collect();
    done.evaluated += pairs.len() as u64;
    let mut all = Vec::with_capacity(pairs.len());
    for (part, rays) in parts? {
        done.rays += rays;
        all.extend(part);
    }
    Ok(all)
}
