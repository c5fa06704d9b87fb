//! One box of parameters: have all members the same number of roots that violate the specification?
//!
//! If no member has a root on the edge of the specification and none comes from infinity, all
//! members have the number of violating roots that is counted at the centre. The edge up to the
//! radius W of `unbounded_frequency` is divided into stretches, each of which is halved until
//! `value_set` proves it free of roots or the box is too large for a proof. A proof for a box holds
//! for its parts, so that a part examines only the stretches that are left.

use std::collections::VecDeque;

use num_complex::Complex64;

use super::box_expansion::{BoxExpansion, Range};
use super::reduced::Reduced;
use super::unbounded_frequency::{UnboundedFrequency, unbounded_frequency};
use super::value_set::{Look, look};
use crate::stability::cell::{ENDLESS, judge};
use crate::stability::specification::Piece;
use crate::status::CellStatus;
use crate::{Error, Task};

/// Stretches that may fail before a box is divided. A larger number tests more of the edge of boxes
/// that are too large.
const FAILURES: usize = 1;

/// Tests of stretches after which a box is divided.
const LOOKS: usize = 20_000;

/// A box and what is still to be proved for it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Claim<const D: usize> {
    pub(crate) range: Range<D>,
    /// Stretches of the edge not yet proved free of roots, the hardest last; `None` where W is not
    /// known.
    pub(crate) stretches: Option<Vec<Stretch>>,
}

/// A stretch of a piece of the edge, by the index of the piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stretch {
    pub(crate) piece: usize,
    pub(crate) from: f64,
    pub(crate) to: f64,
}

/// What is proved for a box before its members are counted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Examined {
    /// No member has a root on the edge, none comes from infinity.
    Clear,
    /// Every member has infinitely many violating roots.
    Endless,
    /// Nothing is proved: the parameter that contributes most to the bound, and the stretches that
    /// are left.
    Open(Option<usize>, Option<Vec<Stretch>>),
}

/// The verdict about a box.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Verdict {
    /// All members have this number of violating roots, or [`ENDLESS`].
    Proved(i32),
    /// The box has to be halved along this parameter; its halves inherit the stretches.
    Halve(usize, Option<Vec<Stretch>>),
    /// No parameter influences what is missing for a proof.
    Stuck,
}

impl<const D: usize> Claim<D> {
    pub(crate) fn new(range: Range<D>) -> Self {
        Self {
            range,
            stretches: None,
        }
    }
}

/// Judge a box; `expansion` is memory for its expansion.
pub(crate) fn judge_box<const D: usize>(
    reduced: &Reduced<'_, D>,
    claim: &Claim<D>,
    expansion: &mut BoxExpansion<D>,
    task: &Task,
) -> Result<Verdict, Error> {
    let (parameter, left) = match examine(reduced, claim, expansion, task)? {
        Examined::Endless => return Ok(Verdict::Proved(ENDLESS)),
        Examined::Open(parameter, left) => (parameter, left),
        Examined::Clear => {
            let centre = reduced.values_at(&claim.range.centre());
            if let Ok(h) = reduced.family.at(&centre) {
                let cell = judge(&h, reduced.specification, false, task)?;
                if cell.status == CellStatus::Ok {
                    return Ok(Verdict::Proved(cell.unstable));
                }
            }
            // The member at the centre cannot be formed in double precision.
            (largest(&expansion.half), Some(Vec::new()))
        }
    };
    Ok(parameter.map_or(Verdict::Stuck, |i| Verdict::Halve(i, left)))
}

/// Is a box proved to have no roots on the edge?
pub(crate) fn examine<const D: usize>(
    reduced: &Reduced<'_, D>,
    claim: &Claim<D>,
    expansion: &mut BoxExpansion<D>,
    task: &Task,
) -> Result<Examined, Error> {
    task.check()?;
    expansion.adopt(reduced, &claim.range);
    let mut left = match &claim.stretches {
        Some(stretches) => stretches.clone(),
        None => {
            match unbounded_frequency(expansion, reduced.degree, reduced.specification.leftmost()) {
                UnboundedFrequency::Endless => return Ok(Examined::Endless),
                UnboundedFrequency::Bounded(radius) => stretches_within(&reduced.edge, radius),
                UnboundedFrequency::Open(shares) => {
                    return Ok(Examined::Open(largest(&shares), None));
                }
            }
        }
    };
    let mut failed: Vec<Stretch> = Vec::new();
    let mut shares = None;
    for step in 0.. {
        let Some(stretch) = left.pop() else {
            break;
        };
        let Stretch { piece, from, to } = stretch;
        let Some(along) = reduced.edge.get(piece).filter(|_| from < to) else {
            continue;
        };
        if step % 256 == 255 {
            task.check()?;
        }
        match look(expansion, along, from, to) {
            Look::Clear => {}
            Look::Wide(parts) => {
                shares.get_or_insert(parts);
                failed.push(stretch);
            }
            Look::Long => {
                let middle = from + 0.5 * (to - from);
                left.push(Stretch {
                    from: middle,
                    ..stretch
                });
                left.push(Stretch {
                    to: middle,
                    ..stretch
                });
            }
        }
        if failed.len() >= FAILURES || step >= LOOKS {
            break;
        }
    }
    if failed.is_empty() && left.is_empty() {
        return Ok(Examined::Clear);
    }
    left.extend(failed);
    // No stretch failed, but the limit on tests was reached.
    Ok(Examined::Open(
        largest(&shares.unwrap_or(expansion.half)),
        Some(left),
    ))
}

/// The pieces of the edge as far as they lie within a radius.
fn stretches_within(edge: &[Piece], radius: f64) -> Vec<Stretch> {
    let pieces = edge.iter().enumerate().rev();
    let stretches = pieces.map(|(piece, own)| {
        let top = if own.from == Complex64::ZERO {
            radius
        } else {
            own.within(radius)
        };
        Stretch {
            piece,
            from: 0.0,
            to: own.length.min(top),
        }
    });
    stretches.filter(|stretch| stretch.to > 0.0).collect()
}

/// The index of the largest share, if one is above zero.
fn largest<const D: usize>(shares: &[f64; D]) -> Option<usize> {
    let mut best = (0.0, None);
    for (index, share) in shares.iter().enumerate() {
        if *share > best.0 {
            best = (*share, Some(index));
        }
    }
    best.1
}

/// What is proved or found for a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Finding {
    /// Every member is stable.
    Stable,
    /// At least one member has this number of unstable roots, or [`ENDLESS`].
    Unstable(i32),
    /// Neither could be proved.
    Unknown,
}

/// Prove that every member of a box is stable, in at most the given number of boxes, or find one
/// that is not.
pub(crate) fn find_unstable<const D: usize>(
    reduced: &Reduced<'_, D>,
    range: Range<D>,
    boxes: usize,
    expansion: &mut BoxExpansion<D>,
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
        match judge_box(reduced, &claim, expansion, task)? {
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
