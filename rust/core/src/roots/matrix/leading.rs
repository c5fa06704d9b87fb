//! The rightmost roots from guesses, with one line that proves that no other lies to its right.
//!
//! The guesses become discs by Newton's iteration. A line is taken in the widest gap left of the
//! roots wanted and followed; if the count of the half plane is that of the discs, all is proved.
//! Otherwise the points where the line comes closest to a root are further guesses. Where this does
//! not lead to an agreement, the line is handed to the search by lines (`locating::lines`).

use num_complex::Complex64;

use super::laguerre::towards_root;
use super::prepared::Prepared;
use super::starts::starts;
use super::walker::{MOST_WITH_CLUSTERS, MatrixWalker};
use crate::order::sort_down;
use crate::roots::disc::{Disc, with_mirror_image};
use crate::roots::locating::{Effort, Line, Search, Spectrum, first};
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Upper limit on the lines followed.
const MAX_LINES: usize = 4;

/// Guesses from which Newton's iteration starts, in addition to one for every root wanted. More:
/// a wider gap may be found; fewer: fewer iterations.
const MORE_STARTS: usize = 1;

/// Upper limit on the hints of a line from which it starts.
const MAX_HINTS: usize = 24;

/// Factorisations after which the lines and the iterations are abandoned.
const LINE_LIMIT: u64 = 3_000;

/// Position of the line in the gap, as a share of its width.
const POSITION: f64 = 0.45;

/// Least part of the widest gap that is taken although a wider one lies further left, where the line
/// is closer to more roots. Larger: wider gaps; smaller: fewer roots to enclose.
const WIDE: f64 = 0.3;

/// Distance right of a line from which roots are sought that no guess led to, in units of one over the
/// longest delay. Larger: roots closer by are passed; smaller: those left of the line are found.
const ASIDE: f64 = 0.1;

/// The outcome of a search from guesses.
pub(super) enum Found {
    Proved(RootSet),
    /// Not proved; a line that was counted on the way, and a place where roots are too close together
    /// to be enclosed, if there are such.
    Open(Option<Line>, Option<Complex64>),
}

/// The `n` rightmost roots right of `chain`.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn from_guesses(
    prepared: &Prepared<'_>,
    n: usize,
    chain: f64,
    task: &Task,
) -> Result<Found, Error> {
    let mut walker = MatrixWalker::new(prepared.system, task, LINE_LIMIT);
    let step = 1.0 / prepared.system.longest();
    let mut guesses = starts(prepared.system, &mut walker);
    let mut others = guesses.split_off(guesses.len().min(n + MORE_STARTS));
    let mut ahead: Vec<f64> = others.iter().map(|s| s.re).collect();
    let mut search = Search::new(&mut walker);
    let mut last = None;
    for _ in 0..MAX_LINES {
        for guess in &guesses {
            if search.knows(*guess) {
                continue;
            }
            match search.iterate_from(&[*guess], |s| s.is_finite()) {
                Err(error) if error.ends_all() => return Err(error),
                Err(_) => return Ok(open(last, &search)),
                Ok(()) => {}
            }
        }
        let Some(sigma) = line_beside(search.found(), n, &ahead, chain, step) else {
            return Ok(open(last, &search));
        };
        // Steps are short near clusters, but what encloses them does not count the others.
        let has_cluster = search.found().iter().any(|disc| disc.multiplicity > 1);
        let effort = Effort {
            limit: if has_cluster {
                MOST_WITH_CLUSTERS
            } else {
                LINE_LIMIT
            },
            double_double: false,
        };
        let (count, hints) = match prepared.line(sigma, effort, task) {
            Err(error) if error.ends_all() => return Err(error),
            Err(_) => return Ok(open(last, &search)),
            Ok(found) => found,
        };
        if search.weight_right_of(sigma) == count {
            let right = |disc: &&Disc| disc.center.re - disc.radius > sigma;
            let discs = search.found().iter().filter(right).copied().collect();
            return Ok(Found::Proved(first(discs, n, sigma)));
        }
        // The guesses missed some roots; only what is proved counts from here on.
        ahead.clear();
        guesses.clone_from(&hints);
        sort_down(&mut guesses, |guess| guess.re);
        guesses.truncate(MAX_HINTS);
        let known: Vec<Complex64> = with_images(search.found());
        for place in guesses.clone() {
            let right = Complex64::new(place.re.max(sigma) + ASIDE * step, place.im);
            match towards_root(search.walker_mut(), &known, right) {
                Ok(nearer) => guesses.push(nearer),
                Err(error) if error.ends_all() => return Err(error),
                Err(_) => return Ok(open(last, &search)),
            }
        }
        guesses.extend(others.drain(..).filter(|guess| guess.re > sigma - step));
        last = Some(Line {
            sigma,
            count,
            hints,
        });
    }
    Ok(open(last, &search))
}

/// The roots of discs and of their mirror images.
fn with_images(discs: &[Disc]) -> Vec<Complex64> {
    let images = discs.iter().copied().flat_map(with_mirror_image);
    images.map(|disc| disc.center).collect()
}

fn open(line: Option<Line>, search: &Search<'_, MatrixWalker<'_>>) -> Found {
    Found::Open(line, search.walker().stalled.first().copied())
}

/// A line left of at least `n` of the discs. `ahead` are guesses of real parts of further roots.
///
/// Left of the last one of them all is unknown, so that a gap between two of them is preferred.
fn line_beside(discs: &[Disc], n: usize, ahead: &[f64], chain: f64, step: f64) -> Option<f64> {
    let mut sorted: Vec<(f64, f64)> = discs
        .iter()
        .map(|disc| (disc.center.re - disc.radius, disc.center.re + disc.radius))
        .collect();
    sort_down(&mut sorted, |disc| disc.0);
    let gap = |k: usize, edge: f64| {
        let known = sorted.get(k + 1).map(|disc| disc.1);
        let guessed = ahead.iter().copied().filter(|re| *re < edge);
        let next = known.into_iter().chain(guessed).fold(chain, f64::max);
        (edge, (edge - next).min(step))
    };
    let edges = sorted.iter().enumerate().skip(n.saturating_sub(1));
    let mut gaps: Vec<(f64, f64)> = edges.map(|(k, disc)| gap(k, disc.0)).collect();
    if gaps.len() > 1 && ahead.is_empty() {
        gaps.pop();
    }
    let widest = gaps.iter().fold(0.0f64, |a, gap| a.max(gap.1));
    let wide = |gap: &&(f64, f64)| gap.1 >= WIDE * widest && gap.1 > 0.0;
    let (edge, width) = gaps.iter().find(wide)?;
    Some(edge - POSITION * width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_lies_in_the_first_wide_gap() {
        let disc = |re: f64| Disc {
            center: Complex64::new(re, 1.0),
            radius: 0.0,
            isolation: 0.1,
            multiplicity: 1,
        };
        let discs = [disc(1.0), disc(0.9), disc(0.0)];
        let none = f64::NEG_INFINITY;
        let line = line_beside(&discs, 1, &[], none, 2.0).unwrap();
        assert_eq!(line, 0.9 - POSITION * 0.9);
        let line = line_beside(&discs, 1, &[-0.8], none, 2.0).unwrap();
        assert_eq!(line, 0.9 - POSITION * 0.9);
        let line = line_beside(&discs, 1, &[-3.5], none, 4.0).unwrap();
        assert_eq!(line, -POSITION * 3.5);
        assert_eq!(
            line_beside(&discs[..1], 1, &[], none, 2.0),
            Some(1.0 - POSITION * 2.0)
        );
        assert_eq!(line_beside(&discs, 4, &[], none, 2.0), None);
    }
}
