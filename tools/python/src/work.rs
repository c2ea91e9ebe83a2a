//! Work on a thread of its own, without the interpreter's lock, while the calling thread listens for news and signals.
//!
//! The calling thread returns as soon as a signal is not wanted any more (a second Ctrl-C); the work then ends by itself
//! and what it made is dropped. The work never asks for the interpreter: it can neither wait for it nor outlive it badly.

use crate::errors;
use haarlight::{Error, Result};
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::Builder;
use std::time::Duration;

/// How often signals are looked for: a tenth of a second feels immediate.
const LISTENS: Duration = Duration::from_millis(50);
/// Stack of the thread, bytes: that of a main thread, which the command has.
const STACK: usize = 8 << 20;

/// What work says while it is done, and at its end.
enum Event<T, N> {
    News(N),
    Done(Result<T>),
}

/// Tells the calling thread.
pub(crate) struct Tell<T, N>(Sender<Event<T, N>>);

impl<T, N> Tell<T, N> {
    /// Tells news; false when nobody listens any more.
    pub(crate) fn tell(&self, news: N) -> bool {
        self.0.send(Event::News(news)).is_ok()
    }
}

/// What the calling thread does meanwhile.
pub(crate) trait Listener<N> {
    /// There is news. An error ends the call.
    fn hear(&mut self, py: Python<'_>, news: N) -> PyResult<()>;
    /// A signal raised an exception. It ends the call unless it is taken up here.
    fn signal(&mut self, _: Python<'_>, raised: PyErr) -> PyResult<()> {
        Err(raised)
    }
    /// Neither, for a while. An error ends the call.
    fn idle(&mut self, _: Python<'_>) -> PyResult<()> {
        Ok(())
    }
}

/// Work without news, which any signal ends.
struct Silent;

impl Listener<()> for Silent {
    fn hear(&mut self, _: Python<'_>, (): ()) -> PyResult<()> {
        Ok(())
    }
}

/// Does work and waits for it.
pub(crate) fn done<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    told(py, |_: &Tell<T, ()>| work(), &mut Silent)
}

/// Does work that tells news, and waits for it.
pub(crate) fn told<T: Send + 'static, N: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Tell<T, N>) -> Result<T> + Send + 'static,
    listener: &mut impl Listener<N>,
) -> PyResult<T> {
    let (sender, mut events) = channel();
    let thread = Builder::new()
        .name("haarlight".into())
        .stack_size(STACK)
        .spawn(move || {
            let tell = Tell(sender);
            // What the work held is gone with it: nothing broken can be seen afterwards.
            let done = catch_unwind(AssertUnwindSafe(|| work(&tell)));
            let done = done.unwrap_or_else(|panic| Err(Error::Internal(said(&*panic))));
            // Where nobody listens any more the result is dropped.
            let _ = tell.0.send(Event::Done(done));
        });
    if let Err(problem) = thread {
        let fault = Error::Internal(format!("no thread to work on: {problem}"));
        return Err(errors::raised(py, &fault));
    }
    loop {
        let (back, event) = py.detach(move || {
            let event = events.recv_timeout(LISTENS);
            (events, event)
        });
        events = back;
        match event {
            Ok(Event::News(news)) => listener.hear(py, news)?,
            Ok(Event::Done(done)) => return done.map_err(|error| errors::raised(py, &error)),
            Err(RecvTimeoutError::Timeout) => listener.idle(py)?,
            Err(RecvTimeoutError::Disconnected) => {
                let fault = Error::Internal("work ended without a word".into());
                return Err(errors::raised(py, &fault));
            }
        }
        if let Err(raised) = py.check_signals() {
            listener.signal(py, raised)?;
        }
    }
}

/// What a panic said.
fn said(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "panic".into())
}

/// Waits for an answer of the listener; `otherwise` when nobody listens any more.
pub(crate) fn answer<T>(answers: &Receiver<T>, otherwise: T) -> T {
    answers.recv().unwrap_or(otherwise)
}

/// Panics at work: how the tests see that a fault of the program becomes an exception.
#[pyfunction]
pub(crate) fn _panic(py: Python<'_>, text: String) -> PyResult<()> {
    done(py, move || panic!("{text}"))
}
