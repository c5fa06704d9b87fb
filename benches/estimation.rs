//! Likelihood of a recording: one evaluation, the maximum, and one end of an interval.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use deadtime::estimation::{
    Commands, Fit, Free, Limits, Model, Noise, Plant, Point, Quantity, Rows, Search, Timing,
};
use deadtime::{Error, Task};

const ROW: f64 = 0.065;
const DELAY: f64 = 0.31;
const LAG: f64 = 0.17;

/// Numbers of about a Gaussian distribution of variance one.
fn gaussian(state: &mut u64) -> f64 {
    let sum: f64 = (0..12)
        .map(|_| {
            *state ^= *state << 13;
            *state ^= *state >> 7;
            *state ^= *state << 17;
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        })
        .sum();
    sum - 6.0
}

/// An integrator that answers commands of a few seconds through a lag, air and white noise.
fn recorded(count: usize) -> Result<Rows, Error> {
    const FINE: usize = 50;
    let mut seed = 7;
    let step = ROW / FINE as f64;
    let late = (DELAY / step).round() as usize;
    let command = |fine: usize| {
        let row = fine / FINE;
        if (ROW * row as f64 * 0.9).sin() > 0.0 {
            1.0
        } else {
            -0.4
        }
    };
    let (mut state, mut output, mut air) = (0.0, Vec::with_capacity(count), 0.0);
    let mut height = 0.0;
    for row in 0..count {
        output.push(height + 0.005 * gaussian(&mut seed));
        air += -air * ROW / 2.0 + 0.01 * ROW.sqrt() * gaussian(&mut seed);
        for fine in row * FINE..(row + 1) * FINE {
            let input = fine.checked_sub(late).map_or(0.0, command);
            state += step / LAG * (0.85 * input - state);
            height += step * (state + air);
        }
    }
    let time: Vec<f64> = (0..count).map(|row| ROW * row as f64).collect();
    Rows {
        output,
        speed: Vec::new(),
        used: vec![true; count],
        commands: Commands {
            value: (0..count).map(|row| command(row * FINE)).collect(),
            time: time.clone(),
            unknown: Vec::new(),
            uncertain: Vec::new(),
        },
        time,
        offset: true,
        trim: false,
    }
    .checked()
}

fn model(count: usize, lag: bool) -> Result<Model, Error> {
    let free = Free {
        delay: true,
        gain: true,
        lags: vec![true; usize::from(lag)],
        zero: false,
    };
    Model::new(
        Plant::new(&[1.0], &[1.0, 0.0])?,
        vec![recorded(count)?],
        free,
        5.0,
    )
}

fn point(lag: bool, air: bool) -> Point {
    Point {
        timing: Timing::Total(if lag { DELAY + LAG } else { DELAY }),
        lags: vec![LAG; usize::from(lag)],
        zero: 0.0,
        gain: 0.85,
        noise: vec![Noise {
            air_time: 2.0,
            air: if air { 2.0 } else { 0.0 },
            sensor_time: 1.0,
            sensor: 0.0,
            stamps: 0.0,
            arrivals: 0.0,
        }],
    }
}

/// The maximum, with its gain.
fn best(model: &Model, start: &Point, task: &Task) -> Result<Fit, Error> {
    let mut best = model.fit(start, None, Search::All, 1e-6, task)?;
    best.point.gain = model.at(0, &best.point, task)?.gain;
    Ok(best)
}

fn likelihood(criterion: &mut Criterion) {
    let task = Task::new();
    for count in [120, 300, 10_000] {
        let mut group = criterion.benchmark_group(format!("likelihood of {count} rows"));
        group.throughput(Throughput::Elements(count as u64));
        group.sample_size(10);
        for (name, lag, air) in [
            ("white", false, false),
            ("air", false, true),
            ("lag", true, false),
            ("lag and air", true, true),
        ] {
            let start = point(lag, air);
            let Ok(model) = model(count, lag) else {
                continue;
            };
            group.bench_function(format!("objective, {name}"), |bencher| {
                bencher.iter(|| model.objective(black_box(&start), &task));
            });
            group.bench_function(format!("fit, {name}"), |bencher| {
                bencher.iter(|| model.fit(black_box(&start), None, Search::All, 1e-6, &task));
            });
            let Ok(best) = best(&model, &start, &task) else {
                continue;
            };
            group.bench_function(format!("end, {name}"), |bencher| {
                bencher.iter(|| {
                    model.end(
                        black_box(&best),
                        Quantity::Total,
                        0.01,
                        3.84,
                        Limits::floor(0.0),
                        &task,
                    )
                });
            });
        }
        group.finish();
    }
    // Long recordings, in which the columns are in memory and no longer in a cache.
    let mut group = criterion.benchmark_group("likelihood of 1 000 000 rows");
    group.throughput(Throughput::Elements(1_000_000));
    group.sample_size(10);
    if let Ok(model) = model(1_000_000, true) {
        group.bench_function("objective, lag and air", |bencher| {
            bencher.iter(|| model.objective(black_box(&point(true, true)), &task));
        });
        group.bench_function("fit of the mean, lag and air", |bencher| {
            let start = point(true, true);
            bencher.iter(|| model.fit(black_box(&start), None, Search::Mean, 0.02, &task));
        });
    }
    group.finish();
}

criterion_group!(benches, likelihood);
criterion_main!(benches);
