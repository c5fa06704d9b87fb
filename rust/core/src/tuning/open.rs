//! The loop gain of one loop at some frequencies, as a linear function of its free gains.
//!
//! L = L₀ + Σ g_i L_i. Along a ray of gains, L = F + k D, and |1 + L| ≥ m asks of each frequency that
//!     |D|² k² + 2 Re(conj(1 + F) D) k + |1 + F|² ≥ m²,
//! which excludes one interval of k. What no frequency excludes are a few gaps; within a gap no pole
//! comes to the edge of stability, since 1 + L has no zero there.

use num_complex::Complex64;

use crate::elementary::{angle, sin_cos};
use crate::frequency::{first_term, ratio};
use crate::loops::{ControlLoop, Input, Place};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::stability::{HeldLoop, HeldNumbers};
use crate::{Error, Task};

/// Frequencies for each decade, and the decades below and above the phase crossover of the plant: more
/// need fewer corrections by exact margins, and take time in proportion.
const PER_DECADE: f64 = 120.0;
const BELOW: f64 = 1e-3;
const ABOVE: f64 = 30.0;

/// Distance of two frequencies at most in turns of the delay, in rad, and up to how many.
const TURN: f64 = 0.2;
const TURNS: f64 = 60.0;

/// Where the phase crossover of a plant is sought: from this part of one over its slowest time on, in
/// steps by this factor, of which there are so many.
const SLOW: f64 = 1e-2;
const STEP: f64 = 1.04;
const STEPS: usize = 600;

/// Halvings of the last of these steps: as many as doubles have digits.
const HALVINGS: usize = 45;

/// Phase at the lowest frequency below which a plant counts as a double integrator, in turns of π.
const DOUBLE: f64 = 0.9;

/// n and d of the loop gain by parts, or a and b of a sampled one.
#[derive(Debug)]
enum Parts {
    Continuous(Vec<QuasiPolynomial>, QuasiPolynomial),
    Held(Vec<HeldNumbers>),
}

/// One loop.
#[derive(Debug)]
pub(super) struct Open {
    parts: Parts,
    /// Each frequency, and L₀ and each L_i there; the lowest first.
    values: Vec<(f64, Vec<Complex64>)>,
}

/// An interval of k.
pub(super) type Gap = (f64, f64);

/// The scale of a plant: its sign at low frequencies and its phase crossover, rad/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    pub(super) sign: f64,
    pub(super) omega: f64,
    /// Does the phase fall to half a turn there?
    is_crossed: bool,
}

impl Open {
    /// The loop with these gains free.
    ///
    /// # Errors
    /// [`Error::Argument`] where numbers are beyond double precision.
    pub(super) fn new(of: &ControlLoop, free: &[usize], task: &Task) -> Result<Self, Error> {
        let parts = Parts::of(of, free)?;
        let scale = Scale::of(of, task)?;
        let mut found = Self {
            values: Vec::new(),
            parts,
        };
        let top = of.values().sample_time;
        let top = top.map(|period| std::f64::consts::PI / period);
        for omega in frequencies(scale.omega, of.values().delay, top) {
            found.add(omega, task)?;
        }
        found.add_the_end();
        Ok(found)
    }

    /// Look at one more frequency.
    pub(super) fn add(&mut self, omega: f64, task: &Task) -> Result<(), Error> {
        if omega > 0.0 && omega.is_finite() {
            let row = self.parts.at(omega, task)?;
            if row.iter().all(|value| value.is_finite()) {
                let place = self.values.partition_point(|known| known.0 < omega);
                self.values.insert(place, (omega, row));
            }
        }
        Ok(())
    }

    /// The loop gain at high frequencies with both phases, where it does not vanish.
    fn add_the_end(&mut self) {
        let Parts::Continuous(above, below) = &self.parts else {
            return;
        };
        let degree = below.degree();
        let lead = |h: &QuasiPolynomial| -> f64 {
            let rows = h.coefficients().iter();
            rows.filter_map(|row| row.get(degree)).sum()
        };
        let own = lead(below);
        let row: Vec<Complex64> = above.iter().map(|n| (lead(n) / own).into()).collect();
        if row.iter().any(|value| *value != Complex64::ZERO) {
            let other = row.iter().map(|value| -value).collect();
            self.values.push((f64::INFINITY, other));
            self.values.push((f64::INFINITY, row));
        }
    }

    /// The growth of the argument of 1 + L over the frequencies: stable loops that differ in their gains
    /// alone differ by less than a quarter turn in it, all others by half a turn at least.
    pub(super) fn growth(&self, gains: &[f64]) -> f64 {
        let finite = self.values.iter().filter(|(omega, _)| omega.is_finite());
        let values =
            finite.map(|(_, row)| 1.0 + row.first().copied().unwrap_or_default() + sum(row, gains));
        let (mut total, mut last) = (0.0, None);
        for value in values {
            if let Some(before) = last.replace(value) {
                let turn: Complex64 = value * Complex64::conj(&before);
                total += angle(turn.im, turn.re);
            }
        }
        total
    }

    /// Put the intervals of k in which gains `offset` + k `ray` come closer to −1 than `least` to a list.
    pub(super) fn exclude(&self, offset: &[f64], ray: &[f64], least: f64, list: &mut Vec<Gap>) {
        for (_, row) in &self.values {
            let first = row.first().copied().unwrap_or_default();
            let (fixed, along) = (1.0 + first + sum(row, offset), sum(row, ray));
            let (a, b) = (along.norm_sqr(), (fixed.conj() * along).re);
            let root = b * b - a * (fixed.norm_sqr() - least * least);
            if root > 0.0 {
                let root = root.sqrt();
                list.push(((-b - root) / a, (-b + root) / a));
            } else if a == 0.0 && fixed.norm_sqr() < least * least {
                list.push((f64::NEG_INFINITY, f64::INFINITY));
            }
        }
    }
}

/// Σ g_i L_i.
fn sum(row: &[Complex64], gains: &[f64]) -> Complex64 {
    let pairs = row.iter().skip(1).zip(gains);
    pairs.map(|(value, gain)| value * gain).sum()
}

/// What no interval of a list excludes above `low`, from the highest down.
pub(super) fn gaps(mut list: Vec<Gap>, low: f64) -> Vec<Gap> {
    list.retain(|gap| gap.1 > low);
    list.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (mut found, mut end) = (Vec::new(), low);
    for (from, to) in list {
        if from > end {
            found.push((end, from));
        }
        end = end.max(to);
    }
    if end < f64::INFINITY {
        found.push((end, f64::INFINITY));
    }
    found.reverse();
    found
}

impl Parts {
    fn of(of: &ControlLoop, free: &[usize]) -> Result<Self, Error> {
        let count = of.controller().kind.gains().len();
        let with = |gains: &dyn Fn(usize) -> f64| {
            (0..count).fold(of.clone(), |made, i| {
                made.with_number(Place::Controller(i), gains(i))
            })
        };
        let own = of.values().controller.clone();
        let fixed = with(&|i| {
            if free.contains(&i) {
                0.0
            } else {
                own.get(i).copied().unwrap_or(0.0)
            }
        });
        let alone = |place: usize| with(&|i| f64::from(u8::from(i == place)));
        let loops = std::iter::once(fixed).chain(free.iter().map(|place| alone(*place)));
        if of.values().sample_time.is_none() {
            let mut above = Vec::new();
            let mut below = QuasiPolynomial::variable();
            for each in loops {
                let (n, d) = each.loop_gain()?;
                above.push(n);
                below = d;
            }
            return Ok(Self::Continuous(above, below));
        }
        let held = |each: ControlLoop| {
            let linear = each.linear(Input::Reference)?;
            HeldLoop::new(&linear)?.at(linear.delay())
        };
        Ok(Self::Held(loops.map(held).collect::<Result<_, _>>()?))
    }

    fn at(&self, omega: f64, task: &Task) -> Result<Vec<Complex64>, Error> {
        match self {
            Self::Continuous(above, below) => {
                let s = [Complex64::new(0.0, omega)];
                let mut row = Vec::with_capacity(above.len());
                for n in above {
                    row.extend(ratio(n, below, &s, task)?);
                }
                Ok(row)
            }
            Self::Held(all) => Ok(all.iter().map(|numbers| numbers.gain(omega)).collect()),
        }
    }
}

impl Scale {
    /// The scale of the plant of a loop, its delay and hold with it.
    ///
    /// # Errors
    /// As [`Open::new`].
    pub(super) fn of(of: &ControlLoop, task: &Task) -> Result<Self, Error> {
        let (of, values) = (&alone(of), of.values());
        let plant = Parts::of(of, &[0])?;
        let wait = values.delay + values.sample_time.unwrap_or(0.0);
        let slow = wait + of.slowest_time().unwrap_or(0.0);
        let slow = if slow > 0.0 { slow } else { 1.0 };
        let response = |omega: f64| -> Result<Complex64, Error> {
            Ok(plant.at(omega, task)?.get(1).copied().unwrap_or_default())
        };
        let mut omega = SLOW / slow;
        let (n, d) = of.loop_gain()?;
        let ((above, zeros), (below, poles)) = (first_term(&n), first_term(&d));
        let sign = if above * below < 0.0 { -1.0 } else { 1.0 };
        let top = values
            .sample_time
            .map_or(f64::INFINITY, |period| std::f64::consts::PI / period);
        // At low frequencies each pole at zero turns by a quarter.
        let start = (f64::from(zeros) - f64::from(poles)) * std::f64::consts::FRAC_PI_2;
        let (sine, cosine) = sin_cos(start);
        let mut last = sign * response(omega)?;
        let off = last * Complex64::new(cosine, -sine);
        let mut phase = start + angle(off.im, off.re);
        let is_double = phase < -DOUBLE * std::f64::consts::PI;
        let end = if is_double { 1.5 } else { 1.0 } * -std::f64::consts::PI;
        for _ in 0..STEPS {
            let next = (omega * STEP).min(top);
            let value = sign * response(next)?;
            let turn = value * last.conj();
            phase += angle(turn.im, turn.re);
            (omega, last) = (next, value);
            if phase <= end {
                let omega = halved((next / STEP, next), phase - end, &|omega| {
                    let off = sign * response(omega)? * value.conj();
                    Ok(angle(off.im, off.re))
                })?;
                return Ok(Self {
                    sign,
                    omega,
                    is_crossed: !is_double,
                });
            }
            if next >= top {
                return Ok(Self {
                    sign,
                    omega,
                    is_crossed: false,
                });
            }
        }
        // The phase never gets there.
        Ok(Self {
            sign,
            omega: 10.0 / slow,
            is_crossed: false,
        })
    }

    /// The proportional gain at which a loop oscillates, with its sign, and the period, s; none where the
    /// phase of the plant does not fall to half a turn.
    ///
    /// # Errors
    /// As [`Open::new`].
    pub(super) fn critical(of: &ControlLoop, task: &Task) -> Result<Option<(f64, f64)>, Error> {
        let found = Self::of(of, task)?;
        if !found.is_crossed {
            return Ok(None);
        }
        let alone = alone(of);
        let row = Parts::of(&alone, &[0])?.at(found.omega, task)?;
        let size = row.get(1).map_or(0.0, |value| modulus(*value));
        Ok(Some((
            found.sign / size,
            std::f64::consts::TAU / found.omega,
        )))
    }
}

/// The loop with a proportional gain of one alone.
fn alone(of: &ControlLoop) -> ControlLoop {
    let count = of.controller().kind.gains().len();
    (0..count).fold(of.clone(), |made, i| {
        made.with_number(Place::Controller(i), f64::from(u8::from(i == 0)))
    })
}

/// The frequency between two at which a phase that falls by `beyond` too much at the second one is
/// right; `phase` is that from the second one on.
fn halved(
    (mut low, mut high): (f64, f64),
    beyond: f64,
    phase: &dyn Fn(f64) -> Result<f64, Error>,
) -> Result<f64, Error> {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if phase(middle)? + beyond <= 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(high)
}

/// Frequencies around a phase crossover, up to `top`.
fn frequencies(crossover: f64, delay: f64, top: Option<f64>) -> Vec<f64> {
    let end = top.unwrap_or(f64::INFINITY).min(ABOVE * crossover);
    let factor = 10f64.powf(1.0 / PER_DECADE);
    let (mut omega, mut found) = (BELOW * crossover, Vec::new());
    while omega < end {
        found.push(omega);
        let step = (factor - 1.0) * omega;
        let most = if delay * omega < TURNS {
            TURN / delay
        } else {
            step
        };
        omega += step.min(most);
    }
    found.push(end);
    found
}
