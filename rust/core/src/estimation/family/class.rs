//! The classes of plants: k (1 + z s) e^(−T s) / (s^i (q s² + p s + 1)).
//!
//! Two lags and a pair of complex poles are one class, by the sum p and the product q of the time
//! constants, so that nothing ends where the poles meet.

use super::tolerances::STARTS;

/// A class of plants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Class {
    /// Does the plant integrate?
    pub integrating: bool,
    /// Lags beside the integrator.
    pub order: usize,
    /// Has it a zero?
    pub has_zero: bool,
}

/// Every class and its name, each after those that it contains.
const CLASSES: [(&str, Class); 9] = [
    ("delay", class(false, 0, false)),
    ("integrator", class(true, 0, false)),
    ("lag", class(false, 1, false)),
    ("integrator, lag", class(true, 1, false)),
    ("integrator, lag, zero", class(true, 1, true)),
    ("two lags", class(false, 2, false)),
    ("two lags, zero", class(false, 2, true)),
    ("integrator, two lags", class(true, 2, false)),
    ("integrator, two lags, zero", class(true, 2, true)),
];

const fn class(integrating: bool, order: usize, has_zero: bool) -> Class {
    Class {
        integrating,
        order,
        has_zero,
    }
}

impl Class {
    /// All classes, each after those that it contains.
    pub fn all() -> impl Iterator<Item = Self> {
        CLASSES.iter().map(|(_, class)| *class)
    }

    /// The class of this name.
    pub fn named(name: &str) -> Option<Self> {
        let found = CLASSES.iter().find(|(own, _)| *own == name);
        found.map(|(_, class)| *class)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        let found = CLASSES.iter().find(|(_, class)| *class == self);
        found.map_or("", |(name, _)| name)
    }

    /// The names of its numbers, the gain second.
    pub fn numbers(self) -> Vec<&'static str> {
        let mut names = vec!["delay", "gain"];
        match self.order {
            0 => {}
            1 => names.push("lag"),
            _ => names.extend(["lag_sum", "lag_product"]),
        }
        if self.has_zero {
            names.push("zero");
        }
        names
    }

    /// The gain and the other numbers, of values in the order of these names.
    pub fn of_values(self, values: &[f64]) -> (f64, Numbers) {
        let names = self.numbers();
        let at = |name: &str| {
            let place = names.iter().position(|own| *own == name);
            place
                .and_then(|place| values.get(place))
                .copied()
                .unwrap_or(0.0)
        };
        let numbers = Numbers {
            delay: at("delay"),
            sum: at("lag") + at("lag_sum"),
            product: at("lag_product"),
            zero: at("zero"),
        };
        (at("gain"), numbers)
    }

    /// Is the other class this one with lags of zero, or none of its zero?
    pub(super) fn contains(self, other: Self) -> bool {
        self.integrating == other.integrating
            && self.order >= other.order
            && (self.has_zero || !other.has_zero)
    }

    /// Can a search of the other class start at the numbers of this one? An integrator may be a slow lag.
    pub(super) fn leads_to(self, other: Self) -> bool {
        let poles = |one: Self| one.order + usize::from(one.integrating);
        self == other
            || poles(self) <= poles(other)
                && self.integrating >= other.integrating
                && self.has_zero <= other.has_zero
    }

    /// How many starts or minima: those given, or more where only the delay is searched.
    pub(super) fn starts(self, given: usize) -> usize {
        if self.order == 0 {
            STARTS.delays_only
        } else {
            given
        }
    }

    /// How many numbers are searched: all but the gain.
    pub(super) fn searched(self) -> usize {
        1 + self.order + usize::from(self.has_zero)
    }
}

/// The numbers of a plant that are searched, s and s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers {
    /// T.
    pub delay: f64,
    /// p, the sum of the time constants.
    pub sum: f64,
    /// q, their product.
    pub product: f64,
    /// z.
    pub zero: f64,
}

impl Numbers {
    /// A delay alone.
    pub(super) const fn of_delay(delay: f64) -> Self {
        Self {
            delay,
            sum: 0.0,
            product: 0.0,
            zero: 0.0,
        }
    }

    /// A number by its name.
    pub(super) fn named(&self, name: &str) -> f64 {
        match name {
            "delay" => self.delay,
            "lag" | "lag_sum" => self.sum,
            "lag_product" => self.product,
            _ => self.zero,
        }
    }

    /// The slower lag, or that of a pair of poles.
    pub(super) fn lag(&self) -> f64 {
        self.lags().first().copied().unwrap_or(0.5 * self.sum)
    }

    /// The equivalent delay as ω → 0: delay and lags, less the zero.
    pub(super) fn low_delay(&self) -> f64 {
        self.delay + self.sum - self.zero
    }

    /// The same without a zero that leads.
    pub(super) fn latest(&self) -> f64 {
        self.delay + self.sum - self.zero.min(0.0)
    }

    /// Are the poles a complex pair?
    pub fn are_complex(&self) -> bool {
        self.sum * self.sum < 4.0 * self.product
    }

    /// Frequency and damping of a pair of complex poles.
    pub fn pair(&self) -> Option<(f64, f64)> {
        let root = self.product.sqrt();
        self.are_complex()
            .then(|| (1.0 / root, 0.5 * self.sum / root))
    }

    /// The real time constants, largest first.
    pub fn lags(&self) -> Vec<f64> {
        if self.are_complex() || self.sum <= 0.0 {
            return Vec::new();
        }
        if self.product <= 0.0 {
            return vec![self.sum];
        }
        let root = (self.sum * self.sum - 4.0 * self.product).sqrt();
        let largest = 0.5 * (self.sum + root);
        vec![largest, self.product / largest]
    }
}
