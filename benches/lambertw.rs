//! Lambert W: time per block of 1000 elements, one thread.
//!
//! The disc is what control problems ask for; next to -1/e and extreme exponents are where
//! other implementations slow down or fail.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::lambertw::{dde_root_array, lambertw_array};
use num_complex::Complex64;

const LENGTH: u32 = 1000;
const INVERSE_E: f64 = 0.367_879_441_171_442_33;

/// Moduli from 10^low to 10^high, arguments all around (golden angle: evenly and unordered).
fn spiral(low: f64, high: f64) -> Vec<Complex64> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    (0..LENGTH)
        .map(|i| {
            let part = f64::from(i) / f64::from(LENGTH);
            let modulus = 10.0_f64.powf(low + (high - low) * part);
            Complex64::from_polar(modulus, GOLDEN_ANGLE * f64::from(i))
        })
        .collect()
}

fn lambertw(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("lambertw");
    group.throughput(Throughput::Elements(u64::from(LENGTH)));
    let near: Vec<_> = spiral(-16.0, -1.0).iter().map(|d| d - INVERSE_E).collect();
    let mixed: Vec<i64> = (0..i64::from(LENGTH)).map(|i| i % 11 - 5).collect();
    let cases = [
        ("disc k=0", spiral(-3.0, 3.0), vec![0]),
        ("disc k=-1", spiral(-3.0, 3.0), vec![-1]),
        ("disc k=3", spiral(-3.0, 3.0), vec![3]),
        ("disc k mixed", spiral(-3.0, 3.0), mixed.clone()),
        ("near -1/e k=0", near.clone(), vec![0]),
        ("near -1/e k=-1", near, vec![-1]),
        ("wide k=0", spiral(-300.0, 300.0), vec![0]),
        ("wide k mixed", spiral(-300.0, 300.0), mixed),
    ];
    let mut out = vec![Complex64::ZERO; LENGTH as usize];
    let task = Task::new();
    for (name, z, k) in cases {
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter(|| lambertw_array(black_box(&z), black_box(&k), &mut out, &task));
        });
    }
    group.finish();
}

fn dde_roots(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("dde_root");
    group.throughput(Throughput::Elements(u64::from(LENGTH)));
    let gains: Vec<_> = (1..=LENGTH).map(|i| -0.005 * f64::from(i)).collect();
    let mut out = vec![Complex64::ZERO; LENGTH as usize];
    let task = Task::new();
    for k in [0, -3] {
        group.bench_function(BenchmarkId::from_parameter(format!("k={k}")), |bencher| {
            bencher.iter(|| {
                dde_root_array(&[-0.1], black_box(&gains), &[0.36], &[k], &mut out, &task)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, lambertw, dde_roots);
criterion_main!(benches);
