//! Certificates of `deadtime::roots`: the parts of a proved count.

use deadtime::roots;
use num_complex::Complex64;
use pyo3::prelude::*;

type Range = (f64, f64);

/// A straight line without a root.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Segment {
    start: Complex64,
    end: Complex64,
    middle: Complex64,
    reference: usize,
    value: Complex64,
    error: f64,
    slope: f64,
}

impl From<&roots::Segment> for Segment {
    fn from(part: &roots::Segment) -> Self {
        Self {
            start: part.start,
            end: part.end,
            middle: part.middle,
            reference: part.reference,
            value: part.value,
            error: part.error,
            slope: part.slope,
        }
    }
}

/// A part of the real axis on which the derivative has no zero.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Monotone {
    start: f64,
    end: f64,
    middle: f64,
    reference: usize,
    slope: f64,
    error: f64,
    bend: f64,
}

/// A path around a rectangle.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Contour {
    re: Range,
    im: Range,
    symmetric: bool,
    count: u64,
    segments: Vec<Py<Segment>>,
}

impl Contour {
    fn new(py: Python<'_>, path: &roots::Contour) -> PyResult<Self> {
        let segments = path.segments.iter();
        Ok(Self {
            re: path.re,
            im: path.im,
            symmetric: path.symmetric,
            count: path.count,
            segments: segments
                .map(|part| Py::new(py, Segment::from(part)))
                .collect::<PyResult<_>>()?,
        })
    }
}

/// A count and its proof.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Certificate {
    region: (Range, Range),
    count: u64,
    scale: i32,
    zeros: u32,
    beyond: Option<(usize, f64)>,
    closed: (Range, Range),
    contours: Vec<Py<Contour>>,
    /// Segments and monotone parts.
    real: Vec<Py<PyAny>>,
}

impl Certificate {
    pub(crate) fn new(py: Python<'_>, proof: &roots::Certificate) -> PyResult<Self> {
        let contours = proof.contours.iter();
        Ok(Self {
            region: (proof.region.re, proof.region.im),
            count: proof.count,
            scale: proof.scale,
            zeros: proof.zeros,
            beyond: proof.beyond,
            closed: (proof.closed.re, proof.closed.im),
            contours: contours
                .map(|path| Py::new(py, Contour::new(py, path)?))
                .collect::<PyResult<_>>()?,
            real: proof
                .real
                .iter()
                .map(|part| real_part(py, part))
                .collect::<PyResult<_>>()?,
        })
    }
}

fn real_part(py: Python<'_>, part: &roots::RealPart) -> PyResult<Py<PyAny>> {
    Ok(match *part {
        roots::RealPart::Empty(ref empty) => Py::new(py, Segment::from(empty))?.into_any(),
        roots::RealPart::Monotone {
            start,
            end,
            middle,
            reference,
            slope,
            error,
            bend,
        } => {
            let part = Monotone {
                start,
                end,
                middle,
                reference,
                slope,
                error,
                bend,
            };
            Py::new(py, part)?.into_any()
        }
    })
}
