//! What a linear plant may lack: its kind, its size, when it began.

/// A kind of cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CauseKind {
    /// A load at the input of the plant from some row on, in units of the command.
    Load,
    /// A step of the measured output at some row.
    OutputStep,
    /// The delay changes by this at some row, s.
    DelayChange,
    /// A command within ± the size does nothing.
    DeadZone,
    /// An actuator with play of this width between it and the plant.
    Play,
    /// An actuator that moves only when the command is this far from it, and then all of the way.
    Stiction,
    /// A command is not above this.
    UpperLimit,
    /// A command is not below minus this.
    LowerLimit,
    /// What reaches the plant changes by at most this in a second.
    RateLimit,
    /// The output of the plant's lag changes by at most this in a second, in units of the command.
    SlopeLimit,
    /// A force against the motion, by its square.
    Drag,
    /// The gain changes by this share over the record.
    GainRamp,
    /// The gain changes by this share over the range of the output.
    GainByLevel,
    /// Commands arrive at times that scatter by this, s.
    Jitter,
}

impl CauseKind {
    /// All that are columns beside a plant.
    pub(super) const ALL: [Self; 13] = [
        Self::Load,
        Self::OutputStep,
        Self::DelayChange,
        Self::DeadZone,
        Self::Play,
        Self::Stiction,
        Self::UpperLimit,
        Self::LowerLimit,
        Self::RateLimit,
        Self::SlopeLimit,
        Self::Drag,
        Self::GainRamp,
        Self::GainByLevel,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::OutputStep => "output step",
            Self::DelayChange => "delay change",
            Self::DeadZone => "dead zone",
            Self::Play => "play",
            Self::Stiction => "stiction",
            Self::UpperLimit => "upper limit",
            Self::LowerLimit => "lower limit",
            Self::RateLimit => "rate limit",
            Self::SlopeLimit => "slope limit",
            Self::Drag => "drag",
            Self::GainRamp => "gain ramp",
            Self::GainByLevel => "gain by level",
            Self::Jitter => "jitter",
        }
    }

    /// Does it begin at some row?
    pub(super) fn begins(self) -> bool {
        matches!(self, Self::Load | Self::OutputStep | Self::DelayChange)
    }

    /// Is its size a number of the command's transformation?
    pub(super) fn is_passed(self) -> bool {
        matches!(
            self,
            Self::DeadZone | Self::Play | Self::Stiction | Self::UpperLimit | Self::LowerLimit
        ) || self.limits_slope()
    }

    /// Does it limit a slope?
    pub(super) fn limits_slope(self) -> bool {
        matches!(self, Self::RateLimit | Self::SlopeLimit)
    }

    /// Is its size above zero?
    pub(super) fn is_positive(self) -> bool {
        self.is_passed() || self == Self::Drag
    }

    /// Does it depend on where the actuator was at first?
    pub(super) fn remembers(self) -> bool {
        matches!(self, Self::Play | Self::Stiction)
    }

    /// How many columns it has, that of its size last; of a load the other is that of its time.
    pub(super) fn columns(self) -> usize {
        1 + usize::from(self.remembers() || self == Self::Load)
    }

    /// How many numbers it needs.
    pub(super) fn parameters(self) -> usize {
        1 + usize::from(self.remembers() || self.begins())
    }
}

/// A cause that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Cause {
    /// Its kind.
    pub kind: CauseKind,
    /// Its size.
    pub size: f64,
    /// The standard error of the size.
    pub error: f64,
    /// When it began, s, NaN where it was there all the time.
    pub time: f64,
    /// The record in which it began.
    pub record: usize,
    /// BIC by which the record is explained better with it.
    pub lead: f64,
    /// Is it worth a name?
    pub named: bool,
    /// Others that explain the records about as well.
    pub rivals: Vec<CauseKind>,
}
