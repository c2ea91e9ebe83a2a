//! How large the mesh of the output will be, from the solved light alone.
//!
//! A triangle of mean square s^2 has s^2 / n^2 once it is split into n parts (see [`SHRINK`](super::grow::SHRINK)). With areas A the fewest
//! parts for a given sum are `n = c (A s^2)^(1/3)`, at least one, with the c at which `sum of A s^2 / n^2` is the allowed sum. An *estimate*.

use super::grow::share;
use super::more_vertices;
use super::turns::SQUARE;
use crate::solve::{Bake, GatherQuality};

/// Triangles that a vertex adds to a mesh.
const A_VERTEX: usize = 2;
/// Steps in which c is found, each a doubling.
const DOUBLINGS: usize = 40;

impl Bake {
    /// Expected number of triangles of the output's mesh, within a limit of vertices if there is one.
    pub fn triangles_ahead(&self, vertices: Option<usize>) -> usize {
        let mut growth = self.growth(GatherQuality::Preview, &|| false);
        growth.believe(true);
        growth.begin(&|_, _| {});
        let (cells, used) = (growth.cells.all.len(), growth.used());
        let shares: Vec<f64> = growth.cells.all.iter().map(share).collect();
        let [_, allowed] = self.error_between();
        let allowed = SQUARE * allowed * allowed * growth.seen_area();
        let most = match vertices {
            Some(most) => most.saturating_sub(used),
            None => more_vertices(used, self.settings().error),
        };
        parts(&shares, allowed).min(cells + A_VERTEX * most)
    }
}

/// Total number of parts at which the sum of their shares is the allowed one.
fn parts(shares: &[f64], allowed: f64) -> usize {
    let roots: Vec<f64> = shares.iter().map(|share| share.cbrt()).collect();
    let of = |c: f64| roots.iter().map(move |root| (c * root).max(1.0));
    let left = |c: f64| -> f64 {
        shares
            .iter()
            .zip(of(c))
            .map(|(share, n)| share / (n * n))
            .sum()
    };
    let most = roots.iter().copied().fold(0.0, f64::max);
    let mut c = 1.0 / most.max(f64::MIN_POSITIVE);
    for _ in 0..DOUBLINGS {
        if left(c) <= allowed {
            break;
        }
        c *= 2.0;
    }
    // The cast is safe: the number is limited where it is used.
    of(c).sum::<f64>() as usize
}
