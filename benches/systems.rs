//! General linear systems: one step response of ten seconds each, 100 outputs.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::dde::system::Term;
use deadtime::dde::{LinearSystem, Past, Signal, SystemEquations};

fn term(delay: f64, matrix: &[f64]) -> Term {
    Term {
        delay,
        matrix: matrix.to_vec(),
    }
}

fn scalar(state: Vec<Term>, derivative: Vec<Term>) -> SystemEquations {
    SystemEquations {
        states: 1,
        inputs: 1,
        outputs: 1,
        state,
        derivative,
        input: vec![term(0.36, &[1.0])],
        output: vec![term(0.0, &[1.0])],
        ..SystemEquations::default()
    }
}

/// Ten oscillators in a ring, each driven by the delayed position of the next.
fn ring() -> SystemEquations {
    let n = 20;
    let mut now = vec![0.0; n * n];
    let mut late = vec![0.0; n * n];
    for i in 0..10 {
        now[i * n + 10 + i] = 1.0;
        now[(10 + i) * n + i] = -4.0;
        now[(10 + i) * n + 10 + i] = -1.0;
        late[(10 + i) * n + (i + 1) % 10] = 1.5;
    }
    let mut input = vec![0.0; n];
    input[10] = 1.0;
    let mut output = vec![0.0; n];
    output[0] = 1.0;
    SystemEquations {
        states: n,
        inputs: 1,
        outputs: 1,
        state: vec![term(0.0, &now), term(0.36, &late)],
        input: vec![term(0.0, &input)],
        output: vec![term(0.0, &output)],
        ..SystemEquations::default()
    }
}

fn simulations(criterion: &mut Criterion) {
    let root = 0.36 * std::f64::consts::SQRT_2;
    let cases = [
        ("scalar", scalar(vec![term(0.36, &[-1.31])], Vec::new())),
        (
            "neutral",
            scalar(vec![term(0.36, &[-2.0])], vec![term(0.36, &[0.3])]),
        ),
        (
            "two incommensurate delays",
            scalar(vec![term(0.36, &[-1.0]), term(root, &[-0.5])], Vec::new()),
        ),
        ("twenty states", ring()),
    ];
    let mut group = criterion.benchmark_group("system, 10 s, 100 outputs");
    let times: Vec<f64> = (1..=100).map(|i| 0.1 * f64::from(i)).collect();
    for (name, equations) in cases {
        let rest = vec![0.0; equations.states];
        let signals = (Signal::constant(&rest), Signal::step(&[0.0], &[1.0]));
        let (Ok(system), (Ok(history), Ok(inputs))) = (LinearSystem::new(equations), signals)
        else {
            continue;
        };
        let past = Past {
            state: rest,
            history,
            slopes: None,
        };
        group.bench_function(name, |bencher| {
            let task = Task::new();
            bencher.iter(|| system.simulate(black_box(past.clone()), &inputs, &times, &task));
        });
    }
    group.finish();
}

criterion_group!(benches, simulations);
criterion_main!(benches);
