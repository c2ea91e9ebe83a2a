//! Links: which patches exchange light, how much, and how well that is known.

mod balance;
mod contour;
mod kernel;
mod mirrored;
mod refine;
mod store;
mod visibility;

pub(crate) use balance::row_sums;
pub use balance::{RowBalance, balance};
pub use contour::exchange;
pub(crate) use kernel::{POLYGONS, in_front_of, open_weight, pattern, polygons};
pub use kernel::{Scratch, evaluate, facing, point_factors};
pub use mirrored::Mirrored;
pub use refine::{Demand, Graph, MAX_DEPTH, Refined, blockers_of};
pub use store::LinkRows;
pub use visibility::{Opaque, Sight, Visibility};
pub(crate) use visibility::{PIECES, is_small};

use crate::hierarchy::Tree;

/// A symmetric link between two patches: `area_a * F_ab = area_b * F_ba` (reciprocity by construction).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// One end.
    pub a: u32,
    /// The other end.
    pub b: u32,
    /// `A_a F_ab` with visibility, in the file's units squared.
    pub exchange: f32,
    /// `exchange` with nothing in the way.
    pub open_exchange: f32,
    /// Relative variation of the point-to-patch factor: half of (greatest - least), over the mean.
    pub variation: f32,
    /// What may block this exchange.
    pub occlusion: Occlusion,
}

impl Link {
    /// Visible share of the exchange, in [0, 1].
    pub fn visibility(&self) -> f32 {
        if self.open_exchange > 0.0 {
            (self.exchange / self.open_exchange).min(1.0)
        } else {
            0.0
        }
    }
}

/// What may stand between the ends of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occlusion {
    /// Nothing: proved.
    Clear,
    /// Only a few triangles: `Graph::blockers[start..start + count]`.
    Listed {
        /// Index of the first.
        start: u32,
        /// Number of them.
        count: u8,
    },
    /// Anything.
    Crowded,
}

/// What links are worked out from: the patches and what may stand between them.
#[derive(Clone, Copy)]
pub struct LinkContext<'a> {
    /// The patches.
    pub tree: &'a Tree,
    /// What blocks rays.
    pub sight: &'a Sight<'a>,
    /// Mixed into every sampling pattern.
    pub seed: u64,
}
