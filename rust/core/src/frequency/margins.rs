//! Margins of a feedback loop, from all crossings of its loop gain L = n/d.
//!
//! The closed loop has the characteristic function d + n. Its roots move continuously with a factor
//! k on L, a turn e^(−jφ) or a further delay T, so that a stable loop first loses stability where a
//! root comes to the axis:
//!     k = 1/|L| where L is real and negative (ω = 0 among these places),
//!     φ = π + arg L and T = φ/ω where |L| = 1, φ in [0, 2π),
//! or, if L does not vanish for high frequencies, where strong stability is lost (`chains`).
//! |d|² = |n|² and Im(n conj d) = 0 are solved by `zeros_between`, which misses nothing up to a
//! frequency beyond which the moduli of the coefficients show |L| to stay below what matters.
//! Stability as it is is a proved count. The margins themselves carry rounding only.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::bounds::{end_of_gain, highest_corner};
use super::chains::Lead;
use super::norms::{Peaks, peaks};
use super::squares::{DifferenceOfSquares, alike};
use super::two_sided::TwoSided;
use super::waves::Waves;
use super::zeros::zeros_between;
use crate::elementary::angle;
use crate::quasipoly::{Kind, Probe, QuasiPolynomial};
use crate::roots::{Ratio, Stability, is_stable};
use crate::{Error, Task};

/// Where delays stay in the phase but none of them turns it through 180 degrees, there is no bound
/// on the frequencies: the search ends where the gain is below the first number, or at the second
/// one times the crossover frequency or the turn of the longest delay.
const SMALLEST_GAIN: f64 = 1e-8;
const TURNS: f64 = 1e3;

/// A neutral loop whose gain has no proved end above or below one is searched this many times
/// beyond its highest corner.
const BEYOND_CORNERS: f64 = 100.0;

/// Margins and the crossings behind them; what is not there is infinite, zero or NaN as
/// `deadtime.Margins` says.
#[derive(Debug, Clone, PartialEq)]
#[expect(
    missing_docs,
    reason = "the names are those of the class of the Python package"
)]
pub struct Margins {
    pub stable: bool,
    pub gain_margin: f64,
    pub gain_reduction: f64,
    pub phase_margin: f64,
    pub delay_margin: f64,
    pub gain_margin_omega: f64,
    pub gain_reduction_omega: f64,
    pub phase_margin_omega: f64,
    pub delay_margin_omega: f64,
    pub gain_crossovers: Vec<f64>,
    pub phase_margins: Vec<f64>,
    pub delay_margins: Vec<f64>,
    pub phase_crossovers: Vec<f64>,
    pub gain_margins: Vec<f64>,
    pub searched: (f64, f64),
    pub hidden: Vec<Complex64>,
    pub peaks: Peaks,
}

/// Margins of the loop gain n/d, all roots of d + n counting for stability.
///
/// # Errors
/// [`Error::Argument`] where a loop can have none, or its gain is one or its phase 180 degrees on a
/// whole range of frequencies; as [`is_stable`].
///
/// ```
/// use deadtime::{Task, frequency::margins, quasipoly::QuasiPolynomial};
/// let n = QuasiPolynomial::new(vec![vec![2.0]], vec![0.36])?;
/// let found = margins(&n, &QuasiPolynomial::variable(), &Task::new())?;
/// assert!((found.delay_margin - (std::f64::consts::FRAC_PI_4 - 0.36)).abs() < 1e-15);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn margins(n: &QuasiPolynomial, d: &QuasiPolynomial, task: &Task) -> Result<Margins, Error> {
    refuse_what_has_none(n, d)?;
    let stable = is_stable(&d.add(n)?, true, task)?;
    let hidden = Vec::new();
    with_verdict(n, d, Stability { stable, hidden }, task)
}

/// Gain margin, phase margin in degrees and delay margin in s of a loop that is known to be stable.
/// A gain margin above `most` may come out larger than it is; the other two are infinite without
/// `turns`.
///
/// # Errors
/// As [`margins`].
pub fn margins_of_stable(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    most: f64,
    turns: bool,
    task: &Task,
) -> Result<[f64; 3], Error> {
    refuse_what_has_none(n, d)?;
    let lead = Lead::of(d, n, 0.0);
    let mut found = [lead.lost_above_one(), f64::INFINITY, f64::INFINITY];
    if most > 1.0 {
        let phase = phase_crossovers(n, d, f64::INFINITY, 1.0 / most, task)?;
        let factors = phase.gains.iter().map(|gain| 1.0 / gain);
        found[0] = factors.filter(|k| *k > 1.0).fold(found[0], f64::min);
    }
    if turns {
        for omega in gain_crossovers(n, d, task)?.0 {
            let turn = turn_at(n, d, omega);
            found[1] = found[1].min(degrees(turn).abs());
            found[2] = found[2].min(turn / omega);
        }
        if lead.is_lost_by_delay() {
            found[2] = 0.0;
        }
    }
    Ok(found)
}

/// The turn in [0, 2π) that brings n/d at a gain crossover to −1.
fn turn_at(n: &QuasiPolynomial, d: &QuasiPolynomial, omega: f64) -> f64 {
    let at = over(n, d, omega);
    (PI + angle(at.im, at.re)).rem_euclid(TAU)
}

/// A turn in (−180, 180] degrees.
pub(super) fn degrees(turn: f64) -> f64 {
    if turn > PI { turn - TAU } else { turn }.to_degrees()
}

/// [`margins`], except that roots of d + n that n and d have in common do not count: they are hidden
/// in the ratio n/(d + n).
///
/// # Errors
/// As [`margins`].
pub fn margins_of_ratio(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    task: &Task,
) -> Result<Margins, Error> {
    refuse_what_has_none(n, d)?;
    let found = Ratio::new(n.clone(), d.add(n)?).stability(true, task)?;
    with_verdict(n, d, found, task)
}

fn with_verdict(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    verdict: Stability,
    task: &Task,
) -> Result<Margins, Error> {
    let Stability { stable, hidden } = verdict;
    let (crossovers, all_gain) = gain_crossovers(n, d, task)?;
    let turns = crossovers.iter().map(|omega| turn_at(n, d, *omega));
    let turns: Vec<f64> = turns.collect();
    let delays: Vec<f64> = turns
        .iter()
        .zip(&crossovers)
        .map(|(turn, omega)| turn / omega)
        .collect();
    let degrees: Vec<f64> = turns.iter().map(|turn| degrees(*turn)).collect();
    let last = if stable {
        f64::INFINITY
    } else {
        crossovers.last().copied().unwrap_or(0.0)
    };
    let phase = phase_crossovers(n, d, last, 0.0, task)?;
    let factors: Vec<f64> = phase.gains.iter().map(|gain| 1.0 / gain).collect();

    let lead = Lead::of(d, n, 0.0);
    let mut up = least(&factors, &phase.places, |k| (k > 1.0).then_some(k));
    let mut down = least(&factors, &phase.places, |k| (k < 1.0).then_some(-k));
    down.0 = if down.0 == f64::INFINITY {
        0.0
    } else {
        -down.0
    };
    let (most, fewest) = (lead.lost_above_one(), lead.lost_below_one());
    if most <= up.0 && most < f64::INFINITY {
        up = (most, f64::INFINITY);
    }
    if fewest >= down.0 && fewest > 0.0 {
        down = (fewest, f64::INFINITY);
    }
    let late = if lead.is_lost_by_delay() {
        (0.0, f64::INFINITY)
    } else {
        least(&delays, &crossovers, Some)
    };
    let turned = least(&degrees, &crossovers, |turn| Some(turn.abs()));
    let shown = |pair: (f64, f64)| if stable { pair } else { (f64::NAN, f64::NAN) };
    let [up, down, turned, late] = [up, down, turned, late].map(shown);
    let largest = if stable {
        let places = [&crossovers[..], &phase.places].concat();
        Peaks::if_known(peaks(n, d, &places, task))?
    } else {
        Peaks::UNKNOWN
    };
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
        gain_crossovers: crossovers,
        phase_margins: degrees,
        delay_margins: delays,
        phase_crossovers: phase.places,
        gain_margins: factors,
        searched: (all_gain, phase.searched),
        hidden,
        peaks: largest,
    })
}

/// The smallest of the sizes of `values` and its place; infinite and NaN where there is none.
pub(super) fn least(
    values: &[f64],
    places: &[f64],
    size: impl Fn(f64) -> Option<f64>,
) -> (f64, f64) {
    let sized = values.iter().zip(places);
    sized
        .filter_map(|(value, place)| size(*value).map(|size| (size, *place)))
        .fold((f64::INFINITY, f64::NAN), |best, found| {
            if found.0 < best.0 { found } else { best }
        })
}

fn refuse_what_has_none(n: &QuasiPolynomial, d: &QuasiPolynomial) -> Result<(), Error> {
    refuse_if!(
        d.is_zero(),
        "the denominator of the loop gain is zero, so the loop gain is infinite"
    );
    refuse_if!(
        n.degree() > d.degree(),
        "the loop gain grows with frequency (degree {} over {}), so any delay makes the loop \
         unstable, and there are no margins. Add the roll-off that the real loop has, for example \
         a DerivativeFilter",
        n.degree(),
        d.degree()
    );
    let (own, other) = (first_delay(d), first_delay(n));
    refuse_if!(
        d.kind() == Kind::Advanced || other < own,
        "the loop gain is not causal, so it has no margins. The smallest delay of its denominator \
         is {own} s, the smallest delay of its numerator {other} s, and the denominator is {}",
        d.kind().name()
    );
    Ok(())
}

/// All frequencies above zero with |n| = |d|, and up to where that is all.
///
/// # Errors
/// As [`zeros_between`].
pub(super) fn gain_crossovers(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    task: &Task,
) -> Result<(Vec<f64>, f64), Error> {
    let (n, d) = alike(n, d)?;
    let top = end_of_gain(&n, &d, 1.0, 0).min(end_of_gain(&d, &n, 1.0, 0));
    let (top, searched) = if top.is_finite() {
        (top, f64::INFINITY)
    } else {
        let top = BEYOND_CORNERS * highest_corner(&n, &d);
        (top, top)
    };
    let found = zeros_between(&mut DifferenceOfSquares::new(&d, &n), 0.0, top, task)?;
    Ok((found, searched))
}

/// Frequencies with n/d < 0.
struct PhaseCrossovers {
    places: Vec<f64>,
    /// |n/d| there.
    gains: Vec<f64>,
    /// Up to where they are all.
    searched: f64,
}

/// They go at least up to where the gain is below `level`, below that of one of them that is below
/// one, or some turns of the delays beyond `far`, whichever comes first.
fn phase_crossovers(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    far: f64,
    level: f64,
    task: &Task,
) -> Result<PhaseCrossovers, Error> {
    let mut found = PhaseCrossovers {
        places: Vec::new(),
        gains: Vec::new(),
        searched: f64::INFINITY,
    };
    if n.is_zero() {
        return Ok(found);
    }
    let (p, q) = (n.powers_of_s(), d.powers_of_s());
    let (n, d) = (n.without_powers(p), d.without_powers(q));
    let shift = p as i32 - q as i32;
    let loop_gain = Gain::new(&n, &d, shift);
    // s^(p−q) on the axis is ω^(p−q), which is positive, times quarter turns.
    let sum = TwoSided::of(&n).times(&TwoSided::of(&d).mirrored());
    let mut f = Waves::cleaned(&sum, shift.rem_euclid(4) as usize);
    let last = if f.is_zero() { 0.0 } else { f.last_zero() };
    let ends = |level| match end_of_gain(&n, &d, level, shift) {
        end if end.is_finite() => end,
        _ => BEYOND_CORNERS * highest_corner(&n, &d),
    };
    if p == q {
        loop_gain.keep_negative(&[0.0], &mut found);
    }
    let shortest = TAU / span(&n, &d).max(1e-300);
    let (all, nearly_none) = (ends(1.0), ends(SMALLEST_GAIN));
    let last_level = if level > 0.0 {
        ends(level)
    } else {
        f64::INFINITY
    };
    let enough = all
        .max(shortest)
        .min(10.0 * far.max(shortest))
        .min(last_level);
    let (mut low, mut high) = (0.0, last.min(enough));
    loop {
        if high > low && !f.is_zero() {
            loop_gain.keep_negative(&zeros_between(&mut f, low, high, task)?, &mut found);
        }
        let below = found.gains.iter().filter(|gain| **gain < 1.0).copied();
        let largest = below.fold(0.0, f64::max);
        if high >= last {
            return Ok(found);
        }
        // Ends are enlarged by more than this.
        if far < f64::INFINITY
            || high >= last_level
            || largest > 0.0 && ends(largest) <= high * (1.0 + 5e-10)
            || high >= nearly_none
            || high > TURNS * all.max(shortest)
        {
            found.searched = high;
            return Ok(found);
        }
        (low, high) = (high, last.min(2.0 * high).min(last_level));
    }
}

/// s^shift n/d on the imaginary axis.
struct Gain<'a> {
    n: &'a QuasiPolynomial,
    d: &'a QuasiPolynomial,
    slopes: [Vec<f64>; 2],
    shift: i32,
}

impl<'a> Gain<'a> {
    fn new(n: &'a QuasiPolynomial, d: &'a QuasiPolynomial, shift: i32) -> Self {
        Self {
            n,
            d,
            slopes: [n, d].map(steepness),
            shift,
        }
    }

    /// Add the places at which it is real and negative; where the phase jumps, at a pole or zero on
    /// the axis, it does not cross.
    fn keep_negative(&self, places: &[f64], found: &mut PhaseCrossovers) {
        for &omega in places {
            let turned = Complex64::I.powi(self.shift.rem_euclid(4)) * over(self.n, self.d, omega);
            let mut real = turned.re;
            for _ in 0..self.shift.unsigned_abs() {
                real = if self.shift > 0 {
                    real * omega
                } else {
                    real / omega
                };
            }
            let [n, d] = &self.slopes;
            if real < 0.0 && !vanishes(self.n, n, omega) && !vanishes(self.d, d, omega) {
                found.places.push(omega);
                found.gains.push(-real);
            }
        }
    }
}

/// Coefficients of a bound on |h′| on the imaginary axis.
fn steepness(h: &QuasiPolynomial) -> Vec<f64> {
    let mut total = vec![0.0; h.degree() + 1];
    for (row, delay) in h.coefficients().iter().zip(h.delays()) {
        for (k, c) in row.iter().enumerate() {
            total[k] += delay * c.abs();
            if k > 0 {
                total[k - 1] += k as f64 * c.abs();
            }
        }
    }
    total
}

/// Whether h(jω) is zero but for rounding, that of ω included.
fn vanishes(h: &QuasiPolynomial, steepness: &[f64], omega: f64) -> bool {
    let jet = Probe::new(h).jet(Complex64::new(0.0, omega));
    let step = 32.0 * f64::EPSILON * omega;
    jet.value.norm_sqr().sqrt()
        <= 4.0 * jet.value_error + step * super::waves::polynomial(steepness, omega)
}

/// n(jω)/d(jω).
pub(super) fn over(n: &QuasiPolynomial, d: &QuasiPolynomial, omega: f64) -> Complex64 {
    let s = Complex64::new(0.0, omega);
    super::ratio::ratio_at(n, d, s)
}

fn first_delay(h: &QuasiPolynomial) -> f64 {
    h.delays().first().copied().unwrap_or(0.0)
}

fn span(n: &QuasiPolynomial, d: &QuasiPolynomial) -> f64 {
    let last = |h: &QuasiPolynomial| h.delays().last().copied().unwrap_or(0.0);
    last(n).max(last(d)) - first_delay(n).min(first_delay(d))
}
