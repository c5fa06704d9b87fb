//! The loop without a limit under a constant reference: elements that are equal parts of the delay.
//!
//! Breaking points then lie at whole delays alone. With elements of length h = Td/m the command that
//! arrives during an element is the one of m elements ago in the same local coordinate, so that no
//! polynomial is moved or stretched, and only the values at the start of an element wait for the
//! element before. For c_j, the coefficient of σ^j,
//!
//!   x_{j+1} = h (A x_j + B w_j)/(j + 1),  u_j = K x_j + L w_j,  with E r and M r added for j = 0.
//!
//! For one integrator and m = 1 they have a closed form ([`super::slopes`]). Where the last coefficients
//! are not negligible, elements become half as long from there on; a loop that needs more than
//! [`MOST_PARTS`] of them, or leaves its closed form, is left to [`super::modes`]. The code is
//! compiled for each instruction set: all operations are rounded one by one, in one order, and have
//! the same bits in each.

use pulp::{Simd, WithSimd};

use crate::dde::control_loop::linear_loop::{LinearLoop, Start};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::control_loop::series::DEGREE;
use crate::dde::limits::{check_growth, slack};
use crate::dde::scalar::Scalar;
use crate::simd::Instructions;
use crate::{Error, Task};

use super::effort::watch;
use super::pieces::{Orders, REPORTED, SMOOTH};
use super::polynomial::{LANES, Polynomial};
use super::slopes::Slopes;
use super::values_at_times::ValuesAtTimes;

/// Largest number of elements in a delay.
const MOST_PARTS: usize = 128;

/// The same at the start, so that they can become shorter: what is found at one time does not depend
/// on how long the run is.
const MOST_AT_START: usize = 64;

/// Growth of the coefficients with the degree, times the length of an element, for which the last
/// ones are negligible as a rule.
const REACH: f64 = 1.8;

/// Reported breaks of a loop that has no direct path, about.
const BREAKS: usize = REPORTED as usize + 2;

/// Store the response in `requested`, if the loop and its reference are of this kind.
pub(super) fn run<S: Scalar>(
    instructions: Instructions,
    plant: &LinearLoop<S>,
    start: &Start<S>,
    reference: &Reference,
    requested: &mut RequestedOutput<'_, S>,
    task: &Task,
) -> Result<bool, Error> {
    // A page has one method only, to keep it small; the general one gives the same to rounding.
    let is_page = cfg!(target_family = "wasm");
    if is_page || S::MOVES || requested.is_measured() || plant.bounds().is_some() {
        return Ok(false);
    }
    let delay = plant.delay().value();
    let mut cursor = reference.cursor(&start.kicks);
    let before = cursor.advance(0.0, -slack(0.0, delay));
    let r = cursor.advance(0.0, slack(0.0, delay));
    let jumps_later = cursor.next_jump().is_finite();
    let is_struck = !plant.equations().impulse.is_nothing() && r != before;
    if jumps_later || is_struck {
        return Ok(false);
    }
    match plant.equations().states() {
        1 => serve::<S, 1>(instructions, plant, start, r, requested, task),
        2 => serve::<S, 2>(instructions, plant, start, r, requested, task),
        3 => serve::<S, 3>(instructions, plant, start, r, requested, task),
        _ => Ok(false),
    }
}

fn serve<S: Scalar, const N: usize>(
    instructions: Instructions,
    plant: &LinearLoop<S>,
    start: &Start<S>,
    r: f64,
    requested: &mut RequestedOutput<'_, S>,
    task: &Task,
) -> Result<bool, Error> {
    let equations = plant.equations();
    let delay = plant.delay().value();
    let column = |numbers: &[S]| -> [f64; N] { std::array::from_fn(|i| numbers[i].value()) };
    let a: [[f64; N]; N] = std::array::from_fn(|i| column(&equations.a[i * N..]));
    let (b, k) = (column(&equations.b), column(&equations.k));
    let rate = (0..N)
        .map(|i| {
            let row: f64 = a[i].iter().map(|a| a.abs()).sum();
            row + (b[i] * k[i]).abs()
        })
        .fold(0.0, f64::max);
    let mut parts = 1;
    while rate * delay > REACH * parts as f64 {
        parts *= 2;
        if parts > MOST_AT_START {
            return Ok(false);
        }
    }
    let [output_times, input_times] = requested.times();
    let mut found = Found {
        outputs: ValuesAtTimes::new(output_times)?,
        inputs: ValuesAtTimes::new(input_times)?,
        output_breaks: Vec::with_capacity(BREAKS),
        input_breaks: Vec::with_capacity(BREAKS),
    };
    let run = Run {
        a,
        b,
        k,
        c: column(&equations.c),
        forcing: column(&equations.e).map(|e| e * r),
        l: equations.l.value(),
        d: equations.d.value(),
        constant: equations.m.value() * r,
        state: column(&start.state),
        command: start.command.value(),
        delay,
        parts,
        orders: Orders::new(plant),
        found: &mut found,
        task,
    };
    let is_stored = instructions.run(run)?;
    if is_stored {
        requested.store(Trajectory {
            outputs: found.outputs.found(),
            inputs: found.inputs.found(),
            output_breaks: found.output_breaks,
            input_breaks: found.input_breaks,
        });
    }
    Ok(is_stored)
}

struct Found<'a> {
    outputs: ValuesAtTimes<'a>,
    inputs: ValuesAtTimes<'a>,
    output_breaks: Vec<f64>,
    input_breaks: Vec<f64>,
}

/// One run of a loop with `N` states.
struct Run<'a, 't, const N: usize> {
    a: [[f64; N]; N],
    b: [f64; N],
    k: [f64; N],
    c: [f64; N],
    /// E r.
    forcing: [f64; N],
    l: f64,
    d: f64,
    /// M r.
    constant: f64,
    state: [f64; N],
    /// The command before the start.
    command: f64,
    delay: f64,
    /// Elements in a delay.
    parts: usize,
    orders: Orders,
    found: &'a mut Found<'t>,
    task: &'a Task,
}

impl<const N: usize> WithSimd for Run<'_, '_, N> {
    type Output = Result<bool, Error>;

    /// Is the response stored? Not where an element is too long.
    #[inline(always)]
    fn with_simd<V: Simd>(self, _: V) -> Self::Output {
        let Found {
            outputs,
            inputs,
            output_breaks,
            input_breaks,
        } = self.found;
        let mut parts = self.parts;
        let mut lengths = Lengths::new(self.delay, parts);
        // Output and command at one time follow from the state then.
        let from_state = N == 1 && self.l == 0.0 && self.d == 0.0;
        let slope = |u: f64| self.b[0] * u + self.forcing[0];
        let mut slopes = (from_state && parts == 1 && self.a[0][0] == 0.0)
            .then(|| Slopes::new(self.k[0] * self.b[0], self.delay, slope(self.command)));
        let is_one = std::ptr::eq(outputs.times(), inputs.times());
        // No polynomial of the command is needed where slopes are.
        let kept_commands = if slopes.is_some() { 0 } else { parts };
        let mut commands = vec![Polynomial::constant(self.command); kept_commands];
        let mut x = [Polynomial::constant(0.0); N];
        let mut state = self.state;
        let mut slot = 0;
        let mut arriving = SMOOTH;
        // The command on the element before, if it was constant.
        let mut kept = Some(self.command);
        let mut element = 0;
        while !(outputs.is_done() && inputs.is_done()) {
            watch(element, self.task)?;
            // The number of parts is a power of two, which no division rounds by.
            let t = element as f64 * lengths.h;
            let next = (element + 1) as f64 * lengths.h;
            let end = next - slack(next, self.delay);
            if let Some(slopes) = &slopes {
                slopes.integrate(&mut x[0], state[0]);
            } else {
                let w = &commands[slot];
                expand(
                    &mut x,
                    &self.a,
                    &self.b,
                    &state,
                    &self.forcing,
                    w,
                    &lengths.factors,
                );
            }
            let mut is_sound = true;
            for x in &mut x {
                is_sound &= x.trim();
            }
            if !is_sound {
                if slopes.is_some() || 2 * parts > MOST_PARTS {
                    return Ok(false);
                }
                commands = halved(&commands);
                (parts, slot, element) = (2 * parts, 2 * slot, 2 * element);
                lengths = Lengths::new(self.delay, parts);
                continue;
            }
            for (x, state) in x.iter().zip(&mut state) {
                *state = x.end();
            }
            let inverse = lengths.inverse;
            let (u, is_constant) = if let Some(slopes) = &mut slopes {
                let u = self.constant + self.k[0] * x[0].coefficient(0);
                slopes.push(slope(u));
                (u, self.k[0] == 0.0 || x[0].is_constant())
            } else {
                let mut u = Polynomial::constant(self.constant);
                for (k, x) in self.k.iter().zip(&x) {
                    u.add(*k, x);
                }
                let w = &commands[slot];
                if self.l != 0.0 {
                    u.add(self.l, w);
                }
                if !from_state {
                    let mut y = Polynomial::constant(0.0);
                    for (c, x) in self.c.iter().zip(&x) {
                        y.add(*c, x);
                    }
                    if self.d != 0.0 {
                        y.add(self.d, w);
                    }
                    outputs.fill(t, inverse, end, |sigmas| y.at(sigmas));
                    inputs.fill(t, inverse, end, |sigmas| u.at(sigmas));
                }
                commands[slot] = u;
                (u.coefficient(0), u.is_constant())
            };
            if from_state {
                // Arguments by value that are changed were changed for their caller as well by
                // rustc 1.89 to 1.95, without optimisation across functions.
                let output = |x: &[f64; LANES]| {
                    let mut output = *x;
                    output.iter_mut().for_each(|x| *x *= self.c[0]);
                    output
                };
                let command = |x: &[f64; LANES]| {
                    let mut command = *x;
                    command
                        .iter_mut()
                        .for_each(|x| *x = self.constant + self.k[0] * *x);
                    command
                };
                if is_one {
                    outputs.fill_both(inputs, t, inverse, end, |sigmas| {
                        let x = x[0].at(sigmas);
                        (output(&x), command(&x))
                    });
                } else {
                    outputs.fill(t, inverse, end, |sigmas| output(&x[0].at(sigmas)));
                    inputs.fill(t, inverse, end, |sigmas| command(&x[0].at(sigmas)));
                }
            }
            let still = is_constant.then_some(u);
            if slot == 0 {
                let jumps = element == 0;
                if self.orders.of_output(arriving, jumps) <= REPORTED && outputs.reaches(t) {
                    output_breaks.push(t);
                }
                let order = self.orders.of_command(arriving, jumps);
                if order <= REPORTED && inputs.reaches(t) {
                    input_breaks.push(t);
                }
                // Where one constant continues as itself, nothing breaks a delay later.
                arriving = if order <= REPORTED && is_constant && still == kept {
                    SMOOTH
                } else {
                    order
                };
            }
            kept = still;
            check_growth(&state, u, next)?;
            slot += 1;
            if slot == parts {
                slot = 0;
            }
            element += 1;
        }
        Ok(true)
    }
}

/// What follows from the length of elements.
struct Lengths {
    h: f64,
    /// 1/h.
    inverse: f64,
    /// h/(j + 1).
    factors: [f64; DEGREE],
}

impl Lengths {
    #[inline(always)]
    fn new(delay: f64, parts: usize) -> Self {
        let h = delay / parts as f64;
        let factors = std::array::from_fn(|j| h / (j + 1) as f64);
        Self {
            h,
            inverse: 1.0 / h,
            factors,
        }
    }
}

/// The commands of one delay in elements half as long.
#[cold]
#[inline(never)]
fn halved(commands: &[Polynomial]) -> Vec<Polynomial> {
    commands.iter().flat_map(Polynomial::halves).collect()
}

/// x on an element that starts at `state`.
#[inline(always)]
fn expand<const N: usize>(
    x: &mut [Polynomial; N],
    a: &[[f64; N]; N],
    b: &[f64; N],
    state: &[f64; N],
    forcing: &[f64; N],
    w: &Polynomial,
    factors: &[f64; DEGREE],
) {
    let (mut old, mut forcing) = (*state, *forcing);
    for (x, first) in x.iter_mut().zip(state) {
        x.set(0, *first);
    }
    for (j, factor) in factors.iter().enumerate() {
        let input = w.coefficient(j);
        let mut new = forcing;
        for ((new, b), row) in new.iter_mut().zip(b).zip(a) {
            *new += b * input;
            for (a, old) in row.iter().zip(&old) {
                *new += a * old;
            }
        }
        for (new, x) in new.iter_mut().zip(x.iter_mut()) {
            *new *= factor;
            x.set(j + 1, *new);
        }
        old = new;
        forcing = [0.0; N];
    }
}

#[cfg(test)]
mod tests;
