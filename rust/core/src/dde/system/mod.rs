//! Linear systems with any number of delays, retarded or neutral, of any order.
//!
//!   x′(t) + Σ N_j x′(t − τ_j) = Σ A_j x(t − τ_j) + Σ B_j u(t − τ_j),
//!   y(t) = Σ C_j x(t − τ_j) + Σ F_j x′(t − τ_j) + Σ D_j u(t − τ_j).
//!
//! Method of steps on Legendre elements no longer than the smallest delay: everything delayed is
//! known, and x′ = A_0 x + g is solved for all coefficients at once ([`solver`]). Elements end on
//! breaking points. At one, the jumps of all derivatives obey the equation themselves; a bound on
//! them is carried along ([`jumps`]), and a break that a single polynomial takes to rounding ends
//! no element any more. Legendre rather than Taylor, because what is smooth again is then read
//! across the ends of earlier elements without loss, whatever the ratios of the delays, and
//! because a stiff A_0 restricts the length only while its transients last.
//! x may jump at 0; in a neutral system x + Σ N_j x(t − τ_j) is what has no later jumps.
//! Guaranteed: series truncated below rounding, normwise in every row of the equation. Not
//! guaranteed: speed where a delay is tiny against the time, or breaks of a neutral system with
//! several delays fade slowly: refused beyond a bound.

mod element;
mod given;
mod jumps;
mod legendre;
mod outputs;
mod run;
mod solver;
mod terms;
mod track;

#[cfg(test)]
mod tests;

use crate::memory::room;
use crate::{Error, Task};

pub use terms::Term;
use track::{Piece, Track};

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

/// A vector function of time by pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    track: Track,
    /// Starts of the pieces at which the function or a derivative may jump.
    breaks: Vec<usize>,
}

/// State of affairs at time 0 and before.
#[derive(Debug, Clone, PartialEq)]
pub struct Past {
    /// x(0), n.
    pub state: Vec<f64>,
    /// x before, as far back as the largest delay.
    pub history: Signal,
    /// Its derivative; not needed without N_j and F_j.
    pub slopes: Option<Signal>,
}

/// What a run returns.
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

/// A validated system.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearSystem {
    equations: SystemEquations,
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
        if count == 0 || terms == 0 || terms > legendre::TERMS {
            return Err(Error::argument(format!(
                "{} edges and {terms} coefficients make no signal: give at least two edges and 1 \
                 to {} coefficients",
                edges.len(),
                legendre::TERMS
            )));
        }
        if series.len() != count * width * terms {
            return Err(Error::argument(format!(
                "{} coefficients for {count} pieces of {width} columns with {terms} each",
                series.len()
            )));
        }
        if let Some(pair) = edges.windows(2).find(|pair| pair[1] <= pair[0]) {
            return Err(Error::argument(format!(
                "the time {} of a signal does not come after {}: give increasing times",
                pair[1], pair[0]
            )));
        }
        if let Some(value) = series.iter().find(|value| !value.is_finite()) {
            return Err(Error::argument(format!(
                "a signal holds {value}: give finite numbers"
            )));
        }
        // A piece with its series; a run works on a copy.
        room::<[f64; 48]>("the signal", edges.len())?;
        let piece = |(i, pair): (usize, &[f64])| {
            let own = &series[i * width * terms..(i + 1) * width * terms];
            let degree = own
                .chunks_exact(terms)
                .filter_map(|column| column.iter().rposition(|c| *c != 0.0))
                .max()
                .unwrap_or(0);
            if degree > 0 && !(pair[0].is_finite() && pair[1].is_finite()) {
                return Err(Error::argument(
                    "a signal without end changes: only a constant may",
                ));
            }
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

impl LinearSystem {
    /// Check and keep.
    pub fn new(equations: SystemEquations) -> Result<Self, Error> {
        let (n, p, q) = (equations.states, equations.inputs, equations.outputs);
        let groups = [
            ("A", &equations.state, n, n),
            ("N", &equations.derivative, n, n),
            ("B", &equations.input, n, p),
            ("C", &equations.output, q, n),
            ("F", &equations.output_derivative, q, n),
            ("D", &equations.direct, q, p),
        ];
        for (name, terms, rows, columns) in groups {
            for term in terms {
                term.check(name, rows, columns)?;
            }
        }
        if equations.derivative.iter().any(|term| term.delay == 0.0) {
            return Err(Error::argument(
                "N has a matrix with delay 0: take it to the other side, into E",
            ));
        }
        Ok(Self { equations })
    }

    /// The matrices.
    pub fn equations(&self) -> &SystemEquations {
        &self.equations
    }

    /// y, x and u at `times` (increasing, ≥ 0, s).
    pub fn simulate(
        &self,
        past: Past,
        inputs: &Signal,
        times: &[f64],
        task: &Task,
    ) -> Result<SystemResponse, Error> {
        let n = self.equations.states;
        let widths = [
            ("the initial state", past.state.len(), n),
            ("the history", past.history.track.width(), n),
            ("the input", inputs.track.width(), self.equations.inputs),
        ];
        for (name, found, wanted) in widths {
            if found != wanted {
                return Err(Error::argument(format!(
                    "{name} has {found} components, not {wanted}"
                )));
            }
        }
        if past
            .slopes
            .as_ref()
            .is_some_and(|slopes| slopes.track.width() != n)
        {
            return Err(Error::argument(format!(
                "the derivative of the history does not have {n} components"
            )));
        }
        if let Some(value) = past.state.iter().find(|value| !value.is_finite()) {
            return Err(Error::argument(format!(
                "the initial state holds {value}: give finite numbers"
            )));
        }
        if let Some(time) = times.iter().find(|time| !time.is_finite()) {
            return Err(Error::argument(format!(
                "the times hold {time}: give finite ones"
            )));
        }
        if let Some(first) = times.first().filter(|first| **first < 0.0) {
            return Err(Error::argument(format!(
                "time {first} lies before the start of the run: leave it out"
            )));
        }
        if let Some(pair) = times.windows(2).find(|pair| pair[1] <= pair[0]) {
            return Err(Error::argument(format!(
                "time {} does not come after {}: give increasing times",
                pair[1], pair[0]
            )));
        }
        run::run(&self.equations, past, inputs, times, task)
    }
}

/// The Gauss nodes at which series are taken from values, and what takes those to coefficients: the
/// part of value i in coefficient k at i m + k, m being the number of both.
pub fn legendre_tables() -> (Vec<f64>, Vec<f64>) {
    (legendre::nodes().to_vec(), legendre::transform().concat())
}

/// Two times closer than this are one: rounding of sums of delays.
fn slack(t: f64, longest: f64) -> f64 {
    16.0 * f64::EPSILON * (t.abs() + longest)
}
