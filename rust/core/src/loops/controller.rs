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
//!
//! The reference may enter with weights, Kp (b r − y) and Kd H (c r − y), and past the controller with a
//! gain of feed-forward (Åström and Hägglund, Advanced PID Control, 2006, section 3.4).

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

/// Numbers that a controller may have besides its gains and its filter, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extra {
    /// Weight b of the reference in the proportional term.
    Weight,
    /// Weight c of the reference in the derivative.
    DerivativeWeight,
    /// Gain of the reference past the controller.
    FeedForward,
    /// Time constant of back-calculation, s.
    TrackingTime,
}

impl Extra {
    const ALL: [(Self, &'static str); 4] = [
        (Self::Weight, "weight"),
        (Self::DerivativeWeight, "derivative_weight"),
        (Self::FeedForward, "feed_forward"),
        (Self::TrackingTime, "tracking_time"),
    ];

    /// The number of a name, such as `weight`.
    pub fn named(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find_map(|(extra, own)| (own == name).then_some(extra))
    }
}

/// Which of these numbers a controller has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Extras(u8);

impl Extras {
    /// With one more.
    #[must_use]
    pub fn with(self, extra: Extra) -> Self {
        Self(self.0 | 1 << extra as u8)
    }

    fn has(self, extra: Extra) -> bool {
        self.0 & 1 << extra as u8 != 0
    }

    /// How many they are.
    fn count(self) -> usize {
        self.0.count_ones() as usize
    }

    /// The place of one among them.
    fn place(self, extra: Extra) -> Option<usize> {
        let before = self.0 & ((1 << extra as u8) - 1);
        self.has(extra).then_some(before.count_ones() as usize)
    }

    /// Their names.
    fn names(self) -> impl Iterator<Item = &'static str> {
        let all = Extra::ALL.into_iter();
        all.filter_map(move |(extra, name)| self.has(extra).then_some(name))
    }
}

/// A controller without its numbers: its gains, of a filter ω and ζ, and the extra ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Controller {
    /// Which terms it has.
    pub kind: Kind,
    /// Is the derivative filtered?
    pub is_filtered: bool,
    /// How the filter runs where the loop is sampled; none: continuous before the sampler.
    pub rule: Option<Rule>,
    /// Which further numbers there are.
    pub extras: Extras,
    /// Does the integral stop while it would drive the command further out of its bounds?
    pub stops: bool,
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
        self.kind.gains().len() + 2 * usize::from(self.is_filtered) + self.extras.count()
    }

    /// The names of its numbers, in their order.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        let filter = ["omega", "damping"].into_iter();
        let own = self.kind.gains().iter().copied();
        own.chain(filter.filter(|_| self.is_filtered))
            .chain(self.extras.names())
    }

    /// One of the further numbers; none where there is no such.
    pub(super) fn extra<S: Entry>(&self, numbers: &[S], extra: Extra) -> Option<S> {
        let first = self.count() - self.extras.count();
        let place = self.extras.place(extra)?;
        numbers.get(first + place).cloned()
    }

    /// Gain of the reference in the command, past integral and derivative.
    fn reference_gain<S: Entry>(&self, numbers: &[S]) -> S {
        let mut gain = self.terms(numbers).p;
        if let Some(weight) = self.extra(numbers, Extra::Weight) {
            gain = gain * weight;
        }
        match self.extra(numbers, Extra::FeedForward) {
            Some(feed) => gain + feed,
            None => gain,
        }
    }

    /// Weight of the reference in what the derivative sees.
    pub(super) fn derivative_weight<S: Entry>(&self, numbers: &[S]) -> S {
        if !self.kind.derivative_of_error() {
            return S::from(0.0);
        }
        let weight = self.extra(numbers, Extra::DerivativeWeight);
        weight.unwrap_or_else(|| S::from(1.0))
    }

    /// The gain with which the excess of the command acts on the integral of the error, 1/(Tt Ki); none
    /// without back-calculation, or without an integral.
    pub(super) fn tracking<S: Number>(&self, numbers: &[S]) -> Option<S> {
        let time = self.extra(numbers, Extra::TrackingTime)?;
        let i = self.terms(numbers).i;
        let integrates = self.kind.integrates() && !i.is_zero();
        integrates.then(|| S::from(1.0) / (time * i))
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
    pub(super) fn filter<S: Entry>(&self, numbers: &[S]) -> Option<(S, S)> {
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
        let path = |p: S, d: S| {
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
        let of_error = d.clone() * self.derivative_weight(numbers);
        Paths {
            f: path(p, d),
            r: path(self.reference_gain(numbers), of_error),
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
        let on_error = self.derivative_weight(numbers);
        let integrals = usize::from(self.kind.integrates());
        let size = integrals + 2 * usize::from(self.is_filtered);
        let mut made = ControllerEquations {
            a: vec![zero.clone(); size * size],
            b: Vec::with_capacity(size),
            e: Vec::with_capacity(size),
            c: Vec::with_capacity(size),
            p: -p.clone(),
            q: zero.clone(),
            m: self.reference_gain(numbers),
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
                made.m = made.m - on_error * direct;
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
                // What weights and feed-forward add to the gain of the error.
                let fed = self.reference_gain(numbers) - p.clone();
                let of_error = p * S::from(reference - output) + fed * S::from(reference);
                (command.clone() - of_error) / i
            });
        }
        if self.is_filtered {
            let seen = S::from(output) - self.derivative_weight(numbers) * S::from(reference);
            states.extend([seen, S::from(0.0)]);
        }
        states
    }
}
