//! What lies outside a room: its sky, if any of it is seen.

use super::NOBODY;
use super::flux::{self, Closed};
use super::room::{RAISED, Room, Settings, plan_of};
use crate::geometry::openings::Openings;
use crate::hierarchy::{Mesh, Mirrors, Tree};
use crate::light::Filters;
use crate::scene::Scene;
use crate::scene::effects::{EffectKind, Plan};
use crate::team::{Interrupt, Interrupted};
use crate::transport::{Surroundings, find_openings};

/// Why a closed room has neither sky nor sun.
const CLOSED: &str = "the room is closed: no ray leaves it";

/// The plan of what a bake of a scene runs, without solving anything. Under a sky it casts the rays by which a bake finds out whether
/// the room is open to the sky, which takes seconds for 260 000 triangles.
pub fn running(scene: Scene) -> Plan {
    if scene.sky.is_none() || scene.surfaces.iter().all(|s| s.triangles.is_empty()) {
        let mesh = Mesh::new(&scene);
        let mut plan = plan_of(&scene, &mesh);
        if let Some(mirrors) = Mirrors::new(&scene, &mesh) {
            plan.say(EffectKind::Mirrors, &mirrors.said());
        }
        return plan;
    }
    let never = Interrupt::default();
    let (mut room, tree) = Room::shaped(scene, Settings::default(), None, never).expect(NOBODY);
    room.look_for_sky(&tree).expect(NOBODY);
    room.plan
}

impl Room {
    /// Finds out by rays what is closed, what is outside, and where the light of lamps goes first.
    pub(super) fn look_around(&mut self, tree: &Tree) -> Result<(), Interrupted> {
        self.look_for_sky(tree)?;
        let lanes = self.dense_lanes();
        let filters = Filters::new(&self.scene, &lanes);
        (self.sent, self.landings) =
            self.with_sight(|sight| self.follow_lamps(tree, &lanes, &filters, sight))?;
        Ok(())
    }

    /// Finds out by rays what is closed and what is outside.
    fn look_for_sky(&mut self, tree: &Tree) -> Result<(), Interrupted> {
        [self.closed, self.sealed] = self.with_sight(|sight| {
            flux::closedness(&self.mesh, tree, &self.rays, sight, self.settings.seed)
        });
        self.interrupt.check()?;
        self.look_outside(tree, true);
        // Openings that were looked for in vain are none.
        self.interrupt.check()
    }

    /// Looks for the openings of a room with a sky; takes the sky out of a room that is closed, which then costs nothing and is
    /// baked as if no sky were described.
    ///
    /// A room that is only relit has no rays to look with, and asks for no openings.
    pub(super) fn look_outside(&mut self, tree: &Tree, rays: bool) {
        if self.scene.sky.is_none() {
            return;
        }
        // The few rays that tell whether a room is closed may miss a slit. A room that is relit was looked at when it
        // was solved.
        let mut found = None;
        if rays && self.sealed == Closed::Yes {
            found = Some(self.find_openings(tree)).filter(|openings| !openings.is_empty());
            if found.is_some() {
                (self.closed, self.sealed) = (Closed::No, Closed::No);
            }
        }
        // Where rays meet only fronts and black backs, none leaves the room either.
        if self.sealed == Closed::Yes {
            let has_sun = self.plan.runs(EffectKind::Sun);
            self.scene.shut_out_sky();
            let occlusion = self.plan.runs(EffectKind::Occlusion);
            self.plan = Plan::of(&self.scene);
            if occlusion {
                self.plan.on(EffectKind::Occlusion, RAISED);
            }
            if let Some(mirrors) = &self.mirrors {
                self.plan.say(EffectKind::Mirrors, &mirrors.said());
            }
            self.plan.off(EffectKind::Sky, CLOSED);
            if has_sun {
                self.plan.off(EffectKind::Sun, CLOSED);
            }
            return;
        }
        if !rays {
            return;
        }
        let Some(sky) = self.scene.sky.clone() else {
            return;
        };
        let is_exact =
            self.panes.is_none() && self.with_sight(|sight| Surroundings::is_exact(&sky, sight));
        let openings = match is_exact {
            true => Openings::default(),
            false => found.unwrap_or_else(|| self.find_openings(tree)),
        };
        self.outside = Some(Surroundings { sky, openings });
    }

    /// Finds where rays leave the room, and counts the rays cast.
    fn find_openings(&mut self, tree: &Tree) -> Openings {
        let seed = self.settings.seed;
        let (openings, cast) = self
            .with_sight(|sight| find_openings(&self.mesh, tree, (sight, &self.interrupt), seed));
        self.opening_rays += cast;
        openings
    }
}
