//! Metrics of a step response, and the record of a response from which they follow.

/// Width of the quiet band as a share of the settling band: what remains of the band after three
/// time constants.
const QUIET_SHARE: f64 = 0.05;

/// The output must have been in the quiet band for this share of the time between entering the
/// settling band and the quiet band (a slow oscillation that passes through both stays a tenth),
/// and for at least this many delays.
const QUIET_FOR: f64 = 0.2;

const QUIET_WAITS: f64 = 3.0;

/// A response has settled if it was inside its band, with its command within the limit, for so many of
/// the slowest time constants of the loop: more misjudge fewer responses, and take longer runs.
pub(crate) const TIME_CONSTANTS: f64 = 3.0;

/// Metrics of a step response, measured between its first output and its steady state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metrics {
    /// Time from the lower to the upper level of the rise, s; NaN where a level is not reached.
    pub rise_time: f64,
    /// Time from the start after which the output stays in the band, s; NaN where it does not.
    pub settling_time: f64,
    /// Time of the output farthest from zero, s.
    pub peak_time: f64,
    /// Percent of the step.
    pub overshoot: f64,
    /// Percent of the step.
    pub undershoot: f64,
    /// Least output from the end of the rise on.
    pub settling_min: f64,
    /// Greatest output from the end of the rise on.
    pub settling_max: f64,
    /// The output farthest from zero, its modulus.
    pub peak: f64,
    /// The value that the output tends to.
    pub steady_state: f64,
}

impl Metrics {
    /// All metrics unknown.
    pub const UNKNOWN: Self = Self {
        rise_time: f64::NAN,
        settling_time: f64::NAN,
        peak_time: f64::NAN,
        overshoot: f64::NAN,
        undershoot: f64::NAN,
        settling_min: f64::NAN,
        settling_max: f64::NAN,
        peak: f64::NAN,
        steady_state: f64::NAN,
    };

    #[cfg(test)]
    pub(crate) fn from_array(fields: [f64; 9]) -> Self {
        let [
            rise_time,
            settling_time,
            peak_time,
            overshoot,
            undershoot,
            settling_min,
            settling_max,
            peak,
            steady_state,
        ] = fields;
        Self {
            rise_time,
            settling_time,
            peak_time,
            overshoot,
            undershoot,
            settling_min,
            settling_max,
            peak,
            steady_state,
        }
    }

    /// In the order of the fields.
    pub fn to_array(self) -> [f64; 9] {
        [
            self.rise_time,
            self.settling_time,
            self.peak_time,
            self.overshoot,
            self.undershoot,
            self.settling_min,
            self.settling_max,
            self.peak,
            self.steady_state,
        ]
    }
}

/// Definitions of rise and settling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Shares of the step between which the rise time is measured.
    pub rise: (f64, f64),
    /// Half width of the settling band as a share of the step.
    pub settling: f64,
}

/// The levels with which a response from `first` to `steady` is compared. Outputs change sign where
/// the step goes down, so that every step goes up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Levels {
    pub(crate) first: f64,
    pub(crate) steady: f64,
    /// 1 or −1: the direction of the step.
    pub(crate) sign: f64,
    /// Levels where the rise begins and ends, multiplied by the sign.
    pub(crate) rise: (f64, f64),
    /// Half width of the band.
    pub(crate) band: f64,
    /// Half width of the quiet band.
    pub(crate) quiet_band: f64,
}

impl Levels {
    pub(crate) fn new(first: f64, steady: f64, criteria: &Criteria) -> Self {
        let span = steady - first;
        let sign = if span < 0.0 { -1.0 } else { 1.0 };
        let at = |part: f64| sign * (first + part * span);
        Self {
            first,
            steady,
            sign,
            rise: (at(criteria.rise.0), at(criteria.rise.1)),
            band: criteria.settling * span.abs(),
            quiet_band: QUIET_SHARE * criteria.settling * span.abs(),
        }
    }
}

/// Record of a response from which its metrics follow. Times count from its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Record {
    /// Greatest output and its time.
    pub(crate) top: (f64, f64),
    /// Least output and its time.
    pub(crate) bottom: (f64, f64),
    /// Times at which the rise began and ended; NaN where it did not.
    pub(crate) risen: (f64, f64),
    /// Least and greatest output from the end of the rise on.
    pub(crate) after: (f64, f64),
    /// Time since which the output is in the band; NaN where it is outside at the end.
    pub(crate) inside_since: f64,
    /// Last time at which the output was outside the quiet band.
    pub(crate) unsettled_until: f64,
    /// Last time at which the command was at its limit; zero where it never was. Until then the time
    /// constants of the closed loop say nothing about the response.
    pub(crate) limited_until: f64,
}

/// How long a response was run, and how fast its loop may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pace {
    /// Time from the start to the end of the response.
    pub(crate) span: f64,
    /// The time after which the loop reacts to its own output.
    pub(crate) wait: f64,
    /// The slowest time constant of plant and controller.
    pub(crate) slowest: f64,
}

/// Whether a response has settled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It is outside of its band at the end.
    Outside,
    /// It is inside, but the poles of the loop have to show that it stays there.
    Doubtful,
    /// The response itself shows that it stays inside.
    Settled,
}

impl Record {
    /// For how long, up to the end of `span`, the output was in its band and the command within its
    /// limit; NaN where the output is outside at the end.
    pub(crate) fn time_inside(&self, span: f64) -> f64 {
        // The difference comes first: it keeps NaN.
        let inside = span - self.inside_since;
        if self.limited_until > self.inside_since {
            span - self.limited_until
        } else {
            inside
        }
    }

    /// Does the response itself show that it stays in the band?
    pub(crate) fn verdict(&self, pace: &Pace) -> Verdict {
        if self.inside_since.is_nan() {
            return Verdict::Outside;
        }
        let unrest = self.unsettled_until.max(self.limited_until);
        let quiet = pace.span - unrest;
        let is_quiet =
            quiet >= QUIET_FOR * (unrest - self.inside_since) && quiet >= QUIET_WAITS * pace.wait;
        if is_quiet && TIME_CONSTANTS * pace.slowest <= self.time_inside(pace.span) {
            Verdict::Settled
        } else {
            Verdict::Doubtful
        }
    }

    pub(crate) fn metrics(&self, levels: &Levels) -> Metrics {
        let (top, bottom) = (self.top, self.bottom);
        let upper =
            top.0.abs() > bottom.0.abs() || (top.0.abs() == bottom.0.abs() && top.1 <= bottom.1);
        let peak = if upper { top } else { bottom };
        let span = levels.steady - levels.first;
        let known = Metrics {
            peak: peak.0.abs(),
            peak_time: peak.1,
            steady_state: levels.steady,
            ..Metrics::UNKNOWN
        };
        if span == 0.0 {
            return known;
        }
        let progress = |y: f64| (y - levels.first) / span;
        let (most, least) = if span > 0.0 {
            (progress(top.0), progress(bottom.0))
        } else {
            (progress(bottom.0), progress(top.0))
        };
        let has_risen = self.risen.1.is_finite();
        Metrics {
            rise_time: self.risen.1 - self.risen.0,
            settling_time: self.inside_since,
            overshoot: 100.0 * (most - 1.0).max(0.0),
            undershoot: 100.0 * (-least).max(0.0),
            settling_min: if has_risen { self.after.0 } else { f64::NAN },
            settling_max: if has_risen { self.after.1 } else { f64::NAN },
            ..known
        }
    }
}
