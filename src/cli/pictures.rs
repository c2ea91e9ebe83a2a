//! `inspect --pictures DIR`: `plan.svg`, `lamps.svg` and `materials.svg`, which go on in `lamps-2.svg` and so on.

use crate::error::{Error, Result};
use crate::report::page::lamp_spectra;
use crate::report::{Chart, Scale, Series, plan};
use crate::scene::Scene;
use crate::scene::facts::Facts;
use crate::spectrum::Leaves;
use crate::store::file;
use std::path::Path;

/// As many lines as a chart tells apart.
const PLOTTED: usize = 8;

/// Draws the pictures.
///
/// # Errors
/// They cannot be written.
pub(super) fn write(folder: &Path, scene: &Scene, facts: &Facts) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|problem| Error::io(folder, problem))?;
    let room = scene.source.path.file_stem().unwrap_or_default();
    let room = room.to_string_lossy();
    let title = format!("{room} from above");
    put(&folder.join("plan.svg"), &plan::svg(scene, &title))?;
    let lamps = facts.lights.iter().zip(lamp_spectra(scene));
    let lamps: Vec<(String, Leaves)> = lamps
        .map(|(fact, power)| {
            let peak = power.iter().copied().fold(0.0, f64::max);
            let scale = if peak > 0.0 { peak } else { 1.0 };
            (fact.name.clone(), power.map(|p| p / scale))
        })
        .collect();
    let used = scene.materials.iter().zip(&facts.materials);
    let materials: Vec<(String, Leaves)> = used
        .filter(|(_, fact)| fact.triangles > 0)
        .map(|(material, fact)| {
            let less = if fact.textured { " less texture" } else { "" };
            (format!("{}{less}", fact.name), material.reflectance)
        })
        .collect();
    let of = |what: &str| format!("{what} of {room}");
    charts(
        folder,
        "lamps",
        &of("Lamps"),
        "power, share of its peak",
        scene,
        &lamps,
    )?;
    charts(
        folder,
        "materials",
        &of("Materials"),
        "reflectance",
        scene,
        &materials,
    )
}

fn charts(
    folder: &Path,
    file: &str,
    title: &str,
    y: &str,
    scene: &Scene,
    spectra: &[(String, Leaves)],
) -> Result<()> {
    let grid = &scene.grid;
    // A leaf holds the mean of its interval: steps.
    let steps = |leaves: &Leaves| -> Vec<[f64; 2]> {
        let ends = |(k, value): (usize, &f64)| [[grid.left(k), *value], [grid.left(k + 1), *value]];
        leaves.iter().enumerate().flat_map(ends).collect()
    };
    for (page, part) in spectra.chunks(PLOTTED).enumerate() {
        let number = match page {
            0 => String::new(),
            page => format!("-{}", page + 1),
        };
        let series = |(name, leaves): &(String, Leaves)| Series {
            name: name.clone(),
            points: steps(leaves),
        };
        let chart = Chart {
            title: title.to_owned(),
            x: "wavelength, nm".into(),
            y: y.to_owned(),
            x_scale: Scale::Fitted,
            y_scale: Scale::Linear,
            series: part.iter().map(series).collect(),
        };
        put(&folder.join(format!("{file}{number}.svg")), &chart.to_svg())?;
    }
    Ok(())
}

fn put(path: &Path, text: &str) -> Result<()> {
    file::write_atomic(path, None, |w| w.write_all(text.as_bytes()))
}
