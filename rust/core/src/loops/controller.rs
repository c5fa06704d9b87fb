//! Controllers: what turns the reference r and the measured output y into the command u.
//!
//! Each is linear in its gains and is known in two forms: as polynomials, u = R(s) r − F(s) y, for
//! characteristic functions, and as equations
//!
//! ```text
//! x′ = A x + B y + E r,   u = C x + p y + q y′ + M r,
//! ```
//!
//! for simulation. The derivative is either ideal, H(s) = s, or filtered, H(s) = ω² s/(s² + 2 ζ ω s +
//! ω²). In a sampled loop the filter and the integrator stay continuous and are sampled with the rest,
//! unless the filter runs on samples itself ([`Rule`]).

use super::entry::{Entry, Number};
use super::filter::{Rule, Sampled, SampledFilter};
use super::polynomial::{product, scaled, sum};

/// Which terms there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Kp (r − y).
    P,
    /// Kp (r − y) − Kv H y.
    PV,
    /// Kp (r − y) + Kd H (r − y).
    PD,
    /// Kp (r − y) + Ki ∫(r − y).
    PI,
    /// Kp (r − y) + Ki ∫(r − y) + Kd H (r − y).
    PID,
}

impl Kind {
    /// The kind of a name, such as `PI`.
    pub fn named(name: &str) -> Option<Self> {
        [Self::P, Self::PV, Self::PD, Self::PI, Self::PID]
            .into_iter()
            .find(|kind| format!("{kind:?}") == name)
    }

    /// The names of the gains.
    pub fn gains(self) -> &'static [&'static str] {
        match self {
            Self::P => &["Kp"],
            Self::PV => &["Kp", "Kv"],
            Self::PD => &["Kp", "Kd"],
            Self::PI => &["Kp", "Ki"],
            Self::PID => &["Kp", "Ki", "Kd"],
        }
    }

    /// Is there an integral?
    pub fn integrates(self) -> bool {
        matches!(self, Self::PI | Self::PID)
    }

    /// Is there a derivative?
    pub fn differentiates(self) -> bool {
        matches!(self, Self::PV | Self::PD | Self::PID)
    }

    /// Is the derivative that of the error, not of the output alone?
    pub fn derivative_of_error(self) -> bool {
        matches!(self, Self::PD | Self::PID)
    }
}

/// A controller without its numbers, which are its gains and, of a filter, ω and ζ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Controller {
    /// Which terms it has.
    pub kind: Kind,
    /// Is the derivative filtered?
    pub is_filtered: bool,
    /// How the filter runs where the loop is sampled; none: continuous before the sampler.
    pub rule: Option<Rule>,
}

/// u = p (r − y) + i ∫(r − y) − d H y, or + d H (r − y).
struct Terms<S> {
    p: S,
    i: S,
    d: S,
}

/// x′ = A x + B y + E r, u = C x + p y + q y′ + M r, and an impulse where r jumps.
pub(super) struct ControllerEquations<S> {
    pub(super) a: Vec<S>,
    pub(super) b: Vec<S>,
    pub(super) e: Vec<S>,
    pub(super) c: Vec<S>,
    pub(super) p: S,
    pub(super) q: S,
    pub(super) m: S,
    pub(super) impulse: S,
}

/// F = f/g and R = r/g, descending.
pub(super) struct Paths<S> {
    pub(super) f: Vec<S>,
    pub(super) r: Vec<S>,
    pub(super) g: Vec<S>,
}

impl Controller {
    /// How many numbers it has.
    pub fn count(&self) -> usize {
        self.kind.gains().len() + 2 * usize::from(self.is_filtered)
    }

    /// Does its filter run on samples in a sampled loop?
    pub fn is_discretised(&self) -> bool {
        self.is_filtered && self.rule.is_some()
    }

    fn terms<S: Entry>(&self, numbers: &[S]) -> Terms<S> {
        let gain = |place: usize| numbers.get(place).cloned().unwrap_or_else(|| S::from(0.0));
        let none = || S::from(0.0);
        let (i, d) = match self.kind {
            Kind::P => (none(), none()),
            Kind::PV | Kind::PD => (none(), gain(1)),
            Kind::PI => (gain(1), none()),
            Kind::PID => (gain(1), gain(2)),
        };
        Terms { p: gain(0), i, d }
    }

    /// The gains on the proportional, the integral and the derivative term.
    pub(super) fn gains_of_terms(&self, numbers: &[f64]) -> (f64, f64, f64) {
        let Terms { p, i, d } = self.terms(numbers);
        (p, i, d)
    }

    /// ω and ζ; none of an ideal derivative.
    fn filter<S: Entry>(&self, numbers: &[S]) -> Option<(S, S)> {
        let first = self.kind.gains().len();
        match (numbers.get(first), numbers.get(first + 1)) {
            (Some(omega), Some(damping)) if self.is_filtered => {
                Some((omega.clone(), damping.clone()))
            }
            _ => None,
        }
    }

    /// Numerator and denominator of the feedback for these numbers, descending.
    pub fn feedback(&self, numbers: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let Paths { f, g, .. } = self.paths(numbers);
        (f, g)
    }

    /// The polynomials of both paths.
    pub(super) fn paths<S: Entry>(&self, numbers: &[S]) -> Paths<S> {
        let Terms { p, i, d } = self.terms(numbers);
        let (zero, one) = (S::from(0.0), S::from(1.0));
        let integral = if self.kind.integrates() {
            vec![one.clone(), zero.clone()]
        } else {
            vec![one.clone()]
        };
        let (rolled_off, square) = match self.filter(numbers) {
            Some((omega, damping)) => {
                let square = omega.clone() * omega.clone();
                let middle = S::from(2.0) * (damping * omega);
                (vec![one, middle, square.clone()], Some(square))
            }
            None => (vec![one], None),
        };
        let g = product(&integral, &rolled_off);
        let path = |d: S| {
            let mut num = scaled(&p, &g);
            if self.kind.differentiates() {
                let slope = match &square {
                    Some(square) => square.clone() * d,
                    None => d,
                };
                num = sum(num, product(&integral, &[slope, zero.clone()]));
            }
            if self.kind.integrates() {
                num = sum(num, scaled(&i, &rolled_off));
            }
            num
        };
        let of_error = if self.kind.derivative_of_error() {
            d.clone()
        } else {
            zero.clone()
        };
        Paths {
            f: path(d),
            r: path(of_error),
            g,
        }
    }

    /// The equations of the states: the integral of the error first, the filter after it, its second
    /// state the derivative over ω, so that both are of one size. `sampled` is the filter on samples:
    /// between these its states hold.
    pub(super) fn equations<S: Number>(
        &self,
        numbers: &[S],
        sampled: Option<&SampledFilter<S>>,
    ) -> ControllerEquations<S> {
        let Terms { p, i, d } = self.terms(numbers);
        let (zero, one) = (S::from(0.0), S::from(1.0));
        let on_error = S::from(f64::from(u8::from(self.kind.derivative_of_error())));
        let integrals = usize::from(self.kind.integrates());
        let size = integrals + 2 * usize::from(self.is_filtered);
        let mut made = ControllerEquations {
            a: vec![zero.clone(); size * size],
            b: Vec::with_capacity(size),
            e: Vec::with_capacity(size),
            c: Vec::with_capacity(size),
            p: -p.clone(),
            q: zero.clone(),
            m: p,
            impulse: zero.clone(),
        };
        if integrals > 0 {
            made.b.push(-one.clone());
            made.e.push(one);
            made.c.push(i);
        }
        match (self.filter(numbers), sampled) {
            (Some(_), Some(sampled)) => {
                made.b.extend([zero.clone(), zero.clone()]);
                made.e.extend([zero.clone(), zero]);
                made.c.extend(sampled.c.iter().cloned());
                let direct = sampled.d.clone();
                made.p = made.p + direct.clone();
                made.m = made.m + -on_error * direct;
            }
            (Some((omega, damping)), None) => {
                let place =
                    |row: usize, column: usize| (integrals + row) * size + integrals + column;
                made.a[place(0, 1)] = omega.clone();
                made.a[place(1, 0)] = -omega.clone();
                made.a[place(1, 1)] = S::from(-2.0) * damping * omega.clone();
                made.b.extend([zero.clone(), omega.clone()]);
                // The filter sees y, or y − r for a derivative of the error.
                made.e.extend([zero.clone(), -on_error * omega.clone()]);
                made.c.extend([zero, -d * omega]);
            }
            (None, _) if self.kind.differentiates() => {
                made.q = -d;
                made.impulse = -on_error * made.q.clone();
            }
            (None, _) => {}
        }
        made
    }

    /// The filter on samples.
    ///
    /// # Errors
    /// As [`SampledFilter::new`].
    pub(super) fn sampled<S: Sampled>(
        &self,
        numbers: &[S],
        sample_time: Option<&S>,
    ) -> Result<Option<SampledFilter<S>>, crate::Error> {
        let d = self.terms(numbers).d;
        match (self.filter(numbers), self.rule, sample_time) {
            (Some((omega, damping)), Some(rule), Some(sample_time)) => {
                let zero = S::from(0.0);
                let decay = S::from(-2.0) * damping * omega.clone();
                let filter = SampledFilter::new(
                    &[zero.clone(), omega.clone(), -omega.clone(), decay],
                    &[zero.clone(), omega.clone()],
                    &[zero, -d * omega],
                    sample_time.clone(),
                    rule,
                )?;
                Ok(Some(filter))
            }
            _ => Ok(None),
        }
    }

    /// The states after a long time at constant `output` and `reference`, giving `command`. The
    /// integral takes the value at which the controller takes over without a bump.
    pub(super) fn rest<S: Number>(
        &self,
        numbers: &[S],
        output: f64,
        reference: f64,
        command: &S,
    ) -> Vec<S> {
        let Terms { p, i, .. } = self.terms(numbers);
        let mut states = Vec::new();
        if self.kind.integrates() {
            states.push(if i.is_zero() {
                S::from(0.0)
            } else {
                (command.clone() - p * S::from(reference - output)) / i
            });
        }
        if self.is_filtered {
            let seen = if self.kind.derivative_of_error() {
                output - reference
            } else {
                output
            };
            states.extend([S::from(seen), S::from(0.0)]);
        }
        states
    }
}
