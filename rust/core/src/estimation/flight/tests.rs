//! Whole fits, held against the numbers that made the recordings.

use std::sync::Arc;

use super::super::point::Quantity;
use super::super::rows::{Commands, Rows};
use super::super::tests::{gaussian, recorded};
use super::start::{excited_part, least_squares, parts_of};
use super::tolerances::LONG;
use super::*;
use crate::{Error, Task};

/// An integrator with so many free lags.
fn plant(lags: usize) -> FlightPlant {
    FlightPlant::new(vec![1.0], vec![1.0, 0.0], lags)
}

/// The whole fit of recordings.
fn profiled(plant: &FlightPlant, rows: Vec<Rows>) -> Result<FlightProfile, Error> {
    let (task, runs) = (
        Task::new(),
        rows.into_iter()
            .map(|rows| FlightRun::new(rows, 0.0))
            .collect(),
    );
    let white = least_squares(plant, runs, (0.0, 1.0), &task)?;
    let fit = beside_noise(&white, &task)?;
    let mut quantities = plant.common();
    quantities.push(Quantity::Total);
    FlightProfile::best(fit, &quantities, &quantities, &task)
}

#[test]
fn the_numbers_that_made_a_recording_are_within_their_intervals() {
    let truth = (0.31, 0.85, 0.17);
    let rows = recorded((&[1.0], &[1.0, 0.0]), truth, 0.01, 8);
    let found = profiled(&plant(1), vec![rows]).unwrap();
    let task = Task::new();
    for (quantity, value) in [
        (Quantity::Delay, 0.31),
        (Quantity::Gain, 0.85),
        (Quantity::Lag(0), 0.17),
        (Quantity::Total, 0.48),
    ] {
        let known = found.known_of(quantity).unwrap();
        let (low, high) = found.interval(quantity, 0.99, &task).unwrap();
        assert!(low < value && value < high, "{quantity:?} {low} {high}");
        let (near, far) = found.interval(quantity, 0.95, &task).unwrap();
        assert!(low <= near && far <= high);
        // The statistic at an end is that of the level.
        let reach = super::super::statistics::student_reach(0.95, known.freedom);
        let at_end = found.statistic(quantity, far, &task).unwrap();
        assert!(
            (at_end.sqrt() / reach - 1.0).abs() < 0.02,
            "{quantity:?} {at_end}"
        );
    }
    assert!(found.known_of(Quantity::Zero).is_err());
}

/// A lag of the known part, searched around the likelihood, is what it is as one of the numbers of the
/// likelihood.
#[test]
fn a_number_around_the_likelihood_has_the_errors_that_it_has_within() {
    let task = Task::new();
    let rows = recorded((&[1.0], &[1.0, 0.0]), (0.31, 0.85, 0.17), 0.01, 8);
    let runs: Arc<[FlightRun]> = vec![FlightRun::new(rows.clone(), 0.0)].into();
    let given = |numbers: &[f64]| {
        let mut plant = FlightPlant::new(vec![1.0], vec![numbers[0], 1.0, 0.0], 0);
        plant.own_lag = numbers[0];
        Ok((plant, Arc::clone(&runs)))
    };
    let (white, first) = first_numbers(&given, &[0.1], (0.0, 1.0), &task).unwrap();
    let fit = beside_noise(&white, &task).unwrap();
    let (fit, numbers) = fit_numbers(&fit, &given, &first, &task).unwrap();
    let quantities = [Quantity::Gain, Quantity::Delay, Quantity::Total];
    let profile = FlightProfile::best(fit, &quantities, &quantities, &task).unwrap();
    let around = profile.beside(numbers.unwrap());
    let within = profiled(&plant(1), vec![rows]).unwrap();
    let lag = within.known_of(Quantity::Lag(0)).unwrap();
    let value = around.numbers.as_ref().unwrap().values[0];
    assert!((value - lag.value).abs() < 0.05 * lag.error(), "{value}");
    let error = around.error_of_number(0).unwrap();
    assert!((error / lag.error() - 1.0).abs() < 0.1, "{error}");
    for quantity in quantities {
        let [one, other] = [&around, &within].map(|own| own.known_of(quantity).unwrap().error());
        assert!(
            (one / other - 1.0).abs() < 0.1,
            "{quantity:?} {one} {other}"
        );
        let [one, other] =
            [&around, &within].map(|own| own.interval(quantity, 0.95, &task).unwrap());
        let size = 0.15 * (other.1 - other.0);
        assert!((one.0 - other.0).abs() < size && (one.1 - other.1).abs() < size);
    }
    let (low, high) = around.interval_of_number(0, 0.95).unwrap();
    assert!(low < 0.17 && 0.17 < high);
    let at_end = around.statistic_of_number(0, high).unwrap().sqrt();
    assert!((at_end - 2.0).abs() < 0.1, "{at_end}");
    assert_eq!(
        around.statistic_of_number(0, -value).unwrap(),
        f64::INFINITY
    );
    // Their joint covariance has these errors.
    let cov = around.covariance_of(&quantities[..2]);
    assert!((cov[8].sqrt() / error - 1.0).abs() < 1e-9);
    let delay = around.known_of(Quantity::Delay).unwrap();
    let own = delay.bound.hypot(delay.added);
    assert!((cov[4].sqrt() / own - 1.0).abs() < 1e-9);
}

#[test]
fn outliers_are_left_out_and_do_not_move_the_fit() {
    let truth = (0.31, 0.85, 0.0);
    let clean = recorded((&[1.0], &[1.0, 0.0]), truth, 0.01, 3);
    let mut spoilt = clean.clone();
    for row in [20, 21, 60] {
        spoilt.output[row] += 0.5;
    }
    let [clean, spoilt] = [clean, spoilt].map(|rows| profiled(&plant(0), vec![rows]).unwrap());
    assert!(!spoilt.fit.runs[0].rows.used[20] && !spoilt.fit.runs[0].rows.used[60]);
    let error = clean.known_of(Quantity::Delay).unwrap().error();
    let moved = clean.fit.fit.point.delay() - spoilt.fit.fit.point.delay();
    assert!(moved.abs() < error, "{moved} {error}");
}

#[test]
fn two_recordings_tell_more_than_one() {
    let of = |seed| recorded((&[1.0], &[1.0, 0.0]), (0.31, 0.85, 0.0), 0.01, seed);
    let one = profiled(&plant(0), vec![of(1)]).unwrap();
    let two = profiled(&plant(0), vec![of(1), of(2)]).unwrap();
    // Twice the rows, and noise whose size each estimates for itself.
    for quantity in [Quantity::Delay, Quantity::Gain] {
        let share =
            two.known_of(quantity).unwrap().error() / one.known_of(quantity).unwrap().error();
        assert!((0.5..0.9).contains(&share), "{quantity:?} {share}");
    }
}

#[test]
fn a_command_without_effect_tells_nothing() {
    let rows = recorded((&[1.0], &[1.0, 0.0]), (0.31, 0.85, 0.0), 0.01, 3);
    let still = Rows {
        commands: Commands {
            value: vec![0.0; rows.commands.value.len()],
            ..rows.commands.clone()
        },
        ..rows
    };
    let error = profiled(&plant(0), vec![still]).unwrap_err();
    assert!(
        error.to_string().contains("does not depend on the command"),
        "{error}"
    );
}

#[test]
fn the_part_of_a_long_recording_is_that_in_which_the_command_changes() {
    let count = 3 * LONG.part;
    let time: Vec<f64> = (0..count).map(|row| 0.05 * row as f64).collect();
    let noise = gaussian(4, count);
    let command = |row: usize| {
        if row < 2 * LONG.part { 0.0 } else { noise[row] }
    };
    let commands: Vec<f64> = (0..count).map(command).collect();
    let (rows, sent) = excited_part(&time, &time, &commands).unwrap();
    assert_eq!(rows, 2 * LONG.part..count);
    // Commands of as long a time before it act on it.
    assert_eq!(sent.end, count);
    assert!(sent.start.abs_diff(LONG.part) <= 1, "{sent:?}");
    assert_eq!(excited_part(&time[..LONG.part], &time, &commands), None);
    let last = time[count - 10];
    let mut rows = Rows::new((time.clone(), vec![0.0; count]), (time, commands)).unwrap();
    rows.offset = false;
    rows.commands.unknown = vec![(10.0, 11.0), (last, last + 0.1)];
    let part = &parts_of(&vec![FlightRun::new(rows, 0.0)].into())[0].rows;
    assert_eq!(part.time.len(), LONG.part);
    // What those before have left is in the output at the start.
    assert!(part.offset);
    assert_eq!(part.commands.unknown, [(last, last + 0.1)]);
}
