//! A transport delay as in block-diagram tools: one value for each step, linear interpolation
//! between them.

use std::collections::VecDeque;

/// Two times closer than this share of a step are equal.
pub(super) const SLACK: f64 = 1e-9;

/// Values of a signal at whole steps, the latest last.
#[derive(Debug)]
pub(super) struct Buffer {
    /// The value before the first step.
    before: f64,
    /// Number of the step that `values` starts with.
    first: usize,
    values: VecDeque<f64>,
    /// Number of values that have to be kept.
    needed: usize,
}

impl Buffer {
    /// A buffer that can be read back up to `delay`, in steps.
    pub(super) fn new(before: f64, delay: f64) -> Self {
        Self {
            before,
            first: 0,
            values: VecDeque::new(),
            needed: delay.ceil() as usize + 3,
        }
    }

    /// Append the value of the next step.
    pub(super) fn push(&mut self, value: f64) {
        self.values.push_back(value);
        if self.values.len() > self.needed {
            self.values.pop_front();
            self.first += 1;
        }
    }

    /// The signal at `time` in steps: constant before the first value, linear between values, and
    /// extrapolated linearly beyond the latest value.
    pub(super) fn read(&self, time: f64) -> f64 {
        // A time that differs from a whole step only by rounding errors is that step.
        let whole = time.round();
        let time = if (time - whole).abs() <= SLACK {
            whole
        } else {
            time
        };
        if time < 0.0 || self.values.is_empty() {
            return self.before;
        }
        let newest = self.first + self.values.len() - 1;
        if newest == 0 {
            return self.values[0];
        }
        let left = (time.floor() as usize).clamp(self.first, newest - 1);
        let at = time - left as f64;
        let (a, b) = (
            self.values[left - self.first],
            self.values[left - self.first + 1],
        );
        a + at * (b - a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_between_values_and_beyond_the_last() {
        let mut buffer = Buffer::new(-1.0, 0.5);
        assert_eq!(buffer.read(0.0), -1.0);
        buffer.push(2.0);
        assert_eq!(
            (buffer.read(-0.1), buffer.read(0.0), buffer.read(0.4)),
            (-1.0, 2.0, 2.0)
        );
        buffer.push(4.0);
        assert_eq!((buffer.read(0.25), buffer.read(1.5)), (2.5, 5.0));
        for value in [4.0, 8.0, 8.0, 8.0] {
            buffer.push(value);
        }
        assert_eq!((buffer.read(2.5), buffer.read(5.0)), (6.0, 8.0));
    }
}
