//! Conjugate gradients on all bands at once: one matrix; a right-hand side, an alpha and a beta for each lane.
//!
//! (Hestenes and Stiefel 1952.) The operator is symmetric with eigenvalues in [1 - rho_max, 1 + rho_max], so that
//! `|error| <= |residual| / (1 - rho_max)` in the norm `sum A R^2 / rho`: a *bound*, given exact row sums. Where this
//! takes long, [`Aggregates`] precondition the system.

use super::aggregates::Aggregates;
use super::operator::Operator;
use super::sums::dot;
use crate::light::rows::Rows;
use crate::team::Interrupt;

/// Iterations at the most. Corridors of albedo .99 take about 20.
pub(super) const MAX_ITERATIONS: usize = 400;
/// Greatest albedo from which on the coarse step is taken at once.
const BRIGHT: f64 = 0.98;
/// Iterations after which a darker room is judged.
const LOOK: usize = 6;
/// Such a room takes the coarse step if more iterations than this are still expected.
const MANY: f64 = 12.0;

/// Is the coarse step worth building, given the greatest albedo and the bounds of the error so far?
fn pays(greatest: f64, bounds: &[f64], tolerance: f64) -> bool {
    let slow = |now: &f64| {
        let rate = (now / bounds[0]).ln() / LOOK as f64;
        rate >= 0.0 || (tolerance / now).ln() / rate > MANY
    };
    greatest >= BRIGHT || bounds.get(LOOK).is_some_and(slow)
}

/// How a solve went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Convergence {
    /// Operator applications.
    pub iterations: usize,
    /// Greatest relative residual of a lane.
    pub residual: f64,
    /// Bound of the relative error in the norm above: residual / (1 - rho_max), worst lane.
    pub bound: f64,
    /// How often all bounces were found until fluorescence settled; 0 where nothing fluoresces.
    pub fluorescence: usize,
}

/// The system `(1 - K) y = b`.
#[derive(Debug)]
pub(crate) struct System<'a> {
    /// Pull, gather, push.
    pub operator: Operator<'a>,
    /// Reflectance of each leaf.
    pub reflectance: &'a Rows,
    /// Greatest reflectance of each lane.
    pub greatest: &'a [f32],
    /// Ends the iterations at any time.
    pub interrupt: &'a Interrupt,
}

impl System<'_> {
    /// Reflected radiosity of the leaves (by leaf) from the irradiance of the first bounce, starting from a guess.
    pub(super) fn solve<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> Convergence {
        let greatest = self.greatest.iter().fold(0.0, |a, &b| f64::from(b).max(a));
        self.solve_with::<L>(first, reflected, tolerance, |bounds| {
            pays(greatest, bounds, tolerance)
        })
    }

    /// [`System::solve`] with the coarse step as soon as `pays` finds it worth while, from the bounds before each
    /// iteration.
    pub(crate) fn solve_with<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
        pays: impl Fn(&[f64]) -> bool,
    ) -> Convergence {
        let count = self.operator.leaves.len();
        let root = self.root::<L>();
        let mut work = Work::new::<L>(&self.operator);
        let b = product::<L>(first, &root);
        let mut y = self.symmetric::<L>(reflected, &root);
        let norm = dot::<L>(&b, &b).map(|x| x.max(f64::MIN_POSITIVE));
        let mut applied = Rows::zero(count, L);
        self.apply::<L>(&y, &root, &mut work, &mut applied);
        let mut residual = b;
        step::<L>(&mut residual, &applied, [-1.0; L]);
        let mut direction = residual.clone();
        let mut rr = dot::<L>(&residual, &residual);
        // The residual, preconditioned, and its product with itself.
        let mut aggregates: Option<Aggregates> = None;
        let mut conditioned = Rows::default();
        let mut rz = rr;
        let mut done = Convergence::default();
        let mut bounds = Vec::new();
        loop {
            (done.residual, done.bound) = self.left(&rr, &norm);
            // Rounding ends progress: the rest is the precision of f32, not the method.
            let rounding = rr.iter().zip(&norm).all(|(r, b)| *r <= 1e-14 * b);
            let ended = done.iterations >= MAX_ITERATIONS || self.interrupt.is_raised();
            if done.bound <= tolerance || rounding || ended {
                break;
            }
            bounds.push(done.bound);
            if aggregates.is_none() && pays(&bounds) {
                let new =
                    Aggregates::new::<L>(&self.operator, self.reflectance, &root, &mut work.nodes);
                new.precondition::<L>(&root, &residual, &mut conditioned);
                direction.clone_from(&conditioned);
                rz = dot::<L>(&residual, &conditioned);
                aggregates = Some(new);
            }
            self.apply::<L>(&direction, &root, &mut work, &mut applied);
            done.iterations += 1;
            let alpha = ratios(&rz, &dot::<L>(&direction, &applied));
            step::<L>(&mut y, &direction, alpha);
            step::<L>(&mut residual, &applied, alpha.map(|a| -a));
            rr = dot::<L>(&residual, &residual);
            let (next, z) = match &aggregates {
                Some(aggregates) => {
                    aggregates.precondition::<L>(&root, &residual, &mut conditioned);
                    (dot::<L>(&residual, &conditioned), &conditioned)
                }
                None => (rr, &residual),
            };
            turn::<L>(&mut direction, z, ratios(&next, &rz));
            rz = next;
        }
        self.radiosity::<L>(&y, &root, reflected);
        done
    }

    /// `sqrt(A rho)` of each leaf: with `R = sqrt(rho / A) y` the system is symmetric.
    fn root<const L: usize>(&self) -> Rows {
        let mut root = self.reflectance.clone();
        for (root, &leaf) in root.all_mut::<L>().iter_mut().zip(self.operator.leaves) {
            let area = self.operator.areas[leaf as usize] as f32;
            *root = root.map(|x| (x * area).sqrt());
        }
        root
    }

    /// `y` of a radiosity; 0 where nothing is reflected.
    fn symmetric<const L: usize>(&self, radiosity: &Rows, root: &Rows) -> Rows {
        let mut y = Rows::zero(root.len(), L);
        let rows = y.all_mut::<L>().iter_mut().zip(radiosity.all::<L>());
        for (((y, b), r), &leaf) in rows.zip(root.all::<L>()).zip(self.operator.leaves) {
            let area = self.operator.areas[leaf as usize] as f32;
            *y = std::array::from_fn(|l| if r[l] > 0.0 { b[l] * area / r[l] } else { 0.0 });
        }
        y
    }

    /// Radiosity of a `y`.
    fn radiosity<const L: usize>(&self, y: &Rows, root: &Rows, out: &mut Rows) {
        let rows = out.all_mut::<L>().iter_mut().zip(y.all::<L>());
        for (((b, y), r), &leaf) in rows.zip(root.all::<L>()).zip(self.operator.leaves) {
            let inverse = (1.0 / self.operator.areas[leaf as usize]) as f32;
            *b = std::array::from_fn(|l| y[l] * r[l] * inverse);
        }
    }

    /// Relative residual of the worst lane, and bound of its error, from squares of residual and right-hand side.
    fn left(&self, rr: &[f64], norm: &[f64]) -> (f64, f64) {
        let (mut residual, mut bound) = (0.0_f64, 0.0_f64);
        for ((rr, norm), rho) in rr.iter().zip(norm).zip(self.greatest) {
            let relative = (rr / norm).sqrt();
            residual = residual.max(relative);
            bound = bound.max(relative / (1.0 - f64::from(*rho)));
        }
        (residual, bound)
    }

    /// `(1 - K) y`.
    fn apply<const L: usize>(&self, y: &Rows, root: &Rows, work: &mut Work, out: &mut Rows) {
        self.radiosity::<L>(y, root, &mut work.radiosity);
        self.operator
            .irradiance::<L>(&work.radiosity, &mut work.nodes, &mut work.gathered, out);
        for ((o, y), r) in out
            .all_mut::<L>()
            .iter_mut()
            .zip(y.all::<L>())
            .zip(root.all::<L>())
        {
            *o = std::array::from_fn(|l| y[l] - r[l] * o[l]);
        }
    }
}

/// Scratch of the operator.
struct Work {
    radiosity: Rows,
    nodes: Rows,
    gathered: Rows,
}

impl Work {
    fn new<const L: usize>(operator: &Operator) -> Self {
        let nodes = operator.tree.nodes.len();
        Self {
            radiosity: Rows::zero(operator.leaves.len(), L),
            nodes: Rows::zero(nodes, L),
            gathered: Rows::zero(nodes, L),
        }
    }
}

/// Lane by lane, 0 where the divisor is not positive.
fn ratios<const L: usize>(a: &[f64; L], b: &[f64; L]) -> [f32; L] {
    std::array::from_fn(|l| {
        if b[l] > 0.0 {
            (a[l] / b[l]) as f32
        } else {
            0.0
        }
    })
}

/// `x y`, element by element.
pub(super) fn product<const L: usize>(x: &Rows, y: &Rows) -> Rows {
    let mut out = x.clone();
    for (x, y) in out.all_mut::<L>().iter_mut().zip(y.all::<L>()) {
        *x = std::array::from_fn(|l| x[l] * y[l]);
    }
    out
}

/// The next search direction: `p = z + beta p`, lane by lane.
pub(super) fn turn<const L: usize>(p: &mut Rows, z: &Rows, beta: [f32; L]) {
    for (p, z) in p.all_mut::<L>().iter_mut().zip(z.all::<L>()) {
        *p = std::array::from_fn(|l| z[l] + beta[l] * p[l]);
    }
}

/// `x += alpha p`, lane by lane.
pub(super) fn step<const L: usize>(x: &mut Rows, p: &Rows, alpha: [f32; L]) {
    for (x, p) in x.all_mut::<L>().iter_mut().zip(p.all::<L>()) {
        for l in 0..L {
            x[l] += alpha[l] * p[l];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::{NONE, Node, Tree};
    use crate::link::{Link, LinkRows, Way};

    const LEVELS: u32 = 8;
    /// Leaves that a leaf sees on each side.
    const REACH: u32 = 4;

    /// A binary tree over two rows of equal leaves of area 1, each row a chain; neither sees the other.
    fn chains() -> (Tree, Vec<f64>, Vec<u32>, Vec<Link>) {
        let first_leaf = (1_u32 << LEVELS) - 1;
        let count = 2 * first_leaf + 1;
        let area = |k: u32| 1_u32 << (LEVELS - (k + 1).ilog2());
        let place = |k: u32| {
            let first = (1 << (k + 1).ilog2()) - 1;
            (f64::from(k - first) + 0.5) * f64::from(area(k))
        };
        let nodes = (0..count).map(|k| Node {
            child: if k < first_leaf { 2 * k + 1 } else { NONE },
            children: if k < first_leaf { 2 } else { 0 },
            centre: glam::DVec3::X * place(k),
            radius: f64::from(area(k)),
            ..Node::bare(if k == 0 { NONE } else { (k - 1) / 2 }, f64::from(area(k)))
        });
        let tree = Tree {
            nodes: nodes.collect(),
            ..Tree::default()
        };
        let areas = tree.nodes.iter().map(|n| n.area).collect();
        let half = first_leaf + (1 << (LEVELS - 1));
        let link = |a: u32, b: u32, exchange: f32| Link {
            a,
            b,
            exchange,
            open_exchange: exchange,
            variation: 0.0,
            way: Way::Clear,
        };
        let mut links = Vec::new();
        for (from, to) in [(first_leaf, half), (half, count)] {
            // A leaf sees the next ones on either side, mirrored at the ends: every row sums to 1.
            let exchange = 0.5 / f64::from(REACH) as f32;
            for k in from..to {
                for step in 1..=REACH {
                    if k + step < to {
                        links.push(link(k, k + step, exchange));
                    }
                    if k + step >= to {
                        links.push(link(k, 2 * to - 1 - (k + step), 0.5 * exchange));
                    }
                    if k < from + step {
                        links.push(link(k, 2 * from + step - 1 - k, 0.5 * exchange));
                    }
                }
            }
        }
        (tree, areas, (first_leaf..count).collect(), links)
    }

    /// Solves with light on the first leaf only; lane 3 is black, in lane 2 every other leaf is.
    fn solved(coarse: bool) -> (Rows, Convergence) {
        let (tree, areas, leaves, links) = chains();
        let rows = LinkRows::new(tree.nodes.len(), &links);
        let factor = vec![1.0; tree.nodes.len()];
        let mut rho = Rows::zero(leaves.len(), 4);
        for k in 0..leaves.len() {
            let odd = (k % 2) as f32;
            rho.row_mut(k).copy_from_slice(&[0.99, 0.5, 0.9 * odd, 0.0]);
        }
        let system = System {
            operator: Operator::new(&tree, &rows, &leaves, &areas, &factor),
            reflectance: &rho,
            greatest: &[0.99, 0.5, 0.9, 0.0],
            interrupt: &crate::team::NEVER,
        };
        let mut first = Rows::zero(leaves.len(), 4);
        first.row_mut(0).fill(1.0);
        first.row_mut(1).fill(1.0);
        let mut reflected = Rows::zero(leaves.len(), 4);
        let done = system.solve_with::<4>(&first, &mut reflected, 1e-4, |_| coarse);
        (reflected, done)
    }

    #[test]
    fn the_coarse_step_finds_the_same_solution_in_fewer_iterations() {
        let (plain, slow) = solved(false);
        let (quick, fast) = solved(true);
        for (p, q) in plain.all::<4>().iter().zip(quick.all::<4>()) {
            for l in 0..4 {
                assert!(
                    (p[l] - q[l]).abs() <= 2e-4 * plain.row(1)[l],
                    "{l}: {p:?} {q:?}"
                );
            }
        }
        // All light that comes in is absorbed: sum (1 - rho) / rho R = first.
        let kept: f32 = quick.all::<4>().iter().map(|r| r[0]).sum::<f32>() / 0.99 * 0.01;
        assert!((kept / 2.0 - 1.0).abs() < 1e-3, "{kept}");
        assert!(
            3 * fast.iterations < 2 * slow.iterations,
            "{slow:?} {fast:?}"
        );
    }

    #[test]
    fn what_no_light_reaches_stays_exactly_dark() {
        let (rows, _) = solved(true);
        let half = rows.len() / 2;
        for row in &rows.all::<4>()[half..] {
            assert_eq!(*row, [0.0; 4]);
        }
        assert!(rows.all::<4>()[..half].iter().all(|row| row[3] == 0.0));
        assert!(rows.row(half - 1)[0] > 0.0);
    }
}
