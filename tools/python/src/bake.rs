//! A bake from its first round to its mesh: news of every round, and an end before the error is reached.

use crate::data::Data;
use crate::light::Solved;
use crate::records::flat;
use crate::work::{Listener, Tell, answer, told};
use haarlight::Error;
use haarlight::cli::stop::Stop;
use haarlight::cli::talk::Talk;
use haarlight::mesh::Limits;
use haarlight::solve::{Bake, Round, Settings, Verdict};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, Weak};

/// What is said at the first Ctrl-C.
const ENDING: &str = "ending with what is solved; Ctrl-C again ends at once\n";

/// What is asked for.
pub(crate) struct Wanted {
    pub(crate) settings: Settings,
    pub(crate) time: Option<f64>,
    pub(crate) mesh: bool,
    pub(crate) keep: bool,
    pub(crate) vertices: Option<usize>,
}

/// The calling thread of a bake.
struct Caller {
    on_round: Option<Py<PyAny>>,
    stop_when: Option<Py<PyAny>>,
    stop: Stop,
    signalled: bool,
    /// Tells the bake to go on after a round.
    answers: Sender<()>,
    /// While this is there somebody waits for the result.
    _waits: Arc<()>,
}

impl Listener<Box<Round>> for Caller {
    fn hear(&mut self, py: Python<'_>, round: Box<Round>) -> PyResult<()> {
        if let Some(on_round) = &self.on_round {
            let said = flat(py, &*round).and_then(|record| on_round.call1(py, (record,)));
            match said {
                Ok(said) if said.extract::<bool>(py).is_ok_and(|go_on| !go_on) => {
                    self.stop.interrupt();
                }
                Ok(_) => {}
                Err(raised) => self.signal(py, raised)?,
            }
        }
        // A bake that has ended needs no answer.
        let _ = self.answers.send(());
        Ok(())
    }

    fn signal(&mut self, py: Python<'_>, raised: PyErr) -> PyResult<()> {
        if self.signalled || !raised.is_instance_of::<PyKeyboardInterrupt>(py) {
            return Err(raised);
        }
        self.signalled = true;
        self.stop.interrupt();
        let stderr = py.import("sys")?.getattr("stderr")?;
        if !stderr.is_none() {
            stderr.call_method1("write", (ENDING,))?;
        }
        Ok(())
    }

    fn idle(&mut self, py: Python<'_>) -> PyResult<()> {
        if let Some(event) = &self.stop_when
            && event.call_method0(py, "is_set")?.is_truthy(py)?
        {
            self.stop.interrupt();
        }
        Ok(())
    }
}

/// Bakes.
pub(crate) fn bake(
    py: Python<'_>,
    data: Arc<Data>,
    wanted: Wanted,
    on_round: Option<Py<PyAny>>,
    stop_when: Option<Py<PyAny>>,
) -> PyResult<Solved> {
    let stop = Stop::new(wanted.time);
    let (answers, hears) = channel();
    let waits = Arc::new(());
    let asked = Arc::downgrade(&waits);
    let mut caller = Caller {
        on_round,
        stop_when,
        stop: stop.clone(),
        signalled: false,
        answers,
        _waits: waits,
    };
    let work =
        move |tell: &Tell<Solved, Box<Round>>| solved(data, &wanted, &stop, tell, &hears, &asked);
    told(py, work, &mut caller)
}

fn solved(
    data: Arc<Data>,
    wanted: &Wanted,
    stop: &Stop,
    tell: &Tell<Solved, Box<Round>>,
    answers: &Receiver<()>,
    asked: &Weak<()>,
) -> haarlight::Result<Solved> {
    let forsaken = || asked.strong_count() == 0;
    let mut bake = Bake::new(data.scene.clone(), wanted.settings.clone());
    if wanted.keep {
        bake.keep();
    }
    let verdict = stop.run(
        &mut bake,
        &Talk::new(true),
        |_, round| round.remaining_s,
        |_, round, _| {
            tell.tell(Box::new(round.clone()));
            answer(answers, ());
            match forsaken() {
                true => Err(Error::Internal("nobody waits for the bake".into())),
                false => Ok(()),
            }
        },
    )?;
    let late = || stop.is_late(0.0) || forsaken();
    let limits = Limits {
        vertices: wanted.vertices,
        late: &late,
    };
    let baked = (wanted.mesh).then(|| bake.baked_within(&limits, &|_, _| {}));
    // An error is reached when the mesh's is.
    let met = (baked.as_ref().and_then(|baked| bake.error_of(baked)))
        .is_none_or(|error| error <= bake.settings().error);
    let verdict = match verdict {
        Verdict::Reached if !met => stop
            .reason()
            .filter(|_| late())
            .unwrap_or(Verdict::Exhausted),
        verdict => verdict,
    };
    Ok(Solved {
        data,
        bake,
        baked,
        verdict,
        cache: Mutex::new(None),
    })
}
