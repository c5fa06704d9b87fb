//! Which minima may be the true one.

use super::candidate::Candidate;
use super::class::Class;
use super::minima::Minimum;
use super::tolerances::EVIDENCE;

/// The minima that may be the true one, those that are clearly more likely among them: of many rows BIC
/// asks more of a number than its errors do. By their places.
pub(super) fn within_reach(found: &[Minimum<'_>]) -> Vec<usize> {
    let best = found.first();
    let (least, likely) = best.map_or((f64::INFINITY, f64::INFINITY), |one| {
        (one.bic, one.deviance)
    });
    let is_near = |at: &usize| {
        let one = &found[*at];
        one.bic <= least + EVIDENCE.reach || one.deviance < likely - EVIDENCE.likely
    };
    (0..found.len()).filter(is_near).collect()
}

/// The best minima of other classes that may catch up with the best one, where all are in error and none gains
/// more than that. By their places.
pub(super) fn catching_up(
    found: &[Minimum<'_>],
    near: &[usize],
    minima: &[Candidate],
) -> Vec<usize> {
    let (Some(best), Some(first)) = (found.first(), minima.first()) else {
        return Vec::new();
    };
    if !first.errs() {
        return Vec::new();
    }
    let reach = best.bic + (best.bic - first.bic) + EVIDENCE.reach;
    let mut known: Vec<Class> = near.iter().map(|at| found[*at].model.class).collect();
    let mut out = Vec::new();
    for (at, one) in found.iter().enumerate() {
        if one.bic < reach && !known.contains(&one.model.class) {
            known.push(one.model.class);
            out.push(at);
        }
    }
    out
}

/// The best, and the minima that are as likely, whatever number of numbers they need. By their places.
pub(super) fn as_likely(found: &[Minimum<'_>]) -> Vec<usize> {
    let best = found.first().map_or(f64::INFINITY, |best| best.deviance);
    let is_likely = |at: &usize| *at == 0 || found[*at].deviance <= best + EVIDENCE.likely;
    (0..found.len()).filter(is_likely).collect()
}
