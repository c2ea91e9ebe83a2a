//! What is to be seen at present, and who waits for news of it.
//!
//! There is one state, which is replaced as a whole; a waiter is told that there is a newer one than it knows. So nothing piles
//! up for those who are slow.

use super::picture::LitMesh;
use serde::Serialize;
use serde_json::Value;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What the session is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Doing {
    /// Reading and preparing the room.
    Preparing,
    /// Rounds.
    Solving,
    /// Rounds were stopped.
    Stopped,
    /// Looking up the light at the vertices of the file.
    Gathering,
    /// Working out the light of changed lamps and paints.
    Relighting,
    /// Writing the file.
    Saving,
    /// All is done that was asked for.
    Done,
}

/// A round.
#[derive(Debug, Clone, Serialize)]
pub(super) struct RoundLine {
    pub(super) round: usize,
    /// Estimate, mean CIEDE2000.
    pub(super) de2000: Option<f64>,
    pub(super) patches: usize,
    pub(super) elapsed_s: f64,
}

/// Light after a change.
#[derive(Debug, Clone, Serialize)]
pub(super) struct RelitLine {
    /// From the request to a first answer, seconds.
    pub(super) first_s: f64,
    /// And to the whole one, once it is there.
    pub(super) whole_s: Option<f64>,
    /// Of the last of the two: choice of wavelength intervals, direct light, solve, light of the vertices.
    pub(super) parts_s: [f64; 4],
    /// Estimate, mean CIEDE2000.
    pub(super) de2000: Option<f64>,
}

/// The state: what an event says.
#[derive(Debug, Clone, Serialize)]
pub(super) struct State {
    /// Counts on with every change of it.
    pub(super) number: u64,
    pub(super) doing: Doing,
    /// What of it: (done, all), for what is counted.
    pub(super) progress: Option<(usize, usize)>,
    /// Numbers of the picture: mesh, shape of it, light on it.
    pub(super) picture: Option<[u64; 3]>,
    /// Is the picture that of the file (looked up at its vertices) or of the patches?
    pub(super) fine: bool,
    /// Mean CIEDE2000 that was asked for.
    pub(super) asked_de2000: f64,
    pub(super) rounds: Vec<RoundLine>,
    /// Estimate for the file, mean CIEDE2000.
    pub(super) file_de2000: Option<f64>,
    /// The present light, if lamps or paints were changed since the room was solved.
    pub(super) relit: Option<RelitLine>,
    /// What was changed since the room was read.
    pub(super) changes: Value,
    /// Whether rounds were ended by the error that was asked for.
    pub(super) reached: bool,
    /// The file that was written last, and how often one was.
    pub(super) saved: Option<(String, usize)>,
    /// What the user should know: what the last command came to, if it came to nothing.
    pub(super) note: Option<String>,
    /// Warnings about the room.
    pub(super) warnings: Vec<String>,
}

#[derive(Debug)]
struct BoardContents {
    state: State,
    picture: Option<Arc<LitMesh>>,
    /// What the page is told of the room.
    room: Option<Arc<str>>,
    over: bool,
}

/// The board.
#[derive(Debug)]
pub(super) struct Board {
    held: Mutex<BoardContents>,
    news: Condvar,
}

impl Board {
    pub(super) fn new(asked_de2000: f64) -> Self {
        Self {
            held: Mutex::new(BoardContents {
                state: State {
                    number: 1,
                    doing: Doing::Preparing,
                    progress: None,
                    picture: None,
                    fine: false,
                    asked_de2000,
                    rounds: Vec::new(),
                    file_de2000: None,
                    relit: None,
                    changes: Value::Object(serde_json::Map::new()),
                    reached: false,
                    saved: None,
                    note: None,
                    warnings: Vec::new(),
                },
                picture: None,
                room: None,
                over: false,
            }),
            news: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, BoardContents> {
        // Nobody panics while holding it; and what is there is whole.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, mut held: MutexGuard<BoardContents>) {
        held.state.number += 1;
        self.news.notify_all();
    }

    /// Changes the state.
    pub(super) fn set(&self, change: impl FnOnce(&mut State)) {
        let mut held = self.lock();
        change(&mut held.state);
        self.tell(held);
    }

    /// Shows a picture, and changes the state with it.
    pub(super) fn show(&self, picture: LitMesh, change: impl FnOnce(&mut State)) {
        let mut held = self.lock();
        held.state.picture = Some(picture.numbers());
        held.picture = Some(Arc::new(picture));
        change(&mut held.state);
        self.tell(held);
    }

    /// What the page is told of the room.
    pub(super) fn set_room(&self, room: &Value) {
        self.lock().room = Some(room.to_string().into());
    }

    /// The room, once it is known.
    pub(super) fn room(&self) -> Option<Arc<str>> {
        self.lock().room.clone()
    }

    /// The picture, once there is one.
    pub(super) fn picture(&self) -> Option<Arc<LitMesh>> {
        self.lock().picture.clone()
    }

    /// There will be no more news.
    pub(super) fn end(&self) {
        self.lock().over = true;
        self.news.notify_all();
    }

    /// A state newer than `known`, as soon as there is one; none after `patience`. An error where none will come.
    pub(super) fn newer(&self, known: u64, patience: Duration) -> Result<Option<State>, Over> {
        let waited = self.news.wait_timeout_while(self.lock(), patience, |held| {
            !held.over && held.state.number <= known
        });
        let (held, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if held.over {
            return Err(Over);
        }
        Ok((held.state.number > known).then(|| held.state.clone()))
    }
}

/// There will be no more news.
#[derive(Debug)]
pub(super) struct Over;
