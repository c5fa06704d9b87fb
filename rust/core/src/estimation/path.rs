//! Response of a plant to held and delayed inputs, and its rate, at the rows of a recording.
//!
//! Exact: the state is propagated from event to event, an event being a row or the arrival of an
//! input. Step lengths repeat on even rows, so that few propagators are made.

use super::plant::{Plant, PlantSpace};
use super::rows::check_times;
use super::steps::Steps;
use crate::{Error, Task, memory};

/// Events between two checks for a stop.
const CHECKED: u32 = 4096;

/// Steps after which states that have decayed become zero, and below which size. Their square is
/// nothing; the processor is slow on the smallest numbers, in which a decaying state would end.
pub(super) const SETTLED: u32 = 64;
const NOTHING: f64 = 1e-150;

/// Zero for what has decayed.
pub(super) fn settled(x: f64) -> f64 {
    if x.abs() < NOTHING { 0.0 } else { x }
}

/// Inputs that hold from their times on; zero before the first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held<'a> {
    pub(super) time: &'a [f64],
    pub(super) value: &'a [f64],
}

/// The output of a plant under inputs that hold, at `times`, exact to rounding.
///
/// A plant that comes to rest under a constant input rests under the first one until the second; one
/// that integrates is at zero until the first.
///
/// # Errors
///
/// If sizes do not fit, or times do not increase.
pub fn held_response(
    plant: &Plant,
    input_time: &[f64],
    input: &[f64],
    times: &[f64],
    task: &Task,
) -> Result<Vec<f64>, Error> {
    refuse_if!(
        input_time.is_empty() || input.len() != input_time.len(),
        "{} inputs at {} times are given: give one input for each time",
        input.len(),
        input_time.len()
    );
    check_times("input_time", input_time)?;
    check_times("times", times)?;
    let first = plant.rest_gain().map_or(0.0, |_| input[0]);
    let moved = memory::collected(WHAT, input.iter().map(|value| value - first))?;
    let held = Held {
        time: input_time,
        value: &moved,
    };
    let mut out = memory::filled(WHAT, 0.0, times.len())?;
    let space = plant.space(&[], 0.0);
    respond([&space], held, 0.0, times, [&mut out], None, task)?;
    let rest = plant.rest_gain().unwrap_or(0.0) * first;
    out.iter_mut().for_each(|value| *value += rest);
    Ok(out)
}

/// What memory is asked for.
const WHAT: &str = "a response";

/// The responses of plants of equally many states to `inputs`, each `delay` later, at `times`; and the
/// slope of the first there, if asked for.
///
/// Plants that differ little, for a difference quotient, go side by side: events and lengths of steps
/// are the same.
pub(super) fn respond<const M: usize>(
    plants: [&PlantSpace; M],
    inputs: Held<'_>,
    delay: f64,
    times: &[f64],
    outs: [&mut [f64]; M],
    rate: Option<&mut [f64]>,
    task: &Task,
) -> Result<(), Error> {
    let run = match plants[0].b.len() {
        0 => run::<0, M>,
        1 => run::<1, M>,
        2 => run::<2, M>,
        3 => run::<3, M>,
        4 => run::<4, M>,
        5 => run::<5, M>,
        6 => run::<6, M>,
        7 => run::<7, M>,
        8 => run::<8, M>,
        n => refuse!("the plant has {n} states, but the likelihood can use at most 8"),
    };
    run(plants, inputs, delay, times, outs, rate, task)
}

fn run<const N: usize, const M: usize>(
    plants: [&PlantSpace; M],
    inputs: Held<'_>,
    delay: f64,
    times: &[f64],
    mut outs: [&mut [f64]; M],
    mut rate: Option<&mut [f64]>,
    task: &Task,
) -> Result<(), Error> {
    let c: [[f64; N]; M] = plants.map(|plant| std::array::from_fn(|i| plant.c[i]));
    // The slope of the output is C (A x + B u) between events.
    let first = plants[0];
    let by_state: [f64; N] =
        std::array::from_fn(|j| (0..N).map(|i| first.c[i] * first.a[i * N + j]).sum());
    let by_input: f64 = first.c.iter().zip(&first.b).map(|(c, b)| c * b).sum();
    let mut steps = Steps::<N, M>::new(plants);
    let mut states = [[0.0; N]; M];
    let mut arrivals = inputs.time.iter().zip(inputs.value);
    let mut coming = arrivals.next();
    let mut input = 0.0;
    let mut now = inputs.time.first().map_or(0.0, |first| first + delay);
    let mut events: u32 = 0;
    for (row, &time) in times.iter().enumerate() {
        loop {
            events = events.wrapping_add(1);
            if events.is_multiple_of(SETTLED) {
                states = states.map(|state| state.map(settled));
            }
            if events.is_multiple_of(CHECKED) {
                task.check()?;
            }
            let arrival = coming.map_or(f64::INFINITY, |(time, _)| time + delay);
            let until = time.min(arrival);
            let length = until - now;
            if N > 0 && length > 0.0 {
                let steps = steps.at(length, until);
                for (state, step) in states.iter_mut().zip(steps) {
                    *state = step.apply(state, input);
                }
                now = until;
            }
            if let Some((_, value)) = coming.filter(|_| arrival <= time) {
                input = *value;
                coming = arrivals.next();
                now = now.max(arrival);
            } else {
                break;
            }
        }
        for (((out, plant), c), state) in outs.iter_mut().zip(plants).zip(&c).zip(&states) {
            out[row] = product(c, state) + plant.d * input;
        }
        if let Some(rate) = rate.as_deref_mut() {
            rate[row] = product(&by_state, &states[0]) + by_input * input;
        }
    }
    Ok(())
}

fn product<const N: usize>(x: &[f64; N], y: &[f64; N]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::plant::Plant;
    use super::super::tests::{integral, lagged};
    use super::*;

    /// The response and its slope.
    fn response(
        plant: (&[f64], &[f64], &[f64]),
        inputs: &[(f64, f64)],
        delay: f64,
        times: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let (num, den, lags) = plant;
        let space = Plant::new(num, den).unwrap().space(lags, 0.0);
        let (time, value): (Vec<f64>, Vec<f64>) = inputs.iter().copied().unzip();
        let held = Held {
            time: &time,
            value: &value,
        };
        let (mut out, mut rate) = (vec![f64::NAN; times.len()], vec![f64::NAN; times.len()]);
        let task = Task::new();
        respond(
            [&space],
            held,
            delay,
            times,
            [&mut out],
            Some(&mut rate),
            &task,
        )
        .unwrap();
        (out, rate)
    }

    const INTEGRATOR: (&[f64], &[f64], &[f64]) = (&[1.0], &[1.0, 0.0], &[]);

    fn increasing(steps: &[f64], start: f64) -> Vec<f64> {
        steps
            .iter()
            .scan(start, |time, step| {
                *time += step;
                Some(*time)
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn an_integrator_and_a_lag_have_their_closed_forms(
            rows in proptest::collection::vec(1e-3..0.3_f64, 1..60),
            steps in proptest::collection::vec((1e-3..0.5_f64, -2.0..2.0_f64), 1..60),
            start in -3.0..3.0_f64,
            delay in 0.0..2.0_f64,
            lag in prop_oneof![0.02..2.0_f64, -8.0..-4.0_f64],
        ) {
            let times = increasing(&rows, 0.0);
            let (lengths, values): (Vec<f64>, Vec<f64>) = steps.into_iter().unzip();
            let inputs: Vec<(f64, f64)> =
                increasing(&lengths, start).into_iter().zip(values).collect();
            let (found, rate) = response(INTEGRATOR, &inputs, delay, &times);
            let (behind, slope) = response((&[1.0], &[1.0], &[lag]), &inputs, delay, &times);
            for (row, time) in times.iter().enumerate() {
                prop_assert!((found[row] - integral(&inputs, delay, *time)).abs() < 1e-12);
                prop_assert!((behind[row] - lagged(&inputs, delay, lag, *time)).abs() < 1e-11);
                let arrived = inputs.iter().rev().find(|(from, _)| from + delay <= *time);
                let input = arrived.map_or(0.0, |(_, value)| *value);
                prop_assert_eq!(rate[row], input);
                prop_assert!((slope[row] - (input - behind[row]) / lag).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn rows_and_commands_may_be_dense_or_sparse() {
        let rows: Vec<f64> = (0..2000).map(|i| 0.005 * f64::from(i)).collect();
        let inputs: Vec<(f64, f64)> = (0..2000)
            .map(|i| 0.005 * f64::from(i))
            .map(|time| (time, (3.0 * time).sin()))
            .collect();
        let few: Vec<(f64, f64)> = inputs.iter().copied().step_by(130).collect();
        let some: Vec<f64> = rows.iter().copied().step_by(170).collect();
        for (inputs, times) in [(&inputs, &some), (&few, &rows), (&inputs, &rows)] {
            for delay in [0.0, 0.0023, 0.31] {
                let (found, _) = response(INTEGRATOR, inputs, delay, times);
                for (found, time) in found.iter().zip(times) {
                    assert!((found - integral(inputs, delay, *time)).abs() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn a_command_acts_from_its_row_on_where_there_is_no_delay() {
        let inputs = [(0.0, 2.0), (1.0, 5.0)];
        let (found, rate) = response((&[1.0], &[1.0], &[]), &inputs, 0.0, &[-1.0, 0.0, 0.5, 1.0]);
        assert_eq!(found, [0.0, 2.0, 2.0, 5.0]);
        assert_eq!(rate, [0.0; 4]);
    }

    #[test]
    fn the_rate_is_the_slope_of_the_response() {
        let plant: (&[f64], &[f64], &[f64]) = (&[0.4, 2.0], &[1.0, 0.6, 3.0, 0.0], &[0.3, 0.1]);
        let inputs: Vec<(f64, f64)> = (0..40)
            .map(|i| 0.25 * f64::from(i))
            .map(|time| (time, (1.7 * time).cos()))
            .collect();
        let step = 1e-4;
        // Between the arrivals of commands.
        let middle: Vec<f64> = (0..30).map(|i| 0.25 * f64::from(i) + 0.3).collect();
        let times: Vec<f64> = middle
            .iter()
            .flat_map(|t| [t - step, *t, t + step])
            .collect();
        let (found, rate) = response(plant, &inputs, 0.2, &times);
        for (found, rate) in found.chunks_exact(3).zip(rate.chunks_exact(3)) {
            assert!(((found[2] - found[0]) / (2.0 * step) - rate[1]).abs() < 1e-6);
        }
    }

    #[test]
    fn a_state_that_has_decayed_becomes_zero() {
        let times: Vec<f64> = (0..2000).map(f64::from).collect();
        let inputs = [(0.0, 1.0), (1.0, 0.0)];
        let (found, _) = response((&[1.0], &[1.0], &[0.9]), &inputs, 0.0, &times);
        assert!(found.iter().all(|x| !x.is_subnormal()));
        assert_eq!(found[1999], 0.0);
        assert!((found[100] / lagged(&inputs, 0.0, 0.9, 100.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_stop_is_seen_within_the_events() {
        let task = Task::new();
        task.stop();
        let space = Plant::new(&[1.0], &[1.0, 0.0]).unwrap().space(&[], 0.0);
        let times: Vec<f64> = (0..5000).map(f64::from).collect();
        let held = Held {
            time: &times,
            value: &times,
        };
        let mut out = vec![0.0; times.len()];
        let found = respond([&space], held, 0.5, &times, [&mut out], None, &task);
        assert_eq!(found, Err(Error::Interrupted));
    }
}
