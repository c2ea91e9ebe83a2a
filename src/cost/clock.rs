//! CPU time of this process, all threads, in seconds.
//!
//! Linux tells nanoseconds on the CPU of every thread (`/proc/self/task/*/schedstat`, kernel documentation
//! `scheduler/sched-stats`). Threads that have ended are not in it: to be used where threads stay, as those of a pool do.
//! Elsewhere there is no such file, and wall time stands in.

use std::sync::LazyLock;
use std::time::Instant;

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// CPU seconds so far, if the system tells.
pub fn cpu() -> Option<f64> {
    let mut sum = 0_u64;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        // A thread may end between the listing and the reading.
        let Ok(text) = std::fs::read_to_string(task.ok()?.path().join("schedstat")) else {
            continue;
        };
        sum += text.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(1e-9 * sum as f64)
}

/// CPU seconds, or wall seconds where the system does not tell.
pub fn seconds() -> f64 {
    cpu().unwrap_or_else(|| START.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_time() {
        let before = seconds();
        let mut x = 1.0_f64;
        while seconds() - before < 1e-3 {
            x = std::hint::black_box(x.sin());
        }
        assert!(seconds() > before);
    }
}
