//! What a person hears who exported a room in the wrong way: faults named, with a way out, and no silence.

mod content;
mod desk;
mod faces;
mod limits;
mod names;
mod plane;
mod probes;
mod warnings;
