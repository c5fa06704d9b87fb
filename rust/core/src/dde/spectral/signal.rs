//! A function of time as Legendre series in pieces, which a linear system takes.
//!
//! The pieces are those of [`approximate`], to rounding. A jump is bisected to the last bit, and the
//! pieces are found again with it; a kink is refused.

use super::chebyshev;
use super::fit::{Approximation, UNITS, approximate};
use super::history::Piece;
use crate::Error;
use crate::dde::system::{TERMS, from_values, nodes};

/// Last coefficients relative to the largest value: a smaller share halves pieces for ever, a larger
/// one gives less accurate series.
const ENDED: f64 = 16.0 * f64::EPSILON;

/// Least height of a jump, in units of that.
const HIGH: f64 = 30.0;

/// Distance from a break that was found to where a jump is sought, as a share of the span.
const AROUND: f64 = 1e-9;

/// Upper limit on the even samples of one function (bounds memory and time).
const MOST_SAMPLES: f64 = 1e6;

/// Coefficient k of component i in piece j at (j width + i) TERMS + k.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Ends of the pieces.
    pub edges: Vec<f64>,
    /// Coefficients.
    pub series: Vec<f64>,
    /// Coefficients of a component in a piece.
    pub terms: usize,
    /// Pieces that start with a break.
    pub breaks: Vec<usize>,
}

/// Fit the function of this name and of `width` components on `span` between its breaks; an event
/// longer than `gap` is found.
///
/// # Errors
/// [`Error::Argument`] where it is not smooth between its breaks and jumps, or would take too many
/// pieces or samples; those of the function.
pub fn series(
    name: &str,
    span: (f64, f64),
    gap: f64,
    breaks: &[f64],
    width: usize,
    mut function: impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<Series, Error> {
    let length = span.1 - span.0;
    let kind = name.split(' ').next().unwrap_or(name);
    refuse_if!(
        length / gap > MOST_SAMPLES,
        "max_step={gap} makes more than {MOST_SAMPLES} samples of {name} from {} to {} s. Give a \
         larger max_step, and give the times of shorter changes in {kind}_breaks",
        span.0,
        span.1
    );
    let tolerance = |_: usize, size: f64| ENDED * size;
    let refused = |error| match error {
        Error::TooMuch { limit, unit, .. } => Error::Argument(format!(
            "{name} needs more than {limit} {unit}, because it is too rough or too fast for one \
             run of {length} s. Give a shorter run, or give samples"
        )),
        other => other,
    };
    let fitted = approximate(span, gap, breaks, width, tolerance, &mut function);
    let mut found = fitted.map_err(refused)?;
    let mut known = breaks.to_vec();
    for place in found.breaks.iter().map(|at| at.time) {
        if breaks.contains(&place) {
            continue;
        }
        let inside = (place - span.0).min(span.1 - place) / 5.0;
        let reach = (AROUND * length)
            .max(HIGH * f64::EPSILON * place.abs())
            .min(inside);
        match jump(place, reach, &found.sizes, &mut function)? {
            Some(time) => known.push(time),
            None => refuse_if!(
                is_kink(place, reach, &found.sizes, &mut function)?,
                "{name} is not smooth at t = {place:.10} s: give this time in {kind}_breaks, or \
                 give samples"
            ),
        }
    }
    if known.len() > breaks.len() {
        let fitted = approximate(span, gap, &known, width, tolerance, &mut function);
        found = fitted.map_err(refused)?;
    }
    Ok(of_pieces(&found, width, span.1))
}

/// The first time after a jump within `reach` of a break, if there is one.
fn jump(
    place: f64,
    reach: f64,
    sizes: &[f64],
    function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<Option<f64>, Error> {
    let width = sizes.len();
    let (mut low, mut high) = (place - reach, place + reach);
    let mut ends = vec![0.0; 2 * width];
    function(&[low, high], &mut ends)?;
    let (before, after) = ends.split_at(width);
    let distance =
        |from: &[f64], to: &[f64]| -> f64 { from.iter().zip(to).map(|(a, b)| (a - b).abs()).sum() };
    let mut value = vec![0.0; width];
    let mut middle = 0.5 * (low + high);
    while low < middle && middle < high {
        function(&[middle], &mut value)?;
        if distance(&value, before) <= distance(&value, after) {
            low = middle;
        } else {
            high = middle;
        }
        middle = 0.5 * (low + high);
    }
    let mut sides = vec![0.0; 2 * width];
    function(&[low, high], &mut sides)?;
    let (left, right) = sides.split_at(width);
    let rows = left
        .iter()
        .zip(right)
        .zip(before.iter().zip(after))
        .zip(sizes);
    let mut rows = rows.map(|(((left, right), (before, after)), size)| {
        let height = (right - left).abs();
        height > HIGH * ENDED * size && height > 0.5 * (after - before).abs()
    });
    Ok(rows.any(|is_jump| is_jump).then_some(high))
}

/// Does the slope differ on the two sides of a break? Its change between points at a distance then
/// grows as that, and for a smooth function as the square.
fn is_kink(
    place: f64,
    reach: f64,
    sizes: &[f64],
    function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<bool, Error> {
    let width = sizes.len();
    let times = [-4.0, -2.0, -1.0, 1.0, 2.0, 4.0].map(|step| place + step * reach);
    let mut values = vec![0.0; times.len() * width];
    function(&times, &mut values)?;
    Ok(sizes.iter().enumerate().any(|(i, size)| {
        let growth = |from: usize, to: usize| values[to * width + i] - values[from * width + i];
        let (left, right) = (growth(1, 2), growth(3, 4));
        let (near, far) = (right - left, growth(4, 5) - growth(0, 1));
        let rate = left.abs().max(right.abs()) / reach;
        let blur = 2.0 * UNITS * place.abs() * rate;
        near.abs() > HIGH * ENDED * size + blur && far.abs() < 3.0 * near.abs()
    }))
}

fn of_pieces(found: &Approximation, width: usize, end: f64) -> Series {
    let mut made = Series {
        terms: TERMS,
        ..Series::default()
    };
    for (i, piece) in found.pieces.iter().enumerate() {
        made.edges.push(piece.start);
        if i > 0 && found.breaks.iter().any(|at| at.time == piece.start) {
            made.breaks.push(i);
        }
        made.series.extend(legendre(piece, width));
    }
    made.edges.push(end);
    made
}

/// Legendre coefficients of a piece, component by component.
fn legendre(piece: &Piece, width: usize) -> Vec<f64> {
    let rows = piece.coefficients.chunks_exact(piece.terms).take(width);
    rows.flat_map(|row| {
        let values = nodes().map(|x| chebyshev::value(row, x));
        let mut series = from_values(&values);
        // Of a polynomial of lower degree the others are rounding.
        series[piece.terms..].fill(0.0);
        series
    })
    .collect()
}
