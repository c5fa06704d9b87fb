//! The matrices of a system, its past and its inputs, each checked once.

use super::legendre::TERMS;
use super::terms::Term;
use super::track;
use super::track::{Piece, Track};
use crate::Error;
use crate::dde::limits::finite;
use crate::memory::require;

/// The matrices by their delays, row-major, and their sizes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SystemEquations {
    /// Number of states n.
    pub states: usize,
    /// Number of inputs p.
    pub inputs: usize,
    /// Number of outputs q.
    pub outputs: usize,
    /// A_j, n × n.
    pub state: Vec<Term>,
    /// N_j, n × n, with delays above zero.
    pub derivative: Vec<Term>,
    /// B_j, n × p.
    pub input: Vec<Term>,
    /// C_j, q × n.
    pub output: Vec<Term>,
    /// F_j, q × n.
    pub output_derivative: Vec<Term>,
    /// D_j, q × p.
    pub direct: Vec<Term>,
}

/// A vector function of time, in pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    pub(super) track: Track,
    /// Starts of the pieces at which the function or a derivative may jump.
    pub(super) breaks: Vec<usize>,
}

/// Initial values at time 0 and the past.
#[derive(Debug, Clone, PartialEq)]
pub struct Past {
    /// x(0), n.
    pub state: Vec<f64>,
    /// x before, as far back as the largest delay.
    pub history: Signal,
    /// Its derivative; not needed without N_j and F_j.
    pub slopes: Option<Signal>,
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SystemResponse {
    /// y at the times, one after the other.
    pub outputs: Vec<f64>,
    /// x at the times.
    pub states: Vec<f64>,
    /// u at the times.
    pub inputs: Vec<f64>,
    /// Times at which one of them, or one of its first ten derivatives, jumps.
    pub breaks: Vec<f64>,
}

impl Signal {
    /// Pieces between the `edges`, each with `terms` Legendre coefficients in each of `width`
    /// columns, one piece after the other; those listed in `breaks` start with a break.
    pub fn new(
        width: usize,
        edges: &[f64],
        terms: usize,
        series: &[f64],
        breaks: Vec<usize>,
    ) -> Result<Self, Error> {
        let count = edges.len().saturating_sub(1);
        refuse_if!(
            count == 0 || terms == 0 || terms > TERMS,
            "{} edges and {terms} coefficients are not a signal: give at least two edges and 1 to \
             {} coefficients",
            edges.len(),
            TERMS
        );
        refuse_if!(
            series.len() != count * width * terms,
            "{} coefficients do not fit {count} pieces of {width} columns with {terms} each",
            series.len()
        );
        if let Some(pair) = edges.windows(2).find(|pair| pair[1] <= pair[0]) {
            refuse!(
                "the time {} of a signal is not later than {}: give increasing times",
                pair[1],
                pair[0]
            );
        }
        finite("a signal", series)?;
        // A piece with its series; a run works on a copy.
        require::<[f64; 48]>("the signal", edges.len())?;
        let piece = |(i, pair): (usize, &[f64])| {
            let own = &series[i * width * terms..(i + 1) * width * terms];
            let degree = own
                .chunks_exact(terms)
                .filter_map(|column| column.iter().rposition(|c| *c != 0.0))
                .max()
                .unwrap_or(0);
            refuse_if!(
                degree > 0 && !(pair[0].is_finite() && pair[1].is_finite()),
                "a piece of a signal without a finite start and end must be constant"
            );
            let series = own
                .chunks_exact(terms)
                .flat_map(|column| &column[..=degree])
                .copied()
                .collect();
            Ok(Piece::new(pair[0], pair[1], degree, series))
        };
        let pieces: Result<Vec<Piece>, Error> = edges.windows(2).enumerate().map(piece).collect();
        let mut pieces = pieces?;
        track::share_rounding(&mut pieces);
        Ok(Self {
            track: Track::new(width, pieces),
            breaks,
        })
    }

    /// The same values at all times.
    pub fn constant(values: &[f64]) -> Result<Self, Error> {
        let edges = [f64::NEG_INFINITY, f64::INFINITY];
        Self::new(values.len(), &edges, 1, values, Vec::new())
    }

    /// A step from `before` to `after` at time 0.
    pub fn step(before: &[f64], after: &[f64]) -> Result<Self, Error> {
        let edges = [f64::NEG_INFINITY, 0.0, f64::INFINITY];
        Self::new(before.len(), &edges, 1, &[before, after].concat(), vec![1])
    }
}
