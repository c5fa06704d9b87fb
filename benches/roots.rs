//! Proved counts, all roots of a region, and the rightmost root, on systems of the literature.
//!
//! `cargo bench --bench roots`; names as in `tests/reference/root_cases.json`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::quasipoly::QuasiPolynomial;
use deadtime::roots::{Region, count, count_right_of, rightmost, roots};

struct Case {
    name: &'static str,
    rows: &'static [&'static [f64]],
    delays: &'static [f64],
    re: (f64, f64),
    height: f64,
}

const CASES: [Case; 6] = [
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

criterion_group!(benches, characteristic_roots);
criterion_main!(benches);
