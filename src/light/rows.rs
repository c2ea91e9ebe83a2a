//! Rows of bands: one contiguous, 64-byte aligned row of f32 for each patch, all on one working partition.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

/// A cache line of lanes; only its alignment matters.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f32; 16]);

/// A table of rows. Row lengths are 4, 8, 16, 32 or 64; unused lanes hold zero.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows {
    lines: Vec<Line>,
    rows: usize,
    width: usize,
}

/// Row length for a number of lanes: the next of 4, 8, 16, 32, 64. 16 aligned lanes are faster than 10 or 12 packed ones.
pub fn padded(lanes: usize) -> usize {
    lanes.next_power_of_two().clamp(4, 64)
}

impl Rows {
    /// Zeroed rows.
    pub fn zero(rows: usize, width: usize) -> Self {
        debug_assert!(matches!(width, 4 | 8 | 16 | 32 | 64));
        Self {
            // Zeroed by the system, which touches memory only when it is used.
            lines: bytemuck::zeroed_vec((rows * width).div_ceil(16)),
            rows,
            width,
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows
    }

    /// Are there no rows?
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Lanes in a row, padding included.
    pub fn width(&self) -> usize {
        self.width
    }

    /// One row.
    pub fn row(&self, k: usize) -> &[f32] {
        &bytemuck::cast_slice::<Line, f32>(&self.lines)[k * self.width..(k + 1) * self.width]
    }

    /// One row.
    pub fn row_mut(&mut self, k: usize) -> &mut [f32] {
        &mut bytemuck::cast_slice_mut::<Line, f32>(&mut self.lines)
            [k * self.width..(k + 1) * self.width]
    }

    /// All rows as arrays. `L` must be the width.
    pub fn all<const L: usize>(&self) -> &[[f32; L]] {
        debug_assert_eq!(L, self.width);
        &bytemuck::cast_slice::<Line, f32>(&self.lines)
            .as_chunks::<L>()
            .0[..self.rows]
    }

    /// All rows as arrays. `L` must be the width.
    pub fn all_mut<const L: usize>(&mut self) -> &mut [[f32; L]] {
        debug_assert_eq!(L, self.width);
        &mut bytemuck::cast_slice_mut::<Line, f32>(&mut self.lines)
            .as_chunks_mut::<L>()
            .0[..self.rows]
    }

    /// Parts of `rows` rows each, the last may have fewer.
    pub(crate) fn parts_mut(
        &mut self,
        rows: usize,
    ) -> impl IndexedParallelIterator<Item = &mut [f32]> {
        let used = self.rows * self.width;
        bytemuck::cast_slice_mut::<Line, f32>(&mut self.lines)[..used]
            .par_chunks_mut(rows * self.width)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.lines.len() * size_of::<Line>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_separate_and_padded() {
        assert_eq!(
            [1, 5, 8, 9, 16, 17, 33, 64].map(padded),
            [4, 8, 8, 16, 16, 32, 64, 64]
        );
        let mut rows = Rows::zero(3, 8);
        rows.row_mut(1)[7] = 2.0;
        assert_eq!(rows.all::<8>()[1][7], 2.0);
        assert_eq!(rows.row(0), [0.0; 8]);
        assert_eq!(rows.row(2), [0.0; 8]);
    }
}
