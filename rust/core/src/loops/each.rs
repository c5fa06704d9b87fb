//! One number for each of many loops.

use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::Arc;

use super::entry::{Entry, Number};

/// One number for all loops, or one for each. Zero and one, of which matrices are full, cost nothing.
#[derive(Debug, Clone, PartialEq)]
pub enum Each {
    /// For all.
    Shared(f64),
    /// For each.
    Own(Arc<[f64]>),
}

impl Each {
    /// One number, or one for each.
    pub fn numbers(&self) -> &[f64] {
        match self {
            Self::Shared(number) => std::slice::from_ref(number),
            Self::Own(numbers) => numbers,
        }
    }

    fn is(&self, number: f64) -> bool {
        matches!(self, Self::Shared(own) if *own == number)
    }

    fn with(self, other: Self, operation: impl Fn(f64, f64) -> f64) -> Self {
        match (self, other) {
            (Self::Shared(x), Self::Shared(y)) => Self::Shared(operation(x, y)),
            (Self::Shared(x), Self::Own(y)) => {
                Self::Own(y.iter().map(|y| operation(x, *y)).collect())
            }
            (Self::Own(x), Self::Shared(y)) => {
                Self::Own(x.iter().map(|x| operation(*x, y)).collect())
            }
            (Self::Own(x), Self::Own(y)) => Self::Own(
                x.iter()
                    .zip(y.iter())
                    .map(|(x, y)| operation(*x, *y))
                    .collect(),
            ),
        }
    }
}

impl From<f64> for Each {
    fn from(number: f64) -> Self {
        Self::Shared(number)
    }
}

impl From<Vec<f64>> for Each {
    fn from(numbers: Vec<f64>) -> Self {
        match numbers[..] {
            [number] => Self::Shared(number),
            _ => Self::Own(numbers.into()),
        }
    }
}

impl Add for Each {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        match (self.is(0.0), other.is(0.0)) {
            (_, true) => self,
            (true, _) => other,
            _ => self.with(other, |x, y| x + y),
        }
    }
}

impl Sub for Each {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        match (self.is(0.0), other.is(0.0)) {
            (_, true) => self,
            (true, _) => -other,
            _ => self.with(other, |x, y| x - y),
        }
    }
}

impl Mul for Each {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        match (&self, &other) {
            _ if self.is(0.0) || other.is(0.0) => Self::Shared(0.0),
            _ if other.is(1.0) => self,
            _ if self.is(1.0) => other,
            _ => self.with(other, |x, y| x * y),
        }
    }
}

impl Div for Each {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        if other.is(1.0) {
            self
        } else {
            self.with(other, |x, y| x / y)
        }
    }
}

impl Neg for Each {
    type Output = Self;

    fn neg(self) -> Self {
        match self {
            Self::Shared(number) => Self::Shared(-number),
            Self::Own(numbers) => Self::Own(numbers.iter().map(|x| -x).collect()),
        }
    }
}

impl Entry for Each {
    fn is_zero(&self) -> bool {
        self.numbers().iter().all(|number| *number == 0.0)
    }
}

impl Number for Each {}
