//! A picture of all directions as a sky.
//!
//! Equirectangular as Blender and three.js have it: the middle of the picture looks along +X, its left and right edges along -X, a
//! quarter from the left is -Z; the top row is the zenith. Where north is not -Z the map turns with it. A texel is as bright all over.
//!
//! What is brighter than the mean of all directions (the sun, bright clouds, lamps of a studio) is found by its share of the light, row by
//! row and then within the row: by the excess alone, since rays that look everywhere find the rest (Karlik et al. 2019, "MIS
//! compensation").

use super::parts::PARTS;
use super::picture::SkyPicture;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// What is wanted of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// Its sun by itself.
    pub(super) sun: bool,
    /// What it shows below the horizon.
    pub(super) below: bool,
}

/// The sun that was taken out of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    /// Toward it.
    pub(super) toward: DVec3,
    /// Irradiance by red, green and blue of a plane across its rays, in the unit of the map.
    pub(super) across: [f64; PARTS],
}

/// A picture of all directions.
#[derive(Debug)]
pub struct Map {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Red, green and blue.
    pub(super) texels: Vec<[f32; 3]>,
    /// Where north is, radians clockwise from -Z.
    turn: f64,
    /// Luminance of red, green and blue.
    pub(super) luminance: [f64; PARTS],
    /// Irradiance by each above the horizon of a plane that looks up, and below it of one that looks down.
    levels: [[f64; PARTS]; 2],
    is_even: bool,
    /// Mean luminance of all directions.
    mean: f64,
    /// Excess over the mean in all rows up to one, times solid angle; and within each row, as shares of it.
    rows: Vec<f64>,
    columns: Vec<f32>,
    /// For each row, the chance that [`spot`](Self::spot) takes it over the solid angle of one of its texels.
    row_density: Vec<f64>,
}

impl Map {
    /// Of a picture, with what is taken out of it as its sun where one is looked for. `luminance`: of red, green and blue; `north`: where it is,
    /// radians clockwise from -Z.
    pub(super) fn new(
        picture: SkyPicture,
        luminance: [f64; PARTS],
        north: f64,
        wanted: Wanted,
    ) -> (Self, Option<Disc>) {
        let mut map = Self {
            width: picture.width,
            height: picture.height,
            texels: picture.texels,
            turn: north,
            luminance,
            levels: [[0.0; PARTS]; 2],
            is_even: false,
            mean: 0.0,
            rows: Vec::new(),
            columns: Vec::new(),
            row_density: Vec::new(),
        };
        let sun = if wanted.sun { map.take_sun() } else { None };
        if !wanted.below {
            // A row that the horizon crosses stays.
            let first = map.height.div_ceil(2) * map.width;
            map.texels[first..].fill([0.0; PARTS]);
        }
        map.levels = [0, 1].map(|half| map.level(half));
        let half = map.height.div_ceil(2) * map.width;
        let alike = |texels: &[[f32; PARTS]]| texels.windows(2).all(|two| two[0] == two[1]);
        map.is_even = alike(&map.texels[..half]) && alike(&map.texels[map.texels.len() - half..]);
        map.find_spots();
        (map, sun)
    }

    /// Irradiance by red, green and blue of what is above the horizon (0) or below it (1), of a plane that faces it.
    pub(super) fn levels(&self) -> [[f64; PARTS]; 2] {
        self.levels
    }

    /// Texels across and down.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Red, green and blue, row by row from the top.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Where north is, radians clockwise from -Z.
    pub fn north(&self) -> f64 {
        self.turn
    }

    /// Is each half as bright in all directions?
    pub(super) fn is_even(&self) -> bool {
        self.is_even
    }

    /// Radiance of each part, of which a plane that faces its half has an irradiance of 1.
    #[inline]
    pub(super) fn radiance(&self, direction: DVec3) -> [f64; PARTS] {
        self.radiance_of(self.texel(direction), direction.y > 0.0)
    }

    /// The same of a texel, above the horizon or below it.
    pub(super) fn radiance_of(&self, texel: usize, up: bool) -> [f64; PARTS] {
        let texel = self.texels[texel];
        let levels = &self.levels[usize::from(!up)];
        std::array::from_fn(|k| match levels[k] > 0.0 {
            true => f64::from(texel[k]) / levels[k],
            false => 0.0,
        })
    }

    /// How much of the luminance of a texel is above the mean, a share.
    pub(super) fn excess_share(&self, texel: usize) -> f64 {
        let bright = self.bright(texel);
        match bright > self.mean {
            true => 1.0 - self.mean / bright,
            false => 0.0,
        }
    }

    /// Is anything brighter than the mean?
    pub(super) fn has_spots(&self) -> bool {
        self.rows.last().is_some_and(|&all| all > 0.0)
    }

    /// A direction toward what is brighter than the mean.
    pub(super) fn spot(&self, [u, v]: [f64; 2]) -> Option<DVec3> {
        let all = self.rows.last().copied().filter(|&all| all > 0.0)?;
        let target = v * all;
        let row = self.rows.partition_point(|&sum| sum <= target);
        let row = row.min(self.height - 1);
        let before = row.checked_sub(1).map_or(0.0, |k| self.rows[k]);
        let down = ((target - before) / (self.rows[row] - before)).clamp(0.0, 1.0);
        let columns = self.columns(row);
        let column = columns.partition_point(|&sum| f64::from(sum) <= u);
        let column = column.min(self.width - 1);
        let [before, chance] = within(columns, column);
        let right = ((u - before) / chance).clamp(0.0, 1.0);
        let [top, bottom] = self.edges(row).map(f64::cos);
        let height = top + down * (bottom - top);
        let out = (1.0 - height * height).max(0.0).sqrt();
        let along = (column as f64 + right) / self.width as f64;
        let (sin, cos) = (TAU * (along - 0.5) + self.turn).sin_cos();
        Some(DVec3::new(out * cos, height, out * sin))
    }

    /// Density, by solid angle, with which [`spot`](Self::spot) finds a direction that ends in a texel.
    pub(super) fn spot_density(&self, texel: usize) -> f64 {
        let (row, column) = (texel / self.width, texel % self.width);
        self.row_density[row] * within(self.columns(row), column)[1]
    }

    /// The texel of a direction.
    #[inline]
    pub(super) fn texel(&self, direction: DVec3) -> usize {
        let down = direction.y.clamp(-1.0, 1.0).acos() / PI;
        let along = (direction.z.atan2(direction.x) - self.turn) / TAU + 0.5;
        let row = ((down * self.height as f64) as usize).min(self.height - 1);
        let column = (along.rem_euclid(1.0) * self.width as f64) as usize;
        row * self.width + column.min(self.width - 1)
    }

    /// The direction of the middle of a texel.
    pub(super) fn middle(&self, texel: usize) -> DVec3 {
        let (row, column) = (texel / self.width, texel % self.width);
        let (out, height) = (PI * (row as f64 + 0.5) / self.height as f64).sin_cos();
        let along = (column as f64 + 0.5) / self.width as f64 - 0.5;
        let (sin, cos) = (TAU * along + self.turn).sin_cos();
        DVec3::new(out * cos, height, out * sin)
    }

    pub(super) fn bright(&self, texel: usize) -> f64 {
        self.luminous(self.texels[texel].map(f64::from))
    }

    /// Luminance of red, green and blue together.
    pub(super) fn luminous(&self, parts: [f64; PARTS]) -> f64 {
        let each = parts.iter().zip(&self.luminance);
        each.map(|(x, y)| x * y).sum()
    }

    /// Angles from the zenith between which a row lies.
    fn edges(&self, row: usize) -> [f64; 2] {
        [row, row + 1].map(|k| PI * k as f64 / self.height as f64)
    }

    /// Of a texel of a row.
    pub(super) fn solid_angle(&self, row: usize) -> f64 {
        let [top, bottom] = self.edges(row);
        TAU / self.width as f64 * (top.cos() - bottom.cos())
    }

    fn columns(&self, row: usize) -> &[f32] {
        &self.columns[row * self.width..(row + 1) * self.width]
    }

    pub(super) fn level(&self, half: usize) -> [f64; PARTS] {
        let ends = [[0.0, FRAC_PI_2], [FRAC_PI_2, PI]][half];
        let mut sum = [0.0; PARTS];
        for (row, texels) in self.texels.chunks(self.width).enumerate() {
            let edges = self.edges(row).map(|edge| edge.clamp(ends[0], ends[1]));
            let [top, bottom] = edges.map(|edge| edge.sin().powi(2));
            let weight = 0.5 * (bottom - top).abs() * TAU / self.width as f64;
            for texel in texels.iter().filter(|_| weight > 0.0) {
                sum = std::array::from_fn(|k| sum[k] + weight * f64::from(texel[k]));
            }
        }
        sum
    }

    /// Works out where it is brighter than the mean.
    fn find_spots(&mut self) {
        let of_row = |row: usize| {
            let texels = row * self.width..(row + 1) * self.width;
            self.solid_angle(row) * texels.map(|k| self.bright(k)).sum::<f64>()
        };
        self.mean = (0..self.height).map(of_row).sum::<f64>() / (4.0 * PI);
        let (mut all, mut rows) = (0.0, Vec::with_capacity(self.height));
        let mut columns = Vec::with_capacity(self.texels.len());
        // Rounding must not make spots of an even map.
        let mean = self.mean * (1.0 + 1e-9);
        for row in 0..self.height {
            let texels = row * self.width..(row + 1) * self.width;
            let excess = texels.map(|k| (self.bright(k) - mean).max(0.0));
            let sums = excess.scan(0.0, |sum, excess| {
                *sum += excess;
                Some(*sum)
            });
            let sums: Vec<f64> = sums.collect();
            let sum = sums.last().copied().unwrap_or(0.0);
            let share = |s: f64| if sum > 0.0 { (s / sum) as f32 } else { 0.0 };
            columns.extend(sums.iter().map(|&s| share(s)));
            all += sum * self.solid_angle(row);
            rows.push(all);
        }
        let before = [0.0].into_iter().chain(rows.iter().copied());
        let of_row = rows.iter().zip(before).map(|(upto, before)| upto - before);
        let of_row = of_row.enumerate().map(|(row, excess)| match all > 0.0 {
            true => excess / all / self.solid_angle(row),
            false => 0.0,
        });
        self.row_density = of_row.collect();
        (self.rows, self.columns) = (rows, columns);
    }
}

/// The share of a row before a column, and that of the column.
fn within(columns: &[f32], column: usize) -> [f64; 2] {
    let before = column.checked_sub(1).map_or(0.0, |k| f64::from(columns[k]));
    [before, f64::from(columns[column]) - before]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::sequence02;
    use crate::scene::sky::direction;

    fn map(width: usize, texel: impl Fn(usize, usize) -> [f32; 3], north: f64) -> Map {
        let height = width / 2;
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let texels = places.map(|(x, y)| texel(x, y)).collect();
        let picture = SkyPicture::shrunk(width, height, texels);
        let wanted = Wanted {
            sun: false,
            below: true,
        };
        Map::new(picture, [0.2, 0.7, 0.1], north, wanted).0
    }

    #[test]
    fn the_middle_looks_along_x_and_its_right_half_south() {
        let map = map(8, |x, y| [x as f32, y as f32, 1.0], 0.0);
        let at = |d: DVec3| map.texels[map.texel(d)];
        // East, south, west, north, each a little clockwise of it and above the horizon.
        for (azimuth, column) in [(91.0, 4.0), (181.0, 6.0), (271.0, 0.0), (1.0, 2.0)] {
            assert_eq!(at(direction(10.0, azimuth))[0], column, "{azimuth}");
        }
        for k in 0..32 {
            assert_eq!(map.texel(map.middle(k)), k);
        }
        assert_eq!(at(DVec3::Y)[1], 0.0);
        assert_eq!(at(DVec3::NEG_Y)[1], 3.0);
    }

    #[test]
    fn an_even_map_is_a_uniform_sky_without_spots() {
        for width in [2, 6, 64] {
            let map = map(width, |_, _| [2.0, 3.0, 5.0], 0.3);
            assert!(map.is_even() && !map.has_spots());
            for half in map.levels() {
                for (level, x) in half.into_iter().zip([2.0, 3.0, 5.0]) {
                    assert!((level / (PI * x) - 1.0).abs() < 1e-12);
                }
            }
        }
    }

    /// The mean of f / density over what is found is the integral of f over the excess.
    #[test]
    fn spots_have_their_density() {
        let bright = |x: usize, y: usize| match (x, y) {
            (5, 3) => [900.0, 800.0, 700.0],
            _ => [(x % 3) as f32, (y % 2) as f32, 0.5],
        };
        let map = map(32, bright, 1.0);
        let n = 1 << 14;
        let mut sum = 0.0;
        for k in 0..n {
            let d = map.spot(sequence02(k, 7)).unwrap();
            assert!((d.length() - 1.0).abs() < 1e-12);
            let density = map.spot_density(map.texel(d));
            assert!(density > 0.0);
            sum += map.bright(map.texel(d)) * map.excess_share(map.texel(d)) / density;
        }
        let all = map.rows.last().unwrap();
        assert!((sum / f64::from(n) / all - 1.0).abs() < 1e-3, "{sum} {all}");
        let toward = map.spot([0.5, 0.5]).unwrap();
        assert_eq!(map.texel(toward), 3 * 32 + 5);
    }
}
