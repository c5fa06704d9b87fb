//! Does the noise grow with the speed of the output, as it does where time stamps are not the times of
//! the samples (Breusch & Pagan 1979)?

use super::colour::colour_of_squares;
use crate::estimation::statistics::normal_beyond;
use crate::linear_algebra::vectors::dot;

/// Probability of squares that grow so much with the squared speed, for equal variances.
pub(super) fn grows_with_speed(whitened: &[f64], rate: &[f64], is_coloured: bool) -> f64 {
    let squares: Vec<f64> = whitened.iter().map(|one| one * one).collect();
    let mut speed: Vec<f64> = rate.iter().map(|one| one * one).collect();
    let mean = speed.iter().sum::<f64>() / speed.len() as f64;
    speed.iter_mut().for_each(|one| *one -= mean);
    let power = dot(&speed, &speed);
    if power == 0.0 {
        return 1.0;
    }
    let slope = dot(&speed, &squares) / power;
    // The variance of the square of a Gaussian of variance one is two.
    let wider = if is_coloured {
        colour_of_squares(whitened, &speed)
    } else {
        1.0
    };
    normal_beyond(slope * (0.5 * power / wider).sqrt())
}
