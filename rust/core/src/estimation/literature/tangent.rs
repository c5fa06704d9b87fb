//! The straight part of the rise of a step response, by iteration.

/// Most iterations; one that has not converged by then alternates between two sets of samples.
const ITERATIONS: usize = 30;

/// Rounding of times, s: of samples at the ends of the part, and of a delay that no longer moves.
const ROUNDING: (f64, f64) = (1e-9, 1e-12);

/// Where the line through the straight part meets the initial output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tangent {
    /// So many samples on the part from one time to another: too few.
    Few(usize, f64, f64),
    /// The line does not rise.
    Falls,
    /// Time after the step, and its standard error.
    Meets(f64, f64),
}

/// The line through what lies from the delay to `held` samples later, from a first guess of the delay.
pub fn tangent(
    since: &[f64],
    travelled: &[f64],
    guess: f64,
    held: Option<f64>,
    noise: f64,
) -> Tangent {
    let mut delay = guess;
    let mut found = Tangent::Falls;
    for _ in 0..ITERATIONS {
        // A sampled loop sees a movement at the next sample.
        let seen = held.map_or(delay, |h| h * (delay / h - ROUNDING.0).ceil());
        let until = delay + seen;
        let rows = since.iter().zip(travelled);
        let on: Vec<(f64, f64)> = rows
            .filter(|(t, _)| **t >= delay && **t <= until + ROUNDING.0)
            .map(|(t, x)| (*t, *x))
            .collect();
        if on.len() < 2 {
            return Tangent::Few(on.len(), delay, until);
        }
        let count = on.len() as f64;
        let centre = on.iter().map(|(t, _)| t).sum::<f64>() / count;
        let mean = on.iter().map(|(_, x)| x).sum::<f64>() / count;
        let power: f64 = on.iter().map(|(t, _)| (t - centre).powi(2)).sum();
        let slope = on.iter().map(|(t, x)| (t - centre) * x).sum::<f64>() / power;
        if slope <= 0.0 {
            return Tangent::Falls;
        }
        let place = centre - mean / slope;
        let variance = (noise / slope).powi(2) * (1.0 / count + (centre - place).powi(2) / power);
        found = Tangent::Meets(place, variance.sqrt());
        if !(place > 0.0 && place < 2.0 * delay) || (place - delay).abs() < ROUNDING.1 {
            break;
        }
        delay = place;
    }
    found
}
