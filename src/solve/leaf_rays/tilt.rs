//! How the light of leaves is tilted: a leaf is brighter where it lies in the open.
//!
//! The mean over a leaf is dark beside what others see of it. The floor below the edge of a cupboard is dark, and seen by the cupboard
//! alone; the part before it is bright, and seen by the room. How open a place is, its own rays tell: the share o of those that end
//! further away than close by. Over a leaf o is taken to be linear. Rays start at random places, so with c_i the covariance of "this ray
//! goes far" with the weight w_i of corner i (variance 1/18, covariances -1/36),
//!
//! `o(x) = mean + 12 sum of c_i w_i`
//!
//! How much light goes with openness one leaf's rays cannot tell; those of all leaves can. Light is `B (1 + s (o(x) - mean))`, with one
//! slope s for light straight from lamps and one for reflected light, by least squares over the area of the room, one ray of a pair
//! telling openness and the other light, so that a ray's own length is not taken for either. The mean of a leaf stays what it was.

use super::LeafRays;
use super::hits::{ALONE, BESIDE, MET, RayPairs};
use crate::hierarchy::{NONE, Tree};
use crate::light::Tilts;
use crate::store::Decoder;
use crate::store::codec::Read;
use crate::team::Packed;
use rayon::prelude::*;

/// Pairs of rays that a leaf needs for its openness to have a direction: one more than a plane has unknowns. Leaves cast twice as many at the
/// least, so this holds back only those of which most rays meet no front.
const FEWEST: f64 = 4.0;

/// What a leaf's rays tell.
#[derive(Debug, Clone, Copy, Default)]
struct Findings {
    /// Brightness of direct and of reflected light.
    light: [f64; 2],
    /// Covariance of each with openness; of reflected light with its linear part.
    with_openness: [f64; 2],
    /// Variance of openness: of single rays, of places, and of its linear part without the noise of the fit and with it.
    openness: [f64; 4],
    /// Covariance of openness with the weight of each corner.
    corners: [f64; 3],
}

impl Packed for Findings {
    fn pack(&self, to: &mut Vec<u8>) {
        self.light.pack(to);
        self.with_openness.pack(to);
        self.openness.pack(to);
        self.corners.pack(to);
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok(Self {
            light: Packed::unpack(from)?,
            with_openness: Packed::unpack(from)?,
            openness: Packed::unpack(from)?,
            corners: Packed::unpack(from)?,
        })
    }
}

/// Sums over pairs of rays: how open their places are, and what light they bring.
#[derive(Default)]
struct OpennessSums {
    count: f64,
    weights: [f64; 3],
    /// Of the first and the second rays: that they go far, and what light they bring.
    far: [f64; 2],
    light: [f64; 2],
    /// The same times the weights of the corners.
    far_by_weight: [[f64; 3]; 2],
    light_by_weight: [[f64; 3]; 2],
    /// Both go far.
    both: f64,
}

impl OpennessSums {
    fn add(&mut self, weights: [f64; 3], far: [bool; 2], light: [f64; 2]) {
        let far = far.map(|far| f64::from(u8::from(far)));
        self.count += 1.0;
        self.both += far[0] * far[1];
        for k in 0..2 {
            self.far[k] += far[k];
            self.light[k] += light[k];
            for (i, w) in weights.iter().enumerate() {
                self.far_by_weight[k][i] += far[k] * w;
                self.light_by_weight[k][i] += light[k] * w;
            }
        }
        for (sum, w) in self.weights.iter_mut().zip(weights) {
            *sum += w;
        }
    }

    /// Covariances of sums with the weights of corners.
    fn with_weights(&self, products: [[f64; 3]; 2], sums: [f64; 2]) -> [[f64; 3]; 2] {
        let n = self.count;
        std::array::from_fn(|k| {
            std::array::from_fn(|i| products[k][i] / n - sums[k] * self.weights[i] / (n * n))
        })
    }

    /// With brightness of direct light, and its covariance with openness.
    fn findings(&self, [direct, with_openness]: [f64; 2]) -> Findings {
        let n = self.count;
        if n < FEWEST {
            return Findings {
                light: [direct, 0.0],
                with_openness: [with_openness, 0.0],
                ..Findings::default()
            };
        }
        let far = self.with_weights(self.far_by_weight, self.far);
        let light = self.with_weights(self.light_by_weight, self.light);
        let linear = |a: [f64; 3], b: [f64; 3]| 12.0 * (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        let corners: [f64; 3] = std::array::from_fn(|i| 0.5 * (far[0][i] + far[1][i]));
        let share = 0.5 * (self.far[0] + self.far[1]) / n;
        let reflected = 0.5 * (self.light[0] + self.light[1]) / n;
        let reflected_with = 0.5 * (linear(light[0], far[1]) + linear(light[1], far[0]));
        Findings {
            light: [direct, reflected],
            with_openness: [with_openness, reflected_with],
            openness: [
                share * (1.0 - share),
                (self.both - self.far[0] * self.far[1] / n) / (n - 1.0),
                linear(far[0], far[1]),
                linear(corners, corners),
            ],
            corners,
        }
    }
}

/// How much light goes with openness, of direct and of reflected light, by the sums of findings times area.
fn slopes(leaves: impl Iterator<Item = (f64, Findings)>) -> [f64; 2] {
    let (mut direct, mut reflected, mut openness) = ([0.0; 2], [0.0; 2], [0.0; 4]);
    for (area, f) in leaves {
        let add = |sums: &mut [f64], more: &[f64]| {
            for (sum, x) in sums.iter_mut().zip(more) {
                *sum += area * x;
            }
        };
        let [rays, _, _, fitted] = f.openness;
        add(&mut direct, &[f.with_openness[0], f.light[0] * rays]);
        add(&mut reflected, &[f.with_openness[1], f.light[1] * fitted]);
        add(&mut openness, &f.openness);
    }
    let [rays, places, linear, fitted] = openness;
    let ratio = |a: f64, b: f64| if a > 0.0 && b > 0.0 { a / b } else { 0.0 };
    // What of a ray's openness is that of its place, and what of a fit is not noise.
    let (place, sure) = (ratio(places, rays), ratio(linear, fitted).min(1.0));
    [
        ratio(direct[0], place * direct[1]) * sure,
        ratio(reflected[0], reflected[1]),
    ]
}

/// The tilt of a leaf, by both slopes. No place is darker than black.
fn tilt(found: &Findings, slopes: [f64; 2]) -> [f32; 3] {
    let light = found.light[0] + found.light[1];
    if light <= 0.0 {
        return [0.0; 3];
    }
    let slope = (slopes[0] * found.light[0] + slopes[1] * found.light[1]) / light;
    let corners = found.corners.map(|with| 12.0 * slope * with);
    let darkest = corners.into_iter().fold(-1.0, f64::min);
    corners.map(|x| (x / -darkest) as f32)
}

impl LeafRays {
    /// Finds the tilts of leaves anew, by how bright what each node reflects is, and, by leaf, direct light and its covariance with
    /// openness.
    pub(in crate::solve) fn tilt(
        &mut self,
        (tree, leaves, seed): (&Tree, &[u32], u64),
        reflected: &[f32],
        direct: &[[f32; 2]],
        areas: &[f64],
    ) {
        let own = leaves.par_iter().zip(direct);
        let own = own.filter(|(leaf, _)| self.team.owns(**leaf as usize));
        let find = |(&leaf, direct): (&u32, &[f32; 2])| {
            self.pairs(leaf, reflected, seed)
                .findings(direct.map(f64::from))
        };
        let found: Vec<Findings> = own.map(find).collect();
        let found = self.team.merge(leaves.iter().map(|&k| k as usize), found);
        let each = || leaves.iter().zip(&found);
        let slopes = slopes(each().map(|(&leaf, &found)| (areas[leaf as usize], found)));
        let mut tilts = vec![[0.0; 3]; tree.nodes.len()];
        // Half of a sheet's light comes from behind, whatever stands before it.
        for (&leaf, found) in each().filter(|(leaf, _)| tree.behind(**leaf) == NONE) {
            tilts[leaf as usize] = tilt(found, slopes);
        }
        self.tilt_by(Tilts(tilts));
    }

    /// The pairs of a leaf's rays that both met fronts.
    fn pairs(&self, leaf: u32, reflected: &[f32], seed: u64) -> OpennessSums {
        let (first, count) = self.range[leaf as usize];
        let rays = RayPairs::new(leaf, count as usize, seed);
        let mut pairs = OpennessSums::default();
        for k in 0..count as usize {
            let fellow = rays.fellow(k);
            let both = [k, fellow].map(|k| first as usize + k);
            let met = both.map(|ray| self.met[ray]);
            if fellow < k || met[0] & ALONE != 0 || met[1] & ALONE != 0 {
                continue;
            }
            let light =
                |k: usize| f64::from(self.bright[both[k]] * reflected[(met[k] & MET) as usize]);
            // Each has the flag if the other ended close by.
            let far = [met[1], met[0]].map(|met| met & BESIDE == 0);
            pairs.add(rays.start(k), far, [light(0), light(1)]);
        }
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    const PAIRS: usize = 20_000;

    /// Pairs of rays of a leaf that is open at its first corner: openness is the weight there, and light 2 + `with` times it.
    fn pairs(with: f64) -> OpennessSums {
        let mut random = Pcg::new(5);
        let mut pairs = OpennessSums::default();
        for _ in 0..PAIRS {
            let w = crate::geometry::sampling::triangle_weights([random.f64(), random.f64()]);
            let far = [random.f64() < w[0], random.f64() < w[0]];
            let mut light = || (2.0 + with * w[0]) * 2.0 * random.f64();
            let light = [light(), light()];
            pairs.add(w, far, light);
        }
        pairs
    }

    fn corners(with: f64, direct: [f64; 2]) -> [f32; 3] {
        let found = pairs(with).findings(direct);
        tilt(&found, slopes([(3.0, found)].into_iter()))
    }

    /// Of light 2 + 3 w the mean is 3; at the corner it is 5, at the others 2.
    #[test]
    fn a_leaf_is_bright_where_it_is_open() {
        let [a, b, c] = corners(3.0, [0.0; 2]);
        let near = |x: f32, want: f32| (x - want).abs() < 0.03;
        assert!(near(a, 2.0 / 3.0) && near(b, -1.0 / 3.0) && near(c, -1.0 / 3.0));
        assert!((a + b + c).abs() < 1e-5);
    }

    #[test]
    fn even_light_is_not_tilted() {
        assert!(corners(0.0, [0.0; 2]).iter().all(|x| x.abs() < 0.02));
        assert_eq!(tilt(&Findings::default(), [1.0; 2]), [0.0; 3]);
        assert_eq!(slopes(std::iter::empty()), [0.0; 2]);
    }

    /// Direct light 3 w of mean 1 goes with openness w by 3 / 18.
    #[test]
    fn direct_light_is_tilted_by_how_it_goes_with_openness() {
        let mut dark = pairs(0.0);
        (dark.light, dark.light_by_weight) = ([0.0; 2], [[0.0; 3]; 2]);
        let found = dark.findings([1.0, 3.0 / 18.0]);
        let [a, b, c] = tilt(&found, slopes([(1.0, found)].into_iter()));
        let near = |x: f32, want: f32| (x - want).abs() < 0.1;
        assert!(
            near(a, 2.0) && near(b, -1.0) && near(c, -1.0),
            "{a} {b} {c}"
        );
        assert!(b >= -1.0 && c >= -1.0);
    }
}
