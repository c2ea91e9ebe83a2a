//! The listener: a thread for each connection, and the session beside them.

use super::board::Board;
use super::changes::RoomReader;
use super::guard::Guard;
use super::options::ServeOptions;
use super::routes::Routes;
use super::scratch::ScratchFolder;
use super::session::{Session, SessionCommand, Shared};
use super::slot::Slot;
use crate::error::{Error, Result};
use crate::scene::Scene;
use std::net::{Ipv4Addr, TcpListener};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Connections at the most: each has a thread.
const CONNECTIONS: usize = 64;

/// A server that listens to this machine alone.
pub struct Server {
    listener: TcpListener,
    routes: Arc<Routes>,
    shared: Arc<Shared>,
    scratch: ScratchFolder,
    commands: Receiver<SessionCommand>,
    ended: Sender<SessionResult>,
    end: Receiver<SessionResult>,
}

/// How a session ended.
type SessionResult = std::thread::Result<Result<()>>;

impl Server {
    /// Listens on a port of 127.0.0.1; 0: one that is free. Requests wait until [`Server::run`].
    ///
    /// # Errors
    /// The port is taken or not ours to take; the system gives no random numbers.
    pub fn open(port: u16, asked_de2000: f64) -> Result<Self> {
        let refused = |problem: std::io::Error| {
            let next = "name another port, or leave --port out: a free one is found";
            Error::input(
                format!("--port {port}"),
                format!("cannot be listened to ({problem})"),
                next,
            )
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
        let port = listener.local_addr().map_err(refused)?.port();
        let (sender, commands) = channel();
        let (ended, end) = channel();
        Ok(Self {
            listener,
            routes: Arc::new(Routes {
                guard: Guard::new(port)?,
                commands: sender,
                streams: Arc::default(),
            }),
            shared: Arc::new(Shared {
                board: Board::new(asked_de2000),
                stop: AtomicBool::new(false),
                writing: Mutex::new(()),
                reader: OnceLock::new(),
            }),
            scratch: ScratchFolder::new(&port.to_string()),
            commands,
            ended,
            end,
        })
    }

    /// The address of the page, with its token.
    pub fn address(&self) -> String {
        self.routes.guard.address()
    }

    /// An address that leads there once, for command lines, which others see.
    pub fn ticket(&self) -> String {
        self.routes.guard.ticket()
    }

    /// What ends [`Server::run`] when it is called.
    pub fn end(&self) -> impl Fn() + Send + 'static {
        let ended = self.ended.clone();
        move || {
            // Nobody listens where it ends already.
            let _ = ended.send(Ok(Ok(())));
        }
    }

    /// Serves a room until it is [ended](Server::end). A file that is being written then is written whole, and nothing else is
    /// left behind.
    ///
    /// # Errors
    /// What stops the session: faults of our own.
    ///
    /// # Panics
    /// Where the session does.
    pub fn run(self, scene: Scene, wishes: ServeOptions) -> Result<()> {
        let (routes, shared) = (self.routes, Arc::clone(&self.shared));
        std::thread::spawn(move || listen(&self.listener, &routes, &shared));
        let (shared, scratch) = (Arc::clone(&self.shared), self.scratch.clone());
        std::thread::spawn(move || {
            let work = || {
                let reader = RoomReader::new(wishes.options.clone(), &scene);
                // It is set here only.
                let _ = shared.reader.set(reader);
                Session::new(scene, &wishes, &shared, &scratch)?.run(&self.commands)
            };
            // What the session held is not used again.
            let done = catch_unwind(AssertUnwindSafe(work));
            let _ = self.ended.send(done);
        });
        // The session's sender is there until it says something.
        let done = self.end.recv().unwrap_or(Ok(Ok(())));
        self.shared.board.end();
        let writing = self.shared.writing.lock();
        let _written = writing.unwrap_or_else(PoisonError::into_inner);
        self.scratch.remove();
        done.unwrap_or_else(|panic| resume_unwind(panic))
    }
}

fn listen(listener: &TcpListener, routes: &Arc<Routes>, shared: &Arc<Shared>) {
    let open = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        // A connection that broke off, or no more files: the next may do.
        let Ok(stream) = stream else {
            std::thread::sleep(std::time::Duration::from_millis(20));
            continue;
        };
        let _ = stream.set_nodelay(true);
        let Some(place) = Slot::take(&open, CONNECTIONS) else {
            continue;
        };
        let (routes, shared) = (Arc::clone(routes), Arc::clone(shared));
        let request = std::thread::Builder::new().name("request".into());
        // Where there is no thread for it the connection is closed.
        let _ = request.spawn(move || {
            routes.serve(stream, &shared);
            drop(place);
        });
    }
}
