//! The tolerances of each stage of a fit, with what a larger or smaller value trades.

/// The grid of delays and lags from which searches start.
pub(super) struct Start {
    /// Longest delay, as a share of the window: a longer one leaves few rows that tell.
    pub(super) longest: f64,
    /// Steps of the grid in air, in rows and as a share of the delay: smaller ones miss fewer minima
    /// and cost evaluations.
    pub(super) step: f64,
    pub(super) growth: f64,
    /// Parts of a row at which delays of the grid are where rows are even: more are closer to the
    /// grid that was asked for, fewer have more delays whole rows apart, which one response serves.
    pub(super) parts_of_row: f64,
    /// Share of a part by which even rows differ at most.
    pub(super) even: f64,
    /// Lags of the grid in rows, and factors of it over a time constant: more miss fewer minima.
    pub(super) lags: [f64; 3],
    pub(super) factors: [f64; 3],
    /// How much shorter each further lag is: equal lags have the same effect, so that a search does
    /// not move from them.
    pub(super) shorter: f64,
    /// Local minima of the grid that are refined, for each noise.
    pub(super) refined: usize,
    /// Most points of the grid of least squares, and its step in rows: the cost has minima less than
    /// a row apart, but not where a lag makes the response smooth.
    pub(super) most_points: f64,
    pub(super) sharp_step: f64,
    pub(super) smooth_step: f64,
}

/// See `Start`.
pub(super) const START: Start = Start {
    longest: 0.6,
    step: 1.0,
    growth: 0.1,
    parts_of_row: 4.0,
    even: 1e-8,
    lags: [0.5, 3.0, 8.0],
    factors: [0.3, 1.0, 3.0],
    shorter: 0.4,
    refined: 2,
    most_points: 600.0,
    sharp_step: 0.25,
    smooth_step: 1.0,
};

/// Prices in Akaike's criterion: a higher one keeps a part of the noise out of more recordings, and
/// leaves it out of more that have it.
pub(super) struct Prices {
    /// Of the two numbers of coloured sensor noise (Akaike 1974). Air has none: no air is the lower
    /// bound of its deviation.
    pub(super) sensor: f64,
    /// Of the trim, about twice that, because it would cost accuracy on a calm flight.
    pub(super) trim: f64,
    /// Of times that scatter.
    pub(super) scatter: f64,
}

/// See `Prices`.
pub(super) const PRICES: Prices = Prices {
    sensor: 4.0,
    trim: 9.0,
    scatter: 4.0,
};

/// The search for plant and noise.
pub(super) struct Search {
    /// Accuracy of −2 ln L where fits are compared, and of the fit that is kept.
    pub(super) rough: f64,
    pub(super) fine: f64,
    /// Deviations of strong and of weak air: white deviations a row, or white deviations where the
    /// plant does not integrate.
    pub(super) strong: [f64; 2],
    pub(super) weak: [f64; 2],
    /// Time constant of the air, as a share of the window, and by how much slow air is slower.
    pub(super) air_time: f64,
    pub(super) slow: f64,
    /// Start of the coloured sensor noise: white deviations, and rows.
    pub(super) sensor: f64,
    pub(super) sensor_time: f64,
    /// Rise of the criterion with trim, for each recording, from which no other air is tried with it:
    /// of 608 recordings trim won 22, in which it had fallen there.
    pub(super) doubtful: f64,
    /// Air with a shorter time constant, in rows, may be coloured noise of the sensor.
    pub(super) fast: f64,
    /// The shortest lag, in rows.
    pub(super) shortest: f64,
    /// Rise of −2 ln L without air, or without a lag, up to which it is none.
    pub(super) idle: f64,
    /// Times that scatter by more rows than this are no scatter.
    pub(super) most_scatter: f64,
    /// A command with more changes a row than this moves steadily, as that behind limits of its rate,
    /// and has no times that may scatter.
    pub(super) steady: f64,
}

/// See `Search`.
pub(super) const SEARCH: Search = Search {
    rough: 0.02,
    fine: 1e-6,
    strong: [0.65, 3.0],
    weak: [0.02, 0.3],
    air_time: 0.13,
    slow: 10.0,
    sensor: 1.0,
    sensor_time: 2.0,
    doubtful: 4.0,
    fast: 3.0,
    shortest: 1e-3,
    idle: 1e-3,
    most_scatter: 1.0,
    steady: 2.0,
};

/// Rows that are left out.
pub(super) struct Outliers {
    /// Robust deviations beyond which a row is one: fewer leave out rows of a Gaussian.
    pub(super) spike: f64,
    /// Most of them, as a share of the rows: more are no outliers.
    pub(super) most: f64,
    /// Half a window of the median that spikes are measured from, in rows.
    pub(super) half_window: usize,
    /// Median absolute deviation of a Gaussian.
    pub(super) median: f64,
    /// The least robust deviation, as a share of the plain one.
    pub(super) least: f64,
    /// Rounds of leaving them out.
    pub(super) rounds: usize,
    /// Shortest lag of a start, in rows: shorter ones are a delay there.
    pub(super) start_lag: f64,
}

/// See `Outliers`.
pub(super) const OUTLIERS: Outliers = Outliers {
    spike: 6.0,
    most: 0.15,
    half_window: 2,
    median: 0.6745,
    least: 0.1,
    rounds: 3,
    start_lag: 0.5,
};

/// Recordings on a part of which the search is made.
pub(super) struct Long {
    /// Most rows of a search: more take longer and start nearer to the maximum of all rows.
    pub(super) part: usize,
    /// Parts overlap so that each row is in so many of them.
    pub(super) overlap: usize,
    /// Accuracy of −2 ln L of the maximum on all rows.
    pub(super) close: f64,
}

/// See `Long`.
pub(super) const LONG: Long = Long {
    part: 5000,
    overlap: 4,
    close: 5e-3,
};

/// Intervals.
pub(super) struct Intervals {
    /// Level of the intervals with which a search for likelier fits goes.
    pub(super) level: f64,
    /// Step of difference quotients in the logarithms of the numbers of the noise.
    pub(super) step: f64,
    /// Least curvature of the likelihood in them: their range is bounded, whatever the recording
    /// says.
    pub(super) least_curvature: f64,
    /// Fewest degrees of freedom: fewer are a failure of the parabola, not of the recording.
    pub(super) least_freedom: f64,
    /// A held fit that is lower than the best by this much is another, better minimum.
    pub(super) better: f64,
    /// Most restarts from better minima.
    pub(super) restarts: usize,
    /// Air that may be there unseen, as powers of two of the weak air of the search.
    pub(super) unseen: [i32; 11],
    /// Most that −2 ln L may fall with it: the fit was its minimum.
    pub(super) falls: f64,
    /// Error in rows from which a lag shorter than a row counts as not resolved, and the error in
    /// rows that it then has: half a row is its interval.
    pub(super) unresolved: f64,
    pub(super) split: f64,
    /// Least half width from which the search for an end starts.
    pub(super) reach: f64,
    /// Share of the largest direction of an information below which it tells nothing.
    pub(super) told: f64,
}

/// See `Intervals`.
pub(super) const INTERVALS: Intervals = Intervals {
    level: 0.95,
    step: 0.1,
    least_curvature: 0.25,
    least_freedom: 4.0,
    better: 0.02,
    restarts: 8,
    unseen: [-6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4],
    falls: -1.0,
    unresolved: 4.0,
    split: 0.25,
    reach: 1e-9,
    told: 1e-15,
};

/// Longest delay of a search, as a share of the window.
pub const LONGEST_DELAY: f64 = START.longest;

/// Factors of a time constant at which searches start.
pub(super) const LAG_FACTORS: [f64; 3] = START.factors;

/// The shortest lag of a search, in rows.
pub(super) const SHORTEST_LAG: f64 = SEARCH.shortest;

/// A fitted lag below so many times its lower bound is none: more takes short lags for delay.
pub(super) const NO_LAG: f64 = 2.0;

/// Rounded outputs.
pub(super) struct Rounded {
    /// Steps are multiples of the least, within this share of it.
    pub(super) alike: f64,
    /// Least share of the rows that are equal to the row before: fewer take any decimal log for rounded.
    pub(super) still: f64,
    /// Share of the rows at which a rounded output turns back from which its noise is about half a step.
    pub(super) dithered: f64,
}

/// See `Rounded`.
pub(super) const ROUNDED: Rounded = Rounded {
    alike: 1e-6,
    still: 0.2,
    dithered: 0.18,
};

/// Sensors that read in coarse steps.
pub(super) struct Coarse {
    /// Moves below this share of the range are rounding of numbers.
    pub(super) rounding: f64,
    /// Moves are multiples of a step, within this part of it, and this share of the multiple.
    pub(super) alike: (f64, f64),
    /// Steps between the least and the largest reading from which on rounding acts like noise. Fewer:
    /// rounding is correlated with the output, and intervals do not hold.
    pub(super) levels: f64,
    /// Deviation of the residuals, in steps, below which they are mostly rounding, whose own is 0.29. Larger:
    /// noise of a sensor is taken for rounding.
    pub(super) noise: f64,
}

/// See `Coarse`.
pub(super) const COARSE: Coarse = Coarse {
    rounding: 1e-9,
    alike: (0.01, 1e-5),
    levels: 32.0,
    noise: 0.5,
};

/// Numbers that are searched around the likelihood.
pub(super) struct Around {
    /// Distance of the points around the start of the search, in the logarithm of a number; its first
    /// step, its accuracy in it and in −2 ln L, and the most evaluations for each number.
    pub(super) away: f64,
    pub(super) step: f64,
    pub(super) accuracy: (f64, f64),
    pub(super) most: usize,
    /// Searches: one that ended in a valley is begun again.
    pub(super) searches: usize,
    /// Accuracy of −2 ln L in that search, and at its end.
    pub(super) close: f64,
    pub(super) exact: f64,
    /// Curvature in the logarithm of a number from which it is known: one that may be e times as large
    /// is not.
    pub(super) least_curvature: f64,
    /// Steps of difference quotients: the first, by which −2 ln L has to rise at least, and the longest.
    pub(super) quotient: f64,
    pub(super) least_rise: f64,
    pub(super) longest: f64,
}

/// See `Around`.
pub(super) const AROUND: Around = Around {
    away: 0.25,
    step: 0.05,
    accuracy: (1e-3, 1e-4),
    most: 40,
    searches: 2,
    close: 1e-3,
    exact: 1e-6,
    least_curvature: 1.0,
    quotient: 0.01,
    least_rise: 2.0,
    longest: 0.32,
};

/// Most numbers that are searched so: the points around the start are three to the power of them.
pub const MOST_NUMBERS: usize = 4;

/// Ratio of what is left to that of least squares from which the noise stands for the plant. Smaller: noise
/// is doubted; larger: noise takes the place of a lag.
pub(super) const LESS: f64 = 1.5;
