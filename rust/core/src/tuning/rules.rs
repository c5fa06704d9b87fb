//! Rules of thumb for PI and PID control, from a lag and a dead time that stand in for the plant.
//!
//! * SIMC (Skogestad 2003, Journal of Process Control 13, equations 23 to 25, with τc = θ), from the
//!   reduction by the half rule (equations 10 and 11) with the rules T1 to T3 for zeros.
//! * AMIGO (Åström and Hägglund 2004, Journal of Process Control 14, 635–650), and Ziegler and Nichols
//!   (1942, Transactions of the ASME 64) by the step response, from the tangent at its steepest slope
//!   and the time to 63 %; by the frequency response, from critical gain and period.
//! * λ-tuning (Åström and Hägglund 2006, Advanced PID Control, chapter 6) from the model of SIMC for
//!   PI, the closed loop as slow as the plant or three dead times; it is PI control.
//!
//! A plant with one integrator has the slope k′ in the place of k/τ.

use num_complex::Complex64;

use super::demands::margins_of;
use super::open::Scale;
use super::responses::{figures, overshoot, steepest};
use crate::frequency::{first_term, small_roots};
use crate::loops::{ControlLoop, Drive, Kind, Place};
use crate::quasipoly::QuasiPolynomial;
use crate::{Error, Task};

/// Damping ratio below which two poles count as no two lags: for less the rules do not hold.
const DAMPED: f64 = 0.5;

/// Poles slower than this part of the fastest one are integrators.
const INTEGRATOR: f64 = 1e-9;

/// Dead times of a loop closed by λ-tuning at least.
const LAMBDA: f64 = 3.0;

/// k e^(−θ s)/((τ₁ s + 1)(τ₂ s + 1)), or k e^(−θ s)/(s (τ₂ s + 1)) where τ₁ is infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reduced {
    /// k: the steady gain, or the slope k′ of a plant with an integrator.
    pub gain: f64,
    /// τ₁, s.
    pub lag: f64,
    /// τ₂, s.
    pub second: f64,
    /// θ, s.
    pub dead_time: f64,
}

/// Gains by one rule, and what they give.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The name of the rule.
    pub rule: &'static str,
    /// Kp, Ki and Kd as far as the controller has them; none where the rule does not apply.
    pub gains: Option<Vec<f64>>,
    /// Ms; NaN of a loop that is not stable.
    pub max_sensitivity: f64,
    /// Integral of the modulus of the output after a unit load.
    pub load_iae: f64,
    /// Of a step of the reference, s and %.
    pub settling_time: f64,
    /// See above.
    pub overshoot: f64,
}

/// k, Ti and Td of u = k (e + ∫e/Ti + Td e′).
type Ideal = (f64, f64, f64);

/// A line for the given gains of the loop, and one for each rule for its controller.
///
/// # Errors
/// Those that end all work; [`Error::Argument`] for a plant without polynomials.
pub fn rules(of: &ControlLoop, task: &Task) -> Result<Vec<Row>, Error> {
    let kind = of.controller().kind;
    let own = of.values().controller.iter().take(kind.gains().len());
    let mut found = vec![row("given", of, Some(own.copied().collect()), task)?];
    if !matches!(kind, Kind::PI | Kind::PID) {
        return Ok(found);
    }
    let with_derivative = kind == Kind::PID;
    let (first, second) = (reduced(of, false)?, reduced(of, true)?);
    let step = tangent(of, first, task)?;
    let critical = Scale::critical(of, task)?;
    let simc = if with_derivative { second } else { first };
    let each: [(&'static str, Option<Ideal>); 5] = [
        ("SIMC", simc.map(by_simc)),
        ("AMIGO", step.map(|plant| by_amigo(plant, with_derivative))),
        ("lambda", first.map(by_lambda)),
        (
            "Ziegler-Nichols step",
            step.map(|plant| by_step(plant, with_derivative)),
        ),
        (
            "Ziegler-Nichols frequency",
            critical.map(|(gain, period)| by_frequency(gain, period, with_derivative)),
        ),
    ];
    // Rules know no weight of the reference.
    let plain = match of.place("weight") {
        Ok(place) => of.with_number(place, 1.0),
        Err(_) => of.clone(),
    };
    for (rule, ideal) in each {
        let gains = ideal.map(|(k, ti, td)| {
            let all = [k, k / ti, k * td];
            all.into_iter().take(kind.gains().len()).collect::<Vec<_>>()
        });
        let gains = gains.filter(|gains| gains.iter().all(|gain| gain.is_finite()));
        found.push(row(rule, &plain, gains, task)?);
    }
    Ok(found)
}

fn row(
    rule: &'static str,
    of: &ControlLoop,
    gains: Option<Vec<f64>>,
    task: &Task,
) -> Result<Row, Error> {
    let mut made = Row {
        rule,
        gains,
        max_sensitivity: f64::NAN,
        load_iae: f64::NAN,
        settling_time: f64::NAN,
        overshoot: f64::NAN,
    };
    let Some(gains) = &made.gains else {
        return Ok(made);
    };
    let pairs = gains.iter().enumerate();
    let of = pairs.fold(of.clone(), |made, (place, gain)| {
        made.with_number(Place::Controller(place), *gain)
    });
    let margins = match margins_of(&of, false, task) {
        Err(error) if error.ends_all() => return Err(error),
        found => found.ok(),
    };
    let Some(margins) = margins.filter(|margins| margins.stable) else {
        return Ok(made);
    };
    made.max_sensitivity = margins.peaks.sensitivity.value;
    if let Some(load) = figures(&of, Drive::Load, task)? {
        made.load_iae = load.deviation.iae;
    }
    if let Some(step) = figures(&of, Drive::Reference, task)? {
        made.settling_time = step.deviation.recovery_time;
        made.overshoot = overshoot(&of, step.span, task)?;
    }
    Ok(made)
}

/// The plant of a loop by the half rule, with one lag or two; none for one with unstable or badly damped
/// poles, or two integrators. Half a sample counts as dead time (Skogestad 2003, equation 10).
///
/// # Errors
/// [`Error::Argument`] for a plant without polynomials.
pub fn reduced(of: &ControlLoop, with_second: bool) -> Result<Option<Reduced>, Error> {
    let Some((gain, integrators, mut lags, zeros)) = factors(of)? else {
        return Ok(None);
    };
    let values = of.values();
    let mut dead = values.delay + 0.5 * values.sample_time.unwrap_or(0.0);
    dead -= zeros.iter().filter(|zero| **zero < 0.0).sum::<f64>();
    lags.sort_by(|x, y| y.total_cmp(x));
    if integrators == 1 {
        lags.insert(0, f64::INFINITY);
    }
    let mut gain = gain;
    let mut leads: Vec<f64> = zeros.into_iter().filter(|zero| *zero > 0.0).collect();
    leads.sort_by(|x, y| y.total_cmp(x));
    for lead in leads {
        gain *= cancelled(lead, &mut lags, dead);
    }
    let kept = usize::from(with_second) + 1;
    let lag = |place: usize| lags.get(place).copied().unwrap_or(0.0);
    let rest: f64 = lags.iter().skip(kept + 1).sum();
    let half = 0.5 * lag(kept);
    let mut first = lag(0);
    let mut second = if with_second { lag(1) + half } else { 0.0 };
    if !with_second {
        // An integrator takes no half of a lag.
        first += half;
    }
    if first == 0.0 {
        (first, second) = (second, 0.0);
    }
    let dead_time = dead + half + rest;
    Ok((dead_time > 0.0).then_some(Reduced {
        gain,
        lag: first,
        second,
        dead_time,
    }))
}

/// Take a zero (T s + 1) against a lag, by the rules T1 to T3; the factor on the gain.
fn cancelled(lead: f64, lags: &mut Vec<f64>, dead: f64) -> f64 {
    let larger = lags.iter().rposition(|lag| lag.is_finite() && *lag >= lead);
    let Some(place) = larger.or_else(|| lags.iter().position(|lag| lag.is_finite())) else {
        return 1.0;
    };
    let lag = lags.remove(place);
    if lead >= lag {
        return if lag >= dead {
            lead / lag
        } else if lead >= dead {
            lead / dead
        } else {
            1.0
        };
    }
    if lead >= 5.0 * dead {
        return lead / lag;
    }
    let near = lag.min(5.0 * dead);
    if near > lead {
        lags.insert(place, near - lead);
        lags.sort_by(|x, y| y.total_cmp(x));
    }
    near / lag
}

/// Gain, integrators, lags and zeros (T of T s + 1) of a plant.
type Factors = (f64, u32, Vec<f64>, Vec<f64>);

fn factors(of: &ControlLoop) -> Result<Option<Factors>, Error> {
    let (n, d) = of.plant_ratio()?;
    let ((above, zeros), (below, poles)) = (first_term(&n), first_term(&d));
    if zeros > poles || poles - zeros > 1 || n.delays().len() > 1 || d.delays().len() > 1 {
        return Ok(None);
    }
    let times = |row: &[f64]| -> Option<Vec<f64>> {
        let row: Vec<Complex64> = row.iter().map(|c| Complex64::from(*c)).collect();
        let roots = small_roots(&row);
        let fastest = roots
            .iter()
            .fold(0.0f64, |most, root| most.max(root.norm()));
        let mut found = Vec::new();
        for root in roots {
            let size = root.norm();
            if size <= INTEGRATOR * fastest {
                continue;
            }
            if root.im.abs() > 1e-4 * size && root.re.abs() < DAMPED * size {
                return None;
            }
            found.push(-root.re.signum() / size);
        }
        Some(found)
    };
    let row = |h: &QuasiPolynomial| {
        let rest = h.without_powers(h.powers_of_s());
        rest.coefficients().first().cloned().unwrap_or_default()
    };
    let (Some(leads), Some(lags)) = (times(&row(&n)), times(&row(&d))) else {
        return Ok(None);
    };
    if lags.iter().any(|lag| *lag < 0.0) {
        return Ok(None);
    }
    Ok(Some((above / below, poles - zeros, lags, leads)))
}

/// Lag and dead time from the steepest tangent of the step response and the time to 63 %.
fn tangent(
    of: &ControlLoop,
    known: Option<Reduced>,
    task: &Task,
) -> Result<Option<Reduced>, Error> {
    let Some(known) = known else {
        return Ok(None);
    };
    let is_integrating = known.lag == f64::INFINITY;
    let values = of.values();
    let wait = values.delay + 0.5 * values.sample_time.unwrap_or(0.0);
    let found = steepest(of, is_integrating, task)?;
    Ok(found.map(|(slope, dead, reached)| Reduced {
        gain: if is_integrating { slope } else { known.gain },
        lag: if is_integrating {
            f64::INFINITY
        } else {
            reached - dead
        },
        second: 0.0,
        dead_time: dead + wait,
    }))
}

/// Equations 23 to 25 with τc = θ, of the series form, in the ideal one.
fn by_simc(plant: Reduced) -> Ideal {
    let Reduced {
        gain,
        lag,
        second,
        dead_time,
    } = plant;
    let closed = 2.0 * dead_time;
    let k = if lag.is_finite() {
        lag / gain
    } else {
        1.0 / gain
    } / closed;
    let ti = lag.min(4.0 * closed);
    // Without a lag an integral alone remains: k/Ti = 1/(gain (τc + θ)).
    if ti == 0.0 {
        let small = 1e-6 * dead_time;
        return (small / (gain * closed), small, 0.0);
    }
    (
        k * (1.0 + second / ti),
        ti + second,
        ti * second / (ti + second),
    )
}

fn by_amigo(plant: Reduced, with_derivative: bool) -> Ideal {
    let Reduced {
        gain,
        lag: t,
        dead_time: l,
        ..
    } = plant;
    if t.is_infinite() {
        return if with_derivative {
            (0.45 / (gain * l), 8.0 * l, 0.5 * l)
        } else {
            (0.35 / (gain * l), 13.4 * l, 0.0)
        };
    }
    if with_derivative {
        return (
            (0.2 + 0.45 * t / l) / gain,
            (0.4 * l + 0.8 * t) / (l + 0.1 * t) * l,
            0.5 * l * t / (0.3 * l + t),
        );
    }
    let sum = l + t;
    (
        (0.15 + (0.35 - l * t / (sum * sum)) * t / l) / gain,
        0.35 * l + 13.0 * l * t * t / (t * t + 12.0 * l * t + 7.0 * l * l),
        0.0,
    )
}

fn by_lambda(plant: Reduced) -> Ideal {
    let Reduced {
        gain,
        lag,
        dead_time,
        ..
    } = plant;
    let closed = LAMBDA * dead_time;
    if lag.is_infinite() {
        let ti = 2.0 * closed + dead_time;
        let sum = closed + dead_time;
        return (ti / (gain * sum * sum), ti, 0.0);
    }
    let closed = closed.max(lag);
    let ti = lag.max(1e-6 * dead_time);
    (ti / (gain * (closed + dead_time)), ti, 0.0)
}

fn by_step(plant: Reduced, with_derivative: bool) -> Ideal {
    let Reduced {
        gain,
        lag,
        dead_time,
        ..
    } = plant;
    let slope = if lag.is_infinite() { gain } else { gain / lag };
    let a = slope * dead_time;
    if with_derivative {
        (1.2 / a, 2.0 * dead_time, 0.5 * dead_time)
    } else {
        (0.9 / a, 3.0 * dead_time, 0.0)
    }
}

fn by_frequency(gain: f64, period: f64, with_derivative: bool) -> Ideal {
    if with_derivative {
        (0.6 * gain, 0.5 * period, 0.125 * period)
    } else {
        (0.45 * gain, period / 1.2, 0.0)
    }
}
