//! The tolerances of each stage of a fit, with what a larger or smaller value trades.

/// The grid of delays and lags from which searches start.
pub(super) struct Start {
    /// Longest delay, as a share of the window: larger finds delays that leave few rows.
    pub(super) longest: f64,
    /// Steps of the grid in air, in rows and as a share of the delay: smaller misses fewer minima
    /// and costs evaluations.
    pub(super) step: f64,
    pub(super) growth: f64,
    /// Parts of a row at which delays of the grid are where rows are even, so that one response
    /// serves many, and the share of a part by which even rows differ at most.
    pub(super) parts_of_row: f64,
    pub(super) even: f64,
    /// Lags of the grid in rows, and factors of it over a time constant.
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

/// Prices in Akaike's criterion.
pub(super) struct Prices {
    /// Of the two numbers of coloured sensor noise (Akaike 1974). Air has none: no air is the lower
    /// bound of its deviation.
    pub(super) sensor: f64,
    /// Of the trim, twice that, because it would cost accuracy on a calm flight.
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
