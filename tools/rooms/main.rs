//! Writes the project's own rooms: `rooms [DIR] [--only NAME] [--triangles N]`.
//!
//! No asset files: every room is made of numbers, and the same call writes the same bytes.

mod brightened;
mod building;
mod cells;
mod cie171;
mod cornell;
mod curtained;
mod daylit;
mod flat;
mod furnished;
mod gallery;
mod glazed;
mod glb;
mod mirrored;
mod shapes;
mod simple;
mod textures;

use clap::Parser;
use glb::Glb;
use serde_json::Value;
use std::path::{Path, PathBuf};

#[derive(Parser)]
#[command(about = "Writes the project's own rooms (glTF binaries and their spectra)")]
pub(crate) struct Args {
    /// Folder to write to.
    #[arg(default_value = "scenes")]
    dir: PathBuf,
    /// Write only the room of this name.
    #[arg(long)]
    only: Option<String>,
    /// Triangles of the furnished room, about, 1 000 to 500 000 make sense; or of the building, which is written only when it is named
    /// (`--only building`), up to 2 000 000.
    #[arg(long, default_value_t = 1500)]
    triangles: usize,
}

/// A room: name, content, side file.
type Room = (&'static str, fn() -> Glb, Option<fn() -> Value>);

const ROOMS: &[Room] = &[
    (
        "cornell",
        || cornell::room(cornell::Front::Open),
        Some(|| cornell::spectra("cornell/light")),
    ),
    (
        "cornell-d65",
        || cornell::room(cornell::Front::Open),
        Some(|| cornell::spectra("cie/D65")),
    ),
    (
        "cornell-f2",
        || cornell::room(cornell::Front::Open),
        Some(|| cornell::spectra("cie/F2")),
    ),
    (
        "cornell-closed",
        || cornell::room(cornell::Front::Wall),
        Some(|| cornell::spectra("cornell/light")),
    ),
    ("convex", simple::convex, None),
    (
        "two-rooms",
        simple::two_rooms,
        Some(simple::two_rooms_spectra),
    ),
    ("corridor", simple::corridor, None),
    ("flat", flat::room, None),
    ("daylit", daylit::room, Some(daylit::spectra)),
    ("glazed", glazed::room, Some(glazed::spectra)),
    ("curtained", curtained::room, Some(curtained::spectra)),
    ("mirrored", mirrored::room, Some(mirrored::spectra)),
    ("brightened", brightened::room, Some(brightened::spectra)),
    ("furnace", simple::furnace, None),
    ("gallery", gallery::room, Some(gallery::spectra)),
    ("cie171-5.2", cie171::case_5_2, None),
    ("cie171-5.2-isotropic", cie171::case_5_2_isotropic, None),
    ("cie171-5.3", cie171::case_5_3, None),
    ("cie171-5.4", cie171::case_5_4, None),
    ("cie171-5.6", cie171::case_5_6, None),
    ("cie171-5.7", cie171::case_5_7, None),
    ("cie171-5.8", || cie171::case_5_8(0.5), None),
    ("cie171-5.8-90", || cie171::case_5_8(0.9), None),
];

fn main() -> anyhow::Result<()> {
    run(&Args::parse())
}

/// Writes what is asked for.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.dir)?;
    let wanted = |name: &str| args.only.as_deref().is_none_or(|only| only == name);
    let mut written = 0;
    for (name, make, spectra) in ROOMS {
        if !wanted(name) {
            continue;
        }
        write(&args.dir, name, make())?;
        if let Some(spectra) = spectra {
            let text = format!("{:#}\n", spectra());
            std::fs::write(args.dir.join(format!("{name}.spectra.json")), text)?;
        }
        written += 1;
    }
    if wanted("gallery") {
        for (name, text) in gallery::lamps() {
            std::fs::write(args.dir.join(name), text)?;
        }
    }
    if wanted("furnished") {
        write(&args.dir, "furnished", furnished::room(args.triangles))?;
        written += 1;
    }
    if args.only.as_deref() == Some("building") {
        write(&args.dir, "building", building::room(args.triangles))?;
        written += 1;
    }
    anyhow::ensure!(written > 0, "no room has that name");
    Ok(())
}

fn write(dir: &Path, name: &str, glb: Glb) -> anyhow::Result<()> {
    let path = dir.join(format!("{name}.glb"));
    let triangles = glb.triangles();
    let bytes = glb.finish(name);
    std::fs::write(&path, &bytes)?;
    eprintln!(
        "{}: {triangles} triangles, {} bytes",
        path.display(),
        bytes.len()
    );
    Ok(())
}
