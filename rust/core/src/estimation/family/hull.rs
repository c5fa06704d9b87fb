//! Intervals over all classes that the record does not tell from the best.

use std::f64::consts::{PI, TAU};

use super::candidate::Candidate;
use super::loop_view::Seen;
use crate::elementary::{exp, log};
use crate::{Error, Task};

/// A value and the ends of its interval.
pub type Triple = (f64, f64, f64);

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
    /// Its pieces, where minima are so far apart that their intervals do not meet.
    pub pieces: Vec<(f64, f64)>,
}

/// A candidate as the best one sees it: classes of the other kind have other signs and turns.
pub(super) struct Turning<'a> {
    pub(super) candidate: &'a Candidate,
    /// The frequency at which its largest stable gain oscillates.
    pub(super) turn: Option<f64>,
    /// Added to its phase: half turns that make it comparable with the best.
    offset: f64,
    /// Those of the integrators of the best.
    turns: f64,
}

/// All candidates, the best first, each compared with it.
pub(super) fn turning<'a>(all: &'a [Candidate], task: &Task) -> Result<Vec<Turning<'a>>, Error> {
    let Some(best) = all.first() else {
        return Ok(Vec::new());
    };
    let seen = best.seen();
    let turn = own_turn(&seen, task)?;
    let finite = turn.filter(|turn| turn.is_finite());
    let mut out = Vec::with_capacity(all.len());
    for candidate in all {
        let other = candidate.seen();
        let mut offset = 0.0;
        let own = match finite {
            Some(turn) => {
                let differ = other.sign() * seen.sign() < 0.0;
                let half = if differ { PI } else { 0.0 };
                let off = seen.phase(turn) - other.phase(turn) - half;
                offset = half + (off / TAU).round() * TAU;
                let target = seen.phase(turn) - offset;
                Some(other.passing(turn, target))
            }
            None if out.is_empty() => turn,
            None => own_turn(&other, task)?,
        };
        out.push(Turning {
            candidate,
            turn: own,
            offset,
            turns: seen.turns(),
        });
    }
    Ok(out)
}

fn own_turn(seen: &Seen, task: &Task) -> Result<Option<f64>, Error> {
    match seen.turn(task) {
        Err(error) if error.ends_all() => Err(error),
        // A gain too far from one for its margins: no gain is known to be largest.
        Err(_) => Ok(None),
        Ok(turn) => Ok(turn),
    }
}

impl Turning<'_> {
    fn finite_turn(&self) -> Option<f64> {
        self.turn.filter(|turn| turn.is_finite())
    }

    pub(super) fn crossover(&self) -> Option<f64> {
        self.finite_turn()
            .map(|turn| self.candidate.seen().crossover(turn))
    }

    /// The size of the largest stable gain; infinite where none is.
    pub(super) fn largest(&self) -> Triple {
        match self.turn {
            None => (f64::INFINITY, f64::INFINITY, f64::INFINITY),
            Some(turn) => exponential(self.candidate.interval(|seen| seen.log_largest(turn))),
        }
    }

    /// The delay and its interval.
    pub(super) fn delay(&self) -> Triple {
        self.candidate.interval_of_class(|seen| seen.numbers.delay)
    }

    pub(super) fn phase(&self, seen: &Seen, omega: f64) -> f64 {
        seen.phase(omega) + self.offset
    }

    /// −(arg G + 90° for each integrator of the best)/ω.
    fn equivalent_delay(&self, seen: &Seen, omega: f64) -> f64 {
        -(self.phase(seen, omega) + self.turns) / omega
    }
}

fn exponential((value, low, high): Triple) -> Triple {
    (exp(value), exp(low), exp(high))
}

/// Gain, phase and equivalent delay of each at a frequency.
fn parts_at(all: &[Turning<'_>], omega: f64) -> [Vec<Triple>; 3] {
    let each = |of: &dyn Fn(&Turning<'_>, &Seen) -> f64| -> Vec<Triple> {
        let parts = all.iter();
        parts
            .map(|one| one.candidate.interval(|seen| of(one, seen)))
            .collect()
    };
    let gains = each(&|_, seen| seen.log_gain(omega)).into_iter();
    [
        gains.map(exponential).collect(),
        each(&|one, seen| one.phase(seen, omega)),
        each(&|one, seen| one.equivalent_delay(seen, omega)),
    ]
}

/// The mean equivalent delay over frequencies with these weights, and its ends over all candidates whose
/// numbers the record tells; those of the best count in any case. Phases begin at that of ω → 0.
pub(super) fn mean_delay(all: &[Turning<'_>], omega: &[f64], weight: &[f64]) -> Triple {
    let sign = all.first().map_or(1.0, |best| best.candidate.gain);
    let counts = |place: usize, one: &Turning<'_>| {
        let is_told = one.candidate.told == one.candidate.values.len();
        place == 0 || is_told && one.candidate.gain * sign > 0.0
    };
    let mean = |seen: &Seen, turns: f64| -> f64 {
        let each = omega.iter().zip(weight);
        each.map(|(omega, weight)| -weight * (seen.phase(*omega) + turns) / omega)
            .sum()
    };
    let parts = all.iter().enumerate();
    union(
        parts
            .filter(|(place, one)| counts(*place, one))
            .map(|(_, one)| one.candidate.interval(|seen| mean(seen, one.turns))),
    )
}

/// The same over all, each with its ends.
pub(super) fn at(all: &[Turning<'_>], omega: f64) -> [Triple; 3] {
    parts_at(all, omega).map(|parts| union(parts.into_iter()))
}

/// The first value with the least and the largest end.
fn union(parts: impl Iterator<Item = Triple>) -> Triple {
    let join = |a: Triple, b: Triple| (a.0, a.1.min(b.1), a.2.max(b.2));
    parts.reduce(join).unwrap_or((f64::NAN, f64::NAN, f64::NAN))
}

/// The intervals joined where they meet, in order.
fn pieces(parts: &[Triple]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(f64, f64)> = parts.iter().map(|part| (part.1, part.2)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<(f64, f64)> = Vec::new();
    for (low, high) in sorted {
        match out.last_mut() {
            Some(last) if low <= last.1 => last.1 = last.1.max(high),
            _ => out.push((low, high)),
        }
    }
    out
}

impl Named {
    /// The hull of these parts, the best first.
    fn new(name: &'static str, parts: Vec<Triple>) -> Self {
        let (value, low, high) = union(parts.iter().copied());
        Self {
            name,
            value,
            low,
            high,
            pieces: pieces(&parts),
        }
    }

    /// Nothing of it below zero, or above the largest.
    fn within(mut self, largest: f64) -> Self {
        (self.low, self.high) = (self.low.max(0.0), self.high.min(largest));
        for (low, high) in &mut self.pieces {
            (*low, *high) = (low.clamp(0.0, largest), high.clamp(0.0, largest));
        }
        self
    }
}

/// The intervals of all quantities; the best candidate comes first. No delay is above the largest.
pub(super) fn hull(all: &[Turning<'_>], largest_delay: f64) -> Vec<Named> {
    let Some(best) = all.first() else {
        return Vec::new();
    };
    let kind = best.candidate.class.integrating;
    let same = || {
        all.iter()
            .filter(|one| one.candidate.class.integrating == kind)
    };
    let delays = Named::new("delay", all.iter().map(Turning::delay).collect());
    let mut out = vec![delays.within(largest_delay)];
    // An integrator beside a slow zero has the gain of neither.
    let alike = same().filter(|one| one.candidate.gain * best.candidate.gain > 0.0);
    let gains = alike.map(|one| one.candidate.interval_of_class(Seen::static_gain));
    out.push(Named::new("gain", gains.collect()));
    let times = same().map(|one| {
        let late = |seen: &Seen| seen.numbers.low_delay();
        one.candidate.interval_of_class(late)
    });
    out.push(Named::new("delay+lag", times.collect()));
    if let Some(largest) = best.candidate.numbers.lags().first() {
        let lag = |seen: &Seen| seen.numbers.lag();
        let real = same().filter(|one| !one.candidate.numbers.lags().is_empty());
        let lags = real
            .map(|one| one.candidate.interval_of_class(lag))
            .collect();
        let mut lag = Named::new("lag", lags).within(f64::INFINITY);
        lag.value = *largest;
        out.push(lag);
    }
    let sign = best.candidate.seen().sign();
    let signed = |(value, low, high): Triple| {
        if sign > 0.0 {
            (value, low, high)
        } else {
            (-value, -high, -low)
        }
    };
    let largest = all.iter().map(Turning::largest).map(signed);
    out.push(Named::new("largest_gain", largest.collect()));
    if let Some(omega) = best.crossover() {
        let over = all.iter().filter_map(|one| {
            let turn = one.finite_turn()?;
            let near = one.candidate.seen().crossover(turn);
            let log_crossover = |seen: &Seen| log(seen.crossover_near(near, turn));
            Some(exponential(one.candidate.interval(log_crossover)))
        });
        out.push(Named::new("crossover", over.collect()));
        let names = [
            "gain_at_crossover",
            "phase_at_crossover",
            "delay_at_crossover",
        ];
        for (name, parts) in names.into_iter().zip(parts_at(all, omega)) {
            out.push(Named::new(name, parts));
        }
    }
    out
}
