//! The code reads in the order light travels: a folder uses what stands before it, and no file is too long to be read.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Folders and files of `src`, from the bottom to the top. `lib` and `main` hold them together.
const ORDER: [&str; 24] = [
    "error",
    "data",
    "color",
    "spectrum",
    "scene",
    "geometry",
    "hierarchy",
    "store",
    "team",
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

/// Where the tests at the end of a file begin, whoever may use them.
fn tests_begin(text: &str) -> usize {
    let mark = "#[cfg(test)]\n";
    let module = |at: &usize| {
        let line = text[at + mark.len()..].lines().next();
        line.is_some_and(|line| line.ends_with("mod tests {"))
    };
    let mut marks = text.match_indices(mark).map(|(at, _)| at);
    marks.find(module).unwrap_or(text.len())
}

/// Code without comments and without the tests at its end, which may look at anything.
fn code(text: &str) -> String {
    let end = tests_begin(text);
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
    let end = tests_begin(text);
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
            if lines > LONGEST_FUNCTION {
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

/// The modules of `src`: path to file.
fn modules(root: &Path) -> BTreeMap<Vec<String>, PathBuf> {
    let mut files = Vec::new();
    sources(root, &mut files);
    let of = |file: PathBuf| {
        let relative = file.strip_prefix(root).unwrap().with_extension("");
        let mut path: Vec<String> = (relative.iter())
            .map(|part| part.to_str().unwrap().to_owned())
            .collect();
        path.pop_if(|last| *last == "mod" || *last == "lib");
        (path, file)
    };
    files.into_iter().map(of).collect()
}

/// The paths of a `use` tree: `a::{b, c::d as e}` is `a::b` known as `b`, and `a::c::d` known as `e`.
fn leaves(tree: &str, before: &[String], found: &mut Vec<(String, Vec<String>)>) {
    let tree = tree.trim();
    if let Some((head, group)) = tree.split_once('{') {
        let parts = head.split("::").map(|part| part.trim().to_owned());
        let before: Vec<String> = before
            .iter()
            .cloned()
            .chain(parts.filter(|p| !p.is_empty()))
            .collect();
        let (mut depth, mut from) = (0, 0);
        let group = &group[..group.rfind('}').unwrap_or(group.len())];
        for (at, c) in group.char_indices().chain([(group.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    leaves(&group[from..at], &before, found);
                    from = (at + 1).min(group.len());
                }
                _ => {}
            }
        }
    } else if !tree.is_empty() {
        let (path, name) = tree.split_once(" as ").unwrap_or((tree, ""));
        let mut whole: Vec<String> = before.to_vec();
        whole.extend(path.split("::").map(|part| part.trim().to_owned()));
        whole.pop_if(|last| *last == "self");
        let name = match name.trim() {
            "" => whole.last().cloned().unwrap_or_default(),
            name => name.to_owned(),
        };
        found.push((name, whole));
    }
}

/// Is it handed on? A name, and the path that it stands for.
type Named = (bool, String, Vec<String>);

/// What a file names of others: its `use` lines, said in public or not, and paths in its code.
fn named(code: &str) -> Vec<Named> {
    let mut found = Vec::new();
    let mut rest = String::new();
    for statement in code.split_inclusive(';') {
        let at = statement.find("use ").filter(|at| {
            let head = statement[..*at]
                .rsplit(['\n', '{', '}'])
                .next()
                .unwrap()
                .trim();
            head.is_empty() || head.starts_with("pub")
        });
        let Some(at) = at else {
            rest.push_str(statement);
            continue;
        };
        let is_public = statement[..at].trim_end().ends_with(['b', ')']);
        rest.push_str(&statement[..at]);
        let mut some = Vec::new();
        leaves(statement[at + 4..].trim_end_matches(';'), &[], &mut some);
        found.extend(some.into_iter().map(|(name, path)| (is_public, name, path)));
    }
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == ':';
    for word in rest
        .split(|c| !is_part(c))
        .filter(|word| word.contains("::"))
    {
        let path: Vec<String> = word.split("::").map(str::to_owned).collect();
        found.push((false, String::new(), path));
    }
    found
}

/// The file that a path means, seen from a module; `Y` of `pub use x::Y` stands where `x` says.
struct Resolver {
    files: BTreeMap<Vec<String>, PathBuf>,
    names: BTreeMap<Vec<String>, Vec<Named>>,
}

impl Resolver {
    fn file(&self, from: &[String], path: &[String], depth: usize) -> Option<Vec<String>> {
        let mut at = from.to_vec();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => (at, rest) = (Vec::new(), &path[1..]),
            "self" => rest = &path[1..],
            "super" => {
                while rest.first().is_some_and(|part| part == "super") {
                    at.pop();
                    rest = &rest[1..];
                }
            }
            first => {
                at.push(first.to_owned());
                if !self.files.contains_key(&at) {
                    return None;
                }
                rest = &path[1..];
            }
        }
        while let Some(part) = rest.first() {
            at.push(part.clone());
            if self.files.contains_key(&at) {
                rest = &rest[1..];
                continue;
            }
            at.pop();
            let again = self.names[&at].iter().find(|(_, name, _)| name == part);
            return match again {
                Some((_, _, path)) if depth > 0 => self.file(&at, path, depth - 1),
                _ => Some(at),
            };
        }
        Some(at)
    }
}

#[test]
fn no_circle_of_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = modules(&root);
    let read = |file: &PathBuf| named(&code(&std::fs::read_to_string(file).unwrap()));
    let names = files.iter().map(|(path, file)| (path.clone(), read(file)));
    let resolver = Resolver {
        names: names.collect(),
        files,
    };
    let mut uses: BTreeMap<&Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for (from, names) in &resolver.names {
        let of = uses.entry(from).or_default();
        // What a module only hands on it does not use.
        for (_, _, path) in names.iter().filter(|(is_public, ..)| !is_public) {
            of.extend(
                resolver
                    .file(from, path, 8)
                    .filter(|to| to != from && !to.is_empty()),
            );
        }
    }
    assert!(uses.values().map(BTreeSet::len).sum::<usize>() > 500);
    let reach = |from: &Vec<String>| {
        let (mut seen, mut left) = (BTreeSet::new(), vec![from]);
        while let Some(file) = left.pop() {
            left.extend(uses[file].iter().filter(|to| seen.insert((*to).clone())));
        }
        seen
    };
    let reached: BTreeMap<&Vec<String>, BTreeSet<Vec<String>>> =
        uses.keys().map(|from| (*from, reach(from))).collect();
    let mut circles = Vec::new();
    for (from, of) in &uses {
        let back = of.iter().filter(|to| reached[to].contains(*from));
        circles.extend(back.map(|to| format!("{} uses {}", from.join("/"), to.join("/"))));
    }
    assert!(circles.is_empty(), "circles of files: {circles:#?}");
}

/// The name of the type that a line declares at the level of its module, and whether other files can see it.
fn declared(line: &str) -> Option<(bool, &str)> {
    let (is_visible, rest) = match line.strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => (true, rest.split_once(") ")?.1),
        Some(rest) => (true, rest.strip_prefix(' ')?),
        None => (false, line),
    };
    let (what, name) = rest.split_once(' ')?;
    let is_type = matches!(what, "struct" | "enum" | "trait" | "type");
    let end = name.find(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    is_type.then(|| (is_visible, &name[..end.unwrap_or(name.len())]))
}

#[test]
fn a_name_of_a_type_has_one_meaning() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut names: BTreeMap<String, (bool, BTreeSet<PathBuf>)> = BTreeMap::new();
    for file in files {
        let text = code(&std::fs::read_to_string(&file).unwrap());
        for (is_visible, name) in text.lines().filter_map(declared) {
            let of = names.entry(name.to_owned()).or_default();
            of.0 |= is_visible;
            of.1.insert(file.clone());
        }
    }
    assert!(names.len() > 500, "{} names found", names.len());
    names.retain(|_, (is_visible, files)| *is_visible && files.len() > 1);
    assert!(names.is_empty(), "declared more than once: {names:#?}");
}

#[test]
fn declarations_of_types_are_found() {
    let lines = [
        "pub(in crate::a) struct A<'a> {",
        "pub enum B {",
        "type C = u8;",
    ];
    let expected = [(true, "A"), (true, "B"), (false, "C")];
    assert_eq!(lines.map(|line| declared(line).unwrap()), expected);
    let others = [
        "pub use a::B;",
        "    struct D;",
        "fn e() {}",
        "pub fn f() {",
    ];
    assert!(others.iter().all(|line| declared(line).is_none()));
}
