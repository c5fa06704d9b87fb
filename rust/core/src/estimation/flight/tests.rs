//! Whole fits, held against the numbers that made the recordings.

use super::super::point::Quantity;
use super::super::rows::{Commands, Rows};
use super::super::tests::{gaussian, recorded};
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
    FlightProfile::best(fit, &quantities, &quantities, 0.95, &task)
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
    let count = 3 * SEARCHED_ROWS;
    let time: Vec<f64> = (0..count).map(|row| 0.05 * row as f64).collect();
    let noise = gaussian(4, count);
    let command = |row: usize| {
        if row < 2 * SEARCHED_ROWS {
            0.0
        } else {
            noise[row]
        }
    };
    let commands: Vec<f64> = (0..count).map(command).collect();
    let (rows, sent) = excited_part(&time, &time, &commands).unwrap();
    assert_eq!(rows, 2 * SEARCHED_ROWS..count);
    // Commands of as long a time before it act on it.
    assert_eq!(sent.end, count);
    assert!(sent.start.abs_diff(SEARCHED_ROWS) <= 1, "{sent:?}");
    assert_eq!(excited_part(&time[..SEARCHED_ROWS], &time, &commands), None);
}
