//! What was computed for the last step lengths.
//!
//! Rows of a log are a few lengths apart that repeat, so that most steps are found here.

/// Number of lengths that are kept.
const KEPT: usize = 16;

/// Step lengths that differ by less than this share of the time and of the step are one.
pub(super) const SAME: f64 = 1e-15;
pub(super) const SAME_STEP: f64 = 1e-12;

/// Values by the step length that they belong to.
pub(super) struct Kept<T> {
    found: Vec<(f64, T)>,
    /// The last one asked for, and the one that was made longest ago.
    recent: usize,
    oldest: usize,
    /// What came after each, the last time: steps alternate.
    follower: [usize; KEPT],
}

impl<T> Kept<T> {
    pub(super) fn new() -> Self {
        Self {
            found: Vec::with_capacity(KEPT),
            recent: 0,
            oldest: 0,
            follower: [0; KEPT],
        }
    }

    /// The value for a step of this length that ends at `time`.
    #[inline(always)]
    pub(super) fn at(&mut self, length: f64, time: f64, make: impl FnOnce() -> T) -> &T {
        let tolerance = SAME * time.abs() + SAME_STEP * length;
        let next = self.follower[self.recent];
        let kept = self.found.get(next);
        if kept.is_some_and(|(kept, _)| (kept - length).abs() <= tolerance) {
            self.recent = next;
        } else {
            self.search(length, tolerance, make);
        }
        &self.found[self.recent].1
    }

    /// Another value than the one that followed the last time.
    #[inline(never)]
    fn search(&mut self, length: f64, tolerance: f64, make: impl FnOnce() -> T) {
        let fits = |(kept, _): &(f64, T)| (kept - length).abs() <= tolerance;
        let before = self.recent;
        self.recent = if let Some(place) = self.found.iter().position(fits) {
            place
        } else if self.found.len() < KEPT {
            self.found.push((length, make()));
            self.found.len() - 1
        } else {
            self.oldest = (self.oldest + 1) % KEPT;
            self.found[self.oldest] = (length, make());
            self.oldest
        };
        self.follower[before] = self.recent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_length_is_made_once_while_it_is_kept() {
        let mut made = 0;
        let mut kept = Kept::new();
        for _ in 0..5 {
            for k in 1..=16_u32 {
                let length = 0.01 * f64::from(k);
                let value = *kept.at(length * (1.0 + 1e-13), 1.0, || {
                    made += 1;
                    length
                });
                assert!((value - length).abs() < 1e-12);
            }
        }
        assert_eq!(made, KEPT);
    }

    #[test]
    fn one_length_more_takes_the_place_of_an_old_one() {
        let mut kept = Kept::new();
        for k in 0..64_u32 {
            let length = 1.0 + f64::from(k);
            assert_eq!(*kept.at(length, 0.0, || k), k);
            assert_eq!(*kept.at(length, 0.0, || u32::MAX), k);
        }
    }
}
