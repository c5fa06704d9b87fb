//! A zero of a function between two places of different sign.

/// Most halvings: each gains a binary digit, and secants far more.
const STEPS: usize = 200;

/// The zero, to rounding, by secants that keep it between (Ridders 1979).
pub(super) fn zero(function: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let (mut below, mut above) = (function(low), function(high));
    if below == 0.0 {
        return low;
    }
    if above == 0.0 {
        return high;
    }
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        let at_middle = function(middle);
        let root = (at_middle * at_middle - below * above).sqrt();
        let sign = if below < above { -1.0 } else { 1.0 };
        let place = middle + (middle - low) * sign * at_middle / root;
        let place = if place.is_finite() {
            place.clamp(low, high)
        } else {
            middle
        };
        let at_place = function(place);
        if at_place == 0.0 || high - low <= f64::EPSILON * (low.abs() + high.abs()) {
            return place;
        }
        // The tightest of the places that enclose the zero.
        let mut places = [
            (low, below),
            (middle, at_middle),
            (place, at_place),
            (high, above),
        ];
        places.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut pairs = places.windows(2);
        let Some(pair) = pairs.find(|pair| (pair[0].1 < 0.0) != (pair[1].1 < 0.0)) else {
            return place;
        };
        if pair[0].0 == low && pair[1].0 == high {
            return place;
        }
        ((low, below), (high, above)) = (pair[0], pair[1]);
    }
    0.5 * (low + high)
}
