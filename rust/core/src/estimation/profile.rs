//! The profile of the likelihood over one quantity, and the ends of an interval.

use super::fit::{Fit, Model, Search};
use super::likelihood::Noise;
use super::point::{Point, Quantity, Timing};
use super::search::Accuracy;
use super::variables::SHORTEST_LAG;
use crate::{Error, Task};

/// Farthest end of an interval, in Gaussian half widths.
const FARTHEST: f64 = 64.0;

/// Accuracy of an end, as a share of the half width.
const TOLERANCE: f64 = 4e-3;

/// Widest first step to the end of an interval of a time, as a share of delay and lag together.
const WIDEST: f64 = 0.25;

/// Accuracy of −2 ln L where a quantity is held.
const RISE_TOLERANCE: f64 = 2e-3;

/// The same on the way to an end: what the known slopes lack moves it by less than `TOLERANCE`.
const ON_THE_WAY: Accuracy = Accuracy {
    tolerance: RISE_TOLERANCE,
    takes_known: true,
};

/// Farthest guess beyond what was seen of a profile, as a multiple of it.
const BEYOND: f64 = 2.0;

/// A lag of at most so many times the shortest is none; a second search starts at this one, in rows.
const AT_LEAST: f64 = 2.0;
const SECOND_LAG: f64 = 1.5;

/// Most refinements of an end.
const REFINEMENTS: usize = 12;

/// How far the search for an end goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The least end.
    pub floor: f64,
    /// How far below that of the best fit −2 ln L is where the search ends, because the best is none.
    pub lower: f64,
}

impl Limits {
    /// The least end alone.
    pub fn floor(floor: f64) -> Self {
        Self {
            floor,
            lower: f64::INFINITY,
        }
    }
}

/// What was seen of a profile on one side.
#[derive(Debug, Default)]
pub(super) struct Seen {
    inverse: Option<Vec<f64>>,
    other: Option<Fit>,
}

impl Quantity {
    /// Where the line through two points of a profile has the quantity at this value: straight in
    /// times and gain, and in the logarithms of lags and of the numbers of the noise.
    fn guess(self, near: &Point, before: &Point, value: f64) -> Point {
        let own = self.value(near);
        let share = (value - own) / (own - self.value(before));
        if share.is_nan() || share.abs() > BEYOND || near.lags.len() != before.lags.len() {
            return near.clone();
        }
        let straight = |near: f64, before: f64| near + share * (near - before);
        let curved = |near: f64, before: f64| {
            let moved = near * libm::pow(near / before, share);
            if moved.is_finite() && near != 0.0 {
                moved
            } else {
                near
            }
        };
        let lags = near.lags.iter().zip(&before.lags);
        let noise = near.noise.iter().zip(&before.noise);
        let lags: Vec<f64> = lags.map(|(near, before)| curved(*near, *before)).collect();
        let zero = straight(near.zero, before.zero);
        let timing = match near.timing {
            Timing::Delay(delay) => Timing::Delay(straight(delay, before.delay())),
            Timing::Total(total) => {
                let least = lags.iter().sum::<f64>() - zero;
                Timing::Total(straight(total, before.total()).max(least))
            }
        };
        Point {
            timing,
            lags,
            zero,
            gain: straight(near.gain, before.gain),
            noise: noise
                .map(|(near, before)| Noise {
                    air_time: curved(near.air_time, before.air_time),
                    air: curved(near.air, before.air),
                    sensor_time: curved(near.sensor_time, before.sensor_time),
                    sensor: curved(near.sensor, before.sensor),
                    stamps: curved(near.stamps, before.stamps),
                    arrivals: curved(near.arrivals, before.arrivals),
                })
                .collect(),
        }
    }

    /// A point with the quantity at this value and the others near where they were.
    fn held(self, point: &Point, value: f64, model: &Model) -> Point {
        let mut held = point.clone();
        match self {
            Self::Delay => {
                // What the delay loses or gains, the first free lag takes.
                let change = value - point.delay();
                let least = SHORTEST_LAG * model.row_time;
                let free = model.free.lags.iter().position(|free| *free);
                if let Some(lag) = free.and_then(|free| held.lags.get_mut(free)) {
                    *lag = (*lag - change).max(least);
                }
                held.timing = Timing::Delay(value);
            }
            Self::Total => {
                // Of less than lags and zero the delay would be below zero.
                let late = point.total() - point.delay();
                if value < late && value <= 0.0 && model.free.zero {
                    // No lag is below zero: the zero is longer than the lags.
                    held.zero += late - value;
                } else if value < late && value > 0.0 {
                    let share = value / late;
                    let lags = held.lags.iter_mut().zip(&model.free.lags);
                    lags.filter(|(_, free)| **free)
                        .for_each(|(lag, _)| *lag *= share);
                    if model.free.zero {
                        held.zero *= share;
                    }
                }
                held.timing = Timing::Total(value);
            }
            Self::Gain => held.gain = value,
            Self::Zero => held.zero = value,
            Self::Lag(i) => {
                if let Some(lag) = held.lags.get_mut(i) {
                    *lag = value;
                }
                if let Timing::Total(total) = held.timing {
                    held.timing = Timing::Total(total.max(held.lag()));
                }
            }
        }
        held
    }
}

impl Model {
    /// The maximum with one quantity at `value`, from a fit near it.
    ///
    /// # Errors
    ///
    /// As for `Model::at`, and for a lag that the model does not have.
    pub fn held(
        &self,
        near: &Fit,
        quantity: Quantity,
        value: f64,
        task: &Task,
    ) -> Result<Fit, Error> {
        let start = quantity.held(&near.point, value, self);
        self.held_from(
            start,
            quantity,
            Accuracy::of(RISE_TOLERANCE),
            &mut None,
            task,
        )
    }

    /// The same from a point with that value and the inverse Hessian of a search near by, as in
    /// `fit_near`.
    fn held_from(
        &self,
        start: Point,
        quantity: Quantity,
        accuracy: Accuracy,
        inverse: &mut Option<Vec<f64>>,
        task: &Task,
    ) -> Result<Fit, Error> {
        let lags = start.lags.len();
        if let Quantity::Lag(i) = quantity {
            refuse_if!(
                i >= lags,
                "lag number {i} does not exist: give a number below {lags}"
            );
        }
        let (held, all) = (Some(quantity), Search::All);
        let found = self.fit_near(&start, held, all, accuracy, inverse, task)?;
        // A search does not come back from a lag of zero.
        let least = AT_LEAST * SHORTEST_LAG * self.row_time;
        let vanished = |(i, lag): &(usize, &f64)| {
            self.free.lags[*i] && quantity != Quantity::Lag(*i) && lag.abs() <= least
        };
        let Some((i, _)) = found.point.lags.iter().enumerate().find(vanished) else {
            return Ok(found);
        };
        let mut start = found.point.clone();
        start.lags[i] = (SECOND_LAG * self.row_time).copysign(start.lags[i]);
        let second = self.fit_near(&start, held, all, accuracy, &mut None, task)?;
        Ok(if second.objective < found.objective {
            second
        } else {
            found
        })
    }

    /// The end of the interval of a quantity: where −2 ln L has risen by `rise`.
    ///
    /// `reach` is about its distance from the best value, with its sign. Returns the end and the
    /// lowest fit seen on the way, which may be below the best; `limits` may end the search there.
    ///
    /// # Errors
    ///
    /// As for `Model::held`, and for a reach of zero or a rise that is not above it.
    pub fn end(
        &self,
        best: &Fit,
        quantity: Quantity,
        reach: f64,
        rise: f64,
        limits: Limits,
        task: &Task,
    ) -> Result<(f64, Fit), Error> {
        let seen = &mut Seen::default();
        self.end_near(best, quantity, (reach, rise), limits, seen, task)
    }

    /// The same for this reach and rise, from what was seen of the profile at the other end.
    pub(super) fn end_near(
        &self,
        best: &Fit,
        quantity: Quantity,
        (reach, rise): (f64, f64),
        limits: Limits,
        seen: &mut Seen,
        task: &Task,
    ) -> Result<(f64, Fit), Error> {
        let Limits { floor, lower } = limits;
        refuse_if!(
            reach == 0.0 || !reach.is_finite() || !(rise > 0.0 && rise.is_finite()),
            "the interval has a half width of {reach} and a rise of {rise}: give finite numbers \
             above zero"
        );
        refuse_if!(
            floor.is_nan() || lower.is_nan(),
            "the least end is {floor}, and the search ends {lower} below: give numbers"
        );
        // Two lags that come out equal have standard errors without bound: the search for an end
        // begins nearer, and goes as far as any time that the recordings may tell.
        let widest = (WIDEST * best.point.total()).max(self.row_time);
        let first = if matches!(quantity, Quantity::Gain | Quantity::Zero) {
            reach
        } else {
            reach.clamp(-widest, widest)
        };
        let farthest =
            (FARTHEST * reach.abs()).min((FARTHEST * first.abs()).max(2.0 * self.longest));
        let reach = first;
        let centre = quantity.value(&best.point);
        let mut lowest = best.clone();
        let mut near = best.clone();
        let mut before = seen.other.take();
        let inverse = &mut seen.inverse;
        let mut held_at = |value: f64, near: &Fit, before: Option<&Fit>| {
            let guess = before.map(|before| quantity.guess(&near.point, &before.point, value));
            let start = quantity.held(guess.as_ref().unwrap_or(&near.point), value, self);
            self.held_from(start, quantity, ON_THE_WAY, inverse, task)
        };
        let (mut inner, mut inner_rise) = (centre, 0.0);
        let mut outer = centre + reach;
        let mut bracket = None;
        let mut width = reach;
        while width.abs() <= farthest {
            outer = (centre + width).max(floor);
            let next = held_at(outer, &near, before.as_ref())?;
            if next.objective < lowest.objective {
                lowest = next.clone();
            }
            let found = next.objective - best.objective;
            if found < -lower {
                return Ok((outer, lowest));
            }
            if found >= rise {
                seen.other = Some(next);
                bracket = Some(found);
                break;
            }
            before = Some(std::mem::replace(&mut near, next));
            if outer <= floor {
                return Ok((floor, lowest));
            }
            (inner, inner_rise) = (outer, found.max(0.0));
            // Where the rise is quadratic the end is at once here.
            let guess = (rise / found.max(1e-3 * rise)).sqrt() * 1.02;
            width *= guess.clamp(1.1, 2.0);
        }
        let Some(mut outer_rise) = bracket else {
            return Ok((outer, lowest));
        };
        // False position in the square root of the rise, which is nearly linear (Illinois). Each
        // fit starts from one inside: one from outside may stay at another minimum, above the rise
        // all the way to the centre.
        let goal = rise.sqrt();
        let (mut low, mut high) = (inner_rise.sqrt() - goal, outer_rise.sqrt() - goal);
        for _ in 0..REFINEMENTS {
            if (outer - inner).abs() <= TOLERANCE * reach.abs() || high.abs() < 1e-3 * goal {
                break;
            }
            let share = if high.is_finite() {
                low / (low - high)
            } else {
                0.5
            };
            let middle = inner + (outer - inner) * share;
            let next = held_at(middle, &near, before.as_ref())?;
            if next.objective < lowest.objective {
                lowest = next.clone();
            }
            if next.objective - best.objective < -lower {
                return Ok((middle, lowest));
            }
            outer_rise = (next.objective - best.objective).max(0.0);
            let found = outer_rise.sqrt() - goal;
            if found.abs() < TOLERANCE * goal {
                return Ok((middle, lowest));
            }
            if found > 0.0 {
                (outer, high) = (middle, found);
                low *= 0.5;
            } else {
                (inner, low) = (middle, found);
                before = Some(std::mem::replace(&mut near, next));
                high *= 0.5;
            }
        }
        Ok((outer, lowest))
    }
}

#[cfg(test)]
mod tests {
    use super::super::plant::Plant;
    use super::super::tests::recorded;
    use super::super::variables::Free;
    use super::*;

    /// The fit of an integrator behind 0.31 s and these lags, which are free.
    fn fitted(lags: &[f64]) -> (Model, Fit) {
        let lag = lags.first().copied().unwrap_or(0.0);
        let rows = recorded((&[1.0], &[1.0, 0.0]), (0.31, 0.85, lag), 0.01, 8);
        let free = Free {
            delay: true,
            gain: true,
            lags: vec![true; lags.len()],
            zero: false,
        };
        let plant = Plant::new(&[1.0], &[1.0, 0.0]).unwrap();
        let model = Model::new(plant, vec![rows], free, 5.0).unwrap();
        let start = Point {
            timing: Timing::Total(0.31 + lag),
            lags: lags.to_vec(),
            zero: 0.0,
            gain: 0.85,
            noise: vec![Noise {
                air_time: 2.0,
                air: 0.3,
                ..Noise::QUIET
            }],
        };
        let mut best = model
            .fit(&start, None, Search::All, 1e-6, &Task::new())
            .unwrap();
        best.point.gain = model.at(0, &best.point, &Task::new()).unwrap().gain;
        (model, best)
    }

    #[test]
    fn at_an_end_the_objective_has_risen_by_as_much() {
        let (model, best) = fitted(&[0.17]);
        let rise = 3.84;
        for (quantity, reach) in [
            (Quantity::Delay, 0.03),
            (Quantity::Total, 4e-3),
            (Quantity::Gain, 5e-3),
        ] {
            let centre = quantity.value(&best.point);
            for sign in [-1.0, 1.0] {
                let (end, lowest) = model
                    .end(
                        &best,
                        quantity,
                        sign * reach,
                        rise,
                        Limits::floor(f64::NEG_INFINITY),
                        &Task::new(),
                    )
                    .unwrap();
                assert!(sign * (end - centre) > 0.0);
                assert!(lowest.objective <= best.objective);
                let there = model.held(&best, quantity, end, &Task::new()).unwrap();
                let risen = there.objective - best.objective;
                assert!(
                    (risen - rise).abs() < 0.05 * rise,
                    "{quantity:?} {sign} {risen}"
                );
                if quantity != Quantity::Gain {
                    assert!((quantity.value(&there.point) - end).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn an_error_without_bound_leads_to_the_same_end() {
        let (model, best) = fitted(&[0.17]);
        for sign in [-1.0, 1.0] {
            let [near, far] = [4e-3, 1.5e4].map(|reach| {
                let end = model.end(
                    &best,
                    Quantity::Total,
                    sign * reach,
                    3.84,
                    Limits::floor(f64::NEG_INFINITY),
                    &Task::new(),
                );
                end.unwrap().0
            });
            assert!((near - far).abs() < 1e-3 * 0.48, "{near} {far}");
        }
    }

    #[test]
    fn an_end_does_not_pass_the_floor() {
        let (model, best) = fitted(&[0.17]);
        let floor = 6.5e-5;
        // No rise is as large, so that the search goes on to the floor.
        let found = model.end(
            &best,
            Quantity::Lag(0),
            -0.05,
            1e6,
            Limits::floor(floor),
            &Task::new(),
        );
        assert_eq!(found.unwrap().0, floor);
    }

    #[test]
    fn a_search_ends_at_a_lower_fit_if_asked_to() {
        let (model, mut best) = fitted(&[0.17]);
        // A fit that is not the best of its neighbours.
        best.point.lags = vec![0.1];
        best.objective = model.objective(&best.point, &Task::new()).unwrap();
        let end = |lower| {
            let limits = Limits { floor: 0.0, lower };
            model
                .end(&best, Quantity::Total, 4e-3, 3.84, limits, &Task::new())
                .unwrap()
        };
        let (first, lowest) = end(0.02);
        assert!((first - Quantity::Total.value(&best.point) - 4e-3).abs() < 1e-12);
        assert!(lowest.objective < best.objective - 0.02);
        let (whole, other) = end(f64::INFINITY);
        assert!(whole > first);
        assert!(other.objective <= lowest.objective);
    }

    #[test]
    fn lags_stay_lags_where_the_sum_is_held_below_zero() {
        let (mut model, best) = fitted(&[0.17]);
        model.free.zero = true;
        for value in [-0.2, 0.0, 0.1] {
            let held = Quantity::Total.held(&best.point, value, &model);
            assert!(held.lags[0] > 0.0);
            assert!((held.total() - value).abs() < 1e-15);
            assert!(held.delay() > -1e-15, "{held:?}");
        }
        // A zero longer than delay and lags stays where the delay stays above zero.
        let mut leading = best.point.clone();
        (leading.zero, leading.timing) = (0.6, Timing::Total(0.31 + 0.17 - 0.6));
        for value in [-0.2, -0.12, -0.01] {
            let held = Quantity::Total.held(&leading, value, &model);
            assert_eq!((held.zero, &held.lags), (0.6, &leading.lags));
            assert!((held.total() - value).abs() < 1e-15);
        }
    }

    #[test]
    fn what_has_no_interval_is_refused() {
        let (model, best) = fitted(&[]);
        let task = Task::new();
        let end = |quantity, reach, rise, floor| {
            model
                .end(&best, quantity, reach, rise, Limits::floor(floor), &task)
                .unwrap_err()
                .to_string()
        };
        for (found, expected) in [
            (end(Quantity::Delay, 0.0, 3.84, 0.0), "half width of 0"),
            (
                end(Quantity::Delay, f64::NAN, 3.84, 0.0),
                "half width of NaN",
            ),
            (end(Quantity::Delay, 0.1, -1.0, 0.0), "rise of -1"),
            (
                end(Quantity::Delay, 0.1, 3.84, f64::NAN),
                "least end is NaN",
            ),
            (end(Quantity::Lag(3), 0.1, 3.84, 0.0), "lag number 3"),
        ] {
            assert!(found.contains(expected), "{found}");
        }
    }
}
