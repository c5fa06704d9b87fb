//! −2 ln L at many delays, in rows that are even.
//!
//! The response at a delay of j + f rows is that at f rows, j rows later. Delays of a grid have few such
//! rests f: the response is computed once for each, and whitened for many delays at a time.

use super::disturbance::Joint;
use super::likelihood::{Counts, Noise};
use super::mean::{Derivatives, Gain, Values, base_of, sizes, trim_of};
use super::path::{Held, respond};
use super::plant::{Plant, PlantSpace};
use super::rows::Rows;
use super::whiten::{Known, whiten_in_place};
use crate::linear_algebra::triangle::Triangle;
use crate::{Error, Task, memory};

/// Deviation from even times, and of a delay from a rest, in rows.
const EVEN: f64 = 1e-9;

/// Most rests; with more, each delay is computed alone.
const MOST_RESTS: usize = 8;

/// Delays that are whitened together: a bound on memory.
const TOGETHER: usize = 32;

/// What memory is asked for.
const WHAT: &str = "the responses at many delays";

/// The objective of `evaluate` for `Wanted::Value` at each delay; none where rows or delays are not
/// such, or the errors of commands count.
pub(super) fn over_delays(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    noise: &Noise,
    by: &Derivatives,
    delays: &[f64],
    task: &Task,
) -> Result<Option<Vec<f64>>, Error> {
    let n = rows.time.len();
    let space = plant.space(&values.lags, values.zero);
    let (linear, count) = sizes(rows, values, &Derivatives::none());
    let commands = &rows.commands;
    let is_plain = commands.unknown.is_empty()
        && commands.uncertain.is_empty()
        && noise.stamps == 0.0
        && noise.arrivals == 0.0
        // Where a command acts at once, a row may be on either side of it.
        && space.d == 0.0;
    let used = rows.used.iter().filter(|used| **used).count();
    if !is_plain || used <= sizes(rows, values, by).1 {
        return Ok(None);
    }
    let Some(responses) = Responses::new(rows, plant, &space, delays, task)? else {
        return Ok(None);
    };
    // Offset and trim, then the output.
    let mut fixed = memory::filled(WHAT, 1.0, if rows.offset { n } else { 0 })?;
    if rows.trim {
        memory::append(WHAT, &mut fixed, &trim_of(&space, &rows.time, task)?)?;
    }
    memory::append(WHAT, &mut fixed, &rows.output)?;
    let power = rows.output.iter().zip(&rows.used);
    let counts = Counts {
        used,
        count,
        first: count,
        linear,
        power: power.filter(|(_, used)| **used).map(|(y, _)| y * y).sum(),
    };
    let disturbances = noise.disturbances();
    let joint = Joint::new(&space, &disturbances)?;
    let mut found = memory::reserved(WHAT, delays.len())?;
    let (mut plain, mut columns) = (Vec::new(), Vec::new());
    for places in responses.places.chunks(TOGETHER) {
        plain.clear();
        memory::append(WHAT, &mut plain, &fixed)?;
        for place in places {
            memory::append(WHAT, &mut plain, responses.at(*place, n))?;
        }
        for column in plain.chunks_exact_mut(n) {
            let lost = column
                .iter_mut()
                .zip(&rows.used)
                .filter(|(_, used)| !**used);
            lost.for_each(|(entry, _)| *entry = 0.0);
        }
        let mut whitened = Vec::new();
        let mut log_det = 0.0;
        if !disturbances.is_empty() {
            whitened = memory::copied(WHAT, &plain)?;
            let known = Known {
                used: &rows.used,
                variances: &[],
            };
            log_det = whiten_in_place(&rows.time, known, &mut whitened, &joint, &[], task)?;
        }
        for i in 0..places.len() {
            let mut triangle = |from: &[f64]| {
                let (fixed, responses) = from.split_at(fixed.len());
                arranged(&mut columns, fixed, &responses[i * n..][..n], values.gain);
                Triangle::new(&columns, n, count + 1, task)
            };
            let first = triangle(&plain)?;
            let (triangle, log_gram) = if disturbances.is_empty() {
                (first, 0.0)
            } else {
                let plain = first.log_det(count);
                let white = triangle(&whitened)?;
                let log_gram = white.log_det(count) - plain;
                (white, log_gram)
            };
            found.push(counts.objective(&triangle, log_det, log_gram).1);
        }
    }
    Ok(Some(found))
}

/// The columns in the order of `Mean`: the response first or last among those of unknowns, then the
/// output less its known part. `fixed` ends with the output.
fn arranged(columns: &mut Vec<f64>, fixed: &[f64], response: &[f64], gain: Gain) {
    let (unknown, output) = fixed.split_at(fixed.len() - response.len());
    columns.clear();
    if gain == Gain::Eliminated {
        columns.extend(response);
    }
    columns.extend(unknown);
    if matches!(gain, Gain::Searched(_)) {
        columns.extend(response);
    }
    match gain {
        Gain::Eliminated => columns.extend(output),
        Gain::Searched(gain) | Gain::Known(gain) => {
            columns.extend(output.iter().zip(response).map(|(y, r)| y - gain * r));
        }
    }
}

/// A response for each rest, begun as many rows early as delays need, and where each delay begins.
struct Responses {
    each: Vec<Vec<f64>>,
    places: Vec<(usize, usize)>,
}

impl Responses {
    fn new(
        rows: &Rows,
        plant: &Plant,
        space: &PlantSpace,
        delays: &[f64],
        task: &Task,
    ) -> Result<Option<Self>, Error> {
        let n = rows.time.len();
        let start = rows.time[0];
        let step = rows.span() / (n - 1) as f64;
        let is_even =
            |(row, time): (usize, &f64)| (time - start - row as f64 * step).abs() <= EVEN * step;
        if !rows.time.iter().enumerate().all(is_even) {
            return Ok(None);
        }
        let mut rests: Vec<f64> = Vec::new();
        let mut late = Vec::new();
        for delay in delays {
            let rows = delay / step;
            let whole = (rows + EVEN).floor();
            let rest = (rows - whole).max(0.0);
            let known = rests.iter().position(|one| (one - rest).abs() <= EVEN);
            if (known.is_none() && rests.len() == MOST_RESTS) || !(0.0..1e9).contains(&whole) {
                return Ok(None);
            }
            late.push((known.unwrap_or(rests.len()), whole as usize));
            if known.is_none() {
                rests.push(rest);
            }
        }
        let most = late.iter().map(|(_, whole)| *whole).max().unwrap_or(0);
        let base = base_of(plant, rows);
        let value = rows.commands.value.iter().map(|value| value - base);
        let value = memory::collected(WHAT, value)?;
        let held = Held {
            time: &rows.commands.time,
            value: &value,
        };
        let earlier = (0..n + most).map(|row| start + (row as f64 - most as f64) * step);
        let times = memory::collected(WHAT, earlier)?;
        let mut each = Vec::with_capacity(rests.len());
        for rest in rests {
            let mut response = memory::filled(WHAT, 0.0, times.len())?;
            respond(
                [space],
                held,
                rest * step,
                &times,
                [&mut response],
                None,
                task,
            )?;
            each.push(response);
        }
        let places = late.into_iter().map(|(rest, whole)| (rest, most - whole));
        Ok(Some(Self {
            each,
            places: places.collect(),
        }))
    }

    fn at(&self, (rest, begin): (usize, usize), n: usize) -> &[f64] {
        &self.each[rest][begin..begin + n]
    }
}

#[cfg(test)]
mod tests {
    use super::super::likelihood::{Wanted, evaluate};
    use super::super::tests::recorded;
    use super::*;

    const PLANTS: [(&[f64], &[f64]); 2] = [(&[1.0], &[1.0, 0.0]), (&[1.0], &[1.0, 0.4])];

    #[test]
    fn the_objectives_are_those_of_each_delay_alone() {
        let airy = Noise {
            air_time: 2.0,
            air: 0.6,
            ..Noise::QUIET
        };
        let task = Task::new();
        let by = Derivatives::none();
        for ((num, den), trim) in PLANTS.into_iter().zip([true, false]) {
            let plant = Plant::new(num, den).unwrap();
            let mut rows = recorded((num, den), (0.31, 0.85, 0.17), 0.01, 3);
            rows.trim = trim;
            rows.used[17] = false;
            rows.output[17] = f64::NAN;
            let step = rows.row_time();
            let delays: Vec<f64> = (0..100).map(|i| 0.25 * f64::from(i) * step).collect();
            for noise in [Noise::QUIET, airy] {
                for gain in [Gain::Eliminated, Gain::Searched(0.8), Gain::Known(0.8)] {
                    let mut values = Values {
                        delay: 0.0,
                        lags: vec![0.1],
                        zero: 0.0,
                        gain,
                    };
                    let found = over_delays(&rows, &plant, &values, &noise, &by, &delays, &task);
                    let found = found.unwrap().unwrap();
                    for (delay, found) in delays.iter().zip(found) {
                        values.delay = *delay;
                        let wanted = Wanted::Value;
                        let noise = noise.through(&values);
                        let one = evaluate(&rows, &plant, &values, &noise, &by, wanted, &task);
                        let expected = one.unwrap().objective;
                        assert!(
                            (found - expected).abs() < 1e-8 || found == expected,
                            "{delay} {gain:?} {found} {expected}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn uneven_rows_and_many_rests_are_left_to_each_delay_alone() {
        let (num, den) = PLANTS[0];
        let plant = Plant::new(num, den).unwrap();
        let mut rows = recorded((num, den), (0.31, 0.85, 0.17), 0.01, 3);
        let values = Values {
            delay: 0.0,
            lags: vec![0.1],
            zero: 0.0,
            gain: Gain::Eliminated,
        };
        let of = |rows: &Rows, delays: &[f64]| {
            let by = Derivatives::none();
            over_delays(
                rows,
                &plant,
                &values,
                &Noise::QUIET,
                &by,
                delays,
                &Task::new(),
            )
            .unwrap()
        };
        let step = rows.row_time();
        let many: Vec<f64> = (0..9).map(|i| f64::from(i) * 0.1 * step).collect();
        assert!(of(&rows, &many[..8]).is_some());
        assert!(of(&rows, &many).is_none());
        rows.time[5] += 1e-3 * step;
        assert!(of(&rows, &many[..8]).is_none());
    }
}
