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
    if let Some(problem) = content::nothing(scene) {
        return vec![problem];
    }
    scene.warnings.extend(size::hint(scene));
    let eyes = Eyes::new(scene);
    let warnings = [openings::hint, lying::hint, curved::hint].map(|hint| hint(&eyes));
    let mut problem = content::no_lamp(scene);
    let mut away = match problem {
        None => lamps::away(&eyes),
        Some(_) => None,
    };
    scene.warnings.extend(warnings.into_iter().flatten());
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
