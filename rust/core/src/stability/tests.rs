use std::f64::consts::PI;

use proptest::prelude::*;

use super::{
    Affine, Axis, Damping, ENDLESS, Family, Proof, Question, Specification, Term, UNKNOWN, Vertex,
    boundaries, judge, map,
};
use crate::quasipoly::{QuasiPolynomial, make};
use crate::roots::{count_right_of, spectral_abscissa};
use crate::status::CellStatus;
use crate::{Error, Task};

const COUNTS: Question = Question {
    specification: Specification {
        decay: 0.0,
        damping: None,
    },
    abscissa: false,
    proof: Proof::Curves,
};
const ABSCISSA: Question = Question {
    abscissa: true,
    ..COUNTS
};

fn term(coefficient: f64, exponents: &[u32], power: u32, constant: f64, slopes: &[f64]) -> Term {
    Term {
        coefficient,
        exponents: exponents.to_vec(),
        power,
        delay: Affine {
            constant,
            slopes: slopes.to_vec(),
        },
    }
}

fn names(text: &str) -> Vec<String> {
    text.split(' ').map(str::to_owned).collect()
}

/// s + Kp e^(−s T).
fn integrator() -> Family {
    Family::new(
        names("Kp T"),
        vec![
            term(1.0, &[0, 0], 1, 0.0, &[0.0, 0.0]),
            term(1.0, &[1, 0], 0, 0.0, &[0.0, 1.0]),
        ],
    )
    .unwrap()
}

/// s + (Kp + Kv s) e^(−0.36 s).
fn velocity() -> Family {
    Family::new(
        names("Kp Kv"),
        vec![
            term(1.0, &[0, 0], 1, 0.0, &[0.0, 0.0]),
            term(1.0, &[1, 0], 0, 0.36, &[0.0, 0.0]),
            term(1.0, &[0, 1], 1, 0.36, &[0.0, 0.0]),
        ],
    )
    .unwrap()
}

fn line(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count)
        .map(|i| low + (high - low) * i as f64 / (count - 1) as f64)
        .collect()
}

/// The axes of the first two parameters.
fn axes<'a>(first: &'a [f64], second: &'a [f64]) -> [Axis<'a>; 2] {
    [(0, first), (1, second)].map(|(parameter, points)| Axis { parameter, points })
}

#[test]
fn terms_of_one_delay_and_power_add_up() {
    let family = Family::new(
        names("a b"),
        vec![
            term(2.0, &[1, 0], 1, 0.1, &[0.0, 0.0]),
            term(-1.0, &[0, 2], 1, 0.1, &[0.0, 0.0]),
            term(3.0, &[0, 0], 0, 0.0, &[0.0, 0.1]),
        ],
    )
    .unwrap();
    let h = family.at(&[5.0, 3.0]).unwrap();
    assert_eq!(h.delays(), [0.1, 0.1 * 3.0]);
    assert_eq!(h.coefficients(), [vec![0.0, 1.0], vec![3.0]]);
    // b = 1 makes the two delays one.
    let h = family.at(&[1.0, 1.0]).unwrap();
    assert_eq!(h.delays(), [0.1]);
    assert_eq!(h.coefficients(), [vec![3.0, 1.0]]);
}

#[test]
fn delays_equal_but_for_rounding_are_merged_and_rounded_negative_ones_are_zero() {
    let family = Family::new(
        names("T"),
        vec![
            term(1.0, &[0], 0, 0.3, &[0.0]),
            term(1.0, &[0], 0, 0.1, &[1.0]),
        ],
    )
    .unwrap();
    // 0.1 + 0.2 is an ulp above 0.3.
    let h = family.at(&[0.2]).unwrap();
    assert_eq!(h.delays(), [0.3]);
    assert_eq!(h.coefficients(), [vec![2.0]]);
    let family = Family::new(names("T"), vec![term(1.0, &[0], 1, -0.3, &[3.0])]).unwrap();
    // 3 · 0.1 − 0.3 is 5.6e-17, and negative a few ulp below 0.1.
    let below = f64::from_bits(0.1f64.to_bits() - 4);
    assert!(3.0 * below - 0.3 < 0.0);
    assert_eq!(family.at(&[below]).unwrap().delays()[0], 0.0);
    let error = family.at(&[0.09]).unwrap_err().to_string();
    assert!(error.contains("T=0.09"), "{error}");
}

#[test]
fn bad_families_and_values_are_refused() {
    let ok = term(1.0, &[0], 1, 0.0, &[0.0]);
    for bad in [
        term(f64::NAN, &[0], 1, 0.0, &[0.0]),
        term(1.0, &[0], 1, f64::INFINITY, &[0.0]),
        term(1.0, &[0], 1, 0.0, &[f64::NAN]),
        term(1.0, &[0, 1], 1, 0.0, &[0.0]),
        term(1.0, &[0], 1, 0.0, &[]),
        term(1.0, &[5000], 1, 0.0, &[0.0]),
        term(1.0, &[0], 5000, 0.0, &[0.0]),
    ] {
        let made = Family::new(names("K"), vec![ok.clone(), bad]);
        assert!(matches!(made, Err(Error::Argument(_))), "{made:?}");
    }
    assert!(Family::new(names("K K"), vec![]).is_err());
    let family = integrator();
    for values in [
        &[1.0][..],
        &[1.0, -0.1],
        &[f64::NAN, 0.1],
        &[1.0, f64::INFINITY],
    ] {
        assert!(matches!(family.at(values), Err(Error::Argument(_))));
    }
    assert!(
        Family::new(names("K"), vec![])
            .unwrap()
            .at(&[1.0])
            .unwrap()
            .is_zero()
    );
}

#[test]
fn cells_of_every_kind_are_told_apart() {
    let task = Task::new();
    let told = |h: &QuasiPolynomial| {
        let cell = judge(h, Specification::default(), true, &task).unwrap();
        (cell.unstable, cell.status)
    };
    let s: &[f64] = &[0.0, 1.0];
    let known: [(&[&[f64]], i32, CellStatus); 10] = [
        (&[s, &[2.0]], 0, CellStatus::Ok),
        (&[s, &[5.0]], 2, CellStatus::Ok),
        // A root 7e-5 right of the chain was once taken for the chain.
        (&[s, &[0.12, 0.984]], 0, CellStatus::Ok),
        // |s + 0.12| > |s|: every root of the chain lies left of its limit.
        (&[&[0.12, 1.0], &[0.0, 0.984]], 0, CellStatus::Chain),
        (&[s, &[2.0, 1.0]], UNKNOWN, CellStatus::Boundary),
        (&[s, &[2.0, -1.1]], ENDLESS, CellStatus::Infinite),
        (&[&[1.0], s], ENDLESS, CellStatus::Infinite),
        (&[&[1.0], &[0.5]], 0, CellStatus::Chain),
        (&[&[1.0], &[2.5]], ENDLESS, CellStatus::Infinite),
        (&[&[3.0], &[0.0]], 0, CellStatus::Ok),
    ];
    for (rows, unstable, status) in known {
        assert_eq!(
            told(&make(rows, &[0.0, 0.36])),
            (unstable, status),
            "{rows:?}"
        );
    }
    let chain_leads = make(&[&[0.12, 1.0], &[0.0, 0.984]], &[0.0, 0.36]);
    let cell = judge(&chain_leads, Specification::default(), true, &task).unwrap();
    assert!((cell.abscissa - 0.984f64.ln() / 0.36).abs() < 1e-14);
    assert_eq!(told(&make(&[s], &[0.0])), (UNKNOWN, CellStatus::Boundary));
    let zero = QuasiPolynomial::zero();
    assert_eq!(told(&zero), (UNKNOWN, CellStatus::Undecided));
}

/// The pairs of s + K e^(−s T) cross at K T = π/2 + 2πk; for K < 0 a real root is unstable and
/// pairs cross at −K T = 3π/2 + 2πk.
fn unstable_by_hand(gain: f64, delay: f64) -> i32 {
    let turns = |start: f64| {
        (((gain * delay).abs() - start) / (2.0 * PI))
            .ceil()
            .max(0.0) as i32
    };
    if gain > 0.0 {
        2 * turns(PI / 2.0)
    } else {
        1 + 2 * turns(1.5 * PI)
    }
}

#[test]
fn the_delayed_integrator_follows_the_closed_form_everywhere() {
    let (gains, delays) = (line(-30.0, 30.0, 40), line(0.0, 2.0, 31));
    let task = Task::new();
    let axes = axes(&gains, &delays);
    let chart = map(&integrator(), &[0.0, 0.0], axes, COUNTS, &task).unwrap();
    assert_eq!(task.done(), 40 * 31);
    let cells = gains
        .iter()
        .flat_map(|gain| delays.iter().map(move |delay| (*gain, *delay)));
    for ((gain, delay), unstable) in cells.zip(&chart.unstable) {
        let truth = unstable_by_hand(gain, delay);
        assert_eq!(*unstable, truth, "K={gain}, T={delay}");
    }
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let (kp, kv) = (line(-1.0, 6.0, 15), line(-1.2, 1.2, 13));
    let axes = axes(&kp, &kv);
    let run = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| map(&velocity(), &[0.0, 0.0], axes, ABSCISSA, &Task::new()).unwrap())
    };
    let (one, four) = (run(1), run(4));
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&one.abscissa), bits(&four.abscissa));
    assert_eq!((one.unstable, one.status), (four.unstable, four.status));
}

#[test]
fn a_stopped_map_stops_and_bad_axes_are_refused() {
    let points = line(0.1, 1.0, 3);
    let run = |values: &[f64], axes, task: &Task| map(&integrator(), values, axes, COUNTS, task);
    let [good, other] = axes(&points, &points);
    let task = Task::new();
    task.stop();
    assert_eq!(
        run(&[0.0; 2], [good, other], &task),
        Err(Error::Interrupted)
    );
    let task = Task::new();
    let beyond = Axis {
        parameter: 2,
        ..good
    };
    for bad in [
        [good, good],
        [good, beyond],
        axes(&points, &[0.1, -0.1]),
        axes(&[f64::NAN], &points),
    ] {
        assert!(run(&[0.0; 2], bad, &task).is_err());
    }
    assert!(run(&[0.0; 1], [good, other], &task).is_err());
    let many = vec![1.0; 10_000];
    let found = run(&[0.0; 2], axes(&many, &many), &task);
    assert!(matches!(found, Err(Error::TooMuch { .. })));
    let found = run(&[0.0; 2], axes(&[], &points), &task);
    assert_eq!(found.unwrap().status.len(), 0);
    assert_eq!(task.done(), 0);
}

/// Terms over two parameters with delays that are not negative for positive parameters.
fn any_terms() -> impl Strategy<Value = Vec<Term>> {
    let one = (
        -3.0..3.0f64,
        0..3u32,
        0..3u32,
        0..4u32,
        0.0..1.0f64,
        0.0..2.0f64,
        0.0..2.0f64,
    );
    let one =
        one.prop_map(|(c, a, b, power, constant, x, y)| term(c, &[a, b], power, constant, &[x, y]));
    prop::collection::vec(one, 1..6)
}

proptest! {
    #[test]
    fn a_member_is_the_sum_of_its_terms(
        terms in any_terms(),
        a in 0.0..2.0f64,
        b in 0.0..2.0f64,
        x in -1.0..1.0f64,
        y in -3.0..3.0f64,
    ) {
        let h = Family::new(names("a b"), terms.clone()).unwrap().at(&[a, b]).unwrap();
        let s = num_complex::Complex64::new(x, y);
        let (mut sum, mut size) = (num_complex::Complex64::ZERO, 0.0);
        for term in &terms {
            let gain = term.coefficient
                * a.powi(term.exponents[0] as i32)
                * b.powi(term.exponents[1] as i32);
            let delay = term.delay.constant + term.delay.slopes[0] * a + term.delay.slopes[1] * b;
            let value = gain * s.powu(term.power) * (-s * delay).exp();
            sum += value;
            size += value.norm() * (1.0 + delay * s.norm());
        }
        // Each side has a few rounding errors.
        prop_assert!((h.value(s) - sum).norm() <= 1e-13 * size);
    }

    #[test]
    fn a_cell_is_the_pointwise_call(kp in -1.0..8.0f64, kv in -0.95..0.95f64) {
        let task = Task::new();
        let axes = [
            Axis { parameter: 0, points: &[kp] },
            Axis { parameter: 1, points: &[kv] },
        ];
        let chart = map(&velocity(), &[0.0, 0.0], axes, ABSCISSA, &task).unwrap();
        let h = velocity().at(&[kp, kv]).unwrap();
        prop_assert_eq!(chart.unstable[0] as u64, count_right_of(&h, 0.0, &task).unwrap());
        prop_assert_eq!(chart.abscissa[0], spectral_abscissa(&h, true, &task).unwrap());
        // Both are proved, so that they never contradict each other.
        prop_assert_eq!(chart.unstable[0] > 0, chart.abscissa[0] > 0.0);
    }
}

#[test]
fn rows_say_what_single_cells_say() {
    let gains: Vec<f64> = (0..40).map(|i| -2.0 + 0.25 * f64::from(i)).collect();
    let others: Vec<f64> = (0..25).map(|i| -1.2 + 0.1 * f64::from(i)).collect();
    let damping = Some(Damping {
        ratio: 0.4,
        horizon: 1.0,
    });
    let specifications = [(0.0, None), (0.35, None), (0.0, damping), (0.2, damping)];
    for (first, second) in [(&gains, &others), (&others, &gains)] {
        let order = if first.len() == 40 { [0, 1] } else { [1, 0] };
        let axes = [(order[0], first), (order[1], second)]
            .map(|(parameter, points)| Axis { parameter, points });
        for (decay, damping) in specifications {
            let [curves, cells] = [Proof::Curves, Proof::Cells].map(|proof| {
                let question = Question {
                    specification: Specification { decay, damping },
                    abscissa: false,
                    proof,
                };
                map(&velocity(), &[0.0, 0.0], axes, question, &Task::new()).unwrap()
            });
            assert_eq!(curves, cells, "{decay} {damping:?}");
        }
    }
}

#[test]
fn boundaries_are_closed_forms_in_order() {
    // s + (Kp + Kv s) e^(−0.36 s): Kp = w sin(0.36 w), Kv = −cos(0.36 w).
    let gains = [0.5, 6.0];
    let others: Vec<f64> = (0..61).map(|i| -0.6 + 0.02 * f64::from(i)).collect();
    let axes = axes(&gains, &others);
    let found = boundaries(
        &velocity(),
        &[0.0, 0.0],
        axes,
        Specification::default(),
        &Task::new(),
    );
    let [found, _] = found.unwrap().unwrap();
    assert_eq!((found.along, found.curves.len()), (0, 1));
    let curve = &found.curves[0];
    assert_eq!(curve.len(), others.len());
    for (vertex, kv) in curve.iter().zip(&others) {
        let omega = (-kv).acos() / 0.36;
        // A crossing is known to a few rounding errors of the bounds of F, not of F itself.
        assert!((vertex.omega - omega).abs() < 1e-10);
        assert!((vertex.gain - omega * (0.36 * omega).sin()).abs() < 1e-9);
        assert_eq!(vertex.jump, 2);
    }
}

#[test]
fn a_curve_that_turns_back_is_one() {
    // The pendulum s² − 1 + (Kp + Kd s) e^(−0.3 s): Kp = (1 + w²) cos 0.3w, Kd = (w + 1/w) sin
    // 0.3w, which grows up to 6.2 at w = 6.8 and returns to 0, so that most rows meet the curve
    // twice.
    let none = [0.0, 0.0];
    let terms = vec![
        term(1.0, &[0, 0], 2, 0.0, &none),
        term(-1.0, &[0, 0], 0, 0.0, &none),
        term(1.0, &[1, 0], 0, 0.3, &none),
        term(1.0, &[0, 1], 1, 0.3, &none),
    ];
    let family = Family::new(names("Kp Kd"), terms).unwrap();
    let (first, second) = (line(-130.0, 20.0, 31), line(0.02, 8.0, 400));
    let axes = axes(&first, &second);
    let found = boundaries(&family, &none, axes, Specification::default(), &Task::new());
    let [found, _] = found.unwrap().unwrap();
    // The real root crosses in the opposite direction where the pair reaches it, at Kd = 0.3.
    assert_eq!((found.along, found.curves.len()), (0, 3));
    let curves = &found.curves;
    let (real, pairs): (Vec<_>, Vec<_>) = curves.iter().partition(|curve| curve[0].omega == 0.0);
    let mut real = real.into_iter().flatten();
    assert!(real.all(|vertex| (vertex.gain - 1.0).abs() < 1e-12));
    assert_eq!(pairs.len(), 1);
    let curve = pairs[0];
    for Vertex {
        gain, row, omega, ..
    } in curve
    {
        let (sine, cosine) = (0.3 * omega).sin_cos();
        assert!((gain - (1.0 + omega * omega) * cosine).abs() < 1e-9);
        assert!((second[*row] - (omega + 1.0 / omega) * sine).abs() < 1e-9);
    }
    // All frequencies once, with rows and directions turning at one point.
    let up = curve[0].omega < curve[1].omega;
    assert!(
        curve
            .windows(2)
            .all(|pair| (pair[0].omega < pair[1].omega) == up)
    );
    let turns: Vec<_> = curve
        .windows(2)
        .filter(|pair| pair[0].row == pair[1].row)
        .collect();
    assert_eq!(turns.len(), 1);
    assert_eq!(turns[0][0].jump, -turns[0][1].jump);
    let top = turns[0][0].row;
    assert!(second[top] < 6.21 && second[top + 1] > 6.19);
    for row in second.iter().position(|kd| *kd > 0.31).unwrap()..=top {
        assert_eq!(curve.iter().filter(|vertex| vertex.row == row).count(), 2);
    }
}
