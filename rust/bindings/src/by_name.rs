//! Values by the names of parameters: a dict of Python's, in its order.

use deadtime::stability::Family;
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Names of parameters and the value of each.
pub(crate) struct ByName<T>(Vec<(String, T)>);

impl<'a, 'py, T: FromPyObjectOwned<'py>> FromPyObject<'a, 'py> for ByName<T> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let dict = object.cast::<PyDict>()?;
        let item = |(name, value): (Bound<'py, PyAny>, Bound<'py, PyAny>)| {
            let value = value.extract::<T>().map_err(Into::<PyErr>::into)?;
            Ok((name.extract::<String>()?, value))
        };
        dict.iter().map(item).collect::<PyResult<_>>().map(Self)
    }
}

impl<T> ByName<T> {
    /// The values, in the order of the dict.
    pub(crate) fn values(&self) -> impl Iterator<Item = &T> {
        self.0.iter().map(|(_, value)| value)
    }

    /// The index in `family` of each parameter, in the order of the dict.
    pub(crate) fn places(&self, family: &Family) -> PyResult<Vec<usize>> {
        let place = |(name, _): &(String, T)| {
            let found = family.names().iter().position(|known| known == name);
            found.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "{name}: no such parameter, there is {}",
                    family.names().join(", ")
                ))
            })
        };
        self.0.iter().map(place).collect()
    }

    /// The values in the order of the parameters of `family`, `fill` where there is none.
    pub(crate) fn ordered(&self, family: &Family, fill: T) -> PyResult<Vec<T>>
    where
        T: Copy,
    {
        let mut values = vec![fill; family.names().len()];
        for (place, value) in self.places(family)?.into_iter().zip(self.values()) {
            if let Some(slot) = values.get_mut(place) {
                *slot = *value;
            }
        }
        Ok(values)
    }

    /// A dict with the same names: `values` are in the order of the parameters of `family`.
    pub(crate) fn named<'py, V>(
        &self,
        py: Python<'py>,
        family: &Family,
        values: &[V],
    ) -> PyResult<Bound<'py, PyDict>>
    where
        V: Copy + IntoPyObject<'py>,
    {
        let dict = PyDict::new(py);
        for (place, (name, _)) in self.places(family)?.into_iter().zip(&self.0) {
            if let Some(value) = values.get(place) {
                dict.set_item(name, *value)?;
            }
        }
        Ok(dict)
    }
}
