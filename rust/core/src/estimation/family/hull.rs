//! Intervals over all classes that the record does not tell from the best.

use super::candidate::Candidate;
use super::loop_view::Seen;
use crate::elementary::exp;
use crate::{Error, Task};

/// An interval of a named quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// The name.
    pub name: &'static str,
    /// Its value for the best class, and the ends.
    pub value: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// A candidate with the frequency at which its largest stable gain oscillates.
pub(super) struct Turning<'a> {
    pub(super) candidate: &'a Candidate,
    pub(super) turn: Option<f64>,
}

impl<'a> Turning<'a> {
    pub(super) fn new(candidate: &'a Candidate, task: &Task) -> Result<Self, Error> {
        let turn = match candidate.seen().turn(task) {
            Err(error) if error.ends_all() => return Err(error),
            Err(_) => None,
            Ok(turn) => turn,
        };
        Ok(Self { candidate, turn })
    }

    fn finite_turn(&self) -> Option<f64> {
        self.turn.filter(|turn| turn.is_finite())
    }

    pub(super) fn crossover(&self) -> Option<f64> {
        self.finite_turn().map(|turn| self.candidate.seen().crossover(turn))
    }

    /// The size of the largest stable gain; infinite where none is.
    pub(super) fn largest(&self) -> (f64, f64, f64) {
        match self.turn {
            None => (f64::INFINITY, f64::INFINITY, f64::INFINITY),
            Some(turn) => {
                let (value, low, high) = self.candidate.interval(|seen| seen.log_largest(turn));
                (exp(value), exp(low), exp(high))
            }
        }
    }
}

/// Gain, phase and equivalent delay at a frequency, each with its ends, over all of these.
pub(super) fn at(all: &[Turning<'_>], omega: f64) -> [(f64, f64, f64); 3] {
    let over = |of: &dyn Fn(&Seen) -> f64| union(all.iter().map(|one| one.candidate.interval(of)));
    let gain = over(&|seen| seen.log_gain(omega));
    [
        (exp(gain.0), exp(gain.1), exp(gain.2)),
        over(&|seen| seen.phase(omega)),
        over(&|seen| seen.equivalent_delay(omega)),
    ]
}

/// The first value with the least and the largest end.
fn union(parts: impl Iterator<Item = (f64, f64, f64)>) -> (f64, f64, f64) {
    let join = |a: (f64, f64, f64), b: (f64, f64, f64)| (a.0, a.1.min(b.1), a.2.max(b.2));
    parts.reduce(join).unwrap_or((f64::NAN, f64::NAN, f64::NAN))
}

/// The intervals of all quantities; the best candidate comes first.
pub(super) fn hull(all: &[Turning<'_>]) -> Vec<Named> {
    let Some(best) = all.first() else {
        return Vec::new();
    };
    let mut out = Vec::new();
    let mut add = |name, (value, low, high): (f64, f64, f64)| {
        out.push(Named { name, value, low, high });
    };
    let plain = |of: &dyn Fn(&Seen) -> f64, one: &Turning<'_>| one.candidate.interval(of);
    let (value, low, high) = union(all.iter().map(|one| plain(&|seen| seen.numbers.delay, one)));
    add("delay", (value, low.max(0.0), high));
    let kind = best.candidate.class.integrating;
    let same = all.iter().filter(|one| one.candidate.class.integrating == kind);
    add("gain", union(same.map(|one| plain(&|seen| seen.gain, one))));
    let lag = |seen: &Seen| seen.numbers.lags().first().copied().unwrap_or(seen.numbers.sum);
    if let Some(largest) = best.candidate.numbers.lags().first() {
        let same = all.iter().filter(|one| {
            one.candidate.class.integrating == kind && !one.candidate.numbers.lags().is_empty()
        });
        let (_, low, high) = union(same.map(|one| plain(&lag, one)));
        add("lag", (*largest, low.max(0.0), high));
    }
    let sign = if best.candidate.gain < 0.0 { -1.0 } else { 1.0 };
    let (value, low, high) = union(all.iter().map(Turning::largest));
    let [low, high] = if sign > 0.0 { [low, high] } else { [-high, -low] };
    add("largest_gain", (sign * value, low, high));
    if let Some(omega) = best.crossover() {
        let places = all.iter().filter_map(|one| one.finite_turn().map(|turn| (one, turn)));
        let over = places.map(|(one, turn)| {
            let near = one.candidate.seen().crossover(turn);
            plain(&|seen: &Seen| seen.crossover_near(near, turn), one)
        });
        add("crossover", union(over));
        let [gain, phase, delay] = at(all, omega);
        add("gain_at_crossover", gain);
        add("phase_at_crossover", phase);
        add("delay_at_crossover", delay);
    }
    out
}
