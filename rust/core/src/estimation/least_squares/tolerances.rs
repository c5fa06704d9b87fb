//! The tolerances of each stage, with what a larger value trades.

/// The search for a minimum.
pub(super) struct Search {
    /// Starting points that are refined: more find the lowest minimum more often, and cost as much.
    pub(super) refined: usize,
    /// Most evaluations of the misfit in one search.
    pub(super) evaluations: usize,
    /// Fall of the cost, as a share, that a step has to promise where a result is sought: at rounding.
    pub(super) to_rounding: f64,
    /// The same where minima are compared, which are flat: more ends sooner, further away.
    pub(super) to_compare: f64,
    /// The same where a quantity is held: more moves the ends of intervals, by 3e-4 of them for some
    /// hundred rows.
    pub(super) to_hold: f64,
    /// First damping of the steps; more is slower and surer.
    pub(super) damping: f64,
    /// Factor by which damping changes.
    pub(super) change: f64,
    /// Damping at which the search has come to an end.
    pub(super) most_damping: f64,
    /// Distance of a lag to its bound, as a share of delay and lag, at which the search begins again: more
    /// finds lower minima, and costs searches.
    pub(super) on_bound: f64,
}

pub(super) const SEARCH: Search = Search {
    refined: 3,
    evaluations: 200,
    to_rounding: 1e-14,
    to_compare: 1e-6,
    to_hold: 1e-5,
    damping: 1e-3,
    change: 5.0,
    most_damping: 1e12,
    on_bound: 1e-2,
};

/// Weights of several recordings.
pub(super) struct Weighting {
    /// Most iterations.
    pub(super) iterations: usize,
    /// Change at which the weights have converged.
    pub(super) converged: f64,
    /// Least residuals of a recording as a share of the largest of any: less lets rounding outweigh
    /// other recordings.
    pub(super) least_share: f64,
}

pub(super) const WEIGHTING: Weighting = Weighting {
    iterations: 20,
    converged: 1e-6,
    least_share: 1e-6,
};

/// Lags and delays that are set to zero.
pub(super) struct Zero {
    /// Rise of the cost, as a share, that is put up with: more calls small ones zero.
    pub(super) rise: f64,
    /// Factor on the cost at which zero is tried: more finds more of them, and costs searches.
    pub(super) tried: f64,
    /// Distance to the lower bound that counts as on it, as a share of it.
    pub(super) at_bound: f64,
    /// Rounding of one row, as a share of the excitation.
    pub(super) rounding: f64,
}

pub(super) const ZERO: Zero = Zero {
    rise: 1e-6,
    tried: 2.0,
    at_bound: 1e-6,
    rounding: 1e-12,
};

/// Difference quotients.
pub(super) struct Quotient {
    /// Step, as a share of a number, of the time between two rows, or of the excitation: more loses
    /// curvature, less loses digits.
    pub(super) step: f64,
    /// Step from a delay or lag of zero in a continuous loop, in rows: a shorter one makes it stiff.
    pub(super) from_zero: f64,
}

pub(super) const QUOTIENT: Quotient = Quotient {
    step: 1e-5,
    from_zero: 0.25,
};

/// Residuals with memory.
pub(super) struct Memory {
    /// Most correlation of neighbours in the choice of the bandwidth: nearer to 1, it has no end.
    pub(super) most: f64,
    /// Largest bandwidth, as a share of the rows.
    pub(super) longest: usize,
}

pub(super) const MEMORY: Memory = Memory {
    most: 0.97,
    longest: 4,
};

/// Bound of the exponents of the approximated loop, so that unstable ones do not overflow.
pub(super) const LARGEST_EXPONENT: f64 = 50.0;

/// Rows that are read as intervals.
pub(super) struct Rounded {
    /// The noise at which searches begin, in steps: with the first the likelihood is smooth.
    pub(super) noises: [f64; 2],
    /// Least and largest noise, in steps: below the least, rows are intervals with hard ends.
    pub(super) least: f64,
    pub(super) most: f64,
    /// Most steps of a search, and the fall of −2 ln L that a step has to promise and bring.
    pub(super) iterations: usize,
    pub(super) promised: f64,
    /// Readings to either side of the most probable one over which the information of a row is summed.
    pub(super) readings: i32,
    /// Probability of a reading below which it tells nothing.
    pub(super) impossible: f64,
    /// Distance of a reading from the output, in deviations, from which the slope no longer grows.
    pub(super) farthest: f64,
}

/// See `Rounded`.
pub(super) const ROUNDED: Rounded = Rounded {
    noises: [0.5, 0.15],
    least: 0.02,
    most: 3.0,
    iterations: 300,
    promised: 1e-9,
    readings: 12,
    impossible: 1e-30,
    farthest: 1e4,
};
