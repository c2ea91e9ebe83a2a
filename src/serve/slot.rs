//! So many at a time: connections, streams of events.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One of a number of places, given back in the end.
pub(super) struct Slot(Arc<AtomicUsize>);

impl Slot {
    /// Takes one; none if all are taken.
    pub(super) fn take(taken: &Arc<AtomicUsize>, all: usize) -> Option<Self> {
        let place = Self(Arc::clone(taken));
        (taken.fetch_add(1, Ordering::SeqCst) < all).then_some(place)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}
