//! A room whose light is watched in a browser while it is worked out: `haarlight serve`.
//!
//! | file | what |
//! |---|---|
//! | `http` | requests and answers over TCP, with limits on size and time |
//! | `guard` | who may ask: the token, the host, the origin |
//! | `board` | what is to be seen at present, and who waits for news of it |
//! | `spectra` | the spectrum of the light at points of a picture, and its error |
//! | `patches` | the patches of the hierarchy as meshes that only grow |
//! | `picture` | a mesh with its light, and what a browser lacks of it in bytes |
//! | `changes` | lamps and paints as they were changed |
//! | `scratch` | a folder that is gone in the end |
//! | `wishes` | what is to be done with the room |
//! | `session` | the thread that solves, relights and saves |
//! | `place` | so many connections at a time |
//! | `routes` | which request gets which answer |
//! | `server` | the listener |
//!
//! One thread solves; every connection has a thread of its own, is asked one thing and closed, but for the streams of events.
//! An event holds the whole state, never a part: who is slow misses events and no state. Light goes by itself as bytes, 16 a
//! vertex, with the vertices and triangles that are new.

mod board;
mod changes;
mod guard;
mod http;
mod options;
mod patches;
mod picture;
mod routes;
mod scratch;
mod server;
mod session;
mod slot;
mod spectra;

pub use options::ServeOptions;
pub use server::Server;
