//! Breaking points: when they occur, and a bound on the jumps there.
//!
//! At a break b let Δ_k bound the jump of H^k/k! x^(k), H a fixed length. The equation's own
//! recursion gives it from the breaks that arrive, at b − τ_j:
//!
//!   Δ_{k+1} = Σ |N_j| Δ_{k+1}(b − τ_j) + H/(k + 1) (|A_0| Δ_k + Σ |A_j| Δ_k(b − τ_j) + Σ |B_j| υ_k)
//!
//! with υ the same for u. The lowest k that jumps therefore rises by one at a return through A_j
//! but not through N_j, and simultaneous breaks add up. A polynomial of degree k − 1 approximates a
//! jump s of the k-th derivative over a length h up to 2 s (h/4)^k/k!; once this is below rounding
//! errors for every k, the break is dropped together with all its returns. x itself may jump:
//! exactly, by −Σ N_j times the jump at b − τ_j.

use std::collections::VecDeque;

use crate::Error;

use super::legendre::TERMS;
use super::terms::Feed;
use crate::dde::limits::slack;

/// A jump below this share of the size to which rounding errors are relative is negligible.
const FADED: f64 = f64::EPSILON;

/// Upper limit on the breaks stored at a time (bounds memory and time).
const MOST_KEPT: usize = 200_000;

/// Highest order of a break that is reported; breaks of higher order are too small to be seen in a
/// plot or a fit.
const REPORTED: usize = 10;

/// A breaking point and the bounds on its jumps, Δ_k of component i at k width + i.
#[derive(Debug, Clone)]
pub(super) struct Break {
    pub(super) time: f64,
    pub(super) bounds: Vec<f64>,
    /// The jump of x itself; empty if there is none.
    pub(super) leap: Vec<f64>,
}

impl Break {
    /// Does a derivative jump that is reported?
    pub(super) fn is_reported(&self, width: usize) -> bool {
        let seen = (REPORTED + 1) * width;
        self.bounds.iter().take(seen).any(|bound| *bound > 0.0)
    }
}

/// Breaks of one signal in order of time, and the number of those removed.
#[derive(Debug, Default)]
struct Line {
    breaks: VecDeque<Break>,
    dropped: usize,
}

impl Line {
    fn get(&self, place: usize) -> Option<&Break> {
        self.breaks.get(place.checked_sub(self.dropped)?)
    }
}

/// One way in which breaks return: a matrix, its delay, and the next break to arrive.
#[derive(Debug)]
struct Way {
    delay: f64,
    kind: Kind,
    entries: Vec<(usize, usize, f64)>,
    next: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    State,
    Derivative,
    Input,
}

/// Sizes to which rounding errors are relative, on the element before.
#[derive(Debug)]
pub(super) struct Scale<'a> {
    /// Of x.
    pub(super) state: &'a [f64],
    /// Of x′.
    pub(super) slope: &'a [f64],
    /// Largest length of the elements to come.
    pub(super) length: f64,
}

/// All breaks, past and future.
#[derive(Debug)]
pub(super) struct Jumps {
    n: usize,
    inputs: usize,
    /// Delay-free matrix, moduli.
    direct: Vec<(usize, usize, f64)>,
    ways: Vec<Way>,
    states: Line,
    input: Line,
    unit: f64,
    longest: f64,
    pending: Option<Break>,
}

impl Jumps {
    /// For feeds of the state, its derivative and the input into x′; `unit` is H.
    pub(super) fn new(
        n: usize,
        inputs: usize,
        a: &[f64],
        [state, derivative, input]: [&[Feed]; 3],
        input_breaks: Vec<Break>,
        unit: f64,
        longest: f64,
    ) -> Self {
        let ways = [
            (Kind::State, state),
            (Kind::Derivative, derivative),
            (Kind::Input, input),
        ]
        .into_iter()
        .flat_map(|(kind, feeds)| {
            feeds.iter().map(move |feed| Way {
                delay: feed.delay,
                kind,
                entries: feed.entries().collect(),
                next: 0,
            })
        })
        .collect();
        let direct = a
            .iter()
            .enumerate()
            .filter(|(_, a)| **a != 0.0)
            .map(|(place, a)| (place / n, place % n, a.abs()))
            .collect();
        Self {
            n,
            inputs,
            direct,
            ways,
            states: Line::default(),
            input: Line {
                breaks: input_breaks.into(),
                dropped: 0,
            },
            unit,
            longest,
            pending: None,
        }
    }

    /// H.
    pub(super) fn unit(&self) -> f64 {
        self.unit
    }

    /// Store a break that has occurred.
    pub(super) fn push(&mut self, passed: Break) -> Result<(), Error> {
        if self.states.breaks.len() >= MOST_KEPT {
            return Err(Error::TooMuch {
                what: "the response of the system",
                limit: MOST_KEPT as u64,
                unit: "breaking points within the longest delay",
                advice: "simulate a shorter time. With smaller delayed derivatives, the breaks of \
                     a neutral system become small sooner"
                    .to_owned(),
            });
        }
        self.states.breaks.push_back(passed);
        Ok(())
    }

    /// Remove breaks that have returned for the last time by `t`.
    pub(super) fn forget(&mut self, t: f64) {
        let old = t - self.longest - slack(t, self.longest);
        while self.states.breaks.front().is_some_and(|b| b.time < old) {
            self.states.breaks.pop_front();
            self.states.dropped += 1;
        }
    }

    /// Time of the next break before `reach` that is not negligible, infinite if there is none.
    pub(super) fn next(&mut self, reach: f64, scale: &Scale<'_>) -> f64 {
        loop {
            if self.pending.is_none() {
                self.pending = self.gather();
                let is_past = |b: &Break| b.time <= slack(0.0, self.longest);
                if self.pending.as_ref().is_some_and(is_past) {
                    self.pending = None;
                    continue;
                }
            }
            match &self.pending {
                Some(pending) if pending.time >= reach => return pending.time,
                Some(pending) if !self.is_faded(pending, scale) => return pending.time,
                Some(_) => self.pending = None,
                None => return f64::INFINITY,
            }
        }
    }

    /// The pending break, if it occurs by `t`.
    pub(super) fn arrived(&mut self, t: f64) -> Option<Break> {
        self.pending
            .take_if(|pending| pending.time <= t + slack(t, self.longest))
    }

    fn coming(&self, way: &Way) -> Option<&Break> {
        match way.kind {
            Kind::Input => self.input.get(way.next),
            Kind::State | Kind::Derivative => self.states.get(way.next),
        }
    }

    /// Combine the breaks that arrive next.
    fn gather(&mut self) -> Option<Break> {
        let time = self
            .ways
            .iter()
            .filter_map(|way| self.coming(way).map(|b| b.time + way.delay))
            .fold(f64::INFINITY, f64::min);
        if time == f64::INFINITY {
            return None;
        }
        let (n, reach) = (self.n, time + slack(time, self.longest));
        // Jumps that arrive through A and B, before integration, and through N.
        let mut source = vec![0.0; TERMS * n];
        let mut bounds = vec![0.0; TERMS * n];
        let mut leap = Vec::new();
        let mut ways = std::mem::take(&mut self.ways);
        for way in &mut ways {
            while let Some(b) = self.coming(way).filter(|b| b.time + way.delay <= reach) {
                let width = if way.kind == Kind::Input {
                    self.inputs
                } else {
                    n
                };
                let into = if way.kind == Kind::Derivative {
                    &mut bounds
                } else {
                    &mut source
                };
                for k in 0..TERMS {
                    for &(row, column, factor) in &way.entries {
                        into[k * n + row] += factor.abs() * b.bounds[k * width + column];
                    }
                }
                if way.kind == Kind::Derivative && !b.leap.is_empty() {
                    leap.resize(n, 0.0);
                    for &(row, column, factor) in &way.entries {
                        leap[row] += factor * b.leap[column];
                    }
                }
                way.next += 1;
            }
        }
        self.ways = ways;
        self.integrate(&mut bounds, &source);
        Some(Break { time, bounds, leap })
    }

    /// Add H/(k + 1) (|A_0| Δ_k + source_k) to Δ_{k+1}, from the lowest k upwards.
    pub(super) fn integrate(&self, bounds: &mut [f64], source: &[f64]) {
        let n = self.n;
        for k in 0..TERMS - 1 {
            let factor = self.unit / (k + 1) as f64;
            let (known, rest) = bounds.split_at_mut((k + 1) * n);
            let known = &known[k * n..];
            for (new, source) in rest.iter_mut().zip(&source[k * n..(k + 1) * n]) {
                *new += factor * source;
            }
            for &(row, column, a) in &self.direct {
                rest[row] += factor * a * known[column];
            }
        }
    }

    fn is_faded(&self, pending: &Break, scale: &Scale<'_>) -> bool {
        let ratio = scale.length / (4.0 * self.unit);
        (0..self.n).all(|i| {
            let (mut sum, mut power) = (0.0, 8.0);
            for k in 1..TERMS {
                power *= ratio;
                sum += k as f64 * pending.bounds[k * self.n + i] * power;
            }
            pending.bounds[i] <= FADED * scale.state[i]
                && sum <= FADED * scale.length * scale.slope[i]
        })
    }
}
