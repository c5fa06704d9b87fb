//! A loop: plant × controller × paths, and its named numbers.

use crate::Error;

use super::controller::{Controller, Extra};
use super::entry::Entry;
use super::plant::{Fraction, Plant};

/// Where the delay sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Path {
    /// Between command and plant.
    #[default]
    Command,
    /// Between output and controller.
    Measurement,
}

/// One of the numbers of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Of the plant, by its place.
    Plant(usize),
    /// Of the controller, by its place: gains, ω, ζ.
    Controller(usize),
    /// Of the path, s.
    Delay,
    /// Of the hold, s.
    SampleTime,
    /// Greatest command, and bound of its modulus where there is no least one.
    Limit,
    /// Least command.
    Low,
    /// Bound of the rate of the command.
    Rate,
}

/// The numbers of a loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Values<S = f64> {
    /// Of the plant; the first one is its gain.
    pub plant: Vec<S>,
    /// Of the controller: gains, ω, ζ.
    pub controller: Vec<S>,
    /// s.
    pub delay: S,
    /// s; none in continuous time.
    pub sample_time: Option<S>,
    /// Greatest command, and bound of its modulus without `low`; none where there is no bound.
    pub limit: Option<S>,
    /// Least command; none where it is that of equal bounds.
    pub low: Option<S>,
    /// Bound of the rate of the command; none where there is no bound.
    pub rate: Option<S>,
    /// num and den of a [`Plant::Given`].
    pub given: Option<Fraction<S>>,
}

/// A plant under feedback with one delay in the loop.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlLoop {
    plant: Plant,
    controller: Controller,
    path: Path,
    /// Of the plant's numbers.
    names: Vec<String>,
    values: Values,
}

impl<S> Values<S> {
    /// The place of a number; the sample time and the limit count as there.
    fn slot(&mut self, place: Place) -> Option<&mut S> {
        match place {
            Place::Plant(index) => self.plant.get_mut(index),
            Place::Controller(index) => self.controller.get_mut(index),
            Place::Delay => Some(&mut self.delay),
            Place::SampleTime => self.sample_time.as_mut(),
            Place::Limit => self.limit.as_mut(),
            Place::Low => self.low.as_mut(),
            Place::Rate => self.rate.as_mut(),
        }
    }

    /// Put another number in its place.
    pub fn set(&mut self, place: Place, value: S) {
        match place {
            Place::SampleTime => self.sample_time = Some(value),
            Place::Limit => self.limit = Some(value),
            Place::Low => self.low = Some(value),
            Place::Rate => self.rate = Some(value),
            _ => {
                if let Some(slot) = self.slot(place) {
                    *slot = value;
                }
            }
        }
    }
}

impl<S> Values<S> {
    /// Each number changed; without the polynomials of a [`Plant::Given`].
    pub(super) fn each<T>(&self, change: &impl Fn(&S) -> T) -> Values<T> {
        Values {
            plant: self.plant.iter().map(change).collect(),
            controller: self.controller.iter().map(change).collect(),
            delay: change(&self.delay),
            sample_time: self.sample_time.as_ref().map(change),
            limit: self.limit.as_ref().map(change),
            low: self.low.as_ref().map(change),
            rate: self.rate.as_ref().map(change),
            given: None,
        }
    }
}

impl Values {
    /// The numbers as entries; without the polynomials of a [`Plant::Given`].
    pub fn entries<S: Entry>(&self) -> Values<S> {
        self.each(&|number| S::from(*number))
    }

    /// A number; none where the loop has none.
    pub fn get(&self, place: Place) -> Option<f64> {
        self.clone().slot(place).copied()
    }
}

impl ControlLoop {
    /// Join the parts; `names` are those of the plant's numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] where the numbers are not as many as the parts have.
    pub fn new(
        plant: Plant,
        names: Vec<String>,
        controller: Controller,
        values: Values,
        path: Path,
    ) -> Result<Self, Error> {
        refuse_if!(
            values.plant.len() != names.len() || values.controller.len() != controller.count(),
            "{} parameters of the plant and {} of the controller are given, but there are {} and \
             {}",
            values.plant.len(),
            values.controller.len(),
            names.len(),
            controller.count()
        );
        Ok(Self {
            plant,
            controller,
            path,
            names,
            values,
        })
    }

    /// The form of the plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The form of the controller.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// All numbers.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Is the command bounded otherwise than by its modulus, or does its integral not wind up?
    pub fn is_guarded(&self) -> bool {
        let controller = self.controller;
        let winds = controller.kind.integrates()
            && (controller.stops || controller.names().any(|name| name == "tracking_time"));
        let values = &self.values;
        values.low.is_some() || values.rate.is_some() || (winds && values.limit.is_some())
    }

    /// Is the delay in the measurement?
    pub fn is_measured(&self) -> bool {
        self.path == Path::Measurement
    }

    /// How much earlier than its measurement the output is, s.
    pub fn output_lead(&self) -> f64 {
        if self.is_measured() {
            self.values.delay
        } else {
            0.0
        }
    }

    /// The place of a named number.
    ///
    /// # Errors
    /// [`Error::Argument`] where the loop has no such number.
    pub fn place(&self, name: &str) -> Result<Place, Error> {
        let of_plant = self.names.iter().position(|own| own == name);
        let of_controller = self.controller.names().position(|own| own == name);
        match (of_plant, of_controller, name) {
            (Some(index), ..) => Ok(Place::Plant(index)),
            (_, Some(index), _) => Ok(Place::Controller(index)),
            (.., "delay") => Ok(Place::Delay),
            (.., "sample_time") => Ok(Place::SampleTime),
            (.., "limit" | "limit_high") => Ok(Place::Limit),
            (.., "limit_low") => Ok(Place::Low),
            (.., "rate_limit") => Ok(Place::Rate),
            _ => refuse!("this loop has no parameter {name:?}"),
        }
    }

    /// The name of a number of the plant.
    pub(super) fn name_of_plant(&self, index: usize) -> &str {
        self.names.get(index).map_or("", String::as_str)
    }

    /// Is the feedback, or the gain of the plant, linear in this number?
    pub fn is_gain(&self, place: Place) -> bool {
        match place {
            Place::Plant(index) => self.name_of_plant(index) == "gain",
            Place::Controller(index) => index < self.controller.kind.gains().len(),
            _ => false,
        }
    }

    /// The same loop with other numbers.
    pub fn with(&self, values: Values) -> Self {
        Self {
            values,
            ..self.clone()
        }
    }

    /// The same loop with another number in one place.
    pub fn with_number(&self, place: Place, value: f64) -> Self {
        let mut other = self.clone();
        other.values.set(place, value);
        other
    }

    /// The same loop with this weight of the reference in the proportional term.
    #[must_use]
    pub fn with_weight(&self, weight: f64) -> Self {
        let (mut other, controller) = (self.clone(), self.controller);
        let numbers = &mut other.values.controller;
        let place = controller.kind.gains().len() + 2 * usize::from(controller.is_filtered);
        match numbers.get_mut(place) {
            Some(own) if controller.names().any(|name| name == "weight") => *own = weight,
            _ => numbers.insert(place.min(numbers.len()), weight),
        }
        other.controller.extras = controller.extras.with(Extra::Weight);
        other
    }
}
