//! The tolerances of the tests of a fit, with what a larger or smaller value trades.

/// Levels: a lower one calls fewer right models wrong, and finds fewer wrong ones.
pub(super) struct Levels {
    /// Of each test.
    pub(super) test: f64,
    /// Of the test for a lag where air is found and the plant has none. The air takes the place of
    /// such a lag so well that at 1 % the test misses one in twelve, and at 4 % one in twenty.
    pub(super) lag_in_air: f64,
    /// At which a further lag may not move delay and lag together out of their interval.
    pub(super) moves: f64,
    /// Of the quantiles that widen standard errors where recordings are compared.
    pub(super) compared: f64,
}

/// Level of each test: this share of right fits is called wrong by it.
pub const LEVEL_OF_TESTS: f64 = 0.01;

/// See `Levels`.
pub(super) const LEVELS: Levels = Levels {
    test: LEVEL_OF_TESTS,
    lag_in_air: 0.04,
    moves: 0.05,
    compared: 0.95,
};

/// The test of residuals for whiteness.
pub(super) struct White {
    /// Most autocorrelations: more see longer colour, and less of a short one.
    pub(super) lags: usize,
    /// Rows for each of them: fewer make them less Gaussian.
    pub(super) rows: usize,
    /// Excess of the variance of the statistic over that of chi-squared, in lags over rows, by
    /// simulation: without it, the 1 % level calls 2.5 % of white residuals of 120 rows coloured.
    pub(super) excess: f64,
    /// Deviation of residuals, in that of rounding, up to which they are those of rounding: more
    /// take noise for rounding.
    pub(super) rounding: f64,
}

/// See `White`.
pub(super) const WHITE: White = White {
    lags: 20,
    rows: 4,
    excess: 1.6,
    rounding: 1.5,
};

/// The test for a further lag, and for one with a zero.
pub(super) struct Further {
    /// Starts of the lag, in rows: more find more of its minima.
    pub(super) starts: [f64; 2],
    /// The lag that counts as none, in rows: a longer one is seen.
    pub(super) none: f64,
    /// Accuracy of −2 ln L, and that in long recordings: small beside the rise of a lag that is
    /// significant. From 0.02 on a search takes slopes as they are known, and misses some lags.
    pub(super) rough: f64,
    pub(super) clear: f64,
    /// Starts of a lag with a zero: the lag, and the zero less the lag's own, in rows.
    pub(super) overshoots: [(f64, f64); 2],
}

/// See `Further`.
pub(super) const FURTHER: Further = Further {
    starts: [0.7, 3.0],
    none: 1e-3,
    rough: 0.01,
    clear: 0.3,
    overshoots: [(2.0, 4.0), (8.0, 10.0)],
};

/// The smallest further lag that would have been seen.
pub(super) struct Power {
    /// Probability with which the lag would have been found.
    pub(super) power: f64,
    /// Where the search begins, in rows.
    pub(super) first: f64,
    /// Most evaluations, and the accuracy that ends them: of the length of what is left, as a share.
    pub(super) evaluations: usize,
    pub(super) enough: f64,
    /// Least power of the lag with which that length is taken to grow: less jumps too far.
    pub(super) least_order: f64,
    /// Share of the longest lag from which a search is at it.
    pub(super) near: f64,
    /// Least length that counts, in white deviations: below is rounding.
    pub(super) least: f64,
}

/// See `Power`.
pub(super) const POWER: Power = Power {
    power: 0.9,
    first: 1.0,
    evaluations: 12,
    enough: 0.01,
    least_order: 0.3,
    near: 1.0 - 1e-3,
    least: 1e-9,
};

/// Rows at which the vehicle moves and rests, and the air there.
pub(super) struct Rest {
    /// The vehicle moves at this share of its largest speed: more takes slow motion for rest.
    pub(super) moves: f64,
    /// What its plant lacks shows so many rows longer; so many rows later the vehicle is taken to
    /// rest. More leave fewer rows at rest.
    pub(super) shows: isize,
    pub(super) rests: isize,
    /// Rows over which changes of the residuals are taken.
    pub(super) over: [usize; 3],
    /// Fewest changes of each kind: fewer are compared where they tell nothing.
    pub(super) fewest: usize,
    /// How much longer than usual the time of a change may be, in rows.
    pub(super) uneven: f64,
    /// Most deviations of the sensor noise by which air that changes within a row may move the
    /// output: more takes what the plant lacks for air.
    pub(super) restless: f64,
}

/// See `Rest`.
pub(super) const REST: Rest = Rest {
    moves: 0.25,
    shows: 16,
    rests: 48,
    over: [4, 8, 16],
    fewest: 10,
    uneven: 0.1,
    restless: 15.0,
};

/// Colour of the residuals that is there at rest, too.
pub(super) struct Colour {
    /// Autocorrelations that are compared, and the fewest pairs of rows of which each is known.
    pub(super) lags: usize,
    pub(super) fewest: usize,
    /// Autocorrelations in a covariance: more hold longer colour, and vary more.
    pub(super) window: usize,
    /// Step of difference quotients in times, in rows, and in the gain, as a share of it: smaller
    /// loses digits, larger is no derivative.
    pub(super) time_step: f64,
    pub(super) gain_step: f64,
    /// Share of the largest singular value below which a matrix has none.
    pub(super) singular: f64,
}

/// See `Colour`.
pub(super) const COLOUR: Colour = Colour {
    lags: 20,
    fewest: 50,
    window: 40,
    time_step: 0.02,
    gain_step: 1e-3,
    singular: 1e-15,
};

/// Delays that change over the window.
pub(super) struct Change {
    /// Delays that wander are sums of so many waves at most, one for so many rows: more follow faster
    /// changes, and see less of slow ones.
    pub(super) waves: usize,
    pub(super) rows: usize,
    /// Correlation times of the delays, as shares of the window.
    pub(super) correlation_times: [f64; 4],
    /// Variances that the delays add to the rows along what shows best, in white variances: the least,
    /// how many for a factor of ten, and how many.
    pub(super) least_added: f64,
    pub(super) added_a_decade: f64,
    pub(super) added: usize,
    /// Share of what shows best below which a sum of waves does not show.
    pub(super) shows: f64,
    /// Accuracy of −2 ln L of a fit without air: small beside the fall of a change that is significant.
    pub(super) rough: f64,
    /// How much less likely, in −2 ln L, than a fit with air, scattered times or a coloured sensor
    /// one without these and with delays that wander may be. In air of 0.002 m/s/√s, 1 in 200 flights
    /// with a constant delay is doubted more than at 0, and of flights with a wandering one 1 in 100.
    pub(super) as_likely: f64,
    /// Share of recordings with a constant delay whose statistic is above a chi-square of one degree
    /// of freedom, in which a variance at its bound has a part of one half (Self & Liang 1987), and
    /// less where few rows tell.
    pub(super) some: f64,
    /// A statistic above this is held against so many drawn ones: more cost time, fewer digits.
    pub(super) drawn: f64,
    pub(super) draws: usize,
    /// So many larger ones end the drawing: with the number above, a probability near the level is
    /// always drawn to the end.
    pub(super) enough: usize,
}

/// See `Change`.
pub(super) const CHANGE: Change = Change {
    waves: 12,
    rows: 3,
    correlation_times: [1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0],
    least_added: 0.3,
    added_a_decade: 4.0,
    added: 25,
    shows: 1e-9,
    rough: 0.02,
    as_likely: 1.0,
    some: 0.3,
    drawn: 2.0,
    draws: 4000,
    enough: 100,
};
