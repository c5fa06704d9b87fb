//! One row of the bank of filters: 50 delays beside one lag in wind, without and with the second
//! bank, at even rows and where each row has a length of its own.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::Error;
use deadtime::estimation::{Disturbance, Entry, Lags, Online, Plant, Settings, online};

const ROW: f64 = 0.065;
const CELLS: u32 = 50;

/// A bank that has been running for a while, and its time.
fn running(alarm: f64, jitter: f64) -> Result<(Box<dyn Online>, u32), Error> {
    let settings = Settings {
        plant: Plant::new(&[1.0], &[1.0, 0.0])?,
        own_lag: 0.0,
        delays: (0..CELLS).map(|i| 0.1 + 0.01 * f64::from(i)).collect(),
        follow: true,
        layers: vec![Lags {
            lags: vec![0.15],
            zero: 0.0,
            log_prior: vec![0.0; CELLS as usize],
        }],
        disturbances: vec![Disturbance {
            entry: Entry::Input,
            time_constant: 1.0,
            deviation: 10.0,
        }],
        gain: (0.85, 0.4),
        trim: 0.0,
        white: 0.005,
        freedom: 200.0,
        memory: 60.0,
        drift: 0.01,
        gain_walk: 0.0,
        width: 0.05,
        alarm,
        every: 1,
        at_rest: true,
        level: 0.95,
    };
    let mut bank = online(settings)?;
    let rows = 300;
    for row in 0..rows {
        step(bank.as_mut(), row, jitter)?;
    }
    Ok((bank, rows))
}

fn step(bank: &mut dyn Online, row: u32, jitter: f64) -> Result<(), Error> {
    let noise = f64::from(row.wrapping_mul(2_654_435_761) >> 8) / f64::from(1_u32 << 24) - 0.5;
    let time = ROW * f64::from(row) + jitter * noise;
    let command = if (row / 15).is_multiple_of(2) {
        0.5
    } else {
        -0.5
    };
    black_box(bank.row(time, Some(0.01 * noise))?);
    bank.command(time, command + 0.1 * noise)
}

fn rows(c: &mut Criterion) {
    for (name, alarm, jitter) in [
        ("50 cells", f64::INFINITY, 0.0),
        ("50 cells, uneven rows", f64::INFINITY, 0.02),
        ("50 cells and as many for a change", 900.0, 0.0),
    ] {
        let Ok((mut bank, mut row)) = running(alarm, jitter) else {
            continue;
        };
        c.bench_function(name, |b| {
            b.iter(|| {
                row += 1;
                step(bank.as_mut(), row, jitter)
            });
        });
    }
}

criterion_group!(benches, rows);
criterion_main!(benches);
