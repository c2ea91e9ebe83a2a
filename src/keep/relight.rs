//! The same room under other lamps and paints: links, form factors and visibility are kept, only the light is solved anew.
//!
//! A cache holds a finished bake (see `checkpoint`) and where every leaf and every vertex of the output gets its light
//! from (see `transport::trace`). Light is linear in lamps and, given the solution, in paints: direct light of the leaves is
//! one sparse product, the solve starts from the old solution, and the light of the vertices is another product. No ray
//! is cast: there is not even a ray index. What was refined for the old light stays as fine as it was: shadows of a lamp
//! that was dark beside the others are as coarse as they were worth then.
//!
//! A cache belongs to a shape: surfaces, sides, holes, places of lights. Where that changed it is refused with what
//! changed; so is a room in which a surface gives out light that did not (lamps may go out). A bake with layers is relit with layers.

use super::relit::TracedSide;
use crate::color::de2000;
use crate::error::{Error, Result};
use crate::gather::Baked;
use crate::hierarchy::{Counted, Frame};
use crate::light::lanes::Lanes;
use crate::light::{Light, Rows, padded};
use crate::link::LinkRows;
use crate::scene::Scene;
use crate::solve::solver::Convergence;
use crate::solve::{
    Bake, Closed, DE_PER_PERCENT, NOBODY, RoomAnalysis, SHARE_ALIKE, Settings, SolveInput, flux,
    punctual,
};
use crate::spectrum::BANDS;
use crate::store::codec::Read;
use crate::store::{Broken, Decoder, FileKind, Fingerprint, Packs, container};
use crate::transport::trace::{self, Stains};
use std::path::Path;
use std::time::Instant;

/// Relative error at which the solve of a first answer ends. In the furnished room such answers, to six changes, differ from the
/// whole ones by .02 % of the mean illuminance at the most (mean of the vertices), for 6 to 14 applications of the rows where the
/// whole ones take 18 to 28.
const ROUGH: f64 = 0.5;

/// A finished bake whose lamps and paints may change.
pub struct Relighter {
    bake: Bake,
    shape: Fingerprint,
    /// Which surfaces gave out light.
    lit: Vec<u8>,
    /// Of the room that the present lanes were chosen for.
    paint: Fingerprint,
    /// White of the last solution over the guess for its lamps and paints, X, Y, Z.
    guess: [f64; 3],
    /// What the leaves reflect by the bake, until it was asked for.
    start: Option<Rows>,
    /// Rows of links, once they were asked for.
    links: Option<LinkRows>,
    /// Of the present light.
    solved: Convergence,
    /// Was it solved for a first answer only?
    rough: bool,
    flux: flux::FluxBalance,
    leaves: Packs,
    kept: Vec<TracedSide>,
    /// What the bake estimated for geometry, over what its last two rounds differ by at the watched points with the same
    /// light on the patches.
    geometry: Option<f64>,
}

/// A relit room.
#[derive(Debug)]
#[non_exhaustive]
pub struct Relit {
    /// The output mesh with its new light.
    pub baked: Baked,
    /// What it took.
    pub record: RelitRecord,
}

/// What relighting took and how wrong it may be.
#[derive(Debug, Clone, serde::Serialize)]
#[non_exhaustive]
pub struct RelitRecord {
    /// Always `relit`.
    pub record: &'static str,
    /// Did lamps or paints change?
    pub changed: bool,
    /// Wavelength intervals of the working partition, all lights together.
    pub intervals_working: usize,
    /// Operator applications of the solve.
    pub iterations: usize,
    /// Mean colour difference (CIEDE2000), an estimate: geometry as the bake estimated it, times how much more (or less)
    /// the gathers of its last two rounds differ under this light than under its own, and as if these erred alike if the light changed; wavelengths
    /// and the solve as they are now.
    pub error_de2000: crate::solve::record::Figure,
    /// Where the light went; all 0 of a first answer, which does not count it.
    pub flux: flux::FluxBalance,
    /// Seconds: choice of lanes, direct light, solve, light of the vertices.
    pub lanes_s: f64,
    /// Direct light of the leaves.
    pub direct_s: f64,
    /// The solve.
    pub solve_s: f64,
    /// Light of the vertices.
    pub gather_s: f64,
}

impl Bake {
    /// Keeps where light comes from, for [`Bake::write_cache`]. To be called before the first round.
    pub fn keep(&mut self) {
        self.room.keep = true;
    }

    /// Is it kept where light comes from?
    pub fn keeps(&self) -> bool {
        self.room.keep
    }

    /// Writes what relighting needs beside the baked mesh; the size in bytes.
    ///
    /// # Errors
    /// The room is dark; the cache would be larger than `limit` bytes; the file cannot be written; a bake that did not [`Bake::keep`].
    pub fn write_cache(&self, baked: &Baked, path: &Path, limit: u64) -> Result<u64> {
        if !self.room.keep || baked.kept.len() != baked.surfaces.len() {
            return Err(Error::Internal("a bake that kept nothing".into()));
        }
        if self.solution.light.white == [0.0; 3] {
            return Err(Error::input(
                path.display().to_string(),
                "a room without light has nothing to keep: no patch is worth looking at",
                "bake it under the lamps that are to be changed",
            ));
        }
        let size = self.cache_bytes(baked);
        if size > limit {
            return Err(Error::input(
                path.display().to_string(),
                format!(
                    "the cache would take {} MB, and {} MB are allowed",
                    size >> 20,
                    limit >> 20
                ),
                "raise --cache-limit, or ask for a larger --error",
            ));
        }
        let guess = self.room.guess(&self.refinement.tree).white;
        let distance = self
            .watched_distance()
            .map_err(|Broken(what)| Error::Internal(what))?;
        let settings = serde_json::to_string(&self.room.settings)
            .map_err(|problem| Error::Internal(format!("settings: {problem}")))?;
        container::write(path, FileKind::Cache, |out| {
            Fingerprint::shape(&self.room.scene).encode(out)?;
            out.put(u8::from(self.room.scene.changes.layers.is_some()))?;
            Fingerprint::paint(&self.room.scene).encode(out)?;
            out.put_text(&settings)?;
            out.put_all(&self.room.spaces)?;
            out.put_all(&self.room.counted.splits)?;
            out.put_all(&self.room.counted.shares)?;
            out.put_all(self.room.frame.map(Frame::numbers).as_slice())?;
            out.put([self.room.closed, self.room.sealed].map(|c| u8::from(c == Closed::Yes)))?;
            out.put(guess)?;
            out.put(distance.unwrap_or(0.0))?;
            out.put_all(&lit(&self.room.scene))?;
            self.encode_state(false, out)?;
            out.put(baked.surfaces.len() as u64)?;
            for (surface, kept) in baked.surfaces.iter().zip(&baked.kept) {
                TracedSide::encode(surface, kept, out)?;
            }
            Ok(())
        })
    }

    /// Mean colour difference between what the traces of the last two rounds give at the watched points under the present
    /// light; none before there are two.
    fn watched_distance(&self) -> Read<Option<f64>> {
        let stains = Stains::new(&self.solution.filters);
        let seen = |round: &[Option<Box<[u8]>>]| -> Read<Vec<[f64; 3]>> {
            let rows = round
                .iter()
                .map(|packed| self.replayed(packed.as_deref(), &stains));
            rows.map(|row| Ok(self.solution.lanes.tristimulus(&row?)))
                .collect()
        };
        let [before, last] = &self.solution.watched;
        if before.is_empty() || before.len() != last.len() {
            return Ok(None);
        }
        let (a, b) = (seen(before)?, seen(last)?);
        // Equal light is no difference, also in the dark, where there is no white.
        let pairs = a.iter().zip(&b).filter(|(a, b)| a != b);
        let sum: f64 = pairs
            .map(|(a, b)| de2000(*a, *b, self.solution.light.white))
            .sum();
        Ok(Some(sum / a.len() as f64))
    }

    /// About how many bytes a cache takes.
    pub fn cache_bytes(&self, baked: &Baked) -> u64 {
        let leaves = &self.solution.light.leaves;
        let of_leaves: usize = leaves
            .iter()
            .map(|&leaf| self.refinement.direct.trace(leaf).map_or(0, <[u8]>::len))
            .sum();
        let vertices: usize = baked.kept.iter().map(Vec::len).sum();
        let of_vertices: usize = (baked.kept.iter().flatten())
            .map(|v| v.trace.as_ref().map_or(0, |t| t.len()))
            .sum();
        let rows = leaves.len() * (4 * self.solution.light.width() + 8);
        (of_leaves
            + of_vertices
            + 36 * vertices
            + 12 * baked
                .surfaces
                .iter()
                .map(|s| s.triangles.len())
                .sum::<usize>()
            + rows
            + 12 * self.refinement.tree.nodes.len()
            + self.refinement.leaf_rays.bytes()
            + 22 * self.refinement.graph.links.len()
            + 4 * self.refinement.graph.blockers.len()
            + 4 * self.room.spaces.len()) as u64
    }
}

impl Relighter {
    /// Opens the cache of a room, which may have other lamps and paints by now.
    ///
    /// # Errors
    /// The file cannot be read, is none of ours, is damaged, or belongs to a room of another shape; it has layers, and the lamps of the
    /// room now make more than rows hold.
    pub fn open(cache: &Path, scene: Scene) -> Result<Self> {
        let now = Fingerprint::shape(&scene);
        let place = cache.display().to_string();
        let mut opened = Err(Error::Internal("a cache that was not read".into()));
        container::read(cache, FileKind::Cache, |from| {
            let changed = Fingerprint::decode(from)?.change(&now);
            let ready = match changed {
                None => parted(scene, from.get::<u8>()? == 1),
                Some(what) => Err(refused(&place, &what)),
            };
            opened = match ready {
                Ok(scene) => Ok(Self::decode(scene, now, from)?),
                Err(error) => {
                    // What follows belongs to something else.
                    from.skip();
                    Err(error)
                }
            };
            Ok(())
        })?;
        let opened = opened?;
        match opened.newly_emitting(&opened.bake.room.scene) {
            None => Ok(opened),
            Some(what) => Err(refused(&place, &what)),
        }
    }

    /// A surface that gives out light and did not: nobody looked for its shadows.
    fn newly_emitting(&self, scene: &Scene) -> Option<String> {
        let now = lit(scene);
        let new = (0..now.len()).find(|&k| now[k] > self.lit[k])?;
        let name = &scene.surfaces[new].name;
        Some(format!("surface {name} gives out light and did not"))
    }

    fn decode(scene: Scene, shape: Fingerprint, from: &mut Decoder) -> Read<Self> {
        let paint = Fingerprint::decode(from)?;
        let settings: Settings = serde_json::from_str(&from.get_text()?)
            .map_err(|problem| Broken::new(format!("has settings that do not read: {problem}")))?;
        let spaces = from.get_all()?;
        let (splits, shares) = (from.get_all()?, from.get_all()?);
        let frame: Vec<[f64; 4]> = from.get_all()?;
        let closed = from
            .get::<[u8; 2]>()?
            .map(|c| if c == 1 { Closed::Yes } else { Closed::No });
        let analysis = RoomAnalysis {
            spaces,
            closed,
            counted: Counted { splits, shares },
            frame: frame.first().copied().map(Frame::of_numbers),
        };
        let mut bake = Bake::with(scene, settings, Some(analysis));
        bake.room.keep = true;
        let guess: [f64; 3] = from.get()?;
        let distance: f64 = from.get()?;
        let lit = from.get_exactly(bake.room.scene.surfaces.len())?;
        let (reflected, leaves) = bake.decode_state(false, from)?;
        let same = paint
            .change(&Fingerprint::paint(&bake.room.scene))
            .is_none();
        if same && reflected.width() == 0 {
            return Err(Broken::new("has lanes of light that is not there"));
        }
        let mut kept = Vec::new();
        for _ in 0..from.get::<u64>()? {
            kept.push(TracedSide::decode(&bake.room.mesh, from)?);
        }
        let white = bake.solution.light.white;
        Ok(Self {
            guess: over(white, guess, [1.0; 3]),
            geometry: (bake.rounds.last())
                .and_then(|r| Some(without(r.error.total_de2000.value?, r) / distance))
                .filter(|_| distance > 0.0),
            shape,
            lit,
            paint,
            start: Some(reflected).filter(|rows| rows.width() > 0),
            links: None,
            rough: false,
            solved: Convergence {
                bound: (bake.rounds.last())
                    .and_then(|r| r.error.convergence.value)
                    .unwrap_or(0.0),
                ..Convergence::default()
            },
            flux: bake.rounds.last().map(|r| r.flux).unwrap_or_default(),
            leaves,
            kept,
            bake,
        })
    }

    /// The room, to be relit under other lamps and paints.
    ///
    /// # Errors
    /// Its shape is another; its lamps make more layers than rows hold.
    pub fn change(&mut self, scene: Scene) -> Result<()> {
        let changed = self.shape.change(&Fingerprint::shape(&scene));
        if let Some(what) = changed.or_else(|| self.newly_emitting(&scene)) {
            return Err(refused(&scene.source.path.display().to_string(), &what));
        }
        let layers = self.bake.room.scene.changes.layers.is_some();
        self.bake.room.scene = parted(scene, layers)?;
        self.bake.room.plan = crate::scene::effects::Plan::of(&self.bake.room.scene);
        Ok(())
    }

    /// Makes what a first change would have to wait for: the table of colours as spectra, 45 ms.
    pub fn prepare(&self) {
        self.bake.room.upsampler.table();
    }

    /// Light for the lamps and paints that the room has now.
    ///
    /// # Errors
    /// The cache is damaged in a way that its checksum does not show.
    pub fn relight(&mut self) -> Result<Relit> {
        self.relit_within(self.bake.room.tolerance())
    }

    /// The same as a first answer, with what takes a solve longest left out; [`Relighter::relight`] goes on from there.
    ///
    /// # Errors
    /// As [`Relighter::relight`].
    pub fn relight_roughly(&mut self) -> Result<Relit> {
        self.relit_within(self.bake.room.tolerance().max(ROUGH))
    }

    fn relit_within(&mut self, tolerance: f64) -> Result<Relit> {
        self.relit(tolerance)
            .map_err(|Broken(what)| Error::input("the cache", what, FileKind::Cache.next()))
    }

    fn relit(&mut self, tolerance: f64) -> Read<Relit> {
        let clock = Instant::now();
        let paint = Fingerprint::paint(&self.bake.room.scene);
        let other = paint.change(&self.paint).is_some();
        let changed = other || self.rough;
        if other {
            self.choose_lanes()?;
            self.paint = paint;
        } else if changed {
            // On from the first answer.
        } else if let Some(reflected) = self.start.take() {
            self.bake.light_up(&reflected);
        }
        let lanes_s = clock.elapsed().as_secs_f64();
        let (convergence, flux, [direct_s, solve_s]) = match padded(self.bake.solution.lanes.len())
        {
            // The light is there already.
            _ if !changed => (self.solved, self.flux, [0.0; 2]),
            4 => self.solve::<4>(tolerance)?,
            8 => self.solve::<8>(tolerance)?,
            16 => self.solve::<16>(tolerance)?,
            32 => self.solve::<32>(tolerance)?,
            _ => self.solve::<64>(tolerance)?,
        };
        (self.solved, self.flux) = (convergence, flux);
        self.rough = changed && tolerance > self.bake.room.tolerance();
        let clock = Instant::now();
        let baked = self.bake.relit(&self.kept)?;
        let bake = &self.bake;
        let distance = bake.watched_distance()?;
        let error = self.geometry.zip(distance).map(|(share, distance)| {
            // What was refined for other light errs alike in both rounds. As if it did not, relit vertices of a furnished room in which all lamps but
            // one go out are off by .86 to 1.28 of the stated error (eight trials).
            let share = if changed {
                share.max(SHARE_ALIKE)
            } else {
                share
            };
            let geometry = share * distance;
            let solve = convergence.bound * 100.0 * DE_PER_PERCENT;
            (geometry.powi(2) + bake.solution.spectrum_error.unwrap_or(0.0).powi(2) + solve.powi(2))
                .sqrt()
        });
        Ok(Relit {
            record: RelitRecord {
                record: "relit",
                changed,
                intervals_working: bake.solution.lanes.len(),
                iterations: if changed { convergence.iterations } else { 0 },
                error_de2000: crate::solve::record::Figure::estimate(error),
                flux,
                lanes_s,
                direct_s,
                solve_s,
                gather_s: clock.elapsed().as_secs_f64(),
            },
            baked,
        })
    }

    /// Lanes for the present lamps and paints.
    fn choose_lanes(&mut self) -> Read<()> {
        let bake = &mut self.bake;
        let guess = bake.room.guess(&bake.refinement.tree).white;
        let white = std::array::from_fn(|c| self.guess[c] * guess[c]);
        bake.solution.light.white = bake.room.settings.white.unwrap_or(white);
        let (nodes, lights) = (
            bake.refinement.tree.nodes.len(),
            bake.room.scene.lights.len(),
        );
        let mut by_leaf = vec![Vec::new(); self.leaves.len()];
        if lights > 0 {
            self.leaves.for_each(&mut by_leaf, |packed, list| {
                if let Some(packed) = packed {
                    *list = trace::lamps_of(packed, nodes, lights)?;
                }
                Ok(())
            })?;
        }
        let shadowed = punctual::Shadowed { by_leaf, rays: 0 };
        bake.refinement.frozen = Some(shadowed);
        let before = bake.solution.lanes.clone();
        bake.choose_lanes().expect(NOBODY);
        bake.refinement.frozen = None;
        if !bake.solution.lanes.same_meaning(&before) {
            self.start = None;
        }
        Ok(())
    }

    /// Direct light by the kept weights, and the solve on the kept links.
    fn solve<const L: usize>(
        &mut self,
        tolerance: f64,
    ) -> Read<(Convergence, flux::FluxBalance, [f64; 2])> {
        let clock = Instant::now();
        let bake = &mut self.bake;
        let leaves = bake.solution.light.leaves.clone();
        bake.solution.light_lamps(&bake.room);
        let painter = bake.room.painter();
        let sources = painter.paint(&bake.refinement.tree, &leaves, &bake.solution.lanes);
        let mut light = std::mem::take(&mut bake.solution.light);
        let reflected = match self.start.take() {
            Some(rows) => rows,
            None => {
                let mut rows = Rows::zero(leaves.len(), L);
                if light.reflected.width() == L {
                    for (row, &leaf) in rows.all_mut::<L>().iter_mut().zip(&leaves) {
                        *row = light.reflected.all::<L>()[leaf as usize];
                    }
                }
                rows
            }
        };
        // What leaves get straight from lamps asks for nothing that is reflected.
        light.reflected = Rows::zero(0, L);
        light.emitted = bake.refinement.on_nodes::<L>(&sources.emission, &leaves);
        let shines = |row: &[f32; L]| f32::from(u8::from(row.iter().any(|&x| x > 0.0)));
        light.bright_emitted = light.emitted.all::<L>().iter().map(shines).collect();
        let mut first = Rows::zero(leaves.len(), L);
        let stains = Stains::new(&bake.solution.filters);
        self.leaves.for_each(first.all_mut::<L>(), |packed, row| {
            if let Some(packed) = packed {
                *row = trace::replay::<L>(packed, &light, &bake.solution.lamps, &stains)?;
            }
            Ok(())
        })?;
        let emitted = Some(std::mem::take(&mut light.emitted));
        bake.solution.light = light;
        let direct_s = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let looks = bake.refinement.leaf_rays.looks();
        // Where leaves look for themselves a solve asks for no links.
        let links = self.links.get_or_insert_with(|| {
            let links = if looks {
                &[]
            } else {
                &bake.refinement.graph.links[..]
            };
            LinkRows::new(bake.refinement.tree.nodes.len(), links)
        });
        // Nobody asks for neighbours without casting rays.
        let graph = std::mem::take(&mut bake.refinement.graph);
        let input = SolveInput {
            sources,
            first,
            reflected,
            emitted,
            tolerance,
            tilts: false,
            // A sweep more, which a first answer does without.
            counted: tolerance <= bake.room.tolerance(),
        };
        let (convergence, flux) = bake.solve_with::<L>(links, &leaves, input);
        bake.refinement.graph = graph;
        let guess = bake.room.guess(&bake.refinement.tree).white;
        self.guess = over(bake.solution.light.white, guess, self.guess);
        Ok((convergence, flux, [direct_s, clock.elapsed().as_secs_f64()]))
    }

    /// The bake behind it. It has no rays: nothing may be gathered at new points, see [`Relighter::probe`].
    pub fn bake(&self) -> &Bake {
        &self.bake
    }

    /// The room as it is lit now.
    pub fn scene(&self) -> &Scene {
        &self.bake.room.scene
    }

    /// What the lanes of the present light stand for.
    pub fn lanes(&self) -> &Lanes {
        &self.bake.solution.lanes
    }

    /// The present light on the patches, from the first [`Relighter::relight`] on. Of a room that was not changed since its
    /// bake it tells no irradiance.
    pub fn light(&self) -> &Light {
        &self.bake.solution.light
    }

    /// Radiosity on the 64 bands at every vertex of a relit mesh, see [`Bake::radiosity_spectra`].
    pub fn radiosity_spectra(&self, baked: &Baked) -> Vec<Vec<[f32; BANDS]>> {
        self.bake.radiosity_spectra(baked)
    }
}

/// The room with its lamps parted where those of the bake were, see [`Scene::part_lamps`].
fn parted(mut scene: Scene, layers: bool) -> Result<Scene> {
    if layers {
        scene.part_lamps()?;
    }
    Ok(scene)
}

/// White over guess, channel by channel; `otherwise` where nothing was guessed.
fn over(white: [f64; 3], guess: [f64; 3], otherwise: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| {
        if guess[c] > 0.0 {
            white[c] / guess[c]
        } else {
            otherwise[c]
        }
    })
}

/// For each surface: does it give out light?
fn lit(scene: &Scene) -> Vec<u8> {
    let emits = |material: usize| scene.materials[material].emission.is_some();
    scene
        .surfaces
        .iter()
        .map(|s| u8::from(emits(s.material)))
        .collect()
}

/// Estimate of a round without its wavelengths and its solve, which are known anew.
fn without(total: f64, round: &crate::solve::Round) -> f64 {
    let parts = [round.error.spectrum_de_luv, round.error.convergence_de_luv]
        .map(|f| f.value.unwrap_or(0.0).powi(2));
    (total * total - parts[0] - parts[1]).max(0.0).sqrt()
}

fn refused(place: &str, what: &str) -> Error {
    Error::input(
        place,
        format!("the cache belongs to a room of another shape: {what}"),
        FileKind::Cache.next(),
    )
}
