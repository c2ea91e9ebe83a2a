//! Means of an image over triangles of any size, by running sums along its rows.
//!
//! A triangle is cut into level strips, none across two rows; along the middle of each the texels, as even squares, are summed exactly
//! by two look-ups. So a few bright texels in a large dark image count for what they are, and what the parts of a triangle get adds up
//! to what all of it gets.

use super::wrap::Wrap;

/// Texels from one running sum to the next: 2 bytes a texel, and 8 texels to read in the mean for the last bit of a sum.
const STRIDE: usize = 16;
/// Strips of a row of texels: the ends of one are where they are in its middle.
const STRIPS: usize = 4;
/// The most rows that count by themselves; where a triangle runs over more, some stand for others.
const ROWS: f64 = 4096.0;
/// A triangle that runs over more texels than this along an axis has coordinates that nobody meant.
const FARTHEST: f64 = 1e9;

/// Sums of texels from the left end of each row.
#[derive(Debug, Clone)]
pub(super) struct Running {
    size: [usize; 2],
    /// Sums before texel 0, [`STRIDE`], 2 [`STRIDE`], ... of a row, and of all of it.
    sums: Vec<[f64; 4]>,
}

/// Sums in a row.
fn stops(width: usize) -> usize {
    width.div_ceil(STRIDE) + 1
}

fn add(sum: [f64; 4], texel: &[f32; 4], times: f64) -> [f64; 4] {
    std::array::from_fn(|c| sum[c] + times * f64::from(texel[c]))
}

impl Running {
    /// Of an image with rows of `width` texels.
    pub(super) fn new(width: usize, pixels: &[[f32; 4]]) -> Self {
        let mut sums = Vec::with_capacity(stops(width) * (pixels.len() / width.max(1)));
        for row in pixels.chunks_exact(width.max(1)) {
            let mut sum = [0.0; 4];
            for texels in row.chunks(STRIDE) {
                sums.push(sum);
                sum = texels.iter().fold(sum, |sum, texel| add(sum, texel, 1.0));
            }
            sums.push(sum);
        }
        let size = [width, pixels.len() / width.max(1)];
        Self { size, sums }
    }

    /// Mean over a triangle with its corners in texels from the top left; none where it has no area to speak of, or far too much.
    pub(super) fn mean(
        &self,
        pixels: &[[f32; 4]],
        wrap: [Wrap; 2],
        mut corners: [[f64; 2]; 3],
    ) -> Option<[f32; 4]> {
        corners.sort_by(|a, b| a[1].total_cmp(&b[1]));
        let [top, middle, bottom] = corners;
        let high = bottom[1] - top[1];
        let xs = corners.map(|p| p[0]);
        let wide = xs.iter().copied().fold(f64::MIN, f64::max)
            - xs.iter().copied().fold(f64::MAX, f64::min);
        if !(high > 0.0 && wide > 0.0 && high.max(wide) < FARTHEST) {
            return None;
        }
        let at = |from: [f64; 2], to: [f64; 2], y: f64| {
            let way = (to[1] - from[1]).max(f64::MIN_POSITIVE);
            from[0] + (to[0] - from[0]) * ((y - from[1]) / way).clamp(0.0, 1.0)
        };
        let step = (high / ROWS).ceil().max(1.0);
        let (mut sum, mut area) = ([0.0; 4], 0.0);
        let mut upper = top[1];
        while upper < bottom[1] {
            let mut lower = (((upper / step).floor() + 1.0) * step).min(bottom[1]);
            let mut side = (middle, bottom);
            if upper < middle[1] {
                (lower, side) = (lower.min(middle[1]), (top, middle));
            }
            let thick = (lower - upper) / STRIPS as f64;
            for k in 0..STRIPS {
                let y = upper + thick * (k as f64 + 0.5);
                let (a, b) = (at(top, bottom, y), at(side.0, side.1, y));
                let row = wrap[1].texel(y.floor(), self.size[1]);
                let [left, right] =
                    [a.min(b), a.max(b)].map(|x| self.before(pixels, row, wrap[0], x));
                sum = std::array::from_fn(|c| sum[c] + thick * (right[c] - left[c]));
                area += thick * (a - b).abs();
            }
            upper = lower;
        }
        (area > 0.0).then(|| sum.map(|x| (x / area).max(0.0) as f32))
    }

    /// Sum of a row from 0 to `x`, beyond the image as it goes on there.
    fn before(&self, pixels: &[[f32; 4]], row: usize, wrap: Wrap, x: f64) -> [f64; 4] {
        let width = self.size[0] as f64;
        let all = self.sums[(row + 1) * stops(self.size[0]) - 1];
        let within = |x: f64| self.within(pixels, row, x);
        let repeats =
            |count: f64, rest: [f64; 4]| std::array::from_fn(|c| count * all[c] + rest[c]);
        match wrap {
            Wrap::Repeat => repeats((x / width).floor(), within(x.rem_euclid(width))),
            Wrap::Mirror => {
                let pairs = (x / (2.0 * width)).floor();
                let rest = x.rem_euclid(2.0 * width);
                if rest <= width {
                    return repeats(2.0 * pairs, within(rest));
                }
                let back = within(2.0 * width - rest);
                repeats(2.0 * (pairs + 1.0), back.map(|x| -x))
            }
            Wrap::Clamp => {
                let inside = x.clamp(0.0, width);
                let edge = row * self.size[0] + if x < 0.0 { 0 } else { self.size[0] - 1 };
                add(within(inside), &pixels[edge], x - inside)
            }
        }
    }

    /// Sum of a row from 0 to `x`, from 0 to the width.
    fn within(&self, pixels: &[[f32; 4]], row: usize, x: f64) -> [f64; 4] {
        let whole = (x as usize).min(self.size[0]);
        let stop = whole / STRIDE;
        let first = row * self.size[0];
        let mut sum = self.sums[row * stops(self.size[0]) + stop];
        for texel in &pixels[first + stop * STRIDE..first + whole] {
            sum = add(sum, texel, 1.0);
        }
        match whole < self.size[0] {
            true => add(sum, &pixels[first + whole], x - whole as f64),
            false => sum,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    /// Against texels summed one by one at many points.
    #[test]
    fn means_over_triangles_are_those_of_their_texels() {
        let (width, height) = (37, 23);
        let mut random = Pcg::new(5);
        let texel = |_| [random.f64() as f32, random.f64() as f32, 0.25, 1.0];
        let pixels: Vec<[f32; 4]> = (0..width * height).map(texel).collect();
        let running = Running::new(width, &pixels);
        let mut random = Pcg::new(6);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for _ in 0..20 {
                let mut corner = || [200.0 * random.f64() - 80.0, 120.0 * random.f64() - 40.0];
                let corners = [corner(), corner(), corner()];
                let [a, b, c] = corners.map(glam::DVec2::from);
                // Of needles more than a share of a row is missed at either end.
                if (b - a).perp_dot(c - a).abs() < 200.0 {
                    continue;
                }
                let mean = running.mean(&pixels, [wrap; 2], corners).unwrap();
                let [a, b, c] = corners;
                let (mut sum, steps) = (0.0, 800);
                for i in 0..steps {
                    for k in 0..steps {
                        let [mut s, mut t] =
                            [i, k].map(|x| (f64::from(x) + 0.5) / f64::from(steps));
                        if s + t > 1.0 {
                            (s, t) = (1.0 - s, 1.0 - t);
                        }
                        let at = |e: usize| (a[e] + s * (b[e] - a[e]) + t * (c[e] - a[e])).floor();
                        let place = wrap.texel(at(1), height) * width + wrap.texel(at(0), width);
                        sum += f64::from(pixels[place][0]);
                    }
                }
                let expected = sum / f64::from(steps * steps);
                let off = f64::from(mean[0]) - expected;
                assert!(off.abs() < 2e-3, "{wrap:?} {corners:?} {mean:?} {expected}");
                assert!((mean[2] - 0.25).abs() < 1e-6 && (mean[3] - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn nothing_is_said_of_lines_and_of_what_has_no_end() {
        let pixels = vec![[1.0; 4]; 64];
        let running = Running::new(8, &pixels);
        let mean = |corners| running.mean(&pixels, [Wrap::Clamp; 2], corners);
        assert_eq!(mean([[0.0, 0.0], [5.0, 0.0], [2.0, 0.0]]), None);
        assert_eq!(mean([[0.0, 0.0], [1e30, 0.0], [2.0, 4.0]]), None);
        assert_eq!(mean([[-9.0, 0.0], [90.0, 0.0], [2.0, 4.0]]), Some([1.0; 4]));
    }
}
