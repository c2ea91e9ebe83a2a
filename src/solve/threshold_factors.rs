//! How finely rooms are divided.

/// How finely a room of one kind is divided, as multiples of the round's threshold.
pub(super) struct ThresholdFactors {
    /// How much light a link may misplace.
    pub(super) link: f64,
    /// By how much direct light may vary over a leaf.
    pub(super) direct: f64,
    /// By how much reflected light may vary over a leaf that looks for itself.
    pub(super) reflected: f64,
}

/// Rooms of few faces: there are many links to a leaf. A share for direct light of up to 16 changes the Cornell box's
/// error at points by less than a tenth: what a leaf reflects is seen as a whole.
const EMPTY: ThresholdFactors = ThresholdFactors {
    link: 0.125,
    direct: 1.0,
    reflected: 0.0,
};
/// Rooms of at least [`MANY_LEAVES`] faces, nothing hidden: leaves are faces, and small anyway.
const TESSELLATED: ThresholdFactors = ThresholdFactors {
    link: 0.25,
    direct: 4.0,
    reflected: 0.0,
};
const MANY_LEAVES: usize = 4096;
/// Where leaves look for themselves, links only tell where the hierarchy is too coarse and what is near and clear, and points
/// see reflected light through rays that end on many leaves.
const FURNISHED: ThresholdFactors = ThresholdFactors {
    link: 0.4,
    direct: 5.0,
    reflected: 1.4,
};
/// Rooms of few triangles that are solved by rays because of their panes: direct light as in others of their size.
const GLAZED: ThresholdFactors = ThresholdFactors {
    direct: EMPTY.direct,
    ..FURNISHED
};

impl ThresholdFactors {
    /// The shares for a room of `faces` faces; is it solved by rays, and has it few triangles?
    pub(super) fn of(by_rays: bool, small: bool, faces: usize) -> Self {
        match (by_rays, small) {
            (true, true) => GLAZED,
            (true, false) => FURNISHED,
            _ if faces >= MANY_LEAVES => TESSELLATED,
            _ => EMPTY,
        }
    }
}
