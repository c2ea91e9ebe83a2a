//! Edges of the input that something stands on: a ceiling that ends at a wall which runs on above it.
//!
//! Light on both sides of such an edge has nothing to do with each other, though they are one plane and maybe one space. So
//! each side gets vertices of its own, whose light is looked at beside the edge, as on edges of shadows.

use super::cells::{Cell, Cells};
use super::shades::{FENCE, Shades};
use crate::gather::Vertex;
use crate::geometry::Segment;
use crate::link::Sight;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What stands on an edge is looked for this far from it, a share of the room's half diagonal: 2.5 mm in a room of 6 m by
/// 6 m by 3 m, where lines are as far from what they stand for.
const ASIDE: f64 = 5e-4;
/// But no further than this share of the height of a triangle on the edge.
const INTO: f64 = 0.2;
/// And so many times higher than aside, so that the way passes above edges that are bent outwards.
const ABOVE: f64 = 3.0;
/// Where along an edge.
const ALONG: [f64; 3] = [0.2, 0.5, 0.8];

impl Cells {
    /// Parts the vertices on edges that something stands on. To be called before any edge is split.
    pub(super) fn fence(&mut self, shades: &Shades) {
        let mut around = vec![[None::<(usize, usize)>; 2]; self.edges.len()];
        for (k, cell) in self.all.iter().enumerate() {
            for (e, &edge) in cell.edges.iter().enumerate() {
                if let Some(free) = around[edge as usize].iter_mut().find(|side| side.is_none()) {
                    *free = Some((k, e));
                }
            }
        }
        let fenced: Vec<u32> = shades.bake().with_sight(|_, sight| {
            let all = (0..self.edges.len() as u32).into_par_iter();
            let stands = |&edge: &u32| match around[edge as usize] {
                [Some(a), Some(b)] => self.stands_between(shades, sight, a, b),
                _ => false,
            };
            all.filter(stands).collect()
        });
        for edge in fenced {
            let edge = &mut self.edges[edge as usize];
            edge.sharp |= FENCE;
            for point in edge.ends {
                self.sharpen(point, FENCE);
            }
        }
        self.part_vertices();
    }

    /// Does something stand on the edge that two cells share?
    fn stands_between(
        &self,
        shades: &Shades,
        sight: &Sight,
        (a, e): (usize, usize),
        (b, f): (usize, usize),
    ) -> bool {
        let mesh = shades.bake().mesh();
        let [a, b] = [(a, e), (b, f)].map(|(k, e)| (&self.all[k], e));
        let (Some(beside_a), Some(beside_b)) = (self.beside(shades, a), self.beside(shades, b))
        else {
            return false;
        };
        let planes = [a, b].map(|(cell, _)| mesh.plane[cell.of.0 as usize]);
        let ends = self.edges[a.0.edges[e] as usize].ends;
        let [from, to] = ends.map(|p| self.points[p as usize]);
        ALONG.into_iter().any(|t| {
            let at = from.lerp(to, t);
            sight.blocks_one(&Segment::new(at + beside_a, at + beside_b, planes))
        })
    }

    /// From the edge `e` of a cell to a place a little into it and above; none where it is too thin or smaller than what is
    /// looked for.
    fn beside(&self, shades: &Shades, (cell, e): (&Cell, usize)) -> Option<DVec3> {
        let aside = ASIDE * shades.bake().mesh().half_size;
        let [p, q, r] = [0, 1, 2].map(|k| self.points[cell.corners[(e + k) % 3].point as usize]);
        let normal = (q - p).cross(r - p).try_normalize()?;
        let into = normal.cross(q - p).try_normalize()?;
        let height = into.dot(r - p);
        let wide = p.distance(q) > aside && INTO * height > 0.1 * aside;
        let step = aside.min(INTO * height);
        wide.then(|| step * (into + ABOVE * normal))
    }

    /// Gives every sector of cells about a point on a fence vertices of its own.
    fn part_vertices(&mut self) {
        let mut corners: BTreeMap<(u32, u32), Vec<(usize, usize)>> = BTreeMap::new();
        for (k, cell) in self.all.iter().enumerate() {
            for (c, corner) in cell.corners.iter().enumerate() {
                if self.sharp.contains_key(&corner.point) {
                    let of = corners.entry((cell.sheet, corner.vertex)).or_default();
                    of.push((k, c));
                }
            }
        }
        for ((sheet, vertex), mut left) in corners {
            let mut first = true;
            while let Some(start) = left.pop() {
                let mut sector = vec![start];
                let mut next = 0;
                while let Some(&one) = sector.get(next) {
                    let joined = |other: &(usize, usize)| self.are_joined(one, *other);
                    let (new, rest) = left.into_iter().partition(joined);
                    left = rest;
                    sector.extend::<Vec<_>>(new);
                    next += 1;
                }
                self.give_vertex(sheet, if first { Some(vertex) } else { None }, &sector);
                first = false;
            }
        }
    }

    /// Do two corners at a point share an edge there that nothing stands on?
    fn are_joined(&self, (a, c): (usize, usize), (b, d): (usize, usize)) -> bool {
        let about = |k: usize, c: usize| [c, (c + 2) % 3].map(|e| self.all[k].edges[e]);
        let others = about(b, d);
        let open = |edge: &u32| self.edges[*edge as usize].sharp & FENCE == 0;
        about(a, c)
            .iter()
            .filter(|e| open(e))
            .any(|edge| others.contains(edge))
    }

    /// Gives the corners of a sector one vertex: `kept`, or a new one.
    fn give_vertex(&mut self, sheet: u32, kept: Option<u32>, sector: &[(usize, usize)]) {
        let (k, c) = sector[0];
        let Cell { of, corners, .. } = self.all[k];
        let own = Vertex {
            triangle: of.0,
            weights: corners[c].weights,
            entry: of.1,
        };
        let vertices = &mut self.sheets[sheet as usize].vertices;
        let vertex = kept.unwrap_or(vertices.len() as u32);
        match kept {
            Some(vertex) => vertices[vertex as usize] = own,
            None => vertices.push(own),
        }
        for &(k, c) in sector {
            self.all[k].corners[c].vertex = vertex;
        }
    }
}
