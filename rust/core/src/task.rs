//! What a long kernel shares with whoever waits for it: a request to stop and a count of
//! finished items.
//!
//! A kernel calls [`Task::check`] at least every few milliseconds of work and
//! [`Task::advance`] as it finishes items; both are a relaxed atomic access.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::Error;

/// Stop flag and progress counter of one running computation.
#[derive(Debug, Default)]
pub struct Task {
    stop: AtomicBool,
    done: AtomicU64,
}

impl Task {
    /// A task nobody has asked to stop, with nothing done.
    pub const fn new() -> Self {
        Self {
            stop: AtomicBool::new(false),
            done: AtomicU64::new(0),
        }
    }

    /// Ask the computation to stop at its next check.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// `Err(Error::Interrupted)` once somebody has asked to stop.
    pub fn check(&self) -> Result<(), Error> {
        if self.stop.load(Ordering::Relaxed) {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    }

    /// Count `items` more as finished.
    pub fn advance(&self, items: u64) {
        self.done.fetch_add(items, Ordering::Relaxed);
    }

    /// How many items are finished.
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
    fn progress_adds_up() {
        let task = Task::new();
        task.advance(3);
        task.advance(4);
        assert_eq!(task.done(), 7);
    }
}
