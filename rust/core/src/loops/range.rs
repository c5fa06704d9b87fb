//! The values of one number, around its present one, for which a loop is stable, its limit left out.

use crate::dde::LinearLoop;
use crate::dde::control_loop::sampled::Timing;
use crate::elementary::Enclosed;
use crate::frequency::{
    Members, Number, corner_range, damping_range, delay_range, end_of_gain, gain_range,
    gain_range_held, held_delay_range, held_range,
};
use crate::quasipoly::QuasiPolynomial;
use crate::stability::{HeldInterval, HeldLoop};
use crate::{Error, Task};

use super::control_loop::{ControlLoop, Place, Values};
use super::equations::Input;
use super::held::Polynomials;
use super::plant::{Fraction, Plant};
use super::polynomial::product;
use super::symbol::Symbol;

/// What the kernel cannot know of a plant whose polynomials are given.
pub struct GivenPlant<'a> {
    /// They, with the number free whose range is sought.
    pub free: Option<Fraction<Symbol>>,
    /// They for numbers.
    pub at: &'a mut Polynomials<'a>,
}

/// A loop of which one number varies.
struct Varied<'a, 'b> {
    of: &'a ControlLoop,
    place: Place,
    given: GivenPlant<'b>,
}

impl Members for Varied<'_, '_> {
    fn at(&mut self, value: f64) -> Result<LinearLoop, Error> {
        let mut values = self.of.values().clone();
        values.set(self.place, value);
        if *self.of.plant() == Plant::Given && matches!(self.place, Place::Plant(_)) {
            values.given = Some((self.given.at)(&values.plant)?);
        }
        self.of.with(values).linear(Input::Reference)
    }

    fn within(&mut self, (low, high): (f64, f64), samples: f64) -> Result<HeldInterval, Error> {
        let number = Enclosed::between(low, high);
        let own = self.of.values();
        let mut values: Values<Enclosed> = own.entries();
        values.set(self.place, number);
        values.given = self.given.free.as_ref().map(|free| free.at(&number));
        let (equations, update) = self.of.on_samples(&values, Input::Reference)?;
        let period = own.sample_time.unwrap_or_default();
        let (early, period) = match values.sample_time {
            Some(varied) if self.place == Place::SampleTime => {
                (values.delay - Enclosed::from(samples) * varied, varied)
            }
            _ => (Timing::new(own.delay, period).early.into(), period.into()),
        };
        let times = [early, period - early];
        Ok(HeldInterval::new(&equations, update.as_ref(), times))
    }
}

impl ControlLoop {
    /// Stable values of one number around its present one.
    ///
    /// # Errors
    /// As the ranges of `frequency`.
    pub fn stable_range(
        &self,
        place: Place,
        given: GivenPlant<'_>,
        task: &Task,
    ) -> Result<(f64, f64), Error> {
        let Some(value) = self.values().get(place) else {
            refuse!("the loop has no parameter {place:?}");
        };
        let bounds = self.bounds(place, value);
        if self.values().sample_time.is_some() {
            return self.held_range(place, (value, bounds), given, task);
        }
        let mut values = self.free(&[place]);
        values.given = given.free;
        let family = self.family(vec![format!("{place:?}")], &[place], &values)?;
        let filter = self.controller().kind.gains().len();
        match place {
            Place::Delay => delay_range(&family, value, task),
            Place::Controller(index) if index == filter => {
                corner_range(&family, value, self.highest_crossing()?, task)
            }
            Place::Controller(index) if index == filter + 1 => {
                damping_range(&family, value, self.highest_crossing()?, task)
            }
            _ => gain_range(&family, value, bounds, task),
        }
    }

    fn held_range(
        &self,
        place: Place,
        (value, bounds): (f64, (f64, f64)),
        given: GivenPlant<'_>,
        task: &Task,
    ) -> Result<(f64, f64), Error> {
        if place == Place::Delay {
            return held_delay_range(HeldLoop::new(&self.linear(Input::Reference)?)?, task);
        }
        if self.is_gain(place) {
            let [rest, own] = self.shares(place)?;
            return gain_range_held(&rest, &own, value, bounds, task);
        }
        let number = match place {
            Place::SampleTime => Number::SampleTime,
            _ => Number::Other,
        };
        let mut varied = Varied {
            of: self,
            place,
            given,
        };
        held_range(&mut varied, number, value, bounds, task)
    }

    /// The loop without a gain, and the one whose feedback is its factor: the feedback is linear in the
    /// gains of the controller times the gain of the plant.
    fn shares(&self, place: Place) -> Result<[LinearLoop; 2], Error> {
        let gains = self.controller().kind.gains().len();
        let gain = Place::Plant(0);
        let total = self.values().get(gain).unwrap_or(1.0);
        let is_total = place == gain;
        let with = |own: &dyn Fn(Place, f64) -> f64| {
            let mut values: Values = self.values().clone();
            values.set(gain, 1.0);
            for index in 0..gains {
                let place = Place::Controller(index);
                let factor = self.values().get(place).unwrap_or(0.0);
                values.set(place, own(place, factor));
            }
            self.with(values).linear(Input::Reference)
        };
        Ok([
            with(&|other, factor| {
                if is_total || other == place {
                    0.0
                } else {
                    factor * total
                }
            })?,
            with(&|other, factor| {
                if is_total {
                    factor
                } else if other == place {
                    total
                } else {
                    0.0
                }
            })?,
        ])
    }

    /// Between what a number can be: times, corners and damping ratios are not negative, and numbers
    /// without a meaning at zero keep their sign.
    fn bounds(&self, place: Place, value: f64) -> (f64, f64) {
        let (keeps_sign, is_time) = match place {
            Place::Plant(0) => (false, false),
            Place::Plant(index) => {
                let name = self.name_of_plant(index);
                let keeps = ["time_constant", "pole_frequency", "pole_damping"].contains(&name);
                let is_given = *self.plant() == Plant::Given;
                (keeps || is_given, !is_given && name.starts_with("lag"))
            }
            Place::Controller(index) => (false, index >= self.controller().kind.gains().len()),
            Place::Delay | Place::SampleTime | Place::Limit | Place::Rate => (false, true),
            Place::Low => (false, false),
        };
        let keeps_sign = keeps_sign && value != 0.0;
        if keeps_sign && value < 0.0 {
            (f64::NEG_INFINITY, 0.0)
        } else if keeps_sign || is_time {
            (0.0, f64::INFINITY)
        } else {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }

    /// A frequency beyond which the loop gain is below one, whatever the corner of the filter is, and for
    /// all dampings from the present one on; infinite where there is none.
    fn highest_crossing(&self) -> Result<f64, Error> {
        let [b, a, ..] = self.polynomials(self.values())?;
        let (p, i, d) = self.controller().gains_of_terms(&self.values().controller);
        let filter = self.controller().filter(&self.values().controller);
        let damping = filter.map_or(1.0, |(_, damping)| damping);
        // The least modulus of x² + 2 damping x + 1 where Re x ≥ 0.
        let least = if damping >= std::f64::consts::FRAC_1_SQRT_2 {
            1.0
        } else {
            2.0 * damping * (1.0 - damping * damping).sqrt()
        };
        let sizes: Vec<f64> = b.iter().map(|c| c.abs()).collect();
        let mut gain = product(&sizes, &[d.abs() / least, p.abs(), i.abs()]);
        gain.reverse();
        let rest = std::iter::once(0.0).chain(a.into_iter().rev()).collect();
        let one = |row: Vec<f64>| QuasiPolynomial::new(vec![row], vec![0.0]);
        Ok(end_of_gain(&one(gain)?, &one(rest)?, 1.0, 0))
    }
}
