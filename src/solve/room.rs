//! The room that is baked: all that stays the same from the first round to the last.

use super::estimate::WatchedPoints;
use super::flux::{self, Closed, Sent};
use super::landed::Landing;
use super::parted_mesh::PartedMesh;
use super::representation::Representation;
use super::sources::Painter;
use crate::color::{Observer, Upsampler};
use crate::geometry::RayIndex;
use crate::hierarchy::{Counted, Frame, Glazing, Mesh, Mirrors, Panes, Tree};
use crate::light::lanes::Lanes;
use crate::link::{Opaque, Sight, is_small};
use crate::scene::Scene;
use crate::scene::effects::{EffectKind, Plan};
use crate::spectrum::Spectrum;
use crate::team::{Interrupt, Interrupted, Team};
use crate::transport::Surroundings;
use crate::transport::hemisphere::Hemisphere;

/// What the user asks for.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    /// Mean colour difference (CIEDE2000) at which to stop.
    pub error: f64,
    /// How spectra are carried.
    pub representation: Representation,
    /// Mean colour difference (CIELUV) that adaptive lanes may cause; none: a share of `error`.
    pub spectrum: Option<f64>,
    /// Seed of every sampling pattern.
    pub seed: u64,
    /// Irradiance (tristimulus) of the adaptation white; none: twice the mean irradiance of the room.
    pub white: Option<[f64; 3]>,
    /// Rounds at the most.
    pub rounds: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            error: 0.5,
            representation: Representation::Adaptive,
            spectrum: None,
            seed: 0,
            white: None,
            rounds: 12,
        }
    }
}

/// Rooms of few triangles with panes or mirrors use directions for this share of the error: rays find there what is clipped exactly in others,
/// and a ray costs next to nothing.
const GLAZED_DIRECTIONS: f64 = 0.25;
/// A shade around a bulb is as bright as a lamp, but found by rays like everything that passes light on: rooms with sheets use directions
/// for this share of the error. In a curtained room directions and tolerances of points twice as fine brought the estimate of the fifth
/// round from .56 to .38 dE00, with half the elements.
const SHEET_DIRECTIONS: f64 = 0.5;
/// The solve ends at this relative error per unit of asked-for colour difference: far below geometry and spectrum.
const SOLVE_SHARE: f64 = 0.002;

/// Why occlusion is tested where nothing else would block light.
pub(super) const RAISED: &str = "a surface lies in the plane of another";

/// A room that is baked. No round changes it; only relighting puts another scene of the same shape in its place.
pub(crate) struct Room {
    pub(crate) scene: Scene,
    pub(crate) settings: Settings,
    pub(crate) plan: Plan,
    pub(crate) mesh: Mesh,
    pub(crate) rays: RayIndex,
    /// The panes, through which light passes; none where the room has none.
    pub(crate) panes: Option<Panes>,
    /// The mirrors, which send light on in one direction; none where the room has none.
    pub(crate) mirrors: Option<Mirrors>,
    /// Does every ray meet a front?
    pub(crate) closed: Closed,
    /// As `closed`, leaving out points that something solid covers.
    pub(crate) sealed: Closed,
    /// What is outside; none where no light comes from outside.
    pub(crate) outside: Option<Surroundings>,
    /// Rays that looked for openings to a sky.
    pub(super) opening_rays: u64,
    /// Where the light of lamps goes first.
    pub(crate) sent: Sent,
    /// The places where that light lands on faces; empty in a room that is only relit.
    pub(super) landings: Vec<Landing>,
    pub(crate) weights: [Spectrum; 3],
    /// Turns colours of textures into spectra: its table is made once.
    pub(crate) upsampler: Upsampler,
    pub(crate) hemisphere: Hemisphere,
    /// The part of the hierarchy that counts; errors are averaged over this.
    pub(crate) counted: Counted,
    /// The box around that part, if most of the file lies outside it.
    pub(crate) frame: Option<Frame>,
    /// Points that are watched from round to round.
    pub(crate) probes: WatchedPoints,
    /// Space of each face, see [`spaces`](crate::hierarchy::spaces).
    pub(crate) spaces: Vec<u32>,
    /// Is the origin of light recorded, for relighting?
    pub(crate) keep: bool,
    /// The ranks that bake this room together.
    pub(crate) team: Team,
    /// Ends the preparing, or a round, before it is done.
    pub(crate) interrupt: Interrupt,
}

/// What rays have told of a room before the first round.
pub(crate) struct RoomAnalysis {
    pub(crate) spaces: Vec<u32>,
    /// Of all points, and of those that nothing covers.
    pub(crate) closed: [Closed; 2],
    /// The part that counts, and the box around it.
    pub(crate) counted: Counted,
    pub(crate) frame: Option<Frame>,
}

/// Do leaves and points of a room look for themselves? In a room of few triangles exact clipping is better, but it cannot
/// apply filters: where there are panes or mirrors, rays are used.
pub(super) fn by_rays(sight: &Sight) -> bool {
    let plain = sight.panes.is_none() && sight.mirrors.is_none();
    sight.occlusion && !(sight.small() && plain)
}

/// The share of the error for which a room chooses its directions.
fn directions(plan: &Plan, mesh: &Mesh) -> f64 {
    let filtered = plan.runs(EffectKind::Panes) || plan.runs(EffectKind::Mirrors);
    match (filtered && is_small(mesh), plan.runs(EffectKind::Sheets)) {
        (true, _) => GLAZED_DIRECTIONS,
        (_, true) => SHEET_DIRECTIONS,
        _ => 1.0,
    }
}

/// The plan as far as it follows from a scene and its welded mesh.
pub(super) fn plan_of(scene: &Scene, mesh: &Mesh) -> Plan {
    let mut plan = Plan::of(scene);
    if !mesh.raised.is_empty() {
        plan.on(EffectKind::Occlusion, RAISED);
    }
    plan
}

impl Room {
    /// Welds a scene, finds its spaces and the first hierarchy of its faces, and looks around outside.
    pub(super) fn new(
        scene: Scene,
        settings: Settings,
        analysis: Option<RoomAnalysis>,
        interrupt: Interrupt,
    ) -> Result<(Self, Tree), Interrupted> {
        let closed = analysis.as_ref().map(|known| known.closed);
        let (mut room, tree) = Self::shaped(scene, settings, analysis, interrupt)?;
        match closed {
            Some(closed) => {
                [room.closed, room.sealed] = closed;
                room.look_outside(&tree, false);
            }
            None => room.look_around(&tree)?,
        }
        Ok((room, tree))
    }

    /// [`Self::new`] without looking around outside.
    pub(super) fn shaped(
        scene: Scene,
        settings: Settings,
        analysis: Option<RoomAnalysis>,
        interrupt: Interrupt,
    ) -> Result<(Self, Tree), Interrupted> {
        let counted = analysis.as_ref().map(|known| known.counted.clone());
        let frame = analysis.as_ref().and_then(|known| known.frame);
        let (mut room, mut tree) = Self::framed(scene, settings, analysis, frame, interrupt)?;
        let found = counted.is_none();
        room.counted = counted.unwrap_or_else(|| room.count(&mut tree));
        tree.weigh(&room.counted);
        if let Some(frame) = room.frame_of(&tree).filter(|_| found) {
            (room, tree) =
                Self::framed(room.scene, room.settings, None, Some(frame), room.interrupt)?;
            room.counted = room.count(&mut tree);
            tree.weigh(&room.counted);
        }
        room.interrupt.check()?;
        room.probes = WatchedPoints::new(&tree, room.settings.seed);
        Ok((room, tree))
    }

    /// Builds the room so that only what lies in a frame counts, which is not weighed yet.
    fn framed(
        scene: Scene,
        settings: Settings,
        analysis: Option<RoomAnalysis>,
        frame: Option<Frame>,
        interrupt: Interrupt,
    ) -> Result<(Self, Tree), Interrupted> {
        interrupt.check()?;
        let mesh = Mesh::framed(&scene, frame);
        interrupt.check()?;
        let mut plan = plan_of(&scene, &mesh);
        let known = analysis.map(|known| known.spaces);
        let PartedMesh { mesh, rays, spaces } =
            PartedMesh::new(&scene, mesh, &plan, settings.seed, known, &interrupt)?;
        interrupt.check()?;
        let tree = Tree::new(&mesh, &spaces);
        interrupt.check()?;
        let mirrors = Mirrors::new(&scene, &mesh);
        if let Some(mirrors) = &mirrors {
            plan.say(EffectKind::Mirrors, &mirrors.said());
        }
        let room = Self {
            closed: Closed::No,
            sealed: Closed::No,
            outside: None,
            opening_rays: 0,
            sent: Sent::default(),
            landings: Vec::new(),
            panes: Panes::new(&scene, mesh.centre),
            mirrors,
            weights: Observer::cie1931().weights(&scene.grid),
            upsampler: Upsampler::new(&scene.grid),
            hemisphere: Hemisphere::for_error(settings.error * directions(&plan, &mesh)),
            counted: Counted::default(),
            frame,
            probes: WatchedPoints::default(),
            keep: false,
            team: Team::default(),
            interrupt,
            scene,
            settings,
            plan,
            mesh,
            rays,
            spaces,
        };
        Ok((room, tree))
    }

    /// Runs `f` with what blocks light in this room.
    pub(crate) fn with_sight<T>(&self, f: impl FnOnce(&Sight) -> T) -> T {
        let opaque = |triangle: u32, u: f32, v: f32| {
            let at = [1.0 - u - v, u, v];
            !crate::hierarchy::alpha::is_hole(&self.scene, &self.mesh, triangle, at)
        };
        let opaque: Option<&Opaque> = if self.plan.runs(EffectKind::AlphaMasks) {
            Some(&opaque)
        } else {
            None
        };
        f(&Sight {
            rays: &self.rays,
            mesh: &self.mesh,
            opaque,
            panes: self.glazing(),
            mirrors: self.mirrors.as_ref(),
            occlusion: self.plan.runs(EffectKind::Occlusion),
        })
    }

    /// Do leaves and points of this room look for themselves?
    pub(super) fn by_rays(&self) -> bool {
        self.with_sight(by_rays)
    }

    /// The panes of this room.
    pub(crate) fn glazing(&self) -> Option<Glazing<'_>> {
        let scene = &self.scene;
        (self.panes.as_ref()).map(|panes| Glazing { panes, scene })
    }

    /// Turns materials into rows.
    pub(crate) fn painter(&self) -> Painter<'_> {
        Painter::new(&self.scene, &self.mesh, &self.upsampler)
    }

    /// Radiosity itself on the 64 bands: lanes that serve every light.
    pub(crate) fn dense_lanes(&self) -> Lanes {
        Lanes::dense(&self.scene.spectra, &self.weights)
    }

    /// Relative error at which a solve ends.
    pub(crate) fn tolerance(&self) -> f64 {
        SOLVE_SHARE * self.settings.error
    }

    /// A rough guess of the room's brightness, before anything is solved.
    pub(crate) fn guess(&self, tree: &Tree) -> flux::Guess {
        flux::guess(&self.scene, &self.mesh, tree, &self.weights)
    }
}
