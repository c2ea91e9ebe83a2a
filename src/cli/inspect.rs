//! `haarlight inspect ROOM [--json] [--pictures DIR] [--spectra FILE] [--range 380..780]`: what the program sees in a room.
//!
//! Prints triangles, areas, whether the room is closed, lamps with lumens, materials with albedo (Y under D65) and where
//! their spectrum comes from, the plan of effects, and warnings. Nothing is solved.
//!
//! `--json` prints one object: `{"version": 1, "facts": ..., "plan": [...], "unsupported": [...], "warnings": [...]}`;
//! `unsupported` are the extensions that are not read (the page has them among its warnings);
//! the fields of `facts` are those of [`Facts`], with units in their names.

use super::options::Reading;
use super::pictures;
use super::results::put;
use crate::error::Result;
use crate::scene::document::Document;
use crate::scene::effects::Plan;
use crate::scene::facts::{Facts, LightFact, MaterialFact};
use crate::scene::{Scene, short};
use crate::solve::running;
use crate::survey::advise;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;

/// Version of the JSON form.
const VERSION: u32 = 1;

/// Arguments of `inspect`.
#[derive(Debug, Clone, clap::Args)]
#[non_exhaustive]
pub struct InspectArgs {
    /// The room, .glb or .gltf.
    pub room: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Draw the room from above, the spectra of its lamps and those of its materials: SVG, black on white.
    #[arg(long, value_name = "DIR")]
    pub pictures: Option<PathBuf>,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
}

/// Reads the room and prints what is in it.
///
/// # Errors
/// As [`Scene::load`]; [`Error::Io`](crate::Error::Io) if `out` cannot be written to.
pub fn run(args: &InspectArgs, out: &mut impl Write) -> Result<()> {
    let document = Document::open(&args.room)?;
    let unsupported = document.unsupported.clone();
    let mut scene = Scene::from_document(document, &args.reading.options())?;
    // What would stop a bake is only said: the page shows what is there.
    let stops = advise(&mut scene, args.reading.wishes());
    scene
        .warnings
        .extend(stops.iter().map(|p| format!("{}; {}", p.what, p.next)));
    let facts = Facts::of(&scene);
    if let Some(folder) = &args.pictures {
        pictures::write(folder, &scene, &facts)?;
    }
    let warnings = std::mem::take(&mut scene.warnings);
    let plan = running(scene);
    let text = if args.json {
        let all = json!({
            "version": VERSION,
            "facts": facts,
            "plan": plan,
            "unsupported": unsupported,
            "warnings": warnings,
        });
        format!("{all:#}\n")
    } else {
        page(&facts, &plan, &warnings)
    };
    put(out, &text)
}

fn page(facts: &Facts, plan: &Plan, warnings: &[String]) -> String {
    let [low, high] = facts.bounds_m;
    let size: Vec<String> = (0..3).map(|a| format!("{:.3}", high[a] - low[a])).collect();
    let closed = &facts.closed;
    let mut lines = vec![
        facts.room.clone(),
        format!(
            "  {} triangles in {} surfaces, {:.4} m2",
            facts.triangles, facts.surfaces, facts.area_m2
        ),
        format!("  {} m (x, y, z)", size.join(" x ")),
        format!(
            "  {}: {} of {} parts closed, {} open edges",
            if closed.largest_is_closed {
                "closed"
            } else {
                "not shown to be closed"
            },
            closed.closed_parts,
            closed.parts,
            closed.open_edges
        ),
        format!(
            "  {} to {} nm in 64 bands",
            facts.range_nm[0], facts.range_nm[1]
        ),
    ];
    if !facts.cameras.is_empty() {
        lines.push(format!("  cameras: {}", facts.cameras.join(", ")));
    }
    lines.push("\nLamps".into());
    lines.extend(table(&lamps(&facts.lights)));
    lines.push("\nMaterials".into());
    lines.extend(table(&materials(&facts.materials)));
    lines.push("\nEffects".into());
    lines.extend(plan.to_string().lines().map(|l| format!("  {l}")));
    if !warnings.is_empty() {
        lines.push("\nWarnings".into());
        lines.extend(warnings.iter().map(|w| format!("  {w}")));
    }
    lines.join("\n") + "\n"
}

/// A row a lamp.
fn lamps(lights: &[LightFact]) -> Vec<Vec<String>> {
    if lights.is_empty() {
        return vec![vec!["none: the room stays dark".into()]];
    }
    let titles = ["name", "kind", "flux lm", "", "spectrum"].map(String::from);
    let row = |light: &LightFact| {
        vec![
            light.name.clone(),
            light.kind.into(),
            light.flux_lm.map_or("-".into(), |f| format!("{f:.1}")),
            strength(light),
            spectrum(light),
        ]
    };
    let rows = lights.iter().map(row);
    std::iter::once(titles.to_vec()).chain(rows).collect()
}

/// A row a material.
fn materials(materials: &[MaterialFact]) -> Vec<Vec<String>> {
    let titles = [
        "name",
        "triangles",
        "area m2",
        "albedo",
        "sides",
        "reflectance",
    ];
    let row = |material: &MaterialFact| {
        let textured = if material.textured { ", textured" } else { "" };
        let through = material.sheet.as_ref().map(|sheet| {
            let (through, from) = (sheet.transmittance_y, short(&sheet.transmission));
            format!("; {through:.3} passes ({from})")
        });
        let again = (material.fluorescence.as_ref()).map(|from| format!("; fluoresces ({from})"));
        vec![
            material.name.clone(),
            material.triangles.to_string(),
            format!("{:.3}", material.area_m2),
            format!("{:.3}", material.albedo_y),
            material.sides.into(),
            format!(
                "{}{textured}{}{}",
                material.reflectance,
                through.unwrap_or_default(),
                again.unwrap_or_default()
            ),
        ]
    };
    let rows = materials.iter().map(row);
    std::iter::once(titles.map(String::from).to_vec())
        .chain(rows)
        .collect()
}

/// Where the spectrum comes from, and how the light is spread.
fn spectrum(light: &LightFact) -> String {
    let Some(profile) = &light.profile else {
        return light.spectrum.clone();
    };
    let lamps = profile.lamps_lm.map(|lm| format!(" of {lm:.0} lm lamps"));
    format!(
        "{}, spread as '{}' ({}, type {}, {:.1} lm{})",
        light.spectrum,
        short(&profile.luminaire),
        profile.format,
        profile.angles,
        profile.flux_lm,
        lamps.unwrap_or_default()
    )
}

fn strength(light: &LightFact) -> String {
    let units = [
        (light.luminance_cd_m2, "cd/m2"),
        (light.intensity_cd, "cd"),
        (light.illuminance_lx, "lx"),
    ];
    let given = units
        .iter()
        .find_map(|(value, unit)| Some(format!("{:.1} {unit}", (*value)?)));
    given.unwrap_or_else(|| "textured".into())
}

/// Columns padded to their widest cell; the last one is left as it is.
fn table(rows: &[Vec<String>]) -> Vec<String> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| {
        rows.iter()
            .filter_map(|r| r.get(c))
            .map(|t| t.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    rows.iter()
        .map(|row| {
            let cells = row
                .iter()
                .zip(&widths)
                .map(|(cell, &width)| format!("{cell:width$}"));
            format!("  {}", cells.collect::<Vec<_>>().join("  ").trim_end())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn inspect(room: &str, json: bool) -> String {
        let room = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(room);
        let mut out = Vec::new();
        run(
            &InspectArgs {
                room,
                json,
                pictures: None,
                reading: Reading::default(),
            },
            &mut out,
        )
        .unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn the_page_says_what_is_there() {
        let page = inspect("two-rooms.glb", false);
        for text in [
            "692 triangles",
            "closed: 1 of 1 parts",
            "cie/F11",
            "macbeth/dark_skin",
            "6000.0 cd/m2",
            "Effects",
        ] {
            assert!(page.contains(text), "{text}\n{page}");
        }
    }

    #[test]
    fn the_json_carries_units_and_version() {
        let json: serde_json::Value =
            serde_json::from_str(&inspect("cie171-5.4.glb", true)).unwrap();
        assert_eq!(json["version"], 1);
        assert!((json["facts"]["lights"][0]["flux_lm"].as_f64().unwrap() - 10_000.0).abs() < 0.01);
        assert_eq!(json["plan"][0]["name"], "interreflection");
        assert_eq!(json["plan"][0]["runs"], false);
    }
}
