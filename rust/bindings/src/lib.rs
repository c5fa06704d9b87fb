//! The seam between the `deadtime` core and Python: it converts and nothing else.

mod arrays;
mod dde;
mod errors;
mod quasipoly;
mod runtime;
mod special;
mod stability;

use pyo3::prelude::*;

/// Native part of the `deadtime` package; use the names of `deadtime` instead.
#[pymodule(gil_used = false)]
mod _deadtime {
    #[pymodule_export]
    use super::dde::{PyLinearLoop, sampled_abscissa_grid};
    #[pymodule_export]
    use super::quasipoly::QuasiPolynomial;
    #[pymodule_export]
    use super::runtime::{spin, thread_count};
    #[pymodule_export]
    use super::special::{dde_roots, lambertw};
    #[pymodule_export]
    use super::stability::PyFamily;
}
