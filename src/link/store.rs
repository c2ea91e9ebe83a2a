//! Links as compressed rows, one row per patch: what the operator streams through. 8 bytes per link and direction.

use super::Link;

/// For each node, its links' other ends and exchanges.
#[derive(Debug, Default)]
pub struct LinkRows {
    /// Where each node's row starts; one more entry than nodes.
    start: Vec<u32>,
    /// Source node and `A F` of each entry.
    entries: Vec<(u32, f32)>,
}

impl LinkRows {
    /// Sorts links into rows; links that carry nothing are left out. Entries of a row are sorted by source.
    pub fn new(nodes: usize, links: &[Link]) -> Self {
        let carrying = || links.iter().filter(|l| l.exchange > 0.0);
        let mut start = vec![0_u32; nodes + 1];
        for link in carrying() {
            start[link.a as usize + 1] += 1;
            start[link.b as usize + 1] += 1;
        }
        for k in 0..nodes {
            start[k + 1] += start[k];
        }
        let mut next = start.clone();
        let mut entries = vec![(0, 0.0); start[nodes] as usize];
        for link in carrying() {
            for (end, source) in [(link.a, link.b), (link.b, link.a)] {
                entries[next[end as usize] as usize] = (source, link.exchange);
                next[end as usize] += 1;
            }
        }
        let mut rows = Self { start, entries };
        for k in 0..nodes {
            let (from, to) = (rows.start[k] as usize, rows.start[k + 1] as usize);
            rows.entries[from..to].sort_unstable_by_key(|e| e.0);
        }
        rows
    }

    /// The row of a node: sources and exchanges.
    pub fn row(&self, node: usize) -> &[(u32, f32)] {
        &self.entries[self.range(node)]
    }

    /// Where the row of a node lies among all entries.
    pub fn range(&self, node: usize) -> std::ops::Range<usize> {
        self.start[node] as usize..self.start[node + 1] as usize
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.start.len() - 1
    }

    /// Entries in all rows: twice the number of links.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Are there no links?
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * self.start.len() + 8 * self.entries.len()
    }
}
