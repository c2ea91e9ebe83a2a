//! Edges of the input on which something stands: a ceiling that ends at a wall which runs on above the ceiling.
//!
//! The light on one side of such an edge has nothing to do with that on the other, though both sides lie in one plane and
//! maybe in one space. So each side gets vertices of its own, whose light is looked at beside the edge, as on edges of
//! shadows.

use super::cells::{Cell, Cells, FENCE};
use super::shades::Shades;
use crate::gather::Vertex;
use crate::geometry::Segment;
use crate::link::Sight;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Distance from an edge at which things standing on it are looked for, a share of the room's half diagonal: 2.5 mm in a
/// room of 6 m by 6 m by 3 m, where lines are as far from the edges of shadows.
const ASIDE: f64 = 5e-4;
/// But no further than this share of the height of a triangle on the edge.
const INTO: f64 = 0.2;
/// Height of the way between both sides, as a multiple of that distance, so that it passes above edges bent outwards.
const ABOVE: f64 = 3.0;
/// Of this many cells around an edge at the most all pairs are tested.
const MOST: usize = 8;
/// Positions along an edge.
const ALONG: [f64; 3] = [0.2, 0.5, 0.8];

/// Normals whose cosine is above this are one direction for looks: such places share their light.
const ALIKE: f64 = 0.999;

/// A corner of a cell, or the edge that begins at this corner.
type CellCorner = (usize, usize);

/// How a vertex is divided: its sheet, and the corners around it in sectors, the first of which keeps it.
struct Parted {
    sheet: u32,
    vertex: u32,
    sectors: Vec<Vec<CellCorner>>,
}

impl Cells {
    /// Divides the vertices on edges on which something stands, unless that takes more than `most` new ones. Edges of things that
    /// lie on one side are left out: that side is lent the light of the other. `spaces` holds the space of each entry and whether
    /// something covers it. Must be called before any edge is split.
    pub(super) fn fence(&mut self, shades: &Shades, spaces: &[(u32, bool)], most: usize) {
        let fenced = self.fenced(shades, spaces);
        let ends = fenced.iter().map(|&edge| self.edges[edge as usize].ends);
        let points: BTreeSet<u32> = ends.flatten().collect();
        let parted = self.parted(&fenced, &points);
        if parted.iter().map(|p| p.sectors.len() - 1).sum::<usize>() > most {
            return;
        }
        for edge in fenced {
            self.edges[edge as usize].sharp |= FENCE;
        }
        for point in points {
            self.sharpen(point, FENCE);
        }
        for Parted {
            sheet,
            vertex,
            sectors,
        } in parted
        {
            for (k, sector) in sectors.iter().enumerate() {
                self.give_vertex(sheet, (vertex, k), sector);
            }
        }
    }

    /// Edges on which something stands.
    fn fenced(&self, shades: &Shades, spaces: &[(u32, bool)]) -> BTreeSet<u32> {
        let mut around: Vec<(u32, CellCorner)> = Vec::with_capacity(3 * self.all.len());
        let is_bare = |cell: &Cell| !spaces.get(cell.of.1 as usize).is_some_and(|space| space.1);
        let bare = self.all.iter().enumerate();
        for (k, cell) in bare.filter(|(_, cell)| is_bare(cell)) {
            around.extend(
                cell.edges
                    .iter()
                    .enumerate()
                    .map(|(e, &edge)| (edge, (k, e))),
            );
        }
        around.sort_unstable();
        let edges: Vec<&[(u32, CellCorner)]> = around.chunk_by(|a, b| a.0 == b.0).collect();
        shades.bake().room.with_sight(|sight| {
            let stands = |cells: &[(u32, CellCorner)]| {
                let few = &cells[..cells.len().min(MOST)];
                let all = few.iter().enumerate();
                all.flat_map(|(k, a)| few[k + 1..].iter().map(move |b| (a.1, b.1)))
                    .any(|(a, b)| self.stands_between(shades, sight, a, b))
            };
            let found = edges.into_par_iter().filter(|cells| stands(cells));
            found.map(|cells| cells[0].0).collect()
        })
    }

    /// Does something stand on the edge that two cells share? Both must belong to one sheet, or face the same
    /// direction.
    fn stands_between(
        &self,
        shades: &Shades,
        sight: &Sight,
        (a, e): CellCorner,
        (b, f): CellCorner,
    ) -> bool {
        let mesh = shades.bake().mesh();
        let [a, b] = [(a, e), (b, f)].map(|(k, e)| (&self.all[k], e));
        let (Some((at_a, normal_a)), Some((at_b, normal_b))) =
            (self.beside(shades, a), self.beside(shades, b))
        else {
            return false;
        };
        if a.0.sheet != b.0.sheet && normal_a.dot(normal_b) < ALIKE {
            return false;
        }
        let planes = [a, b].map(|(cell, _)| mesh.plane[cell.of.0 as usize]);
        let ends = self.edges[a.0.edges[e] as usize].ends;
        let [from, to] = ends.map(|p| self.points[p as usize]);
        ALONG.into_iter().any(|t| {
            let at = from.lerp(to, t);
            sight.blocks_one(&Segment::new(at + at_a, at + at_b, planes))
        })
    }

    /// The way from the edge `e` of a cell to a place a little inside and above it, and the cell's normal; none where the
    /// cell is too thin or too small for the search.
    fn beside(&self, shades: &Shades, (cell, e): (&Cell, usize)) -> Option<(DVec3, DVec3)> {
        let aside = ASIDE * shades.bake().mesh().half_size;
        let [p, q, r] = [0, 1, 2].map(|k| self.points[cell.corners[(e + k) % 3].point as usize]);
        let normal = (q - p).cross(r - p).try_normalize()?;
        let into = normal.cross(q - p).try_normalize()?;
        let height = into.dot(r - p);
        let wide = p.distance(q) > aside && INTO * height > 0.1 * aside;
        let step = aside.min(INTO * height);
        wide.then(|| (step * (into + ABOVE * normal), normal))
    }

    /// How the vertices at ends of fenced edges are divided.
    fn parted(&self, fenced: &BTreeSet<u32>, points: &BTreeSet<u32>) -> Vec<Parted> {
        let mut corners: BTreeMap<(u32, u32), Vec<CellCorner>> = BTreeMap::new();
        for (k, cell) in self.all.iter().enumerate() {
            for (c, corner) in cell.corners.iter().enumerate() {
                if points.contains(&corner.point) {
                    let of = corners.entry((cell.sheet, corner.vertex)).or_default();
                    of.push((k, c));
                }
            }
        }
        let parted = corners.into_iter().map(|((sheet, vertex), about)| Parted {
            sheet,
            vertex,
            sectors: self.sectors(&about, fenced),
        });
        parted.collect()
    }

    /// Corners around a vertex in sets that are connected by edges on which nothing stands.
    fn sectors(&self, about: &[CellCorner], fenced: &BTreeSet<u32>) -> Vec<Vec<CellCorner>> {
        let open = |(k, c): CellCorner| {
            let edges = [c, (c + 2) % 3].map(|e| self.all[k].edges[e]);
            edges.into_iter().filter(|edge| !fenced.contains(edge))
        };
        let mut along: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (place, &corner) in about.iter().enumerate() {
            open(corner).for_each(|edge| along.entry(edge).or_default().push(place));
        }
        let mut taken = vec![false; about.len()];
        let mut sectors = Vec::new();
        for start in 0..about.len() {
            let (mut sector, mut next) = (Vec::new(), vec![start]);
            while let Some(place) = next.pop() {
                if !std::mem::replace(&mut taken[place], true) {
                    sector.push(about[place]);
                    // Each edge is followed once: its corners are then taken, or about to be.
                    let beyond = open(about[place]).filter_map(|edge| along.remove(&edge));
                    next.extend(beyond.flatten());
                }
            }
            if !sector.is_empty() {
                sectors.push(sector);
            }
        }
        sectors
    }

    /// Gives the corners of the `k`-th sector around a vertex one vertex: the first sector keeps the old one, others
    /// get a new one.
    fn give_vertex(&mut self, sheet: u32, (parted, k): (u32, usize), sector: &[CellCorner]) {
        let (cell, c) = sector[0];
        let Cell { of, corners, .. } = self.all[cell];
        let own = Vertex {
            triangle: of.0,
            weights: corners[c].weights,
            entry: of.1,
        };
        let sheet = &mut self.sheets[sheet as usize];
        let vertex = match k {
            0 => {
                sheet.vertices[parted as usize] = own;
                parted
            }
            _ => {
                sheet.vertices.push(own);
                sheet.vertices.len() as u32 - 1
            }
        };
        sheet.parted.insert(vertex, parted);
        for &(k, c) in sector {
            self.all[k].corners[c].vertex = vertex;
        }
    }
}
