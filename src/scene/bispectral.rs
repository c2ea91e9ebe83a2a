//! Bispectral reflectance from a CSV, taken apart into reflection and a few products of an emission and an excitation.
//!
//! ```text
//! # lines with a hash are passed over
//! per_nm,300,310,320,...            wavelengths of excitation, nm; the first cell holds the unit
//! 300,0.05,0,0,...                  a row for each wavelength of emission, nm
//! ```
//!
//! Where both wavelengths are equal a cell is the reflectance, unit 1. Elsewhere it is, `per_nm`, the spectral exitance in W/m2/nm for an
//! irradiance of 1 W/m2 at the excitation, or, `per_band`, that for a spectral irradiance of 1 W/m2/nm over the column's band, which is as
//! wide as half the way to both neighbours: what is measured band by band. Between wavelengths both spectra of a product are linear,
//! beyond the ends 0. Nothing is negative.
//!
//! Light that is given out has no shorter wavelengths than what excites it (Stokes 1852), but for a tail where both spectra overlap. More
//! than [`UPHILL`] there, of what all columns give out for the same power each, is a problem: with rows for columns it is nearly all.
//!
//! The products are found by alternating least squares, column by column and never below 0 (hierarchical alternating least squares,
//! Cichocki, Zdunek and Amari 2007), with the diagonal left out, where reflection hides what fluoresces. There are as few as describe the
//! matrix to [`GOOD`], at most [`MOST`].

use crate::data::{Outside, Table};

/// Products are enough when the root of the squares they miss is less than this share of that of all.
pub(super) const GOOD: f64 = 0.01;
/// More than this is worth a warning.
pub(super) const TOLERABLE: f64 = 0.05;
/// Share of the power given out that may have shorter wavelengths than what excites it. Two bands alike, s wide (standard deviation) and d
/// apart, have `Phi(-d / (s sqrt 2))`: .10 for fluorescein (494 and 521 nm, 15 nm wide), .14 for dyes of the red.
pub(super) const UPHILL: f64 = 0.2;
/// Products at the most: each is a light spectrum of its own.
const MOST: usize = 4;
/// Rounds of least squares at the most: a second for a matrix of 500 by 500.
const ROUNDS: usize = 500;
/// A round that changes the error by less than this share of all is the last.
const STILL: f64 = 1e-7;
/// Wavelengths along a side at the most: 1 nm from 300 to 800 are 501.
const LARGEST: usize = 512;
/// What a wavelength may be, nm.
const WAVELENGTHS: std::ops::RangeInclusive<f64> = 10.0..=1e6;

/// A matrix as it was read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bispectral {
    emission: Vec<f64>,
    excitation: Vec<f64>,
    /// Row by row, density by wavelength (1/nm) off the diagonal; 0 on it.
    cells: Vec<Vec<f64>>,
    /// For each row the column of the same wavelength, and the reflectance there.
    same: Vec<Option<(usize, f64)>>,
}

/// Products, and what they miss.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Terms {
    /// Emission and excitation; the integral of the emission is 1.
    pub(super) all: Vec<[Table; 2]>,
    /// Root of the squares missed over that of all.
    pub(super) error: f64,
}

impl Bispectral {
    /// Reads a CSV.
    ///
    /// # Errors
    /// What is wrong, with its line.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let lines = text
            .lines()
            .enumerate()
            .map(|(k, line)| (k + 1, line.trim()));
        let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let (first, head) = lines.next().ok_or("line 1: holds no numbers")?;
        let mut head = head.split(',').map(str::trim);
        let unit = head.next().unwrap_or_default();
        let per_band = match (unit.contains("per_nm"), unit.contains("per_band")) {
            (true, false) => false,
            (false, true) => true,
            _ => {
                return Err(format!(
                    "line {first}: its first cell says neither per_nm nor per_band"
                ));
            }
        };
        let at = |line: usize| move |why: String| format!("line {line}: {why}");
        let mut this = Self {
            emission: Vec::new(),
            excitation: Vec::new(),
            cells: Vec::new(),
            same: Vec::new(),
        };
        for cell in head {
            let nm = wavelength(cell, this.excitation.last()).map_err(at(first))?;
            this.excitation.push(nm);
        }
        let wide = this.excitation.len();
        for (number, line) in lines {
            this.row(line).map_err(at(number))?;
        }
        if wide < 2 || this.emission.len() < 2 || wide.max(this.emission.len()) > LARGEST {
            let tall = this.emission.len();
            return Err(format!(
                "line {first}: {tall} rows of {wide} cells, and 2 to {LARGEST} are meant"
            ));
        }
        if per_band {
            let widths = widths(&this.excitation);
            for row in &mut this.cells {
                (row.iter_mut().zip(&widths)).for_each(|(cell, width)| *cell /= width);
            }
        }
        Ok(this)
    }

    fn row(&mut self, line: &str) -> Result<(), String> {
        let mut cells = line.split(',').map(str::trim);
        let nm = wavelength(cells.next().unwrap_or_default(), self.emission.last())?;
        let mut row = cells.map(number).collect::<Result<Vec<f64>, String>>()?;
        if row.len() != self.excitation.len() {
            let (found, meant) = (row.len() + 1, self.excitation.len() + 1);
            return Err(format!("{found} cells, {meant} are meant"));
        }
        let column = self.excitation.iter().position(|e| (e - nm).abs() < 1e-6);
        let same = column.map(|k| (k, std::mem::take(&mut row[k])));
        if let Some((_, rho)) = same.filter(|(_, rho)| *rho > 1.0) {
            return Err(format!("the reflectance at {nm} nm is {rho}, above 1"));
        }
        self.emission.push(nm);
        self.cells.push(row);
        self.same.push(same);
        Ok(())
    }

    /// The share that is given out at shorter wavelengths than what excites it, and the excitation that most of it comes from, nm.
    pub(super) fn uphill(&self) -> (f64, f64) {
        let (heights, widths) = (widths(&self.emission), widths(&self.excitation));
        let (mut all, mut short, mut worst) = (0.0, 0.0, (0.0, 0.0));
        for (c, (&taken, width)) in self.excitation.iter().zip(widths).enumerate() {
            let mut here = 0.0;
            for (r, (&given, height)) in self.emission.iter().zip(&heights).enumerate() {
                let power = self.cells[r][c] * height * width;
                all += power;
                here += if given < taken { power } else { 0.0 };
            }
            short += here;
            if here > worst.0 {
                worst = (here, taken);
            }
        }
        (if all > 0.0 { short / all } else { 0.0 }, worst.1)
    }

    /// The reflectance, if the diagonal holds one.
    pub(super) fn diagonal(&self) -> Option<Table> {
        let on = self.same.iter().zip(&self.emission);
        let rows = on.filter_map(|(same, nm)| same.map(|(_, rho)| (*nm, rho)));
        let (nm, rho): (Vec<f64>, Vec<f64>) = rows.unzip();
        let given = rho.iter().any(|r| *r > 0.0);
        given.then(|| Table::new(nm, rho).ok()).flatten()
    }

    /// The products that describe what is beside the diagonal.
    pub(super) fn terms(&self) -> Terms {
        let mut left = self.cells.clone();
        let whole = self.squares(&left);
        let mut products: Vec<[Vec<f64>; 2]> = Vec::new();
        let mut error = if whole > 0.0 { 1.0 } else { 0.0 };
        while error > GOOD && products.len() < MOST {
            let Some(next) = self.brightest(&left) else {
                break;
            };
            add(&mut left, &next, -1.0);
            products.push(next);
            for _ in 0..ROUNDS {
                let before = error;
                for product in &mut products {
                    self.improve(product, &mut left);
                }
                error = (self.squares(&left) / whole).sqrt();
                if (before - error).abs() < STILL {
                    break;
                }
            }
        }
        let all = products.into_iter().filter_map(|[emission, excitation]| {
            let emission = Table::new(self.emission.clone(), emission).ok()?;
            let [first, last] = emission.range();
            let size = emission.integral(first, last, Outside::Zero);
            let excitation = excitation.iter().map(|x| x * size).collect();
            let excitation = Table::new(self.excitation.clone(), excitation).ok()?;
            let values = emission.values().iter().map(|x| x / size).collect();
            let emission = Table::new(self.emission.clone(), values).ok()?;
            Some([emission, excitation])
        });
        Terms {
            all: all.collect(),
            error,
        }
    }

    /// Cells of a row that are not on the diagonal.
    fn counted<'a>(&self, row: usize, cells: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let same = self.same[row].map(|(column, _)| column);
        let cells = cells.iter().copied().enumerate();
        cells.filter(move |(column, _)| Some(*column) != same)
    }

    /// Sum of squares off the diagonal.
    fn squares(&self, cells: &[Vec<f64>]) -> f64 {
        let rows = cells.iter().enumerate();
        rows.map(|(r, row)| self.counted(r, row).map(|(_, x)| x * x).sum::<f64>())
            .sum()
    }

    /// A product to begin with: the column of which most is left, and how much of it every other column has.
    fn brightest(&self, left: &[Vec<f64>]) -> Option<[Vec<f64>; 2]> {
        let mut sizes = vec![0.0; self.excitation.len()];
        for (r, row) in left.iter().enumerate() {
            for (c, x) in self.counted(r, row) {
                sizes[c] += x.max(0.0).powi(2);
            }
        }
        let best = (0..sizes.len()).max_by(|&a, &b| sizes[a].total_cmp(&sizes[b]))?;
        let at = |r: usize| match self.same[r] {
            Some((column, _)) if column == best => 0.0,
            _ => left[r][best].max(0.0),
        };
        let u: Vec<f64> = (0..left.len()).map(at).collect();
        let mut v = vec![0.0; sizes.len()];
        for (r, row) in left.iter().enumerate() {
            for (c, x) in self.counted(r, row) {
                v[c] += u[r] * x.max(0.0) / sizes[best];
            }
        }
        (sizes[best] > 0.0).then_some([u, v])
    }

    /// Least squares for both spectra of a product, the others given; `left` is what all of them leave.
    fn improve(&self, product: &mut [Vec<f64>; 2], left: &mut [Vec<f64>]) {
        add(left, product, 1.0);
        let [u, v] = product;
        let mut sums = vec![[0.0; 2]; u.len()];
        for (r, row) in left.iter().enumerate() {
            for (c, x) in self.counted(r, row) {
                sums[r][0] += v[c] * x;
                sums[r][1] += v[c] * v[c];
            }
        }
        fit(u, &sums);
        let mut sums = vec![[0.0; 2]; v.len()];
        for (r, row) in left.iter().enumerate() {
            for (c, x) in self.counted(r, row) {
                sums[c][0] += u[r] * x;
                sums[c][1] += u[r] * u[r];
            }
        }
        fit(v, &sums);
        add(left, product, -1.0);
    }
}

/// Adds a multiple of a product to the cells.
fn add(cells: &mut [Vec<f64>], [u, v]: &[Vec<f64>; 2], sign: f64) {
    for (row, u) in cells.iter_mut().zip(u) {
        row.iter_mut().zip(v).for_each(|(x, v)| *x += sign * u * v);
    }
}

/// The quotients of sums, never below 0; a spectrum that would come to nothing stays as it is, as it would never come back.
fn fit(spectrum: &mut [f64], sums: &[[f64; 2]]) {
    if sums.iter().any(|[over, under]| *over > 0.0 && *under > 0.0) {
        for (x, [over, under]) in spectrum.iter_mut().zip(sums) {
            if *under > 0.0 {
                *x = (over / under).max(0.0);
            }
        }
    }
}

/// Half the way to both neighbours; at the ends as much on either side.
fn widths(nm: &[f64]) -> Vec<f64> {
    let last = nm.len() - 1;
    let half = |k: usize| 0.5 * (nm[k + 1] - nm[k]);
    let each = (0..=last).map(|k| match k {
        0 => 2.0 * half(0),
        k if k == last => 2.0 * half(last - 1),
        k => half(k - 1) + half(k),
    });
    each.collect()
}

fn number(cell: &str) -> Result<f64, String> {
    let shown: String = cell.chars().take(40).collect();
    match cell.parse::<f64>() {
        Ok(value) if (0.0..=1e30).contains(&value) => Ok(value),
        Ok(_) => Err(format!("`{shown}` is negative or not finite")),
        Err(_) => Err(format!("`{shown}` is not a number")),
    }
}

fn wavelength(cell: &str, last: Option<&f64>) -> Result<f64, String> {
    let nm = number(cell)?;
    match last {
        _ if !WAVELENGTHS.contains(&nm) => Err(format!("{nm} is no wavelength in nm")),
        Some(last) if nm <= *last => Err(format!("{nm} nm does not follow {last} nm")),
        _ => Ok(nm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix of dyes, each an emission and an excitation, with a reflectance on its diagonal.
    fn of(dyes: &[[&dyn Fn(f64) -> f64; 2]], rho: f64, unit: &str) -> String {
        let nm: Vec<f64> = (0..30).map(|k| 320.0 + 10.0 * f64::from(k)).collect();
        let head: Vec<String> = nm.iter().map(f64::to_string).collect();
        let mut text = format!("{unit},{}\n", head.join(","));
        for out in &nm {
            let cell = |taken: &f64| match out == taken {
                true => rho,
                false => dyes.iter().map(|[e, g]| e(*out) * g(*taken)).sum(),
            };
            let row: Vec<String> = nm.iter().map(|x| format!("{:e}", cell(x))).collect();
            text += &format!("{out},{}\n", row.join(","));
        }
        text
    }

    fn bump(middle: f64, wide: f64) -> impl Fn(f64) -> f64 {
        move |nm: f64| (-((nm - middle) / wide).powi(2)).exp()
    }

    #[test]
    fn dyes_are_found_again() {
        let (a, b) = (bump(440.0, 30.0), bump(365.0, 25.0));
        let (c, d) = (bump(560.0, 20.0), bump(480.0, 40.0));
        for (dyes, count) in [
            (vec![[&a as &dyn Fn(f64) -> f64, &b]], 1),
            (vec![[&a as _, &b as _], [&c as _, &d as _]], 2),
        ] {
            let matrix = Bispectral::parse(&of(&dyes, 0.4, "per_nm")).unwrap();
            let terms = matrix.terms();
            assert_eq!(terms.all.len(), count);
            assert!(terms.error < 1e-3, "{}", terms.error);
            for (out, taken) in [(440.0, 360.0), (450.0, 380.0), (560.0, 480.0)] {
                let made = terms
                    .all
                    .iter()
                    .map(|[e, g]| e.at(out, Outside::Zero) * g.at(taken, Outside::Zero));
                let (made, meant) = (
                    made.sum::<f64>(),
                    dyes.iter().map(|[e, g]| e(out) * g(taken)).sum::<f64>(),
                );
                assert!((made - meant).abs() < 2e-3, "{out} {taken}: {made} {meant}");
            }
            let rho = matrix.diagonal().unwrap();
            assert!(rho.values().iter().all(|r| *r == 0.4));
        }
    }

    #[test]
    fn bands_are_ten_nanometres_wide() {
        let (a, b) = (bump(440.0, 30.0), bump(365.0, 25.0));
        let dyes = [[&a as &dyn Fn(f64) -> f64, &b]];
        let [nm, band] = ["per_nm", "per_band"].map(|unit| {
            let matrix = Bispectral::parse(&of(&dyes, 0.0, unit)).unwrap();
            assert!(matrix.diagonal().is_none());
            matrix.terms().all[0][1].at(370.0, Outside::Zero)
        });
        assert!((nm / band - 10.0).abs() < 1e-6, "{nm} {band}");
    }

    /// Rows for columns: all that goes to longer wavelengths goes to shorter ones.
    #[test]
    fn a_transposed_matrix_goes_uphill() {
        let (a, b) = (bump(440.0, 30.0), bump(365.0, 25.0));
        let of = |dye: [&dyn Fn(f64) -> f64; 2]| {
            let matrix = Bispectral::parse(&of(&[dye], 0.4, "per_nm")).unwrap();
            matrix.uphill()
        };
        let ((right, _), (wrong, at)) = (of([&a, &b]), of([&b, &a]));
        assert!(right < 0.01 && wrong > 0.99, "{right} {wrong}");
        assert!((430.0..=450.0).contains(&at), "{at}");
        assert!((right + wrong - 1.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_fluoresces() {
        let matrix = Bispectral::parse(&of(&[], 0.4, "per_nm")).unwrap();
        assert!(matrix.terms().all.is_empty());
    }

    #[test]
    fn problems_name_their_line() {
        for (text, what) in [
            ("", "line 1: holds no numbers"),
            (
                "nm,300,310\n300,0,0\n310,0,0",
                "line 1: its first cell says neither",
            ),
            ("per_nm,300,290\n", "line 1: 290 nm does not follow 300 nm"),
            ("per_nm,300,310\n300,0\n", "line 2: 2 cells, 3 are meant"),
            (
                "# x\nper_nm,300,310\n300,0,-1\n",
                "line 3: `-1` is negative",
            ),
            (
                "per_nm,300,310\n300,1.5,0\n",
                "line 2: the reflectance at 300 nm is 1.5",
            ),
            ("per_nm,300,310\n300,0,0\n", "line 1: 1 rows of 2 cells"),
            ("per_nm,300,x\n", "line 1: `x` is not a number"),
            ("per_nm,0.3,0.31\n", "line 1: 0.3 is no wavelength"),
        ] {
            let why = Bispectral::parse(text).unwrap_err();
            assert!(why.contains(what), "{what} -- {why}");
        }
    }
}
