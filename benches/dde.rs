//! Simulation of linear loops: one simulation of ten seconds each, the poles of a sampled loop, sweeps, and
//! simulations in fixed steps.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::dde::ensemble::{self, Measures, Sets};
use deadtime::dde::fixed_step::{self, Blocks, Driven, Path, Rest, Settings, Solver};
use deadtime::dde::sampled;
use deadtime::dde::{Criteria, Equations, LinearLoop, Reference, Start};

const DELAY: f64 = 0.36;
const SAMPLE_TIME: f64 = 0.065;

/// y′ = w, u = kp (r − y) − kv y′.
fn drone(kp: f64, kv: f64) -> Equations {
    Equations {
        a: vec![0.0],
        b: vec![1.0],
        e: vec![0.0],
        k: vec![-kp],
        l: -kv,
        m: kp,
        c: vec![1.0],
        ..Equations::default()
    }
}

/// The derivative filtered at 38 rad/s, damping 1.
fn filtered(kp: f64, kv: f64) -> Equations {
    let omega = 38.0;
    Equations {
        a: vec![0.0, 0.0, 0.0, 0.0, 0.0, omega, omega, -omega, -2.0 * omega],
        b: vec![1.0, 0.0, 0.0],
        e: vec![0.0; 3],
        k: vec![-kp, 0.0, -kv * omega],
        l: 0.0,
        m: kp,
        c: vec![1.0, 0.0, 0.0],
        ..Equations::default()
    }
}

/// The plant with a lag: its output and the force behind it.
fn lagging(kp: f64, lag: f64) -> Equations {
    Equations {
        a: vec![-1.0 / lag, 1.0, 0.0, 0.0],
        b: vec![0.0, 1.0 / lag],
        e: vec![0.0; 2],
        k: vec![-kp, 0.0],
        m: kp,
        c: vec![1.0, 0.0],
        ..Equations::default()
    }
}

/// Both.
fn filtered_lagging(kp: f64, kv: f64, lag: f64) -> Equations {
    let omega = 38.0;
    Equations {
        a: [
            [-1.0 / lag, 1.0, 0.0, 0.0],
            [0.0; 4],
            [0.0, 0.0, 0.0, omega],
            [omega, 0.0, -omega, -2.0 * omega],
        ]
        .concat(),
        b: vec![0.0, 1.0 / lag, 0.0, 0.0],
        e: vec![0.0; 4],
        k: vec![-kp, 0.0, 0.0, -kv * omega],
        m: kp,
        c: vec![1.0, 0.0, 0.0, 0.0],
        ..Equations::default()
    }
}

fn simulations(criterion: &mut Criterion) {
    let cases = [
        ("p step", drone(1.31, 0.0), None, None),
        ("p step, limited", drone(1.31, 0.0), None, Some(1.0)),
        ("pv neutral", drone(2.0, 0.3), None, None),
        ("pv filtered, limited", filtered(2.0, 0.3), None, Some(1.0)),
        (
            "sampled p, limited",
            drone(1.31, 0.0),
            Some(SAMPLE_TIME),
            Some(1.0),
        ),
        (
            "sampled pv filtered, limited",
            filtered(2.0, 0.3),
            Some(SAMPLE_TIME),
            Some(1.0),
        ),
    ];
    let mut group = criterion.benchmark_group("simulate 10 s, 100 outputs");
    let times: Vec<f64> = (1..=100).map(|i| 0.1 * f64::from(i)).collect();
    for (name, equations, sample_time, limit) in cases {
        let start = Start {
            state: vec![0.0; equations.states()],
            ..Start::default()
        };
        let plant = LinearLoop::new(equations, DELAY, sample_time, limit);
        let (Ok(plant), Ok(reference)) = (plant, Reference::step(0.0, 1.0)) else {
            continue;
        };
        group.bench_function(name, |bencher| {
            let task = Task::new();
            bencher.iter(|| {
                plant.simulate(black_box(&start), black_box(&reference), &times, &[], &task)
            });
        });
    }
    group.finish();
}

fn poles(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sampled poles");
    for (name, equations) in [("p", drone(2.0, 0.0)), ("pv filtered", filtered(2.0, 0.3))] {
        if let Ok(plant) = LinearLoop::new(equations, DELAY, Some(SAMPLE_TIME), None) {
            group.bench_function(name, |bencher| {
                bencher.iter(|| sampled::poles(black_box(&plant)));
            });
        }
    }
    group.finish();
}

/// Metrics of ten seconds of many limited, sampled loops.
fn sweeps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sweep 10 s, metrics");
    group.sample_size(10);
    let count: usize = 10_000;
    let cases = [
        ("p", drone(1.0, 0.0)),
        ("p, lag", lagging(1.0, 0.2)),
        ("pv filtered", filtered(1.0, 0.3)),
        ("pv filtered, lag", filtered_lagging(1.0, 0.3, 0.2)),
    ];
    for (name, equations) in cases {
        let states = equations.states();
        let mut gains = Vec::new();
        let (mut feedback, mut delays) = (Vec::new(), Vec::new());
        for i in 0..count {
            let part = i as f64 / count as f64;
            let gain = 0.5 + 2.0 * part;
            gains.push(gain);
            feedback.push(-gain);
            delays.push(0.1 + 0.4 * part);
        }
        let numbers = [equations.l, 0.0, 0.0, 0.0, 0.0, SAMPLE_TIME, 1.0];
        let shared: Vec<f64> = [
            &equations.a,
            &equations.b,
            &equations.e,
            &equations.k,
            &equations.c,
        ]
        .into_iter()
        .flatten()
        .copied()
        .chain(numbers)
        .collect();
        let mut entries: Vec<&[f64]> = shared.chunks(1).collect();
        let matrices = states * states + 4 * states;
        entries[states * states + 2 * states] = &feedback;
        entries[matrices + 1] = &gains;
        entries[matrices + 4] = &delays;
        let Ok(sets) = Sets::new(states, count, &entries, 1.0, false) else {
            continue;
        };
        let criteria = Criteria {
            rise: (0.1, 0.9),
            settling: 0.02,
        };
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(name, |bencher| {
            let task = Task::new();
            let mut overshoots = vec![0.0; count];
            bencher.iter(|| {
                let keep = |sets: &[usize], measures: &Measures| {
                    let found = measures.columns().nth(3).into_iter().flatten();
                    for (&set, overshoot) in sets.iter().zip(found) {
                        overshoots[set] = *overshoot;
                    }
                };
                let numbers: (&[f64], &[f64]) = (&[1.0], &[0.0]);
                ensemble::metrics(black_box(&sets), numbers, 10.0, &criteria, &task, keep)
            });
        });
    }
    group.finish();
}

/// Ten seconds of the P loop in steps of a millisecond.
fn fixed_steps(criterion: &mut Criterion) {
    let blocks = Blocks {
        plant_matrix: vec![0.0],
        plant_input: vec![1.0],
        plant_output: vec![1.0],
        proportional: -1.31,
        reference: 1.31,
        ..Blocks::default()
    };
    let rest = Rest {
        state: vec![0.0],
        ..Rest::default()
    };
    let (Ok(reference), Ok(still)) = (Reference::step(0.0, 1.0), Reference::step(0.0, 0.0)) else {
        return;
    };
    let driven = Driven {
        reference,
        load: still.clone(),
        output: still.clone(),
        noise: still,
    };
    let mut group = criterion.benchmark_group("fixed steps");
    for (name, solver) in Solver::NAMED {
        let settings = Settings {
            delay: DELAY,
            path: Path::Measurement,
            bounds: Some((-1.0, 1.0)),
            sample_steps: None,
            solver,
            step: 1e-3,
            steps: 10_000,
        };
        group.throughput(Throughput::Elements(settings.steps as u64));
        group.bench_function(name, |bencher| {
            let task = Task::new();
            bencher.iter(|| fixed_step::run(black_box(&blocks), &settings, &rest, &driven, &task));
        });
    }
    group.finish();
}

criterion_group!(benches, simulations, poles, sweeps, fixed_steps);
criterion_main!(benches);
