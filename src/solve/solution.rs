//! What a round solves for: the light on the hierarchy, on the lanes chosen for it.

use super::room::{Room, by_rays};
use super::{GatherQuality, punctual};
use crate::hierarchy::Tree;
use crate::light::lanes::Lanes;
use crate::light::{Filters, Glass, Light, Rows, brightness, lightness_sensitivity, weighed};
use crate::link::Sight;
use crate::scene::PunctualLight;
use crate::transport::{AllowedNoise, Gatherer};

/// What one patch may misplace in a gather, share of the asked-for error.
const GATHER_SHARE: f64 = 0.1;
/// At points that are asked for, which are few. With as much noise as in the solve and with this they are off by 4.7 and 3.9 % in a dungeon at the default, by 3.5
/// and 3.0 in a restaurant, 2.6 and 2.5 in a living room, 2.6 and 2.0 in a home theatre and 1.9 and 1.6 in a garage (root mean square beside Mitsuba, seed 0), in
/// the same time. With half of it and 64 turns, in the solve as well, by 4.0, 2.9, 2.3, 1.9 and 1.6 % in 1.1, 1.1, 1.9, 1.5 and 1.3 times the time.
const NOISE_AT_POINT: AllowedNoise = AllowedNoise {
    lamps: 1.0,
    most_rays: 1024,
    glare: 1.0,
    // With as few as a tolerance in lightness asks for, points to which a hole of .1 m sends all their light are 9 % off.
    opening_rays: [4096, 4096],
    nearby: 2.0,
    paths: [64, 2048],
};
/// On leaves, and at watched points, by which the error of vertices is estimated: their lamps are as noisy. Watched as closely as points that are asked for, a furnished
/// room under other lamps stated 1.6 and 4.7 dE00 where 1.9 and 7.3 were measured at vertices.
const NOISE_IN_SOLVE: AllowedNoise = AllowedNoise {
    lamps: 4.0,
    most_rays: 256,
    glare: 1.0,
    opening_rays: [256, 4096],
    nearby: 4.0,
    paths: [64, 1024],
};
/// At vertices, which are many, and whose chance is evened out. With 6.3 times the rays to lamps and to bright patches `--error 1` takes 1.27 times the
/// time in a garage, 1.31 in a home theatre and 1.28 in a living room, for as many vertices and mean errors between them of .28 for .32, .44 for .42 and
/// .35 for .33. A ray may bring two tolerances and close by as many paths are followed as 8 ask for: files at `--error 1` are off by .72, .92 and .93 dE00
/// beside Mitsuba (two or three seeds; a sunlit room .25), with one tolerance, 16, and no fewer than 64 paths by .76, .88 and .99 (.28); a garage
/// takes .82 of the CPU time, a theatre 1.00 and .80 in two runs.
const NOISE_AT_VERTEX: AllowedNoise = AllowedNoise {
    glare: 2.0,
    nearby: 8.0,
    paths: [8, 1024],
    ..NOISE_IN_SOLVE
};

impl GatherQuality {
    /// What light may err by chance.
    pub(crate) fn allowed_noise(self) -> AllowedNoise {
        match self {
            Self::Full => NOISE_AT_POINT,
            Self::Watched => NOISE_IN_SOLVE,
            Self::Vertex(effort) => NOISE_AT_VERTEX.by(effort.samples()),
            Self::Preview => NOISE_AT_VERTEX,
        }
    }
}

/// A relative error of 1 % of a mid grey is about this colour difference, see `estimate`.
pub(crate) const DE_PER_PERCENT: f64 = 0.35;

/// Where the light of the watched points came from in a round, if kept.
pub(crate) type Traces = Vec<Option<Box<[u8]>>>;

/// The light of the last round.
pub(crate) struct Solution {
    pub(crate) lanes: Lanes,
    /// Colour difference (CIELUV) that the lanes cause, as far as it is known.
    pub(crate) spectrum_error: Option<f64>,
    /// Colour difference (CIELUV) that lists may make, where light is carried from patch to patch by lists.
    pub(crate) list_limit: Option<f64>,
    /// The spectra of panes and mirrors on the present lanes.
    pub(crate) filters: Filters,
    /// Punctual lights, recentred, with their rows.
    pub(crate) lamps: Vec<(PunctualLight, Vec<f32>)>,
    pub(crate) light: Light,
    /// Reflected radiosity of the round before, by node: the start of a solve.
    pub(crate) previous: Rows,
    /// Irradiance at the watched points, X, Y, Z; empty before the first round.
    pub(crate) seen: Vec<[f64; 3]>,
    /// Where that irradiance came from in the last two rounds, if kept.
    pub(crate) watched: [Traces; 2],
}

impl Solution {
    /// No light yet, on the 64 bands.
    pub(super) fn new(room: &Room) -> Self {
        let lanes = room.dense_lanes();
        Self {
            filters: Filters::new(&room.scene, &lanes),
            lanes,
            spectrum_error: None,
            list_limit: None,
            lamps: Vec::new(),
            light: Light::default(),
            previous: Rows::default(),
            seen: Vec::new(),
            watched: Default::default(),
        }
    }

    /// Puts the punctual lights on the present lanes, and tells how far off those are that shine from far away.
    pub(crate) fn light_lamps(&mut self, room: &Room) {
        self.light.half_size = room.mesh.half_size;
        self.lamps = punctual::lamps(&room.scene, &room.mesh, &self.lanes);
    }

    /// What turns a row into brightness, share of the white's.
    pub(super) fn bright_weights(&self) -> Vec<f64> {
        let white = self.light.white;
        let xyz = self.lanes.noticed().iter();
        xyz.map(|&xyz| brightness(xyz, white)).collect()
    }

    /// How bright each lamp is at a factor of 1, share of the white's.
    pub(super) fn bright_lamps(&self) -> Vec<f32> {
        let weights = self.bright_weights();
        let lamps = self.lamps.iter();
        lamps
            .map(|(_, row)| weighed(row, &weights) as f32)
            .collect()
    }

    /// How much a change of its irradiance changes the lightness of every node.
    pub(super) fn lightness_sensitivity(&self, tree: &Tree) -> Vec<f32> {
        let mut sensitivity = vec![0.0_f32; tree.nodes.len()];
        for (k, &leaf) in self.light.leaves.iter().enumerate() {
            let h = brightness(
                self.lanes.tristimulus(self.light.irradiance.row(k)),
                self.light.white,
            );
            sensitivity[leaf as usize] = lightness_sensitivity(h) as f32;
        }
        for k in (0..sensitivity.len()).rev() {
            let node = &tree.nodes[k];
            if !node.is_leaf() {
                let sum: f64 = node
                    .child_range()
                    .map(|c| f64::from(sensitivity[c as usize]) * tree.node(c).area)
                    .sum();
                sensitivity[k] = (sum / node.area) as f32;
            }
        }
        sensitivity
    }

    /// Reflected radiosity of the last round on the leaves of the present one: a new element starts from its nearest ancestor.
    pub(super) fn guess<const L: usize>(&self, tree: &Tree, leaves: &[u32]) -> Rows {
        let mut rows = Rows::zero(leaves.len(), L);
        if self.previous.width() == L {
            let known = self.previous.len();
            for (row, &leaf) in rows.all_mut::<L>().iter_mut().zip(leaves) {
                let mut id = leaf;
                while id as usize >= known {
                    id = tree.node(id).parent;
                }
                *row = self.previous.all::<L>()[id as usize];
            }
        }
        rows
    }

    /// What finds light at points.
    pub(crate) fn gatherer<'a>(
        &'a self,
        room: &'a Room,
        tree: &'a Tree,
        sight: &'a Sight<'a>,
    ) -> Gatherer<'a> {
        Gatherer {
            tree,
            light: &self.light,
            sight,
            lamps: &self.lamps,
            sky: room.outside.as_ref(),
            glass: sight.panes.map(|glazing| Glass {
                glazing,
                filters: &self.filters,
            }),
            filters: &self.filters,
            via: None,
            tolerance: GATHER_SHARE * room.settings.error / DE_PER_PERCENT * 0.01,
            closed: room.closed == super::flux::Closed::Yes,
            hemisphere: by_rays(sight).then_some(&room.hemisphere),
            shafts: true,
            keep: room.keep,
            most_backs: 1.0,
            allowed_noise: NOISE_IN_SOLVE,
        }
    }
}
