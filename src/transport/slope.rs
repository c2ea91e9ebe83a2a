//! The light of a leaf seen from nearby is not even: it goes on as it does over the leaf and its three siblings.
//!
//! The parent's three corner children, of radiosity b_0, b_1, b_2 with mean m, give a linear function on each child: at
//! barycentric weights w of the child it is `B + sum over j of s_j w_j`, `s_j = 2 (b_j - m)` (the middle child is turned
//! round: -2), which keeps the child's mean B. A point receives `sum over j of s_j W_j` more than by the mean alone, with
//! `W_j` the integral of w_j over the form factor's kernel, found by quartering the child while that matters.

use super::gatherer::Gatherer;
use super::receiver::{Gathered, Receiver};
use crate::geometry::{lambert_triangles_x8, quarters};
use glam::DVec3;

/// A leaf is quartered this often at the most.
const DEEPEST: u32 = 3;
/// Less than this share of white is never looked for, however small an error is asked for.
const LEAST: f64 = 1e-6;

impl Gatherer<'_> {
    /// Adds what the slope of the radiosity of leaf `id` brings, if that may exceed `limit` (share of white). `factor` is the
    /// unblocked one, `visible` the share of it that is seen.
    pub(super) fn slope(
        &self,
        to: &Receiver,
        id: u32,
        factor: f64,
        visible: f64,
        limit: f64,
        out: &mut Gathered,
    ) {
        let limit = limit.max(LEAST);
        let node = self.tree.node(id);
        let Some(element) = self.tree.element(node).filter(|e| e.depth > 0) else {
            return;
        };
        if visible <= 0.0 || !node.is_leaf() {
            return;
        }
        let first = self.tree.node(node.parent).child;
        let bright = |k: u32| f64::from(self.light.bright_reflected[k as usize]);
        let corners = [bright(first), bright(first + 1), bright(first + 2)];
        let mean = corners.iter().sum::<f64>() / 3.0;
        let steepest = corners
            .iter()
            .map(|b| 2.0 * (b - mean).abs())
            .fold(0.0, f64::max);
        // Weights differ from 1/3 by about as much over the kernel.
        if factor * steepest * 0.5 <= limit {
            return;
        }
        // Nowhere below zero.
        let sign = if id == first + 3 { -2.0 } else { 2.0 };
        let lowest = corners
            .iter()
            .map(|b| sign * (b - mean))
            .fold(0.0, f64::min);
        let scale = (bright(id) / -lowest).min(1.0);
        let mut moments = [0.0; 3];
        let unit = DVec3::AXES;
        let limit = limit / steepest.max(f64::MIN_POSITIVE);
        moment(to, element.corners, unit, factor, limit, 0, &mut moments);
        let weights = moments.map(|w| sign * scale * visible * (w - factor / 3.0));
        if let Some(trace) = &mut out.trace {
            (0..3).for_each(|k| trace.slope(first + k, weights[k as usize] as f32, None));
        }
        let width = self.light.width();
        let rows = [0, 1, 2].map(|k| self.light.reflected.row((first + k) as usize));
        for (l, x) in out.irradiance[..width].iter_mut().enumerate() {
            let more: f64 = (0..3).map(|k| weights[k] * f64::from(rows[k][l])).sum();
            *x += more as f32;
        }
    }
}

/// Adds the integrals of the barycentric weights over a triangle; `w` are those of its corners, `factor` its own.
fn moment(
    to: &Receiver,
    corners: [DVec3; 3],
    w: [DVec3; 3],
    factor: f64,
    limit: f64,
    depth: u32,
    out: &mut [f64; 3],
) {
    let size = 0.5_f64.powi(depth as i32);
    if depth >= DEEPEST || 0.25 * factor * size <= limit {
        for (k, out) in out.iter_mut().enumerate() {
            *out += factor * (w[0][k] + w[1][k] + w[2][k]) / 3.0;
        }
        return;
    }
    let parts = quarters(corners);
    let factors = lambert_triangles_x8(to.point, to.normal, parts.into_iter()).to_array();
    for ((corners, w), part) in parts.into_iter().zip(quarters(w)).zip(factors) {
        if part > 0.0 {
            moment(to, corners, w, part, limit, depth + 1, out);
        }
    }
}
