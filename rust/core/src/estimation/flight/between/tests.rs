//! Tests of commands between rows.

use super::super::super::path::{Held, respond};
use super::super::super::plant::Plant;
use super::controlled::{Controlled, closed};
use super::gaps::gaps_of;
use super::sent::Sent;
use super::smoothed::smoothed;
use crate::Task;

/// Even times with some left out.
fn times(count: u32, missing: &[u32]) -> Vec<f64> {
    let kept = (0..count).filter(|k| !missing.contains(k));
    kept.map(|k| 0.1 * f64::from(k)).collect()
}

fn controlled(time: Vec<f64>, gain: f64) -> Controlled {
    let reference: Vec<f64> = time.iter().map(|t| f64::from(u8::from(*t > 1.0))).collect();
    let output: Vec<f64> = time.iter().map(|t| 0.1 * t).collect();
    let pairs = reference.iter().zip(&output);
    let command = pairs
        .map(|(r, y)| (2.0 * (r - y)).clamp(-1.0, 1.0))
        .collect();
    Controlled {
        time,
        reference,
        output,
        command,
        sample_time: Some(0.1),
        gain,
        is_proportional: true,
        limit: 1.0,
    }
}

#[test]
fn a_late_row_is_no_missing_one() {
    let mut time = times(30, &[12, 13]);
    time[5] += 0.06;
    let gaps = gaps_of(&time, 0.1);
    assert_eq!(gaps.len(), 1);
    assert_eq!((gaps[0].row, gaps[0].count()), (11, 2));
    assert!((gaps[0].places[1] - 1.3).abs() < 1e-12);
}

#[test]
fn the_commands_of_missing_samples_are_those_of_the_law_or_means() {
    let own = controlled(times(40, &[25, 26]), 2.0);
    let sent = own.sent(None);
    assert_eq!((sent.time.len(), sent.longest, sent.ways), (40, 2, 1));
    assert!(sent.unknown.is_empty());
    // On a straight output the law gives them exactly.
    let expected = (2.0_f64 * (1.0 - 0.1 * 2.5)).clamp(-1.0, 1.0);
    assert!((sent.command[25] - expected).abs() < 1e-12);
    // A controller with another gain is not in charge: the mean command is unknown.
    let foreign = controlled(times(40, &[25, 26]), 0.5).sent(None);
    assert_eq!(foreign.unknown.len(), 1);
    let around = 0.5 * (foreign.command[24] + foreign.command[27]);
    assert_eq!(foreign.command[25], around);
    // Where the reference changes in the gap, each of its samples is a way.
    let stepping = controlled(times(40, &[10, 11]), 2.0);
    assert_eq!(stepping.sent(None).ways, 3);
    assert_eq!(stepping.sent(None).unknown.len(), 1);
    assert!(stepping.sent(Some(1)).unknown.is_empty());
}

#[test]
fn lost_commands_are_no_held_ones() {
    let every: Vec<f64> = times(120, &[]);
    let wave = |t: &f64| (1.3 * t).sin();
    let kept: Vec<f64> = times(120, &[30, 60, 61, 62, 63]);
    let sent = Sent::with_lost(kept.clone(), kept.iter().map(wave).collect(), &every);
    assert_eq!(sent.lost, 2);
    assert_eq!(sent.time.len(), kept.len() + 2);
    assert_eq!(sent.unknown.len(), 1);
    assert!((sent.unknown[0].1 - 6.4).abs() < 1e-12);
    // Commands that seldom change are held until the next.
    let still = vec![1.0; kept.len()];
    assert_eq!(Sent::with_lost(kept.clone(), still, &every).lost, 0);
}

#[test]
fn values_are_smoothed_around_their_own_place() {
    for rows in [3_u32, 30, 96, 97, 300] {
        let noise = |k: u32| f64::from((k * 7919) % 101) / 50.0 - 1.0;
        let smooth = |k: u32| (6.0 * f64::from(k) / f64::from(rows)).sin();
        let values: Vec<f64> = (0..rows).map(|k| smooth(k) + 0.05 * noise(k)).collect();
        let (means, error) = smoothed(&values);
        let backward: Vec<f64> = values.iter().rev().copied().collect();
        let (back, same) = smoothed(&backward);
        assert_eq!(error, same);
        for (one, other) in means.iter().zip(back.iter().rev()) {
            assert!((one - other).abs() < 1e-13);
        }
        let away = (0..rows).map(|k| (means[k as usize] - smooth(k)).powi(2));
        assert!(rows == 3 || (away.sum::<f64>() / f64::from(rows)).sqrt() < 0.05);
    }
}

/// Each output from which a command is computed is wrong by e in turn: the loop is stepped.
#[test]
fn the_loop_answers_an_error_of_a_predicted_output() {
    let (sample, delay, gain) = (0.065, 0.2, 0.8);
    let space = Plant::new(&[1.0], &[1.0, 0.0]).unwrap().space(&[0.1], 0.0);
    let task = Task::new();
    let output = |sent: &[f64], at: &[f64]| {
        let time: Vec<f64> = (0..sent.len()).map(|k| sample * k as f64).collect();
        let mut out = vec![0.0; at.len()];
        let held = Held {
            time: &time,
            value: sent,
        };
        respond([&space], held, delay, at, [&mut out], None, &task).unwrap();
        out
    };
    let mut slopes = vec![0.0, 0.0];
    slopes.extend([1.7; 12]);
    let count = slopes.len();
    let commands = |errors: &[f64]| {
        let mut sent = vec![0.0; count];
        for k in 0..count {
            let y = gain * output(&sent, &[sample * k as f64])[0];
            sent[k] = -slopes[k] * (y + errors[k]);
        }
        sent.iter().sum::<f64>()
    };
    let ages: Vec<f64> = (0..count).map(|k| sample * k as f64).collect();
    let response: Vec<f64> = output(&[1.0, 0.0], &ages)
        .iter()
        .map(|y| gain * y)
        .collect();
    let (each, shared) = closed(&slopes, &response);
    for (place, own) in each.iter().enumerate() {
        let mut errors = vec![0.0; count];
        errors[place] = 1.0;
        assert!((own - commands(&errors).abs()).abs() < 1e-9);
    }
    assert!((12.0 * shared - commands(&vec![1.0; count]).abs()).abs() < 1e-9);
}
