//! How texture coordinates go on beyond the image.

/// Wrapping of texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    /// Tile.
    Repeat,
    /// Tile, every second one turned.
    Mirror,
    /// Hold the edge.
    Clamp,
}

impl Wrap {
    /// Which of `size` texels in a row stands at `place`, a whole number.
    pub(super) fn texel(self, place: f64, size: usize) -> usize {
        let (i, whole) = (place as i64, size as i64);
        let i = match self {
            Wrap::Repeat => i.rem_euclid(whole),
            Wrap::Mirror => {
                let i = i.rem_euclid(2 * whole);
                if i < whole { i } else { 2 * whole - 1 - i }
            }
            Wrap::Clamp => i.clamp(0, whole - 1),
        };
        i as usize
    }
}
