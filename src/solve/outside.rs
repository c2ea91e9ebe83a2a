//! What lies outside a room: its sky, if any of it is seen.

use super::{Bake, Closed};
use crate::light::lanes::Lanes;
use crate::scene::effects::Kind;
use crate::transport::openings::Openings;
use crate::transport::sky::Outside;

/// Why a closed room has neither.
const CLOSED: &str = "the room is closed: no ray leaves it";

impl Bake {
    /// Looks for the openings of a room with a sky; takes the sky out of a room that is closed, which then costs nothing and is
    /// baked as if no sky were described.
    ///
    /// A room that is only relit has no rays to look with, and asks for no openings.
    pub(super) fn look_outside(&mut self, rays: bool) {
        if self.scene.sky.is_none() {
            return;
        }
        // Where only black backs are met besides fronts no ray leaves it either.
        if self.sealed == Closed::Yes {
            self.scene.shut_out_sky();
            self.lanes = Lanes::dense(&self.scene.spectra, &self.weights);
            self.plan = crate::scene::effects::Plan::of(&self.scene);
            self.plan.off(Kind::Sky, CLOSED);
            self.plan.off(Kind::Sun, CLOSED);
            return;
        }
        if !rays {
            return;
        }
        let seed = self.settings.seed;
        let openings = self.with_sight(|bake, sight| {
            if Outside::is_exact(sight) {
                return Openings::default();
            }
            Openings::find(&bake.mesh, &bake.tree, sight, seed)
        });
        self.outside = self.scene.sky.clone().map(|sky| Outside { sky, openings });
    }
}
