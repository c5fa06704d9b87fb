//! What can go wrong, with the numbers in it.

use num_complex::Complex64;

use crate::memory::in_words;

/// Every failure a kernel can report. The message says what was wrong and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// An argument outside what the function is defined for.
    #[error("{0}")]
    Argument(String),

    /// A response has grown out of bounds.
    #[error(
        "the response exceeds {bound:e} at t = {time} s after the start: the loop is unstable, end \
         the simulation earlier, lower the gain or give it a limit"
    )]
    Diverges {
        /// What it exceeds.
        bound: f64,
        /// When, s.
        time: f64,
    },

    /// The caller asked to stop (Ctrl-C).
    #[error("interrupted")]
    Interrupted,

    /// Memory that was not to be had.
    #[error(
        "{what} needs {} of memory, which the system does not give: ask for less at once, or raise \
         the limit",
        in_words(*bytes)
    )]
    Memory {
        /// What it is for.
        what: &'static str,
        /// How much.
        bytes: u64,
    },

    /// A function of the caller failed; what it said is the caller's to tell.
    #[error("a function given by the caller failed")]
    Caller,

    /// An iteration used up its budget; `best` is the last iterate.
    #[error("{what} did not converge from {best}: {advice}")]
    Convergence {
        /// What was being computed.
        what: &'static str,
        /// The last iterate.
        best: Complex64,
        /// What to change.
        advice: String,
    },

    /// A zero lies on the contour, or too close to it to tell.
    #[error(
        "a root lies on the contour near {:?}{:+?}i, or closer to it than double precision can \
         tell: move the edge of the region by more than {distance:.1e}",
        place.re, place.im
    )]
    Contour {
        /// Where the contour meets the root.
        place: Complex64,
        /// Size of the segment on which the winding could not be proved.
        distance: f64,
    },

    /// Roots lie on the edge of a region, or closer to it than the discs that hold them tell.
    #[error(
        "the edge of the region meets {}; {inside} roots are clearly inside: move the edge, or say \
         to which side roots on it belong (edge=\"inside\" or \"outside\")",
        described(roots)
    )]
    OnEdge {
        /// The number of roots clear of the edge and inside.
        inside: u64,
        /// Centre, radius and number of roots of each disc that meets the edge.
        roots: Vec<(Complex64, f64, u32)>,
    },

    /// Roots found and roots counted disagree; both are given.
    #[error(
        "{counted} roots were counted in the region but {} could be located: {advice}",
        found.iter().map(|(_, m)| m).sum::<u32>()
    )]
    CountMismatch {
        /// What the argument principle says.
        counted: u64,
        /// What was located: root and multiplicity.
        found: Vec<(Complex64, u32)>,
        /// What to change.
        advice: String,
    },

    /// More work than the caller can have meant.
    #[error("{what} needs more than {limit} {unit}: {advice}")]
    TooMuch {
        /// What was being computed.
        what: &'static str,
        /// The limit that was hit.
        limit: u64,
        /// What is being counted.
        unit: &'static str,
        /// What to change.
        advice: String,
    },
}

impl Error {
    /// Shorthand for [`Error::Argument`].
    pub fn argument(message: impl Into<String>) -> Self {
        Self::Argument(message.into())
    }

    /// Whether the whole computation ends with it: the caller has asked to stop, or memory is
    /// gone. No part of the work may take it for a finding.
    pub const fn ends_all(&self) -> bool {
        matches!(self, Self::Interrupted | Self::Memory { .. })
    }
}

/// The places of roots on an edge, as a message names them.
fn described(roots: &[(Complex64, f64, u32)]) -> String {
    const FEW: usize = 3;
    let place = |(root, radius, multiplicity): &(Complex64, f64, u32)| {
        let times = if *multiplicity > 1 {
            format!(" ({multiplicity} roots)")
        } else {
            String::new()
        };
        format!("{:?}{:+?}i within {radius:.1e}{times}", root.re, root.im)
    };
    let listed: Vec<String> = roots.iter().take(FEW).map(place).collect();
    let more = if roots.len() > FEW { ", …" } else { "" };
    listed.join(", ") + more
}
