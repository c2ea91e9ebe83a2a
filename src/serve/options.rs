//! What is to be done with the room that is served.

use crate::output::{ExposureSetting, WhiteBalance, Writing};
use crate::scene::Options;
use crate::solve::Settings;
use std::path::PathBuf;

/// What is to be done with the room.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// How it is solved.
    pub settings: Settings,
    /// How it is read again when it is changed.
    pub options: Options,
    /// Where it is saved.
    pub output: PathBuf,
    /// How bright it is shown.
    pub brightness: ExposureSetting,
    /// Which light shows as white.
    pub balance: WhiteBalance,
    /// How it is stored.
    pub writing: Writing,
}
