//! The code reads in the order light travels: a folder uses what stands before it, and no file is too long to be read.

use std::path::{Path, PathBuf};

/// Folders and files of `src`, from the bottom to the top. `lib` and `main` hold them together.
const ORDER: [&str; 23] = [
    "error",
    "data",
    "color",
    "spectrum",
    "scene",
    "geometry",
    "hierarchy",
    "store",
    "link",
    "light",
    "transport",
    "survey",
    "solve",
    "gather",
    "mesh",
    "lightmap",
    "keep",
    "audit",
    "output",
    "report",
    "cost",
    "serve",
    "cli",
];
const LONGEST: usize = 600;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            found.push(path);
        }
    }
}

/// Code without comments and without the tests at its end, which may look at anything.
fn code(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines = text[..end].lines();
    lines
        .map(|line| line.split("//").next().unwrap_or("").to_owned() + "\n")
        .collect()
}

#[test]
fn a_folder_uses_what_stands_before_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 100);
    let place = |name: &str| ORDER.iter().position(|&o| o == name);
    let mut wrong = Vec::new();
    for file in &files {
        let relative = file.strip_prefix(&root).unwrap();
        let own = relative.components().next().unwrap().as_os_str();
        let own = own.to_str().unwrap().trim_end_matches(".rs");
        if own == "lib" || own == "main" {
            continue;
        }
        let at = place(own).unwrap_or_else(|| panic!("{own} has no place in the order"));
        for used in code(&std::fs::read_to_string(file).unwrap())
            .split("crate::")
            .skip(1)
        {
            let name: String = (used.chars())
                .take_while(|c| c.is_ascii_lowercase() || *c == '_')
                .collect();
            // What begins with a capital stands in `lib`.
            if !name.is_empty() && place(&name).is_none_or(|used| used > at) {
                wrong.push(format!("{} uses {name}", relative.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn files_can_be_read() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let lines = |file: &PathBuf| std::fs::read_to_string(file).unwrap().lines().count();
    files.retain(|file| lines(file) > LONGEST);
    assert!(files.is_empty(), "longer than {LONGEST} lines: {files:#?}");
}
