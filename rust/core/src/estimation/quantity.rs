//! What a profile holds.

/// A quantity that a profile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The delay.
    Delay,
    /// Delay and lags together.
    Total,
    /// The gain.
    Gain,
    /// A lag.
    Lag(usize),
}
