//! `haarlight bake ROOM`: the room back with its light baked in, pictures and a log on the way.
//!
//! Rounds until the error asked for, `--time` or Ctrl-C; what there is then is written out whole. The exposure of the
//! baked room is metered from its own light, through its cameras, whether or not pictures were taken: the same room gives
//! the same bytes.

use super::log::{End, Outputs, PlanRecord, Seconds, SnapshotsRecord, VerdictRecord, exit_code};
use super::maps::{self, Mapping};
use super::options::{Common, Reading, Showing, Solving, Storing, positive};
use super::parting::{self, Parting};
use super::paths::text;
use super::report::Report;
use super::results::print;
use super::snapshots::Snapshots;
use super::stop::Stop;
use super::talk::Talk;
use super::{paths, summary};
use crate::audit::{self, Reference};
use crate::error::{Error, Problem, Result};
use crate::gather::Baked;
use crate::mesh::Limits;
use crate::output::gltf::{Packing, Writing};
use crate::output::{BakedGlb, baked_glb, camera, mapped_glb, npz, vertices_within};
use crate::report::Log;
use crate::scene::Scene;
use crate::solve::{Bake, Representation, Settings, Verdict};
use crate::store::file;
use crate::survey::advise;
use crate::team::Team;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Phases of a round, in order.
const PHASES: [&str; 6] = [
    "links", "spectrum", "direct", "balance", "solve", "estimate",
];
/// Pictures of rounds take this share of the time so far at the most, once they have taken [`PICTURES_FREE_S`].
const PICTURES_SHARE: f64 = 0.1;
const PICTURES_FREE_S: f64 = 10.0;
/// Distinguishes the audit's random numbers from the solver's.
const AUDIT_SEED: u64 = 0x5eed_a0d1;
/// Paths a point of the audit at the most.
const AUDIT_PATHS: usize = 65_536;

/// Arguments of `bake`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  haarlight bake room.glb
  haarlight bake room.gltf -o lit.glb --error 0.3 --spectra measured.spectra.json
  haarlight bake room.glb --snapshots pictures --log bake.jsonl --audit 200
  haarlight bake room.glb --checkpoint room.state      stop it at any time; the same command goes on
  haarlight bake room.glb --report                     and a page, room.report.html, to look at the light in a browser
  haarlight bake room.glb --cache                      then change lamps or paints: haarlight relight room.glb")]
#[non_exhaustive]
pub struct BakeArgs {
    /// The room, .glb or .gltf.
    pub room: PathBuf,
    /// The baked room [default: ROOM's name with .baked.glb, beside it].
    #[arg(short, long, value_name = "OUT.glb")]
    pub output: Option<PathBuf>,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
    /// When to stop.
    #[command(flatten)]
    pub solving: Solving,
    /// How it is shown.
    #[command(flatten)]
    pub showing: Showing,
    /// How it is stored.
    #[command(flatten)]
    pub storing: Storing,
    /// In vertices or in maps.
    #[command(flatten)]
    pub mapping: Mapping,
    /// What is written beside it.
    #[command(flatten)]
    pub parting: Parting,
    /// The baked room has this many vertices at the most, but never fewer than the room itself.
    #[arg(long, value_name = "N")]
    pub vertices: Option<usize>,
    /// The baked room takes about this many megabytes (1e6 bytes) at the most, but never fewer than the room itself.
    #[arg(long, value_name = "MB", value_parser = positive)]
    pub megabytes: Option<f64>,
    /// JSON lines: plan, rounds, verdict.
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// A PNG from each camera after every round, while that takes less than a tenth of the time, and of the result; an EXR of
    /// the result.
    #[arg(long, value_name = "DIR")]
    pub snapshots: Option<PathBuf>,
    /// Positions, normals and spectra of all vertices for NumPy.
    #[arg(long, value_name = "FILE")]
    pub npz: Option<PathBuf>,
    /// Measure the error at N random points by Monte Carlo.
    #[arg(long, value_name = "N")]
    pub audit: Option<usize>,
    /// Keep the state of the bake here after every round; if the file is there already, go on from it.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Keep here what `haarlight relight` needs to change lamps and paints without casting a ray [without a value: ROOM's
    /// name with .cache, beside it, where `relight` looks].
    #[arg(long, value_name = "FILE")]
    pub cache: Option<Option<PathBuf>>,
    /// Write a page that shows the room with its light, its errors and what they took: one HTML file that needs no network
    /// [without a value: ROOM's name with .report.html, beside it].
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<Option<PathBuf>>,
    /// The cache may take this much, MB.
    #[arg(long, value_name = "MB", default_value_t = 2048)]
    pub cache_limit: u64,
    /// How spectra are carried: perceptual, guaranteed (bounds instead of estimates), paper, uniform:N,
    /// characteristic:N, dense (all 64 leaves) or rgb.
    #[arg(long, value_name = "HOW", default_value_t, hide_short_help = true)]
    pub spectrum: Representation,
    /// Print the verdict as one JSON object.
    #[arg(long)]
    pub json: bool,
}

impl BakeArgs {
    /// The same with a report, named or not.
    pub(super) fn with_report(mut self) -> Self {
        self.report.get_or_insert(None);
        self
    }

    /// What a rank is to do: but for the first, it writes nothing that others need no part of.
    fn of_rank(&self, team: Team) -> Self {
        let mut args = self.clone();
        if !team.is_first() {
            (args.log, args.npz, args.report) = (None, None, None);
            args.json = false;
        }
        args
    }

    fn report(&self) -> Option<PathBuf> {
        let named = self.report.clone()?;
        Some(named.unwrap_or_else(|| paths::report_of(&self.room)))
    }
}

/// Bakes; the exit code.
///
/// # Errors
/// As [`Scene::load`]; outputs that would overwrite an input or each other; files that cannot be written.
pub fn run(args: &BakeArgs, common: &Common) -> Result<u8> {
    let team = common.team;
    let args = &args.of_rank(team);
    let stop = Stop::new(args.solving.time).of_all(team);
    stop.listen()?;
    let talk = Talk::new(common.quiet || !team.is_first());
    let output = args
        .output
        .clone()
        .unwrap_or_else(|| args.room.with_extension("baked.glb"));
    let cache = cache(args);
    talk.phase("reading");
    let mut scene = load(&args.room, &args.reading, |parts| {
        problems(args, &output, cache.as_deref(), parts, team)
    })?;
    args.parting.part(&mut scene, &talk)?;
    let grid = args.parting.grid(&scene)?;
    scene.warnings.iter().for_each(|w| talk.warn(w));
    let mut seconds = Seconds {
        load: stop.elapsed_s(),
        ..Seconds::default()
    };

    let clock = Instant::now();
    talk.phase("preparing");
    let cameras = camera::cameras(&scene);
    seconds.prepare = clock.elapsed().as_secs_f64();
    let snapshots = args
        .snapshots
        .as_deref()
        .map(|folder| Snapshots::new(folder, &cameras, team))
        .transpose()?;
    let mut log = args.log.as_deref().map(Log::create).transpose()?;
    let mut outputs = Outputs {
        log: args.log.as_deref().map(text),
        ..Outputs::default()
    };

    let clock = Instant::now();
    let mut bake = prepare(scene, &args.solving, common, args.spectrum, &talk);
    if args.checkpoint.is_some() {
        bake.can_be_kept("--checkpoint")?;
    }
    if cache.is_some() {
        bake.can_be_kept("--cache")?;
        bake.keep();
    }
    let plan = PlanRecord::new(&bake, args.solving.time);
    write(&mut log, &plan)?;
    let mut report = args
        .report()
        .map(|path| Report::new(path, &plan))
        .transpose()?;
    let resumed = args.checkpoint.as_deref();
    if let Some(path) = resumed.filter(|path| team.first_says(path.exists())) {
        bake.resume(path)?;
        for round in bake.rounds() {
            write(&mut log, round)?;
        }
        if let Some(report) = &mut report {
            report.note(&bake);
        }
        let rounds = bake.rounds().len();
        talk.say(&format!("going on after round {rounds} of {}", text(path)));
    }
    seconds.prepare += clock.elapsed().as_secs_f64();

    // Seconds that pictures of the result will take: as long as those of the last round.
    let mut drawing = 0.0;
    let verdict = stop.run(&mut bake, &talk, |bake, round| {
        seconds.solve += round.round_s;
        write(&mut log, round)?;
        if let Some(report) = &mut report {
            report.note(bake);
        }
        if let Some(path) = &args.checkpoint {
            bake.save(path)?;
        }
        let affordable = PICTURES_SHARE * stop.elapsed_s().max(PICTURES_FREE_S / PICTURES_SHARE);
        if let Some(snapshots) = snapshots
            .as_ref()
            .filter(|_| team.first_says(seconds.snapshots <= affordable))
        {
            let clock = Instant::now();
            let seen = snapshots.seen(bake.scene());
            let light = bake.sketch(&seen, &|done, of| talk.progress("gathering", done, of));
            talk.phase("drawing");
            let drawn = Instant::now();
            let (scene, surfaces) = (bake.scene(), &light.surfaces);
            let exposure = args.showing.of(scene, surfaces, &cameras);
            let start = format!("round-{:02}", round.round);
            let files = snapshots.pictures(&start, scene, surfaces, &exposure)?;
            write(
                &mut log,
                &SnapshotsRecord::new(round.round, &files, exposure),
            )?;
            outputs.pictures.extend(files);
            drawing = drawn.elapsed().as_secs_f64();
            seconds.snapshots += clock.elapsed().as_secs_f64();
        }
        Ok(())
    })?;

    // Pictures on the way are sketches; the result is looked at more closely.
    let clock = Instant::now();
    let limits = Limits {
        vertices: most_vertices(args, bake.scene())?,
        late: &|| stop.is_late(drawing),
    };
    let maps = (args.mapping.is_wanted()).then(|| args.mapping.maps(&bake, &stop, &talk));
    let of_vertices = match &maps {
        Some(_) => maps::metered(&bake),
        None => bake.baked_within(&limits, &|done, of| talk.progress("gathering", done, of)),
    };
    let baked = maps.as_ref().map_or(&of_vertices, |maps| &maps.baked);
    let cut_short = stop.is_late(drawing);
    seconds.gather = clock.elapsed().as_secs_f64();
    // An error is reached when the file's is.
    let met = bake
        .error_of(baked)
        .is_none_or(|e| e <= bake.settings().error);
    let verdict = match verdict {
        Verdict::Reached if !met && cut_short => stop.reason().unwrap_or(Verdict::Exhausted),
        Verdict::Reached if !met => Verdict::Exhausted,
        verdict => verdict,
    };

    let clock = Instant::now();
    talk.phase("writing");
    let (scene, room) = (bake.scene(), Some(args.room.as_path()));
    let exposure = args.showing.of(scene, &of_vertices.surfaces, &cameras);
    let glb = match &maps {
        Some(maps) => mapped_glb(scene, maps, &exposure)?,
        None => baked_glb(scene, &baked.surfaces, &exposure, args.storing.writing())?,
    };
    glb.warnings.iter().for_each(|w| talk.warn(w));
    over_budget(args, &glb).iter().for_each(|w| talk.warn(w));
    if team.is_first() {
        file::write_atomic(&output, room, |w| w.write_all(&glb.bytes))?;
    }
    outputs.glb = text(&output);
    if let Some(maps) = maps.as_ref().filter(|_| team.is_first()) {
        let (room, ktx2) = (&args.room, args.mapping.ktx2);
        outputs.maps = maps::write(&output, room, scene, maps, &glb, &exposure, ktx2)?;
    }
    if let Some(grid) = &grid {
        talk.phase("probing");
        let names = (output.as_path(), args.room.as_path());
        outputs.probes = parting::write_probes(&bake, grid, names, &exposure, &talk)?;
    }
    outputs.report = report.as_ref().map(|r| text(&r.path));
    if let Some(path) = &args.npz {
        write_npz(path, &args.room, &bake, baked)?;
        outputs.npz = Some(text(path));
    }
    // A cache that cannot be written is told of when all else is done.
    let mut uncached = None;
    if let Some(path) = &cache {
        match bake.write_cache(baked, path, args.cache_limit << 20) {
            Ok(size) => {
                talk.say(&format!("cache: {}, {:.1} MB", text(path), megabytes(size)));
                outputs.cache = Some(text(path));
            }
            Err(error) => uncached = Some(error),
        }
    }
    if let Some(snapshots) = &snapshots {
        let (files, exr) = snapshots.results(scene, &baked.surfaces, &exposure)?;
        outputs.pictures.extend(files);
        outputs.exr = exr;
    }
    seconds.write = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let audit = args.audit.map(|points| {
        talk.phase("auditing");
        let seed = common.seed ^ AUDIT_SEED;
        let reference = Reference::new(&bake, points, AUDIT_PATHS, seed);
        match &maps {
            Some(maps) => audit::Report::of_maps(&bake, maps, &reference),
            None => audit::Report::of_file(&bake, baked, &reference),
        }
    });
    if let Some(audit) = &audit {
        write(&mut log, audit)?;
    }
    seconds.audit = clock.elapsed().as_secs_f64();

    seconds.total = stop.elapsed_s();
    let end = End {
        bake: &bake,
        verdict,
        baked,
        glb: &glb,
        exposure,
        outputs,
        seconds,
        warned: talk.warned(),
    };
    let record = VerdictRecord::new(end);
    write(&mut log, &record)?;
    if let Some(report) = &report {
        // The viewer opens no packed file, and knows vertices by their order.
        let plain = Writing {
            packing: Packing::default(),
            ..args.storing.writing()
        };
        let plain = match plain == args.storing.writing() {
            true => None,
            false => Some(baked_glb(scene, &baked.surfaces, &exposure, plain)?),
        };
        let glb = plain.as_ref().unwrap_or(&glb);
        report.write(&record, audit.as_ref(), baked, &cameras, glb, &bake)?;
    }
    talk.clear();
    talk.say(&format!("\n{}", summary::rounds(bake.rounds())));
    talk.say(&summary::verdict(&record, audit.as_ref()));
    talk.count_warnings();
    if args.json {
        let line = serde_json::to_string(&record)
            .map_err(|problem| Error::Internal(format!("verdict: {problem}")))?;
        print(&(line + "\n"))?;
    }
    uncached.map_or(Ok(exit_code(verdict)), Err)
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

fn megabytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// Reads a room and looks it over; its problems and those that `others` finds (given the files the room is made of) come together.
pub(super) fn load(
    room: &Path,
    reading: &Reading,
    others: impl FnOnce(&[PathBuf]) -> Vec<Problem>,
) -> Result<Scene> {
    match Scene::load(room, &reading.options()) {
        Ok(mut scene) => {
            let mut problems = advise(&mut scene, reading.wishes());
            problems.extend(others(&paths::parts(&scene)));
            if problems.is_empty() {
                Ok(scene)
            } else {
                Err(Error::Input(problems))
            }
        }
        Err(Error::Input(mut problems)) => {
            problems.extend(others(&[]));
            Err(Error::Input(problems))
        }
        Err(Error::Io { path, source }) => {
            let mut problems = vec![Problem::new(
                path,
                source.to_string(),
                "name a file that can be read",
            )];
            problems.extend(others(&[]));
            Err(Error::Input(problems))
        }
        Err(fault) => Err(fault),
    }
}

/// The bake of a scene, which tells `talk` of its phases.
pub(super) fn prepare(
    scene: Scene,
    solving: &Solving,
    common: &Common,
    representation: Representation,
    talk: &Talk,
) -> Bake {
    let settings = Settings {
        error: solving.error,
        representation,
        seed: common.seed,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    bake.spread_over(common.team);
    let parts = talk.parts();
    bake.watch(Arc::new(move |ended| {
        let place = PHASES.iter().position(|phase| *phase == ended);
        let next = place.and_then(|k| PHASES.get(k + 1)).unwrap_or(&"");
        parts.begins("round", next);
    }));
    bake
}

/// Where the cache goes, if one is kept.
fn cache(args: &BakeArgs) -> Option<PathBuf> {
    let named = args.cache.clone()?;
    Some(named.unwrap_or_else(|| paths::cache_of(&args.room)))
}

/// What is wrong with the output files.
fn problems(
    args: &BakeArgs,
    output: &Path,
    cache: Option<&Path>,
    parts: &[PathBuf],
    team: Team,
) -> Vec<Problem> {
    let mut outputs = vec![("-o", output)];
    outputs.extend(args.npz.as_deref().map(|path| ("--npz", path)));
    outputs.extend(args.log.as_deref().map(|path| ("--log", path)));
    outputs.extend(
        args.checkpoint
            .as_deref()
            .map(|path| ("--checkpoint", path)),
    );
    outputs.extend(cache.map(|path| ("--cache", path)));
    let report = args.report();
    outputs.extend(report.as_deref().map(|path| ("--report", path)));
    let mut inputs = vec![args.room.as_path()];
    let beside = args.room.with_extension("spectra.json");
    inputs.push(args.reading.spectra.as_deref().unwrap_or(&beside));
    inputs.extend(parts.iter().map(PathBuf::as_path));
    let mut problems = paths::problems(&outputs, &inputs);
    problems.extend(paths::not_glb(output, "baked"));
    let of_vertices = [
        ("--vertices", args.vertices.is_some()),
        ("--megabytes", args.megabytes.is_some()),
        ("--xyz", args.storing.xyz),
        ("--compress", args.storing.compress != Packing::Floats),
        ("--npz", args.npz.is_some()),
        ("--cache", args.cache.is_some()),
        ("--report", args.report.is_some()),
        ("--snapshots", args.snapshots.is_some()),
    ];
    if args.cache.is_some() && !team.is_alone() {
        problems.push(Problem::new(
            "--cache",
            "is made by one rank: it holds where all light comes from",
            "leave it out, or bake without mpirun",
        ));
    }
    problems.extend(args.mapping.problems(&of_vertices));
    problems.extend(args.parting.problems(args.spectrum, args.cache.is_some()));
    if let Some(folder) = args
        .snapshots
        .as_deref()
        .filter(|f| f.exists() && !f.is_dir())
    {
        problems.push(Problem::new(
            format!("--snapshots {}", folder.display()),
            "is a file",
            "name a folder",
        ));
    }
    problems
}

fn write(log: &mut Option<Log<File>>, record: &impl serde::Serialize) -> Result<()> {
    log.as_mut().map_or(Ok(()), |log| log.write(record))
}

pub(super) fn write_npz(path: &Path, room: &Path, bake: &Bake, baked: &Baked) -> Result<()> {
    let spectra = bake.radiosity_spectra(baked);
    // The writer's own error says more than what the system makes of it.
    let mut problem = None;
    let written = file::write_atomic(path, Some(room), |w| {
        npz::write_baked(w, bake.scene(), &baked.surfaces, &spectra).map_err(|e| {
            let text = e.to_string();
            problem = Some(e);
            std::io::Error::other(text)
        })
    });
    match problem {
        Some(Error::Internal(what)) => Err(Error::Internal(what)),
        _ => written,
    }
}
