//! The largest modulus of n/d on the imaginary axis, and of the sensitivities of a loop.
//!
//! Beyond a frequency γ² |d|² − |n|² keeps above zero: with d_i, n_i the coefficients of the highest
//! power of d by delay and any phases in the place of those of the delays, γ² |d|² − |n|² ≥
//! (γ² − γ∞²)(|d_0| − Σ |d_i|)² in that power, γ∞ being the largest |n|/|d| over all phases, and the
//! other powers are bounded by their moduli. So γ∞ counts as a value of the norm: the strong one,
//! which small changes of the delays do not change (Gumussoy and Michiels 2011, SIAM Journal on
//! Control and Optimization 49, section 3).

use num_complex::Complex64;

use super::bounds::{fujiwara, highest_corner};
use super::chains::Lead;
use super::peaks::{CLOSE, Modulus, Peak, Sought, highest};
use super::ratio::ratio_at;
use super::squares::{DifferenceOfSquares, alike};
use super::two_sided::TwoSided;
use super::zeros::zeros_between;
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::Ratio;
use crate::{Error, Task};

/// Octaves below the highest corner at which a ratio is looked at first: more find a larger value to
/// start from.
const OCTAVES: i32 = 24;

/// Largest moduli of the sensitivities of a loop; all NaN where it is not stable or they are not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peaks {
    /// Of 1/(1 + L).
    pub sensitivity: Peak,
    /// Of L/(1 + L).
    pub complementary: Peak,
    /// Of (1 − L)/(1 + L), halved: one over it is the disk margin.
    pub disk: Peak,
}

impl Peaks {
    /// What was found, or nothing where it cannot be known: margins are there without it.
    ///
    /// # Errors
    /// Those that end all work.
    pub(super) fn if_known(found: Result<Self, Error>) -> Result<Self, Error> {
        match found {
            Err(error) if error.ends_all() => Err(error),
            found => Ok(found.unwrap_or(Self::UNKNOWN)),
        }
    }

    /// Those of a loop that is not stable.
    pub(super) const UNKNOWN: Self = {
        let unknown = Peak {
            value: f64::NAN,
            omega: f64::NAN,
        };
        Self {
            sensitivity: unknown,
            complementary: unknown,
            disk: unknown,
        }
    };
}

/// The largest |n/d| over all frequencies, infinite where n/d is not stable or grows with the
/// frequency; `strong` over small changes of the delays. Roots that n and d have in common do not
/// count.
///
/// # Errors
/// As [`Ratio::stability`] and [`peak`].
///
/// ```
/// use deadtime::{Task, frequency::hinf_norm, quasipoly::QuasiPolynomial};
/// // 1/(s² + 0.2 s + 1)
/// let n = QuasiPolynomial::new(vec![vec![1.0]], vec![0.36])?;
/// let d = QuasiPolynomial::new(vec![vec![1.0, 0.2, 1.0]], vec![0.0])?;
/// let found = hinf_norm(&n, &d, &Task::new())?;
/// assert!((found.value - 1.0 / (0.2 * 0.99f64.sqrt())).abs() < 1e-9);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn hinf_norm(n: &QuasiPolynomial, d: &QuasiPolynomial, task: &Task) -> Result<Peak, Error> {
    let unbounded = |omega| Peak {
        value: f64::INFINITY,
        omega,
    };
    refuse_if!(d.is_zero(), "the denominator is zero");
    if n.is_zero() {
        return Ok(Peak::NONE);
    }
    if n.degree() > d.degree() {
        return Ok(unbounded(f64::INFINITY));
    }
    if !Ratio::new(n.clone(), d.clone())
        .stability(true, task)?
        .stable
    {
        return Ok(unbounded(f64::NAN));
    }
    peak(n, d, &[], task)
}

/// The largest moduli of the sensitivities of a stable loop with the loop gain n/d; `places` are
/// frequencies near which they may be.
///
/// # Errors
/// As [`peak`].
pub fn peaks(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    places: &[f64],
    task: &Task,
) -> Result<Peaks, Error> {
    let closed = d.add(n)?;
    let half = d.sub(n)?.scale(0.5)?;
    let sensitivity = peak(d, &closed, places, task)?;
    let near = if sensitivity.omega.is_finite() {
        [places, &[sensitivity.omega]].concat()
    } else {
        places.to_vec()
    };
    Ok(Peaks {
        sensitivity,
        complementary: peak(n, &closed, &near, task)?,
        disk: peak(&half, &closed, &near, task)?,
    })
}

/// The largest |n/d| over all frequencies where d has no root on the right or on the axis, also for
/// other delays; `places` are frequencies near which it may be.
///
/// # Errors
/// [`Error::Argument`] where the values at high frequencies have no known bound, or rounding hides a
/// root next to the axis; [`Error::Interrupted`].
pub fn peak(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    places: &[f64],
    task: &Task,
) -> Result<Peak, Error> {
    peak_to(n, d, places, Sought::Value(CLOSE), task)
}

/// The same, as well as it is sought: where the value is that of high frequencies, the work grows without
/// bound as `close` falls.
///
/// # Errors
/// As [`peak`].
pub fn peak_to(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    places: &[f64],
    sought: Sought,
    task: &Task,
) -> Result<Peak, Error> {
    if n.is_zero() {
        return Ok(Peak::NONE);
    }
    let (n, d) = alike(n, d)?;
    let far = Far::of(&n, &d)?;
    let of = OnAxis { n, d, far };
    let corner = highest_corner(&of.n, &of.d);
    let octaves = (-2..OCTAVES).map(|k| libm::ldexp(corner, -k));
    let start = [0.0].into_iter().chain(octaves);
    let mut start: Vec<f64> = start.chain(places.iter().copied()).collect();
    let known = Peak {
        value: of.far.most,
        omega: f64::INFINITY,
    };
    if let Sought::Above(level) = sought
        && of.far.most * FAR > level
    {
        return Ok(Peak {
            value: f64::INFINITY,
            ..known
        });
    }
    highest(&of, known, &mut start, sought, task)
}

/// The limit at high frequencies times this counts as above a level. Closer ones: the frequencies that
/// have to be looked at grow without bound.
const FAR: f64 = 1.0 + 1e-3;

/// What is known of n/d at high frequencies.
#[derive(Debug, Clone, Copy)]
struct Far {
    /// γ∞.
    most: f64,
    /// |d_0| − Σ |d_i|.
    reserve: f64,
}

impl Far {
    fn of(n: &QuasiPolynomial, d: &QuasiPolynomial) -> Result<Self, Error> {
        let lead = Lead::of(d, n, 0.0);
        let reserve = lead.reserve(0.0);
        refuse_if!(
            reserve <= 0.0,
            "the largest gain over frequency is not bounded. Infinitely many poles come close to \
             the imaginary axis, or cross it after small changes of the delays"
        );
        match lead.largest_ratio() {
            Some(most) => Ok(Self { most, reserve }),
            None => refuse!(
                "the largest gain at high frequencies is not known, because the highest power of \
                 s has several delays in numerator and denominator. Add the roll-off that the \
                 real system has"
            ),
        }
    }
}

struct OnAxis {
    n: QuasiPolynomial,
    d: QuasiPolynomial,
    far: Far,
}

impl OnAxis {
    /// A frequency beyond which |n| < `level` |d|.
    fn end(&self, level: f64) -> f64 {
        let top = 2 * self.d.degree();
        let mut lower = vec![0.0; top];
        for (h, factor) in [(&self.n, 1.0), (&self.d, level * level)] {
            let sum = TwoSided::of(h);
            for row in sum.times(&sum.mirrored()).rows {
                for (size, value) in lower.iter_mut().zip(&row.values) {
                    *size += factor * value.abs();
                }
            }
        }
        let Far { most, reserve } = self.far;
        fujiwara(&lower, (level - most) * (level + most) * reserve * reserve)
    }
}

impl Modulus for OnAxis {
    fn at(&self, omega: f64) -> f64 {
        let found = modulus(ratio_at(&self.n, &self.d, Complex64::new(0.0, omega)));
        if found.is_nan() { 0.0 } else { found }
    }

    fn reaching(&self, level: f64, task: &Task) -> Result<(Vec<f64>, f64), Error> {
        let scaled = self.d.scale(level)?;
        let mut excess = DifferenceOfSquares::new(&scaled, &self.n);
        let top = excess.last_zero().min(self.end(level));
        let zeros = zeros_between(&mut excess, 0.0, top, task)?;
        Ok((zeros, top))
    }
}
