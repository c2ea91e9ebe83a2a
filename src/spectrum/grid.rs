//! The 64 leaves that every spectrum is held on (paper 2.1.1).

/// Number of leaves: 2^6, the finest level of every spectral tree.
pub const LEAVES: usize = 64;

/// One value for each leaf.
pub type Leaves = [f64; LEAVES];

/// Where the leaves lie on the wavelength axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Left edge of the first leaf, nm.
    start: f64,
    /// Width of a leaf, nm.
    width: f64,
}

impl Grid {
    /// Leaves over `start..end` nm.
    pub fn new(start: f64, end: f64) -> Self {
        Self {
            start,
            width: (end - start) / LEAVES as f64,
        }
    }

    /// Left edge of a leaf, nm.
    pub fn left(&self, leaf: usize) -> f64 {
        self.start + self.width * leaf as f64
    }

    /// Width of a leaf, nm.
    pub fn width(&self) -> f64 {
        self.width
    }
}

impl Default for Grid {
    /// 380 to 780 nm, 6.25 nm a leaf.
    fn default() -> Self {
        Self::new(380.0, 780.0)
    }
}
