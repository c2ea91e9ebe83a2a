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
/// Lines of a function.
const LONGEST_FUNCTION: usize = 80;
/// Functions that are longer still: folder or file of `src`, and name; no name stands for all of it.
const LONG: [(&str, &str); 2] = [("scene", ""), ("cli/bake.rs", "run")];

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

/// Names and lengths of the functions of a file, tests aside. Each ends at the brace below its first column: the code is
/// formatted.
fn functions(text: &str) -> Vec<(String, usize)> {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines: Vec<&str> = text[..end].lines().collect();
    let mut found = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let indent = line.len() - line.trim_start().len();
        let mut words = line.split_whitespace();
        let begins = |word: &str| {
            matches!(word, "pub" | "const" | "async" | "unsafe" | "extern" | "in")
                || word.starts_with(['"', '('])
                || word.starts_with("pub(")
                || word.ends_with(')')
        };
        let Some("fn") = words.find(|word| !begins(word)) else {
            continue;
        };
        let name: String = (words.next().unwrap_or("").chars())
            .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
            .collect();
        let own = |line: &&str| line.len() - line.trim_start().len() == indent;
        let last = lines[at..].iter().position(|line| {
            let text = line.trim_end();
            // A body ends so; what a trait asks for, and a body of one line, end in their own way.
            own(line) && (text.trim_start() == "}" || text.ends_with([';', '}']))
        });
        found.push((name, last.expect("every function ends") + 1));
    }
    found
}

#[test]
fn functions_can_be_read() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let (mut count, mut long) = (0, Vec::new());
    for file in &files {
        let relative = file.strip_prefix(&root).unwrap();
        for (name, lines) in functions(&std::fs::read_to_string(file).unwrap()) {
            count += 1;
            let is_known = |(place, known): &(&str, &str)| {
                relative.starts_with(place) && (known.is_empty() || *known == name)
            };
            if lines > LONGEST_FUNCTION && !LONG.iter().any(is_known) {
                long.push(format!("{} {name}: {lines}", relative.display()));
            }
        }
    }
    assert!(count > 2000, "{count} functions found");
    assert!(
        long.is_empty(),
        "longer than {LONGEST_FUNCTION} lines: {long:#?}"
    );
}

#[test]
fn lengths_of_functions_are_found() {
    let text = "pub(in crate::a) const fn one(\n    x: u8,\n) -> u8 {\n    x\n}\n\ntrait T {\n    fn two(&self);\n    \
                fn three(&self) {\n        four();\n        five();\n    }\n}\nfn six() {}\n#[cfg(test)]\nmod tests {\n\
                fn seven() {}\n}\n";
    let expected = [("one", 5), ("two", 1), ("three", 4), ("six", 1)];
    assert_eq!(
        functions(text),
        expected.map(|(name, n)| (name.to_owned(), n))
    );
}
