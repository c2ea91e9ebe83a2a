//! `haarlight spectra [PATTERN] [--plot FILE.svg]`: the spectra that rooms may name in their `.spectra.json`.
//!
//! One line a spectrum: name, what it is (`light` or `reflectance`), first and last wavelength in nm.

use super::results::print;
use crate::data::{Named, TableKind, named, names, nearest};
use crate::error::{Error, Result};
use crate::report::{Align, LineChart, Scale, Series, TextTable};
use crate::store::file;
use std::path::{Path, PathBuf};

/// As many lines as a chart tells apart.
const PLOTTED: usize = 8;

/// Arguments of `spectra`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  haarlight spectra                                every name
  haarlight spectra macbeth                        those with 'macbeth' in them
  haarlight spectra blackbody/3200 --plot warm.svg")]
#[non_exhaustive]
pub struct SpectraArgs {
    /// List the names that hold this, letter case free.
    pub pattern: Option<String>,
    /// Draw them: reflectances as they are, lights with their peak at 1.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

/// Lists and draws.
///
/// # Errors
/// No name matches, too many do for a plot, or the plot cannot be written.
pub fn run(args: &SpectraArgs) -> Result<()> {
    let pattern = args.pattern.as_deref().unwrap_or("");
    let found = matching(pattern);
    if found.is_empty() {
        return Err(Error::input(
            "spectra",
            format!("no name holds '{pattern}'"),
            format!("the nearest names are {}", nearest(pattern).join(", ")),
        ));
    }
    if let Some(path) = &args.plot {
        plot(path, pattern, &found)?;
    }
    use Align::{Left, Right};
    let mut table = TextTable::new([
        ("name", Left),
        ("is", Left),
        ("from nm", Right),
        ("to nm", Right),
    ]);
    for (name, spectrum) in &found {
        let [first, last] = spectrum.table.range();
        let is = kind(spectrum.kind);
        table.row([name.clone(), is.into(), first.to_string(), last.to_string()]);
    }
    let mut text = table.terminal();
    if found.iter().any(|(name, _)| name.starts_with("blackbody/")) {
        text += "(blackbody/KELVIN: any temperature from 500 to 50000 K)\n";
    }
    print(&text)
}

/// Spectra whose names hold `pattern`, and the one that it names itself.
fn matching(pattern: &str) -> Vec<(String, Named)> {
    let wanted = pattern.to_lowercase();
    let mut found: Vec<String> = names();
    found.retain(|name| name.to_lowercase().contains(&wanted));
    if found.is_empty() {
        found.push(pattern.to_owned());
    }
    found
        .into_iter()
        .filter_map(|name| named(&name).map(|spectrum| (name, spectrum)))
        .collect()
}

fn kind(kind: TableKind) -> &'static str {
    match kind {
        TableKind::Illuminant => "light",
        TableKind::Reflectance => "reflectance",
    }
}

fn plot(path: &Path, pattern: &str, found: &[(String, Named)]) -> Result<()> {
    let place = format!("--plot {}", path.display());
    if found.len() > PLOTTED {
        let what = format!(
            "{} spectra match, a plot tells {PLOTTED} apart",
            found.len()
        );
        return Err(Error::input(place, what, "give more of the name"));
    }
    let lights = found
        .iter()
        .filter(|(_, s)| s.kind == TableKind::Illuminant);
    let y = match lights.count() {
        0 => "reflectance",
        n if n == found.len() => "power, share of its peak",
        _ => "reflectance; power, share of its peak",
    };
    let series = |(name, spectrum): &(String, Named)| {
        let table = &spectrum.table;
        let peak = match spectrum.kind {
            TableKind::Illuminant => table.values().iter().copied().fold(0.0, f64::max),
            TableKind::Reflectance => 1.0,
        };
        let points = table.wavelengths().iter().zip(table.values());
        Series {
            name: name.clone(),
            points: points.map(|(nm, value)| [*nm, value / peak]).collect(),
        }
    };
    let chart = LineChart {
        title: match pattern {
            "" => "Spectra".into(),
            pattern => format!("Spectra: {pattern}"),
        },
        x: "wavelength, nm".into(),
        y: y.into(),
        x_scale: Scale::Fitted,
        y_scale: Scale::Linear,
        series: found.iter().map(series).collect(),
    };
    file::write_atomic(path, None, |w| w.write_all(chart.to_svg().as_bytes()))
}
