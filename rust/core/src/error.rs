//! Errors, with the numbers that caused them.

use num_complex::Complex64;

use crate::memory::readable_size;

/// Return [`Error::Argument`] with a formatted message.
macro_rules! refuse {
    ($($message:tt)+) => {
        return Err($crate::Error::Argument(format!($($message)+)))
    };
}

/// Return [`Error::Argument`] with a formatted message if the condition holds.
macro_rules! refuse_if {
    ($condition:expr, $($message:tt)+) => {
        if $condition {
            refuse!($($message)+);
        }
    };
}

/// Every error of the kernel. The message states what was wrong and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// An argument outside what the function is defined for.
    #[error("{0}")]
    Argument(String),

    /// Data from which numbers cannot be told.
    #[error("{0}")]
    NotIdentifiable(String),

    /// A response exceeded the limit for diverging runs.
    #[error(
        "the response exceeds {bound:e} at t = {time} s after the start, so the loop is unstable. \
         End the simulation earlier, lower the gain, or give the loop a limit"
    )]
    Diverges {
        /// The limit that it exceeded.
        bound: f64,
        /// When, s.
        time: f64,
    },

    /// The caller asked to stop (Ctrl-C).
    #[error("interrupted")]
    Interrupted,

    /// Memory that could not be allocated.
    #[error(
        "{what} needs {} of memory, which is not available: compute less at once, or raise the \
         limit of memory",
        readable_size(*bytes)
    )]
    Memory {
        /// Purpose of the memory.
        what: &'static str,
        /// Its size in bytes.
        bytes: u64,
    },

    /// A function of the caller failed; the caller knows its error.
    #[error("a function given by the caller failed")]
    Caller,

    /// An iteration reached its limit; `best` is the last iterate.
    #[error("{what} did not converge from {best}: {advice}")]
    Convergence {
        /// What was being computed.
        what: &'static str,
        /// The last iterate.
        best: Complex64,
        /// What to change.
        advice: String,
    },

    /// A root lies on the contour, or too close to it to decide its side.
    #[error(
        "a root lies on the contour near {:?}{:+?}i, or closer to the contour than double \
         precision can resolve: move the edge of the region by more than {distance:.1e}",
        place.re, place.im
    )]
    Contour {
        /// Where the contour meets the root.
        place: Complex64,
        /// Size of the segment on which the winding number could not be proved.
        distance: f64,
    },

    /// Roots lie on the edge of a region, or closer to it than the radii of their discs.
    #[error(
        "the edge of the region touches {}, and {inside} roots are clearly inside. Move the edge, \
         or say on which side roots at the edge count (edge=\"inside\" or \"outside\")",
        described(roots)
    )]
    OnEdge {
        /// The number of roots inside that do not touch the edge.
        inside: u64,
        /// Centre, radius and number of roots of each disc that meets the edge.
        roots: Vec<(Complex64, f64, u32)>,
    },

    /// The number of roots found and the number counted disagree; the error contains both.
    #[error(
        "{counted} roots were counted in the region, but only {} were located: {advice}",
        found.iter().map(|(_, m)| m).sum::<u32>()
    )]
    CountMismatch {
        /// The number by the argument principle.
        counted: u64,
        /// The located roots and their multiplicities.
        found: Vec<(Complex64, u32)>,
        /// What to change.
        advice: String,
    },

    /// The work exceeds a limit.
    #[error("{what} needs more than {limit} {unit}: {advice}")]
    TooMuch {
        /// What was being computed.
        what: &'static str,
        /// The limit that was reached.
        limit: u64,
        /// The unit of the limit.
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

    /// Shorthand for [`Error::Contour`].
    pub(crate) const fn contour(place: Complex64, distance: f64) -> Self {
        Self::Contour { place, distance }
    }

    /// Does the error end the whole computation? True when the caller asked to stop, or memory is
    /// exhausted; no part of the work may then interpret the error as a result.
    pub const fn ends_all(&self) -> bool {
        matches!(self, Self::Interrupted | Self::Memory { .. })
    }
}

/// The locations of roots on an edge, for a message.
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
