//! Triangles that are halves of one convex quadrilateral: as blockers they count as one.

use super::Mesh;
use super::tree::NONE;
use glam::DVec3;
use std::collections::HashMap;

/// Sines of corners below this count as 0: the quadrilateral is a triangle.
const STRAIGHT: f64 = 1e-6;

/// The outline of a blocker: a triangle, or a convex quadrilateral in one plane.
#[derive(Debug, Clone, Copy)]
pub struct Outline {
    corners: [DVec3; 4],
    count: usize,
}

/// A triangle that blocks, alone or with its other half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blocker {
    /// The triangle.
    pub triangle: u32,
    /// Does the blocker include the other half?
    pub together: bool,
}

impl AsRef<[DVec3]> for Outline {
    fn as_ref(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }
}

impl Mesh {
    /// For each triangle the other half of its convex quadrilateral; [`NONE`] where there is none.
    pub(super) fn paired(&self) -> Vec<u32> {
        let mut half = vec![NONE; self.triangles.len()];
        let mut waiting: HashMap<(u32, u32), u32> = HashMap::new();
        for (t, &[a, b, c]) in self.triangles.iter().enumerate() {
            if self.area[t] <= 0.0 {
                continue;
            }
            // The longest edge first: it is the diagonal where a rectangle was halved.
            let length = |(p, q): (u32, u32)| {
                self.positions[p as usize].distance_squared(self.positions[q as usize])
            };
            let mut edges = [(a, b), (b, c), (c, a)];
            edges.sort_by(|&e, &f| length(f).total_cmp(&length(e)));
            let found = edges.iter().find_map(|&(p, q)| {
                let other = *waiting.get(&(q, p))?;
                let fits = half[other as usize] == NONE
                    && self.plane[other as usize] == self.plane[t]
                    && self.is_convex(self.quadrilateral(t as u32, other)?);
                fits.then_some(other)
            });
            match found {
                Some(other) => (half[t], half[other as usize]) = (other, t as u32),
                None => waiting.extend(edges.map(|edge| (edge, t as u32))),
            }
        }
        half
    }

    /// The blockers of a list: each triangle, or both halves of a quadrilateral as one where both are listed.
    pub fn blockers(&self, list: &[u32]) -> impl Iterator<Item = Blocker> {
        list.iter().filter_map(|&triangle| {
            let half = self.half[triangle as usize];
            let together = half != NONE && list.contains(&half);
            // The first half represents both.
            (!together || triangle < half).then_some(Blocker { triangle, together })
        })
    }

    /// The outline of a blocker.
    pub fn outline(&self, blocker: Blocker) -> Outline {
        let triangle = blocker.triangle as usize;
        let half = blocker.together.then(|| self.half[triangle]);
        let whole = half.and_then(|half| self.quadrilateral(blocker.triangle, half));
        let at = |v: u32| self.positions[v as usize];
        match whole {
            Some(ids) => Outline {
                corners: ids.map(at),
                count: 4,
            },
            None => {
                let [a, b, c] = self.triangles[triangle].map(at);
                Outline {
                    corners: [a, b, c, c],
                    count: 3,
                }
            }
        }
    }

    /// Corners of two triangles with a common edge, in the sense of the first.
    fn quadrilateral(&self, one: u32, other: u32) -> Option<[u32; 4]> {
        let [one, other] = [one, other].map(|t| self.triangles[t as usize]);
        let far = *other.iter().find(|v| !one.contains(v))?;
        let apex = one.iter().position(|v| !other.contains(v))?;
        Some([one[apex], one[(apex + 1) % 3], far, one[(apex + 2) % 3]])
    }

    fn is_convex(&self, corners: [u32; 4]) -> bool {
        let p = corners.map(|v| self.positions[v as usize]);
        let turn = |k: usize| {
            let (a, b) = (p[(k + 1) % 4] - p[k], p[(k + 2) % 4] - p[(k + 1) % 4]);
            a.cross(b) / (a.length() * b.length())
        };
        let turns = [0, 1, 2, 3].map(turn);
        turns.iter().all(|t| t.dot(turns[0]) > STRAIGHT * STRAIGHT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
        let mut mesh = Mesh {
            positions: positions.iter().map(|&p| p.into()).collect(),
            triangles: triangles.to_vec(),
            area: vec![1.0; triangles.len()],
            plane: vec![0; triangles.len()],
            ..Mesh::empty()
        };
        mesh.half = mesh.paired();
        mesh
    }

    #[test]
    fn halves_of_squares_find_each_other() {
        // Two squares side by side: triangles pair over the diagonals, not over the edge between the squares.
        let positions = [
            [0., 0., 0.],
            [1., 0., 0.],
            [2., 0., 0.],
            [0., 1., 0.],
            [1., 1., 0.],
            [2., 1., 0.],
        ];
        let mesh = mesh(&positions, &[[0, 1, 4], [1, 2, 5], [1, 5, 4], [0, 4, 3]]);
        assert_eq!(mesh.half, [3, 2, 1, 0]);
        let corners = |t: u32, list: &[u32]| {
            let blocker = mesh.blockers(list).find(|b| b.triangle == t)?;
            Some(mesh.outline(blocker).as_ref().to_vec())
        };
        let of = |ids: &[usize]| {
            ids.iter()
                .map(|&k| positions[k].into())
                .collect::<Vec<DVec3>>()
        };
        assert_eq!(corners(1, &[1, 2]), Some(of(&[2, 5, 4, 1])));
        assert_eq!(corners(2, &[1, 2]), None);
        assert_eq!(corners(2, &[0, 2]), Some(of(&[1, 5, 4])));
    }

    #[test]
    fn what_is_not_convex_stays_apart() {
        let dart = [[0., 0., 0.], [4., 1., 0.], [1., 1., 0.], [1., 4., 0.]];
        assert_eq!(mesh(&dart, &[[0, 1, 2], [0, 2, 3]]).half, [NONE; 2]);
        let straight = [[0., 0., 0.], [2., 0., 0.], [1., 1., 0.], [0., 2., 0.]];
        assert_eq!(mesh(&straight, &[[0, 1, 2], [0, 2, 3]]).half, [NONE; 2]);
        let kite = [[0., 0., 0.], [2., 0., 0.], [3., 3., 0.], [0., 2., 0.]];
        assert_eq!(mesh(&kite, &[[0, 1, 2], [0, 2, 3]]).half, [1, 0]);
        assert_eq!(mesh(&kite, &[[0, 1, 2], [2, 3, 0]]).half, [1, 0]);
        // Turned over.
        assert_eq!(mesh(&kite, &[[0, 1, 2], [0, 3, 2]]).half, [NONE; 2]);
    }
}
