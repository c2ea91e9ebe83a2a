//! Which of the known names was meant.

/// Names that are suggested.
const SHOWN: usize = 3;

/// The three of `names` nearest to `name`, nearest first: those that it begins or that begin it, then by edit distance
/// (letter case is free); of equals the first.
pub(crate) fn nearest_of<T: AsRef<str>>(
    name: &str,
    names: impl IntoIterator<Item = T>,
) -> Vec<String> {
    let given = name.to_lowercase();
    let rank = |known: &str| {
        let lower = known.to_lowercase();
        let begins = lower.starts_with(&given) || given.starts_with(&lower);
        (!begins, edit_distance(name, known))
    };
    let mut ranked: Vec<((bool, usize), String)> = Vec::new();
    for known in names {
        let known = known.as_ref();
        if ranked.iter().all(|(_, other)| other != known) {
            ranked.push((rank(known), known.to_owned()));
        }
    }
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.truncate(SHOWN);
    ranked.into_iter().map(|(_, known)| known).collect()
}

/// Levenshtein distance of the lower-case forms; letters beyond the 64th do not count.
fn edit_distance(a: &str, b: &str) -> usize {
    let letters = |text: &str| text.to_lowercase().chars().take(64).collect::<Vec<char>>();
    let (a, b) = (letters(a), letters(b));
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, &from) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &to) in b.iter().enumerate() {
            let replace = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = replace.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_come_first_and_each_once() {
        let names = ["wall", "lamp", "Wall", "lamp", "floor", "ceiling"];
        assert_eq!(nearest_of("lmap", names), ["lamp", "wall", "Wall"]);
        assert_eq!(nearest_of("wal", ["wall"; 5]), ["wall"]);
        // A name that was cut short is nearer than a shorter one with fewer changes.
        let keys = ["name", "csv", "luminance_cd_m2"];
        assert_eq!(nearest_of("luminance", keys)[0], "luminance_cd_m2");
        assert!(nearest_of("x", Vec::<String>::new()).is_empty());
    }
}
