//! Breaking points: where a derivative of the solution jumps, and which later points follow from
//! them.
//!
//! A jump of the p-th derivative at ξ reaches y through the delay τ at ξ + τ, where the derivative
//! of order p + 1 jumps; through a delayed derivative the p-th itself does, and at least the first
//! (Bellen and Zennaro, Numerical Methods for Delay Differential Equations, 2003, section 2.1.2).
//! Points that agree up to rounding errors are merged, with the smaller order. They are followed up
//! to the order that matters for the method; this order decreases with the number of delays, so
//! that at most about a hundred points follow from one. Points that are not followed are left to
//! the error estimate. In a neutral equation a jump of y′ never ends. A caller that finds it
//! negligible adds the point with order 2, from which on the order rises by one at each delay: a
//! jump that a delayed derivative passes on unchanged becomes small as the first one did.

use std::collections::BTreeMap;

/// Upper limit on the points that follow from one point. More of them give more and shorter
/// elements.
const DESCENDANTS: f64 = 100.0;
/// Order from which on a jump does not affect elements of the largest order.
const SMOOTH: u32 = 12;
/// Upper limit on the points stored ahead of time; those of the highest order are dropped first.
const MOST: usize = 4096;
/// Relative distance of times below which two points are merged.
const SAME: f64 = 1e-13;

/// A time at which a derivative of the solution jumps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BreakingPoint {
    /// The time.
    pub time: f64,
    /// The lowest derivative that jumps: 0 for the solution itself.
    pub order: u32,
}

/// Later breaking points for constant delays.
#[derive(Debug, Clone)]
pub struct Breaks {
    delays: Vec<f64>,
    neutral: bool,
    smooth: u32,
    /// Key: the bits of the distance from `origin`, whose order is that of positive distances.
    ahead: BTreeMap<u64, BreakingPoint>,
    origin: f64,
}

impl Breaks {
    /// No points yet; all that come are later than `origin`.
    ///
    /// Jumps of derivatives beyond the order `sight` are never followed.
    pub fn new(origin: f64, delays: &[f64], neutral: bool, sight: u32) -> Self {
        Self {
            delays: delays.to_vec(),
            neutral,
            smooth: followed(delays.len()).min(sight + 1),
            ahead: BTreeMap::new(),
            origin,
        }
    }

    /// The order from which on a point is not followed.
    pub fn smooth(&self) -> u32 {
        self.smooth
    }

    /// Add a point, or lower the order of an existing one.
    pub fn add(&mut self, point: BreakingPoint) {
        let distance = point.time - self.origin;
        if point.order >= self.smooth
            || distance.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater)
        {
            return;
        }
        let width = self.width(point.time);
        let low = (distance - width).max(0.0).to_bits();
        let high = (distance + width).to_bits();
        if let Some((_, known)) = self.ahead.range_mut(low..=high).next() {
            // The time that was added first is kept: that of a jump is exact.
            known.order = known.order.min(point.order);
            return;
        }
        self.ahead.insert(distance.to_bits(), point);
        if self.ahead.len() > MOST {
            let least = self
                .ahead
                .iter()
                .max_by_key(|(key, point)| (point.order, **key));
            if let Some(key) = least.map(|(key, _)| *key) {
                self.ahead.remove(&key);
            }
        }
    }

    /// Add the points that follow from a point.
    pub fn follow(&mut self, point: BreakingPoint) {
        let order = if self.neutral && point.order < 2 {
            1
        } else {
            point.order + 1
        };
        for index in 0..self.delays.len() {
            let time = point.time + self.delays[index];
            self.add(BreakingPoint { time, order });
        }
    }

    /// The next point.
    pub fn next(&self) -> Option<BreakingPoint> {
        self.ahead.first_key_value().map(|(_, point)| *point)
    }

    /// Distance below which points at `time` are merged.
    fn width(&self, time: f64) -> f64 {
        SAME * time.abs().max(self.origin.abs())
    }

    /// Remove the points up to `time`; returns the one with the lowest order.
    pub fn reach(&mut self, time: f64) -> Option<BreakingPoint> {
        let until = time + self.width(time);
        let mut order = None;
        while let Some(point) = self.next() {
            if point.time > until {
                break;
            }
            self.ahead.pop_first();
            order = Some(order.map_or(point.order, |old: u32| old.min(point.order)));
        }
        order.map(|order| BreakingPoint { time, order })
    }
}

/// The largest K with C(m + K, m) ≤ DESCENDANTS for m delays, at least 3.
fn followed(delays: usize) -> u32 {
    let mut count = 1.0;
    let mut order = 0;
    while order < SMOOTH {
        let next = count * (delays as f64 + f64::from(order) + 1.0) / (f64::from(order) + 1.0);
        if next > DESCENDANTS && order >= 3 {
            break;
        }
        count = next;
        order += 1;
    }
    order + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What follows from one point.
    fn following(time: f64, order: u32, delays: &[f64], neutral: bool) -> Breaks {
        let mut breaks = Breaks::new(time, delays, neutral, 30);
        breaks.follow(BreakingPoint { time, order });
        breaks
    }

    fn all(breaks: &mut Breaks, until: f64) -> Vec<(f64, u32)> {
        let mut found = Vec::new();
        while let Some(point) = breaks.next() {
            if point.time > until {
                break;
            }
            let point = breaks.reach(point.time).unwrap();
            breaks.follow(point);
            found.push((point.time, point.order));
        }
        found
    }

    #[test]
    fn retarded_points_lose_an_order_each_delay_and_end() {
        let mut breaks = following(0.0, 1, &[0.36], false);
        let found = all(&mut breaks, 100.0);
        assert_eq!(found.len() as u32, breaks.smooth() - 2);
        for (k, (time, order)) in found.iter().enumerate() {
            assert!((time - 0.36 * (k + 1) as f64).abs() < 1e-14);
            assert_eq!(*order as usize, k + 2);
        }
    }

    #[test]
    fn neutral_points_keep_their_order() {
        let mut breaks = following(1.0, 0, &[0.5], true);
        let found = all(&mut breaks, 50.9);
        assert_eq!(found.len(), 99);
        assert!(found.iter().all(|(_, order)| *order == 1));
    }

    #[test]
    fn points_of_two_delays_merge() {
        // 1/3 and 1/5: 2/5 and 1/3 + 1/5 by two ways each, all multiples of 1/15.
        let mut breaks = following(0.0, 0, &[1.0 / 3.0, 0.2], false);
        let times: Vec<f64> = all(&mut breaks, 1.01)
            .iter()
            .map(|(t, _)| 15.0 * t)
            .collect();
        let known = [3.0, 5.0, 6.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
        assert_eq!(times.len(), known.len());
        assert!(times.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-11));
    }

    #[test]
    fn many_delays_stay_bounded() {
        let delays: Vec<f64> = (1..=40).map(|k| f64::from(k).sqrt()).collect();
        let mut breaks = following(0.0, 1, &delays, true);
        for _ in 0..2000 {
            let point = breaks.next().unwrap();
            let point = breaks.reach(point.time).unwrap();
            breaks.follow(point);
            assert!(breaks.ahead.len() <= MOST);
        }
    }
}
