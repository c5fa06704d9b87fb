//! Maps against the eigenvalues of transition matrices.

use proptest::prelude::*;

use super::*;
use crate::Task;
use crate::dde::control_loop::sampled;
use crate::dde::{Equations, LinearLoop};
use crate::stability::{Chart, Damping, Question, Specification};
use crate::status::CellStatus;

/// A P or PV loop around an integrator with n − 1 lags.
struct Plant {
    a: Vec<f64>,
    b: Vec<f64>,
    p: Vec<f64>,
    v: Vec<f64>,
}

fn plant(lags: &[f64]) -> Plant {
    let n = lags.len() + 1;
    let mut a = vec![0.0; n * n];
    let mut b = vec![0.0; n];
    for (i, lag) in lags.iter().enumerate() {
        // A chain: x_i′ = x_{i+1} − 0, the lags from the command on.
        a[i * n + i + 1] = if i == 0 { 1.0 } else { 1.0 / lags[i - 1] };
        if i > 0 {
            a[i * n + i] = -1.0 / lags[i - 1];
        }
        if i + 1 == n - 1 {
            a[(n - 1) * n + n - 1] = -1.0 / lag;
        }
    }
    b[n - 1] = lags.last().map_or(1.0, |lag| 1.0 / lag);
    let mut p = vec![0.0; n];
    p[0] = -1.0;
    let mut v = vec![0.0; n];
    v[1.min(n - 1)] = if n > 1 { -1.0 } else { 0.0 };
    Plant { a, b, p, v }
}

/// The loop with Kp and Kv.
fn with_gains(plant: &Plant, gains: (f64, f64), delay: f64, sample_time: f64) -> LinearLoop {
    let k = plant
        .p
        .iter()
        .zip(&plant.v)
        .map(|(p, v)| gains.0 * p + gains.1 * v)
        .collect();
    let n = plant.b.len();
    let equations = Equations {
        a: plant.a.clone(),
        b: plant.b.clone(),
        e: vec![0.0; n],
        k,
        l: if n == 1 { -gains.1 } else { 0.0 },
        c: vec![0.0; n],
        ..Equations::default()
    };
    LinearLoop::new(equations, delay, Some(sample_time), None).unwrap()
}

/// Its poles s.
fn poles(
    plant: &Plant,
    gains: (f64, f64),
    delay: f64,
    sample_time: f64,
) -> Vec<num_complex::Complex64> {
    sampled::poles(&with_gains(plant, gains, delay, sample_time)).unwrap()
}

fn mapped(
    plant: &Plant,
    kp: &[f64],
    kv: &[f64],
    delay: f64,
    sample_time: f64,
    question: Question,
) -> Chart {
    let n = plant.b.len();
    let used = [n as f64];
    let k: Vec<f64> = kv
        .iter()
        .flat_map(|kv| plant.v.iter().map(move |v| kv * v))
        .collect();
    let l: Vec<f64> = kv.iter().map(|kv| if n == 1 { -kv } else { 0.0 }).collect();
    let rows = LoopRows {
        rows: kv.len(),
        states: n,
        used: &used,
        a: &plant.a,
        b: &plant.b,
        k: &k,
        l: &l,
        k_slope: &plant.p,
        l_slope: &[0.0],
        delay: &[delay],
        sample_time: &[sample_time],
        points: kp,
    };
    let middle = kp[kp.len() / 2];
    let column_k: Vec<f64> = plant.p.iter().map(|p| middle * p).collect();
    let column = LoopRows {
        rows: 1,
        k: &column_k,
        l: &[0.0],
        k_slope: &plant.v,
        l_slope: &[if n == 1 { -1.0 } else { 0.0 }],
        points: kv,
        ..rows
    };
    held_map(&rows, Some(&column), question, false, &Task::new()).unwrap()
}

fn violates(s: num_complex::Complex64, specification: Specification) -> (bool, bool) {
    let slow = s.re + specification.decay;
    let margin = 1e-6;
    let mut violated = slow > 0.0;
    let mut near = slow.abs() < margin;
    if let Some(Damping { ratio, horizon }) = specification.damping {
        let weak = -s.re / s.norm() - ratio;
        violated |= s.re > -horizon && weak < 0.0;
        near |= (s.re + horizon).abs() < margin || weak.abs() < margin;
    }
    (violated, near)
}

#[test]
fn maps_agree_with_eigenvalues() {
    let kp: Vec<f64> = (0..23).map(|i| -1.0 + 0.37 * f64::from(i)).collect();
    let kv: Vec<f64> = (0..11).map(|i| -0.83 + 0.19 * f64::from(i)).collect();
    let specifications = [
        Specification::default(),
        Specification {
            decay: 0.7,
            damping: None,
        },
        Specification {
            decay: -0.4,
            damping: None,
        },
        Specification {
            decay: 0.2,
            damping: Some(Damping {
                ratio: 0.3,
                horizon: 6.0,
            }),
        },
        Specification {
            decay: 0.0,
            damping: Some(Damping {
                ratio: 0.5,
                horizon: 400.0,
            }),
        },
    ];
    let mut compared = 0;
    for lags in [&[][..], &[0.15], &[0.15, 0.03], &[0.4, 0.1, 0.02, 0.01]] {
        let plant = plant(lags);
        for (delay, sample_time) in [
            (0.0, 0.1),
            (0.36, 0.065),
            (0.325, 0.065),
            (0.1, 0.3),
            (0.2, 0.004),
        ] {
            let all: Vec<_> = (0..11 * 23)
                .map(|at| poles(&plant, (kp[at % 23], kv[at / 23]), delay, sample_time))
                .collect();
            for specification in specifications {
                let question = Question {
                    specification,
                    abscissa: true,
                    ..Question::default()
                };
                let chart = mapped(&plant, &kp, &kv, delay, sample_time, question);
                for (row, kv) in kv.iter().enumerate() {
                    for (column, kp) in kp.iter().enumerate() {
                        let at = row * 23 + column;
                        let found = &all[at];
                        let judged: Vec<_> = found
                            .iter()
                            .filter(|s| s.re.is_finite())
                            .map(|s| violates(*s, specification))
                            .collect();
                        if judged.iter().any(|(_, near)| *near) {
                            continue;
                        }
                        let truth = judged.iter().filter(|(violated, _)| *violated).count();
                        assert_eq!(
                            chart.status[at],
                            CellStatus::Ok,
                            "{lags:?} {delay} {sample_time} {specification:?} {kp} {kv} truth {truth}"
                        );
                        assert_eq!(
                            chart.unstable[at] as usize, truth,
                            "{lags:?} {delay} {sample_time} {specification:?} {kp} {kv}"
                        );
                        let abscissa = found[0].re;
                        assert!(
                            (chart.abscissa[at] - abscissa).abs() < 1e-6 * (1.0 + abscissa.abs()),
                            "{lags:?} {delay} {sample_time} {kp} {kv}: {} {abscissa}",
                            chart.abscissa[at]
                        );
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(compared > 20_000, "{compared}");
}

proptest! {
    #[test]
    fn no_pole_crosses_within_a_proved_part_of_a_sample(
        lag in 0.05..0.6_f64,
        gains in (0.2..6.0_f64, -0.3..0.6_f64),
        samples in 0_u8..6,
        low in 0.0..1.0_f64,
        width in 1e-7..0.3_f64,
    ) {
        let (plant, period) = (plant(&[lag]), 0.1);
        let (start, end) = (f64::from(samples), (low + width).min(1.0));
        let of = with_gains(&plant, gains, start * period, period);
        let held = HeldLoop::new(&of).unwrap();
        let at = |fraction: f64| poles(&plant, gains, (start + fraction) * period, period);
        let count = |fraction: f64| at(fraction).iter().filter(|s| s.re > 0.0).count();
        if held.within_sample((low, end)).avoids_circle((start + 1.0, start + 1.0)) {
            for part in 0_u8..=8 {
                prop_assert_eq!(count(low + (end - low) * f64::from(part) / 8.0), count(low));
            }
        } else {
            // A short part is proved where no pole is next to the circle.
            let short = held.within_sample((low, low + 1e-7 * (end - low)));
            let nearest = at(low).iter().fold(1.0, |least: f64, s| least.min(s.re.abs()));
            let is_known = short.avoids_circle((start + 1.0, start + 1.0));
            prop_assert!(is_known || nearest < 1e-3);
        }
    }
}

/// The zeros of the polynomial are the eigenvalues of the transition matrix.
#[test]
fn poles_with_a_long_delay_are_the_eigenvalues() {
    let mut seed = 9u64;
    let mut draw = |low: f64, high: f64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        low + (high - low) * ((seed >> 11) as f64 / (1u64 << 53) as f64)
    };
    for lags in [&[][..], &[0.3], &[0.2, 1.1]] {
        let of = plant(lags);
        for _ in 0..12 {
            let period = draw(0.01, 0.05);
            let delay = period * draw(11.0, 60.0);
            let gains = (draw(0.02, 1.5) / delay, draw(-0.1, 0.4));
            let linear = with_gains(&of, gains, delay, period);
            let found = HeldLoop::new(&linear).unwrap().poles().unwrap();
            let expected: Vec<_> = sampled::poles(&linear).unwrap();
            // Those that fall below a tenth within a sample are far from all that matters.
            let lasting = |s: &&num_complex::Complex64| s.re * period > -2.3;
            let count = expected.iter().filter(lasting).count();
            assert_eq!(found.iter().filter(lasting).count(), count, "{lags:?}");
            for pole in expected.iter().filter(lasting) {
                let near = found.iter().map(|s| ((s - pole) * period).exp() - 1.0);
                let near = near.map(|apart| apart.norm());
                let least = near.fold(f64::INFINITY, f64::min);
                assert!(
                    least < 1e-9,
                    "{lags:?} {gains:?} {delay} {period}: {pole} {least}"
                );
            }
        }
    }
}
