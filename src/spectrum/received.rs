//! Reflection of light that came from many places (paper 3.2 and 3.4, for sums).
//!
//! The paper refines a product along the list of its reflections. A sum of light from a thousand patches has no such list. What a receiver
//! can mend is what its own reflection adds: where the reflectance varies over an interval of the light, the interval is halved, and the
//! halves reflect each by their own part of the reflectance. Errors that arrived with the light are handed on; those that sent it have
//! answered for them.

use super::control::{Control, Metric, best_pair};
use super::interval::{Cmf, Interval};
use super::list::add;
use super::tree::{CmfTree, node};
use super::{SpectralList, SpectralTree};

/// The reflection of a sum of lists by a material. The error that is added here, not counting what arrived with the light, is within `limit`
/// (in the unit of `metric`) if that can be done: intervals are split until it is, and merged while it stays.
///
/// ```
/// use haarlight::color::{Observer, luv_jacobian};
/// use haarlight::data::{Outside, named};
/// use haarlight::spectrum::*;
/// let grid = Grid::default();
/// let cmf = CmfTree::new(Observer::cie1931().weights(&grid));
/// let white = *cmf.node(1);
/// let paint = grid.means(&named("macbeth/orange").unwrap().table, Outside::Hold);
/// // Light of equal energy, half from either of two places.
/// let mut light = SpectralList::black();
/// for _ in 0..2 {
///     light.add_scaled(0.5, &SpectralList::from_values(Partition::ROOT, &[1.0]), &cmf);
/// }
/// let metric = Metric::Luv(luv_jacobian(white, white));
/// let sent = reflect_sum(&light, &SpectralTree::new(&paint, &cmf), &cmf, &metric, 0.5);
/// assert!((4..16).contains(&sent.partition().count()));
/// ```
pub fn reflect_sum(
    light: &SpectralList,
    reflectance: &SpectralTree,
    cmf: &CmfTree,
    metric: &Metric,
    limit: f64,
) -> SpectralList {
    let (mut light, mut sent) = (light.clone(), SpectralList::black());
    light.reflect(reflectance, cmf, &mut sent);
    let own = loop {
        let (own, worst) = added(&light, &sent, reflectance, metric);
        let Some(first) = worst.filter(|_| metric.exceeds(limit, own, [0.0; 3])) else {
            break own;
        };
        light.halve(first, cmf);
        let (cut, mut place) = (light.partition(), first);
        let halves = [(); 2].map(|()| {
            let n = node(place, cut.len_at(place));
            let half = light.intervals()[cut.rank(place)].times(reflectance.node(n), cmf.node(n));
            place += cut.len_at(place);
            half
        });
        sent.split(first, halves);
    };
    merge(&mut sent, own, cmf, metric, limit);
    sent
}

/// The error that a reflection adds, and where the interval starts that adds most and can be halved.
fn added(
    light: &SpectralList,
    sent: &SpectralList,
    reflectance: &SpectralTree,
    metric: &Metric,
) -> (Cmf, Option<usize>) {
    let (mut sum, mut worst, mut most) = ([0.0; 3], None, 0.0);
    let intervals = light.intervals().iter().zip(sent.intervals());
    for ((light, sent), (first, len)) in intervals.zip(light.partition().iter()) {
        let rho = reflectance.node(node(first, len)).value();
        let own = std::array::from_fn(|a| sent.error()[a] - rho * light.error()[a]);
        sum = add(sum, own);
        let size = metric.squared(own, [0.0; 3]);
        if len > 1 && size > most {
            (worst, most) = (Some(first), size);
        }
    }
    (sum, worst)
}

/// Merges pairs while `error`, and what merging adds to it, stays within a limit.
fn merge(list: &mut SpectralList, mut error: Cmf, cmf: &CmfTree, metric: &Metric, limit: f64) {
    let rule = Control::within(limit);
    while let Some((first, after)) = best_pair(list, error, cmf, metric, &rule) {
        if metric.exceeds(limit, after, [0.0; 3]) {
            break;
        }
        list.merge(first, cmf, rule.representative);
        error = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{luv_jacobian, tristimulus};
    use crate::spectrum::partition::tests::any_cut;
    use crate::spectrum::testing::{cmf, patch};
    use crate::spectrum::{Partition, Spectrum};
    use proptest::prelude::*;

    proptest! {
        /// Light that is exactly what its list says: all error is the receiver's own, and within its limit.
        #[test]
        fn a_receiver_answers_for_what_it_adds(
            values in prop::array::uniform32(0.0..2.0f64), more in prop::array::uniform32(0.0..2.0f64),
            cut in any_cut(), paint in patch(), limit in 0.05..4.0f64,
        ) {
            let cmf = cmf();
            let values: Vec<f64> = values.into_iter().chain(more).collect();
            let light = SpectralList::from_values(cut, &values);
            let lit = light.spectrum();
            let exact: Spectrum = std::array::from_fn(|k| lit[k] * paint[k]);
            let white = tristimulus(&[1.0; 64], cmf.weights());
            let colour = tristimulus(&exact, cmf.weights());
            let metric = Metric::Luv(luv_jacobian(colour, white));
            let sent = reflect_sum(&light, &SpectralTree::new(&paint, &cmf), &cmf, &metric, limit);
            prop_assert_eq!(sent.validate(), Ok(()));
            let xyz = sent.xyz(&cmf);
            let lacks = std::array::from_fn(|a| colour[a] - xyz[a]);
            prop_assert!(metric.size(lacks, [0.0; 3]) <= limit * 1.000_001 + 1e-9);
            // What the list says of its error is that error.
            prop_assert!((0..3).all(|a| (lacks[a] - sent.error()[a]).abs() < 1e-9 * white[a]));
        }

        /// Errors that arrive are handed on, dimmed, and make no list longer.
        #[test]
        fn what_arrived_is_handed_on(paint in patch(), s in patch(), limit in 0.05..4.0f64) {
            let cmf = cmf();
            let tree = SpectralTree::new(&s, &cmf);
            let light = SpectralList::new(&tree, Partition::uniform(3));
            let exact = SpectralList::from_values(
                light.partition(),
                &light.intervals().iter().map(|i| i.value()).collect::<Vec<_>>(),
            );
            let white = tristimulus(&[1.0; 64], cmf.weights());
            let metric = Metric::Luv(luv_jacobian(white, white));
            let of = |light| reflect_sum(light, &SpectralTree::new(&paint, &cmf), &cmf, &metric, limit);
            let (sent, without) = (of(&light), of(&exact));
            let carried: Cmf = std::array::from_fn(|a| sent.error()[a] - without.error()[a]);
            let arrived = light.error();
            prop_assert!((0..3).all(|a| carried[a].abs() <= arrived[a].abs() + 0.05 * white[a]));
        }
    }
}
