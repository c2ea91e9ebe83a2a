//! `haarlight bake ROOM`: the room back with its light baked in, pictures and a log on the way.
//!
//! Rounds until the error asked for, `--time` or Ctrl-C; what there is then is written out whole. The exposure of the
//! baked room is metered from its own light, through its cameras, whether or not pictures were taken: the same room gives
//! the same bytes.

pub use super::bake_args::BakeArgs;
use super::baking::{Order, Recorders};
use super::options::Common;
use super::paths;
use super::rooms::load_unless;
use super::stop::{KILLED, Stop};
use super::talk::{Talk, tell};
use crate::error::{Problem, Result};
use crate::output::camera;
use crate::output::gltf::Packing;
use crate::team::Team;
use std::path::{Path, PathBuf};

/// Bakes; the exit code.
///
/// # Errors
/// As [`Scene::load`](crate::scene::Scene::load); outputs that would overwrite an input or each other; files that cannot be written.
pub fn run(args: &BakeArgs, common: &Common) -> Result<u8> {
    let team = common.team;
    let told = args.json || args.log.is_some() || args.report.is_some();
    let args = &args.of_rank(team);
    let mut stop = Stop::new(args.solving.time).of_all(team);
    // A checkpoint is there to go on from: without a round it would have nothing.
    if args.checkpoint.is_none() {
        stop = stop.at_any_time();
    }
    stop.listen()?;
    let talk = Talk::new(common.quiet || !team.is_first());
    let output = args
        .output
        .clone()
        .unwrap_or_else(|| args.room.with_extension("baked.glb"));
    let cache = cache(args);
    talk.phase("reading");
    let mut scene = load_unless(&args.room, &args.reading, &stop.survey(), |parts| {
        problems(args, &output, cache.as_deref(), parts, team)
    })?;
    args.parting.part(&mut scene, &talk)?;
    let grid = args.parting.grid(&scene)?;
    scene.warnings.iter().for_each(|w| talk.warn(w));
    let load_s = stop.elapsed_s();

    talk.phase("preparing");
    let cameras = camera::cameras(&scene);
    let order = Order {
        args,
        common,
        stop: &stop,
        talk: &talk,
        output: &output,
        cache: cache.as_deref(),
        cameras: &cameras,
        grid: grid.as_ref(),
        told,
    };
    let Some(mut bake) = order.prepare(scene) else {
        talk.clear();
        tell(
            "haarlight: interrupted before it was known where the light of lamps goes; nothing was written",
        );
        return Ok(KILLED);
    };
    let mut kept = Recorders::new(order, load_s)?;
    order.begin(&mut bake, &mut kept)?;
    let verdict = order.rounds(&mut bake, &mut kept)?;
    let lit = order.gather(&bake, verdict, &mut kept)?;
    let written = order.write(&bake, &lit, &mut kept)?;
    let audit = order.audit(&bake, &lit, &mut kept)?;
    order.end(&bake, &lit, written, audit.as_ref(), kept)
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
    problems.extend(args.parting.problem(args.spectrum));
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
