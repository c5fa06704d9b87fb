//! Our elementary functions against those of the `libm` crate, 1000 arguments at a time.
//!
//! `cargo bench --bench elementary`; "far" are arguments of 1e8, "near" those of a usual contour.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::elementary::{angle, exp, log, sin_cos};

fn arguments(scale: f64) -> Vec<f64> {
    let fraction = |k: i32| (f64::from(k) * 0.618_033_988_749_895).fract() * 2.0 - 1.0;
    (0..1000).map(|k| scale * fraction(k)).collect()
}

fn elementary(c: &mut Criterion) {
    let mut compare = |name: &str, scale: f64, ours: fn(f64) -> f64, theirs: fn(f64) -> f64| {
        let values = arguments(scale);
        let mut group = c.benchmark_group(name);
        for (label, function) in [("ours", ours), ("libm", theirs)] {
            group.bench_function(label, |b| {
                b.iter(|| black_box(&values).iter().map(|x| function(*x)).sum::<f64>());
            });
        }
        group.finish();
    };
    compare("exp", 30.0, exp, libm::exp);
    let ours = |y| {
        let (sine, cosine) = sin_cos(y);
        sine + cosine
    };
    let theirs = |y| {
        let (sine, cosine) = libm::sincos(y);
        sine + cosine
    };
    compare("sin_cos_near", 100.0, ours, theirs);
    compare("sin_cos_far", 1e8, ours, theirs);
    compare("log", 30.0, |x| log(x.abs()), |x| libm::log(x.abs()));
    compare("angle", 1.0, |x| angle(x, 0.7), |x| libm::atan2(x, 0.7));
}

criterion_group!(benches, elementary);
criterion_main!(benches);
