//! Stability maps, one thread: time per map of 64 by 64 cells, counts alone and with abscissa.
//!
//! The velocity loop s + (Kp + Kv s) e^(−0.36 s) is neutral, the integrator s + Kp e^(−s T)
//! retarded with the delay as a parameter.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::stability::{Affine, Axis, Family, Question, Term, map};

const SIDE: u32 = 64;

/// Points inside the range: its ends are the boundary of stability in places.
fn inside(low: f64, high: f64) -> Vec<f64> {
    (0..SIDE)
        .map(|i| low + (high - low) * (f64::from(i) + 0.5) / f64::from(SIDE))
        .collect()
}

fn term(exponents: [u32; 2], power: u32, constant: f64, slopes: [f64; 2]) -> Term {
    Term {
        coefficient: 1.0,
        exponents: exponents.to_vec(),
        power,
        delay: Affine {
            constant,
            slopes: slopes.to_vec(),
        },
    }
}

fn family(names: [&str; 2], terms: Vec<Term>) -> Family {
    let names = names.map(str::to_owned).to_vec();
    Family::new(names, terms).expect("a good family")
}

fn maps(criterion: &mut Criterion) {
    let none = [0.0, 0.0];
    let s = || term([0, 0], 1, 0.0, none);
    let velocity = vec![
        s(),
        term([1, 0], 0, 0.36, none),
        term([0, 1], 1, 0.36, none),
    ];
    let integrator = vec![s(), term([1, 0], 0, 0.0, [0.0, 1.0])];
    let cases = [
        (
            "velocity",
            family(["Kp", "Kv"], velocity),
            inside(0.0, 6.0),
            inside(-1.0, 1.0),
        ),
        (
            "integrator",
            family(["Kp", "T"], integrator),
            inside(0.0, 20.0),
            inside(0.0, 2.0),
        ),
    ];
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("stability_map");
    group.throughput(Throughput::Elements(u64::from(SIDE * SIDE)));
    for (name, family, first, second) in &cases {
        let axes = [(0, first), (1, second)].map(|(parameter, points)| Axis { parameter, points });
        for (what, abscissa) in [("counts", false), ("abscissa", true)] {
            let question = Question {
                abscissa,
                ..Question::default()
            };
            group.bench_function(BenchmarkId::new(*name, what), |bencher| {
                bencher.iter(|| {
                    pool.install(|| map(family, &[0.0, 0.0], axes, question, &Task::new()))
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, maps);
criterion_main!(benches);
