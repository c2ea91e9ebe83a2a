//! The thread that solves, relights and saves: commands in, pictures on the board.
//!
//! Rounds go on until the error asked for, then the light is looked up at the vertices of the file. Where lamps or paints
//! change, rounds end and the present state is relit through its rows: the patches at first, the vertices once they are
//! there. To go on after a change is to solve the changed room anew. So is a lamp that was dark when the room was solved.

use super::board::{Board, Doing, RelitLine, RoundLine, State};
use super::changes::newly_emitting;
use super::options::ServeOptions;
use super::patches::Patches;
use super::picture::{LitMesh, PictureMesh};
use super::scratch::ScratchFolder;
use super::spectra::{ColourError as PointError, VertexSpectra};
use crate::data::{TableKind, named, names};
use crate::error::Result;
use crate::gather::Baked;
use crate::keep::{Relighter, Relit};
use crate::light::lanes::Lanes;
use crate::mesh::Limits;
use crate::output::gltf;
use crate::output::{Exposure, baked_glb, camera};
use crate::report::page;
use crate::scene::{Camera, LightKind, Scene};
use crate::solve::{Bake, Verdict};
use crate::store::file;
use serde_json::{Value, json};
use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvError, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The board hears of progress this often at the most.
const PROGRESS: Duration = Duration::from_millis(100);
/// What is kept for relighting may take this much, bytes: as `bake --cache` by default.
const KEPT: u64 = 2048 << 20;

/// What is asked of the session.
pub(super) enum SessionCommand {
    /// No further round; a gather ends soon.
    Stop,
    /// On with the rounds; the changed room is solved anew.
    Go,
    /// Write the file.
    Save,
    /// Other lamps and paints, and when they were asked for.
    Change(Box<Scene>, Value, Instant),
    /// Expose the picture for its present light.
    Expose,
}

/// What the session and the requests share.
pub(super) struct Shared {
    pub(super) board: Board,
    /// Is a gather to end soon?
    pub(super) stop: AtomicBool,
    /// Held while the file is written: nobody ends the program meanwhile.
    pub(super) writing: Mutex<()>,
    /// Reads the room with changes, once it is known.
    pub(super) reader: std::sync::OnceLock<super::changes::RoomReader>,
}

/// How far the room is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SessionStage {
    Solving,
    Stopped,
    Done,
}

/// A bake that is watched.
pub(super) struct Session<'a> {
    wishes: &'a ServeOptions,
    shared: &'a Shared,
    scratch: &'a ScratchFolder,
    bake: Bake,
    patches: Patches,
    cameras: Vec<Camera>,
    stage: SessionStage,
    /// Waiting commands.
    queue: VecDeque<SessionCommand>,
    /// The light at the vertices of the file and their mesh, of the last round that was gathered.
    fine: Option<Fine>,
    /// The light of the last two rounds.
    history: page::History,
    /// The present state with its rows, once it was asked for; with the vertices, if `fine` is there.
    kept: Option<Relighter>,
    /// Lamps and paints that differ from those of the bake.
    changed: Option<Scene>,
    /// Mean colour difference of the light of the changed room, an estimate.
    relit: Option<f64>,
    /// Where only a first answer was given to a change: when it was asked for, and seconds until then.
    rough: Option<(Instant, f64)>,
    exposure: Exposure,
    /// Numbers of meshes and pictures so far.
    meshes: u32,
    lights: u32,
}

/// The light at the vertices of the file.
struct Fine {
    /// Its irradiance rows are in `spectra`.
    baked: Baked,
    shape: Arc<PictureMesh>,
    spectra: Arc<VertexSpectra>,
    /// Where the error of the light is, see [`PointError`].
    share: Option<Arc<[Vec<f32>]>>,
}

impl Fine {
    /// Takes up light whose error is `mean`.
    fn light(&mut self, scene: &Scene, lanes: &Lanes, mut baked: Baked, mean: Option<f64>) {
        self.spectra = Arc::new(own_spectra(
            scene,
            lanes,
            &mut baked,
            mean,
            self.share.clone(),
        ));
        self.baked = baked;
    }
}

/// The rows of a baked mesh, in the order of the file, which it does not keep.
fn own_spectra(
    scene: &Scene,
    lanes: &Lanes,
    baked: &mut Baked,
    mean: Option<f64>,
    share: Option<Arc<[Vec<f32>]>>,
) -> VertexSpectra {
    let mut rows = std::mem::take(&mut baked.irradiance);
    let order = gltf::order(scene, &baked.surfaces).into_iter();
    let parts = order.map(|k| rows.get_mut(k).map(std::mem::take).unwrap_or_default());
    let error = mean.map(|mean| PointError {
        mean,
        share: share.unwrap_or_else(|| [].into()),
    });
    VertexSpectra::own(lanes, parts.collect(), error)
}

impl<'a> Session<'a> {
    /// Prepares a room.
    pub(super) fn new(
        scene: Scene,
        wishes: &'a ServeOptions,
        shared: &'a Shared,
        scratch: &'a ScratchFolder,
    ) -> Result<Self> {
        let warnings = scene.warnings.clone();
        let bake = begun(scene, wishes);
        let cameras = camera::cameras(bake.scene());
        shared.board.set_room(&about(&bake, &cameras));
        let patches = Patches::new(&bake, 1)?;
        shared.board.set(|state| state.warnings = warnings);
        Ok(Self {
            wishes,
            shared,
            scratch,
            bake,
            patches,
            cameras,
            stage: SessionStage::Solving,
            queue: VecDeque::new(),
            fine: None,
            history: page::History::default(),
            kept: None,
            changed: None,
            relit: None,
            rough: None,
            exposure: Exposure::new(1.0),
            meshes: 1,
            lights: 0,
        })
    }

    /// Works until nobody can ask for anything any more.
    ///
    /// # Errors
    /// Faults of our own. What a command meets is put on the board.
    pub(super) fn run(&mut self, commands: &Receiver<SessionCommand>) -> Result<()> {
        self.rest();
        loop {
            if self.listen(commands).is_err() {
                return Ok(());
            }
            match self.queue.pop_front() {
                Some(command) => {
                    self.note(None);
                    if let Err(problem) = self.obey(command) {
                        self.note(Some(problem.to_string()));
                    }
                }
                None if self.rough.is_some() => {
                    if let Err(problem) = self.refine() {
                        self.note(Some(problem.to_string()));
                    }
                }
                None if self.bake.verdict().is_some() => self.finish()?,
                None => self.round(),
            }
            self.rest();
        }
    }

    /// Takes up commands, and waits for one where there is nothing else to do. Of changes the last counts.
    fn listen(
        &mut self,
        commands: &Receiver<SessionCommand>,
    ) -> std::result::Result<(), RecvError> {
        let idle = self.stage != SessionStage::Solving && self.rough.is_none();
        if idle && self.queue.is_empty() {
            self.queue.push_back(commands.recv()?);
        }
        loop {
            match commands.try_recv() {
                Ok(command) => {
                    if matches!(command, SessionCommand::Change(..)) {
                        self.queue
                            .retain(|c| !matches!(c, SessionCommand::Change(..)));
                    }
                    self.queue.push_back(command);
                }
                Err(TryRecvError::Empty) => return Ok(()),
                Err(TryRecvError::Disconnected) => return Err(RecvError),
            }
        }
    }

    fn obey(&mut self, command: SessionCommand) -> Result<()> {
        match command {
            SessionCommand::Stop => {
                self.shared.stop.store(false, Ordering::SeqCst);
                if self.stage == SessionStage::Solving {
                    self.stage = SessionStage::Stopped;
                }
            }
            SessionCommand::Go => match self.changed.take() {
                Some(scene) => self.restart(scene)?,
                None if self.stage == SessionStage::Stopped => self.stage = SessionStage::Solving,
                None => {}
            },
            SessionCommand::Save => self.save()?,
            SessionCommand::Change(scene, changes, asked) => self.change(*scene, changes, asked)?,
            SessionCommand::Expose => self.expose(),
        }
        Ok(())
    }

    fn board(&self) -> &'a Board {
        &self.shared.board
    }

    fn note(&self, note: Option<String>) {
        self.board().set(|state| state.note = note);
    }

    fn doing(&self, doing: Doing) {
        self.board().set(|state| {
            state.doing = doing;
            state.progress = None;
        });
    }

    /// Says how far the room is, between two pieces of work.
    fn rest(&self) {
        self.doing(match self.stage {
            _ if self.rough.is_some() => Doing::Relighting,
            SessionStage::Solving => Doing::Solving,
            SessionStage::Stopped => Doing::Stopped,
            SessionStage::Done => Doing::Done,
        });
    }

    /// Mean colour difference of the last round, an estimate.
    fn estimate(&self) -> Option<f64> {
        self.bake.rounds().last()?.error.total_de2000.value
    }

    /// One round, and its picture.
    fn round(&mut self) {
        self.bake.step();
        self.kept = None;
        self.fine = None;
        self.history.note(&self.bake);
        self.history.keep_last(2);
        self.patches.grow(&self.bake);
        let (lit, spectra) = self.patches.lit(&self.bake);
        let spectra = Arc::new(spectra.with_mean(self.estimate()));
        self.exposure = self.metered(self.bake.scene(), &lit);
        let shape = Arc::new(self.patches.shape());
        self.lights += 1;
        let scene = self.bake.scene();
        let picture = LitMesh::new(shape, self.lights, scene, (&lit, spectra), &self.exposure);
        let rounds = self.bake.rounds().iter().map(|r| RoundLine {
            round: r.round,
            de2000: r.error.total_de2000.value,
            patches: r.elements,
            elapsed_s: r.elapsed_s,
        });
        let rounds: Vec<RoundLine> = rounds.collect();
        self.board().show(picture, |state| {
            state.rounds = rounds;
            state.fine = false;
            state.relit = None;
            state.file_de2000 = None;
        });
    }

    /// Looks up the light at the vertices of the file, and keeps its rows.
    fn gather(&mut self) -> Result<()> {
        self.doing(Doing::Gathering);
        let limits = Limits {
            vertices: None,
            late: &|| self.shared.stop.load(Ordering::SeqCst),
        };
        let told = Cell::new(Instant::now());
        let mut baked = self.bake.baked_within(&limits, &|done, of| {
            if told.get().elapsed() > PROGRESS {
                told.set(Instant::now());
                self.board().set(|state| state.progress = Some((done, of)));
            }
        });
        let scene = self.bake.scene();
        self.exposure = self.metered(scene, &baked.surfaces);
        // The viewer opens no packed file.
        let writing = gltf::Writing::default();
        let glb = baked_glb(scene, &baked.surfaces, &self.exposure, writing)?;
        let order = gltf::order(scene, &baked.surfaces);
        let counts = order.iter().map(|&k| baked.surfaces[k].vertices.len());
        self.meshes += 1;
        let shape = Arc::new(PictureMesh::fixed(self.meshes, glb.bytes, counts));
        self.lights += 1;
        let map = page::error_map(&self.bake, &baked, &self.history, &order);
        let share = map.map(|(map, mean)| {
            let mut rest = map.iter().map(|e| (e / mean.max(f64::MIN_POSITIVE)) as f32);
            let parts = order.iter().map(|&k| baked.surfaces[k].vertices.len());
            parts.map(|n| rest.by_ref().take(n).collect()).collect()
        });
        let (lanes, mean) = (self.bake.lanes(), self.estimate());
        let spectra = own_spectra(scene, lanes, &mut baked, mean, Option::clone(&share));
        let spectra = Arc::new(spectra);
        let picture = LitMesh::new(
            Arc::clone(&shape),
            self.lights,
            scene,
            (&baked.surfaces, Arc::clone(&spectra)),
            &self.exposure,
        );
        let error = self.bake.error_of(&baked);
        self.board().show(picture, |state| {
            state.fine = true;
            state.file_de2000 = error;
            state.relit = None;
        });
        self.kept = None;
        let kept = self.keep(&baked);
        self.fine = Some(Fine {
            baked,
            shape,
            spectra,
            share,
        });
        if let Err(problem) = kept {
            self.note(Some(format!("lamps cannot be changed: {problem}")));
        }
        Ok(())
    }

    /// The last round was done.
    fn finish(&mut self) -> Result<()> {
        self.gather()?;
        self.stage = SessionStage::Done;
        let reached = self.bake.verdict() == Some(Verdict::Reached);
        let asked = self.bake.settings().error;
        self.board().set(|state| {
            state.reached = reached && state.file_de2000.is_none_or(|e| e <= asked);
        });
        Ok(())
    }

    /// Keeps the rows of the present state, with those of the vertices of `baked`.
    fn keep(&mut self, baked: &Baked) -> Result<()> {
        let bake = &self.bake;
        let kept = self.scratch.with(|path| {
            bake.write_cache(baked, path, KEPT)?;
            Relighter::open(path, bake.scene().clone())
        });
        let kept = kept?;
        kept.prepare();
        self.kept = Some(kept);
        Ok(())
    }

    /// Other lamps and paints.
    fn change(&mut self, scene: Scene, changes: Value, asked: Instant) -> Result<()> {
        if self.stage == SessionStage::Solving {
            self.stage = SessionStage::Stopped;
        }
        // Together, so that nobody takes the old light for the changed one's.
        self.board().set(|state| {
            state.changes = changes;
            state.doing = Doing::Relighting;
            state.progress = None;
        });
        if self.bake.rounds().is_empty() {
            return self.restart(scene);
        }
        if let Some(lamp) = newly_emitting(self.bake.scene(), &scene) {
            self.restart(scene)?;
            self.note(Some(format!(
                "{lamp} was dark when the room was solved, so that its shadows are not known: the room is solved anew"
            )));
            return Ok(());
        }
        if self.kept.is_none() {
            self.fine = None;
            self.keep(&Baked::default())?;
        }
        self.changed = Some(scene);
        self.relight(asked)
    }

    /// A first answer for the changed room, through the rows that are kept.
    fn relight(&mut self, asked: Instant) -> Result<()> {
        let (Some(scene), Some(kept)) = (&self.changed, &mut self.kept) else {
            return Ok(());
        };
        kept.change(scene.clone())?;
        let relit = kept.relight_roughly()?;
        let first_s = self.show_relit(relit, asked, None);
        self.rough = Some((asked, first_s));
        Ok(())
    }

    /// The whole answer after the first.
    fn refine(&mut self) -> Result<()> {
        if let (Some((asked, first_s)), Some(kept)) = (self.rough.take(), &mut self.kept) {
            let relit = kept.relight()?;
            self.show_relit(relit, asked, Some(first_s));
        }
        Ok(())
    }

    /// Shows relit light; seconds since it was asked for. `first_s`: those of the first answer, if it was shown.
    fn show_relit(&mut self, relit: Relit, asked: Instant, first_s: Option<f64>) -> f64 {
        let r = &relit.record;
        let de2000 = r.error_de2000.value;
        self.relit = de2000;
        let parts_s = [r.lanes_s, r.direct_s, r.solve_s, r.gather_s];
        if let (Some(fine), Some(kept)) = (&mut self.fine, &self.kept) {
            fine.light(kept.scene(), kept.lanes(), relit.baked, de2000);
        }
        self.paint(de2000);
        let seconds = asked.elapsed().as_secs_f64();
        let fine = self.fine.is_some();
        self.board().set(|state| {
            state.fine = fine;
            state.relit = Some(RelitLine {
                first_s: first_s.unwrap_or(seconds),
                whole_s: first_s.map(|_| seconds),
                parts_s,
                de2000,
            });
        });
        seconds
    }

    /// Shows the present light of the changed room; `error`: mean colour difference, an estimate.
    fn paint(&mut self, error: Option<f64>) {
        let scene = self.changed.as_ref().unwrap_or(self.bake.scene());
        let of_patches;
        let (shape, lit, spectra) = match (&self.fine, &self.kept) {
            (Some(fine), _) => (
                Arc::clone(&fine.shape),
                &fine.baked.surfaces,
                Arc::clone(&fine.spectra),
            ),
            (None, kept) => {
                let relit = kept.as_ref().filter(|_| self.changed.is_some());
                let (lit, spectra) = self.patches.lit(relit.map_or(&self.bake, Relighter::bake));
                of_patches = lit;
                let spectra = Arc::new(spectra.with_mean(error));
                (Arc::new(self.patches.shape()), &of_patches, spectra)
            }
        };
        self.lights += 1;
        let picture = LitMesh::new(shape, self.lights, scene, (lit, spectra), &self.exposure);
        self.board().show(picture, |_| {});
    }

    /// Solves a room from the beginning.
    fn restart(&mut self, scene: Scene) -> Result<()> {
        self.doing(Doing::Preparing);
        (self.kept, self.fine, self.changed, self.rough) = (None, None, None, None);
        (self.history, self.relit) = (page::History::default(), None);
        self.bake = begun(scene, self.wishes);
        self.meshes += 1;
        self.patches = Patches::new(&self.bake, self.meshes)?;
        self.stage = SessionStage::Solving;
        self.board().set(|state| {
            state.rounds.clear();
            state.reached = false;
        });
        Ok(())
    }

    /// Writes what there is, as `bake` and `relight` do.
    fn save(&mut self) -> Result<()> {
        if self.bake.rounds().is_empty() {
            self.round();
        }
        if self.fine.is_none() {
            self.gather()?;
            self.relight(Instant::now())?;
        }
        self.refine()?;
        self.doing(Doing::Saving);
        let Some(Fine { baked, .. }) = &self.fine else {
            return Ok(());
        };
        let scene = self.changed.as_ref().unwrap_or(self.bake.scene());
        let look = self.metered(scene, &baked.surfaces);
        let glb = baked_glb(scene, &baked.surfaces, &look, self.wishes.writing)?;
        let (output, room) = (&self.wishes.output, Some(scene.source.path.as_path()));
        {
            let _held = self
                .shared
                .writing
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            file::write_atomic(output, room, |w| w.write_all(&glb.bytes))?;
        }
        let name = output.display().to_string();
        self.board().set(|state: &mut State| {
            let times = state.saved.as_ref().map_or(0, |(_, times)| *times);
            state.saved = Some((name, times + 1));
        });
        Ok(())
    }

    /// Exposes the picture for the light that it has.
    fn expose(&mut self) {
        if self.bake.rounds().is_empty() {
            return;
        }
        let scene = self.changed.as_ref().unwrap_or(self.bake.scene());
        self.exposure = match (&self.fine, &self.kept) {
            (Some(fine), _) => self.metered(scene, &fine.baked.surfaces),
            (None, Some(kept)) if self.changed.is_some() => {
                self.metered(scene, &self.patches.lit(kept.bake()).0)
            }
            _ => self.metered(scene, &self.patches.lit(&self.bake).0),
        };
        self.paint(self.relit.or_else(|| self.estimate()));
    }

    fn metered(&self, scene: &Scene, lit: &[crate::gather::BakedSurface]) -> Exposure {
        let ServeOptions {
            brightness,
            balance,
            ..
        } = self.wishes;
        Exposure::metered(scene, lit, &self.cameras, *brightness, *balance)
    }
}

/// A bake that keeps its rows.
fn begun(scene: Scene, wishes: &ServeOptions) -> Bake {
    let mut bake = Bake::new(scene, wishes.settings.clone());
    bake.keep();
    bake
}

/// What the page is told of a room.
fn about(bake: &Bake, cameras: &[Camera]) -> Value {
    let scene = bake.scene();
    let name = scene
        .source
        .path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    let of = |kind: TableKind| -> Vec<String> {
        let is = |name: &String| named(name).is_some_and(|n| n.kind == kind);
        names().into_iter().filter(is).collect()
    };
    let alone = scene.lights.iter().filter(|l| l.kind != LightKind::Surface);
    let alone = alone.count();
    json!({
        "name": name,
        "program": crate::PROGRAM,
        // The first lamps are materials, the last so many lights.
        "lone_lights": alone,
        "room": page::room(bake, cameras),
        "lights": of(TableKind::Illuminant),
        "paints": of(TableKind::Reflectance),
    })
}
