//! Turns diagonals where light asks for it.
//!
//! Bisection knows two diagonals of a square and no contours: where light falls off towards a wall, triangles with one corner at the wall
//! stand beside triangles with two, and look like teeth. Two triangles that share an edge inside one triangle of the input may as well
//! share the other diagonal. The diagonal with fewer creases is drawn: creases are the sum, over the edges around, of length times the
//! jump of the gradient of lightness, which an eye takes for a line (data-dependent triangulation, Dyn, Levin & Rippa 1990).

use super::cells::{Cells, FENCE, SurfaceSide, key};
use glam::DVec3;
use std::collections::{BTreeSet, HashMap, HashSet};

/// No triangle is made with less than this share of the area of both: needles would show what they should hide.
const SLIVER: f64 = 0.05;
/// A turn must remove this share of the creases around. Interpolation at `--error 1` (mean dE00; as bisected, with turns that remove
/// anything, with .15 and with .3): cornell .296, .316, .304, .292; gallery .322, .332, .328, .307; two rooms .233, .226, .224, .226; convex
/// .282, .272, .268, .263; Bevy's box .206, .210, .193, .196; sun-room .135, .141, .138, .135. With .5 rather more again.
const LESS: f64 = 0.3;
/// Triangles whose normals meet at less than this cosine do not lie in one plane.
const FLAT: f64 = 0.9999;

/// The unchanging part of a sheet: where its vertices are, and which edges are lines where light ends.
#[derive(Debug, Default, Clone)]
pub(super) struct Ground {
    pub(super) at: Vec<DVec3>,
    /// For each triangle, before any is turned, one of the mesh that stands for all that belong together.
    pub(super) of: Vec<u32>,
    lines: HashSet<(u32, u32)>,
}

/// The unchanging parts of all sheets.
pub(super) fn grounds(cells: &Cells) -> Vec<Ground> {
    let ground = |sheet: &SurfaceSide| Ground {
        at: vec![DVec3::ZERO; sheet.vertices.len()],
        of: Vec::new(),
        lines: HashSet::new(),
    };
    let mut grounds: Vec<Ground> = cells.sheets.iter().map(ground).collect();
    for cell in &cells.all {
        let ground = &mut grounds[cell.sheet as usize];
        ground.of.push(cells.divided.first(cell.of));
        for k in 0..3 {
            let [a, b] = [cell.corners[k], cell.corners[(k + 1) % 3]];
            ground.at[a.vertex as usize] = cells.points[a.point as usize];
            let ends = cells.along.get(&key(a.point, b.point));
            let is_fenced = cells.edges[cell.edges[k] as usize].sharp & FENCE != 0;
            if is_fenced || ends.is_some_and(|lamps| *lamps != 0) {
                ground.lines.insert(key(a.vertex, b.vertex));
            }
        }
    }
    grounds
}

/// Triangles of a sheet as drawn.
struct Faces<'a> {
    triangles: &'a mut [[u32; 3]],
    /// See [`Ground`].
    of: &'a [u32],
    at: &'a [DVec3],
    /// Lightness of vertices; none where nothing was seen.
    light: &'a [Option<f64>],
    /// Triangles at each edge, by its vertices.
    beside: HashMap<(u32, u32), [Option<u32>; 2]>,
    /// Edges of more than two triangles, one of which lies upon another: they stay.
    crowded: HashSet<(u32, u32)>,
}

/// Turns the diagonals of a sheet with the given lightness at vertices.
pub(super) fn turn(ground: &Ground, triangles: &mut [[u32; 3]], light: &[Option<f64>]) {
    let mut faces = Faces {
        triangles,
        of: &ground.of,
        at: &ground.at,
        light,
        beside: HashMap::new(),
        crowded: HashSet::new(),
    };
    for t in 0..faces.triangles.len() as u32 {
        faces.tie(t);
    }
    // Every turn removes creases, so this ends.
    let mut open: BTreeSet<(u32, u32)> = faces.beside.keys().copied().collect();
    while let Some(edge) = open.pop_first() {
        if !ground.lines.contains(&edge) {
            open.extend(faces.turned(edge).into_iter().flatten());
        }
    }
}

fn edges([a, b, c]: [u32; 3]) -> [(u32, u32); 3] {
    [key(a, b), key(b, c), key(c, a)]
}

impl Faces<'_> {
    fn tie(&mut self, t: u32) {
        for edge in edges(self.triangles[t as usize]) {
            if self.crowded.contains(&edge) {
                continue;
            }
            let both = self.beside.entry(edge).or_default();
            match both.iter().position(Option::is_none) {
                Some(free) => both[free] = Some(t),
                None => {
                    self.beside.remove(&edge);
                    self.crowded.insert(edge);
                }
            }
        }
    }

    fn untie(&mut self, t: u32) {
        for edge in edges(self.triangles[t as usize]) {
            if let Some(both) = self.beside.get_mut(&edge) {
                if both[0] == Some(t) {
                    both[0] = both[1].take();
                } else {
                    both[1] = None;
                }
            }
        }
    }

    fn normal(&self, [a, b, c]: [u32; 3]) -> DVec3 {
        let [a, b, c] = [a, b, c].map(|v| self.at[v as usize]);
        (b - a).cross(c - a)
    }

    /// Normal of twice the area, and the gradient of lightness.
    fn slope(&self, triangle: [u32; 3]) -> Option<(DVec3, DVec3)> {
        let [a, b, c] = triangle.map(|v| self.at[v as usize]);
        let [la, lb, lc] = triangle.map(|v| self.light[v as usize]);
        let n = self.normal(triangle);
        let rises = la? * (c - b) + lb? * (a - c) + lc? * (b - a);
        (n != DVec3::ZERO).then(|| (n, n.cross(rises) / n.length_squared()))
    }

    /// Length times jump of the gradient between a triangle and the one beyond its edge `k`.
    fn crease(&self, triangle: [u32; 3], k: usize, beyond: Option<[u32; 3]>) -> f64 {
        let jump = || {
            let ((n, one), (m, other)) = (self.slope(triangle)?, self.slope(beyond?)?);
            let flat = n.normalize().dot(m.normalize()) > FLAT;
            let [p, q] = [k, (k + 1) % 3].map(|k| self.at[triangle[k] as usize]);
            flat.then(|| (one - other).length() * p.distance(q))
        };
        jump().unwrap_or(0.0)
    }

    /// Creases around two triangles that share their first edge, drawn or considered, in place of the present triangles
    /// `both`.
    fn creases(&self, pair: [[u32; 3]; 2], both: [u32; 2]) -> f64 {
        let beyond = |p: u32, q: u32| {
            let near = self.beside.get(&key(p, q))?;
            let other = near.iter().flatten().find(|t| !both.contains(t))?;
            Some(self.triangles[*other as usize])
        };
        let outer = |t: [u32; 3]| {
            self.crease(t, 1, beyond(t[1], t[2])) + self.crease(t, 2, beyond(t[2], t[0]))
        };
        self.crease(pair[0], 0, Some(pair[1])) + outer(pair[0]) + outer(pair[1])
    }

    /// Turns an edge if that makes fewer creases; returns the edges around, whose creases have changed.
    fn turned(&mut self, edge: (u32, u32)) -> Option<[(u32, u32); 4]> {
        let &[Some(t), Some(s)] = self.beside.get(&edge)? else {
            return None;
        };
        if self.of[t as usize] != self.of[s as usize] {
            return None;
        }
        // (a, b, c) and (b, a, d); the other diagonal leads from c to d.
        let [one, other] = [t, s].map(|t| self.triangles[t as usize]);
        let k = (0..3).find(|&k| key(one[k], one[(k + 1) % 3]) == edge)?;
        let [a, b, c] = [0, 1, 2].map(|i| one[(k + i) % 3]);
        let &d = other.iter().find(|v| **v != a && **v != b)?;
        let is_edge = (self.beside.get(&key(c, d))).is_some_and(|both| both[0].is_some())
            || self.crowded.contains(&key(c, d));
        let then = [[c, d, b], [d, c, a]];
        let n = self.normal(one) + self.normal(other);
        let is_whole = |t: &[u32; 3]| self.normal(*t).dot(n) > SLIVER * n.length_squared();
        let is_seen = [a, b, c, d]
            .iter()
            .all(|v| self.light[*v as usize].is_some());
        if is_edge || !is_seen || !then.iter().all(is_whole) {
            return None;
        }
        let before = self.creases([[a, b, c], [b, a, d]], [t, s]);
        // A crease that is no number is never smoother: in a dark room light has no white to be compared with.
        let is_smoother = self.creases(then, [t, s]) < (1.0 - LESS) * before;
        if !is_smoother {
            return None;
        }
        self.untie(t);
        self.untie(s);
        [self.triangles[t as usize], self.triangles[s as usize]] = then;
        self.tie(t);
        self.tie(s);
        Some([key(b, c), key(c, a), key(a, d), key(d, b)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    /// A strip of squares, two triangles each, all bisected the same way.
    fn strip() -> (Ground, Vec<[u32; 3]>) {
        let at = (0..10).map(|k| dvec3(f64::from(k / 2), f64::from(k % 2), 0.0));
        let squares = (0..4).flat_map(|k: u32| {
            let [a, d, b, c] = [0, 1, 2, 3].map(|i| 2 * k + i);
            [[a, b, c], [a, c, d]]
        });
        let ground = Ground {
            at: at.collect(),
            of: vec![0; 8],
            lines: HashSet::new(),
        };
        (ground, squares.collect())
    }

    /// Lightness that falls off across diagonals that are not drawn: all are turned.
    fn folded(at: &[DVec3]) -> Vec<Option<f64>> {
        at.iter().map(|p| Some((p.x + p.y - 2.5).abs())).collect()
    }

    #[test]
    fn diagonals_follow_what_light_does() {
        let (ground, mut faces) = strip();
        turn(&ground, &mut faces, &folded(&ground.at));
        // The fold lies in the third square from (2.5, 0) to (1.5, 1): light along x + y = 2 and 3 is drawn straight.
        for (a, b) in [(2, 5), (4, 7)] {
            let has = |t: &&[u32; 3]| t.contains(&a) || t.contains(&b);
            let along = faces.iter().filter(|t| t.contains(&a) && t.contains(&b));
            assert_eq!(
                along.count(),
                0,
                "{:?}",
                faces.iter().filter(has).collect::<Vec<_>>()
            );
        }
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| ground.at[v as usize]);
            0.5 * (b - a).cross(c - a).z
        };
        assert!(faces.iter().all(|t| area(t) > 0.0));
        assert!((faces.iter().map(area).sum::<f64>() - 4.0).abs() < 1e-12);
    }

    /// As in files that have triangles twice: turning ends, and the edges of such triangles stay.
    #[test]
    fn triangles_upon_each_other_are_no_reason_to_turn_for_ever() {
        let (mut ground, mut faces) = strip();
        faces.extend([faces[2], faces[3], faces[5]]);
        ground.of = vec![0; faces.len()];
        turn(&ground, &mut faces, &folded(&ground.at));
        for (of, twice) in [(2, 8), (3, 9), (5, 10)] {
            assert_eq!(faces[of], faces[twice]);
        }
    }

    #[test]
    fn lines_parts_of_other_triangles_and_even_light_stay() {
        let (ground, as_bisected) = strip();
        let same = |ground: &Ground, light: Vec<Option<f64>>| {
            let mut faces = as_bisected.clone();
            turn(ground, &mut faces, &light);
            faces == as_bisected
        };
        let folded = folded(&ground.at);
        assert!(!same(&ground, folded.clone()));
        let slope = ground.at.iter().map(|p| Some(3.0 * p.x - p.y)).collect();
        assert!(same(&ground, slope));
        assert!(same(&ground, vec![None; 10]));
        assert!(same(&ground, vec![Some(f64::NAN); 10]));
        let apart = Ground {
            of: (0..8).collect(),
            ..ground.clone()
        };
        assert!(same(&apart, folded.clone()));
        let lines = Ground {
            lines: (0..4).map(|k| key(2 * k, 2 * k + 3)).collect(),
            ..ground
        };
        assert!(same(&lines, folded));
    }
}
