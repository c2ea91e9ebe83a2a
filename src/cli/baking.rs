//! The steps of `haarlight bake`, in order: begin, rounds, gather, write, audit, end.

use super::bake_args::BakeArgs;
use super::log::{
    FinalRecord, Outputs, PlanRecord, RoundRecord, Seconds, SnapshotsRecord, VerdictRecord,
    exit_code,
};
use super::maps;
use super::metrics;
use super::options::Common;
use super::parting;
use super::paths::text;
use super::report::PageBuilder;
use super::results::print;
use super::rooms::{prepare_unless, write_npz};
use super::snapshots::Snapshots;
use super::stop::Stop;
use super::summary;
use super::talk::Talk;
use crate::audit::{self, PathReference};
use crate::error::{Error, Result};
use crate::gather::Baked;
use crate::lightmap::LightMaps;
use crate::mesh::Limits;
use crate::output::gltf::{Packing, Writing};
use crate::output::probes::ProbeGrid;
use crate::output::{BakedGlb, Exposure, baked_glb, mapped_glb, vertices_within};
use crate::report::Log;
use crate::scene::{Camera, Scene};
use crate::solve::{Bake, Round, Verdict};
use crate::store::file;
use std::fs::File;
use std::path::Path;
use std::time::Instant;

/// Pictures take this share of the time given at the most, or of the time so far. Where none is given they may take [`PICTURES_FREE_S`] in any
/// case: in a Cornell box a round's took 1 s a camera on two busy cores, and small rooms would have none.
const PICTURES_SHARE: f64 = 0.1;
const PICTURES_FREE_S: f64 = 2.0;
/// What a triangle that is expected of the written mesh takes, in looks at watched points, with all that is done besides and all triangles that are not foreseen: .75 in a
/// canteen, 1.0 in a restaurant and 1.7 in a dungeon (`--error 2`), 1.1 to 1.4 in a garage, 1.4 to 1.9 in a living room, 1.8 in a home theatre, 2.2 to 4.1 in a sunlit room
/// (`--error` 2, 1 and .5), 1.7 in two rooms and 3.3 in a furnished room (default).
const LOOKS: f64 = 1.75;
/// Distinguishes the audit's random numbers from the solver's.
const AUDIT_SEED: u64 = 0x5eed_a0d1;
/// Paths a point of the audit at the most.
const AUDIT_PATHS: usize = 65_536;

/// What a bake goes by: what was asked for, when to stop, whom to tell.
#[derive(Clone, Copy)]
pub(super) struct Order<'a> {
    pub(super) args: &'a BakeArgs,
    pub(super) common: &'a Common,
    pub(super) stop: &'a Stop,
    pub(super) talk: &'a Talk,
    pub(super) output: &'a Path,
    pub(super) cache: Option<&'a Path>,
    pub(super) cameras: &'a [Camera],
    /// Where probes stand.
    pub(super) grid: Option<&'a ProbeGrid>,
    /// Is the verdict asked for, by this rank or another?
    pub(super) told: bool,
}

/// What is kept of a bake while it goes on.
pub(super) struct Recorders {
    log: Option<Log<File>>,
    report: Option<PageBuilder>,
    snapshots: Option<Snapshots>,
    outputs: Outputs,
    seconds: Seconds,
    /// Seconds that pictures of the result will take: as long as those of the last round.
    drawing: f64,
    /// Seconds that those of the last round took, with their gather.
    last_pictures: f64,
}

/// The light that is written.
pub(super) struct WrittenLight {
    maps: Option<LightMaps>,
    /// At vertices of the written mesh; with maps, what pictures are exposed by.
    of_vertices: Baked,
    verdict: Verdict,
}

impl WrittenLight {
    fn baked(&self) -> &Baked {
        self.maps
            .as_ref()
            .map_or(&self.of_vertices, |maps| &maps.baked)
    }
}

/// The written room.
pub(super) struct Written {
    glb: BakedGlb,
    exposure: Exposure,
    /// A cache that cannot be written is told of when all else is done.
    uncached: Option<Error>,
}

impl Recorders {
    /// Opens what is written on the way; reading took `load_s` seconds.
    pub(super) fn new(order: Order, load_s: f64) -> Result<Self> {
        let Order { args, common, .. } = order;
        let pictures = args.snapshots.as_deref();
        let snapshots = pictures.map(|folder| Snapshots::new(folder, order.cameras, common.team));
        Ok(Self {
            log: args.log.as_deref().map(Log::create).transpose()?,
            report: None,
            snapshots: snapshots.transpose()?,
            outputs: Outputs {
                log: args.log.as_deref().map(text),
                ..Outputs::default()
            },
            seconds: Seconds {
                load: load_s,
                ..Seconds::default()
            },
            drawing: 0.0,
            last_pictures: 0.0,
        })
    }

    fn log(&mut self, record: &impl serde::Serialize) -> Result<()> {
        self.log.as_mut().map_or(Ok(()), |log| log.write(record))
    }

    /// Takes note of a round.
    fn note(&mut self, record: &RoundRecord) -> Result<()> {
        self.log(record)?;
        match &mut self.report {
            Some(report) => report.note(record),
            None => Ok(()),
        }
    }

    /// Takes note of the light after a round.
    fn see(&mut self, bake: &Bake) {
        if let Some(report) = &mut self.report {
            report.see(bake);
        }
    }
}

impl Order<'_> {
    /// Prepares the room; none if Ctrl-C ended that.
    pub(super) fn prepare(self, scene: Scene) -> Option<Bake> {
        let Self {
            args, common, talk, ..
        } = self;
        let asked = self.stop.preparing();
        let mut bake = prepare_unless(scene, &args.solving, common, args.spectrum, talk, asked)?;
        if self.cache.is_some() {
            bake.keep();
        }
        Some(bake)
    }

    /// Takes note of the plan, and goes on where a checkpoint ends.
    pub(super) fn begin(self, bake: &mut Bake, kept: &mut Recorders) -> Result<()> {
        let Self {
            args, common, talk, ..
        } = self;
        let plan = PlanRecord::new(bake, args.solving.time);
        kept.log(&plan)?;
        let report = args.report().map(|path| PageBuilder::new(path, &plan));
        kept.report = report.transpose()?;
        let resumed = args.checkpoint.as_deref();
        if let Some(path) = resumed.filter(|path| common.team.first_says(path.exists())) {
            bake.resume(path)?;
            for round in bake.rounds() {
                let to_end_s = None;
                kept.note(&RoundRecord { round, to_end_s })?;
            }
            kept.see(bake);
            let rounds = bake.rounds().len();
            talk.say(&format!("going on after round {rounds} of {}", text(path)));
        }
        kept.seconds.prepare = self.stop.elapsed_s() - kept.seconds.load;
        Ok(())
    }

    /// Rounds until it is enough.
    pub(super) fn rounds(self, bake: &mut Bake, kept: &mut Recorders) -> Result<Verdict> {
        let vertices = most_vertices(self.args, bake.scene())?;
        let ahead = |bake: &Bake, round: &Round| {
            let rounds = round.remaining_s?;
            Some(rounds + self.file_ahead(bake, round, vertices)?)
        };
        let verdict = self
            .stop
            .run(bake, self.talk, ahead, |bake, round, to_end_s| {
                kept.seconds.solve += round.round_s;
                kept.note(&RoundRecord { round, to_end_s })?;
                kept.see(bake);
                if let Some(path) = &self.args.checkpoint {
                    bake.save(path)?;
                }
                self.pictures(bake, round, kept)
            })?;
        kept.seconds.solve += bake.taken_back_s().unwrap_or(0.0);
        Ok(verdict)
    }

    /// Seconds that the mesh of the file is expected to take; light maps are not foreseen.
    fn file_ahead(self, bake: &Bake, round: &Round, vertices: Option<usize>) -> Option<f64> {
        (!self.args.mapping.is_wanted())
            .then(|| LOOKS * bake.triangles_ahead(vertices) as f64 * round.look_s)
    }

    /// Pictures of a round, as long as they take little of the time.
    fn pictures(self, bake: &Bake, round: &Round, kept: &mut Recorders) -> Result<()> {
        let (talk, stop, team) = (self.talk, self.stop, self.common.team);
        let free = (self.args.solving.time).map_or(PICTURES_FREE_S, |time| PICTURES_SHARE * time);
        // Those of the result are drawn in any case.
        let left =
            free.max(PICTURES_SHARE * stop.elapsed_s()) - kept.seconds.snapshots - kept.drawing;
        // These take as long as the last.
        let is_affordable = kept.last_pictures <= left;
        let Some(snapshots) = kept
            .snapshots
            .as_ref()
            .filter(|_| team.first_says(is_affordable))
        else {
            return Ok(());
        };
        let clock = Instant::now();
        let seen = snapshots.seen(bake.scene());
        // How long the first drawing takes is not known: half.
        let is_first = kept.last_pictures == 0.0;
        let time = if is_first {
            0.5 * left
        } else {
            left - kept.drawing
        };
        let late = || team.first_says(clock.elapsed().as_secs_f64() > time);
        let light = bake.sketch_within(&seen, &late, &|done, of| {
            talk.progress("gathering", done, of);
        });
        talk.phase("drawing");
        let drawn = Instant::now();
        let (scene, surfaces) = (bake.scene(), &light.surfaces);
        let exposure = self.args.showing.of(scene, surfaces, self.cameras);
        let start = format!("round-{:02}", round.round);
        let files = snapshots.pictures(&start, scene, surfaces, &exposure)?;
        kept.log(&SnapshotsRecord::new(round.round, &files, exposure))?;
        kept.outputs.pictures.extend(files);
        kept.drawing = drawn.elapsed().as_secs_f64();
        kept.last_pictures = clock.elapsed().as_secs_f64();
        kept.seconds.snapshots += kept.last_pictures;
        Ok(())
    }

    /// Looks up the light that is written: pictures on the way are sketches, the result is looked at more closely.
    pub(super) fn gather(
        self,
        bake: &Bake,
        verdict: Verdict,
        kept: &mut Recorders,
    ) -> Result<WrittenLight> {
        let Self {
            args, stop, talk, ..
        } = self;
        let clock = Instant::now();
        let limits = Limits {
            vertices: most_vertices(args, bake.scene())?,
            // Where there is no solution nothing is looked at: there is no time, and light beside what is believed would show as patches.
            late: &|| bake.rounds().is_empty() || stop.is_late(kept.drawing),
        };
        let maps = (args.mapping.is_wanted()).then(|| args.mapping.maps(bake, stop, talk));
        let of_vertices = match &maps {
            Some(_) => maps::metered(bake),
            None => bake.baked_within(&limits, &|done, of| talk.progress("gathering", done, of)),
        };
        let mut lit = WrittenLight {
            maps,
            of_vertices,
            verdict,
        };
        // A mesh that is as fine as it has to be was not cut short.
        let coarse = (lit.baked().interpolation).is_some_and(|between| !between.is_met());
        let cut_short = coarse && stop.is_late(kept.drawing);
        kept.seconds.gather = clock.elapsed().as_secs_f64();
        // An error is reached when the file's is.
        let error = bake.error_of(lit.baked());
        let met = error.is_none_or(|e| e <= bake.settings().error);
        lit.verdict = match verdict {
            Verdict::Reached if met => Verdict::Reached,
            // Whatever the rounds ended for, the file would be better had there been time.
            verdict if cut_short => stop.reason().unwrap_or(verdict),
            Verdict::Reached => Verdict::Exhausted,
            verdict => verdict,
        };
        Ok(lit)
    }

    /// Writes all but the page.
    pub(super) fn write(
        self,
        bake: &Bake,
        lit: &WrittenLight,
        kept: &mut Recorders,
    ) -> Result<Written> {
        let Self {
            args, talk, output, ..
        } = self;
        let clock = Instant::now();
        talk.phase("writing");
        let (scene, baked) = (bake.scene(), lit.baked());
        let exposure = args
            .showing
            .of(scene, &lit.of_vertices.surfaces, self.cameras);
        let glb = match &lit.maps {
            Some(maps) => mapped_glb(scene, maps, &exposure)?,
            None => baked_glb(scene, &baked.surfaces, &exposure, args.storing.writing())?,
        };
        glb.warnings.iter().for_each(|w| talk.warn(w));
        over_budget(args, &glb).iter().for_each(|w| talk.warn(w));
        let is_first = self.common.team.is_first();
        if is_first {
            file::write_atomic(output, Some(&args.room), |w| w.write_all(&glb.bytes))?;
        }
        kept.outputs.glb = text(output);
        if let Some(maps) = lit.maps.as_ref().filter(|_| is_first) {
            let (room, ktx2) = (&args.room, args.mapping.ktx2);
            kept.outputs.maps = maps::write(output, room, scene, maps, &glb, &exposure, ktx2)?;
        }
        if let Some(grid) = self.grid {
            talk.phase("probing");
            let names = (output, args.room.as_path());
            kept.outputs.probes = parting::write_probes(bake, grid, names, &exposure, talk)?;
        }
        kept.outputs.report = kept.report.as_ref().map(|r| text(&r.path));
        if let Some(path) = &args.npz {
            write_npz(path, &args.room, bake, baked)?;
            kept.outputs.npz = Some(text(path));
        }
        let uncached = self.write_cache(bake, baked, kept);
        if let Some(snapshots) = &kept.snapshots {
            let (files, exr) = snapshots.results(scene, &baked.surfaces, &exposure)?;
            kept.outputs.pictures.extend(files);
            kept.outputs.exr = exr;
        }
        kept.seconds.write = clock.elapsed().as_secs_f64();
        Ok(Written {
            glb,
            exposure,
            uncached,
        })
    }

    /// Writes the cache, if one is asked for; what went wrong.
    fn write_cache(self, bake: &Bake, baked: &Baked, kept: &mut Recorders) -> Option<Error> {
        let path = self.cache?;
        if !bake.keeps() {
            self.talk
                .warn("no cache: not even the first round was done");
            return None;
        }
        match bake.write_cache(baked, path, self.args.cache_limit << 20) {
            Ok(size) => {
                let mb = size as f64 / f64::from(1 << 20);
                self.talk.say(&format!("cache: {}, {mb:.1} MB", text(path)));
                kept.outputs.cache = Some(text(path));
                None
            }
            Err(error) => Some(error),
        }
    }

    /// Measures the error, if that is asked for.
    pub(super) fn audit(
        self,
        bake: &Bake,
        lit: &WrittenLight,
        kept: &mut Recorders,
    ) -> Result<Option<audit::Report>> {
        let clock = Instant::now();
        let audit = self.args.audit.map(|points| {
            self.talk.phase("auditing");
            let seed = self.common.seed ^ AUDIT_SEED;
            let reference = PathReference::new(bake, points, AUDIT_PATHS, seed);
            match &lit.maps {
                Some(maps) => audit::Report::of_maps(bake, maps, &reference),
                None => audit::Report::of_file(bake, lit.baked(), &reference),
            }
        });
        if let Some(audit) = &audit {
            kept.log(audit)?;
        }
        kept.seconds.audit = clock.elapsed().as_secs_f64();
        Ok(audit)
    }

    /// Says what came of it; the exit code.
    pub(super) fn end(
        self,
        bake: &Bake,
        lit: &WrittenLight,
        written: Written,
        audit: Option<&audit::Report>,
        mut kept: Recorders,
    ) -> Result<u8> {
        let Self {
            args, stop, talk, ..
        } = self;
        // All ranks look together.
        let metrics = match self.told {
            true => metrics::of_bake(bake, self.cameras),
            false => metrics::of_room(bake),
        };
        kept.seconds.total = stop.elapsed_s();
        let record = VerdictRecord::new(FinalRecord {
            bake,
            verdict: lit.verdict,
            baked: lit.baked(),
            glb: &written.glb,
            exposure: written.exposure,
            outputs: std::mem::take(&mut kept.outputs),
            metrics,
            seconds: kept.seconds,
            warned: talk.warned(),
        });
        kept.log(&record)?;
        if let Some(report) = &kept.report {
            self.page(report, (&record, audit), (bake, lit), &written)?;
        }
        talk.clear();
        talk.say(&format!("\n{}", summary::rounds(bake.rounds())));
        talk.say(&summary::verdict(&record, audit));
        talk.count_warnings();
        if args.json {
            let line = serde_json::to_string(&record)
                .map_err(|problem| Error::Internal(format!("verdict: {problem}")))?;
            print(&(line + "\n"))?;
        }
        written.uncached.map_or(Ok(exit_code(lit.verdict)), Err)
    }

    /// Writes the page.
    fn page(
        self,
        report: &PageBuilder,
        (record, audit): (&VerdictRecord, Option<&audit::Report>),
        (bake, lit): (&Bake, &WrittenLight),
        written: &Written,
    ) -> Result<()> {
        let baked = lit.baked();
        // The viewer opens no packed file, and knows vertices by their order.
        let asked = self.args.storing.writing();
        let plain = Writing {
            packing: Packing::default(),
            ..asked
        };
        let plain = match plain == asked {
            true => None,
            false => Some(baked_glb(
                bake.scene(),
                &baked.surfaces,
                &written.exposure,
                plain,
            )?),
        };
        let glb = plain.as_ref().unwrap_or(&written.glb);
        report.write(record, audit, baked, self.cameras, glb, bake)
    }
}

/// Vertices that the budget allows.
fn most_vertices(args: &BakeArgs, scene: &Scene) -> Result<Option<usize>> {
    let of_bytes = args
        .megabytes
        .map(|mb| vertices_within(scene, (mb * 1e6) as usize, args.storing.writing()))
        .transpose()?;
    Ok(args.vertices.into_iter().chain(of_bytes).min())
}

/// What to say of a file that is larger than its budget.
fn over_budget(args: &BakeArgs, glb: &BakedGlb) -> Vec<String> {
    let mb = glb.bytes.len() as f64 / 1e6;
    let vertices = args.vertices.filter(|most| glb.vertices > *most);
    let megabytes = args.megabytes.filter(|most| mb > *most);
    let of_vertices = vertices.map(|most| {
        let count = glb.vertices;
        format!("the baked room has {count} vertices and not {most}: the room itself needs as many")
    });
    let of_bytes =
        megabytes.map(|most| format!("the baked room takes {mb:.2} MB, more than {most}"));
    of_vertices.into_iter().chain(of_bytes).collect()
}
