//! Looking up textures: KHR_texture_transform, wrapping, bilinear values, means over triangles.
//!
//! Texel (i, j) of a w x h image has its centre at u = (i + 1/2) / w, v = (j + 1/2) / h, v down from the top
//! (glTF 2.0, section 3.8.4). Values are linear light. Bilinear whatever the sampler's filter says: a mean over a
//! surface does not depend on it.

pub use super::wrap::Wrap;
use crate::scene::Image;

/// Triangles of fewer texels than this are sampled: bilinear values count there. Larger ones by running sums; of a large image with a
/// few bright texels even 1024 samples, as they used to be, miss a seventh.
const FEW_TEXELS: f64 = 16.0;
/// The most samples of what has no area in the image, or no end.
const MAX_SAMPLES: usize = 1024;
/// The fewest samples where a triangle covers any of the texture.
const MIN_SAMPLES: usize = 4;
/// The R2 sequence: powers of the inverse of the plastic number, the real root of x^3 = x + 1
/// (M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018).
const R2: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];

/// A texture reference: image, coordinates, sampler, KHR_texture_transform.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Index in [`Scene::images`](crate::scene::Scene::images).
    pub image: usize,
    /// Which set of coordinates.
    pub texcoord: usize,
    /// KHR_texture_transform as rows of a 2x3 matrix on (u, v, 1).
    pub transform: [[f32; 3]; 2],
    /// Wrapping in u and v.
    pub wrap: [Wrap; 2],
}

impl Texture {
    /// Linear RGBA at texture coordinates `uv`, bilinear. White where the image does not exist.
    pub fn sample(&self, images: &[Image], uv: [f32; 2]) -> [f32; 4] {
        match images.get(self.image) {
            Some(image) => self.bilinear(image, self.transformed(uv)),
            None => [1.0; 4],
        }
    }

    /// Mean over the triangle with corners `uv`: exact where it covers many texels, else by as many samples as it covers, at points of
    /// a fixed low-discrepancy sequence, so that no pattern of the texture falls in step with them.
    pub fn average(&self, images: &[Image], uv: [[f32; 2]; 3]) -> [f32; 4] {
        let Some(image) = images.get(self.image) else {
            return [1.0; 4];
        };
        if let [only] = image.pixels.as_slice() {
            return *only;
        }
        let [a, b, c] = uv.map(|corner| self.transformed(corner));
        let (ab, ac) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let [w, h] = [image.width as f64, image.height as f64];
        let area = 0.5 * ((ab[0] * ac[1] - ab[1] * ac[0]) * w * h).abs();
        if area > FEW_TEXELS {
            let corners = [a, b, c].map(|[u, v]| [u * w, v * h]);
            if let Some(mean) = image.running().mean(&image.pixels, self.wrap, corners) {
                return mean;
            }
        }
        // A sliver in texture space still runs over as many texels as it is long.
        let long = |d: [f64; 2]| (d[0] * w).abs().max((d[1] * h).abs());
        let wanted = area.max(long(ab)).max(long(ac)).ceil();
        // The clamp holds for whatever number comes in, so the conversion is exact.
        let count = wanted.clamp(MIN_SAMPLES as f64, MAX_SAMPLES as f64) as usize;
        let mut sum = [0.0f64; 4];
        for i in 0..count {
            let [mut s, mut t] = R2.map(|step| (0.5 + step * i as f64).fract());
            if s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            let at = [0, 1].map(|k| a[k] + s * ab[k] + t * ac[k]);
            let value = self.bilinear(image, at);
            for (sum, value) in sum.iter_mut().zip(value) {
                *sum += f64::from(value);
            }
        }
        sum.map(|x| (x / count as f64) as f32)
    }

    fn transformed(&self, uv: [f32; 2]) -> [f64; 2] {
        let [u, v] = uv.map(f64::from);
        self.transform.map(|row| {
            let [x, y, shift] = row.map(f64::from);
            let at = x * u + y * v + shift;
            if at.is_finite() { at } else { 0.0 }
        })
    }

    fn bilinear(&self, image: &Image, at: [f64; 2]) -> [f32; 4] {
        let [(x, fx), (y, fy)] = [
            neighbours(at[0], image.width, self.wrap[0]),
            neighbours(at[1], image.height, self.wrap[1]),
        ];
        let texel = |i: usize, j: usize| image.pixels[y[j] * image.width + x[i]];
        let [a, b, c, d] = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
        std::array::from_fn(|k| {
            let top = a[k] + (b[k] - a[k]) * fx;
            let bottom = c[k] + (d[k] - c[k]) * fx;
            top + (bottom - top) * fy
        })
    }
}

/// The two texels around a coordinate, and how far it is from the first to the second.
fn neighbours(at: f64, size: usize, wrap: Wrap) -> ([usize; 2], f32) {
    let n = size as f64;
    // Wrapped before it is scaled: far away the fraction of a texel would be lost, and the index would not fit.
    let at = match wrap {
        Wrap::Repeat => at.rem_euclid(1.0),
        Wrap::Mirror => at.rem_euclid(2.0),
        Wrap::Clamp => at.clamp(0.0, 1.0),
    };
    let position = at * n - 0.5;
    let first = position.floor();
    let fraction = (position - first) as f32;
    // In [-1, 2 size], whatever came in.
    let index = [first, first + 1.0].map(|i| wrap.texel(i, size));
    (index, fraction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn texture(wrap: Wrap) -> Texture {
        Texture {
            image: 0,
            texcoord: 0,
            transform: IDENTITY,
            wrap: [wrap; 2],
        }
    }

    /// Red counts columns, green rows.
    fn counted(width: usize, height: usize) -> Vec<Image> {
        let pixel = |i: usize| [(i % width) as f32, (i / width) as f32, 0.5, 1.0];
        vec![Image::new(
            "",
            width,
            (0..width * height).map(pixel).collect(),
        )]
    }

    #[test]
    fn texel_centres_give_texels_and_between_them_it_is_linear() {
        let images = counted(4, 2);
        let t = texture(Wrap::Clamp);
        for x in 0..4 {
            for y in 0..2 {
                let uv = [(x as f32 + 0.5) / 4.0, (y as f32 + 0.5) / 2.0];
                assert_eq!(t.sample(&images, uv), [x as f32, y as f32, 0.5, 1.0]);
            }
        }
        assert_eq!(t.sample(&images, [0.5, 0.5]), [1.5, 0.5, 0.5, 1.0]);
        assert_eq!(t.sample(&images, [-9.0, 9.0]), [0.0, 1.0, 0.5, 1.0]);
    }

    #[test]
    fn wrapping() {
        let images = counted(4, 4);
        let red = |wrap, u: f32| texture(wrap).sample(&images, [u, 0.5])[0];
        assert_eq!(red(Wrap::Repeat, 1.125), 0.0);
        assert_eq!(red(Wrap::Repeat, -0.125), 3.0);
        // Half way between the last and the first.
        assert_eq!(red(Wrap::Repeat, 1.0), 1.5);
        assert_eq!(red(Wrap::Mirror, 1.125), 3.0);
        assert_eq!(red(Wrap::Mirror, -0.125), 0.0);
        assert_eq!(red(Wrap::Mirror, 2.125), 0.0);
        assert_eq!(red(Wrap::Clamp, 1.125), 3.0);
        assert_eq!(
            red(Wrap::Repeat, 16_777_216.0 + 2.0),
            red(Wrap::Repeat, 0.0)
        );
    }

    #[test]
    fn the_transform_comes_first() {
        let images = counted(4, 4);
        let mut t = texture(Wrap::Clamp);
        t.transform = [[0.0, 1.0, 0.25], [1.0, 0.0, 0.0]];
        assert_eq!(t.sample(&images, [0.125, 0.375]), [2.0, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn means_of_a_ramp_are_exact_and_of_a_checkerboard_close() {
        // Over the unit square's halves the mean of a clamped ramp is that of its linear part, nearly.
        let images = counted(64, 64);
        let t = texture(Wrap::Clamp);
        let corners = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]];
        let mean = t.average(&images, corners);
        let expected = 64.0 * (1.25 / 3.0) - 0.5;
        assert!((mean[0] - expected).abs() < 0.05, "{mean:?} {expected}");
        assert_eq!(mean[3], 1.0);

        let board = |i: usize| [((i % 8 + i / 8) % 2) as f32; 4];
        let images = vec![Image::new("", 8, (0..64).map(board).collect())];
        let t = texture(Wrap::Repeat);
        let mean = t.average(&images, [[0.0, 0.0], [40.0, 0.0], [0.0, 40.0]]);
        assert!((mean[0] - 0.5).abs() < 0.02, "{mean:?}");
    }

    /// A neon sign: bright lines of a few texels on a large dark board.
    #[test]
    fn a_few_bright_texels_count_for_what_they_are() {
        let size = 1024;
        let lit = |i: usize| {
            let (x, y) = (i % size, i / size);
            (500..504).contains(&y) && (200..800).contains(&x)
                || (510..513).contains(&x) && (300..700).contains(&y)
        };
        let board: Vec<[f32; 4]> = (0..size * size).map(|i| [f32::from(lit(i)); 4]).collect();
        let share = board.iter().map(|p| f64::from(p[0])).sum::<f64>() / board.len() as f64;
        let images = vec![Image::new("", size, board)];
        let t = texture(Wrap::Repeat);
        let halves = [
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
            [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        ];
        let mean = halves.map(|half| f64::from(t.average(&images, half)[0]));
        let mean = 0.5 * (mean[0] + mean[1]);
        assert!((mean / share - 1.0).abs() < 1e-3, "{mean} {share}");
    }

    #[test]
    fn numbers_out_of_this_world_are_survived() {
        let images = counted(3, 5);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for odd in [
                f32::NAN,
                f32::INFINITY,
                f32::MAX,
                f32::MIN,
                f32::MIN_POSITIVE,
            ] {
                let t = texture(wrap);
                assert!(t.sample(&images, [odd, -odd])[0].is_finite());
                let mean = t.average(&images, [[odd, 0.0], [0.0, odd], [-odd, 1.0]]);
                assert!(mean[0].is_finite());
            }
        }
        assert_eq!(texture(Wrap::Clamp).sample(&[], [0.5; 2]), [1.0; 4]);
    }

    proptest! {
        #[test]
        fn values_stay_between_the_texels(u in -10.0f32..10.0, v in -10.0f32..10.0, w in 1usize..9, h in 1usize..9) {
            let images = counted(w, h);
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let [r, g, b, a] = texture(wrap).sample(&images, [u, v]);
                prop_assert!((0.0..=(w - 1) as f32).contains(&r) && (0.0..=(h - 1) as f32).contains(&g));
                prop_assert_eq!([b, a], [0.5, 1.0]);
            }
        }
    }
}
