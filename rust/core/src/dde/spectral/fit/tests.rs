use super::*;

fn fitted(breaks: &[f64], function: impl Fn(f64) -> f64) -> Approximation {
    let tolerance = |_, size: f64| 1e-10 * size;
    approximate((-1.0, 0.0), 1e-3, breaks, 1, tolerance, |times, out| {
        for (t, out) in times.iter().zip(out) {
            *out = function(*t);
        }
        Ok(())
    })
    .unwrap()
}

fn error(found: &Approximation, function: impl Fn(f64) -> f64) -> f64 {
    let mut worst: f64 = 0.0;
    // A piece that contains a jump is as short as numbers allow.
    for piece in found
        .pieces
        .iter()
        .filter(|piece| piece.end - piece.start > 1e-9)
    {
        for i in 1..10 {
            let t = piece.start + 0.1 * f64::from(i) * (piece.end - piece.start);
            let mut value = [0.0];
            piece.value(t, &mut value);
            worst = worst.max((value[0] - function(t)).abs());
        }
    }
    worst
}

#[test]
fn a_smooth_function_needs_few_pieces_and_has_no_breaks() {
    let found = fitted(&[], |t| (5.0 * t).sin());
    assert!(found.pieces.len() <= 2 && found.breaks.is_empty());
    assert!(error(&found, |t| (5.0 * t).sin()) < 1e-10);
}

#[test]
fn kinks_and_jumps_are_found() {
    for kink in [-0.3, -0.5, -0.2500003, -std::f64::consts::FRAC_1_PI] {
        for function in [
            Box::new(move |t: f64| (t - kink).abs()) as Box<dyn Fn(f64) -> f64>,
            Box::new(move |t: f64| if t < kink { 1.0 } else { 2.0 }),
        ] {
            let found = fitted(&[], &function);
            assert!(error(&found, &function) < 1e-8);
            for point in &found.breaks {
                assert!((point.time - kink).abs() < 1e-6, "{point:?} {kink}");
            }
            assert_eq!(found.breaks.len(), 1);
        }
    }
}

#[test]
fn declared_breaks_are_joints() {
    let found = fitted(&[-0.3, 4.0], |t| (t + 0.3).abs());
    assert_eq!(found.pieces.len(), 2);
    let time = -0.3;
    assert_eq!(found.breaks, [BreakingPoint { time, order: 0 }]);
}

#[test]
fn noise_is_refused() {
    let mut state = 1_u64;
    let refused = approximate(
        (-1.0, 0.0),
        1e-3,
        &[],
        1,
        |_, _| 1e-10,
        |_, out| {
            for out in out {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                *out = (state >> 40) as f64;
            }
            Ok(())
        },
    );
    assert!(matches!(refused, Err(Error::TooMuch { .. })));
}
