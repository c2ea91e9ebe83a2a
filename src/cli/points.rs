//! The points of `probe`: a CSV with a header that names at least `x,y,z,nx,ny,nz`, in any order.
//!
//! Positions are in the file's units, world space; normals point to the side that is lit and are normalised here.
//! Further columns are passed over. Empty lines count as lines and are skipped.

use crate::error::{Error, Problem, Result};
use glam::DVec3;
use std::path::Path;

/// Columns that must be there.
pub const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
/// Problems that are listed one by one.
const LISTED: usize = 20;
/// The longest piece of a cell that a message repeats.
const SHOWN: usize = 24;

/// A point and its unit normal.
pub type Point = (DVec3, DVec3);

/// Points, and every problem by line.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Points {
    /// Points in the order of the file.
    pub points: Vec<Point>,
    /// What is wrong.
    pub problems: Vec<Problem>,
    /// Columns that are not read.
    pub ignored: Vec<String>,
}

impl Points {
    /// Reads a file.
    ///
    /// # Errors
    /// There is no such file, or it is none.
    pub fn open(path: &Path) -> Result<Self> {
        // A device or pipe might never end.
        if std::fs::metadata(path)
            .map_err(|e| Error::io(path, e))?
            .is_file()
        {
            let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
            return Ok(Self::parse(
                &String::from_utf8_lossy(&bytes),
                &path.display().to_string(),
            ));
        }
        Err(Error::input(
            path.display().to_string(),
            "is not a file",
            "name a CSV file",
        ))
    }

    /// Reads the text of a CSV; `place` names it in problems.
    pub fn parse(text: &str, place: &str) -> Self {
        let mut out = Self::default();
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = text
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty());
        let next = "begin with the line x,y,z,nx,ny,nz";
        let Some((_, header)) = lines.next() else {
            out.problems.push(Problem::new(place, "is empty", next));
            return out;
        };
        let names: Vec<String> = header
            .split(',')
            .map(|name| name.trim().trim_matches('"').to_lowercase())
            .collect();
        let columns = COLUMNS.map(|wanted| names.iter().position(|name| name == wanted));
        let missing: Vec<&str> = COLUMNS
            .into_iter()
            .zip(columns)
            .filter(|(_, c)| c.is_none())
            .map(|(name, _)| name)
            .collect();
        if !missing.is_empty() {
            let what = format!("line 1 lacks the columns {}", missing.join(", "));
            out.problems.push(Problem::new(place, what, next));
            return out;
        }
        let columns = columns.map(Option::unwrap_or_default);
        out.ignored = names
            .into_iter()
            .filter(|n| !COLUMNS.contains(&n.as_str()))
            .collect();
        let mut wrong = 0;
        for (number, line) in lines {
            match point(line, columns) {
                Ok(point) => out.points.push(point),
                Err(what) => {
                    wrong += 1;
                    if wrong <= LISTED {
                        let place = format!("{place}: line {}", number + 1);
                        out.problems
                            .push(Problem::new(place, what, "correct or remove the line"));
                    }
                }
            }
        }
        if wrong > LISTED {
            let what = format!("{} more lines are wrong", wrong - LISTED);
            out.problems
                .push(Problem::new(place, what, "correct or remove them"));
        }
        if out.points.is_empty() && wrong == 0 {
            out.problems.push(Problem::new(
                place,
                "has no points",
                "add a line for each point",
            ));
        }
        out
    }
}

fn point(line: &str, columns: [usize; 6]) -> std::result::Result<Point, String> {
    let cells: Vec<&str> = line
        .split(',')
        .map(|c| c.trim().trim_matches('"'))
        .collect();
    let mut values = [0.0; 6];
    for ((value, column), name) in values.iter_mut().zip(columns).zip(COLUMNS) {
        let cell = cells
            .get(column)
            .ok_or_else(|| format!("there is no {name}"))?;
        *value = match cell.parse::<f64>() {
            Ok(number) if number.is_finite() => number,
            _ => {
                let shown: String = cell.chars().take(SHOWN).collect();
                return Err(format!("{name} is '{shown}', not a finite number"));
            }
        };
    }
    let [x, y, z, nx, ny, nz] = values;
    let normal = DVec3::new(nx, ny, nz);
    // Scaled first: squares of very large or small numbers leave the range of f64.
    let normal = (normal / normal.abs().max_element()).try_normalize();
    Ok((
        DVec3::new(x, y, z),
        normal.ok_or("the normal has no length")?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_any_order_and_normals_any_length() {
        let text = "\u{feff}name, X,y,z,nz,ny,nx\r\ndesk,1,2,3,0,2,0\r\n\r\nlamp,4,5,6,3e-200,0,4e-200\r\n";
        let read = Points::parse(text, "p.csv");
        assert!(read.problems.is_empty(), "{:?}", read.problems);
        assert_eq!(read.points[0], (DVec3::new(1.0, 2.0, 3.0), DVec3::Y));
        assert!((read.points[1].1 - DVec3::new(0.8, 0.0, 0.6)).length() < 1e-12);
        assert_eq!(read.ignored, ["name"]);
    }

    #[test]
    fn every_wrong_line_is_named() {
        let text = "x,y,z,nx,ny,nz\n1,2,3,0,0,0\n1,2,NaN,0,1,0\n1,2,3,0,1\n1,2,3,0,1,0\nx,2,3,0,1,0\n1,2,3,inf,0,0\n";
        let read = Points::parse(text, "p.csv");
        let texts: Vec<String> = read.problems.iter().map(ToString::to_string).collect();
        for (text, part) in texts.iter().zip([
            "p.csv: line 2: the normal has no length",
            "line 3: z is 'NaN'",
            "line 4: there is no nz",
            "line 6: x is 'x'",
            "line 7: nx is 'inf'",
        ]) {
            assert!(text.contains(part), "{texts:#?}");
        }
        assert_eq!((texts.len(), read.points.len()), (5, 1));
    }

    #[test]
    fn files_without_points_are_refused() {
        for (text, part) in [
            ("", "is empty"),
            ("x,y,z,nx\n", "lacks the columns ny, nz"),
            ("x,y,z,nx,ny,nz\n", "no points"),
        ] {
            let read = Points::parse(text, "p.csv");
            assert!(
                read.problems[0].to_string().contains(part),
                "{:?}",
                read.problems
            );
        }
        let many = "x,y,z,nx,ny,nz\n".to_owned() + &"?\n".repeat(1000);
        let read = Points::parse(&many, "p.csv");
        assert_eq!(read.problems.len(), LISTED + 1);
        assert!(read.problems[LISTED].what.starts_with("980 more"));
    }
}
