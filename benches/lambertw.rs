//! Lambert W: time per block of 1000 elements, one thread.
//!
//! Control problems have arguments in the disc. Next to -1/e and at extreme exponents other
//! implementations become slow or fail. The real branches stand beside those of the crate
//! `lambert_w`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deadtime::lambertw::block;
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

/// Square of side 6 around 0, filled evenly and unordered.
fn square() -> Vec<Complex64> {
    const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;
    (0..LENGTH)
        .map(|i| {
            let part = f64::from(i) / f64::from(LENGTH);
            let other = (GOLDEN_RATIO * f64::from(i)).fract();
            Complex64::new(6.0 * part - 3.0, 6.0 * other - 3.0)
        })
        .collect()
}

fn lambertw(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("lambertw");
    group.throughput(Throughput::Elements(u64::from(LENGTH)));
    let near: Vec<_> = spiral(-16.0, -1.0).iter().map(|d| d - INVERSE_E).collect();
    let mixed: Vec<i64> = (0..i64::from(LENGTH)).map(|i| i % 11 - 5).collect();
    let branch = |k| vec![k; LENGTH as usize];
    let cases = [
        ("disc k=0", spiral(-3.0, 3.0), branch(0)),
        ("disc k=-1", spiral(-3.0, 3.0), branch(-1)),
        ("disc k=3", spiral(-3.0, 3.0), branch(3)),
        ("disc k mixed", spiral(-3.0, 3.0), mixed.clone()),
        ("square k=0", square(), branch(0)),
        ("square k=-1", square(), branch(-1)),
        ("near -1/e k=0", near.clone(), branch(0)),
        ("near -1/e k=-1", near, branch(-1)),
        ("wide k=0", spiral(-300.0, 300.0), branch(0)),
        ("wide k=-1", spiral(-300.0, 300.0), branch(-1)),
        ("wide k mixed", spiral(-300.0, 300.0), mixed),
    ];
    let mut w = vec![Complex64::ZERO; LENGTH as usize];
    for (name, z, k) in cases {
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter(|| block::lambertw(black_box(&z), black_box(&k), &mut w));
        });
    }
    let (z, k) = ([Complex64::new(1.0, 2.0)], [-1]);
    group.throughput(Throughput::Elements(1));
    group.bench_function(BenchmarkId::from_parameter("one element"), |bencher| {
        bencher.iter(|| block::lambertw(black_box(&z), black_box(&k), black_box(&mut w[..1])));
    });
    group.finish();
}

fn real_branches(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("lambertw real");
    group.throughput(Throughput::Elements(u64::from(LENGTH)));
    let positive: Vec<_> = spiral(-3.0, 3.0).iter().map(|z| z.norm()).collect();
    let negative: Vec<_> = (1..=LENGTH)
        .map(|i| -INVERSE_E * f64::from(i) / f64::from(LENGTH + 1))
        .collect();
    let mut w = vec![0.0; LENGTH as usize];
    let mut ours = |name: &str, kernel: fn(&[f64], &mut [f64]), x: &[f64]| {
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter(|| kernel(black_box(x), &mut w));
        });
    };
    ours("k=0", block::lambertw0, &positive);
    ours("k=0 below zero", block::lambertw0, &negative);
    ours("k=-1", block::lambertwm1, &negative);
    // The crate `lambert_w`, one number at a time.
    let mut theirs = |name: &str, function: fn(f64) -> f64, x: &[f64]| {
        group.bench_function(BenchmarkId::new("lambert_w", name), |bencher| {
            bencher.iter(|| {
                for (w, x) in w.iter_mut().zip(black_box(x)) {
                    *w = function(*x);
                }
            });
        });
    };
    theirs("k=0", lambert_w::lambert_w0, &positive);
    theirs("k=0 below zero", lambert_w::lambert_w0, &negative);
    theirs("k=-1", lambert_w::lambert_wm1, &negative);
    group.finish();
}

fn dde_roots(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("dde_root");
    group.throughput(Throughput::Elements(u64::from(LENGTH)));
    let length = LENGTH as usize;
    let (own, delay) = (vec![-0.1; length], vec![0.36; length]);
    let gains: Vec<_> = (1..=LENGTH).map(|i| -0.005 * f64::from(i)).collect();
    let mut s = vec![Complex64::ZERO; length];
    for branch in [0, -3] {
        let k = vec![branch; length];
        group.bench_function(
            BenchmarkId::from_parameter(format!("k={branch}")),
            |bencher| {
                bencher.iter(|| block::dde_root(&own, black_box(&gains), &delay, &k, &mut s));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, lambertw, real_branches, dde_roots);
criterion_main!(benches);
