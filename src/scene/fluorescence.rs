//! Fluorescence: surfaces that take in light of some wavelengths and give a part of it out again at others, evenly to all sides.
//!
//! With the irradiance E a surface sends out `B(band) = rho(band) E(band) + sum over terms of e(band) q`,
//! `q = integral of g(mu) E(mu) d mu`: a Donaldson matrix (Donaldson 1954, British Journal of Applied Physics 5, 210) as a diagonal and few
//! products of an emission spectrum e (1/nm, its integral is 1) and an excitation g, the power that leaves for a unit of power that comes.
//!
//! A side file says it by what a dye absorbs and by its quantum yield, or as a whole matrix:
//!
//! ```json
//! { "materials": { "sheet": { "fluorescence": { "excitation": { "csv": "taken.csv" }, "emission": { "csv": "given.csv" }, "yield": 0.8 } },
//!                  "card":  { "fluorescence": { "csv": "card.csv" } } } }
//! ```
//!
//! `excitation` is the share of the light that the dye absorbs, 0 to 1, of photons and of power alike; `emission` is relative spectral
//! power; `yield` counts photons. A photon of wavelength mu that is given out again at the mean of the emission,
//! `l = integral of lambda e`, keeps mu / l of its energy, so `g(mu) = excitation(mu) yield mu / l`, and never more than is absorbed.
//! Several dyes are a list. Beyond their rows both spectra are 0. The matrix: rows of emission, columns of excitation, the unit (`per_nm` or
//! `per_band`) in the first cell, the reflectance where both wavelengths are equal; see `scene/bispectral.rs`.
//!
//! What is given out has no shorter wavelengths than what excites it, but for a tail: more than a fifth there is a problem, for dyes as
//! for matrices.
//!
//! No more power leaves a surface than comes at any wavelength: `rho + g` above 1 is a problem where both are measured; a base colour,
//! painted or not, reflects what the dye leaves of [`GREATEST_ALBEDO`](super::GREATEST_ALBEDO). Light does not wait: no phosphorescence.

use super::LightSpectrum;
use super::bispectral::{Bispectral, UPHILL};
use super::check::Check;
use super::json::short;
use super::reader::Reader;
use crate::data::{BANDS, Grid, Outside, Spectrum, Table, TableKind};
use serde_json::{Map, Value};

/// Steps over an excitation, 1 nm of most of them: a share of a fifth is asked for.
const STEPS: u32 = 400;

/// What a material fluoresces.
#[derive(Debug, Clone, PartialEq)]
pub struct Fluorescence {
    /// Emission spectra with what excites them.
    pub terms: Vec<Term>,
    /// Where it comes from, for the plan and for `inspect`.
    pub from: String,
}

/// One emission spectrum.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Index in [`Scene::spectra`](crate::scene::Scene::spectra): the emission, whose power there is 1/nm, with an integral of at most 1
    /// over the grid.
    pub light: usize,
    /// Power given out for a unit of power that comes, by band, in [0, 1): what the text above calls g.
    pub excitation: Spectrum,
    /// Of which layer light must be to excite it; none: any.
    pub layer: Option<usize>,
}

impl Fluorescence {
    /// Each term once: copies of a term for the layers are excited by light of their own.
    pub(crate) fn once(&self) -> impl Iterator<Item = &Term> {
        let first = self.terms.first().and_then(|t| t.layer);
        self.terms.iter().filter(move |t| t.layer == first)
    }

    /// Power given out for a unit of power that comes, by band, all terms together.
    pub fn efficiency(&self) -> Spectrum {
        let mut sum = [0.0; BANDS];
        for term in self.once() {
            (sum.iter_mut().zip(&term.excitation)).for_each(|(s, g)| *s += g);
        }
        sum
    }

    /// The Donaldson matrix without its diagonal of reflection: element `[i][j]` is the spectral exitance on band i for a unit of
    /// spectral irradiance on band j, `width` the width of a band, nm.
    pub fn matrix(&self, spectra: &[LightSpectrum], width: f64) -> Vec<Spectrum> {
        let element = |i: usize, j: usize| {
            let each = self
                .once()
                .map(|t| spectra[t.light].power[i] * t.excitation[j]);
            each.sum::<f64>() * width
        };
        let row = |i: usize| std::array::from_fn(|j| element(i, j));
        (0..BANDS).map(row).collect()
    }
}

/// What a side file says of fluorescence.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct FluorescenceWish {
    /// Emission (1/nm) and excitation of each term.
    pub(crate) terms: Vec<[Spectrum; 2]>,
    /// In words.
    pub(crate) from: String,
    /// Diagonal of a matrix: the reflectance, if it holds one.
    pub(crate) diagonal: Option<Spectrum>,
}

/// Reads the fluorescence of a material's entry: an object, or a list of them.
pub(super) fn read(reader: &mut Reader, value: &Value, place: &str) -> Option<FluorescenceWish> {
    let place = format!("{place}, fluorescence");
    let list = match value {
        Value::Array(list) => list.iter().collect(),
        one => vec![one],
    };
    let mut wish = FluorescenceWish::default();
    let mut said = Vec::new();
    for (k, value) in list.iter().enumerate() {
        let place = match list.len() {
            1 => place.clone(),
            _ => format!("{place} {}", k + 1),
        };
        let object = reader.object(value, &place)?;
        if object.contains_key("csv") {
            let matrix = matrix(reader, object, &place)?;
            if wish.diagonal.is_some() && matrix.diagonal.is_some() {
                let what = "two matrices hold a reflectance on their diagonals";
                (reader.check).problem(&place, what, "leave the diagonal of one at 0");
            }
            wish.diagonal = wish.diagonal.or(matrix.diagonal);
            wish.terms.extend(matrix.terms);
            said.push(matrix.from);
        } else {
            let (term, from) = dye(reader, object, &place)?;
            wish.terms.push(term);
            said.push(from);
        }
    }
    wish.terms
        .retain(|[_, excitation]| excitation.iter().any(|g| *g > 0.0));
    wish.from = said.join("; ");
    Some(wish)
}

/// A dye by what it absorbs, what it gives out, and its quantum yield.
fn dye(
    reader: &mut Reader,
    object: &Map<String, Value>,
    place: &str,
) -> Option<([Spectrum; 2], String)> {
    reader.keys(object, &["excitation", "emission", "yield", "csv"], place);
    let quantum = object.get("yield").and_then(Value::as_f64);
    let quantum = quantum.filter(|q| (0.0..=1.0).contains(q));
    if quantum.is_none() {
        let what = match object.get("yield") {
            Some(value) => format!("its yield is {}", short(&value.to_string())),
            None => "says no yield".into(),
        };
        let next =
            "give the quantum yield, photons given out for each that is absorbed, from 0 to 1";
        reader.check.problem(place, what, next);
    }
    let mut table = |key: &str, kind: TableKind| {
        let place = format!("{place}, {key}");
        let Some(value) = object.get(key) else {
            let next = "say {\"excitation\": {\"csv\": ...}, \"emission\": {\"csv\": ...}, \"yield\": ...}";
            reader.check.problem(&place, "is missing", next);
            return None;
        };
        let object = reader.object(value, &place)?;
        reader.keys(object, &["name", "csv"], &place);
        reader.table(object, kind, &place)
    };
    let absorbed = table("excitation", TableKind::Reflectance);
    let emission = table("emission", TableKind::Illuminant);
    let ((absorbed, taken), (emission, given), quantum) = (absorbed?, emission?, quantum?);
    if let Some(most) = absorbed.values().iter().copied().find(|x| *x > 1.0) {
        let what = format!("'{}' goes up to {most}", short(&taken));
        let next = "write the share of light that the dye absorbs, from 0 to 1";
        (reader.check).problem(&format!("{place}, excitation"), what, next);
        return None;
    }
    let grid = *reader.grid;
    let spectrum = normalised(&emission, &grid);
    let Some(spectrum) = spectrum.filter(|e| e.iter().any(|x| *x > 0.0)) else {
        let (start, end) = (grid.start(), grid.end());
        let what = format!(
            "'{}' gives no light from {start} to {end} nm",
            short(&given)
        );
        let next = "give the emission in nanometres, or widen --range";
        (reader.check).problem(&format!("{place}, emission"), what, next);
        return None;
    };
    let (share, at) = uphill(&absorbed, &emission);
    if share > UPHILL {
        let next = "are excitation and emission each in the other's place?";
        goes_uphill(reader.check, place, "", [share, at], next);
        return None;
    }
    let mean = mean_wavelength(&emission);
    let out = |nm: f64, share: f64| share * (quantum * nm / mean).min(1.0);
    // At the table's rows and the edges of the bands: between them both factors are smooth.
    let excitation = power(&absorbed, &grid, out);
    outside(reader.check, &absorbed, &grid, place);
    let most = absorbed.wavelengths().iter().zip(absorbed.values());
    let most = most.max_by(|a, b| a.1.total_cmp(b.1));
    let peak = most.map_or(0.0, |(nm, _)| *nm);
    let from = format!(
        "light of {peak:.0} nm above all, given out at {mean:.0} nm in the mean, yield {quantum}"
    );
    Some(([spectrum, excitation], from))
}

/// Says what share of an excitation lies beyond the grid.
fn outside(check: &mut Check, absorbed: &Table, grid: &Grid, place: &str) {
    let [first, last] = absorbed.range();
    let all = absorbed.integral(first, last, Outside::Zero);
    let seen = absorbed.integral(grid.start(), grid.end(), Outside::Zero);
    let share = 1.0 - seen / all;
    // Less is nothing to speak of.
    if all > 0.0 && share > 0.01 {
        check.warn(format!(
            "{place}: {:.0} % of its excitation lies outside of {} to {} nm and is left out (--range 300..780 takes in the \
             ultraviolet)",
            100.0 * share,
            grid.start(),
            grid.end()
        ));
    }
}

/// A matrix from a CSV.
fn matrix(
    reader: &mut Reader,
    object: &Map<String, Value>,
    place: &str,
) -> Option<FluorescenceWish> {
    reader.keys(object, &["csv"], place);
    let (text, from) = reader.text(object, place)?;
    match Bispectral::parse(&text) {
        Ok(matrix) => {
            let (share, at) = matrix.uphill();
            if share > UPHILL {
                let file = format!("'{}', ", short(&from));
                let next = "rows are wavelengths of emission, columns of excitation: is the matrix transposed?";
                goes_uphill(reader.check, place, &file, [share, at], next);
                return None;
            }
            let terms = matrix.terms();
            let said = format!(
                "{}: {} of emission, off by {:.2} % of the matrix",
                short(&from),
                match terms.all.len() {
                    1 => "1 spectrum".to_owned(),
                    n => format!("{n} spectra"),
                },
                100.0 * terms.error
            );
            if terms.error > super::bispectral::TOLERABLE {
                reader.check.warn(format!("{place}: {said}"));
            }
            let on_grid = |[emission, excitation]: &[Table; 2]| {
                let spectrum = normalised(emission, reader.grid)?;
                Some([spectrum, reader.grid.means(excitation, Outside::Zero)])
            };
            let diagonal = matrix.diagonal();
            Some(FluorescenceWish {
                terms: terms.all.iter().filter_map(on_grid).collect(),
                from: said,
                diagonal: diagonal.map(|table| reader.grid.means(&table, Outside::Hold)),
            })
        }
        Err(why) => {
            let next = "rows are wavelengths of emission, columns of excitation; the first cell says per_nm or per_band";
            let what = format!("'{}', {why}", short(&from));
            reader.check.problem(place, what, next);
            None
        }
    }
}

/// Light of shorter wavelengths than what excites it, and most of it excited at `at`.
fn goes_uphill(check: &mut Check, place: &str, file: &str, [share, at]: [f64; 2], next: &str) {
    let what = format!(
        "{file}{:.0} % of what is given out has shorter wavelengths than what excites it, most of that excited at {at} nm",
        100.0 * share
    );
    check.problem(place, what, next);
}

/// The share of a dye's emission at shorter wavelengths than what excites it, all excitations with the same power, and the excitation
/// that most of it comes from, nm.
fn uphill(absorbed: &Table, emission: &Table) -> (f64, f64) {
    let [first, last] = emission.range();
    let whole = emission.integral(first, last, Outside::Zero);
    let [low, high] = absorbed.range();
    let (mut all, mut short, mut worst) = (0.0, 0.0, (0.0, low));
    for k in 0..STEPS {
        let nm = low + (high - low) * (f64::from(k) + 0.5) / f64::from(STEPS);
        let taken = absorbed.at(nm, Outside::Zero);
        let below = emission.integral(first, nm.clamp(first, last), Outside::Zero);
        let here = taken * below / whole;
        (all, short) = (all + taken, short + here);
        if here > worst.0 {
            worst = (here, nm.round());
        }
    }
    (if all > 0.0 { short / all } else { 0.0 }, worst.1)
}

/// An emission on the grid, 1/nm, the integral of its whole table 1; none of a table of zeros.
fn normalised(table: &Table, grid: &Grid) -> Option<Spectrum> {
    let [first, last] = table.range();
    let all = table.integral(first, last, Outside::Zero);
    (all > 0.0).then(|| grid.means(table, Outside::Zero).map(|x| x / all))
}

/// Mean wavelength of an emission by power, nm: that of its mean photon, `h c / l` being its energy.
fn mean_wavelength(table: &Table) -> f64 {
    let [first, last] = table.range();
    let all = table.integral(first, last, Outside::Zero);
    // Simpson's rule, exact for the product of two linear functions on each segment.
    let rows = table.wavelengths().iter().zip(table.values());
    let rows: Vec<(f64, f64)> = rows.map(|(w, v)| (*w, *v)).collect();
    let moment: f64 = (rows.windows(2))
        .map(|pair| {
            let [(a, x), (b, y)] = [pair[0], pair[1]];
            (b - a) / 6.0 * (a * x + (a + b) * (x + y) + b * y)
        })
        .sum();
    moment / all
}

/// Means over the bands of a share that depends on the table's value and the wavelength.
fn power(table: &Table, grid: &Grid, share: impl Fn(f64, f64) -> f64) -> Spectrum {
    std::array::from_fn(|band| {
        let (from, to) = (grid.left(band), grid.left(band + 1));
        let mut ends = vec![from];
        ends.extend(
            table
                .wavelengths()
                .iter()
                .filter(|w| **w > from && **w < to),
        );
        ends.push(to);
        let at = |nm: f64| share(nm, table.at(nm, Outside::Zero));
        let part = |pair: &[f64]| {
            let (a, b) = (pair[0], pair[1]);
            // Just inside, for the table ends abruptly.
            let inset = 1e-9 * (b - a);
            (b - a) / 6.0 * (at(a + inset) + 4.0 * at(0.5 * (a + b)) + at(b - inset))
        };
        ends.windows(2).map(part).sum::<f64>() / grid.width()
    })
}
