//! What every estimator does, row by row.

use super::answer::Answer;
use crate::Error;

/// An estimator that takes rows as they come.
pub trait Online: Send + Sync {
    /// A command that holds from `time` on.
    ///
    /// # Errors
    ///
    /// If a number is not finite, or the time does not follow that of the command before.
    fn command(&mut self, time: f64, value: f64) -> Result<(), Error>;

    /// A row: its output, or none where that was lost.
    ///
    /// # Errors
    ///
    /// If a number is not finite, or the time does not follow that of the row before.
    fn row(&mut self, time: f64, output: Option<f64>) -> Result<Answer, Error>;
}
