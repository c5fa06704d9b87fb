//! An estimator whatever the number of its states.

use super::bank::Bank;
use super::row_by_row::Online;
use super::settings::Settings;
use crate::Error;

/// An estimator with these settings.
///
/// # Errors
///
/// If a setting is out of its range, or a cell would have more than nine states.
pub fn online(settings: Settings) -> Result<Box<dyn Online>, Error> {
    settings.check()?;
    macro_rules! bank {
        ($($states:literal)*) => {
            match settings.states() {
                $(..=$states => Ok(Box::new(Bank::<$states>::new(settings)?)),)*
                n => refuse!("plant, noise, gain and level have {n} states, but the filters can \
                    use at most 9"),
            }
        };
    }
    // A size for each number of states would take the compiler three times as long.
    bank!(4 5 9)
}
