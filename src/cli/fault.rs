//! Our own faults: a panic ends the command with a message and exit code 3, not with a stack trace and 101.

use super::talk::tell;
use crate::error::Error;
use crate::team::Team;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Ranks but the first wait so long before they tell of a fault: where all have the same one, the first has told of it by then and ended
/// the job.
const FIRST_SPEAKS: Duration = Duration::from_secs(2);

/// Runs a command on a rank; the exit code, after errors and panics have been told on stderr.
pub fn guarded(team: Team, run: impl FnOnce() -> crate::Result<u8>) -> u8 {
    let said: Arc<Mutex<Option<String>>> = Arc::default();
    let heard = Arc::clone(&said);
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        let place = info
            .location()
            .map(|l| format!(" ({}:{})", l.file(), l.line()));
        let payload = info.payload();
        let what = payload
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
            .unwrap_or("panic");
        // The first panic is the cause; others follow from it.
        if let Ok(mut said) = heard.lock() {
            said.get_or_insert_with(|| format!("{what}{}", place.unwrap_or_default()));
        }
        if std::env::var_os("RUST_BACKTRACE").is_some() {
            tell(&std::backtrace::Backtrace::force_capture().to_string());
        }
    }));
    // What the command held is gone with it: nothing broken can be seen afterwards.
    let result = panic::catch_unwind(AssertUnwindSafe(run));
    panic::set_hook(before);
    let error = match result {
        Ok(Ok(code)) => return code,
        Ok(Err(error)) => error,
        Err(_) => {
            let what = said.lock().ok().and_then(|mut s| s.take());
            Error::Internal(what.unwrap_or_else(|| "panic".into()))
        }
    };
    if team.is_first() {
        tell(&format!("haarlight: {error}"));
    } else {
        std::thread::sleep(FIRST_SPEAKS);
        tell(&format!("haarlight: rank {}: {error}", team.rank()));
    }
    error.exit_code()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_end_has_its_code() {
        assert_eq!(guarded(Team::default(), || Ok(1)), 1);
        assert_eq!(
            guarded(Team::default(), || Err(Error::input(
                "room.glb",
                "is empty",
                "export it again"
            ))),
            2
        );
        assert_eq!(
            guarded(Team::default(), || Err(Error::Internal("lost".into()))),
            3
        );
        assert_eq!(guarded(Team::default(), || panic!("lost")), 3);
        assert_eq!(
            guarded(Team::default(), || rayon::join(
                || panic!("lost in a thread"),
                || Ok(0)
            )
            .1),
            3
        );
    }
}
