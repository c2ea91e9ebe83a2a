//! `inspect --pictures DIR`: `plan.svg`, `lamps.svg` and `materials.svg`, which go on in `lamps-2.svg` and so on, and
//! `profile.svg`, `profile-2.svg` ..., the polar curves of lamps whose light is spread as a file says.

use crate::error::{Error, Result};
use crate::report::page::lamp_spectra;
use crate::report::{LineChart, Scale, Series, plan, polar};
use crate::scene::facts::Facts;
use crate::scene::profile::Profile;
use crate::scene::{Scene, listed, short};
use crate::spectrum::Spectrum;
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
    let lamps: Vec<(String, Spectrum)> = lamps
        .map(|(fact, power)| {
            let peak = power.iter().copied().fold(0.0, f64::max);
            let scale = if peak > 0.0 { peak } else { 1.0 };
            (fact.name.clone(), power.map(|p| p / scale))
        })
        .collect();
    let used = scene.materials.iter().zip(&facts.materials);
    let materials: Vec<(String, Spectrum)> = used
        .filter(|(_, fact)| fact.triangles > 0)
        .flat_map(|(material, fact)| {
            let less = if fact.textured { " less texture" } else { "" };
            let reflected = (format!("{}{less}", fact.name), material.reflectance);
            let sheet = material.sheet.as_ref();
            let passes = sheet.map(|s| (format!("{}, what passes", fact.name), s.transmittance));
            std::iter::once(reflected).chain(passes)
        })
        .collect();
    profiles(folder, scene)?;
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

/// A polar curve for each file of photometric data, titled by the lamps that have it.
fn profiles(folder: &Path, scene: &Scene) -> Result<()> {
    let mut drawn: Vec<(&Profile, Vec<&str>)> = Vec::new();
    for light in &scene.lights {
        let Some(luminaire) = &light.luminaire else {
            continue;
        };
        let profile = &*luminaire.profile;
        match drawn.iter_mut().find(|(other, _)| *other == profile) {
            Some((_, names)) if names.contains(&light.name.as_str()) => {}
            Some((_, names)) => names.push(&light.name),
            None => drawn.push((profile, vec![&light.name])),
        }
    }
    for (k, (profile, names)) in drawn.iter().enumerate() {
        let number = match k {
            0 => String::new(),
            k => format!("-{}", k + 1),
        };
        let names: Vec<String> = names.iter().map(|name| short(name)).collect();
        let of = match profile.luminaire.as_str() {
            "" => String::new(),
            of => format!(": {}", short(of)),
        };
        let title = format!("{}{of}", listed(&names));
        put(
            &folder.join(format!("profile{number}.svg")),
            &polar::svg(profile, &title),
        )?;
    }
    Ok(())
}

fn charts(
    folder: &Path,
    file: &str,
    title: &str,
    y: &str,
    scene: &Scene,
    spectra: &[(String, Spectrum)],
) -> Result<()> {
    let grid = &scene.grid;
    // A band holds the mean of its interval: steps.
    let steps = |spectrum: &Spectrum| -> Vec<[f64; 2]> {
        let ends = |(k, value): (usize, &f64)| [[grid.left(k), *value], [grid.left(k + 1), *value]];
        spectrum.iter().enumerate().flat_map(ends).collect()
    };
    for (page, part) in spectra.chunks(PLOTTED).enumerate() {
        let number = match page {
            0 => String::new(),
            page => format!("-{}", page + 1),
        };
        let series = |(name, spectrum): &(String, Spectrum)| Series {
            name: name.clone(),
            points: steps(spectrum),
        };
        let chart = LineChart {
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
