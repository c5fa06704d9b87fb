//! State shared by a long computation and the thread that waits for it: a request to stop and a
//! count of finished items.
//!
//! A kernel calls [`Task::check`] at least every few milliseconds of work and
//! [`Task::advance`] as it finishes items; both are a relaxed atomic access.

use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::Error;
use crate::memory::{HEADROOM, is_scarce, is_short, out_of_memory};

/// Checks between two readings of the clock, which cost more than a check.
const CHECKS: u64 = 32;

/// Stop flag and progress counter of one running computation.
#[derive(Debug, Default)]
pub struct Task {
    stop: AtomicBool,
    scarce: AtomicBool,
    done: AtomicU64,
    lookout: Option<Lookout>,
}

/// A function to call regularly, on the computing thread, that decides whether to continue.
struct Lookout {
    /// The time of the first look at the clock, none where there is no clock, as in a page: then it
    /// is asked after every so many checks.
    start: OnceLock<Option<Instant>>,
    every: Duration,
    checks: AtomicU64,
    asked: AtomicU64,
    go_on: fn() -> bool,
}

impl fmt::Debug for Lookout {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Lookout")
            .field("every", &self.every)
            .finish_non_exhaustive()
    }
}

impl Lookout {
    /// Is it time to call it?
    fn is_due(&self) -> bool {
        // Not `fetch_add`, which costs more than the rest: a count lost between two threads does no
        // harm.
        let checks = self.checks.load(Ordering::Relaxed);
        self.checks.store(checks.wrapping_add(1), Ordering::Relaxed);
        // Work of a few checks never looks at the clock.
        if checks % CHECKS != CHECKS - 1 {
            return false;
        }
        let Some(start) = self.start.get() else {
            // Two threads may come here at once, and either time will do.
            let _ = self.start.set(now());
            return true;
        };
        let Some(start) = start else {
            return true;
        };
        let period = start.elapsed().as_nanos() / self.every.as_nanos().max(1);
        let period = u64::try_from(period).unwrap_or(u64::MAX);
        self.asked.swap(period, Ordering::Relaxed) != period
    }
}

/// The time, where there is a clock.
fn now() -> Option<Instant> {
    // Reading the clock of this target panics.
    (!cfg!(all(target_family = "wasm", target_os = "unknown"))).then(Instant::now)
}

impl Task {
    /// A task without a request to stop and with no items finished.
    pub const fn new() -> Self {
        Self {
            stop: AtomicBool::new(false),
            scarce: AtomicBool::new(false),
            done: AtomicU64::new(0),
            lookout: None,
        }
    }

    /// A task that calls `go_on` itself at about this interval when it is checked; `false` stops
    /// it.
    pub fn asking(every: Duration, go_on: fn() -> bool) -> Self {
        Self {
            lookout: Some(Lookout {
                start: OnceLock::new(),
                every,
                checks: AtomicU64::new(0),
                asked: AtomicU64::new(0),
                go_on,
            }),
            ..Self::new()
        }
    }

    /// Ask the computation to stop at its next check.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Ask the computation to stop at its next check if memory is scarce.
    pub fn look_at_memory(&self) {
        if is_scarce() {
            self.scarce.store(true, Ordering::Relaxed);
            self.stop();
        }
    }

    /// `Err(Error::Interrupted)` after a request to stop, [`Error::Memory`] after memory was
    /// scarce.
    pub fn check(&self) -> Result<(), Error> {
        if let Some(lookout) = self.lookout.as_ref().filter(|lookout| lookout.is_due()) {
            self.look_at_memory();
            if !(lookout.go_on)() {
                self.stop();
            }
        }
        let is_stopped = self.stop.load(Ordering::Relaxed);
        if is_short() || (is_stopped && self.scarce.load(Ordering::Relaxed)) {
            Err(out_of_memory("the rest of the computation", HEADROOM))
        } else if !is_stopped {
            Ok(())
        } else {
            Err(Error::Interrupted)
        }
    }

    /// Count `items` more as finished.
    pub fn advance(&self, items: u64) {
        self.done.fetch_add(items, Ordering::Relaxed);
    }

    /// Count `items` less as finished: they are done again.
    pub(crate) fn take_back(&self, items: u64) {
        let less = |done: u64| Some(done.saturating_sub(items));
        let _ = self
            .done
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }

    /// Number of finished items.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stopped_task_says_so_at_its_next_check() {
        let task = Task::new();
        assert_eq!(task.check(), Ok(()));
        task.stop();
        assert_eq!(task.check(), Err(Error::Interrupted));
    }

    #[test]
    fn a_task_that_asks_hears_the_answer() {
        let task = Task::asking(Duration::from_millis(1), || false);
        let start = Instant::now();
        while task.check().is_ok() {
            assert!(start.elapsed() < Duration::from_secs(60));
        }
        assert_eq!(task.check(), Err(Error::Interrupted));
        let willing = Task::asking(Duration::from_nanos(1), || true);
        assert!((0..1000).all(|_| willing.check().is_ok()));
    }

    #[test]
    fn progress_adds_up() {
        let task = Task::new();
        task.advance(3);
        task.advance(4);
        assert_eq!(task.done(), 7);
    }
}
