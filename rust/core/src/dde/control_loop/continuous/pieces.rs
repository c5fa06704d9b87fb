//! The delayed command as a queue of pieces, and the order of the breaks between them.
//!
//! Every break returns one delay later, one order smoother (in a neutral loop, with the same
//! order), so that the number of pieces in one delay grows with every jump. Two neighbours whose
//! polynomials are the same function to rounding are merged into one piece, so that a break that
//! has become smaller than rounding errors costs nothing.

use std::collections::VecDeque;

use crate::Error;
use crate::dde::limits::slack;
use crate::dde::scalar::{Scalar, is_reached, part_ways};
use crate::memory::push_back;

use crate::dde::control_loop::linear_loop::LinearLoop;
use crate::dde::control_loop::series::{DEGREE, Series};

/// Upper limit on the pieces in the queue (bounds memory and time).
const MOST_PIECES: usize = 1_000_000;

/// No break.
pub(super) const SMOOTH: Order = u8::MAX;

/// Highest order of a break that is reported; breaks of higher order are too small to be seen in a
/// plot or a fit.
pub(super) const REPORTED: Order = 10;

/// Two polynomials are merged if the sum of the differences of their coefficients is below this
/// share of the largest one.
const SAME: f64 = 4.0 * f64::EPSILON;

/// The same for slopes, which have rounding errors of products with values. Slopes are derivatives
/// with respect to a parameter in units of its own size, so that both are comparable.
const SAME_SLOPE: f64 = 256.0 * f64::EPSILON;

/// Factor by which the recorded longest length shrinks with each piece.
const FORGET: f64 = 0.998;

/// The lowest derivative that jumps at a breaking point; [`SMOOTH`] where none does.
pub(super) type Order = u8;

/// w(t) = series((t − origin)/scale) from `start` to `end`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece<S = f64> {
    pub(super) start: S,
    pub(super) end: S,
    pub(super) origin: S,
    pub(super) scale: S,
    pub(super) series: Series<S>,
    /// Order of the break at the start of the piece.
    pub(super) order: Order,
}

impl<S: Scalar> Piece<S> {
    pub(super) fn constant(value: S, end: S) -> Self {
        Self {
            start: S::default(),
            end,
            origin: S::default(),
            scale: S::from(1.0),
            series: Series::constant(value),
            order: SMOOTH,
        }
    }

    /// Write w over [t, t + h] as a polynomial in σ ∈ [0, 1].
    pub(super) fn in_local_time(&self, t: S, h: S, local: &mut Series<S>) {
        local.copy_from(&self.series);
        if self.series.degree == 0 {
            return;
        }
        let offset = (t - self.origin) / self.scale;
        let offset = if offset.value().abs() <= f64::EPSILON {
            offset.pinned(0.0)
        } else {
            offset
        };
        local.shift(offset, h / self.scale);
    }

    /// Is the other piece a continuation of this one?
    fn continues_as(&self, other: &Self) -> bool {
        let length = other.end - other.start;
        let (mut mine, mut theirs) = (self.series, other.series);
        self.in_local_time(other.start, length, &mut mine);
        other.in_local_time(other.start, length, &mut theirs);
        let (mut difference, mut largest) = (0.0, 0.0_f64);
        let (mut apart, mut steepest) = (0.0, 0.0_f64);
        for (&mine, &theirs) in mine.coefficients.iter().zip(&theirs.coefficients) {
            difference += (mine - theirs).value().abs();
            largest = largest.max(theirs.value().abs());
            apart += (mine - theirs).slope().abs();
            steepest = steepest.max(theirs.slope().abs());
        }
        difference <= SAME * largest && apart <= SAME_SLOPE * (steepest + largest)
    }
}

/// The remaining pieces in order.
#[derive(Debug)]
pub(super) struct Pieces<S = f64> {
    /// The command before the run, in front of the queue until it has passed.
    first: Piece<S>,
    has_passed: bool,
    queue: VecDeque<Box<Piece<S>>>,
    /// Pieces that have passed, whose memory is used again.
    spare: Vec<Box<Piece<S>>>,
    end: S,
    delay: S,
    /// Length of the longest of the latest pieces. Two pieces that are longer together are not
    /// merged, because they would be cut again.
    longest: f64,
    /// Order of a break inside a piece too short to be stored.
    dropped: Order,
}

impl<S: Scalar> Pieces<S> {
    /// The constant `command` until the first command of the run arrives.
    pub(super) fn new(command: S, delay: S) -> Self {
        Self {
            first: Piece::constant(command, delay),
            has_passed: false,
            queue: VecDeque::new(),
            spare: Vec::new(),
            end: delay,
            delay,
            longest: 0.0,
            dropped: SMOOTH,
        }
    }

    pub(super) fn front(&self) -> &Piece<S> {
        let front = self.queue.front().filter(|_| self.has_passed);
        front.map_or(&self.first, |front| &**front)
    }

    /// A piece to fill and to [`push`](Self::push).
    pub(super) fn blank(&mut self) -> Box<Piece<S>> {
        self.spare
            .pop()
            .unwrap_or_else(|| Box::new(Piece::constant(S::default(), S::default())))
    }

    /// Remove what ends at `t`; returns the order of the break that is passed. The last piece
    /// stays.
    pub(super) fn reach(&mut self, t: S) -> Order {
        let mut order = SMOOTH;
        while is_reached(self.front().end, t, slack(t, self.delay))
            && self.queue.len() > usize::from(self.has_passed)
        {
            if self.has_passed {
                self.spare.extend(self.queue.pop_front());
            }
            self.has_passed = true;
            order = order.min(self.front().order);
        }
        order
    }

    /// Append a piece. A piece shorter than rounding errors is given to its neighbour, and equal
    /// constants are merged.
    pub(super) fn push(&mut self, mut piece: Box<Piece<S>>) -> Result<(), Error> {
        self.longest = (FORGET * self.longest).max((piece.end - piece.start).value());
        piece.order = piece.order.min(self.dropped);
        let is_dust = (piece.end - self.end).value() <= slack(piece.end, self.delay)
            && !part_ways(piece.end, self.end);
        let last = match self.queue.back_mut() {
            Some(last) => &mut **last,
            None => &mut self.first,
        };
        let is_same = last.series.degree == 0 && last.series == piece.series;
        self.end = piece.end;
        if is_dust {
            self.dropped = piece.order;
            last.end = piece.end;
            self.spare.push(piece);
            return Ok(());
        }
        self.dropped = SMOOTH;
        let is_faded = piece.order > REPORTED && (piece.end - last.start).value() <= self.longest;
        if is_same || (is_faded && last.continues_as(&piece)) {
            last.end = piece.end;
            self.spare.push(piece);
            return Ok(());
        }
        if is_faded && piece.continues_as(last) {
            *last = Piece {
                start: last.start,
                order: last.order,
                ..*piece
            };
            self.spare.push(piece);
            return Ok(());
        }
        if self.queue.len() >= MOST_PIECES {
            return Err(Error::TooMuch {
                what: "the continuous response",
                limit: MOST_PIECES as u64,
                unit: "pieces of the command in one delay",
                advice:
                    "simulate a shorter time or fewer reference jumps, and set lags close to zero \
                     to exactly zero"
                        .to_owned(),
            });
        }
        push_back("the command in one delay", &mut self.queue, piece)
    }
}

/// The orders of breaks behind the loop: an integration raises the order by one, a direct path
/// keeps it.
pub(super) struct Orders {
    command_is_direct: bool,
    output_is_direct: bool,
    reference_in_command: Order,
    reference_in_output: Order,
}

impl Orders {
    pub(super) fn new<S: Scalar>(plant: &LinearLoop<S>) -> Self {
        let equations = plant.equations();
        let reaches_states = !equations.e.iter().all(|e| e.is_nothing());
        Self {
            command_is_direct: !equations.l.is_nothing(),
            output_is_direct: !equations.d.is_nothing(),
            reference_in_command: match (!equations.m.is_nothing(), reaches_states) {
                (true, _) => 0,
                (false, true) => 1,
                (false, false) => SMOOTH,
            },
            reference_in_output: if reaches_states { 1 } else { SMOOTH },
        }
    }

    /// Order of the break of the command where w breaks with order `arriving` and the reference may
    /// jump.
    pub(super) fn of_command(&self, arriving: Order, jumps: bool) -> Order {
        let jump = jumps.then_some(self.reference_in_command);
        Self::pass(arriving, self.command_is_direct).min(jump.unwrap_or(SMOOTH))
    }

    /// Order of the break of the output, likewise.
    pub(super) fn of_output(&self, arriving: Order, jumps: bool) -> Order {
        let jump = jumps.then_some(self.reference_in_output);
        Self::pass(arriving, self.output_is_direct).min(jump.unwrap_or(SMOOTH))
    }

    fn pass(arriving: Order, direct: bool) -> Order {
        let order = if direct {
            arriving
        } else {
            arriving.saturating_add(1)
        };
        if usize::from(order) > DEGREE {
            SMOOTH
        } else {
            order
        }
    }
}
