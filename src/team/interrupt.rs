//! Work that may be given up: long loops ask between chunks whether anybody still wants what they find.
//!
//! What was given up is no result: it is thrown away, and so an interrupt changes nothing of what is kept.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Is told by loops on all threads that they go on; true: they should not. To be answered in far less than a millisecond.
pub type Asked = Arc<dyn Fn() -> bool + Send + Sync>;

/// Nobody interrupts.
pub static NEVER: Interrupt = Interrupt {
    asked: None,
    raised: AtomicBool::new(false),
};

/// Says whether to go on. Once it says no it does not change its mind.
#[derive(Default)]
pub struct Interrupt {
    asked: Option<Asked>,
    raised: AtomicBool,
}

/// Work was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

impl Interrupt {
    /// Work is given up as soon as `asked` says so.
    pub fn by(asked: Asked) -> Self {
        Self {
            asked: Some(asked),
            raised: AtomicBool::new(false),
        }
    }

    /// Is the work to be given up?
    pub fn is_raised(&self) -> bool {
        let Some(asked) = &self.asked else {
            return false;
        };
        // Nothing but the flag itself goes from thread to thread.
        if !self.raised.load(Ordering::Relaxed) && asked() {
            self.raised.store(true, Ordering::Relaxed);
        }
        self.raised.load(Ordering::Relaxed)
    }

    /// The same, for `?`.
    ///
    /// # Errors
    /// The work is to be given up.
    pub fn check(&self) -> Result<(), Interrupted> {
        match self.is_raised() {
            true => Err(Interrupted),
            false => Ok(()),
        }
    }
}

impl fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Interrupt")
            .field("raised", &self.raised)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn what_was_interrupted_stays_so() {
        let asked = Arc::new(AtomicUsize::new(0));
        let count = asked.clone();
        // Says yes just once.
        let interrupt = Interrupt::by(Arc::new(move || count.fetch_add(1, Ordering::Relaxed) == 2));
        let said: Vec<bool> = (0..5).map(|_| interrupt.is_raised()).collect();
        assert_eq!(said, [false, false, true, true, true]);
        assert_eq!(interrupt.check(), Err(Interrupted));
        // Nobody is asked again.
        assert_eq!(asked.load(Ordering::Relaxed), 3);
        assert_eq!(NEVER.check(), Ok(()));
    }
}
