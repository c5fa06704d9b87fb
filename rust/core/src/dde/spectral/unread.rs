//! What the nodes of an element leave unread of the past.
//!
//! An element represents each delayed value by the polynomial through its nodes. Where the delayed
//! element covers several stored pieces, or one of a higher degree, the stored solution is another
//! function, and its course between two nodes would be lost. Therefore each stretch of the past
//! that comes from one piece is compared with the polynomial through the nodes: both are
//! polynomials there, and their difference is known from as many Chebyshev points as its degree
//! needs, ends included. The right-hand side is not called. A stretch that the nodes do not resolve
//! ends the element at its start or, where it is the first one, at its end.

use super::chebyshev;
use super::element::Element;
use super::history::History;
use super::nodes::Nodes;
use super::problem::Problem;
use super::products::{Rows, multiply};
use super::sizes::{largest, largest_of};

/// Largest difference in tolerances: stored pieces and nodes both have errors of a share of one.
const UNREAD: f64 = 10.0;
/// Largest difference as a share of the values, where the tolerance is large.
const LOOSEST: f64 = 0.1;
/// Stretches no longer than this share of the time are rounding errors of it: breaking points this
/// close are merged.
const SHORTEST: f64 = 1024.0 * f64::EPSILON;
/// Part of a length by which the ends of a stretch differ from those of its piece by rounding.
const ONE_PIECE: f64 = 1e-13;
/// Rounding errors of values, summed by interpolation.
const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// A stretch of the past that the nodes do not resolve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unread {
    /// The difference relative to the allowed one.
    pub(super) error: f64,
    /// End of an element that resolves it; `None` where the element covers no other piece.
    pub(super) end: Option<f64>,
}

/// Memory for one run.
#[derive(Debug, Default)]
pub(super) struct Reading {
    /// Coefficients of the polynomial through the nodes, of its values and of its slopes.
    through: [Vec<f64>; 2],
    points: Vec<f64>,
    places: Vec<f64>,
    table: Vec<f64>,
    other: Vec<f64>,
    found: Vec<f64>,
    stored: Vec<f64>,
}

/// One piece of the past, as far as it is read.
struct Stretch<'a> {
    low: f64,
    high: f64,
    /// Start and end of the piece itself.
    span: (f64, f64),
    terms: usize,
    /// Coefficients of the values or of the slopes.
    rows: &'a [f64],
}

impl Stretch<'_> {
    /// Is it one whole piece, up to rounding errors of times?
    fn is_one_piece(&self) -> bool {
        let apart = (self.low - self.span.0)
            .abs()
            .max((self.high - self.span.1).abs());
        apart <= ONE_PIECE * (self.high - self.low)
    }
}

impl Reading {
    /// The first stretch that the nodes of a converged element do not resolve.
    pub(super) fn unread(
        &mut self,
        problem: &Problem,
        element: &Element,
        nodes: &Nodes,
        history: &History,
    ) -> Option<Unread> {
        let n = nodes.order + 1;
        let block = problem.dim() * n;
        for (j, delay) in problem.delays.iter().enumerate() {
            let z = &element.z[j * block..(j + 1) * block];
            let slopes = element.dz.chunks_exact(block.max(1)).nth(j);
            let window = (element.start - delay, element.end - delay);
            let times = [window.0, element.end, problem.start];
            let thin = SHORTEST * largest(&times);
            let mut index = history.locate(window.0 + thin)?;
            let mut low = window.0;
            let mut is_known = false;
            while low + thin < window.1 {
                // After the stored pieces comes the element itself.
                let piece = history.piece(index).filter(|_| low < element.start);
                let (span, terms, rows) = match piece {
                    Some(piece) => (
                        (piece.start, piece.end),
                        piece.terms,
                        &piece.coefficients[..],
                    ),
                    None => ((element.start, element.end), n, &element.coefficients[..]),
                };
                index += 1;
                let last = piece.is_none() || span.1 + thin >= window.1;
                let high = if last { window.1 } else { span.1 };
                let covers = last && low == window.0;
                if high - low <= thin || (covers && terms <= n) {
                    low = low.max(high);
                    if last {
                        break;
                    }
                    continue;
                }
                if !is_known {
                    for (through, values) in self.through.iter_mut().zip([Some(z), slopes]) {
                        through.resize(block, 0.0);
                        nodes.coefficients(values.unwrap_or(&[]), through);
                    }
                    is_known = true;
                }
                let mut stretch = Stretch {
                    low,
                    high,
                    span,
                    terms,
                    rows,
                };
                let mut error = self.compare(problem, element, nodes, (z, &stretch), window, None);
                if let (Some(dz), Some(piece)) = (slopes, piece) {
                    stretch.rows = &piece.slopes;
                    let values = Some((z, high - low));
                    let slope =
                        self.compare(problem, element, nodes, (dz, &stretch), window, values);
                    error = error.max(slope);
                }
                if error > 1.0 {
                    let end = if low - window.0 > thin {
                        Some(low + delay)
                    } else if window.1 - high > thin {
                        Some(high + delay)
                    } else {
                        None
                    };
                    return Some(Unread { error, end });
                }
                low = high;
            }
        }
        None
    }

    /// [`Reading::compare`] for a stretch that is one whole piece and all that the element reads: the
    /// sum of the differences of their coefficients bounds the difference.
    fn compare_whole(
        &self,
        problem: &Problem,
        element: &Element,
        nodes: &Nodes,
        (at_nodes, stretch): (&[f64], &Stretch<'_>),
    ) -> f64 {
        let n = nodes.order + 1;
        let pieces = stretch.rows.chunks_exact(stretch.terms);
        let mut worst = 0.0_f64;
        for (d, (through, own)) in self.through[0].chunks_exact(n).zip(pieces).enumerate() {
            let shared = through.iter().zip(own).map(|(a, b)| (a - b).abs());
            let rest = own.iter().skip(n).chain(through.iter().skip(own.len()));
            let off = shared.sum::<f64>() + rest.map(|c| c.abs()).sum::<f64>();
            let size = largest(&at_nodes[d * n..(d + 1) * n]);
            worst = worst.max(off / allowed(problem, element, d, size));
        }
        worst
    }

    /// The difference on a stretch relative to the allowed one. For slopes the allowed difference
    /// follows from that of the values, by Markov's inequality for the length of the stretch.
    fn compare(
        &mut self,
        problem: &Problem,
        element: &Element,
        nodes: &Nodes,
        (at_nodes, stretch): (&[f64], &Stretch<'_>),
        window: (f64, f64),
        slopes_of: Option<(&[f64], f64)>,
    ) -> f64 {
        let n = nodes.order + 1;
        let m = n.max(stretch.terms) + 1;
        let (low, high) = (stretch.low, stretch.high);
        if slopes_of.is_none() && (low, high) == window && stretch.is_one_piece() {
            return self.compare_whole(problem, element, nodes, (at_nodes, stretch));
        }
        self.points.clear();
        self.places.clear();
        for i in 0..m {
            let angle = std::f64::consts::PI * i as f64 / (m - 1) as f64;
            let time = 0.5 * (low + high) - 0.5 * (high - low) * angle.cos();
            self.points.push(place(window, time));
            self.places.push(place(stretch.span, time));
        }
        chebyshev::basis(&self.points, n, &mut self.table);
        chebyshev::basis(&self.places, stretch.terms, &mut self.other);
        self.found.resize(m, 0.0);
        self.stored.resize(m, 0.0);
        let through = &self.through[usize::from(slopes_of.is_some())];
        let pieces = stretch.rows.chunks_exact(stretch.terms);
        let mut worst = 0.0_f64;
        for (d, (through, own)) in through.chunks_exact(n).zip(pieces).enumerate() {
            let (all, found) = (Rows::of(m), &mut self.found);
            multiply((through, Rows::of(n)), &self.table, m, (found, all));
            let stored = &mut self.stored;
            multiply(
                (own, Rows::of(stretch.terms)),
                &self.other,
                m,
                (stored, all),
            );
            let off = largest_of(&self.found, &self.stored, |a, b| a - b);
            let own = largest(&self.stored);
            let row = d * n..(d + 1) * n;
            let (size, part) = match slopes_of {
                None => (own.max(largest(&at_nodes[row])), 1.0),
                Some((values, length)) => {
                    let rough = length * own.max(largest(&at_nodes[row.clone()]));
                    (
                        rough.max(largest(&values[row])),
                        length / (2 * n * n) as f64,
                    )
                }
            };
            worst = worst.max(off * part / allowed(problem, element, d, size));
        }
        worst
    }
}

/// The allowed difference of component `d`, of this size.
fn allowed(problem: &Problem, element: &Element, d: usize, size: f64) -> f64 {
    let ratio = UNREAD.min((LOOSEST / problem.rtol).max(1.0));
    let atol = problem.atol.get(d).or(problem.atol.first());
    let local = atol.copied().unwrap_or(0.0) + problem.rtol * size;
    let allowed = (ratio * local.max(element.scale[d])).max(ROUNDING * size);
    allowed.max(f64::MIN_POSITIVE)
}

/// Place of a time on [−1, 1].
fn place((start, end): (f64, f64), time: f64) -> f64 {
    ((time - start) - (end - time)) / (end - start)
}
