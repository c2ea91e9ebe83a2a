//! Does light come straight from a lamp to a place? Told by rays to the middles of lamps, and to the rims of those with an
//! extent.

use super::cells::{Cell, Cells, FENCE};
use crate::geometry::sampling::around;
use crate::geometry::{NO_PLANE, Segment};
use crate::link::Sight;
use crate::scene::LightKind;
use crate::scene::sky::SUN_RADIUS;
use crate::solve::Bake;
use crate::transport::{Receiver, punctual_factor};
use glam::DVec3;

/// A cover is treated like a lamp: light ends where the cover begins.
pub(super) const COVER: u64 = 1 << 63;
/// Lamps for whose shadows edges are looked for, at the most: those that give most light.
const LAMPS: usize = 62;
/// Places on the rim of a lamp.
const RIM: u32 = 4;

/// Where rays to a lamp end.
#[derive(Debug, Clone, Copy)]
enum RayTarget {
    /// Far away in a direction.
    Far(DVec3),
    At(DVec3),
}

/// A lamp as a source of shadows.
#[derive(Debug)]
struct ShadowLamp {
    /// Index among the punctual lights.
    number: usize,
    middle: RayTarget,
    /// Empty for a lamp without extent.
    rim: Vec<RayTarget>,
    /// Tristimulus intensity.
    light: [f64; 3],
}

/// The lamps whose shadows have edges.
pub(super) struct Shades<'a> {
    bake: &'a Bake,
    lamps: Vec<ShadowLamp>,
}

impl<'a> Shades<'a> {
    pub(super) fn new(bake: &'a Bake) -> Self {
        let mut lamps: Vec<ShadowLamp> = (bake.lamps().iter().enumerate())
            .filter_map(|(number, (lamp, row))| {
                let (middle, rim) = match lamp.kind {
                    LightKind::Sky(_) | LightKind::Ground(_) | LightKind::Surface => return None,
                    LightKind::Directional => (RayTarget::Far(-lamp.direction), Vec::new()),
                    LightKind::Sun => {
                        let turn = |k| f64::from(k) / f64::from(RIM);
                        let at = |k| around(-lamp.direction, SUN_RADIUS.cos(), turn(k));
                        let rim = (0..RIM).map(|k| RayTarget::Far(at(k)));
                        (RayTarget::Far(-lamp.direction), rim.collect())
                    }
                    LightKind::Point | LightKind::Spot { .. } | LightKind::Profile => {
                        (RayTarget::At(lamp.position), Vec::new())
                    }
                };
                let mut all = [0.0; 64];
                all[..row.len()].copy_from_slice(row);
                let light = bake.lanes().tristimulus(&all);
                Some(ShadowLamp {
                    number,
                    middle,
                    rim,
                    light,
                })
            })
            .collect();
        lamps.sort_by(|a, b| b.light[1].total_cmp(&a.light[1]));
        lamps.truncate(LAMPS);
        Self { bake, lamps }
    }

    pub(super) fn bake(&self) -> &'a Bake {
        self.bake
    }

    /// A place of a cell as a receiver, by weights of the corners of its triangle of the mesh.
    pub(super) fn place(&self, cells: &Cells, cell: &Cell, weights: [f64; 3]) -> Receiver {
        let sheet = &cells.sheets[cell.sheet as usize];
        let vertex = cells.divided.place(cell.of, weights);
        self.bake.texel(&vertex, sheet.surface, sheet.back)
    }

    /// Lamps whose shadow at one of some places would be visible: `shows` is given the light of a lamp there.
    pub(super) fn that_matter(&self, places: &[Receiver], shows: impl Fn([f64; 3]) -> bool) -> u64 {
        let half_size = self.bake.light().half_size;
        let mut found = 0;
        for (k, lamp) in self.lamps.iter().enumerate() {
            let punctual = &self.bake.lamps()[lamp.number].0;
            let factor = |to| punctual_factor(punctual, to, half_size).map_or(0.0, |(f, _)| f);
            let most = places.iter().map(factor).fold(0.0, f64::max);
            if most > 0.0 && shows(lamp.light.map(|x| x * most)) {
                found |= 1 << k;
            }
        }
        found
    }

    /// Does the middle of a lamp light a place? For [`COVER`]: is the place uncovered?
    pub(super) fn lit(&self, sight: &Sight, lamp: u64, to: &Receiver) -> bool {
        match lamp {
            COVER => !self.bake.is_under(sight, to),
            FENCE => true,
            _ => self.reaches(sight, self.of(lamp).middle, to),
        }
    }

    /// [`Self::lit`]; none in half shadow.
    pub(super) fn wholly(&self, sight: &Sight, lamp: u64, to: &Receiver) -> Option<bool> {
        let lit = self.lit(sight, lamp, to);
        let rim = match lamp {
            COVER | FENCE => &[],
            _ => self.of(lamp).rim.as_slice(),
        };
        let alike = rim.iter().all(|&aim| self.reaches(sight, aim, to) == lit);
        alike.then_some(lit)
    }

    /// Does the lamp throw no half shadow?
    pub(super) fn is_hard(&self, lamp: u64) -> bool {
        matches!(lamp, COVER | FENCE) || self.of(lamp).rim.is_empty()
    }

    fn of(&self, lamp: u64) -> &ShadowLamp {
        &self.lamps[lamp.trailing_zeros() as usize]
    }

    fn reaches(&self, sight: &Sight, aim: RayTarget, to: &Receiver) -> bool {
        let end = match aim {
            RayTarget::Far(direction) => to.point + direction * (4.0 * self.bake.light().half_size),
            RayTarget::At(place) => place,
        };
        !sight.blocks_one(&Segment::new(to.point, end, [to.plane, NO_PLANE]))
    }
}

/// The lamps of a set, one at a time.
pub(super) fn each(lamps: u64) -> impl Iterator<Item = u64> {
    (0..64)
        .map(|k| 1 << k)
        .filter(move |lamp| lamps & lamp != 0)
}
