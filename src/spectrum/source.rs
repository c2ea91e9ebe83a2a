//! The coarsest list of a light that is accurate enough (paper 3.1.3).
//!
//! From one interval, the interval with the greatest error is halved until the error of the whole is at most the limit.

use super::control::{Metric, worst};
use super::interval::Interval;
use super::list::List;
use super::partition::Partition;
use super::product::Path;
use super::tree::{CmfTree, Tree};

/// The list of a light whose error is at most `limit` in the unit of `metric`.
///
/// It ends: an interval of one leaf has no error, so the worst interval can always be halved.
pub fn represent<I: Interval>(
    source: &Tree<I>,
    cmf: &CmfTree,
    metric: &Metric,
    limit: f64,
) -> List<I> {
    let path = Path {
        source,
        reflections: &[],
    };
    let mut list = List::new(source, Partition::ROOT);
    while metric.size(list.error(), list.radius()) > limit {
        let Some((first, n)) = worst(&list, metric) else {
            break;
        };
        list.split(first, path.children(n, cmf));
    }
    list
}
