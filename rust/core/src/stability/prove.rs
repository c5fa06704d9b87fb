//! One box of parameters: has every member the same number of unstable roots?
//!
//! If no member has a root on the imaginary axis and none comes from infinity, the number of roots
//! right of it is that at the centre, where it is counted. The axis up to the frequency W of `tail`
//! is divided into stretches, each in halves until `value_set` proves it clear of roots or the box is
//! too large for that. What a box has proved holds for its parts: a part looks only at the stretches
//! that are left.

use std::collections::VecDeque;

use super::cell::ENDLESS;
use super::local::{Local, Range};
use super::reduced::Reduced;
use super::tail::{Tail, tail};
use super::value_set::{Look, look};
use crate::roots::count_right_of;
use crate::{Error, Task};

/// Stretches that a box may fail on before it is divided.
const FAILURES: usize = 1;

/// Looks that a box may take before it is divided.
const LOOKS: usize = 20_000;

/// What is left to prove on a box.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Claim<const D: usize> {
    pub(super) range: Range<D>,
    /// Stretches of the axis not known to be clear, the hardest last; `None` where no W is known.
    pub(super) stretches: Option<Vec<(f64, f64)>>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Verdict {
    /// All members have so many unstable roots, or [`ENDLESS`].
    Proved(i32),
    /// The box is to be halved along the parameter, its halves inherit the stretches.
    Halve(usize, Option<Vec<(f64, f64)>>),
    /// No parameter makes a difference to what is missing.
    Stuck,
}

impl<const D: usize> Claim<D> {
    pub(super) fn new(range: Range<D>) -> Self {
        Self {
            range,
            stretches: None,
        }
    }
}

/// Judge a box; `local` is room for what it knows.
pub(super) fn judge_box<const D: usize>(
    reduced: &Reduced<'_, D>,
    claim: &Claim<D>,
    local: &mut Local<D>,
    task: &Task,
) -> Result<Verdict, Error> {
    task.check()?;
    local.adopt(reduced, &claim.range);
    let mut left = match &claim.stretches {
        Some(stretches) => stretches.clone(),
        None => match tail(local, reduced.degree) {
            Tail::Endless => return Ok(Verdict::Proved(ENDLESS)),
            Tail::Bounded(frequency) => vec![(0.0, frequency)],
            Tail::Open(shares) => {
                return Ok(largest(&shares).map_or(Verdict::Stuck, |i| Verdict::Halve(i, None)));
            }
        },
    };
    let mut failed: Vec<(f64, f64)> = Vec::new();
    let mut shares = None;
    for step in 0.. {
        let Some((from, to)) = left.pop() else {
            break;
        };
        if from == to {
            continue;
        }
        if step % 256 == 255 {
            task.check()?;
        }
        match look(local, from, to) {
            Look::Clear => {}
            Look::Wide(parts) => {
                shares.get_or_insert(parts);
                failed.push((from, to));
            }
            Look::Long => {
                let middle = from + 0.5 * (to - from);
                left.push((middle, to));
                left.push((from, middle));
            }
        }
        if failed.len() >= FAILURES || step >= LOOKS {
            break;
        }
    }
    if failed.is_empty() && left.is_empty() {
        let centre = reduced.values_at(&claim.range.centre());
        let counted = reduced
            .family
            .at(&centre)
            .and_then(|h| count_right_of(&h, 0.0, task));
        match counted.map(i32::try_from) {
            Ok(Ok(count)) => return Ok(Verdict::Proved(count)),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            _ => {}
        }
    }
    left.extend(failed);
    // Where nothing failed, the work was too much, or the centre is beyond double precision.
    let shares = shares.unwrap_or(local.half);
    Ok(largest(&shares).map_or(Verdict::Stuck, |i| Verdict::Halve(i, Some(left))))
}

/// The index of the largest share, if there is one above zero.
fn largest<const D: usize>(shares: &[f64; D]) -> Option<usize> {
    let mut best = (0.0, None);
    for (index, share) in shares.iter().enumerate() {
        if *share > best.0 {
            best = (*share, Some(index));
        }
    }
    best.1
}

/// What a box holds, as far as it was looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Finding {
    /// Every member is stable.
    Stable,
    /// Some are not: so many unstable roots, or [`ENDLESS`].
    Unstable(i32),
    /// Neither could be proved.
    Unknown,
}

/// Prove that every member of a box is stable, in at most so many boxes, or find one that is not.
pub(super) fn find_unstable<const D: usize>(
    reduced: &Reduced<'_, D>,
    range: Range<D>,
    boxes: usize,
    local: &mut Local<D>,
    task: &Task,
) -> Result<Finding, Error> {
    let mut waiting = VecDeque::from([Claim::new(range)]);
    let mut judged = 0;
    let mut finding = Finding::Stable;
    while let Some(claim) = waiting.pop_front() {
        judged += 1;
        if judged > boxes {
            return Ok(Finding::Unknown);
        }
        match judge_box(reduced, &claim, local, task)? {
            Verdict::Proved(0) => {}
            Verdict::Proved(count) => return Ok(Finding::Unstable(count)),
            Verdict::Stuck => finding = Finding::Unknown,
            Verdict::Halve(parameter, stretches) => match claim.range.halves(parameter) {
                None => finding = Finding::Unknown,
                Some((_, halves)) => waiting.extend(halves.map(|range| Claim {
                    range,
                    stretches: stretches.clone(),
                })),
            },
        }
    }
    Ok(finding)
}
