//! Bindings of the intervals and the tests of fits of a named plant.

use std::collections::HashMap;

use deadtime::estimation::{
    Ends, FlightProfile as CoreProfile, FreeNumbers as CoreNumbers, KnownQuantity, Quantity,
    colour_factors, judge_profile,
};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::converted;
use crate::flight::FlightFit;
use crate::flight_plant::FlightPlant;
use crate::judgement::FlightJudgement;
use crate::runtime::run_here;

/// Of each quantity by its name: value, standard error for the fitted noise, factor on its square, degrees
/// of freedom, and what other numbers add.
type KnownParts = Vec<(String, [f64; 5])>;

/// The ends of intervals that were found, by name and level.
type EndParts = Vec<(String, f64, (f64, f64))>;

/// What a profile is made of.
type ProfileParts = (
    FlightFit,
    KnownParts,
    Vec<f64>,
    Vec<Vec<f64>>,
    bool,
    Option<FreeNumbers>,
    EndParts,
);

/// Names, values, covariance, and slopes of quantities by their places.
type NumberParts = (Vec<String>, Vec<f64>, Vec<f64>, Vec<(usize, Vec<f64>)>);

/// Numbers of a plant that were searched around the likelihood.
#[pyclass(frozen, from_py_object, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct FreeNumbers {
    pub(crate) core: CoreNumbers,
    pub(crate) names: Vec<String>,
}

#[pymethods]
impl FreeNumbers {
    #[new]
    fn new(
        names: Vec<String>,
        values: Vec<f64>,
        cov: Vec<f64>,
        slopes: Vec<(usize, Vec<f64>)>,
    ) -> Self {
        let slopes = slopes.into_iter().map(|(place, slope)| (at(place), slope));
        let core = CoreNumbers {
            values,
            cov,
            slopes: slopes.collect(),
        };
        Self { core, names }
    }

    fn __getnewargs__(&self) -> NumberParts {
        let own = self.core.clone();
        let slopes = own
            .slopes
            .into_iter()
            .map(|(one, slope)| (place(one), slope));
        (self.names.clone(), own.values, own.cov, slopes.collect())
    }

    /// The numbers by their names.
    #[getter]
    fn values(&self) -> Vec<(String, f64)> {
        let pairs = self.names.iter().cloned().zip(&self.core.values);
        pairs.map(|(name, value)| (name, *value)).collect()
    }
}

const FIRST_LAG: usize = 4;

/// A quantity as a number.
fn place(quantity: Quantity) -> usize {
    match quantity {
        Quantity::Delay => 0,
        Quantity::Gain => 1,
        Quantity::Zero => 2,
        Quantity::Total => 3,
        Quantity::Lag(i) => FIRST_LAG + i,
    }
}

fn at(place: usize) -> Quantity {
    match place {
        0 => Quantity::Delay,
        1 => Quantity::Gain,
        2 => Quantity::Zero,
        3 => Quantity::Total,
        lag => Quantity::Lag(lag - FIRST_LAG),
    }
}

/// The profile of one fit.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct FlightProfile {
    core: CoreProfile,
    of: FlightPlant,
    numbers: Option<FreeNumbers>,
}

impl FlightProfile {
    pub(crate) fn of(
        py: Python<'_>,
        fit: &FlightFit,
        first: Option<Vec<String>>,
        covariance: Option<Vec<f64>>,
        numbers: Option<FreeNumbers>,
    ) -> PyResult<Self> {
        let of = fit.of.clone();
        let all = |names: Vec<String>| -> PyResult<Vec<Quantity>> {
            names.iter().map(|name| of.quantity(name)).collect()
        };
        let (quantities, first) = (all(of.known())?, all(first.unwrap_or_default())?);
        let own = fit.core.clone();
        let mut core = run_here(py, |task| match covariance {
            Some(covariance) => Ok(CoreProfile::new(own, &quantities, task)?.of_plant(covariance)),
            None => CoreProfile::best(own, &quantities, &first, task),
        })?;
        if let Some(numbers) = &numbers {
            core = core.beside(numbers.core.clone());
        }
        Ok(Self { core, of, numbers })
    }

    /// The place of a number that was searched around the likelihood.
    fn number(&self, name: &str) -> Option<usize> {
        let mut names = self.numbers.iter().flat_map(|own| &own.names);
        names.position(|own| own == name)
    }

    fn errors(&self, of: impl Fn(&KnownQuantity) -> f64) -> PyResult<Vec<(String, f64)>> {
        let known = self.of.known().into_iter().zip(&self.core.known);
        let mut found: Vec<(String, f64)> = known.map(|(name, one)| (name, of(one))).collect();
        for (place, name) in self.numbers.iter().flat_map(|own| &own.names).enumerate() {
            found.push((name.clone(), converted(self.core.error_of_number(place))?));
        }
        Ok(found)
    }
}

#[pymethods]
impl FlightProfile {
    /// The profile of a fit with what was found of it before.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "what `__reduce__` gives")]
    fn restored(
        py: Python<'_>,
        fit: PyRef<'_, FlightFit>,
        known: KnownParts,
        covariance: Vec<f64>,
        weights: Vec<Vec<f64>>,
        is_of_plant: bool,
        numbers: Option<FreeNumbers>,
        ends: EndParts,
    ) -> PyResult<Self> {
        let of = fit.of.clone();
        let mut own = Vec::new();
        for (name, [value, bound, unseen, freedom, added]) in known {
            own.push(KnownQuantity {
                quantity: of.quantity(&name)?,
                value,
                bound,
                unseen,
                freedom,
                added,
            });
        }
        let fit = fit.core.clone();
        let mut core = run_here(py, |task| {
            CoreProfile::restored(fit, own, covariance, weights, task)
        })?;
        core.is_of_plant = is_of_plant;
        if let Some(numbers) = &numbers {
            core = core.beside(numbers.core.clone());
        }
        for (name, level, ends) in ends {
            core.keep(of.quantity(&name)?, level, ends);
        }
        Ok(Self { core, of, numbers })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, ProfileParts)> {
        let names: HashMap<usize, String> = self
            .core
            .known
            .iter()
            .map(|known| place(known.quantity))
            .zip(self.of.known())
            .collect();
        let name = |one: Quantity| names.get(&place(one)).cloned().unwrap_or_default();
        let known = self.core.known.iter().map(|one| {
            let parts = [one.value, one.bound, one.unseen, one.freedom, one.added];
            (name(one.quantity), parts)
        });
        let found: Ends = self.core.found();
        let ends = found
            .into_iter()
            .map(|(one, level, ends)| (name(one), level, ends));
        let parts = (
            self.fit(),
            known.collect(),
            self.core.covariance.clone(),
            self.core.weights.clone(),
            self.core.is_of_plant,
            self.numbers.clone(),
            ends.collect(),
        );
        Ok((py.get_type::<Self>().getattr("restored")?, parts))
    }

    #[getter]
    fn fit(&self) -> FlightFit {
        FlightFit {
            core: self.core.fit.clone(),
            of: self.of.clone(),
        }
    }

    #[getter]
    fn numbers(&self) -> Option<FreeNumbers> {
        self.numbers.clone()
    }

    /// Are all quantities those of the likelihood, under commands that are given?
    #[getter]
    fn is_plain(&self) -> bool {
        self.numbers.is_none() && !self.core.is_of_plant
    }

    /// Why these intervals are preferred to those of standard errors.
    #[getter]
    const fn preferred(&self) -> &'static str {
        "the noise is fitted"
    }

    /// Covariance of what was fitted, for the fitted noise.
    #[getter]
    fn cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let names = self.of.names.iter();
        let wanted: PyResult<Vec<Quantity>> = names.map(|name| self.of.quantity(name)).collect();
        let found = self.core.covariance_of(&wanted?);
        let size = found.len().isqrt();
        found.into_pyarray(py).reshape([size, size])
    }

    /// Standard errors for the fitted noise.
    #[getter]
    fn bounds(&self) -> PyResult<Vec<(String, f64)>> {
        self.errors(|one| one.bound.hypot(one.added))
    }

    /// Standard errors for the fitted noise, and for air that may be there unseen.
    #[getter]
    fn stderr(&self) -> PyResult<Vec<(String, f64)>> {
        self.errors(KnownQuantity::error)
    }

    /// Degrees of freedom of the quantile for a quantity.
    fn freedom_of(&self, name: &str) -> PyResult<f64> {
        if self.number(name).is_some() {
            return Ok(self.core.least_freedom());
        }
        Ok(converted(self.core.known_of(self.of.quantity(name)?))?.freedom)
    }

    /// The squared t for which a value is the end of an interval.
    fn statistic(&self, py: Python<'_>, name: &str, value: f64) -> PyResult<f64> {
        if let Some(place) = self.number(name) {
            return converted(self.core.statistic_of_number(place, value));
        }
        let quantity = self.of.quantity(name)?;
        run_here(py, |task| self.core.statistic(quantity, value, task))
    }

    /// Ends of an interval.
    fn interval(
        &self,
        py: Python<'_>,
        name: &str,
        _value: f64,
        _stderr: f64,
        level: f64,
    ) -> PyResult<(f64, f64)> {
        if let Some(place) = self.number(name) {
            return converted(self.core.interval_of_number(place, level));
        }
        let quantity = self.of.quantity(name)?;
        run_here(py, |task| self.core.interval(quantity, level, task))
    }

    /// The same fit with intervals for the colour of its whitened residuals.
    fn coloured(&self, py: Python<'_>) -> PyResult<Self> {
        let core = run_here(py, |task| {
            self.core.widened(&colour_factors(&self.core, task)?)
        })?;
        Ok(Self {
            core,
            of: self.of.clone(),
            numbers: self.numbers.clone(),
        })
    }

    /// What the tests of the fit say.
    fn judge(&self, py: Python<'_>) -> PyResult<FlightJudgement> {
        Ok(run_here(py, |task| judge_profile(&self.core, true, task))?.into())
    }
}
