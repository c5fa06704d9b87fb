//! Readings that a sensor did not take: frozen and repeated ones, and glitches. They are left out.
//!
//! Equal readings of a coarse sensor are none of these: repeats count where readings usually differ by
//! many steps of the sensor. A glitch leaves for a few rows and comes back.

use std::ops::Range;

use super::rows::Record;
use super::tolerances::SENSORS;

/// What a sensor did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorKind {
    /// It gave one value for a long time.
    Frozen,
    /// It gave some values several times.
    Repeated,
    /// It left for a few rows and came back.
    Glitch,
    /// Its readings were replaced by their moving mean.
    Smoothed,
}

impl SensorKind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Frozen => "frozen",
            Self::Repeated => "repeated",
            Self::Glitch => "glitch",
            Self::Smoothed => "smoothed",
        }
    }
}

/// Rows that were left out of a record, or smoothed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFault {
    /// Why.
    pub kind: SensorKind,
    /// The record.
    pub record: usize,
    /// How many rows.
    pub rows: usize,
    /// The mean age of repeated readings, s, or the length of a moving mean, rows; NaN of others.
    pub size: f64,
    /// Times of the first and of the last of them, s.
    pub from: f64,
    /// The last.
    pub to: f64,
}

/// The record without what the sensor did not read, and what that was.
pub(super) fn without_faults(record: &Record, place: usize) -> (Record, Vec<SensorFault>) {
    let mut out = record.clone();
    let mut faults = Vec::new();
    let known: Vec<usize> = (0..out.output.len())
        .filter(|row| out.output[*row].is_finite())
        .collect();
    if known.len() < SENSORS.fewest {
        return (out, faults);
    }
    let values: Vec<f64> = known.iter().map(|row| record.output[*row]).collect();
    // How a sensor reads is seen in all rows; what it did counts in those that are fitted.
    let first = known.partition_point(|row| *row < out.earlier);
    let mut leave = |kind: SensorKind, runs: &[Range<usize>]| {
        let fitted = runs.iter().map(|run| run.start.max(first)..run.end);
        let runs: Vec<_> = fitted.filter(|run| !run.is_empty()).collect();
        let rows = runs.iter().map(ExactSizeIterator::len).sum();
        let taken = |run: &std::ops::Range<usize>| record.time[known[run.start.max(1) - 1]];
        let ages = runs.iter().flat_map(|run| {
            let taken = taken(run);
            run.clone().map(move |at| (at, taken))
        });
        let age: f64 = ages.map(|(at, taken)| record.time[known[at]] - taken).sum();
        let size = match kind {
            SensorKind::Repeated => age / rows as f64,
            _ => f64::NAN,
        };
        if let (Some(first), Some(last)) = (runs.first(), runs.last()) {
            faults.push(SensorFault {
                kind,
                record: place,
                rows,
                size,
                from: record.time[known[first.start]],
                to: record.time[known[last.end - 1]],
            });
        }
        for at in runs.into_iter().flatten() {
            out.output[known[at]] = f64::NAN;
        }
    };
    let repeats = repeats(&values);
    let usual = usual_run(&values);
    let long = SENSORS.frozen.max(SENSORS.longer * usual);
    let (frozen, short): (Vec<_>, Vec<_>) = repeats
        .into_iter()
        .partition(|run| run.len() as f64 >= long);
    for run in &frozen {
        leave(SensorKind::Frozen, std::slice::from_ref(run));
    }
    leave(SensorKind::Repeated, &short);
    let glitches = glitches(&values);
    let rows: Vec<_> = glitches
        .iter()
        .map(|run| known[run.start]..known[run.end - 1] + 1)
        .collect();
    if !are_responses(&rows, &record.command) {
        leave(SensorKind::Glitch, &glitches);
    }
    (out, faults)
}

/// Whether most of these runs of rows come one and the same time after pulses of the command that are as
/// wide, and after most of its pulses comes one of them.
fn are_responses(runs: &[Range<usize>], command: &[f64]) -> bool {
    let pulse_at = |at: usize| {
        let (rest, out) = (command[at - 1], command[at] - command[at - 1]);
        let latest = (at + SENSORS.longest).min(command.len() - 1);
        let back = |row: &usize| (command[*row] - rest).abs() < 0.5 * out.abs();
        (at + 1..=latest).find(back).map(|back| at..back)
    };
    let pulses: Vec<Range<usize>> = (1..command.len()).filter_map(pulse_at).collect();
    let after = |run: &Range<usize>, pulse: &Range<usize>, lag: usize| {
        run.start.abs_diff(pulse.start + lag) <= 1 && pulse.len().abs_diff(run.len()) <= 1
    };
    let answers = |lag: usize| {
        let answered = |pulse: &&Range<usize>| runs.iter().any(|run| after(run, pulse, lag));
        let caused = |run: &&Range<usize>| pulses.iter().any(|pulse| after(run, pulse, lag));
        2 * runs.iter().filter(caused).count() > runs.len()
            && 2 * pulses.iter().filter(answered).count() > pulses.len()
    };
    let first = runs.iter().take(1 + runs.len() / 2);
    let lags = first.flat_map(|run| {
        pulses
            .iter()
            .map(|pulse| run.start.checked_sub(pulse.start))
    });
    lags.flatten().any(|lag| lag > 0 && answers(lag))
}

/// How many rows a reading usually lasts.
fn usual_run(values: &[f64]) -> f64 {
    let runs = values.chunk_by(|one, next| one == next);
    median(runs.map(|run| run.len() as f64).collect())
}

/// Readings that repeat the one before them by more than chance.
fn repeats(values: &[f64]) -> Vec<Range<usize>> {
    let steps: Vec<f64> = values
        .windows(2)
        .map(|two| (two[1] - two[0]).abs())
        .collect();
    let mut moved: Vec<f64> = steps.iter().copied().filter(|step| *step > 0.0).collect();
    moved.sort_by(f64::total_cmp);
    let Some(least) = moved.first().copied() else {
        return Vec::new();
    };
    if moved[moved.len() / 2] < SENSORS.coarse * least {
        return Vec::new();
    }
    let count = steps.len() as f64;
    // As often as a reading moves by one step up or down, it stays where it is.
    let single = moved.partition_point(|step| *step < 1.5 * least);
    let equal = (steps.len() - moved.len()) as f64;
    let chance = 0.5 * single.max(2) as f64;
    let is_chance = equal < single as f64 || are_rounded(&moved);
    let longest = if !is_chance || equal > SENSORS.excess * chance + SENSORS.few {
        1.0
    } else {
        (count / SENSORS.chance).ln() / (count / chance).ln()
    };
    let mut out = Vec::new();
    let mut at = 0;
    while at < steps.len() {
        let start = at;
        while at < steps.len() && steps[at] == 0.0 {
            at += 1;
        }
        // A vehicle at rest leaves by one step of the sensor.
        let leaves = steps
            .get(at)
            .is_none_or(|step| *step >= SENSORS.coarse * least);
        // A plant may rest before its first command.
        if start > 0 && (at - start) as f64 >= longest && leaves {
            out.push(start + 1..at + 1);
        }
        at += 1;
    }
    out
}

/// Whether the smallest of these moves, in order, are by whole steps of a sensor. Readings that are not rounded are
/// equal by no chance.
fn are_rounded(moved: &[f64]) -> bool {
    let Some((least, others)) = moved.split_first() else {
        return true;
    };
    let others = &others[..others.len().min(SENSORS.moves)];
    // The least move may be by several steps.
    let by_whole = |parts: usize| {
        let (mut sum, mut count, mut whole) = (*least, parts as f64, 0);
        for own in others {
            // The step is known better from larger moves.
            let steps = own * count / sum;
            if (steps - steps.round()).abs() < SENSORS.off {
                whole += 1;
                sum += own;
                count += steps.round();
            }
        }
        f64::from(whole) >= SENSORS.whole * others.len() as f64
    };
    others.len() < SENSORS.enough || (1..=SENSORS.parts).any(by_whole)
}

/// Readings that leave for a few rows and come back, both by far more than those around them move.
fn glitches(values: &[f64]) -> Vec<Range<usize>> {
    let steps: Vec<f64> = values.windows(2).map(|two| two[1] - two[0]).collect();
    let around = |first: usize, last: usize| {
        let before = first.saturating_sub(SENSORS.around)..first;
        let after = last + 1..(last + 1 + SENSORS.around).min(steps.len());
        let mut sizes: Vec<f64> = before.chain(after).map(|at| steps[at].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        // The largest may be those of other glitches.
        sizes.truncate(sizes.len() - SENSORS.others.min(sizes.len() / 4));
        sizes.last().copied().unwrap_or(0.0)
    };
    // At either end nothing is seen before or after it.
    let alone = |at: usize| {
        let moves = around(at, at);
        moves > 0.0 && steps[at].abs() > SENSORS.far * moves
    };
    let mut out = Vec::new();
    if steps.is_empty() {
        return out;
    }
    let mut at = 0;
    if alone(0) && !(steps.len() > 1 && alone(1)) {
        out.push(0..1);
        at = 1;
    }
    while at + 1 < steps.len() {
        // Out by the step `at`, back by the step `back`.
        let comes_back = |back: &usize| {
            let (leaves, returns) = (steps[at], steps[*back]);
            let moves = around(at, *back);
            let least = leaves.abs().min(returns.abs());
            moves > 0.0
                && leaves * returns < 0.0
                && least > SENSORS.far * moves
                && (leaves + returns).abs() < 0.5 * least
        };
        let latest = (at + SENSORS.longest).min(steps.len() - 1);
        if let Some(back) = (at + 1..=latest).find(comes_back) {
            out.push(at + 1..back + 1);
            at = back;
        }
        at += 1;
    }
    let last = steps.len() - 1;
    if at == last && last > 1 && alone(last) && !alone(last - 1) {
        out.push(last + 1..last + 2);
    }
    out
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(output: Vec<f64>) -> Record {
        Record {
            time: (0..output.len()).map(|at| 0.1 * at as f64).collect(),
            command: vec![0.0; output.len()],
            sent: None,
            hold: 0.0,
            output,
            earlier: 0,
        }
    }

    fn noisy(rows: usize, step: f64) -> Vec<f64> {
        let wave = |at: usize| {
            let noise = ((at * 7919 + 13) % 1009) as f64 / 1009.0 - 0.5;
            (at as f64 * 0.05).sin() + 0.05 * noise
        };
        let rounded = |y: f64| {
            if step > 0.0 {
                (y / step).round() * step
            } else {
                y
            }
        };
        (0..rows).map(wave).map(rounded).collect()
    }

    #[test]
    fn frozen_rows_and_glitches_are_left_out_and_nothing_of_a_coarse_sensor() {
        let mut output = noisy(400, 0.0);
        let held = output[200];
        output[200..230].fill(held);
        output[300..303].iter_mut().for_each(|y| *y += 2.0);
        let (clean, faults) = without_faults(&of(output.clone()), 0);
        assert_eq!(faults.len(), 2);
        assert_eq!((faults[0].kind, faults[0].rows), (SensorKind::Frozen, 29));
        assert_eq!((faults[1].kind, faults[1].rows), (SensorKind::Glitch, 3));
        assert_eq!(clean.output.iter().filter(|y| y.is_nan()).count(), 32);
        // Some beside one another, and one at each end.
        for at in [0, 100, 104, 109, 399] {
            output[at] += if at % 2 == 0 { 2.0 } else { -2.0 };
        }
        assert_eq!(without_faults(&of(output), 0).1[1].rows, 8);
        for step in [0.0, 0.01, 0.1] {
            assert!(without_faults(&of(noisy(400, step)), 0).1.is_empty());
        }
    }

    #[test]
    fn responses_to_pulses_of_the_command_are_no_glitches() {
        let mut record = of(noisy(400, 0.0));
        for at in [30, 91, 150, 207, 260, 331] {
            record.output[at..at + 3].iter_mut().for_each(|y| *y += 2.0);
        }
        assert_eq!(without_faults(&record, 0).1[0].rows, 18);
        for at in [30, 91, 150, 207, 260, 331] {
            record.command[at - 7..at - 4].fill(2.0);
        }
        assert!(without_faults(&record, 0).1.is_empty());
        // What a controller answers to glitches comes after them.
        record.command.fill(0.0);
        for at in [30, 91, 150, 207, 260, 331] {
            record.command[at + 1..at + 4].fill(-2.0);
        }
        assert_eq!(without_faults(&record, 0).1[0].rows, 18);
    }

    #[test]
    fn readings_that_repeat_are_counted() {
        let mut output = noisy(400, 0.0);
        for at in (1..400).filter(|at| at % 3 == 0) {
            output[at] = output[at - 1];
        }
        let (_, faults) = without_faults(&of(output), 1);
        assert_eq!(
            (faults[0].kind, faults[0].rows),
            (SensorKind::Repeated, 133)
        );
        assert_eq!(faults[0].record, 1);
    }

    #[test]
    fn one_equal_reading_is_a_repeat_where_readings_are_not_rounded() {
        for (step, rows) in [(0.0, 3), (1e-4, 0), (1e-3, 0)] {
            let mut output = noisy(400, step);
            for at in [57, 180, 333] {
                output[at] = output[at - 1];
            }
            let (_, faults) = without_faults(&of(output), 0);
            assert_eq!(faults.iter().map(|fault| fault.rows).sum::<usize>(), rows);
        }
    }
}
