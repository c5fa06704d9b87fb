//! Ranges of parameters divided into boxes with a proved number of unstable roots.
//!
//! A box that cannot be proved is halved along the parameter that contributes most to the bound;
//! the largest boxes come first. The division ends when the undecided boxes together are no more
//! than the wanted share of the ranges, or there are too many boxes. Boxes are judged in groups of
//! a fixed size, in parallel, and their results are used in order, so that the tree is the same for
//! any number of threads.
//!
//! Proved means: every member of the closed box, with the family's coefficients taken as exact, has
//! that many roots with Re s > 0 and none on the axis (or infinitely many to its right, in the
//! sense in which [`crate::stability::Cell`] judges chains).

use std::collections::VecDeque;

use super::box_expansion::{BoxExpansion, Range};
use super::prove::{Claim, Verdict, judge_box};
use super::reduced::Reduced;
use crate::parallel;
use crate::stability::cell::UNKNOWN;
use crate::stability::family::Family;
use crate::{Error, Task, memory};

/// Upper limit on the parameters that may vary (the number of boxes grows exponentially with it).
const MOST_PARAMETERS: usize = 3;

/// Boxes judged in one group. A larger group keeps more threads busy and judges more boxes than
/// necessary at the end.
const GROUP: usize = 128;

/// What memory is requested for, in errors.
const BOXES: &str = "the list of boxes";

/// When to stop the division.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Share of the ranges that may stay undecided.
    pub undecided: f64,
    /// Upper limit on the number of boxes.
    pub boxes: usize,
}

/// A node of the tree of boxes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// A box, by its index.
    Leaf(usize),
    /// Divided at `at`; `first` is the node of the lower half, the node of the upper half follows
    /// it.
    Halved {
        /// The index of the parameter.
        parameter: usize,
        /// Where it is divided.
        at: f64,
        /// The node of the lower half.
        first: usize,
    },
}

/// Result of [`proved_boxes`]. Ends have one entry for each box and parameter, those of a box next
/// to each other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Boxes {
    /// Lower ends.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// Number of unstable roots for each box; −1 for infinitely many, −2 where undecided.
    pub unstable: Vec<i32>,
    /// The tree, root first.
    pub nodes: Vec<Node>,
    /// Share of the ranges that is undecided.
    pub undecided: f64,
}

/// Divide `ranges`, one for each parameter of the family, into proved boxes.
///
/// At most three ranges may have a positive width.
///
/// # Errors
/// [`Error::Argument`] for ranges that are not finite or reversed, too many of them, a delay that
/// becomes negative, or a root at 0 of all members; [`Error::Interrupted`].
///
/// ```
/// use deadtime::Task;
/// use deadtime::stability::{Affine, Family, Limits, Term, proved_boxes};
/// // s + K e^(−s) is stable for 0 < K < π/2.
/// let term = |exponent, power, constant| Term {
///     coefficient: 1.0,
///     exponents: vec![exponent],
///     power,
///     delay: Affine { constant, slopes: vec![0.0] },
/// };
/// let family = Family::new(vec!["K".into()], vec![term(0, 1, 0.0), term(1, 0, 1.0)])?;
/// let limits = Limits { undecided: 1e-3, boxes: 1000 };
/// let boxes = proved_boxes(&family, &[(0.0, 2.0)], limits, &Task::new())?;
/// assert!(boxes.undecided <= 1e-3);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn proved_boxes(
    family: &Family,
    ranges: &[(f64, f64)],
    limits: Limits,
    task: &Task,
) -> Result<Boxes, Error> {
    let varying = check(family, ranges)?;
    match varying.len() {
        0 | 1 => Tree::<1>::grow(family, ranges, &varying, limits, task),
        2 => Tree::<2>::grow(family, ranges, &varying, limits, task),
        _ => Tree::<3>::grow(family, ranges, &varying, limits, task),
    }
}

/// The indices of the parameters that vary, after a check of the ranges.
pub(crate) fn check(family: &Family, ranges: &[(f64, f64)]) -> Result<Vec<usize>, Error> {
    refuse_if!(
        ranges.len() != family.names().len(),
        "{} ranges are given for {} parameters ({}): give one range for each parameter",
        ranges.len(),
        family.names().len(),
        family.names().join(", ")
    );
    for (name, (low, high)) in family.names().iter().zip(ranges) {
        refuse_if!(
            !(low.is_finite() && high.is_finite() && (high - low).is_finite() && low <= high),
            "{name} from {low} to {high}: give a range with finite ends, the smaller one first"
        );
    }
    family.check_delays(ranges)?;
    let varying: Vec<usize> = ranges
        .iter()
        .enumerate()
        .filter(|(_, (low, high))| low < high)
        .map(|(index, _)| index)
        .collect();
    refuse_if!(
        varying.len() > MOST_PARAMETERS,
        "{} parameters vary ({}), but boxes have at most {MOST_PARAMETERS}: give the other \
         parameters a value",
        varying.len(),
        family.names().join(", ")
    );
    Ok(varying)
}

/// The family over the parameters that vary, and their ranges.
pub(crate) fn reduce<'a, const D: usize>(
    family: &'a Family,
    ranges: &[(f64, f64)],
    varying: &[usize],
) -> Result<(Reduced<'a, D>, Range<D>), Error> {
    let values: Vec<f64> = ranges.iter().map(|range| range.0).collect();
    let mut reduced = Reduced::new(family, &values, varying);
    reduced.refuse_root_at_zero()?;
    let mut whole = Range {
        low: [0.0; D],
        high: [0.0; D],
    };
    let ends = varying.iter().filter_map(|index| ranges.get(*index));
    for ((low, high), range) in whole.low.iter_mut().zip(&mut whole.high).zip(ends) {
        (*low, *high) = *range;
    }
    reduced.refer_to_first(&whole.centre());
    Ok((reduced, whole))
}

/// A box that is still to be judged.
struct Waiting<const D: usize> {
    claim: Claim<D>,
    node: usize,
    share: f64,
}

struct Tree<'a, const D: usize> {
    reduced: Reduced<'a, D>,
    boxes: Boxes,
}

impl<'a, const D: usize> Tree<'a, D> {
    fn grow(
        family: &'a Family,
        ranges: &[(f64, f64)],
        varying: &[usize],
        limits: Limits,
        task: &Task,
    ) -> Result<Boxes, Error> {
        let (reduced, whole) = reduce(family, ranges, varying)?;
        let mut tree = Self {
            reduced,
            boxes: Boxes {
                nodes: vec![Node::Leaf(0)],
                undecided: 1.0,
                ..Boxes::default()
            },
        };
        let mut waiting = VecDeque::from([Waiting {
            claim: Claim::new(whole),
            node: 0,
            share: 1.0,
        }]);
        while tree.boxes.undecided > limits.undecided && !waiting.is_empty() {
            // Judging a box adds at most one box.
            let margin = limits
                .boxes
                .saturating_sub(tree.boxes.unstable.len() + waiting.len());
            if margin == 0 {
                break;
            }
            let size = GROUP.min(waiting.len()).min(margin);
            let group: Vec<Waiting<D>> = waiting.drain(..size).collect();
            let verdicts = tree.judge(&group, task)?;
            for (judged, verdict) in group.into_iter().zip(verdicts) {
                tree.file(judged, verdict, &mut waiting)?;
            }
        }
        for left in waiting {
            tree.leaf(&left, UNKNOWN)?;
        }
        Ok(tree.boxes)
    }

    fn judge(&self, group: &[Waiting<D>], task: &Task) -> Result<Vec<Verdict>, Error> {
        let start = || BoxExpansion::new(&self.reduced);
        let found = parallel::results("the boxes", group.len(), start, |expansion, index| {
            let Some(waiting) = group.get(index) else {
                return Ok(None);
            };
            let verdict = judge_box(&self.reduced, &waiting.claim, expansion, task)?;
            task.advance(1);
            Ok(Some(verdict))
        })?;
        Ok(found.into_iter().flatten().collect())
    }

    fn file(
        &mut self,
        judged: Waiting<D>,
        verdict: Verdict,
        waiting: &mut VecDeque<Waiting<D>>,
    ) -> Result<(), Error> {
        let (parameter, stretches) = match verdict {
            Verdict::Proved(count) => {
                self.boxes.undecided -= judged.share;
                return self.leaf(&judged, count);
            }
            Verdict::Stuck => return self.leaf(&judged, UNKNOWN),
            Verdict::Halve(parameter, stretches) => (parameter, stretches),
        };
        let Some((at, halves)) = judged.claim.range.halves(parameter) else {
            return self.leaf(&judged, UNKNOWN);
        };
        let first = self.boxes.nodes.len();
        if let Some(node) = self.boxes.nodes.get_mut(judged.node) {
            *node = Node::Halved {
                parameter: self.reduced.place(parameter),
                at,
                first,
            };
        }
        for (range, node) in halves.into_iter().zip(first..) {
            memory::push(BOXES, &mut self.boxes.nodes, Node::Leaf(0))?;
            memory::push_back(
                BOXES,
                waiting,
                Waiting {
                    claim: Claim {
                        range,
                        stretches: stretches.clone(),
                    },
                    node,
                    share: 0.5 * judged.share,
                },
            )?;
        }
        Ok(())
    }

    fn leaf(&mut self, one: &Waiting<D>, unstable: i32) -> Result<(), Error> {
        if let Some(node) = self.boxes.nodes.get_mut(one.node) {
            *node = Node::Leaf(self.boxes.unstable.len());
        }
        memory::push(BOXES, &mut self.boxes.unstable, unstable)?;
        let Range { low, high } = &one.claim.range;
        memory::append(BOXES, &mut self.boxes.low, &self.reduced.values_at(low))?;
        memory::append(BOXES, &mut self.boxes.high, &self.reduced.values_at(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::Specification;
    use crate::stability::{Affine, Term, judge, largest_stable_box, stability_radius};

    /// s + (Kp + Kv s) e^(−s T)
    fn velocity() -> Family {
        let term = |exponents: [u32; 3], power, slope| Term {
            coefficient: 1.0,
            exponents: exponents.to_vec(),
            power,
            delay: Affine {
                constant: 0.0,
                slopes: vec![0.0, 0.0, slope],
            },
        };
        let terms = vec![
            term([0, 0, 0], 1, 0.0),
            term([1, 0, 0], 0, 1.0),
            term([0, 1, 0], 1, 1.0),
        ];
        Family::new(["Kp", "Kv", "T"].map(str::to_owned).to_vec(), terms).unwrap()
    }

    fn limits(undecided: f64, boxes: usize) -> Limits {
        Limits { undecided, boxes }
    }

    /// Every corner and the centre of each proved box has its count.
    fn members_agree(family: &Family, boxes: &Boxes, every: usize) {
        let count = family.names().len();
        let corners = boxes.low.chunks(count).zip(boxes.high.chunks(count));
        let proved = corners.zip(&boxes.unstable).filter(|(_, n)| **n != UNKNOWN);
        for ((low, high), unstable) in proved.step_by(every) {
            for corner in 0..(1 << count) {
                let ends = |i: usize| [low[i], high[i]][corner >> i & 1];
                let values: Vec<f64> = (0..count).map(ends).collect();
                let h = family.at(&values).unwrap();
                let cell = judge(&h, Specification::default(), false, &Task::new());
                assert_eq!(cell.unwrap().unstable, *unstable);
            }
        }
    }

    #[test]
    fn members_of_proved_boxes_have_their_count() {
        let family = velocity();
        for ranges in [
            [(0.0, 6.0), (-1.0, 1.0), (0.36, 0.36)],
            [(-9.0, 9.0), (-1.5, 1.5), (0.2, 0.2)],
            [(-1.0, 6.0), (0.3, 0.3), (0.0, 1.0)],
            [(0.0, 6.0), (-0.9, 0.9), (0.3, 0.5)],
        ] {
            let found = proved_boxes(&family, &ranges, limits(0.03, 50_000), &Task::new()).unwrap();
            assert!(found.undecided <= 0.03);
            members_agree(&family, &found, 7);
        }
    }

    #[test]
    fn the_number_of_boxes_and_their_volume_are_as_said() {
        let ranges = [(0.0, 6.0), (-1.0, 1.0), (0.36, 0.36)];
        let found = proved_boxes(&velocity(), &ranges, limits(0.0, 300), &Task::new()).unwrap();
        assert_eq!(found.unstable.len(), 300);
        assert_eq!(found.nodes.len(), 599);
        let sides = found.low.chunks(3).zip(found.high.chunks(3));
        let volumes = sides.map(|(low, high)| (high[0] - low[0]) * (high[1] - low[1]) / 12.0);
        let (mut all, mut unknown) = (0.0, 0.0);
        for (volume, unstable) in volumes.zip(&found.unstable) {
            all += volume;
            unknown += if *unstable == UNKNOWN { volume } else { 0.0 };
        }
        assert!((all - 1.0f64).abs() < 1e-12 && (unknown - found.undecided).abs() < 1e-12);
    }

    #[test]
    fn ranges_without_sense_are_refused() {
        let task = Task::new();
        let family = velocity();
        for ranges in [
            vec![(0.0, 1.0)],
            vec![(1.0, 0.0), (0.0, 0.0), (0.1, 0.1)],
            vec![(0.0, f64::NAN), (0.0, 0.0), (0.1, 0.1)],
            vec![(f64::MIN, f64::MAX), (0.0, 0.0), (0.1, 0.1)],
            vec![(0.0, 1.0), (0.0, 0.0), (-0.1, 0.1)],
            vec![(0.0, 0.0), (0.0, 1.0), (0.1, 0.1)],
        ] {
            let refused = proved_boxes(&family, &ranges, limits(0.1, 100), &task);
            assert!(matches!(refused, Err(Error::Argument(_))), "{ranges:?}");
        }
    }

    #[test]
    fn a_stopped_task_stops() {
        let task = Task::new();
        task.stop();
        let ranges = [(0.0, 6.0), (-1.0, 1.0), (0.36, 0.36)];
        let found = proved_boxes(&velocity(), &ranges, limits(0.0, 1000), &task);
        assert_eq!(found, Err(Error::Interrupted));
    }

    #[test]
    fn the_radius_is_that_of_the_closed_form() {
        // Kv = 0: stable for Kp T < π/2. The radius is where both parameters have grown by it.
        let point = [2.0, 0.0, 0.36];
        let limits = (1e-6, 100_000);
        let found = stability_radius(&velocity(), &point, &point, limits, &Task::new()).unwrap();
        let truth = (0.5 * std::f64::consts::PI / 0.72).sqrt() - 1.0;
        assert!(found.radius <= truth && truth <= found.upper);
        assert!(found.upper <= found.radius * (1.0 + 2e-6));
    }

    #[test]
    fn the_largest_box_of_one_parameter_is_the_stable_interval() {
        let ranges = [(-3.0, 9.0), (0.0, 0.0), (0.5, 0.5)];
        let found = largest_stable_box(&velocity(), &ranges, None, 1e-9, &Task::new());
        let (low, high) = found.unwrap().unwrap()[0];
        assert!(low > 0.0 && low < 1e-7 && high < std::f64::consts::PI);
        assert!(high > std::f64::consts::PI - 1e-7);
    }
}
