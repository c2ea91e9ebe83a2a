//! Tables of text: aligned for the terminal, Markdown (aligned as well) and CSV (RFC 4180).
//!
//! Widths count characters, not bytes; wide East Asian characters are taken for one.

use std::fmt::Write;

/// Side on which a column is flush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Text.
    Left,
    /// Numbers.
    Right,
}

/// A table under construction.
///
/// ```
/// use haarlight::report::{Align, TextTable};
/// let mut table = TextTable::new([("phase", Align::Left), ("s", Align::Right)]);
/// table.row(["links", "0.25"]);
/// table.row(["gather", "12.00"]);
/// assert_eq!(table.terminal(), "phase       s\n------  -----\nlinks    0.25\ngather  12.00\n");
/// ```
#[derive(Debug, Clone)]
pub struct TextTable {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl TextTable {
    /// Columns by title.
    pub fn new<T: Into<String>>(columns: impl IntoIterator<Item = (T, Align)>) -> Self {
        Self {
            columns: columns
                .into_iter()
                .map(|(title, align)| (title.into(), align))
                .collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; missing cells are empty, those beyond the last column are left out.
    pub fn row<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }

    /// For the terminal: two spaces between columns, a rule below the titles.
    pub fn terminal(&self) -> String {
        let clean: Vec<Vec<String>> = self.cells(|c| c.replace(['\n', '\r'], " "));
        let widths = self.widths(&clean, 0);
        let mut out = String::new();
        for (i, row) in clean.iter().enumerate() {
            let cells: Vec<String> = self.padded(row, &widths);
            let _ = writeln!(out, "{}", cells.join("  ").trim_end());
            if i == 0 {
                let rules: Vec<String> = widths.iter().map(|&w| "-".repeat(w)).collect();
                let _ = writeln!(out, "{}", rules.join("  "));
            }
        }
        out
    }

    /// For Markdown (GitHub's tables).
    pub fn markdown(&self) -> String {
        let clean = self.cells(|c| c.replace('|', "\\|").replace(['\n', '\r'], " "));
        let widths = self.widths(&clean, 3);
        let mut out = String::new();
        for (i, row) in clean.iter().enumerate() {
            let _ = writeln!(out, "| {} |", self.padded(row, &widths).join(" | "));
            if i == 0 {
                let rule = |(&w, (_, align)): (&usize, &(String, Align))| match align {
                    Align::Left => "-".repeat(w),
                    Align::Right => format!("{}:", "-".repeat(w - 1)),
                };
                let rules: Vec<String> = widths.iter().zip(&self.columns).map(rule).collect();
                let _ = writeln!(out, "| {} |", rules.join(" | "));
            }
        }
        out
    }

    /// As CSV with a header line.
    pub fn csv(&self) -> String {
        let quoted = |c: &str| {
            if c.contains([',', '"', '\n', '\r']) {
                format!("\"{}\"", c.replace('"', "\"\""))
            } else {
                c.to_owned()
            }
        };
        let lines: Vec<String> = self
            .cells(quoted)
            .iter()
            .map(|row| row.join(",") + "\n")
            .collect();
        lines.concat()
    }

    /// Titles and rows, each cell through `clean`.
    fn cells(&self, clean: impl Fn(&str) -> String) -> Vec<Vec<String>> {
        let titles = self.columns.iter().map(|(title, _)| clean(title)).collect();
        let rows = self
            .rows
            .iter()
            .map(|row| row.iter().map(|c| clean(c)).collect());
        std::iter::once(titles).chain(rows).collect()
    }

    fn widths(&self, rows: &[Vec<String>], least: usize) -> Vec<usize> {
        let width = |column: usize| {
            rows.iter()
                .map(|row| row[column].chars().count())
                .max()
                .unwrap_or(0)
                .max(least)
        };
        (0..self.columns.len()).map(width).collect()
    }

    fn padded(&self, row: &[String], widths: &[usize]) -> Vec<String> {
        let cells = row.iter().zip(widths).zip(&self.columns);
        cells
            .map(|((cell, &width), (_, align))| match align {
                Align::Left => format!("{cell:<width$}"),
                Align::Right => format!("{cell:>width$}"),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> TextTable {
        let mut table = TextTable::new([("paint", Align::Left), ("ΔE", Align::Right)]);
        table.row(["a|b", "0.5"]);
        table.row(["\"q\", r"]);
        table
    }

    #[test]
    fn markdown_is_aligned_and_escaped() {
        let wanted = "| paint  |  ΔE |\n| ------ | --: |\n| a\\|b   | 0.5 |\n| \"q\", r |     |\n";
        assert_eq!(table().markdown(), wanted);
    }

    #[test]
    fn csv_is_quoted() {
        assert_eq!(table().csv(), "paint,ΔE\na|b,0.5\n\"\"\"q\"\", r\",\n");
    }
}
