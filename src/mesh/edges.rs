//! Finds edges of shadows in a triangle that is to be split.
//!
//! Where light of a lamp begins or ends on the triangle's edges is found by halving, with rays alone. Two such
//! crossings are joined by a line if light differs to its left and right all along; if it does not, a corner of the
//! shadow is looked for where its edges would meet if both ran on straight. All other triangles are bisected, and
//! looked at again.

use super::cells::{Cell, Cells, FENCE, ShadowEnd, within};
use super::divided::between;
use super::shades::{COVER, Shades, each};
use super::shadow::{EdgeCrossing, Mark, ShadowEdge, ShadowFinding};
use crate::link::Sight;
use crate::transport::Receiver;
use glam::{DVec2, DVec3, dvec2};

/// Parts of an edge in which the beginning or end of light is looked for; light that both begins and ends within one
/// part is found when triangles are smaller.
const PARTS: usize = 8;
/// Parts along a line beside the edge, near a crossing.
const FINE_PARTS: usize = 32;
/// All lengths below are shares of the room's half diagonal, 5 m in a room of 6 m by 6 m by 3 m. Accuracy of crossings:
/// some micrometres, as lines through them are extended to eight times as far.
const FOUND: f64 = 1e-6;
/// A line may be this far from the edge of the shadow: half the size of the smallest triangles.
const STRAIGHT: f64 = 5e-4;
/// Crossings this near to the end of an edge count as that end. No edge shorter than this arises from crossings.
const NEAR: f64 = 4e-4;
/// Half shadows that reach further than this from a line have no edge.
pub(super) const SHARP: f64 = 4e-3;
/// Where it is asked whether a round shadow reaches into a triangle: share of the way from an edge's middle to the opposite corner. A disc's
/// shadow loses the last place that was on its wrong side, and five rooms have up to .4 % more vertices; other shares were not tried.
const BESIDE_MIDDLE: f64 = 0.04;
/// Positions along a line at which its sides are looked at.
const ALONG: [f64; 5] = [0.06, 0.27, 0.5, 0.73, 0.94];
/// Depths at which an edge of a shadow is found a second time, to see its direction; share of the triangle.
const DEPTHS: [f64; 3] = [0.125, 0.03125, 0.0078125];
/// A triangle with more crossings is bisected first.
const CROSSINGS: usize = 8;
/// Edges of shadows are found a second time only if they leave a triangle's edge at a slope of more than one in this
/// many.
const REACH: f64 = 4.0;
/// Left out at the ends of a line beside an edge, and the least distance of a bend from the edges; shares.
const END: f64 = 1e-4;
const INSIDE: f64 = 1e-3;
/// Steps in which lines are carried on to be finished; and the size down to which triangles are bisected for them: 2
/// cm.
const FINISHING: usize = 24;
const BISECTED: f64 = 4e-3;

/// A cell that is searched for edges of shadows.
struct CellLook<'a> {
    shades: &'a Shades<'a>,
    sight: &'a Sight<'a>,
    cells: &'a Cells,
    cell: &'a Cell,
    lamp: u64,
    /// All lamps of interest.
    lamps: u64,
    half_size: f64,
}

fn flat(w: [f64; 3]) -> DVec2 {
    dvec2(w[1], w[2])
}

impl CellLook<'_> {
    fn receiver(&self, weights: [f64; 3]) -> Receiver {
        self.shades.place(self.cells, self.cell, weights)
    }

    fn lit(&self, weights: [f64; 3]) -> bool {
        self.shades
            .lit(self.sight, self.lamp, &self.receiver(weights))
    }

    /// Corners of the triangle of the mesh.
    fn corners(&self) -> [DVec3; 3] {
        let mesh = self.shades.bake().mesh();
        mesh.triangles[self.cell.of.0 as usize].map(|p| mesh.positions[p as usize])
    }

    fn point(&self, w: [f64; 3]) -> DVec3 {
        let [a, b, c] = self.corners();
        a * w[0] + b * w[1] + c * w[2]
    }

    /// Where light begins or ends between two places, as shares of the way, at least `margin` from both.
    fn flips(&self, a: [f64; 3], b: [f64; 3], parts: usize, margin: f64) -> Vec<f64> {
        let length = self.point(a).distance(self.point(b));
        let share = |k: usize| margin + (1.0 - 2.0 * margin) * k as f64 / parts as f64;
        let lit: Vec<bool> = (0..=parts)
            .map(|k| self.lit(between(a, b, share(k))))
            .collect();
        let mut found = Vec::new();
        for k in 0..parts {
            if lit[k] == lit[k + 1] {
                continue;
            }
            let (mut low, mut high) = (share(k), share(k + 1));
            while (high - low) * length > FOUND * self.half_size {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                match self.lit(between(a, b, middle)) == lit[k] {
                    true => low = middle,
                    false => high = middle,
                }
            }
            found.push(0.5 * (low + high));
        }
        found
    }

    fn ends(&self, edge: usize) -> [[f64; 3]; 2] {
        let corners = &self.cell.corners;
        [corners[edge].weights, corners[(edge + 1) % 3].weights]
    }

    fn crossings(&self) -> Vec<EdgeCrossing> {
        let mut found = Vec::new();
        for edge in 0..3 {
            let length = self.cells.edges[self.cell.edges[edge] as usize].length;
            let margin = NEAR * self.half_size / length;
            if self.cells.sharp_along(self.cell, edge) & self.lamp != 0 || margin > 0.25 {
                continue;
            }
            let [a, b] = self.ends(edge);
            for at in self.flips(a, b, PARTS, margin) {
                let weights = between(a, b, at);
                found.push(EdgeCrossing { edge, at, weights });
            }
        }
        found
    }

    /// Does light differ between left and right all along a line?
    fn is_edge(&self, a: [f64; 3], b: [f64; 3]) -> bool {
        let [p, q] = [self.point(a), self.point(b)];
        let length = p.distance(q);
        if length < 2.0 * NEAR * self.half_size {
            return false;
        }
        let [k, l, m] = self.corners();
        let across = (l - k).cross(m - k).cross(q - p).normalize_or_zero();
        let beside = |t: f64, distance: f64| {
            let at = p.lerp(q, t) + across * distance;
            let w = crate::solve::weights_of(at, k, l, m);
            w.iter().all(|w| *w >= 0.0).then_some(w)
        };
        let distance = (STRAIGHT * self.half_size).min(0.02 * length);
        let (mut left, mut compared) = (None, 0);
        for t in ALONG {
            let (Some(a), Some(b)) = (beside(t, distance), beside(t, -distance)) else {
                continue;
            };
            let lit = self.lit(a);
            if self.lit(b) == lit || left.is_some_and(|left| left != lit) {
                return false;
            }
            left = Some(lit);
            compared += 1;
        }
        let sharp = |side: f64, expected: bool| {
            let at = beside(0.5, side * SHARP * self.half_size);
            let wholly = |w| self.shades.wholly(self.sight, self.lamp, &self.receiver(w));
            at.is_none_or(|w| wholly(w) == Some(expected))
        };
        let is_hard = self.shades.is_hard(self.lamp);
        compared > 1 && left.is_some_and(|left| is_hard || (sharp(1.0, left) && sharp(-1.0, !left)))
    }

    /// A second place on the edge of the shadow that begins at a mark.
    fn heading(&self, from: &Mark, depth: f64) -> Option<[f64; 3]> {
        let corners = self.cell.corners.map(|c| c.weights);
        let (a, b, middle) = match from {
            Mark::Crossing(from) => {
                let [a, b] = self.ends(from.edge);
                let c = corners[(from.edge + 2) % 3];
                let (a, b) = (between(a, c, depth), between(b, c, depth));
                let reach = REACH * depth;
                let [low, high] = [from.at - reach, from.at + reach].map(|t| t.clamp(0.0, 1.0));
                let middle = (from.at - low) / (high - low);
                (between(a, b, low), between(a, b, high), middle)
            }
            Mark::Corner(k) => {
                let [a, b] = [1, 2].map(|e| between(corners[*k], corners[(k + e) % 3], depth));
                (a, b, 0.5)
            }
            Mark::Inside(_) => return None,
        };
        let flips = self.flips(a, b, FINE_PARTS, END);
        let nearest = flips
            .into_iter()
            .min_by(|x, y| (x - middle).abs().total_cmp(&(y - middle).abs()));
        nearest.map(|t| between(a, b, t))
    }

    fn weights(&self, mark: &Mark) -> [f64; 3] {
        match mark {
            Mark::Crossing(c) => c.weights,
            Mark::Corner(k) => self.cell.corners[*k].weights,
            Mark::Inside(weights) => *weights,
        }
    }

    /// Where two edges of shadows that begin at marks meet, if they meet inside.
    fn bend(&self, p: &Mark, q: &Mark, depth: f64) -> Option<[f64; 3]> {
        let (from, to) = (self.weights(p), self.weights(q));
        let (a, c) = (flat(from), flat(to));
        let b = flat(self.heading(p, depth)?) - a;
        let d = flat(self.heading(q, depth)?) - c;
        let t = (c - a).perp_dot(d) / b.perp_dot(d);
        let at = a + t * b;
        let own = within(&self.cell.corners, at.to_array());
        let inside = t.is_finite() && own.iter().all(|w| *w > INSIDE);
        let weights = [1.0 - at.x - at.y, at.x, at.y];
        (inside && self.is_edge(from, weights) && self.is_edge(weights, to)).then_some(weights)
    }

    /// Does the light of the lamp end at a corner?
    fn ends_at(&self, corner: usize) -> bool {
        self.cells.lamps_at(self.cell, corner) & self.lamp != 0
    }

    /// Is the edge of the shadow between the ends of an edge known, along it or along both others? Whatever lies within reach of a
    /// known edge would do as a bend, and in all parts of the cell again.
    fn is_joined(&self, edge: usize) -> bool {
        let is_sharp = |k: usize| self.cells.sharp_along(self.cell, k % 3) & self.lamp != 0;
        is_sharp(edge) || (is_sharp(edge + 1) && is_sharp(edge + 2))
    }

    /// A line, with all lamps whose light ends along it.
    fn line(&self, marks: [Mark; 2]) -> ([Mark; 2], u64) {
        let [a, b] = [0, 1].map(|k| self.weights(&marks[k]));
        let others = each(self.lamps).filter(|&lamp| {
            let look = CellLook { lamp, ..*self };
            lamp == self.lamp || look.is_edge(a, b)
        });
        (marks, others.fold(0, |all, lamp| all | lamp))
    }

    fn look(&self) -> ShadowFinding {
        let crossings = self.crossings();
        // Neighbours may have put both ends of a bent edge on corners.
        let ends = (0..3).filter(|&k| self.ends_at(k));
        if crossings.is_empty() && ends.count() < 2 {
            return ShadowFinding::Even;
        }
        if crossings.len() > CROSSINGS {
            return ShadowFinding::Other;
        }
        let mut marks: Vec<Mark> = crossings.into_iter().map(Mark::Crossing).collect();
        let found = marks.len();
        marks.extend((0..3).map(Mark::Corner));
        let pairs = || {
            let count = marks.len();
            let all = (0..count).flat_map(move |k| (k + 1..count).map(move |l| (k, l)));
            all.map(|(k, l)| (marks[k], marks[l]))
        };
        let apart = |(p, q): &(Mark, Mark)| match (p, q) {
            (Mark::Crossing(p), Mark::Crossing(q)) => p.edge != q.edge,
            (Mark::Crossing(p), Mark::Corner(k)) => (p.edge + 2) % 3 == *k,
            _ => false,
        };
        for (p, q) in pairs().filter(apart) {
            if self.is_edge(self.weights(&p), self.weights(&q)) {
                return ShadowFinding::Edge(ShadowEdge {
                    inside: None,
                    lines: vec![self.line([p, q])],
                });
            }
        }
        if !self.shades.is_hard(self.lamp) {
            return ShadowFinding::Even;
        }
        let unknown = |(p, q): &(Mark, Mark)| match (p, q) {
            (Mark::Corner(p), Mark::Corner(q)) => {
                !self.is_joined(if p + 1 == *q { *p } else { *q })
            }
            _ => true,
        };
        for depth in DEPTHS {
            for (p, q) in pairs().filter(unknown) {
                if let Some(at) = self.bend(&p, &q, depth) {
                    let lines = [p, q].map(|end| self.line([end, Mark::Inside(at)]));
                    return ShadowFinding::Edge(ShadowEdge {
                        inside: Some(at),
                        lines: lines.to_vec(),
                    });
                }
            }
        }
        match found == 0 && !self.ends_inside() {
            true => ShadowFinding::Even,
            false => ShadowFinding::Other,
        }
    }

    /// Does light end inside though on no edge of the cell? So it is where a round shadow reaches in between two corners that no
    /// line joins yet.
    fn ends_inside(&self) -> bool {
        let corners = self.cell.corners.map(|c| c.weights);
        let beside = |e: usize, share: f64| {
            let [p, q, r] = [0, 1, 2].map(|k| corners[(e + k) % 3]);
            self.lit(between(between(p, q, 0.5), r, share))
        };
        let is_open = |e: usize| self.ends_at(e) && self.ends_at(e + 1) && !self.is_joined(e);
        (0..3).any(|e| is_open(e) && beside(e, BESIDE_MIDDLE) != beside(e, 1.0 / 3.0))
    }
}

impl Cells {
    /// Lamps whose light ends at a corner of a cell.
    fn lamps_at(&self, cell: &Cell, k: usize) -> u64 {
        let point = cell.corners[k % 3].point;
        self.sharp.get(&point).copied().unwrap_or(0)
    }

    /// Finds edges of cells that are edges of shadows without having been made for them: an end of each is known to lie
    /// on one.
    fn find_edges(&mut self, shades: &Shades, wanted: &[(usize, u64)]) {
        let half_size = shades.bake().mesh().half_size;
        let cells = &*self;
        let found: Vec<[u64; 3]> = shades.bake().room.with_sight(|sight| {
            let look = |(): &mut (), &(k, lamps): &(usize, u64)| {
                let cell = &cells.all[k];
                [0, 1, 2].map(|e| {
                    let [a, b] = [e, (e + 1) % 3].map(|k| cell.corners[k].weights);
                    let ends = cells.lamps_at(cell, e) | cells.lamps_at(cell, e + 1);
                    let unknown = ends & !cells.sharp_along(cell, e) & !FENCE;
                    let along = each(unknown).filter(|&lamp| {
                        let look = CellLook {
                            shades,
                            sight,
                            cells,
                            cell,
                            lamp,
                            lamps,
                            half_size,
                        };
                        look.is_edge(a, b)
                    });
                    along.fold(0, |all, lamp| all | lamp)
                })
            };
            shades.bake().team().map(wanted, || (), look)
        });
        for ((k, _), lamps) in wanted.iter().zip(found) {
            for (edge, lamps) in self.all[*k].edges.into_iter().zip(lamps) {
                if lamps != 0 {
                    self.edges[edge as usize].sharp |= lamps;
                    let ends = self.edges[edge as usize].ends;
                    for point in ends {
                        self.sharpen(point, lamps);
                    }
                }
            }
        }
    }

    fn look_into(&mut self, shades: &Shades, wanted: &[(usize, u64)]) -> Vec<ShadowFinding> {
        self.find_edges(shades, wanted);
        let half_size = shades.bake().mesh().half_size;
        shades.bake().room.with_sight(|sight| {
            let look = |(): &mut (), &(k, lamps): &(usize, u64)| {
                let mut best = ShadowFinding::Even;
                for lamp in each(lamps) {
                    let look = CellLook {
                        shades,
                        sight,
                        cells: self,
                        cell: &self.all[k],
                        lamp,
                        lamps,
                        half_size,
                    };
                    match look.look() {
                        ShadowFinding::Even => {}
                        ShadowFinding::Edge(plan) => return ShadowFinding::Edge(plan),
                        ShadowFinding::Other => best = ShadowFinding::Other,
                    }
                }
                best
            };
            shades.bake().team().map(wanted, || (), look)
        })
    }

    /// Requests what a plan needs, unless something else was requested before.
    fn ask(&mut self, k: usize, plan: &ShadowEdge, near: f64) {
        // Edges are referred to by number before the cell becomes three.
        let mut ends = Vec::new();
        for mark in plan.lines.iter().flat_map(|(marks, _)| marks) {
            ends.push(match mark {
                Mark::Crossing(c) => match self.cross(k, c.edge, c.at, near) {
                    Some(end) => Some(end),
                    None => return,
                },
                Mark::Corner(c) => Some(ShadowEnd::Point(self.all[k].corners[*c].point)),
                Mark::Inside(_) => None,
            });
        }
        let inside = plan.inside.map(|at| self.star(k, at));
        for (ends, (_, lamps)) in ends.chunks(2).zip(&plan.lines) {
            if let (Some(a), Some(b)) = (ends[0].or(inside), ends[1].or(inside)) {
                self.line([a, b], *lamps);
            }
        }
    }

    /// Splits cells along edges of shadows of lamps; returns the new cells. `shrink` is the share of an expected mean square
    /// that remains.
    pub(super) fn split_along(
        &mut self,
        shades: &Shades,
        wanted: &[(usize, u64)],
        shrink: f64,
    ) -> Vec<usize> {
        let found = self.look_into(shades, wanted);
        self.split_found(shades, wanted, &found, f64::INFINITY, shrink)
    }

    /// Carries edges of shadows on to their ends: through all triangles that have a corner on one. Those without a line are
    /// bisected if they are large enough for that to show. Returns the new ones, and how many were split: `most` at the most.
    pub(super) fn finish_lines(
        &mut self,
        shades: &Shades,
        most: usize,
        shrink: f64,
        late: &dyn Fn() -> bool,
    ) -> (Vec<usize>, usize) {
        let least = BISECTED * shades.bake().mesh().half_size;
        let (mut fresh, mut taken) = (Vec::new(), 0);
        let mut some: Vec<usize> = (0..self.all.len()).collect();
        for _ in 0..FINISHING {
            let lamps = |k: usize| {
                let corners = self.all[k].corners.iter();
                let of = |point| self.sharp.get(&point).copied().unwrap_or(0);
                // Lines that end at a cover are carried on only by growing: there may be many, with little to be seen.
                corners.fold(0, |all, corner| all | of(corner.point)) & !(COVER | FENCE)
            };
            let all = some.iter().map(|&k| (k, lamps(k)));
            let wanted: Vec<(usize, u64)> = all.filter(|(_, lamps)| *lamps != 0).collect();
            let found = self.look_into(shades, &wanted);
            // Finished cells take nothing of what is allowed.
            let is_open = |(wanted, found): &(&(usize, u64), &ShadowFinding)| match found {
                ShadowFinding::Edge(_) => true,
                ShadowFinding::Other => self.size(&self.all[wanted.0]) > least,
                _ => false,
            };
            let open = (wanted.iter().zip(&found).filter(is_open)).take(most - taken);
            let (wanted, found): (Vec<(usize, u64)>, Vec<ShadowFinding>) =
                open.map(|(wanted, found)| (*wanted, found.clone())).unzip();
            taken += wanted.len();
            some = self.split_found(shades, &wanted, &found, least, shrink);
            if some.is_empty() || late() {
                break;
            }
            fresh.extend_from_slice(&some);
        }
        fresh.sort_unstable();
        fresh.dedup();
        (fresh, taken)
    }

    /// Splits cells along the lines found, and bisects those larger than `least` in which light ends otherwise.
    fn split_found(
        &mut self,
        shades: &Shades,
        wanted: &[(usize, u64)],
        found: &[ShadowFinding],
        least: f64,
        shrink: f64,
    ) -> Vec<usize> {
        let near = NEAR * shades.bake().mesh().half_size;
        for ((k, _), found) in wanted.iter().zip(found) {
            if let ShadowFinding::Edge(plan) = found {
                self.ask(*k, plan, near);
            }
        }
        for ((k, _), found) in wanted.iter().zip(found) {
            let cell = &self.all[*k];
            if matches!(found, ShadowFinding::Other) && self.size(cell) > least {
                self.mark(*k, self.longest(cell));
            }
        }
        let split = self.split(shrink);
        self.take_sides(shades, split)
    }
}
