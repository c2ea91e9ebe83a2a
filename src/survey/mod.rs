//! A look at a room before it is baked: is there anything to light, does a lamp light it, is it as large as a room?
//!
//! What is found is said with what to do about it. A room that would come out black is a problem, unless darkness is
//! allowed; a strange size is a warning.
//!
//! | file | what |
//! |---|---|
//! | `eyes` | what a ray meets: a front, a back, nothing |
//! | `content` | no surface, no lamp |
//! | `curved` | light that curved mirrors make caustics of |
//! | `lamps` | lamps that shine away from the room, and which faces to turn |
//! | `lying` | surfaces that lie in others |
//! | `openings` | open to a sky that nobody describes |
//! | `size` | rooms that are too large or too small to be rooms |
//! | `points` | points inside solids and outside the room |

mod content;
mod curved;
mod eyes;
mod lamps;
mod lying;
mod openings;
mod points;
mod size;

pub use points::{PointLocation, places};

use eyes::Eyes;

use crate::error::Problem;
use crate::scene::Scene;
use crate::team::{Interrupt, NEVER};

/// What is said of a room that was not looked over.
const GIVEN_UP: &str = "the room was not looked over, as that was interrupted: \
                        of openings, of surfaces in others and of lamps that shine away from it nothing is told";

/// What the user has decided already.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SurveyOptions {
    /// A room without light is meant.
    pub allow_dark: bool,
    /// Faces that look reversed are to be turned.
    pub flip: bool,
}

/// Looks the room over. Warnings join those of the scene; faces are turned if that was wished for; what a bake makes no
/// sense with is returned.
///
/// ```
/// use haarlight::scene::{Options, Scene};
/// use haarlight::survey::{SurveyOptions, advise};
/// let mut room = Scene::load("scenes/convex.glb", &Options::default())?;
/// assert!(advise(&mut room, SurveyOptions::default()).is_empty());
/// room.flip(0..room.surfaces.len());
/// let problems = advise(&mut room, SurveyOptions::default());
/// assert!(problems[0].what.contains("faces look reversed"));
/// // The same room again.
/// assert!(advise(&mut room, SurveyOptions { flip: true, ..SurveyOptions::default() }).is_empty());
/// # Ok::<(), haarlight::Error>(())
/// ```
pub fn advise(scene: &mut Scene, wishes: SurveyOptions) -> Vec<Problem> {
    advise_unless(scene, wishes, &NEVER)
}

/// [`advise`] that is given up once it is interrupted, with a warning: a bake does not need it, unless it turns faces.
pub fn advise_unless(
    scene: &mut Scene,
    wishes: SurveyOptions,
    interrupt: &Interrupt,
) -> Vec<Problem> {
    if let Some(problem) = content::nothing(scene) {
        return vec![problem];
    }
    scene.warnings.extend(size::hint(scene));
    let is_over = || !wishes.flip && interrupt.is_raised();
    let mut problem = content::no_lamp(scene);
    let found = looked_over(scene, problem.is_none(), &is_over);
    let (warnings, mut away) = found.unwrap_or_else(|| (vec![GIVEN_UP.to_owned()], None));
    scene.warnings.extend(warnings);
    if problem.is_none() {
        if wishes.flip {
            match &away {
                Some(found) if !found.turned.is_empty() => {
                    let said = found.turning(scene);
                    scene.flip(found.turned.clone());
                    scene.warnings.push(said);
                    away = lamps::away(&Eyes::new(scene));
                }
                _ => scene
                    .warnings
                    .push("--flip: nothing was turned, no lamp's faces look reversed".to_owned()),
            }
        }
        problem = away.map(|found| found.problem(scene));
    }
    match problem {
        Some(problem) if wishes.allow_dark => {
            let Problem { what, next, .. } = problem;
            scene.warnings.push(format!("{what}; {next}"));
            Vec::new()
        }
        problem => problem.into_iter().collect(),
    }
}

/// Warnings, and lamps that shine away if there are lamps; none if it was over before.
fn looked_over(
    scene: &Scene,
    has_lamps: bool,
    is_over: &dyn Fn() -> bool,
) -> Option<(Vec<String>, Option<lamps::Away>)> {
    let go_on = || (!is_over()).then_some(());
    go_on()?;
    let eyes = Eyes::new(scene);
    let mut warnings = Vec::new();
    for hint in [openings::hint, lying::hint, curved::hint] {
        go_on()?;
        warnings.extend(hint(&eyes));
    }
    go_on()?;
    let away = has_lamps.then(|| lamps::away(&eyes)).flatten();
    Some((warnings, away))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Options;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// What is said of a room whose faces all look away, if it is interrupted when it was asked so often.
    fn said(wishes: SurveyOptions, after: usize) -> (Vec<Problem>, Vec<String>) {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut room = Scene::load(folder.join("scenes/convex.glb"), &Options::default()).unwrap();
        room.flip(0..room.surfaces.len());
        let asked = AtomicUsize::new(0);
        let interrupt = Interrupt::by(Arc::new(move || {
            asked.fetch_add(1, Ordering::Relaxed) >= after
        }));
        let problems = advise_unless(&mut room, wishes, &interrupt);
        (problems, room.warnings)
    }

    #[test]
    fn a_survey_is_given_up_unless_it_turns_faces() {
        let plain = SurveyOptions::default();
        for after in 0..5 {
            let (problems, warnings) = said(plain, after);
            assert!(problems.is_empty(), "{after}: {problems:?}");
            assert_eq!(warnings, [GIVEN_UP], "{after}");
        }
        assert_eq!(said(plain, 5).0.len(), 1);
        let flip = SurveyOptions {
            flip: true,
            ..plain
        };
        let (problems, warnings) = said(flip, 0);
        assert!(problems.is_empty() && !warnings.contains(&GIVEN_UP.to_owned()));
    }
}
