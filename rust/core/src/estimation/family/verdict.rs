//! Whether an answer holds, and if not, why.

use std::f64::consts::PI;

use super::hull::Turning;
use super::tolerances::EVIDENCE;
use crate::elementary::{exp, log};

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

/// What is known beside the candidates.
pub(super) struct Findings {
    /// BIC by which the command explains the output.
    pub(super) response: f64,
    /// Is the command one sine, and no class named?
    pub(super) is_sine: bool,
}

/// The verdict of candidates that are as likely as the best, which comes first.
pub(super) fn verdict(all: &[Turning<'_>], findings: &Findings) -> Verdict {
    let new = |grade, reason, size| Verdict {
        grade,
        reason,
        size,
    };
    let Some(best) = all.first() else {
        return new(Grade::None, "no response", f64::NAN);
    };
    let candidate = best.candidate;
    if findings.response < EVIDENCE.reach {
        return new(Grade::None, "no response", findings.response);
    }
    let told = candidate.told;
    if findings.is_sine {
        return new(Grade::None, "too few told", told as f64);
    }
    if told < candidate.values.len() && (told < EVIDENCE.enough || is_wide(best)) {
        return new(Grade::None, "too few told", told as f64);
    }
    if let Some(size) = contradiction(all) {
        return new(Grade::Indication, "classes contradict", size);
    }
    if best.crossover().is_some() && is_wide(best) {
        let (_, low, high) = best.largest();
        return new(Grade::Indication, "crossover not told", high / low);
    }
    if let Some(number) = candidate.limit {
        let (reason, size) = match number {
            "delay" => ("delay at its limit", candidate.numbers.delay),
            "lag" => ("lag at its limit", candidate.numbers.sum),
            _ => ("zero at its limit", candidate.numbers.zero),
        };
        return new(Grade::Indication, reason, size);
    }
    // Blocks of rows say how much such residuals scatter, unless they are much of what moves.
    if candidate.white < EVIDENCE.white && candidate.unexplained() > EVIDENCE.unexplained {
        return new(Grade::Indication, "residuals not white", candidate.white);
    }
    new(Grade::Reliable, "", f64::NAN)
}

/// A verdict on a record whose command was moved by a row, by so much in −2 ln L.
pub(super) fn shifted(verdict: Verdict, fall: f64) -> Verdict {
    if verdict.grade != Grade::Reliable {
        return verdict;
    }
    Verdict {
        grade: Grade::Indication,
        reason: "command shifted",
        size: fall,
    }
}

/// Is the largest gain of the best class itself unknown?
fn is_wide(best: &Turning<'_>) -> bool {
    let (_, low, high) = best.largest();
    let is_narrow = high < EVIDENCE.wide * low;
    best.crossover().is_none() || !is_narrow
}

/// How far classes are from each other where the loop crosses over, if that is too far.
fn contradiction(all: &[Turning<'_>]) -> Option<f64> {
    let ends = |values: &dyn Fn() -> Vec<f64>| {
        let values = values();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        (
            low,
            values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        )
    };
    let (low, high) = ends(&|| all.iter().map(|one| one.largest().0).collect());
    let agree = high < EVIDENCE.contradiction * low;
    let best = all.first()?;
    // Where the best has no largest gain, delays say whether the others may have none.
    if best.crossover().is_some() && !agree {
        return Some(high / low);
    }
    let delays = || all.iter().map(Turning::delay);
    let least_end = delays().fold(f64::INFINITY, |least, part| least.min(part.2));
    let most_start = delays().fold(f64::NEG_INFINITY, |most, part| most.max(part.1));
    let crossover = best.crossover();
    if crossover.is_none() && most_start > least_end {
        return Some(most_start - least_end);
    }
    // A delay alone has no crossover: where it turns by 180 degrees.
    let omega = crossover.unwrap_or(PI / best.candidate.numbers.delay);
    let gain = |one: &Turning<'_>| one.candidate.seen().log_gain(omega);
    let (low, high) = ends(&|| all.iter().map(gain).collect());
    if high - low > log(EVIDENCE.contradiction) {
        return Some(exp(high - low));
    }
    let phase = |one: &Turning<'_>| one.phase(&one.candidate.seen(), omega);
    let (low, high) = ends(&|| all.iter().map(phase).collect());
    (high - low > EVIDENCE.turn).then_some(high - low)
}
