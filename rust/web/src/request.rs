//! A request: numbers one after the other, lists with their length before them.

use deadtime::Error;
use deadtime::loops::{
    ControlLoop, Controller, Extra, Extras, Factors, Kind, Path, Place, Plant, Values,
};

/// What is left to read.
pub(crate) struct Request<'a> {
    rest: &'a [f64],
}

impl<'a> Request<'a> {
    pub(crate) fn new(numbers: &'a [f64]) -> Self {
        Self { rest: numbers }
    }

    /// The next number.
    ///
    /// # Errors
    /// [`Error::Argument`] at the end of the request.
    pub(crate) fn number(&mut self) -> Result<f64, Error> {
        match self.rest.split_first() {
            Some((number, rest)) => {
                self.rest = rest;
                Ok(*number)
            }
            None => Err(Error::argument("the request ends too early")),
        }
    }

    /// The next number, where that is a whole one from zero on.
    ///
    /// # Errors
    /// As [`number`](Self::number), and for other numbers.
    pub(crate) fn whole(&mut self) -> Result<usize, Error> {
        let number = self.number()?;
        if number >= 0.0 && number.fract() == 0.0 && number < f64::from(u32::MAX) {
            Ok(number as usize)
        } else {
            Err(Error::argument(format!(
                "{number} in a request where a whole number is expected"
            )))
        }
    }

    /// A number that is zero or one.
    ///
    /// # Errors
    /// As [`whole`](Self::whole).
    pub(crate) fn flag(&mut self) -> Result<bool, Error> {
        Ok(self.whole()? != 0)
    }

    /// A list with its length before it.
    ///
    /// # Errors
    /// As [`whole`](Self::whole).
    pub(crate) fn list(&mut self) -> Result<&'a [f64], Error> {
        let count = self.whole()?;
        match self.rest.split_at_checked(count) {
            Some((list, rest)) => {
                self.rest = rest;
                Ok(list)
            }
            None => Err(Error::argument("the request ends inside a list")),
        }
    }

    /// A loop: does it integrate, differentiate, is the derivative that of the error (0 or 1); ω (0 for
    /// no filter) and ζ; Kp, Ki, Kd, gain, lag, delay, sample time (0 for none), weight of the reference;
    /// greatest and least command (infinite for none); tracking time (0 for none, infinite for an
    /// integral that stops); the lists num and den, descending. The plant is gain num/(den (lag s + 1)).
    ///
    /// # Errors
    /// [`Error::Argument`] for a request that ends too early or numbers without sense.
    pub(crate) fn control_loop(&mut self) -> Result<ControlLoop, Error> {
        let terms = (self.flag()?, self.flag()?, self.flag()?);
        let (omega, damping) = (self.number()?, self.number()?);
        let mut numbers = [0.0; 11];
        for number in &mut numbers {
            *number = self.number()?;
        }
        let [kp, ki, kd, gain, lag, delay, sample_time, weight, ..] = numbers;
        let [.., limit, low, tracking] = numbers;
        let (num, den) = (self.list()?.to_vec(), self.list()?.to_vec());
        let finite = numbers[..8].iter().chain(&num).chain(&den);
        if let Some(number) = finite.clone().find(|number| !number.is_finite()) {
            return Err(Error::argument(format!(
                "{number} in a loop: its numbers must be finite"
            )));
        }
        let leads = |list: &[f64]| list.first().is_some_and(|first| *first != 0.0);
        if !leads(&num) || !leads(&den) || num.len() > den.len() {
            return Err(Error::argument(
                "a plant is num/den with leading coefficients other than zero and a degree of den \
                 at least that of num",
            ));
        }
        if let Some(time) = [lag, delay, sample_time]
            .into_iter()
            .find(|time| *time < 0.0)
        {
            return Err(Error::argument(format!(
                "{time} s in a loop: lags, delays and sample times are zero or more"
            )));
        }
        if low.is_nan() || limit <= low || limit.is_finite() != low.is_finite() {
            return Err(Error::argument(format!(
                "commands between {low} and {limit}: give two bounds, the smaller one first"
            )));
        }
        let (kind, mut own) = match terms {
            (false, false, _) => (Kind::P, vec![kp]),
            (false, true, false) => (Kind::PV, vec![kp, kd]),
            (false, true, true) => (Kind::PD, vec![kp, kd]),
            (true, false, _) => (Kind::PI, vec![kp, ki]),
            (true, true, true) => (Kind::PID, vec![kp, ki, kd]),
            (true, true, false) => {
                return Err(Error::argument(
                    "an integral beside a derivative of the output alone: there is no such controller",
                ));
            }
        };
        let is_filtered = kind.differentiates() && omega > 0.0;
        if is_filtered {
            own.extend([omega, damping]);
        }
        let mut extras = Extras::default();
        if kind.integrates() && tracking > 0.0 && tracking.is_finite() {
            extras = extras.with(Extra::TrackingTime);
            own.push(tracking);
        }
        let controller = Controller {
            kind,
            is_filtered,
            rule: None,
            extras,
            stops: kind.integrates() && tracking == f64::INFINITY,
        };
        let plant = Plant::Factors(Factors {
            num,
            den,
            lags: 1,
            has_zero: false,
            has_pair: false,
        });
        let values = Values {
            plant: vec![gain, lag],
            controller: own,
            delay,
            sample_time: (sample_time > 0.0).then_some(sample_time),
            limit: limit.is_finite().then_some(limit),
            low: (low != -limit).then_some(low),
            rate: None,
            given: None,
        };
        let names = ["gain", "lag"].map(String::from).to_vec();
        let made = ControlLoop::new(plant, names, controller, values, Path::Command)?;
        Ok(match weight {
            1.0 => made,
            weight => made.with_weight(weight),
        })
    }

    /// A number of a loop, by its index among Kp, Ki, Kd, gain, lag, delay and sample time.
    ///
    /// # Errors
    /// [`Error::Argument`] where the loop has no such number.
    pub(crate) fn place(&mut self, of: &ControlLoop) -> Result<Place, Error> {
        let derivative = match of.controller().kind {
            Kind::PV => "Kv",
            _ => "Kd",
        };
        let names = [
            "Kp",
            "Ki",
            derivative,
            "gain",
            "lag",
            "delay",
            "sample_time",
        ];
        let index = self.whole()?;
        match names.get(index) {
            Some(name) => of.place(name),
            None => Err(Error::argument(format!(
                "number {index} of a loop: there are {}",
                names.len()
            ))),
        }
    }
}
