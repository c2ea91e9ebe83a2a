//! Which request gets which answer.
//!
//! | request | answer |
//! |---|---|
//! | `GET /` | the page |
//! | `GET /viewer.js`, `/page.css` | what it is made of |
//! | `GET /room` | JSON: name, lamps, materials, viewpoints, names of spectra; 503 while the room is prepared |
//! | `GET /events` | server-sent events: the state, whole, whenever it is another |
//! | `GET /mesh` | the GLB of the present mesh; its number in `X-Mesh` |
//! | `GET /light?mesh=M&had=S` | what a browser lacks that has shape S of mesh M, see `picture`; 204: begin with `/mesh` |
//! | `GET /point?mesh=M&part=P&vertices=A,B,C&weights=U,V,W` | JSON: the light at a point between vertices of a part, see `reading`; 204: there is no such point |
//! | `POST /stop`, `/go`, `/save`, `/expose` | 202; what comes of it is told by events |
//! | `POST /change` | 202, or 400 with what is wrong, see `changes` |

use super::guard::Guard;
use super::http::{Request, Response, TAKING, stream_head};
use super::picture::LitMesh;
use super::session::{SessionCommand, Shared};
use super::slot::Slot;
use super::spectra::PointReading;
use crate::error::Error;
use crate::report::page::{KEYS, NOTICES, PICTURE, STYLE, VIEWER, escaped};
use serde_json::json;
use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

const PAGE: &str = include_str!("page.html");
const OWN_STYLE: &str = include_str!("page.css");
/// A stream says so often that it is there, so that it is seen when nobody listens any more.
const HEARTBEAT: Duration = Duration::from_secs(5);
/// Streams of events at the most: so many tabs.
const STREAMS: usize = 16;

/// What is needed to answer.
pub(super) struct Routes {
    pub(super) guard: Guard,
    pub(super) commands: Sender<SessionCommand>,
    pub(super) streams: Arc<AtomicUsize>,
}

impl Routes {
    /// Answers one request, and is done with the connection.
    pub(super) fn serve(&self, mut stream: TcpStream, shared: &Shared) {
        let asked = Instant::now();
        let answer = match Request::read(&mut stream) {
            Ok(request) => match self.guard.check(&request) {
                Ok(()) if request.path == "/events" && request.method == "GET" => {
                    return self.events(stream, shared);
                }
                Ok(()) => self.answer(&request, asked, shared),
                Err(answer) => answer,
            },
            Err(answer) => answer,
        };
        // Whoever has gone needs no answer.
        let _ = answer.send(&mut stream);
    }

    fn answer(&self, request: &Request, asked: Instant, shared: &Shared) -> Response {
        let unknown = || Response::refusal(404, "there is no such thing here");
        let reads = [
            "/",
            "/viewer.js",
            "/page.css",
            "/room",
            "/events",
            "/mesh",
            "/light",
            "/point",
        ];
        let acts = ["/stop", "/go", "/save", "/expose", "/change"];
        let path = request.path.as_str();
        match request.method.as_str() {
            "GET" if reads.contains(&path) => self.read(request, shared),
            "POST" if acts.contains(&path) => self.act(request, asked, shared),
            _ if reads.contains(&path) => {
                Response::refusal(405, "this is asked for by GET").with("Allow", "GET")
            }
            _ if acts.contains(&path) => {
                Response::refusal(405, "this is asked for by POST").with("Allow", "POST")
            }
            _ => unknown(),
        }
    }

    fn read(&self, request: &Request, shared: &Shared) -> Response {
        let early =
            || Response::refusal(503, "the room is being prepared").with("Retry-After", "1");
        let board = &shared.board;
        match request.path.as_str() {
            "/" => Response::of("text/html; charset=utf-8", self.page()),
            "/viewer.js" => Response::of("text/javascript; charset=utf-8", VIEWER)
                .with("Content-Encoding", "gzip"),
            "/page.css" => Response::of("text/css; charset=utf-8", format!("{STYLE}{OWN_STYLE}")),
            "/room" => board.room().map_or_else(early, |room| {
                Response::of("application/json", room.as_bytes())
            }),
            "/point" => match point_of(request) {
                Some((mesh, part, vertices, weights)) => {
                    board.picture().map_or_else(early, |picture| {
                        let same = Some(&picture).filter(|p| p.numbers()[0] == mesh);
                        let found = same.and_then(|p| p.spectra.at(part, vertices, weights));
                        found.map_or_else(Response::nothing, |found| reading(&picture, &found))
                    })
                }
                None => Response::refusal(
                    400,
                    "say mesh=M, part=P, vertices=A,B,C and weights=U,V,W from 0 to 1",
                ),
            },
            "/mesh" => board.picture().map_or_else(early, |picture| {
                let [mesh, ..] = picture.numbers();
                let glb = &picture.shape.glb[..];
                Response::of("model/gltf-binary", glb).with("X-Mesh", mesh.to_string())
            }),
            _ => {
                let number = |key| request.asked(key).and_then(|n| n.parse::<u32>().ok());
                let (Some(mesh), Some(had)) = (number("mesh"), number("had")) else {
                    return Response::refusal(400, "say mesh=NUMBER and had=NUMBER");
                };
                let lacks = |picture: Arc<LitMesh>| {
                    picture
                        .since(mesh, had as usize)
                        .map_or_else(Response::nothing, |bytes| {
                            Response::of("application/octet-stream", bytes)
                        })
                };
                board.picture().map_or_else(early, lacks)
            }
        }
    }

    fn act(&self, request: &Request, asked: Instant, shared: &Shared) -> Response {
        let command = match request.path.as_str() {
            "/stop" => {
                shared.stop.store(true, Ordering::SeqCst);
                SessionCommand::Stop
            }
            "/go" => SessionCommand::Go,
            "/save" => SessionCommand::Save,
            "/expose" => SessionCommand::Expose,
            _ => {
                let Some(reader) = shared.reader.get() else {
                    return Response::refusal(503, "the room is being prepared");
                };
                match reader.read(&request.body) {
                    Ok((scene, changes)) => SessionCommand::Change(Box::new(scene), changes, asked),
                    Err(Error::Internal(fault)) => return Response::refusal(500, &fault),
                    Err(problem) => return Response::refusal(400, &problem.to_string()),
                }
            }
        };
        match self.commands.send(command) {
            Ok(()) => Response::refusal(202, "heard"),
            Err(_) => Response::refusal(503, "the program is ending"),
        }
    }

    fn page(&self) -> String {
        PAGE.replace("{{picture}}", PICTURE)
            .replace("{{keys}}", KEYS)
            .replace("{{token}}", self.guard.token())
            .replace("{{notices}}", &escaped(NOTICES))
    }

    /// The state, whenever it is another, until nobody listens.
    fn events(&self, mut stream: TcpStream, shared: &Shared) {
        let Some(_place) = Slot::take(&self.streams, STREAMS) else {
            let full = Response::refusal(503, "there are too many windows of this room");
            let _ = full.send(&mut stream);
            return;
        };
        // Ends with an error when the other side is gone, or takes nothing.
        let _ = tell(&mut stream, shared);
    }
}

/// The point that is asked for: mesh, part, vertices and their weights.
fn point_of(request: &Request) -> Option<(u64, usize, [usize; 3], [f64; 3])> {
    let three = |key| -> Option<[&str; 3]> {
        let list: Vec<&str> = request.asked(key)?.split(',').collect();
        list.try_into().ok()
    };
    let [mesh, part] = ["mesh", "part"].map(|key| request.asked(key)?.parse::<u32>().ok());
    let vertices = three("vertices")?.map(|v| v.parse::<u32>().ok());
    let weights = three("weights")?.map(|w| w.parse().ok().filter(|w| (0.0..=1.0).contains(w)));
    let ([Some(a), Some(b), Some(c)], [Some(u), Some(v), Some(w)]) = (vertices, weights) else {
        return None;
    };
    let vertices = [a, b, c].map(|v| v as usize);
    Some((mesh?.into(), part? as usize, vertices, [u, v, w]))
}

/// The light at a point: `light` (number of the light), `spectrum` (W/m2/nm on the 64 bands), `xyz` (tristimulus
/// irradiance; Y is lx), `error_de2000` (an estimate, or null) and whether that is the point's own (`error_here`) or the
/// room's mean.
fn reading(picture: &LitMesh, found: &PointReading) -> Response {
    let [.., light] = picture.numbers();
    let body = json!({
        "light": light,
        "spectrum": found.spectrum.to_vec(),
        "xyz": found.xyz,
        "error_de2000": found.error.map(|(error, _)| error),
        "error_here": found.error.is_some_and(|(_, here)| here),
    });
    Response::of("application/json", body.to_string())
}

fn tell(stream: &mut TcpStream, shared: &Shared) -> std::io::Result<()> {
    stream.set_write_timeout(Some(TAKING))?;
    stream.write_all(stream_head().as_bytes())?;
    let mut known = 0;
    while let Ok(newer) = shared.board.newer(known, HEARTBEAT) {
        let Some(state) = newer else {
            stream.write_all(b": still here\n\n")?;
            continue;
        };
        known = state.number;
        let text = serde_json::to_string(&state)?;
        stream.write_all(format!("data: {text}\n\n").as_bytes())?;
    }
    Ok(())
}
