//! The tolerances of commands between rows, with what each trades.

/// Which samples are missing, and what is known of their commands.
pub(super) struct Gaps {
    /// Rows are that many samples apart, give or take this share of a sample: more takes late rows for
    /// missing ones.
    pub(super) near_whole: f64,
    /// Missing samples in a row from which their mean command is unknown: fewer cost accuracy.
    pub(super) hole: usize,
    /// Most unknown commands, as a share of the rows; the longest gaps come first.
    pub(super) most_unknown: f64,
    /// A command is the controller's where the two differ by less than this share of its deviation: more
    /// takes foreign commands for it.
    pub(super) alike: f64,
    /// Error of the output that is predicted in a hole, in deviations of the white noise.
    pub(super) shared: f64,
}

/// See `Gaps`.
pub(super) const GAPS: Gaps = Gaps {
    near_whole: 0.25,
    hole: 3,
    most_unknown: 0.1,
    alike: 0.2,
    shared: 2.0,
};

/// Commands with times of their own, some of which were lost.
pub(super) struct Log {
    /// Fewest commands that show how they were logged.
    pub(super) fewest: usize,
    /// Share of steps that are alike where that was regular, and of changes where each was logged.
    pub(super) regular: f64,
    pub(super) moves: f64,
    /// A step so many times the usual is a gap.
    pub(super) gap: f64,
    /// Share of the rows at the end in which lost commands may have no effect yet.
    pub(super) end: f64,
    /// Change of the command across a gap, as a share of the range of all and over the usual change,
    /// from which the mean of those around it says too little of the lost ones.
    pub(super) jump: f64,
    pub(super) unusual: f64,
}

/// See `Log`.
pub(super) const LOG: Log = Log {
    fewest: 16,
    regular: 0.6,
    moves: 0.5,
    gap: 1.5,
    end: 0.2,
    jump: 0.05,
    unusual: 3.0,
};

/// Predicting the output of a plant, computing the commands from it, and fitting again.
pub(super) struct Predicted {
    /// Change of the commands, as a share of their range, at which that has settled.
    pub(super) settled: f64,
    /// Rounds of it.
    pub(super) rounds: usize,
    /// Most fits with the commands of the fit before, and the fall of Akaike's criterion that ends them.
    pub(super) refills: usize,
    pub(super) gained: f64,
    /// Most samples at which a reference may have changed that are tried, and by how much of that
    /// criterion one of them has to be the best.
    pub(super) most_ways: usize,
    pub(super) clearly: f64,
}

/// See `Predicted`.
pub(super) const PREDICTED: Predicted = Predicted {
    settled: 1e-5,
    rounds: 6,
    refills: 6,
    gained: 0.5,
    most_ways: 8,
    clearly: 6.0,
};

/// Lengths in rows over which neighbours are averaged, and the farthest neighbour.
pub(super) const LENGTHS: [f64; 7] = [0.3, 0.7, 1.5, 3.0, 6.0, 12.0, 24.0];
pub(super) const REACH: usize = 48;

/// The search for the numbers on which commands in missing rows depend.
pub(super) struct Search {
    /// First steps, in standard errors, before and after the noise is fitted.
    pub(super) steps: [f64; 2],
    /// Most evaluations for each number, and accuracy in −2 ln L and standard errors.
    pub(super) most: usize,
    pub(super) accuracy: f64,
    /// Accuracy of −2 ln L of the noise.
    pub(super) exact: f64,
    /// Most tries of the length over which the curvature is taken, and its length in standard errors:
    /// about that of intervals.
    pub(super) wider: usize,
    pub(super) ends: f64,
    /// Factor on standard errors where air, trim or a coloured sensor move the output across the missing
    /// rows: without it 87 to 90 % of intervals hold the delay of such flights.
    pub(super) in_air: f64,
    /// The grid of starts: delays in sample times around that of the first fit, and factors of its gain.
    pub(super) delays: [f64; 7],
    pub(super) gains: [f64; 3],
}

/// See `Search`.
pub(super) const SEARCH: Search = Search {
    steps: [1.0, 0.3],
    most: 40,
    accuracy: 0.03,
    exact: 1e-6,
    wider: 4,
    ends: 2.0,
    in_air: 1.2,
    delays: [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5],
    gains: [0.85, 1.0, 1.15],
};
