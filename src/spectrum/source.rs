//! The coarsest list of a light that is accurate enough (paper 3.1.3).
//!
//! From one interval, the interval with the greatest error is halved until the error of the whole is at most the limit.

use super::control::{Metric, worst};
use super::interval::Interval;
use super::list::List;
use super::partition::Partition;
use super::product::Path;
use super::tree::{CmfTree, DyadicTree};

/// The list of a light whose error is at most `limit` in the unit of `metric`.
///
/// It ends: an interval of one band has no error, so the worst interval can always be halved.
pub fn represent<I: Interval>(
    source: &DyadicTree<I>,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Observer;
    use crate::data::{Outside, named};
    use crate::spectrum::study::{ColourChart, Reflectances};
    use crate::spectrum::{Estimate, Grid};

    #[test]
    fn a_limit_of_nothing_gives_bands_and_no_limit_gives_one_interval() {
        let chart = ColourChart::new(Reflectances::Ohta);
        let tree = DyadicTree::<Estimate>::new(&chart.light("F2").power, &chart.cmf);
        let exact = represent(&tree, &chart.cmf, &Metric::Xyz, 0.0);
        assert_eq!(exact.error(), [0.0; 3]);
        let coarse = represent(&tree, &chart.cmf, &Metric::Xyz, f64::INFINITY);
        assert_eq!(coarse.partition(), Partition::ROOT);
    }

    #[test]
    fn bands_sampled_in_their_middle_miss_table_1() {
        // The left edges of this grid are the middles of the paper's.
        let grid = Grid::new(382.5, 702.5);
        let cmf = CmfTree::new(Observer::cie1931().samples(&grid));
        let middles = grid.left_edges(&named("cie/C").unwrap().table, Outside::Zero);
        let k = crate::color::normalization(&middles, cmf.weights());
        let tree = DyadicTree::<Estimate>::new(&middles.map(|s| k * s), &cmf);
        assert_eq!(
            represent(&tree, &cmf, &Metric::Xyz, 2e-3)
                .partition()
                .count(),
            9
        );
    }
}
