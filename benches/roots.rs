//! Proved counts, all roots of a region, and the rightmost root, on systems of the literature.
//!
//! `cargo bench --bench roots`; names as in `tests/reference/root_cases.json`.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::lambertw;
use deadtime::quasipoly::QuasiPolynomial;
use deadtime::roots::matrix::{self, CharacteristicMatrix};
use deadtime::roots::{Edge, Region, count, count_right_of, rightmost, roots};
use num_complex::Complex64;

struct Case {
    name: &'static str,
    rows: &'static [&'static [f64]],
    delays: &'static [f64],
    re: (f64, f64),
    height: f64,
}

const CASES: [Case; 7] = [
    Case {
        name: "armah_K2",
        rows: &[&[0.0, 1.0], &[2.0]],
        delays: &[0.0, 0.36],
        re: (-12.0, 2.0),
        height: 100.0,
    },
    Case {
        name: "qpmr_ex1_tall",
        rows: &[&[0.0, 1.0], &[1.0]],
        delays: &[0.0, 1.0],
        re: (-12.0, 2.0),
        height: 1000.0,
    },
    Case {
        name: "armah_neutral_Kv0.3",
        rows: &[&[0.0, 1.0], &[2.0, 0.3]],
        delays: &[0.0, 0.36],
        re: (-12.0, 2.0),
        height: 100.0,
    },
    // The best gains: two roots almost meet where the next ones lie on the chain.
    Case {
        name: "armah_neutral_best",
        rows: &[&[0.0, 1.0], &[1.503849446591373, 0.1353576030581129]],
        delays: &[0.0, 0.36],
        re: (-5.6, 2.0),
        height: 100.0,
    },
    Case {
        name: "qpmr_ex3_neutral",
        rows: &[
            &[2.1, 5.0, 0.0, 0.2, 1.0],
            &[0.0, -2.1, 0.0, 0.0, 0.5],
            &[0.0, 0.0, 3.2, 0.0, 0.3],
            &[0.0, 0.0, 1.2],
            &[3.0],
        ],
        delays: &[0.0, 1.5, 2.2, 4.3, 6.3],
        re: (-10.0, 2.0),
        height: 100.0,
    },
    Case {
        name: "humphries_k3",
        rows: &[&[4.75, 1.0], &[3.0], &[2.3]],
        delays: &[0.0, 1.3, 6.0],
        re: (-3.0, 1.0),
        height: 60.0,
    },
    Case {
        name: "double_all",
        rows: &[&[0.0, 0.0, 1.0], &[0.0, 2.0], &[1.0]],
        delays: &[0.0, 1.0, 2.0],
        re: (-10.0, 2.0),
        height: 30.0,
    },
];

fn characteristic_roots(c: &mut Criterion) {
    let task = Task::new();
    for case in &CASES {
        let rows = case.rows.iter().map(|row| row.to_vec()).collect();
        let Ok(h) = QuasiPolynomial::new(rows, case.delays.to_vec()) else {
            continue;
        };
        let region = Region {
            re: case.re,
            im: (-case.height, case.height),
        };
        let mut group = c.benchmark_group(case.name);
        group.bench_function("count", |b| b.iter(|| count(black_box(&h), &region, &task)));
        group.bench_function("count_right_of_0", |b| {
            b.iter(|| count_right_of(black_box(&h), 0.0, &task));
        });
        group.bench_function("roots", |b| b.iter(|| roots(black_box(&h), &region, &task)));
        group.bench_function("rightmost", |b| {
            b.iter(|| rightmost(black_box(&h), 1, &task))
        });
        group.finish();
    }
}

/// A hundred thousand roots of s + e^(−s): their count, the whole list with its discs, and as the
/// ceiling W_k(−1), which are the same numbers without a disc, a count or a list.
fn long_chain(c: &mut Criterion) {
    const ROOTS: u32 = 100_000;
    let task = Task::new();
    let rows = vec![vec![0.0, 1.0], vec![1.0]];
    let Ok(h) = QuasiPolynomial::new(rows, vec![0.0, 1.0]) else {
        return;
    };
    let region = Region {
        re: (-20.0, 2.0),
        im: (0.0, std::f64::consts::TAU * f64::from(ROOTS)),
    };
    let mut group = c.benchmark_group("chain of 100000");
    group.sample_size(30);
    group.throughput(Throughput::Elements(u64::from(ROOTS)));
    group.bench_function("count", |b| b.iter(|| count(black_box(&h), &region, &task)));
    group.bench_function("roots", |b| b.iter(|| roots(black_box(&h), &region, &task)));
    let z = vec![Complex64::new(-1.0, 0.0); ROOTS as usize];
    let k: Vec<i64> = (0..i64::from(ROOTS)).collect();
    let mut w = vec![Complex64::ZERO; ROOTS as usize];
    group.bench_function("ceiling", |b| {
        b.iter(|| lambertw::block::lambertw(black_box(&z), &k, &mut w));
    });
    group.finish();
}

/// `n` states in a ring, with dense coupling without delay and delayed coupling to the next state.
fn ring(n: usize) -> Option<CharacteristicMatrix> {
    let filled = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        (0..n)
            .map(|i| (0..n).map(|j| entry(i, j)).collect())
            .collect()
    };
    let unit = filled(&|i, j| f64::from(u8::from(i == j)));
    let now = filled(&|i, j| {
        let wave = ((3 * i + 7 * j) as f64).sin() / (n as f64).sqrt();
        wave - if i == j { 1.0 } else { 0.0 }
    });
    let late = filled(&|i, j| if (i + 1) % n == j { 0.8 } else { 0.0 });
    CharacteristicMatrix::new(unit, vec![], vec![(0.0, now), (0.5, late)]).ok()
}

fn matrix_roots(c: &mut Criterion) {
    let task = Task::new();
    let mut group = c.benchmark_group("matrix");
    group.sample_size(10);
    for n in [10, 20, 40] {
        let Some(system) = ring(n) else { continue };
        let region = Region {
            re: (-3.0, 2.0),
            im: (-20.0, 20.0),
        };
        group.bench_function(format!("count/{n}"), |b| {
            b.iter(|| matrix::count(black_box(&system), &region, Edge::Refused, &task));
        });
        group.bench_function(format!("count_right_of_0/{n}"), |b| {
            b.iter(|| matrix::count_right_of(black_box(&system), 0.0, &task));
        });
        group.bench_function(format!("rightmost/{n}"), |b| {
            b.iter(|| matrix::rightmost(black_box(&system), 1, &task));
        });
    }
    group.finish();
}

criterion_group!(benches, characteristic_roots, long_chain, matrix_roots);
criterion_main!(benches);
