//! A spectrum as rows of (wavelength, value), linear between the rows, and the strict reader of its CSV form.
//!
//! Units: nanometres; the unit of the values is the caller's. What lies outside the rows is the caller's choice
//! ([`Outside`]): a reflectance is held, an emission is zero.

use std::fmt;

/// Shortest wavelength that a table may name, nm: anything less was meant as micrometres.
const SHORTEST: f64 = 10.0;
/// Longest wavelength that a table may name, nm.
const LONGEST: f64 = 1e6;
/// Greatest value that a table may hold: sums and products of such values stay finite.
const GREATEST: f64 = 1e30;

/// What a table is worth below its first and above its last row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outside {
    /// The value of the nearest row.
    Hold,
    /// Nothing.
    Zero,
}

/// What is wrong with a CSV.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct CsvProblem {
    /// Line, counted from 1; the last line where something is missing.
    pub line: usize,
    /// One sentence without a full stop.
    pub what: String,
}

impl fmt::Display for CsvProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.what)
    }
}

/// A spectrum, piecewise linear.
///
/// At least two rows; wavelengths in [10, 1e6] nm, strictly increasing; values in [0, 1e30].
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    wavelengths: Vec<f64>,
    values: Vec<f64>,
}

impl Table {
    /// A table from wavelengths (nm) and their values.
    ///
    /// # Errors
    /// Says which row breaks the rules of the type; the line is that of a CSV without header.
    pub fn new(wavelengths: Vec<f64>, values: Vec<f64>) -> Result<Self, CsvProblem> {
        if wavelengths.len() != values.len() {
            let what = format!(
                "{} wavelengths but {} values",
                wavelengths.len(),
                values.len()
            );
            return Err(CsvProblem {
                line: wavelengths.len().min(values.len()) + 1,
                what,
            });
        }
        let mut last = None;
        for (row, (&nm, &value)) in wavelengths.iter().zip(&values).enumerate() {
            check_wavelength(nm, last)
                .and_then(|()| check_value(value))
                .map_err(|what| CsvProblem {
                    line: row + 1,
                    what,
                })?;
            last = Some(nm);
        }
        if values.len() < 2 {
            return Err(CsvProblem {
                line: values.len(),
                what: "fewer than two rows of numbers".into(),
            });
        }
        Ok(Self {
            wavelengths,
            values,
        })
    }

    /// Reads `wavelength_nm,value` rows.
    ///
    /// Lines that begin with `#` and blank lines are skipped. The header `wavelength_nm,<any name>` may be left out.
    /// Decimal points, comma separators, `\n` or `\r\n` ends.
    ///
    /// ```
    /// use haarlight::data::{Outside, Table};
    /// let table = Table::parse_csv("# a ramp\nwavelength_nm,value\n400,0\n500,1\n").unwrap();
    /// assert_eq!(table.at(425.0, Outside::Zero), 0.25);
    /// assert_eq!(table.at(600.0, Outside::Zero), 0.0);
    /// assert_eq!(table.at(600.0, Outside::Hold), 1.0);
    /// let problem = Table::parse_csv("wavelength_nm,value\n400,0\n400,1\n").unwrap_err();
    /// assert_eq!(problem.to_string(), "line 3: wavelength 400 nm does not follow 400 nm: rows must increase");
    /// ```
    ///
    /// # Errors
    /// The first line that breaks a rule, with the rule.
    pub fn parse_csv(text: &str) -> Result<Self, CsvProblem> {
        let columns = CsvColumns::parse(text)?;
        let [values] = <[_; 1]>::try_from(columns.values).map_err(|all| CsvProblem {
            line: columns.first_line,
            what: format!("{} cells in a row, 2 are meant", all.len() + 1),
        })?;
        Ok(Self {
            wavelengths: columns.wavelengths,
            values,
        })
    }

    /// Wavelengths, nm.
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths
    }

    /// Values, one for each wavelength.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// First and last wavelength, nm.
    pub fn range(&self) -> [f64; 2] {
        [
            self.wavelengths[0],
            self.wavelengths[self.wavelengths.len() - 1],
        ]
    }

    /// The value at a wavelength (nm), linear between rows.
    pub fn at(&self, nm: f64, outside: Outside) -> f64 {
        let [first, last] = self.range();
        if nm < first || nm > last || nm.is_nan() {
            return match outside {
                Outside::Zero => 0.0,
                Outside::Hold if nm > last => self.values[self.values.len() - 1],
                Outside::Hold => self.values[0],
            };
        }
        // `above` is at least 1 as nm >= first, and the last segment serves its right end.
        let above = self
            .wavelengths
            .partition_point(|&w| w <= nm)
            .min(self.values.len() - 1);
        let (l, r) = (self.wavelengths[above - 1], self.wavelengths[above]);
        let t = (nm - l) / (r - l);
        self.values[above - 1] * (1.0 - t) + self.values[above] * t
    }

    /// The exact integral of the piecewise linear table over `from..to` (nm, `from <= to`).
    pub fn integral(&self, from: f64, to: f64, outside: Outside) -> f64 {
        let [first, last] = self.range();
        let mut sum = 0.0;
        if outside == Outside::Hold {
            sum += (to.min(first) - from).max(0.0) * self.values[0];
            sum += (to - from.max(last)).max(0.0) * self.values[self.values.len() - 1];
        }
        let (mut left, end) = (from.max(first), to.min(last));
        let mut next = self.wavelengths.partition_point(|&w| w <= left);
        while left < end {
            let right = if next < self.wavelengths.len() {
                self.wavelengths[next].min(end)
            } else {
                end
            };
            sum += 0.5 * (right - left) * (self.at(left, outside) + self.at(right, outside));
            left = right;
            next += 1;
        }
        sum
    }
}

/// A CSV of one or more spectra on the same wavelengths.
#[derive(Debug)]
pub(super) struct CsvColumns {
    /// Names of the value columns; empty without a header.
    pub(super) names: Vec<String>,
    /// Wavelengths, nm.
    pub(super) wavelengths: Vec<f64>,
    /// One list for each value column.
    pub(super) values: Vec<Vec<f64>>,
    /// Line of the header or of the first row.
    first_line: usize,
}

impl CsvColumns {
    pub(super) fn parse(text: &str) -> Result<Self, CsvProblem> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut this = Self {
            names: Vec::new(),
            wavelengths: Vec::new(),
            values: Vec::new(),
            first_line: 0,
        };
        let mut lines = 0;
        for (index, line) in text.lines().enumerate() {
            lines = index + 1;
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            this.row(line, lines)
                .map_err(|what| CsvProblem { line: lines, what })?;
        }
        if this.wavelengths.len() < 2 {
            return Err(CsvProblem {
                line: lines,
                what: "fewer than two rows of numbers".into(),
            });
        }
        Ok(this)
    }

    fn row(&mut self, line: &str, number: usize) -> Result<(), String> {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if cells.len() < 2 {
            return Err("one cell in a row, `wavelength_nm,value` is meant".into());
        }
        if self.first_line == 0 {
            self.first_line = number;
            self.values = vec![Vec::new(); cells.len() - 1];
            if cells[0].eq_ignore_ascii_case("wavelength_nm") {
                self.names = cells[1..].iter().map(|&name| name.to_owned()).collect();
                return Ok(());
            }
        }
        if cells.len() != self.values.len() + 1 {
            return Err(format!(
                "{} cells in a row, {} are meant",
                cells.len(),
                self.values.len() + 1
            ));
        }
        let nm = number_in(cells[0])?;
        check_wavelength(nm, self.wavelengths.last().copied())?;
        self.wavelengths.push(nm);
        for (column, cell) in self.values.iter_mut().zip(&cells[1..]) {
            let value = number_in(cell)?;
            check_value(value)?;
            column.push(value);
        }
        Ok(())
    }

    /// The table of the named column.
    pub(super) fn table(&self, name: &str) -> Option<Table> {
        let column = self.names.iter().position(|n| n == name)?;
        Some(Table {
            wavelengths: self.wavelengths.clone(),
            values: self.values[column].clone(),
        })
    }
}

fn number_in(cell: &str) -> Result<f64, String> {
    // A cell is quoted back in part only: a binary file may hold a line of any length.
    let shown: String = cell.chars().take(40).collect();
    match cell.parse::<f64>() {
        _ if cell.is_empty() => Err("empty cell".into()),
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!("`{shown}` is not finite")),
        Err(_) => Err(format!("`{shown}` is not a number")),
    }
}

fn check_wavelength(nm: f64, last: Option<f64>) -> Result<(), String> {
    if !(SHORTEST..=LONGEST).contains(&nm) {
        return Err(format!(
            "wavelength {nm} is outside {SHORTEST}..{LONGEST} nm"
        ));
    }
    match last {
        Some(last) if nm <= last => Err(format!(
            "wavelength {nm} nm does not follow {last} nm: rows must increase"
        )),
        _ => Ok(()),
    }
}

fn check_value(value: f64) -> Result<(), String> {
    if value < 0.0 {
        Err(format!("value {value} is negative"))
    } else if value <= GREATEST {
        Ok(())
    } else {
        Err(format!("value {value} is not finite or above {GREATEST:e}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn problem(text: &str) -> String {
        Table::parse_csv(text).unwrap_err().to_string()
    }

    #[test]
    fn csv_problems_name_their_line() {
        assert_eq!(problem(""), "line 0: fewer than two rows of numbers");
        assert_eq!(
            problem("# only\n\n400,1"),
            "line 3: fewer than two rows of numbers"
        );
        assert_eq!(
            problem("wavelength_nm,v\n400,1\n390,1"),
            "line 3: wavelength 390 nm does not follow 400 nm: rows must increase"
        );
        assert_eq!(problem("400,1\n410,nan"), "line 2: `nan` is not finite");
        assert_eq!(problem("400,1\n410,1e999"), "line 2: `1e999` is not finite");
        assert_eq!(problem("400,1\n410,-1"), "line 2: value -1 is negative");
        assert_eq!(
            problem("400,1\n410,1e31"),
            "line 2: value 10000000000000000000000000000000 is not finite or above 1e30"
        );
        assert_eq!(problem("400,1\n410,"), "line 2: empty cell");
        assert_eq!(
            problem("400,1\n410,1,2"),
            "line 2: 3 cells in a row, 2 are meant"
        );
        assert_eq!(
            problem("400,1,2\n410,1,2"),
            "line 1: 3 cells in a row, 2 are meant"
        );
        assert_eq!(
            problem("400;1\n410;1"),
            "line 1: one cell in a row, `wavelength_nm,value` is meant"
        );
        assert_eq!(problem("nm,value\n410,1"), "line 1: `nm` is not a number");
        assert_eq!(
            problem("0.4,1\n0.5,1"),
            "line 1: wavelength 0.4 is outside 10..1000000 nm"
        );
    }

    #[test]
    fn accepts_windows_ends_byte_order_mark_and_no_header() {
        let plain = Table::parse_csv("400,1\n500,2\n").unwrap();
        assert_eq!(
            Table::parse_csv("\u{feff}# c\r\nWavelength_nm, red\r\n400, 1\r\n500, 2\r\n").unwrap(),
            plain
        );
    }

    #[test]
    fn integral_of_a_tent_is_its_area() {
        let tent = Table::new(vec![400.0, 450.0, 500.0], vec![0.0, 1.0, 0.0]).unwrap();
        assert!((tent.integral(300.0, 600.0, Outside::Zero) - 50.0).abs() < 1e-12);
        assert!((tent.integral(425.0, 475.0, Outside::Zero) - 37.5).abs() < 1e-12);
        let step = Table::new(vec![400.0, 500.0], vec![2.0, 2.0]).unwrap();
        assert_eq!(step.integral(390.0, 520.0, Outside::Zero), 200.0);
        assert_eq!(step.integral(390.0, 520.0, Outside::Hold), 260.0);
        assert_eq!(step.integral(600.0, 610.0, Outside::Hold), 20.0);
        assert_eq!(step.integral(600.0, 610.0, Outside::Zero), 0.0);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "\\PC*|([0-9.,eE#\\-\r\n]|wavelength_nm){0,80}") {
            if let Ok(table) = Table::parse_csv(&text) {
                prop_assert!(table.at(500.0, Outside::Hold).is_finite());
                prop_assert!(table.integral(0.0, 1e6, Outside::Hold).is_finite());
            }
        }

        #[test]
        fn integrals_add(cut in 350.0..800.0f64) {
            let table = crate::data::named("cie/F2").unwrap().table;
            for outside in [Outside::Hold, Outside::Zero] {
                let parts = table.integral(350.0, cut, outside) + table.integral(cut, 800.0, outside);
                prop_assert!((parts - table.integral(350.0, 800.0, outside)).abs() < 1e-9);
            }
        }
    }
}
