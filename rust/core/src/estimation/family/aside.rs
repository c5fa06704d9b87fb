//! Inputs beside the command, and steps of the output, each times one number.

/// Something that adds to the output of one record.
#[derive(Debug, Clone)]
pub(super) enum Aside {
    /// A signal at the input of the plant: its times, its values less the first one.
    Input {
        /// Times, s.
        sent: Vec<f64>,
        /// Values less the first one.
        value: Vec<f64>,
        /// Is it straight between them, or held?
        straight: bool,
    },
    /// The difference of two signals at the input of the plant, times a factor.
    Difference(Signal, Signal, f64),
    /// The slope over the largest slope of the lag's output, from a change by this share.
    Slope(f64),
    /// A step of the output from this time on.
    Step(f64),
    /// A delay that is longer by a half after this time, and shorter before it.
    Later(f64),
}

/// A signal at the input of the plant.
#[derive(Debug, Clone)]
pub(super) struct Signal {
    /// Times, s.
    pub(super) sent: Vec<f64>,
    /// Values.
    pub(super) value: Vec<f64>,
    /// Is it straight between them, or held?
    pub(super) straight: bool,
}

impl Signal {
    /// What it has more than another one, times a factor; as one signal where the plant is linear.
    pub(super) fn less(self, other: Self, factor: f64, is_linear: bool) -> Aside {
        if !is_linear || self.sent != other.sent || self.straight != other.straight {
            return Aside::Difference(self, other, factor);
        }
        let pairs = self.value.iter().zip(&other.value);
        let value = pairs.map(|(one, other)| factor * (one - other)).collect();
        Aside::input(self.sent, value, self.straight)
    }
}

impl Aside {
    /// A signal at the input of the plant.
    pub(super) fn input(sent: Vec<f64>, mut value: Vec<f64>, straight: bool) -> Self {
        let first = value.first().copied().unwrap_or(0.0);
        value.iter_mut().for_each(|entry| *entry -= first);
        Self::Input {
            sent,
            value,
            straight,
        }
    }
}
