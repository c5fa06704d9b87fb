//! Deviations of an output after a step of a load, of the output or of the reference.
//!
//! A run without a given end goes on until the output rests: until it is within [`QUIET`] of its rest for
//! a fifth of the run, and, where the integral of the deviation is known from the polynomials of the
//! loop, until what was integrated agrees with that. A slow tail below [`QUIET`] is found in this way.

use crate::dde::{
    Deviation, DeviationMetrics, Ending, Kick, LinearLoop, Reference, RequestedOutput, Start,
};
use crate::{Error, Task};

use super::control_loop::ControlLoop;
use super::drive::Drive;
use super::equations::Input;
use super::polynomial::{product, sum};
use super::rest::total_at_rest;
use super::settled::slowest;

/// Share of the peak within which an output rests: less makes runs longer, more makes integrals end with
/// an error of about this share.
const QUIET: f64 = 1e-7;

/// Relative error of the integral at which a run ends, where it is known: as above.
const INTEGRAL: f64 = 1e-7;

/// The output must rest for this share of the run, and for so many delays: less takes a pass through
/// the rest for it.
const QUIET_FOR: f64 = 0.2;
const QUIET_WAITS: f64 = 3.0;

/// No run is shorter than so many waits for a delay, and time constants of the loop without it: less takes
/// a pass through the rest for it, more makes runs longer. Where the integral is known, it shows that.
const FIRST: (f64, f64) = (20.0, 12.0);
const FIRST_KNOWN: (f64, f64) = (4.0, 2.0);

/// No run is longer than so many of these: more settle slower loops and take longer.
const LONGEST: f64 = 2048.0;

/// No run of a continuous loop is longer than so many delays: the steppers refuse twice as many.
pub const MOST_DELAYS: f64 = 1e7;

/// Growth of the peak over a doubling of the time that no loop with a rest shows so many times: less
/// gives up slow loops, more takes unstable loops longer.
const GROWTH: f64 = 3.0;
const GROWTHS: u32 = 3;

/// What steps, and how its response is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviationAsked {
    /// What steps at the start.
    pub of: Drive,
    /// By how much.
    pub size: f64,
    /// Half width of the band within which an output has recovered, as a share of the peak.
    pub band: f64,
    /// End of the run, s; none where it goes on until the output rests.
    pub span: Option<f64>,
    /// Delays after which a run without a given end is given up, at most [`MOST_DELAYS`].
    pub most_delays: f64,
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Figures {
    /// Over the run, or to infinity where it had no given end.
    pub deviation: Deviation,
    /// Deviation at rest; NaN without a rest.
    pub rest: f64,
    /// Length of the run, s.
    pub span: f64,
    /// Did it come to rest? Of a run with a given end: is it in its band there?
    pub is_settled: bool,
}

impl Figures {
    /// Nothing.
    pub const UNKNOWN: Self = Self {
        deviation: Deviation {
            peak: f64::NAN,
            peak_time: f64::NAN,
            iae: f64::NAN,
            ie: f64::NAN,
            recovery_time: f64::NAN,
            loud_until: f64::NAN,
        },
        rest: f64::NAN,
        span: f64::NAN,
        is_settled: false,
    };
}

/// Where an output rests after a step of an input.
struct Rest {
    /// Output at rest per unit; NaN without a rest.
    output: f64,
    /// Integral of the deviation from the rest per unit; NaN where it is not known.
    integral: f64,
}

impl ControlLoop {
    /// Measure the deviation of the output after a step from rest at zero: from zero after a step of a
    /// load or of the output, from its rest after one of the reference.
    ///
    /// # Errors
    /// As [`driven`](Self::driven), and as a simulation.
    pub fn deviation(&self, asked: &DeviationAsked, task: &Task) -> Result<Figures, Error> {
        let plant = match asked.of {
            Drive::Reference => self.linear(Input::Reference)?,
            drive => self.driven(&[(drive, 0)])?,
        };
        let rest = self.rest_after(asked.of)?;
        let is_bounded = plant.bounds().is_some() || plant.rate().is_some();
        let output = rest.output * asked.size;
        let level = match asked.of {
            Drive::Reference => output,
            _ => 0.0,
        };
        let known = if is_bounded {
            f64::NAN
        } else {
            rest.integral * asked.size
        };
        let run = Run {
            plant: &plant,
            asked,
            lead: self.output_lead(),
            level,
            rest: output,
            task,
        };
        let figures = |deviation, span, is_settled| Figures {
            deviation,
            rest: output - level,
            span,
            is_settled,
        };
        if let Some(span) = asked.span {
            let (found, ..) = run.over(span, None)?;
            return Ok(figures(found, span, found.recovery_time.is_finite()));
        }
        let wait = self.values().delay + self.values().sample_time.unwrap_or(0.0);
        let slow = self.time_without_delay()?;
        let parts = if known.is_nan() { FIRST } else { FIRST_KNOWN };
        let mut least = parts.0 * wait + parts.1 * slow;
        if least == 0.0 {
            least = 1.0;
        }
        if output.is_nan() {
            return Ok(figures(Figures::UNKNOWN.deviation, least, false));
        }
        let ending = Ending {
            least,
            quiet: (QUIET_FOR, QUIET_WAITS * wait),
            integral: (known, INTEGRAL),
            growth: (GROWTH, GROWTHS),
        };
        let mut most = LONGEST * least;
        if self.values().sample_time.is_none() && wait > 0.0 {
            most = most.min(asked.most_delays.min(MOST_DELAYS) * wait);
        }
        let (mut found, span, is_settled) = run.over(most, Some(ending))?;
        if !is_settled {
            return Ok(figures(Figures::UNKNOWN.deviation, span, false));
        }
        let offset = output - level;
        if offset.abs() > QUIET * found.peak {
            found.iae = f64::INFINITY;
            found.ie = offset.signum() * f64::INFINITY;
        } else if known.is_finite() {
            found.ie = known;
        }
        Ok(figures(found, span, true))
    }

    /// The slowest time constant of the loop without its delay, at most, s.
    fn time_without_delay(&self) -> Result<f64, Error> {
        let [b, a, f, g, _] = self.polynomials(self.values())?;
        Ok(slowest(&sum(product(&a, &g), product(&b, &f))))
    }

    /// With plant b/a, feedback f/g and reference path r/g, the output over a load is b g/h, over a
    /// disturbance of the output a g/h, over the reference b r e^(−s T)/h, h = a g + b f e^(−s T). The
    /// integral of the deviation from the rest is the derivative of these at s = 0. In a sampled loop
    /// it is so where the controller integrates, since the integral is that of the command at rest.
    fn rest_after(&self, of: Drive) -> Result<Rest, Error> {
        let [b, a, f, g, r] = self.polynomials(self.values())?;
        let at = |p: &[f64], power: usize| p.iter().rev().nth(power).copied().unwrap_or(0.0);
        let (own, fed) = (product(&a, &g), product(&b, &f));
        let (delay, lead) = (self.values().delay, self.output_lead());
        let (num, wait) = match of {
            Drive::Reference => (product(&b, &r), delay - lead),
            Drive::Load => (product(&b, &g), 0.0),
            Drive::Output => (own.clone(), 0.0),
            Drive::Noise => (fed.iter().map(|c| -c).collect(), delay - lead),
        };
        let total = total_at_rest(at(&own, 0), at(&fed, 0));
        let slope = at(&own, 1) + at(&fed, 1) - delay * at(&fed, 0);
        let output = at(&num, 0) / total;
        let integral = (at(&num, 1) - wait * at(&num, 0) - output * slope) / total;
        let is_known = self.values().sample_time.is_none() || self.controller().kind.integrates();
        Ok(Rest {
            output,
            integral: if is_known { integral } else { f64::NAN },
        })
    }
}

/// A response that is measured.
struct Run<'a> {
    plant: &'a LinearLoop,
    asked: &'a DeviationAsked,
    lead: f64,
    level: f64,
    rest: f64,
    task: &'a Task,
}

impl Run<'_> {
    /// The deviation over a time at most, the time reached, and whether the output came to rest.
    fn over(&self, span: f64, ending: Option<Ending>) -> Result<(Deviation, f64, bool), Error> {
        let asked = self.asked;
        let is_step = asked.of == Drive::Reference;
        let mut start = Start {
            state: vec![0.0; self.plant.equations().states()],
            ..Start::default()
        };
        if !is_step {
            start.kicks.push(Kick {
                time: if asked.of.is_at_plant() {
                    self.lead
                } else {
                    0.0
                },
                input: 0,
                to: asked.size,
            });
        }
        let reference = Reference::step(0.0, if is_step { asked.size } else { 0.0 })?;
        let end = [self.lead + span];
        let times = (self.lead, end[0]);
        let bands = (asked.band, QUIET);
        let mut metrics = DeviationMetrics::new(times, (self.level, self.rest), bands, ending);
        let requested = RequestedOutput::new(&end, &[], 0.0)?.measured_by(&mut metrics);
        self.plant.serve(&start, &reference, requested, self.task)?;
        let (time, is_settled) = metrics.settled();
        Ok((metrics.found(), time, is_settled))
    }
}
