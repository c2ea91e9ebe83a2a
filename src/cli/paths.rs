//! Checks on output files before any work is done: they must be writable places, differ, and not be what was read.

use crate::error::Problem;
use crate::scene::Scene;
use crate::scene::uri::{self, UriTarget};
use std::path::{Path, PathBuf};

/// A path as it is said.
pub(super) fn text(path: &Path) -> String {
    path.display().to_string()
}

/// The cache that `bake --cache` writes and `relight` reads where none is named.
pub(super) fn cache_of(room: &Path) -> PathBuf {
    room.with_extension("cache")
}

/// The page that `bake --report` writes where none is named.
pub(super) fn report_of(room: &Path) -> PathBuf {
    room.with_extension("report.html")
}

/// What is wrong with the name of the room that a command writes; `which`: baked, relit.
pub(super) fn not_glb(output: &Path, which: &str) -> Option<Problem> {
    let ends_well = output
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    (!ends_well).then(|| {
        Problem::new(
            format!("-o {}", output.display()),
            format!("the {which} room is a .glb"),
            "end its name in .glb",
        )
    })
}

/// What is wrong with the files that a command is to write; each comes with the option that names it.
pub(super) fn problems(outputs: &[(&str, &Path)], inputs: &[&Path]) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut seen: Vec<(PathBuf, &str)> = Vec::new();
    for &(option, path) in outputs {
        let mut wrong = |what: String, next: &str| {
            problems.push(Problem::new(
                format!("{option} {}", path.display()),
                what,
                next,
            ));
        };
        if path.is_dir() {
            wrong("is a folder".into(), "name a file");
            continue;
        }
        let Some(place) = whole(path) else {
            wrong("its folder is not there".into(), "make the folder first");
            continue;
        };
        if inputs
            .iter()
            .any(|input| whole(input).as_ref() == Some(&place))
        {
            wrong("would overwrite an input".into(), "give another name");
        } else if let Some((_, other)) = seen.iter().find(|(p, _)| *p == place) {
            wrong(format!("is the file of {other} too"), "give another name");
        }
        seen.push((place, option));
    }
    problems
}

/// The files beside a room that it is made of: buffers and images.
pub(super) fn parts(scene: &Scene) -> Vec<PathBuf> {
    let source = &scene.source;
    let folder = source.path.parent().unwrap_or(Path::new(""));
    let uris = ["buffers", "images"]
        .into_iter()
        .filter_map(|list| source.json.get(list)?.as_array())
        .flatten()
        .filter_map(|entry| entry.get("uri")?.as_str());
    uris.filter_map(|uri| match uri::locate(folder, uri) {
        Ok(UriTarget::File(path)) => Some(path),
        _ => None,
    })
    .collect()
}

/// The path without links and dots; none if its folder does not exist. A file that is there is followed to what it is.
fn whole(path: &Path) -> Option<PathBuf> {
    if let Ok(whole) = path.canonicalize() {
        return Some(whole);
    }
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
    folder
        .is_dir()
        .then(|| folder.join(path.file_name().unwrap_or_default()))
}

/// A name without anything that a file system or shell could take amiss.
pub(super) fn file_name(name: &str) -> String {
    let clean: String = name
        .chars()
        .map(|c| {
            if c.is_alphanumeric() || "-_".contains(c) {
                c
            } else {
                '-'
            }
        })
        .take(60)
        .collect();
    if clean.trim_matches('-').is_empty() {
        "camera".into()
    } else {
        clean
    }
}

/// File names for things with these names, no two alike (also where case does not count).
pub(super) fn file_names<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for name in names {
        let base = file_name(name);
        let mut free = base.clone();
        let mut number = 2;
        while out.iter().any(|o| o.to_lowercase() == free.to_lowercase()) {
            free = format!("{base}-{number}");
            number += 1;
        }
        out.push(free);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_folders_and_twins_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("room.glb"), b"room").unwrap();
        let (room, roundabout) = (at("room.glb"), at("./room.glb"));
        let (a, b, nowhere) = (at("a"), at("./a"), at("no/a"));
        let found = problems(
            &[
                ("-o", &roundabout),
                ("--npz", &a),
                ("--log", &b),
                ("--x", folder.path()),
                ("--y", &nowhere),
            ],
            &[&room],
        );
        let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
        for (text, part) in texts.iter().zip([
            "overwrite",
            "is the file of --npz",
            "is a folder",
            "not there",
        ]) {
            assert!(text.contains(part), "{texts:#?}");
        }
        assert_eq!(texts.len(), 4);
        assert!(problems(&[("-o", &a)], &[&room]).is_empty());
    }

    #[test]
    fn camera_names_become_file_names() {
        let names = ["Küche 1", "../x", "", "///", "cam", "Cam"];
        let files = file_names(names.into_iter());
        assert_eq!(
            files,
            ["Küche-1", "---x", "camera", "camera-2", "cam", "Cam-2"]
        );
    }
}
