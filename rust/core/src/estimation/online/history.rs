//! The commands that were sent, and which of them arrive between two rows at each delay.

use std::collections::VecDeque;

use crate::Error;

/// Commands that hold from their times on; zero before the first.
#[derive(Debug, Clone)]
pub(super) struct History {
    sent: VecDeque<(f64, f64)>,
    /// Number of commands that were dropped from the front, and the last of them.
    dropped: usize,
    before: f64,
    delays: Vec<f64>,
    /// For each delay the number of commands that have arrived.
    arrived: Vec<usize>,
    /// For how long commands are kept, s.
    kept: f64,
}

/// A change of the input between two rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jump {
    /// By how much.
    pub(super) size: f64,
    /// How long before the later row, s.
    pub(super) age: f64,
}

impl History {
    pub(super) fn new(delays: &[f64], kept: f64) -> Self {
        Self {
            sent: VecDeque::new(),
            dropped: 0,
            before: 0.0,
            delays: delays.to_vec(),
            arrived: vec![0; delays.len()],
            kept,
        }
    }

    /// Take in a command that holds from `time` on.
    pub(super) fn push(&mut self, time: f64, value: f64) -> Result<(), Error> {
        refuse_if!(
            !time.is_finite() || !value.is_finite(),
            "the command at {time} s is {value}: give finite numbers"
        );
        if let Some((last, _)) = self.sent.back() {
            refuse_if!(
                time <= *last,
                "the command at {time} s follows one at {last} s: give increasing times"
            );
        }
        self.sent.push_back((time, value));
        Ok(())
    }

    fn value(&self, number: usize) -> f64 {
        match number.checked_sub(self.dropped + 1) {
            Some(place) => self.sent.get(place).map_or(0.0, |(_, value)| *value),
            None if number == 0 => 0.0,
            None => self.before,
        }
    }

    /// The command that held at `time`.
    pub(super) fn at(&self, time: f64) -> f64 {
        let count = self.sent.partition_point(|(sent, _)| *sent <= time);
        self.value(self.dropped + count)
    }

    /// The input before the jumps that arrive after the last row and by `time`, which are put into
    /// `jumps`, and the input after them.
    pub(super) fn arrive(
        &mut self,
        delay: usize,
        time: f64,
        length: f64,
        jumps: &mut Vec<Jump>,
    ) -> (f64, f64) {
        jumps.clear();
        let late = self.delays[delay];
        let mut count = self.arrived[delay];
        let before = self.value(count);
        let mut input = before;
        while let Some((sent, value)) = self.sent.get(count - self.dropped) {
            let age = time - (sent + late);
            if age < 0.0 {
                break;
            }
            jumps.push(Jump {
                size: value - input,
                age: age.min(length),
            });
            input = *value;
            count += 1;
        }
        self.arrived[delay] = count;
        (before, input)
    }

    /// Go over to other delays after the row at `now`.
    pub(super) fn follow(&mut self, delays: &[f64], now: f64) {
        let arrived = |late: &f64| {
            let here = self
                .sent
                .partition_point(|(sent, _)| now - (sent + late) >= 0.0);
            self.dropped + here
        };
        self.arrived = delays.iter().map(arrived).collect();
        self.delays = delays.to_vec();
    }

    /// Drop what no delay needs any more.
    pub(super) fn tidy(&mut self, now: f64) {
        let least = self.arrived.iter().copied().min().unwrap_or(0);
        while self.dropped < least {
            match self.sent.get(1) {
                Some((next, _)) if *next < now - self.kept => {
                    if let Some((_, value)) = self.sent.pop_front() {
                        self.before = value;
                        self.dropped += 1;
                    }
                }
                _ => break,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_arrive_once_and_in_order_whatever_is_dropped() {
        let mut history = History::new(&[0.0, 0.25], 0.5);
        let mut jumps = Vec::new();
        let mut heard = [0.0; 2];
        for row in 0..200 {
            let time = 0.1 * f64::from(row);
            history.push(time, f64::from(row % 7)).unwrap();
            for (delay, heard) in heard.iter_mut().enumerate() {
                let (before, after) = history.arrive(delay, time, 0.1, &mut jumps);
                assert_eq!(before, *heard);
                *heard += jumps.iter().map(|jump| jump.size).sum::<f64>();
                assert_eq!(after, *heard);
            }
            assert_eq!(heard[0], f64::from(row % 7));
            if row > 5 {
                assert_eq!(heard[1], f64::from((row - 3) % 7));
                assert_eq!(history.at(time - 0.05), f64::from((row - 1) % 7));
            }
            history.tidy(time);
        }
        assert!(history.sent.len() < 12);
        let refused = history.push(1.0, 0.0).unwrap_err().to_string();
        assert!(refused.contains("the command at 1 s follows"), "{refused}");
    }
}
