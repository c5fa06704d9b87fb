//! Proved boxes, one thread: until 0.1 % of two ranges are undecided, or 1 % of three.
//!
//! The velocity loop s + (Kp + Kv s) e^(−0.36 s) is neutral: chains and infinitely many boundaries
//! meet at Kv = ±1. With the delay as a third parameter the boundary depends on it too.

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::stability::{Affine, Family, Limits, Term, proved_boxes};

fn family(moving: bool) -> Family {
    let term = |exponents: [u32; 3], power, late: bool| Term {
        coefficient: 1.0,
        exponents: exponents.to_vec(),
        power,
        delay: Affine {
            constant: if late && !moving { 0.36 } else { 0.0 },
            slopes: vec![0.0, 0.0, if late && moving { 1.0 } else { 0.0 }],
        },
    };
    let terms = vec![
        term([0, 0, 0], 1, false),
        term([1, 0, 0], 0, true),
        term([0, 1, 0], 1, true),
    ];
    let names = ["Kp", "Kv", "T"].map(str::to_owned).to_vec();
    Family::new(names, terms).expect("a good family")
}

fn boxes(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("boxes");
    group.sample_size(10);
    let plane = [(0.0, 6.0), (-1.0, 1.0), (0.36, 0.36)];
    let space = [(0.0, 6.0), (-0.9, 0.9), (0.3, 0.4)];
    for (name, moving, ranges, undecided) in [
        ("gains", false, plane, 1e-3),
        ("gains and delay", true, space, 1e-2),
    ] {
        let family = family(moving);
        let limits = Limits {
            undecided,
            boxes: 1_000_000,
        };
        group.bench_function(name, |bencher| {
            bencher.iter(|| pool.install(|| proved_boxes(&family, &ranges, limits, &Task::new())));
        });
    }
    group.finish();
}

criterion_group!(benches, boxes);
criterion_main!(benches);
