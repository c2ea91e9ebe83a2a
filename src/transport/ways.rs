//! What is on ways of light from outside: what blocks it, and what panes and mirrors leave of it.

use crate::geometry::Segment;
use crate::light::Passage;

/// What is on ways of light.
pub(super) trait Ways {
    /// For each segment: is it blocked?
    fn block(&self, segments: &[Segment], out: &mut Vec<bool>);
    /// May light change on its way?
    fn change_light(&self) -> bool;
    /// What is left of light on a free segment (none: all), and how bright that is, as a share.
    fn leave(&self, segment: &Segment) -> (Option<Passage>, f64);
    /// What is so far away lies outside the room.
    fn reach(&self) -> f64;
}
