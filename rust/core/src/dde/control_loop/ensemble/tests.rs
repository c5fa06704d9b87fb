//! The vectorised code against the code for single loops.

use super::*;
use crate::Task;
use crate::dde::control_loop::linear_loop::Start;
use crate::dde::control_loop::metrics::{Criteria, Metrics};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::row::Row;
use proptest::prelude::*;

const CRITERIA: Criteria = Criteria {
    rise: (0.1, 0.9),
    settling: 0.02,
};

/// A plant in observable form, c the first unit row: A, B, D.
type Plant = (Vec<f64>, Vec<f64>, f64);

/// A, B, E, C of a controller, its gains on y and r.
type Controller = (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>, f64);

fn plant(kind: usize, gain: f64, lag: f64) -> Plant {
    let fast = 0.4 * lag;
    match kind {
        0 => (vec![0.0], vec![gain], 0.0),
        1 => (vec![-1.0 / lag, 1.0, 0.0, 0.0], vec![0.0, gain / lag], 0.0),
        2 => (vec![-1.0 / lag], vec![gain / lag], 0.0),
        // Two lags; with a zero and feedthrough.
        3 => {
            let (sum, product) = (lag + fast, lag * fast);
            let a = vec![-sum / product, 1.0, -1.0 / product, 0.0];
            (a, vec![0.0, gain / product], 0.0)
        }
        4 => (vec![-1.0 / lag], vec![0.7 * gain / lag], 0.3 * gain),
        // An oscillator, and with an integrator.
        _ => {
            let rate = 1.0 / lag;
            let a = vec![-0.3 * rate, 1.0, -rate * rate, 0.0];
            (a, vec![0.0, gain * rate * rate], 0.0)
        }
    }
}

fn controller(kind: usize, kp: f64, other: f64) -> Controller {
    let omega = 38.0;
    match kind {
        0 => (vec![], vec![], vec![], vec![], kp),
        1 => (vec![0.0], vec![-1.0], vec![1.0], vec![other], kp),
        _ => (
            vec![0.0, omega, -omega, -2.0 * omega],
            vec![0.0, omega],
            vec![0.0; 2],
            vec![0.0, -0.2 * other * omega],
            kp,
        ),
    }
}

/// A loop as a row of numbers, and the number of its states.
fn row(
    plant: &Plant,
    controller: &Controller,
    delay: f64,
    sample_time: f64,
    limit: f64,
) -> Vec<f64> {
    let ((ap, bp, d), (ac, bc, ec, cc, kp)) = (plant, controller);
    let (n, m) = (bp.len(), bc.len());
    let size = n + m;
    let mut a = vec![0.0; size * size];
    for i in 0..n {
        for j in 0..n {
            a[i * size + j] = ap[i * n + j];
        }
    }
    for i in 0..m {
        a[(n + i) * size] = bc[i];
        for j in 0..m {
            a[(n + i) * size + n + j] = ac[i * m + j];
        }
    }
    let unit = |i: usize| if i == 0 { 1.0 } else { 0.0 };
    let mut row = a;
    row.extend(bp.iter().copied().chain(bc.iter().map(|b| b * d)));
    row.extend(std::iter::repeat_n(0.0, n).chain(ec.iter().copied()));
    row.extend((0..n).map(|i| -kp * unit(i)).chain(cc.iter().copied()));
    row.extend((0..size).map(unit));
    row.extend([-kp * d, *kp, *d, 0.0, delay, sample_time, limit]);
    row
}

/// Entries of many rows.
fn columns(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..rows[0].len())
        .map(|place| rows.iter().map(|row| row[place]).collect())
        .collect()
}

/// Metrics and outcomes of all sets.
fn all_metrics(
    sets: &Sets<'_>,
    numbers: (&[f64], &[f64]),
    span: f64,
) -> Result<Vec<(Metrics, Outcome)>, crate::Error> {
    let mut found = vec![(Metrics::UNKNOWN, Outcome::Refused); sets.len()];
    metrics(
        sets,
        numbers,
        span,
        &CRITERIA,
        &Task::new(),
        |sets, measures| {
            for (lane, (&set, outcome)) in sets.iter().zip(measures.outcomes()).enumerate() {
                found[set] = (measures.of(lane), outcome);
            }
        },
    )?;
    Ok(found)
}

/// Metrics of a set by the code for single loops.
fn alone(sets: &Sets<'_>, set: usize, span: f64) -> Metrics {
    let one = each::Alone::of(sets, set).ok().flatten();
    let found = one.map(|one| one.metrics((f64::NAN, 0.0), span, &CRITERIA, &Task::new()));
    let found = found.and_then(Result::ok);
    found.map_or(Metrics::UNKNOWN, |((metrics, _), _)| metrics)
}

/// Loops whose gains differ from those of `rows` by some rounding errors. A saturated loop may be
/// chaotic, and is then known no better than these agree.
fn moved(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut rows = rows.to_vec();
    for row in &mut rows {
        let n = states(row);
        let k = n * n + 2 * n;
        let gains = (k..k + n).chain([k + 2 * n, k + 2 * n + 1]);
        gains.for_each(|place| row[place] *= 1.0 + 1e-14);
    }
    rows
}

/// Values of the output at the extremes agree in any case; times at which it is flat, or touches a
/// level, are known to the root of rounding errors. An error e of the output is one of
/// e (1 + share)/step in a share of the step. `other` is what moved gains give.
fn agree(found: Metrics, truth: Metrics, other: Metrics) -> bool {
    // A response that has not begun has neither peak nor steady state.
    let least = truth.steady_state.abs().clamp(f64::MIN_POSITIVE, 1.0);
    let size = 1.0 + truth.peak / least;
    let (found, truth, other) = (found.to_array(), truth.to_array(), other.to_array());
    (0..found.len()).all(|i| {
        let by = match i {
            0 => 1e-8,
            1 => 1e-7,
            // Two peaks may be equal but for rounding errors.
            2 => return true,
            3 | 4 => 1e-11 * size / least * (100.0 + truth[i].abs()),
            _ => 1e-11 * size,
        };
        // NaN counts as zero.
        let unknown = (4.0 * (other[i] - truth[i]).abs()).max(0.0);
        (found[i] - truth[i]).abs() <= by + unknown || (found[i].is_nan() && truth[i].is_nan())
    })
}

/// Sets of one structure, sampled or continuous, with a limit.
fn loops() -> impl Strategy<Value = (Vec<Vec<f64>>, bool, f64)> {
    let numbers = (
        0.3..2.0,
        0.05..0.8,
        0.0..0.6_f64,
        0.02..0.15,
        0.4..1.5,
        any::<bool>(),
    );
    (
        (
            0..6_usize,
            0..3_usize,
            any::<bool>(),
            any::<bool>(),
            0.5..12.0_f64,
        ),
        prop::collection::vec(numbers, 1..20),
    )
        .prop_map(|((kind, law, is_ahead, is_continuous, span), sets)| {
            let rows = sets
                .into_iter()
                .map(|(kp, lag, delay, sample_time, bound, is_whole)| {
                    let plant = plant(kind, 1.0, lag);
                    let controller = controller(law, kp, 0.4);
                    let whole = f64::floor(delay / sample_time) * sample_time;
                    let delay = if is_whole { whole } else { delay };
                    let sample_time = if is_continuous { 0.0 } else { sample_time };
                    row(&plant, &controller, delay, sample_time, bound)
                })
                .collect();
            (rows, is_ahead, span)
        })
}

/// States of a loop by the length of its row.
fn states(row: &[f64]) -> usize {
    (1..8)
        .find(|&n| crate::dde::control_loop::row::width(n) == row.len())
        .unwrap_or_default()
}

/// The later chunks of a trace repeated the last whole corner of a run that had ended: a dip.
#[test]
fn a_run_that_ends_before_its_neighbour_has_no_dip_after_its_end() {
    let plant = (vec![0.0], vec![1.0], 0.0);
    let controller = (vec![], vec![], vec![], vec![], 0.3);
    let rows = [0.436, 0.028].map(|delay| row(&plant, &controller, delay, 0.0, 0.4));
    assert_eq!(unlike(&rows, false, 0.5), None);
}

/// The first set whose metrics differ from those of the code for single loops.
fn unlike(rows: &[Vec<f64>], is_ahead: bool, span: f64) -> Option<String> {
    let (given, moved) = (columns(rows), columns(&moved(rows)));
    let sets = |columns| Sets::new(states(&rows[0]), rows.len(), columns, 1.0, is_ahead);
    let entries: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
    let others: Vec<&[f64]> = moved.iter().map(Vec::as_slice).collect();
    let (sets, others) = match (sets(&entries), sets(&others)) {
        (Ok(sets), Ok(others)) => (sets, others),
        (Err(error), _) | (_, Err(error)) => return Some(error.to_string()),
    };
    let numbers: (&[f64], &[f64]) = (&[f64::NAN], &[0.0]);
    let found = match all_metrics(&sets, numbers, span) {
        Ok(found) => found,
        Err(error) => return Some(error.to_string()),
    };
    found.into_iter().enumerate().find_map(|(set, (found, _))| {
        let (truth, other) = (alone(&sets, set, span), alone(&others, set, span));
        (!agree(found, truth, other))
            .then(|| format!("{found:?} is not {truth:?} in set {set} of {rows:?}"))
    })
}

proptest! {
    #[test]
    fn lanes_measure_as_the_single_engine_does((rows, is_ahead, span) in loops()) {
        let unlike = unlike(&rows, is_ahead, span);
        prop_assert!(unlike.is_none(), "{}", unlike.unwrap_or_default());
    }

    #[test]
    fn lanes_respond_as_the_single_engine_does(
        (rows, is_ahead, _) in loops(),
        mut times in prop::collection::vec(0.0..8.0_f64, 1..20),
    ) {
        times.sort_by(f64::total_cmp);
        let columns = columns(&rows);
        let entries: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let n = states(&rows[0]);
        let Ok(sets) = Sets::new(n, rows.len(), &entries, 1.0, is_ahead) else {
            return Err(TestCaseError::fail("no sets"));
        };
        let task = Task::new();
        let Ok((found, _)) = responses(&sets, &times, &task) else {
            return Err(TestCaseError::fail("a run failed"));
        };
        let single = |row: &[f64]| {
            let row = Row::new(n, row)?;
            let start = Start { state: vec![0.0; n], ..Start::default() };
            let read: Vec<f64> = times.iter().map(|t| t + sets.ahead(row.delay)).collect();
            let step = Reference::step(0.0, 1.0)?;
            let found = row.checked()?.simulate(&start, &step, &read, &[], &task)?;
            Ok::<_, crate::Error>(found.outputs)
        };
        let others = moved(&rows);
        for (set, found) in found.chunks(times.len()).enumerate() {
            let (Ok(truth), Ok(other)) = (single(&rows[set]), single(&others[set])) else {
                return Err(TestCaseError::fail("a single run failed"));
            };
            let size = truth.iter().fold(1.0_f64, |m, y| m.max(y.abs()));
            for ((found, truth), other) in found.iter().zip(&truth).zip(&other) {
                let by = 1e-12 * size + 4.0 * (other - truth).abs();
                prop_assert!((found - truth).abs() < by, "{found} is not {truth}");
            }
        }
    }

    /// The recursion of Schur and Cohn against the eigenvalues.
    #[test]
    fn decay_is_that_of_the_poles((rows, _, _) in loops(), share in 0.2..3.0_f64) {
        let span = 400.0;
        for values in &rows {
            let n = states(values);
            let unlimited: Vec<f64> = values[..values.len() - 1]
                .iter()
                .copied()
                .chain([f64::INFINITY])
                .collect();
            let Ok(plant) = Row::new(n, &unlimited).and_then(|row| row.checked()) else {
                continue;
            };
            let Ok(poles) = crate::dde::sampled::poles(&plant) else {
                continue;
            };
            let slowest = poles.first().map_or(0.0, |pole| -1.0 / pole.re);
            let entries: Vec<&[f64]> = unlimited.chunks(1).collect();
            let Ok(sets) = Sets::new(n, 1, &entries, 1.0, false) else {
                continue;
            };
            // Everything that is quiet counts as slow, so that the poles decide.
            let slow = [f64::INFINITY];
            let numbers: (&[f64], &[f64]) = (&[f64::NAN], &slow);
            let span = (slowest * 3.0 * share + 1.0).clamp(1.0, span);
            let Ok(found) = all_metrics(&sets, numbers, span) else {
                continue;
            };
            let (metrics, outcome) = found[0];
            let needed = 3.0 * slowest / (span - metrics.settling_time);
            if slowest <= 0.0 || needed.is_nan() || (needed - 1.0).abs() < 1e-6 {
                continue;
            }
            let expected = if needed < 1.0 { Outcome::Ok } else { Outcome::Unsettled };
            prop_assert!(outcome == expected || outcome == Outcome::Doubtful, "{outcome:?}");
        }
    }
}

#[test]
fn a_set_is_refused_or_diverges_alone() {
    let p = |kp: f64, delay: f64, limit: f64| {
        row(
            &plant(0, 1.0, 1.0),
            &controller(0, kp, 0.0),
            delay,
            0.065,
            limit,
        )
    };
    let rows = [
        p(1.0, 0.1, f64::INFINITY),
        p(1.0, -0.1, 1.0),
        p(1e3, 0.1, f64::INFINITY),
    ];
    let columns = columns(&rows);
    let entries: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let sets = Sets::new(1, 3, &entries, 1.0, false);
    let found = sets.and_then(|sets| all_metrics(&sets, (&[1.0], &[0.0]), 100.0));
    let outcomes: Vec<Outcome> = found.into_iter().flatten().map(|(_, o)| o).collect();
    assert_eq!(outcomes, [Outcome::Ok, Outcome::Refused, Outcome::Diverged]);
}

/// The first run of each pair enters its band in its last part, and the second one takes more
/// traces: these must leave the record of the first alone (its settling time was lost).
#[test]
fn a_run_that_is_over_keeps_its_record_in_later_traces() {
    let lagging = |lag: f64| plant(1, 1.0, lag);
    let pi = controller(1, 0.3, 0.4);
    let pair = [
        row(
            &lagging(1.0 / 1.4438254209689607),
            &pi,
            0.5735020898892843,
            0.08256770663318484,
            0.6845498624065149,
        ),
        row(
            &lagging(1.0 / 2.9467378848426433),
            &pi,
            0.17314003479386092,
            0.026103404789516324,
            0.4,
        ),
    ];
    assert_eq!(unlike(&pair, true, 8.088670942370825), None);
    for law in 0..3 {
        let oscillator = |rate: f64| plant(5, 1.0, 1.0 / rate);
        let law = controller(law, 1.9668, 0.4);
        let pair = [
            row(&oscillator(0.4442 / 0.3), &law, 0.29383, 0.04446, 0.93678),
            row(&oscillator(2.0), &law, 0.3, 0.02, 0.9),
        ];
        for part in 0..40 {
            let span = 10.414699 - 0.0444 * f64::from(part);
            assert_eq!(unlike(&pair, false, span), None);
        }
    }
}

/// What a run does after its end, while its neighbour still runs, is no unrest: an unstable mode,
/// which the input hardly excites, is larger by then.
#[test]
fn a_run_is_as_quiet_beside_any_neighbour() {
    let growing = |sample_time: f64| -> Vec<f64> {
        let a = [-5.0, 0.0, 0.0, 3.0];
        let vectors = [5.0, 3e-9, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0];
        let numbers = [0.0, 1.0, 0.0, 0.0, 0.0, sample_time, f64::INFINITY];
        a.into_iter().chain(vectors).chain(numbers).collect()
    };
    let rows = [growing(0.2), growing(0.15)];
    for rows in [&rows[..1], &rows] {
        let columns = columns(rows);
        let entries: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let sets = Sets::new(2, rows.len(), &entries, 1.0, false);
        let found = sets.and_then(|sets| all_metrics(&sets, (&[1.0], &[0.0]), 4.0));
        let outcomes: Vec<Outcome> = found.into_iter().flatten().map(|(_, o)| o).collect();
        assert_eq!(outcomes.first(), Some(&Outcome::Ok));
    }
}

/// Arithmetic with forty digits lies between both codes here, and moves as far if the gains are
/// moved by 1e-15 of themselves.
#[test]
fn a_chaotic_loop_agrees_as_far_as_it_is_known() {
    let lag = 0.3 / 3.462089958274656;
    let law = controller(2, 1.81229235295028, 0.4);
    let rows = [row(
        &plant(5, 1.0, lag),
        &law,
        0.0,
        0.11445971360585044,
        1.347836762890999,
    )];
    assert_eq!(unlike(&rows, false, 10.11026738622043), None);
}

/// Responses to a step of integrators of a gain under P control, with a delay and a limit, in lanes;
/// none of those that have to run alone.
fn in_lanes(
    numbers: &[(f64, f64, f64, f64)],
    step: f64,
    times: &[f64],
) -> Result<Vec<Option<Vec<f64>>>, crate::Error> {
    let rows = numbers.iter().map(|&(gain, kp, delay, limit)| {
        let controller = controller(0, kp, 0.0);
        row(&plant(0, gain, 1.0), &controller, delay, 0.0, limit)
    });
    let columns = columns(&rows.collect::<Vec<_>>());
    let entries: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let sets = Sets::new(1, numbers.len(), &entries, step, false)?;
    let span = times.last().copied().unwrap_or(0.0);
    let (alike, _) = shape::sorted(&sets, span)?;
    let mut found = vec![None; sets.len()];
    for (shape, members) in &alike {
        let (mut rows, blocks) = (Vec::new(), [(*shape, &members[..])]);
        let job = responses::ResponsesJob { times };
        through::through(&sets, &blocks, (span, &job), &mut rows);
        for (&set, row) in members.iter().zip(rows.into_iter().flatten()) {
            found[set] = row.map(|(outputs, _)| outputs);
        }
    }
    Ok(found)
}

/// The search for the end of the time at the limit went on for as long as a neighbour ran.
#[test]
fn a_run_that_ends_at_its_limit_has_its_bits_beside_any_neighbour() -> Result<(), crate::Error> {
    let times: Vec<f64> = (0..=50).map(|i| 0.1 * f64::from(i)).collect();
    let pair = [(1.0, 0.3, 1.0, 0.01), (1.0, 1.0, 0.03, 0.01)];
    let alone = in_lanes(&pair[..1], 1.0, &times)?;
    assert!(alone[0].is_some());
    assert_eq!(alone[0], in_lanes(&pair, 1.0, &times)?[0]);
    Ok(())
}

/// An integrator at gain g whose command is at its limit L at first moves by g L for each second
/// after the delay τ. The command K (r − y) leaves the limit at t₁, and the plant receives
/// L − K g L (t − t₁ − τ) from t₁ + τ to t₁ + 2 τ.
#[test]
fn commands_that_begin_at_their_limit_are_those_of_the_closed_form() -> Result<(), crate::Error> {
    let all = [
        (0.85, 1.6, 0.3, 0.6),
        (0.85, 2.4, 0.1, 1.0),
        (1.3, 1.1, 0.45, 0.25),
        (0.4, 4.0, 0.02, 0.69),
    ];
    for (step, numbers) in [1.0, -0.7].iter().flat_map(|r| all.map(|n| (*r, n))) {
        let (gain, kp, delay, limit) = numbers;
        let leaves = delay + (f64::abs(step) - limit / kp) / (gain * limit);
        let part = (leaves + 2.0 * delay) / 39.0;
        let times: Vec<f64> = (0..40).map(|i| part * f64::from(i)).collect();
        let found = in_lanes(&[numbers], step, &times)?.swap_remove(0);
        assert!(found.is_some(), "{numbers:?} had to run alone");
        for (t, found) in times.iter().zip(found.unwrap_or_default()) {
            let late = (t - leaves - delay).max(0.0);
            let moved = (t - delay).max(0.0) - kp * gain * late * late / 2.0;
            let truth = f64::signum(step) * gain * limit * moved;
            assert!((found - truth).abs() < 1e-13, "{found} at {t}: {truth}");
        }
    }
    Ok(())
}
