//! Whether an answer holds, and if not, why.

use super::candidate::Candidate;
use super::hull::Turning;
use super::loop_view::Seen;
use super::tolerances::EVIDENCE;

/// How far an answer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grade {
    /// Its intervals are claimed to hold.
    Reliable,
    /// Numbers without a claim.
    Indication,
    /// No number.
    None,
}

/// The grade with its reason and the size of that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// The grade.
    pub grade: Grade,
    /// The reason, empty where the answer is reliable.
    pub reason: &'static str,
    /// Its size, NaN where it has none.
    pub size: f64,
}

/// The verdict of candidates within reach, the best first; `response` is by how much BIC the command
/// explains the output.
pub(super) fn verdict(all: &[Turning<'_>], response: f64) -> Verdict {
    let new = |grade, reason, size| Verdict { grade, reason, size };
    let Some(best) = all.first() else {
        return new(Grade::None, "no response", f64::NAN);
    };
    let candidate = best.candidate;
    if response < EVIDENCE.reach {
        return new(Grade::None, "no response", response);
    }
    if candidate.told < candidate.values.len() {
        return new(Grade::None, "too few told", candidate.told as f64);
    }
    if let Some(size) = contradiction(all) {
        return new(Grade::Indication, "classes contradict", size);
    }
    if candidate.at_limit {
        return new(Grade::Indication, "delay at its limit", candidate.numbers.delay);
    }
    if candidate.white < EVIDENCE.white {
        return new(Grade::Indication, "residuals not white", candidate.white);
    }
    new(Grade::Reliable, "", f64::NAN)
}

/// How far classes are from each other where the loop crosses over, if that is too far.
fn contradiction(all: &[Turning<'_>]) -> Option<f64> {
    let best = all.first()?;
    let gains: Vec<f64> = all.iter().map(|one| signed_largest(one)).collect();
    let opposite = gains.iter().any(|gain| gain * gains[0] < 0.0);
    let sizes = || gains.iter().map(|gain| gain.abs());
    let (low, high) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
    if opposite || (low < f64::INFINITY && high > EVIDENCE.contradiction * low) {
        return Some(high / low);
    }
    let omega = best.crossover()?;
    let phases = || all.iter().map(|one| one.candidate.seen().phase(omega));
    let (low, high) = (
        phases().fold(f64::INFINITY, f64::min),
        phases().fold(f64::NEG_INFINITY, f64::max),
    );
    (high - low > EVIDENCE.turn).then_some(high - low)
}

fn signed_largest(one: &Turning<'_>) -> f64 {
    let gain = one.candidate.gain;
    let size = one.turn.map_or(f64::INFINITY, |turn| {
        let seen: Seen = Candidate::seen(one.candidate);
        crate::elementary::exp(seen.log_largest(turn))
    });
    size.copysign(gain)
}
