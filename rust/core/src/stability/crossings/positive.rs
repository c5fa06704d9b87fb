//! How far a polynomial that begins above zero stays there.

/// Share of the length tried at which a length of the cubic is accepted.
const CLOSE_LENGTHS: f64 = 0.7;

/// The next length tried for the cubic: as a multiple of the last result, and at least as a share
/// of the last trial.
const TRIALS: (f64, f64) = (1.6, 0.125);

/// The t up to which a + b t + c t² > 0.
pub(super) fn quadratic(a: f64, b: f64, c: f64) -> f64 {
    if a <= 0.0 {
        return 0.0;
    }
    let square = b * b - 4.0 * a * c;
    if square < 0.0 || (b >= 0.0 && c >= 0.0) {
        return f64::INFINITY;
    }
    let root = square.sqrt();
    if b <= 0.0 {
        2.0 * a / (root - b)
    } else {
        (b + root) / (-2.0 * c)
    }
}

/// The t, at most `most`, up to which a + b t + c t² − d t³ is proved to be positive: t³ ≤ T t² for
/// t ≤ T.
pub(super) fn cubic(a: f64, b: f64, c: f64, d: f64, most: f64) -> f64 {
    let (mut trial, mut best) = (most, 0.0f64);
    for _ in 0..4 {
        let root = quadratic(a, b, c - d * trial);
        best = best.max(root.min(trial));
        if root >= CLOSE_LENGTHS * trial {
            break;
        }
        trial = (TRIALS.0 * root).max(TRIALS.1 * trial);
    }
    best
}
