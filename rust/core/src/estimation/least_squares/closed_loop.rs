//! Misfit of a simulated loop to one recording.
//!
//! The loop starts at rest at its output at the beginning of the window and is evaluated at the time
//! stamps of the recording; in a sampled loop the commands of the last delay before the window are
//! still to arrive. Derivatives are exact where the loop has them, difference quotients elsewhere.

use super::joint::Part;
use super::tolerances::QUOTIENT;
use crate::dde::{Reference, Request, on_sample};
use crate::loops::{ControlLoop, Fraction, Place, Plant, SlopesAsked};
use crate::{Error, Task};

/// A number that is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A time constant at zero, where it acts like a delay.
    Lag(Place),
    /// Another number of the loop.
    Other(Place),
    /// How much later than that of the reference the clock of the output runs, s.
    Start,
}

/// One recording and the loop that made it.
#[derive(Debug, Clone)]
pub struct ClosedLoop {
    /// The loop; the numbers that are fitted may be any.
    pub control: ControlLoop,
    /// Time stamps.
    pub time: Vec<f64>,
    /// The reference from each of them on.
    pub reference: Vec<f64>,
    /// What was recorded.
    pub output: Vec<f64>,
    /// Sampled loops: commands at the samples before the window, the latest last.
    pub past: Vec<f64>,
    /// What is fitted, in the order of a point.
    pub numbers: Vec<Number>,
    /// The output at the start; fitted too where there is none.
    pub start: Option<f64>,
    /// Time between two rows, s.
    pub row: f64,
    /// Size of the excitation.
    pub size: f64,
    /// Largest misfit: simulations may diverge.
    pub bound: f64,
    /// Whether the loop has derivatives.
    pub is_smooth: bool,
}

/// Finds the polynomials of a [`Plant::Given`] for numbers of the plant.
pub type Given<'a> = &'a dyn Fn(&[f64]) -> Result<Fraction<f64>, Error>;

/// The loop with what finds the polynomials of its plant, if it is given by them.
pub struct Simulated<'a> {
    /// The recording.
    pub of: &'a ClosedLoop,
    /// The polynomials.
    pub given: Option<Given<'a>>,
}

/// The loop with some numbers, and its clock.
struct Run {
    control: ControlLoop,
    late: f64,
    phase: f64,
    start: f64,
}

impl Simulated<'_> {
    fn run(&self, point: &[f64]) -> Result<Run, Error> {
        let own = self.of;
        let mut values = own.control.values().clone();
        let mut late = 0.0;
        for (number, value) in own.numbers.iter().zip(point) {
            match number {
                Number::Lag(place) | Number::Other(place) => values.set(*place, *value),
                Number::Start => late = *value,
            }
        }
        if let Some(given) = self.given {
            values.given = Some(given(&values.plant)?);
        }
        // The time stamp t of an output was at t − late.
        let phase = values.sample_time.map_or(0.0, |period| {
            let phase = late.rem_euclid(period);
            if phase == period { 0.0 } else { phase }
        });
        Ok(Run {
            control: own.control.with(values),
            late,
            phase,
            start: own.start.or(point.last().copied()).unwrap_or(0.0),
        })
    }

    fn outputs(&self, point: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
        let run = self.run(point)?;
        let time: Vec<f64> = self.of.time.iter().map(|t| t - run.late).collect();
        let asked = Request {
            time: &time,
            output_lead: run.control.output_lead(),
            reference_before: run.start,
            reference_time: &self.of.time,
            reference: &self.of.reference,
        };
        let past = (self.of.past.clone(), run.phase);
        run.control
            .outputs_after_rest(run.start, past, &asked, task)
    }

    /// Exact derivatives by one number of the loop.
    fn exact(&self, point: &[f64], place: Place, task: &Task) -> Result<Vec<f64>, Error> {
        let run = self.run(point)?;
        let first = self.of.time.first().map_or(0.0, |first| first - run.late);
        let sample = run.control.values().sample_time.map(|ts| (ts, run.phase));
        let since = |t: f64| on_sample(t - first, first, sample);
        let lead = run.control.output_lead();
        let stamps = self.of.time.iter();
        let output_times: Vec<f64> = stamps.map(|t| since(t - run.late) + lead).collect();
        let jumps: Vec<f64> = self.of.time.iter().map(|t| since(*t)).collect();
        let before = self.of.time.partition_point(|t| *t < first);
        let before = before.checked_sub(1).map(|i| self.of.reference[i]);
        let reference = Reference::new(run.start, jumps, self.of.reference.clone())?;
        let asked = SlopesAsked {
            rest: (run.start, before.unwrap_or(run.start)),
            command_history: &self.of.past,
            sample_phase: run.phase,
            output_times: &output_times,
            input_times: &[],
        };
        let given: Vec<_> = run.control.values().given.iter().map(entries).collect();
        let found = run
            .control
            .sensitivities(&[place], &given, &asked, &reference, task)?;
        Ok(found.0)
    }

    /// Difference quotient by one number, one-sided where it is at its lower bound.
    fn quotient(&self, point: &[f64], index: usize, task: &Task) -> Result<Vec<f64>, Error> {
        let own = self.of;
        let value = point[index];
        let number = own.numbers[index];
        let not_negative = matches!(number, Number::Lag(_) | Number::Other(Place::Delay));
        let in_rows = not_negative || number == Number::Start;
        let unit = value.abs().max(if in_rows { own.row } else { 0.0 });
        let is_sampled = own.control.values().sample_time.is_some();
        let change = if value == 0.0 && not_negative && !is_sampled {
            QUOTIENT.from_zero * own.row
        } else {
            QUOTIENT.step * unit
        };
        let below = value - change;
        let low = if not_negative { below.max(0.0) } else { below };
        self.between(point, index, (low, value + change), task)
    }

    /// Slope of the outputs between two values of one parameter.
    fn between(
        &self,
        point: &[f64],
        index: usize,
        (low, high): (f64, f64),
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let at = |value: f64| {
            let mut moved = point.to_vec();
            moved[index] = value;
            self.outputs(&moved, task)
        };
        let (upper, lower) = (at(high)?, at(low)?);
        let pairs = upper.iter().zip(&lower);
        Ok(pairs.map(|(u, l)| (u - l) / (high - low)).collect())
    }

    fn column(&self, point: &[f64], index: usize, task: &Task) -> Result<Vec<f64>, Error> {
        let own = self.of;
        let is_sampled = own.control.values().sample_time.is_some();
        let delay = own
            .numbers
            .iter()
            .position(|n| *n == Number::Other(Place::Delay));
        let delay = delay.map_or(own.control.values().delay, |place| point[place]);
        let has_slope = |place| {
            let of_given = matches!(place, Place::Plant(_)) && self.given.is_some();
            let is_rational = !matches!(own.control.plant(), Plant::Delayed(..));
            own.is_smooth
                && is_rational
                && !of_given
                && (place != Place::Delay || is_sampled || delay != 0.0)
        };
        match own.numbers[index] {
            // At zero the derivative by a lag equals that by a delay.
            Number::Lag(_) if point[index] == 0.0 && has_slope(Place::Delay) => {
                self.exact(point, Place::Delay, task)
            }
            Number::Lag(place) if point[index] != 0.0 && has_slope(place) => {
                self.exact(point, place, task)
            }
            Number::Other(place) if has_slope(place) => self.exact(point, place, task),
            _ => self.quotient(point, index, task),
        }
    }

    fn columns(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        let own = self.of;
        let outputs = self.outputs(point, task)?;
        let mut columns = Vec::new();
        for index in 0..own.numbers.len() {
            columns.push(self.column(point, index, task)?);
        }
        if own.start.is_none() {
            let (index, value) = (own.numbers.len(), point[own.numbers.len()]);
            let ends = (value, value + QUOTIENT.step * own.size);
            columns.push(self.between(point, index, ends, task)?);
        }
        // Zero where the misfit is at its bound.
        let pairs = outputs.iter().zip(&own.output).enumerate();
        for (row, _) in pairs.filter(|(_, (found, wanted))| (*found - *wanted).abs() >= own.bound) {
            columns.iter_mut().for_each(|column| column[row] = 0.0);
        }
        Ok(columns)
    }
}

impl Part for Simulated<'_> {
    fn misfit(&self, point: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
        let (wanted, bound) = (&self.of.output, self.of.bound);
        match self.outputs(point, task) {
            Ok(found) => Ok(found
                .iter()
                .zip(wanted)
                .map(|(found, wanted)| (found - wanted).clamp(-bound, bound))
                .collect()),
            Err(error) if ends(&error) => Err(error),
            // The response with these numbers grows without bound.
            Err(_) => Ok(vec![bound; wanted.len()]),
        }
    }

    fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        match self.columns(point, task) {
            Err(error) if ends(&error) => Err(error),
            Err(_) => Ok(vec![vec![0.0; self.of.time.len()]; point.len()]),
            found => found,
        }
    }
}

/// Does an error say something else than that the loop cannot be simulated with these numbers?
fn ends(error: &Error) -> bool {
    error.ends_all() || *error == Error::Caller
}

/// Polynomials that do not depend on the number.
fn entries<S: From<f64>>(given: &Fraction<f64>) -> Fraction<S> {
    let part = |list: &[f64]| list.iter().map(|x| S::from(*x)).collect();
    Fraction {
        num: part(&given.num),
        den: part(&given.den),
    }
}
