//! What light from outside meets on its way: blockers, and panes and mirrors that change it.

use crate::geometry::Segment;
use crate::light::Passage;

/// What light meets on its way.
pub(super) trait Obstacles {
    /// For each segment: is it blocked?
    fn block(&self, segments: &[Segment], out: &mut Vec<bool>);
    /// May light change on its way?
    fn change_light(&self) -> bool;
    /// What is left of light on a free segment (none: all), and its brightness as a share.
    fn leave(&self, segment: &Segment) -> (Option<Passage>, f64);
    /// Distance beyond which everything lies outside the room.
    fn reach(&self) -> f64;
}
