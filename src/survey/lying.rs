//! Surfaces that lie in others.

use super::eyes::Eyes;

/// How many are named.
const NAMED: usize = 3;

/// What lies in something else, and what is made of it.
pub(super) fn hint(eyes: &Eyes) -> Option<String> {
    let scene = eyes.scene;
    let mut raised: Vec<_> = eyes.mesh.raised.iter().collect();
    raised.sort_by(|a, b| b.area.total_cmp(&a.area));
    let first = raised.first()?;
    let named: Vec<String> = (raised.iter().take(NAMED))
        .map(|found| {
            let [one, other] = found.surfaces.map(|s| scene.surfaces[s].name.as_str());
            format!("{one} in {other} ({:.3} m2)", found.area)
        })
        .collect();
    let more = match raised.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!(
        "surfaces lie in the plane of others: {}{more}; which is seen is chance, so light is worked out as if the first were {:.1} mm \
         higher: raise it in the file, too, or cut what it covers, or viewers will show both in patches",
        named.join(", "),
        first.height * 1000.0
    ))
}
