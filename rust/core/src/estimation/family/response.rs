//! Exact responses of the plants of the family to held or straight commands, with the slope over the
//! delay and the zero, and the free responses of their lags.
//!
//! With v the output of 1/(q s² + p s + 1), u = a + b t on a piece, and x = (v, v′):
//!     x ← x_p + e^(A t) (x − x_p),   x_p = (u − p b, b),
//!     ∫ v = ∫ u − q Δv′ − p Δv.
//! Both hold for one lag with q = 0. Values at a row are those just before it.

use super::aside::{Aside, Signal};
use super::class::{Class, Numbers};
use super::rows::Part;
use super::shape::behind_slope;
use crate::elementary::{exp, sin_cos};
use crate::linear_algebra::vectors::add_multiple;

/// Two steps closer than this share of a row are one, and their transition is computed once.
const SAME_STEP: f64 = 1e-9;

/// (r t)² below which two poles are taken for one in a series.
const MEETING: f64 = 1e-8;

/// Responses at the rows that are used.
#[derive(Debug, Default, Clone)]
pub(super) struct Response {
    pub(super) value: Vec<f64>,
    /// The derivative with respect to the delay.
    pub(super) by_delay: Vec<f64>,
    /// The derivative with respect to the zero.
    pub(super) by_zero: Vec<f64>,
}

impl Response {
    /// None at so many rows.
    pub(super) fn zero(rows: usize) -> Self {
        Self {
            value: vec![0.0; rows],
            by_delay: vec![0.0; rows],
            by_zero: vec![0.0; rows],
        }
    }

    /// With another one, times a factor, added.
    pub(super) fn add(&mut self, factor: f64, other: &Self) {
        add_multiple(&mut self.value, factor, &other.value);
        add_multiple(&mut self.by_delay, factor, &other.by_delay);
        add_multiple(&mut self.by_zero, factor, &other.by_zero);
    }

    /// With that of the next record behind it.
    pub(super) fn append(&mut self, mut next: Self) {
        self.value.append(&mut next.value);
        self.by_delay.append(&mut next.by_delay);
        self.by_zero.append(&mut next.by_zero);
    }
}

/// e^(A t) of the last two lengths of a step.
struct Transitions {
    order: usize,
    sum: f64,
    product: f64,
    tolerance: f64,
    known: [(f64, [f64; 4]); 2],
}

impl Transitions {
    fn new(class: Class, numbers: &Numbers, row: f64) -> Self {
        Self {
            order: class.order,
            sum: numbers.sum,
            product: numbers.product,
            tolerance: SAME_STEP * row,
            known: [(f64::NAN, [0.0; 4]); 2],
        }
    }

    fn over(&mut self, step: f64) -> [f64; 4] {
        if (self.known[0].0 - step).abs() < self.tolerance {
            return self.known[0].1;
        }
        self.known.swap(0, 1);
        let is_known = (self.known[0].0 - step).abs() < self.tolerance;
        if !is_known {
            self.known[0] = (step, self.computed(step));
        }
        self.known[0].1
    }

    fn computed(&self, step: f64) -> [f64; 4] {
        match self.order {
            0 => [0.0; 4],
            1 => [exp(-step / self.sum), 0.0, 0.0, 0.0],
            _ => pair(self.sum, self.product, step),
        }
    }
}

/// e^(A t) of A = [[0, 1], [−1/q, −p/q]].
fn pair(sum: f64, product: f64, step: f64) -> [f64; 4] {
    let middle = 0.5 * sum / product;
    let square = middle * middle - 1.0 / product;
    let (even, odd) = if (square * step * step).abs() < MEETING {
        let decay = exp(-middle * step);
        let part = square * step * step;
        (
            decay * (1.0 + part / 2.0),
            decay * step * (1.0 + part / 6.0),
        )
    } else if square > 0.0 {
        let root = square.sqrt();
        let slow = exp(-step / (product * (middle + root)));
        let fast = exp(-(middle + root) * step);
        (0.5 * (slow + fast), 0.5 * (slow - fast) / root)
    } else {
        let root = (-square).sqrt();
        let decay = exp(-middle * step);
        let (sine, cosine) = sin_cos(root * step);
        (decay * cosine, decay * sine / root)
    };
    [
        even + middle * odd,
        odd,
        -odd / product,
        even - middle * odd,
    ]
}

/// The state of a plant of unit gain under a command.
struct State<'a> {
    class: Class,
    numbers: &'a Numbers,
    transitions: Transitions,
    value: f64,
    slope: f64,
    integral: f64,
    command: f64,
    rate: f64,
}

impl State<'_> {
    fn advance(&mut self, step: f64) {
        if step <= 0.0 {
            return;
        }
        let (p, q) = (self.numbers.sum, self.numbers.product);
        let area = step * (self.command + 0.5 * step * self.rate);
        let transition = self.transitions.over(step);
        let (before, before_slope) = (self.value, self.slope);
        let end = self.command + self.rate * step;
        match self.class.order {
            0 => self.value = end,
            1 => {
                let off = before - (self.command - p * self.rate);
                self.value = end - p * self.rate + transition[0] * off;
            }
            _ => {
                let off = before - (self.command - p * self.rate);
                let off_slope = before_slope - self.rate;
                self.value = end - p * self.rate + transition[0] * off + transition[1] * off_slope;
                self.slope = self.rate + transition[2] * off + transition[3] * off_slope;
            }
        }
        self.command = end;
        if self.class.integrating {
            self.integral += match self.class.order {
                0 => area,
                1 => area - p * (self.value - before),
                _ => area - q * (self.slope - before_slope) - p * (self.value - before),
            };
        }
    }

    fn record(&self, out: &mut Response) {
        let (p, q, z) = (self.numbers.sum, self.numbers.product, self.numbers.zero);
        let left = self.command - self.value;
        let (first, second) = match self.class.order {
            0 => (self.rate, 0.0),
            1 => (left / p, (self.rate - left / p) / p),
            _ => (self.slope, (left - p * self.slope) / q),
        };
        let [zeroth, first, second] = if self.class.integrating {
            [self.integral, self.value, first]
        } else {
            [self.value, first, second]
        };
        out.value.push(zeroth + z * first);
        out.by_delay.push(-(first + z * second));
        out.by_zero.push(first);
    }
}

/// The response of a plant of unit gain that is at rest until the first command arrives.
pub(super) fn response(rows: &Part, class: Class, numbers: &Numbers) -> Response {
    // A signal behind a delay alone is taken as straight: a held one would jump between rows.
    let straight = rows.straight || class.order == 0 && !class.integrating;
    let (sent, command) = (&rows.sent, &rows.command);
    match rows.slope {
        Some(most) => limited(sent, command, most, rows, class, numbers),
        None => response_to(sent, command, straight, rows, class, numbers),
    }
}

/// The same to a command that is held, where the slope of the lag's output is limited.
fn limited(
    sent: &[f64],
    command: &[f64],
    most: f64,
    rows: &Part,
    class: Class,
    numbers: &Numbers,
) -> Response {
    let (sent, command) = behind_slope(sent, command, most, numbers.lag(), rows.row);
    response_to(&sent, &command, true, rows, class, numbers)
}

/// The response at the rows to a command of unit area over an interval, zero before and after it.
pub(super) fn pulse(
    rows: &Part,
    interval: (f64, f64),
    class: Class,
    numbers: &Numbers,
) -> Vec<f64> {
    let (start, end) = interval;
    let command = [1.0 / (end - start), 0.0];
    response_to(&[start, end], &command, false, rows, class, numbers).value
}

fn response_to(
    sent: &[f64],
    command: &[f64],
    straight: bool,
    rows: &Part,
    class: Class,
    numbers: &Numbers,
) -> Response {
    let count = rows.used.len();
    let mut out = Response {
        value: Vec::with_capacity(count),
        by_delay: Vec::with_capacity(count),
        by_zero: Vec::with_capacity(count),
    };
    let mut state = State {
        class,
        numbers,
        transitions: Transitions::new(class, numbers, rows.row),
        value: 0.0,
        slope: 0.0,
        integral: 0.0,
        command: 0.0,
        rate: 0.0,
    };
    let mut now = sent[0] + numbers.delay;
    let mut next = 0;
    for &row in &rows.used {
        // Commands that arrive before this row.
        while next < sent.len() && sent[next] + numbers.delay < rows.time[row] {
            let arrival = sent[next] + numbers.delay;
            state.advance(arrival - now);
            now = arrival;
            state.command = command[next];
            state.rate = match sent.get(next + 1) {
                Some(after) if straight => {
                    (command[next + 1] - command[next]) / (after - sent[next])
                }
                _ => 0.0,
            };
            next += 1;
        }
        if next > 0 {
            state.advance(rows.time[row] - now);
            now = rows.time[row];
        }
        state.record(&mut out);
    }
    out
}

impl Signal {
    fn response(&self, part: &Part, class: Class, numbers: &Numbers) -> Response {
        let first = self.value.first().copied().unwrap_or(0.0);
        let value: Vec<f64> = self.value.iter().map(|own| own - first).collect();
        match part.slope {
            Some(most) => limited(&self.sent, &value, most, part, class, numbers),
            None => response_to(&self.sent, &value, self.straight, part, class, numbers),
        }
    }
}

impl Aside {
    /// What it adds to the output, times one.
    pub(super) fn response(&self, part: &Part, class: Class, numbers: &Numbers) -> Response {
        match self {
            Self::Input {
                sent,
                value,
                straight,
            } => response_to(sent, value, *straight, part, class, numbers),
            Self::Difference(one, other, factor) => {
                let mut out = Response::zero(part.used.len());
                for (signal, factor) in [(one, *factor), (other, -factor)] {
                    out.add(factor, &signal.response(part, class, numbers));
                }
                out
            }
            Self::Slope(step) => {
                let mut out = Response::zero(part.used.len());
                let most = part.slope.unwrap_or(f64::INFINITY);
                for side in [1.0, -1.0] {
                    let own = most * (1.0 + side * step);
                    let own = limited(&part.sent, &part.command, own, part, class, numbers);
                    out.add(0.5 * side / (step * most), &own);
                }
                out
            }
            Self::Step(from) => {
                let mut out = Response::zero(part.used.len());
                for (value, row) in out.value.iter_mut().zip(&part.used) {
                    *value = f64::from(u8::from(part.time[*row] >= *from));
                }
                out
            }
            Self::Later(from) => {
                let mut out = response(part, class, numbers);
                for (value, row) in out.by_delay.iter_mut().zip(&part.used) {
                    *value *= if part.time[*row] >= *from { 0.5 } else { -0.5 };
                }
                out.value = out.by_delay;
                let none = Response::zero(out.value.len());
                (out.by_delay, out.by_zero) = (none.by_delay, none.by_zero);
                out
            }
        }
    }
}

/// The free responses of the lags from the first row that is used on, one column a state.
pub(super) fn free_responses(rows: &Part, class: Class, numbers: &Numbers) -> Vec<Vec<f64>> {
    let mut transitions = Transitions::new(class, numbers, rows.row);
    let start = rows.used.first().map_or(0.0, |row| rows.time[*row]);
    let mut columns = vec![Vec::with_capacity(rows.used.len()); class.order];
    let mut states = [[1.0, 0.0], [0.0, 1.0]];
    let mut now = start;
    for row in &rows.used {
        let step = rows.time[*row] - now;
        now = rows.time[*row];
        if step > 0.0 {
            let [a, b, c, d] = transitions.over(step);
            for state in &mut states[..class.order] {
                *state = [a * state[0] + b * state[1], c * state[0] + d * state[1]];
            }
        }
        for (column, state) in columns.iter_mut().zip(&states) {
            column.push(state[0]);
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_that_meet_are_passed_without_a_jump() {
        // Sum 2, product 1 ± a little: two lags, one twice, a pair.
        let at = |product: f64| pair(2.0, product, 0.7);
        let double = [1.7, 0.7, -0.7, 0.3].map(|part| part * exp(-0.7));
        for off in [1e-3, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-3] {
            for (found, expected) in at(1.0 + off).iter().zip(double) {
                assert!(
                    (found - expected).abs() < 2.0 * f64::abs(off) + 1e-14,
                    "{off}"
                );
            }
        }
    }
}
