//! Inputs besides the reference, and how they act on a loop.

/// An input besides the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// A further reference, which is not held between samples.
    Reference,
    /// Added to the command where it reaches the plant.
    Load,
    /// Added to the output.
    Output,
    /// Added to the output that the controller sees.
    Noise,
}

impl Drive {
    /// The input of a name: `reference`, `load`, `output` or `noise`.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "reference" => Some(Self::Reference),
            "load" => Some(Self::Load),
            "output" => Some(Self::Output),
            "noise" => Some(Self::Noise),
            _ => None,
        }
    }

    /// Is it delayed with the output where the delay is in the measurement?
    pub fn is_at_plant(self) -> bool {
        matches!(self, Self::Load | Self::Output)
    }
}

/// How an input acts.
#[derive(Debug, Clone, Default)]
pub(super) struct Column {
    /// On x′.
    pub(super) states: Vec<f64>,
    /// On u.
    pub(super) command: f64,
    /// On y.
    pub(super) output: f64,
    /// On what the controller sees of y.
    pub(super) seen: f64,
    /// Weight of the impulse in u where it jumps.
    pub(super) impulse: f64,
}

/// How the inputs of a loop act.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    pub(super) reference: Column,
    pub(super) load: Column,
    /// Of what the controller sees of the output.
    pub(super) seen: Column,
}

impl Columns {
    pub(super) fn of(&self, drive: Drive) -> Column {
        match drive {
            Drive::Reference => self.reference.clone(),
            Drive::Load => self.load.clone(),
            Drive::Noise => self.seen.clone(),
            Drive::Output => Column {
                output: 1.0,
                ..self.seen.clone()
            },
        }
    }
}
