//! Margins of a loop with a hold.
//!
//! Its loop gain is L = −b(σ) z^(−m−1)/a(σ) on the circle z = e^(jω Ts) (`stability::held`). There
//! x = |σ|² = (2 sin(ω Ts/2)/Ts)² and σ + σ* = −Ts x, so that |a|² − |b|² is a polynomial of degree n
//! in x, whatever the delay is: its zeros are the gain crossovers. The factors on L at which a pole
//! is on the circle are the crossings of a z^(m+1) − k b.
//!
//! A further delay T changes the fraction of a sample in it, and b with that. Its effect on a
//! crossover at ω is close to a turn by ω T: from a stable loop, steps of less than the smallest
//! φ/ω over the crossovers, φ the turn that brings L to −1, approach the first loss of stability,
//! and Newton's iteration for φ = 0 ends at it. The poles are counted after every step, and on both
//! sides of the result, which proves that stability is lost there; that it is not lost and regained
//! within a step is not proved. Where the plant has modes faster than a sample, or the command acts
//! at once (L jumps where the delay is a whole number of samples), the steps near the loss are parts
//! of a sample.

use std::f64::consts::{PI, TAU};

use super::margins::{Margins, least};
use super::zeros::{ORDER, RealFunction, Taylor, zeros_between};
use crate::elementary::{DoubleDouble, angle};
use crate::order::sort_up;
use crate::stability::{HeldLoop, HeldNumbers};
use crate::{Error, Task};

/// The largest factor on a loop gain that is looked for.
const FAR: f64 = 1e12;

/// Share of the estimated distance to the loss of stability that a step takes.
const CAUTIOUS: f64 = 0.7;

/// Turn in radians from which Newton's iteration is used.
const CLOSE: f64 = 0.02;

/// Upper limits on the steps of the approach and of Newton's iteration.
const STEPS: u32 = 2000;
const NEWTON: u32 = 30;

/// Last relative step of Newton's iteration, about the rounding of the turn.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Fractions of a sample for which it is found whether the gain reaches one.
const FRACTIONS: usize = 33;

/// Fractions just below a whole sample.
const LATE: [f64; 3] = [1e-1, 1e-4, 1e-9];

/// Product of the fastest mode of the plant and the sample time beyond which the loop gain changes
/// much with the fraction of a sample in the delay; parts of a sample that are looked at then.
const ABRUPT: f64 = 0.5;
const PARTS: u32 = 8;

/// Relative distance at which a jump of the loop gain is looked at from below.
const JUMP: f64 = 1e-11;

/// Upper limit on halvings of a step in which stability is lost.
const HALVINGS: u32 = 60;

/// Relative distances from the result at which stability is counted, the larger ones where rounding
/// hides it closer by.
const BESIDE: [f64; 3] = [1e-7, 1e-5, 1e-3];

/// |a|² − |b|² as a polynomial in x, with bounds on the errors of its coefficients.
struct Difference {
    coefficients: Vec<f64>,
    sizes: Vec<f64>,
}

impl Difference {
    fn new(a: &[f64], b: &[f64], sample_time: f64) -> Self {
        let (own, other) = (square(a, sample_time), square(b, sample_time));
        let length = own.len().max(other.len());
        let at = |list: &[(DoubleDouble, f64)], k: usize| {
            list.get(k)
                .copied()
                .unwrap_or((DoubleDouble::default(), 0.0))
        };
        let (mut coefficients, mut sizes) = (Vec::new(), Vec::new());
        for k in 0..length {
            let ((p, of_p), (q, of_q)) = (at(&own, k), at(&other, k));
            let value = (p - q).high;
            coefficients.push(value);
            // A few roundings of the value; those of the sum are in double-double arithmetic.
            sizes.push(value.abs() + 1e-12 * (of_p + of_q));
        }
        Self {
            coefficients,
            sizes,
        }
    }

    /// The derivatives of order 0 to `ORDER` of a polynomial.
    fn derivatives(row: &[f64], x: f64) -> [f64; ORDER + 1] {
        let mut found = [0.0; ORDER + 1];
        for c in row.iter().rev() {
            for k in (1..=ORDER).rev() {
                found[k] = found[k] * x + found[k - 1];
            }
            found[0] = found[0] * x + c;
        }
        let mut factorial = 1.0;
        for (k, value) in found.iter_mut().enumerate().skip(1) {
            factorial *= k as f64;
            *value *= factorial;
        }
        found
    }
}

impl RealFunction for Difference {
    fn value(&mut self, x: f64) -> f64 {
        self.coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, c| sum * x + c)
    }

    fn taylor(&mut self, x: f64) -> Taylor {
        let values = Self::derivatives(&self.coefficients, x);
        let sizes = Self::derivatives(&self.sizes, x);
        let roundings = (4 * self.sizes.len()) as f64 * f64::EPSILON;
        let mut found = Taylor::default();
        for k in 0..ORDER {
            found.values[k] = values[k];
            found.errors[k] = roundings * sizes[k];
        }
        found
    }

    fn bound(&self, x: f64) -> f64 {
        let absolute: Vec<f64> = self.coefficients.iter().map(|c| c.abs()).collect();
        Self::derivatives(&absolute, x)[ORDER]
    }
}

/// |p(σ)|² on the circle as a polynomial in x, with sums of moduli.
fn square(p: &[f64], sample_time: f64) -> Vec<(DoubleDouble, f64)> {
    let zero = (DoubleDouble::default(), 0.0);
    let mut total = vec![zero; p.len()];
    // σᵏ + σ*ᵏ = −Ts x (σᵏ⁻¹ + σ*ᵏ⁻¹) − x (σᵏ⁻² + σ*ᵏ⁻²), ascending powers of x.
    let mut before = vec![(DoubleDouble::from(2.0), 2.0)];
    let mut now = vec![zero, (DoubleDouble::from(-sample_time), sample_time)];
    for k in 0..p.len() {
        let power = if k == 0 {
            vec![(DoubleDouble::ONE, 1.0)]
        } else {
            now.clone()
        };
        for (i, (low, high)) in p.iter().zip(&p[k..]).enumerate() {
            let product = DoubleDouble::product(*low, *high);
            for (j, (c, size)) in power.iter().enumerate() {
                if let Some(sum) = total.get_mut(i + j) {
                    sum.0 = sum.0 + product * *c;
                    sum.1 += product.high.abs() * size;
                }
            }
        }
        if k > 0 {
            let mut next = vec![zero; now.len() + 1];
            for (j, (c, size)) in now.iter().enumerate() {
                next[j + 1].0 = next[j + 1].0 + *c * -sample_time;
                next[j + 1].1 += size * sample_time;
            }
            for (j, (c, size)) in before.iter().enumerate() {
                next[j + 1].0 = next[j + 1].0 - *c;
                next[j + 1].1 += size;
            }
            before = std::mem::replace(&mut now, next);
        }
    }
    total
}

/// All frequencies above zero with |L| = 1, and the turn in [0, 2π) that brings L to −1 there.
fn crossovers(
    numbers: &HeldNumbers,
    sample_time: f64,
    task: &Task,
) -> Result<Vec<(f64, f64)>, Error> {
    let (a, b) = numbers.polynomials();
    let largest = 4.0 / (sample_time * sample_time);
    let mut difference = Difference::new(a, b, sample_time);
    let found = zeros_between(&mut difference, 0.0, largest, task)?;
    Ok(found
        .into_iter()
        .map(|x| {
            let omega = 2.0 / sample_time * (0.5 * sample_time * x.sqrt()).min(1.0).asin();
            let gain = numbers.gain(omega);
            (omega, (PI + angle(gain.im, gain.re)).rem_euclid(TAU))
        })
        .collect())
}

/// Margins of a loop with a hold; without `delay_margin` that is NaN. Further delays change the
/// crossings, so that there is no list of them.
///
/// # Errors
/// [`Error::Argument`] where numbers are beyond double precision; [`Error::Interrupted`].
pub fn held_margins(held: HeldLoop<'_>, delay_margin: bool, task: &Task) -> Result<Margins, Error> {
    let numbers = held.at(held.delay())?;
    let stable = numbers.is_stable(task)?;
    let found = crossovers(&numbers, held.sample_time(), task)?;
    let (places, turns): (Vec<f64>, Vec<f64>) = found.into_iter().unzip();
    let degrees: Vec<f64> = turns
        .iter()
        .map(|turn| if *turn > PI { turn - TAU } else { *turn }.to_degrees())
        .collect();
    let Some(factors) = numbers.factors((0.0, FAR), task)? else {
        refuse!(
            "the phase crossovers of this sampled loop are beyond double precision: a pole and a \
             zero of its loop gain may cancel on the unit circle; change a number by a little"
        );
    };
    let mut factors: Vec<(f64, f64)> = factors
        .iter()
        .filter(|at| at.low > 1.0 / FAR)
        .map(|at| (at.omega, at.gain))
        .collect();
    sort_up(&mut factors, |factor| factor.0);
    let (phase_crossovers, gains): (Vec<f64>, Vec<f64>) = factors.into_iter().unzip();
    let up = least(&gains, &phase_crossovers, |k| (k > 1.0).then_some(k));
    let mut down = least(&gains, &phase_crossovers, |k| (k < 1.0).then_some(-k));
    down.0 = if down.0 == f64::INFINITY {
        0.0
    } else {
        -down.0
    };
    let turned = least(&degrees, &places, |turn| Some(turn.abs()));
    let late = match (stable, delay_margin) {
        (true, true) => further_delay(held, task)?,
        _ => (f64::NAN, f64::NAN),
    };
    let shown = |pair: (f64, f64)| if stable { pair } else { (f64::NAN, f64::NAN) };
    let [up, down, turned] = [up, down, turned].map(shown);
    Ok(Margins {
        stable,
        gain_margin: up.0,
        gain_reduction: down.0,
        phase_margin: turned.0,
        delay_margin: late.0,
        gain_margin_omega: up.1,
        gain_reduction_omega: down.1,
        phase_margin_omega: turned.1,
        delay_margin_omega: late.1,
        gain_crossovers: places,
        phase_margins: degrees,
        delay_margins: Vec::new(),
        phase_crossovers,
        gain_margins: gains,
        searched: (f64::INFINITY, f64::INFINITY),
        hidden: Vec::new(),
    })
}

/// The further delay in s with which a stable loop first loses stability, and the frequency there;
/// infinite where no delay is too much.
///
/// # Errors
/// As for [`held_margins`]; [`Error::Argument`] also where the loss is beyond double precision.
pub fn further_delay(held: HeldLoop<'_>, task: &Task) -> Result<(f64, f64), Error> {
    let (start, period) = (held.delay(), held.sample_time());
    let is_abrupt = held.fastest() * period > ABRUPT || held.is_direct();
    let mut delay = start;
    for _ in 0..STEPS {
        task.check()?;
        let Some((omega, turn)) = nearest(held, delay, is_abrupt, task)? else {
            match next_crossover(held, delay, task)? {
                Some(next) => delay = next,
                None => return Ok((f64::INFINITY, f64::NAN)),
            }
            continue;
        };
        if !is_abrupt
            && turn < CLOSE
            && let Some(found) = newton(held, delay, omega, task)?
        {
            return confirmed(held, found, task);
        }
        let step = CAUTIOUS * turn / omega;
        let points = if is_abrupt && step < period {
            within_sample(delay, period)
        } else {
            vec![delay + step]
        };
        for next in points {
            if !held.at(next)?.is_stable(task)? {
                let found = bracketed(held, delay, next, task)?;
                return confirmed(held, found, task);
            }
            delay = next;
        }
    }
    refuse!(
        "no loss of stability was met from a delay of {start} s to {delay} s, and none beyond is \
         ruled out: look at single delays with is_stable()"
    )
}

/// The crossover whose estimated distance to the loss of stability is least; with a loop gain that
/// changes much within a sample, on both sides of the next whole number of samples as well.
fn nearest(
    held: HeldLoop<'_>,
    delay: f64,
    is_abrupt: bool,
    task: &Task,
) -> Result<Option<(f64, f64)>, Error> {
    let period = held.sample_time();
    let mut found = crossovers(&held.at(delay)?, period, task)?;
    if is_abrupt {
        for beside in within_sample(delay, period).into_iter().rev().take(2) {
            found.extend(crossovers(&held.at(beside)?, period, task)?);
        }
    }
    let distance = |place: &(f64, f64)| place.1 / place.0;
    Ok(found
        .into_iter()
        .min_by(|p, q| distance(p).total_cmp(&distance(q))))
}

/// Delays up to the next whole number of samples, the last two on both sides of it.
fn within_sample(delay: f64, period: f64) -> Vec<f64> {
    let whole = period * ((delay / period * (1.0 + 1e-12)).floor() + 1.0);
    let below = whole * (1.0 - JUMP);
    let inner = (1..PARTS).map(|part| delay + (below - delay) * f64::from(part) / f64::from(PARTS));
    inner.chain([below, whole]).collect()
}

/// The loss of stability between a delay at which the loop is stable and one at which it is not.
fn bracketed(
    held: HeldLoop<'_>,
    mut low: f64,
    mut high: f64,
    task: &Task,
) -> Result<(f64, f64), Error> {
    let turned = |delay: f64| -> Result<f64, Error> {
        let found = crossovers(&held.at(delay)?, held.sample_time(), task)?;
        let size = |place: &(f64, f64)| place.1.min(TAU - place.1);
        let closest = found.into_iter().min_by(|p, q| size(p).total_cmp(&size(q)));
        Ok(closest.map_or(f64::NAN, |place| place.0))
    };
    for halving in 0..HALVINGS {
        if high - low <= 2.0 * JUMP * high {
            break;
        }
        if halving % 6 == 5 {
            let found = newton(held, high, turned(high)?, task)?;
            if let Some(found) = found.filter(|found| found.0 >= low && found.0 <= high) {
                return Ok(found);
            }
        }
        let middle = 0.5 * (low + high);
        if held.at(middle)?.is_stable(task)? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok((high, turned(high)?))
}

/// The next delay with a fraction of a sample for which the gain reaches one.
fn next_crossover(held: HeldLoop<'_>, delay: f64, task: &Task) -> Result<Option<f64>, Error> {
    let period = held.sample_time();
    let here = delay / period;
    let even = (0..FRACTIONS).map(|k| k as f64 / FRACTIONS as f64);
    let late = LATE.iter().map(|gap| 1.0 - gap);
    let mut fractions: Vec<f64> = even
        .chain(late)
        .map(|fraction| {
            let ahead = (fraction - here).rem_euclid(1.0);
            if ahead > 0.0 { ahead } else { 1.0 }
        })
        .collect();
    fractions.sort_by(f64::total_cmp);
    for ahead in fractions {
        let next = delay + ahead * period;
        if !crossovers(&held.at(next)?, period, task)?.is_empty() {
            return Ok(Some(next));
        }
    }
    Ok(None)
}

/// The delay at which the turn of the crossover next to `omega` is zero.
fn newton(
    held: HeldLoop<'_>,
    mut delay: f64,
    mut omega: f64,
    task: &Task,
) -> Result<Option<(f64, f64)>, Error> {
    let start = delay;
    for _ in 0..NEWTON {
        let found = crossovers(&held.at(delay)?, held.sample_time(), task)?;
        let off = |place: &(f64, f64)| (place.0 - omega).abs();
        let Some((place, turn)) = found.into_iter().min_by(|p, q| off(p).total_cmp(&off(q))) else {
            return Ok(None);
        };
        let turn = if turn > PI { turn - TAU } else { turn };
        omega = place;
        let step = turn / omega;
        delay += step;
        if step.abs() <= ROUNDING * (delay + 1.0 / omega) {
            return Ok(Some((delay, omega)));
        }
        if (delay - start).abs() > 10.0 * CLOSE / omega {
            return Ok(None);
        }
    }
    Ok(None)
}

/// The further delay, if stability is lost there.
fn confirmed(
    held: HeldLoop<'_>,
    (delay, omega): (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let start = held.delay();
    for beside in BESIDE {
        let (before, after) = (delay * (1.0 - beside), delay * (1.0 + beside));
        let lost = !held.at(after)?.is_stable(task)?;
        let kept = before <= start || held.at(before)?.is_stable(task)?;
        if lost && kept {
            return Ok((delay - start, omega));
        }
    }
    refuse!(
        "stability seems to be lost at a delay of {delay} s, but a count of the poles on both \
         sides does not confirm it: look at single delays with is_stable()"
    )
}
