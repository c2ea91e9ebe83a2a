//! What is to be done with the room that is served.

use crate::output::{Balance, Brightness, Writing};
use crate::scene::Options;
use crate::solve::Settings;
use std::path::PathBuf;

/// What is to be done with the room.
#[derive(Debug, Clone)]
pub struct Wishes {
    /// How it is solved.
    pub settings: Settings,
    /// How it is read again when it is changed.
    pub options: Options,
    /// Where it is saved.
    pub output: PathBuf,
    /// How bright it is shown.
    pub brightness: Brightness,
    /// Which light shows as white.
    pub balance: Balance,
    /// How it is stored.
    pub writing: Writing,
}
