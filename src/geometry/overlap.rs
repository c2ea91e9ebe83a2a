//! Which triangles may touch a box?

use super::bvh::LEAF;
use super::index::RayIndex;
use glam::Vec3;

impl RayIndex {
    /// Triangles of all leaves whose (padded) boxes meet the box from `low` to `high`: every triangle that touches it, and
    /// some that only come near. In no particular order, each once.
    pub fn near(&self, low: Vec3, high: Vec3, out: &mut Vec<u32>) {
        out.clear();
        if self.tree.nodes.is_empty() {
            return;
        }
        let mut open = vec![0_u32];
        while let Some(id) = open.pop() {
            if id & LEAF != 0 {
                let block = &self.tree.blocks[(id & !LEAF) as usize];
                out.extend(block.ids[..block.count as usize].iter());
                continue;
            }
            let node = &self.tree.nodes[id as usize];
            let sides = node.bounds.map(|side| side.map(|lanes| lanes.0));
            let children = &node.children[..node.count as usize];
            for (lane, &child) in children.iter().enumerate() {
                if (0..3).all(|axis| {
                    sides[0][axis][lane] <= high[axis] && sides[1][axis][lane] >= low[axis]
                }) {
                    open.push(child);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    #[test]
    fn every_triangle_that_touches_is_found_once() {
        let mut rng = Pcg::new(3);
        let mut point = || Vec3::new(rng.f32(), rng.f32(), rng.f32());
        let mut positions = Vec::new();
        for _ in 0..500 {
            let at = point();
            positions.extend([0; 3].map(|_| at + 0.1 * point()));
        }
        let triangles: Vec<[u32; 3]> = (0..500).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let index = RayIndex::build(&positions, &triangles, &[], &[]);
        let mut found = Vec::new();
        for _ in 0..50 {
            let low = point();
            let high = low + 0.2 * point();
            index.near(low, high, &mut found);
            found.sort_unstable();
            assert!(found.windows(2).all(|w| w[0] < w[1]));
            for (k, t) in triangles.iter().enumerate() {
                let corners = t.map(|v| positions[v as usize]);
                let least = corners[0].min(corners[1]).min(corners[2]);
                let most = corners[0].max(corners[1]).max(corners[2]);
                let touches = least.cmple(high).all() && most.cmpge(low).all();
                assert!(!touches || found.contains(&(k as u32)));
            }
            assert!(found.len() < 300);
        }
    }
}
