//! Stability maps of six families, one thread: counts alone on 1000 by 1000 cells, with abscissa on
//! 100 by 100, and the time of counts for 500, 1000 and 2000 cells a side.
//!
//! The velocity loop is neutral; with a filter on the derivative it is retarded of degree 3. The
//! pendulum is unstable without control. The two gains of the fifth family have a delay each. The
//! parameters of the last one are two delays. Then maps of a sampled loop.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deadtime::Task;
use deadtime::stability::{Affine, Axis, Family, LoopRows, Question, Term, held_map, map};

/// Coefficient, powers of the two gains, power of s, delay.
type Row = (f64, [u32; 2], u32, f64);

struct Case {
    name: &'static str,
    family: Family,
    ranges: [(f64, f64); 2],
}

fn case(name: &'static str, rows: Vec<Row>, ranges: [(f64, f64); 2]) -> Case {
    let terms = rows
        .into_iter()
        .map(|(coefficient, exponents, power, delay)| Term {
            coefficient,
            exponents: exponents.to_vec(),
            power,
            delay: Affine {
                constant: delay,
                slopes: vec![0.0; 2],
            },
        });
    let names = vec!["first".to_owned(), "second".to_owned()];
    Case {
        name,
        family: Family::new(names, terms.collect()).expect("a good family"),
        ranges,
    }
}

fn cases() -> Vec<Case> {
    const NONE: [u32; 2] = [0, 0];
    const FIRST: [u32; 2] = [1, 0];
    const SECOND: [u32; 2] = [0, 1];
    let (t, corner) = (0.36, 38.0);
    vec![
        case(
            "velocity",
            vec![(1.0, NONE, 1, 0.0), (1.0, FIRST, 0, t), (1.0, SECOND, 1, t)],
            [(0.0, 6.0), (-1.0, 1.0)],
        ),
        case(
            "velocity_filtered",
            vec![
                (1.0, NONE, 3, 0.0),
                (2.0 * corner, NONE, 2, 0.0),
                (corner * corner, NONE, 1, 0.0),
                (1.0, FIRST, 2, t),
                (2.0 * corner, FIRST, 1, t),
                (corner * corner, FIRST, 0, t),
                (corner * corner, SECOND, 1, t),
            ],
            [(0.0, 6.0), (-1.0, 1.0)],
        ),
        case(
            "pendulum",
            vec![
                (1.0, NONE, 2, 0.0),
                (-1.0, NONE, 0, 0.0),
                (1.0, FIRST, 0, 0.3),
                (1.0, SECOND, 1, 0.3),
            ],
            [(0.0, 8.0), (0.0, 6.0)],
        ),
        case(
            "pi_first_order",
            vec![
                (2.0, NONE, 2, 0.0),
                (1.0, NONE, 1, 0.0),
                (1.5, FIRST, 1, 0.5),
                (1.5, SECOND, 0, 0.5),
            ],
            [(-1.0, 8.0), (0.0, 8.0)],
        ),
        case(
            "two_delays",
            vec![
                (1.0, NONE, 1, 0.0),
                (1.0, FIRST, 0, 0.3),
                (1.0, SECOND, 0, 1.1),
            ],
            [(-6.0, 6.0), (-6.0, 6.0)],
        ),
    ]
}

/// s + 1.2 e^(−s T1) + 0.8 e^(−s T2), affine in neither delay.
fn delays_free() -> Case {
    let term = |coefficient, power, slopes: [f64; 2]| Term {
        coefficient,
        exponents: vec![0; 2],
        power,
        delay: Affine {
            constant: 0.0,
            slopes: slopes.to_vec(),
        },
    };
    let terms = vec![
        term(1.0, 1, [0.0, 0.0]),
        term(1.2, 0, [1.0, 0.0]),
        term(0.8, 0, [0.0, 1.0]),
    ];
    let names = vec!["first".to_owned(), "second".to_owned()];
    Case {
        name: "delays_free",
        family: Family::new(names, terms).expect("a good family"),
        ranges: [(0.01, 6.0), (0.01, 6.0)],
    }
}

/// Both ends included, as from Python.
fn points((low, high): (f64, f64), side: u32) -> Vec<f64> {
    (0..side)
        .map(|i| low + (high - low) * f64::from(i) / f64::from(side - 1))
        .collect()
}

fn maps(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("stability_map");
    group.sample_size(10);
    let mut measure = |what: &str, case: &Case, side: u32, abscissa: bool| {
        let [first, second] = case.ranges.map(|range| points(range, side));
        let axes =
            [(0, &first), (1, &second)].map(|(parameter, points)| Axis { parameter, points });
        let question = Question {
            abscissa,
            ..Question::default()
        };
        group.throughput(Throughput::Elements(u64::from(side) * u64::from(side)));
        group.bench_function(
            BenchmarkId::new(format!("{}/{what}", case.name), side),
            |bencher| {
                bencher.iter(|| {
                    pool.install(|| map(&case.family, &[0.0, 0.0], axes, question, &Task::new()))
                });
            },
        );
    };
    for case in cases().into_iter().chain([delays_free()]) {
        for side in [500, 1000, 2000] {
            measure("counts", &case, side, false);
        }
        measure("abscissa", &case, 100, true);
    }
    group.finish();
}

/// Cells in each step of the recursion: as many as fill vectors, with some more against waiting.
const LANES: usize = 16;

/// Numbers of zeros outside the unit circle by the recursion of Schur and Cohn (Jury 1964), one
/// polynomial in each lane, descending powers: the time that a count of every cell by itself takes
/// at least. It proves nothing where a step loses digits.
fn schur_cohn<const N: usize>(mut p: [[f64; LANES]; N]) -> [u32; LANES] {
    let (mut sign, mut outside) = ([1.0f64; LANES], [0u32; LANES]);
    for length in (2..=N).rev() {
        let (first, last) = (p[0], p[length - 1]);
        for lane in 0..LANES {
            let exchanged = last[lane].abs() > first[lane].abs();
            sign[lane] = if exchanged { -sign[lane] } else { sign[lane] };
            outside[lane] += u32::from(sign[lane] < 0.0);
        }
        let before = p;
        for k in 0..length - 1 {
            for lane in 0..LANES {
                let mirrored = before[length - 1 - k][lane];
                p[k][lane] = first[lane] * before[k][lane] - last[lane] * mirrored;
            }
        }
    }
    outside
}

/// z⁷ − z⁶ + Ts (1 − f) Kp z + Ts f Kp, for a delay of 5 + f samples: the drone under P control.
fn characteristic(kp: f64) -> [f64; 8] {
    let (sample_time, fraction) = (0.065, 0.36 / 0.065 - 5.0);
    let near = sample_time * (1.0 - fraction) * kp;
    [
        1.0,
        -1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        near,
        sample_time * fraction * kp,
    ]
}

/// Maps of the drone sampled every 65, 10, 5 and 1 ms, and the recursion for 7 states.
fn sampled(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("sampled map");
    group.sample_size(10);
    let (kp, kv) = (points((0.1, 6.0), 1000), points((-0.9, 0.9), 1000));
    let l: Vec<f64> = kv.iter().map(|kv| -kv).collect();
    group.throughput(Throughput::Elements(1_000_000));
    for (name, sample_time) in [
        ("65 ms", 0.065),
        ("10 ms", 0.01),
        ("5 ms", 0.005),
        ("1 ms", 0.001),
    ] {
        let rows = LoopRows {
            rows: kv.len(),
            states: 1,
            used: &[1.0],
            a: &[0.0],
            b: &[1.0],
            k: &[0.0],
            l: &l,
            k_slope: &[-1.0],
            l_slope: &[0.0],
            delay: &[0.36],
            sample_time: &[sample_time],
            points: &kp,
        };
        let column = LoopRows {
            rows: 1,
            k: &[-kp[500]],
            l: &[0.0],
            k_slope: &[0.0],
            l_slope: &[-1.0],
            points: &kv,
            ..rows
        };
        group.bench_function(name, |bencher| {
            let question = Question::default();
            bencher.iter(|| {
                pool.install(|| held_map(&rows, Some(&column), question, false, &Task::new()))
            });
        });
    }
    let cells: Vec<[f64; 8]> = points((0.1, 6.0), 1_000_000)
        .iter()
        .map(|kp| characteristic(*kp))
        .collect();
    let lanes: Vec<[[f64; LANES]; 8]> = cells
        .chunks_exact(LANES)
        .map(|block| std::array::from_fn(|k| std::array::from_fn(|lane| block[lane][k])))
        .collect();
    group.bench_function("65 ms, Schur-Cohn in lanes", |bencher| {
        bencher.iter(|| {
            let counts = lanes.iter().map(|block| schur_cohn(*block));
            counts.fold(0, |sum, block| sum + block.iter().sum::<u32>())
        });
    });
    group.finish();
}

criterion_group!(benches, maps, sampled);
criterion_main!(benches);
