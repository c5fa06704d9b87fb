//! The spectral method of steps with right-hand sides of negligible cost.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::dde::breaks::BreakingPoint;
use deadtime::dde::history::{History, Piece};
use deadtime::dde::spectral::{Columns, Equation, Problem, solve};
use deadtime::{Error, Task};

/// y′ = 0.2 z / (1 + z¹⁰) − 0.1 y.
struct MackeyGlass;

impl Equation for MackeyGlass {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], _: &Task) -> Result<(), Error> {
        for ((out, y), z) in out.iter_mut().zip(at.y).zip(at.z) {
            *out = 0.2 * z / (1.0 + z.powi(10)) - 0.1 * y;
        }
        Ok(())
    }
}

/// y′_i = −y_i + tanh(z_{i+1} − 2 z_{i+7}), indices modulo the number of components.
struct Network {
    components: usize,
    costly: bool,
}

impl Equation for Network {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], _: &Task) -> Result<(), Error> {
        let n = at.t.len();
        for (i, out) in out.chunks_exact_mut(n).enumerate() {
            let row = |shift: usize| &at.z[(i + shift) % self.components * n..];
            let inputs = row(1).iter().zip(row(7));
            for ((out, y), (a, b)) in out.iter_mut().zip(&at.y[i * n..]).zip(inputs) {
                *out = -y + libm::tanh(a - 2.0 * b);
            }
        }
        Ok(())
    }

    fn is_costly(&self) -> bool {
        self.costly
    }
}

/// y′ = 2 (1 − z) − 0.3 z′.
struct Drone;

impl Equation for Drone {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], _: &Task) -> Result<(), Error> {
        for ((out, z), dz) in out.iter_mut().zip(at.z).zip(at.dz) {
            *out = 2.0 * (1.0 - z) - 0.3 * dz;
        }
        Ok(())
    }
}

fn problem(y0: Vec<f64>, delay: f64, end: f64, rtol: f64, neutral: bool) -> Problem {
    Problem {
        end,
        delays: vec![delay],
        neutral,
        history: History::new(vec![Piece::new(-delay, 0.0, 1, y0.clone()).with_slopes()]),
        y0,
        breaks: vec![BreakingPoint {
            time: 0.0,
            order: 1,
        }],
        rtol,
        atol: vec![0.1 * rtol],
        max_step: f64::INFINITY,
        t_eval: Some(vec![end]),
        ..Problem::default()
    }
}

fn runs(criterion: &mut Criterion) {
    let task = Task::new();
    for rtol in [1e-6, 1e-9] {
        let mut group = criterion.benchmark_group(format!("solve_dde, rtol {rtol:e}"));
        let mackey_glass = problem(vec![0.5], 17.0, 1000.0, rtol, false);
        group.bench_function("Mackey-Glass, 1000 s", |bencher| {
            bencher.iter(|| solve(black_box(&mackey_glass), &mut MackeyGlass, &task));
        });
        let drone = problem(vec![0.0], 0.36, 10.0, rtol, true);
        group.bench_function("PV loop, neutral, 10 s", |bencher| {
            bencher.iter(|| solve(black_box(&drone), &mut Drone, &task));
        });
        group.sample_size(20);
        for (components, end, costly) in [(50, 50, false), (50, 50, true), (2000, 10, true)] {
            let firing = (0..components).map(|i| (i as f64).sin()).collect();
            let network = problem(firing, 1.0, f64::from(end), rtol, false);
            let name = if costly { ", few sweeps" } else { "" };
            let id = format!("network of {components}, {end} s{name}");
            group.bench_function(id, |bencher| {
                let mut equation = Network { components, costly };
                bencher.iter(|| solve(black_box(&network), &mut equation, &task));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, runs);
criterion_main!(benches);
