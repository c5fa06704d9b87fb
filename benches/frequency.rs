//! The imaginary axis: margins of loops, crossings and ranges of one number, phases.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::frequency::{argument, crossings, gain_range, margins};
use deadtime::quasipoly::QuasiPolynomial;
use deadtime::stability::{Affine, Family, Term};

fn make(rows: &[&[f64]], delays: &[f64]) -> QuasiPolynomial {
    let rows = rows.iter().map(|row| row.to_vec()).collect();
    QuasiPolynomial::new(rows, delays.to_vec()).expect("a quasi-polynomial")
}

/// Coefficient, power of the parameter, power of s, constant delay, slope of the delay.
fn family(terms: &[(f64, u32, u32, f64, f64)]) -> Family {
    let term = |&(coefficient, exponent, power, constant, slope): &_| Term {
        coefficient,
        exponents: vec![exponent],
        power,
        delay: Affine {
            constant,
            slopes: vec![slope],
        },
    };
    let terms = terms.iter().map(term).collect();
    Family::new(vec!["p".to_owned()], terms).expect("a family")
}

fn frequency(criterion: &mut Criterion) {
    let task = Task::new();
    let mut group = criterion.benchmark_group("frequency");
    let loops = [
        (
            "integrator",
            make(&[&[2.0]], &[0.36]),
            QuasiPolynomial::variable(),
        ),
        (
            "several_delays",
            make(&[&[0.3, 0.3], &[1.0]], &[0.1, 0.3]),
            make(&[&[1.0, 3.0, 2.0, 1.0], &[0.2]], &[0.0, 0.5]),
        ),
    ];
    for (name, n, d) in &loops {
        group.bench_function(format!("margins/{name}"), |bencher| {
            bencher.iter(|| margins(black_box(n), black_box(d), &task));
        });
    }
    let equations = [
        (
            "delay",
            family(&[
                (1.0, 0, 2, 0.0, 0.0),
                (0.1, 0, 1, 0.0, 0.0),
                (4.0, 0, 0, 0.0, 0.0),
                (2.0, 0, 0, 0.0, 1.0),
            ]),
        ),
        (
            "multiples",
            family(&[
                (1.0, 0, 1, 0.0, 0.0),
                (1.0, 0, 0, 0.0, 1.0),
                (1.0, 0, 0, 0.0, 2.0),
            ]),
        ),
    ];
    for (name, equation) in &equations {
        group.bench_function(format!("crossings/{name}"), |bencher| {
            bencher.iter(|| crossings(black_box(equation), (0.0, 5.0), &task));
        });
    }
    let gain = family(&[(1.0, 0, 1, 0.0, 0.0), (1.0, 1, 0, 0.36, 0.0)]);
    group.bench_function("gain_range", |bencher| {
        let whole = (f64::NEG_INFINITY, f64::INFINITY);
        bencher.iter(|| gain_range(black_box(&gain), 2.0, whole, &task));
    });
    let frequencies: Vec<f64> = (0..500).map(|k| 0.01 * 1.02f64.powi(k)).collect();
    group.bench_function("argument/500", |bencher| {
        bencher.iter(|| argument(black_box(&loops[1].2), &frequencies, &task));
    });
    group.finish();
}

criterion_group!(benches, frequency);
criterion_main!(benches);
