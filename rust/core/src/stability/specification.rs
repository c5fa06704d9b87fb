//! The specification for the roots: decay, and damping of those that decay slowly.
//!
//! A root s violates it if Re s > −σ, or, with a damping ratio ζ₀ and a horizon d, if Re s > −d and
//! its own damping ratio −Re s/|s| is below ζ₀. Without the horizon no equation could meet it: the
//! chains of a retarded equation follow Re s ≈ −log|s|/τ, so that their damping ratios tend to 0.
//! The edge of the excluded region is, in the upper half plane, the line Re s = −σ up to the ray of
//! ζ₀, this ray, and the line Re s = −d from there on; its lower half mirrors it.

use num_complex::Complex64;

use crate::Error;
use crate::roots::RootSet;

/// Covers the rounding errors of the length of the edge within a disc.
const ENLARGED: f64 = 1.0 + 1e-9;

/// Least length of a piece within a disc, relative to its radius, because a piece must not be empty.
/// Larger: more of the edge is followed in vain; smaller: rounding may make a piece empty.
const LEAST_LENGTH: f64 = 1e-3;

/// Rounding error of the distance of a root from the edge, relative to its modulus.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Least damping ratio of the roots right of −`horizon`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Damping {
    /// ζ₀, between 0 and 1.
    pub ratio: f64,
    /// d, 1/s.
    pub horizon: f64,
}

/// What every root has to satisfy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Specification {
    /// σ: all real parts must be below −σ, 1/s.
    pub decay: f64,
    /// The damping, if required.
    pub damping: Option<Damping>,
}

/// A straight piece of the edge: the points `from` + t `along`, 0 ≤ t ≤ `length`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    pub(super) from: Complex64,
    /// Unit vector, pointing upwards: Im s grows along the edge.
    pub(super) along: Complex64,
    /// Infinite for the last piece.
    pub(super) length: f64,
}

/// A part of the edge below the imaginary part at which h is real again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    pub(super) piece: Piece,
    /// Is h real where it begins?
    pub(super) from_axis: bool,
    /// −1 where it is followed downwards: roots that cross to its right then cross to the left of
    /// the edge.
    pub(super) sign: i32,
}

impl Piece {
    /// The t up to which |s| is at most `radius`, or slightly more: |s| grows along the edge.
    pub(super) fn within(&self, radius: f64) -> f64 {
        let lean = self.from.re * self.along.re + self.from.im * self.along.im;
        let (start, end) = (self.from.norm(), radius * ENLARGED);
        let square = lean * lean + (end - start) * (end + start);
        // A line that the disc does not reach still has its point on the real axis.
        (square.max(0.0).sqrt() - lean).max(LEAST_LENGTH * radius)
    }
}

impl Specification {
    /// The specification Re s < `line` alone.
    pub(super) fn left_of(line: f64) -> Self {
        Self {
            decay: -line,
            damping: None,
        }
    }

    /// # Errors
    /// [`Error::Argument`] where numbers are not finite or do not fit together.
    pub fn check(&self) -> Result<(), Error> {
        refuse_if!(
            !self.decay.is_finite(),
            "decay={}: give a finite number, in 1/s",
            self.decay
        );
        let Some(Damping { ratio, horizon }) = self.damping else {
            return Ok(());
        };
        refuse_if!(
            !(ratio > 0.0 && ratio < 1.0),
            "the damping ratio is {ratio}: give a ratio between 0 and 1"
        );
        refuse_if!(
            !(self.decay >= 0.0 && horizon > self.decay && horizon.is_finite()),
            "the horizon is {horizon} and decay={}: give a finite horizon above the decay, and a \
             decay of zero or more",
            self.decay
        );
        Ok(())
    }

    /// No root left of this line violates the specification, 1/s.
    pub(super) fn leftmost(&self) -> f64 {
        -self.damping.map_or(self.decay, |damping| damping.horizon)
    }

    /// The upper half of the edge, from the real axis up.
    pub(super) fn pieces(&self) -> Vec<Piece> {
        let start = Complex64::new(-self.decay, 0.0);
        let up = |from, length| Piece {
            from,
            along: Complex64::I,
            length,
        };
        let Some(Damping { ratio, horizon }) = self.damping else {
            return vec![up(start, f64::INFINITY)];
        };
        let along = ray(ratio);
        let on_ray = |decay: f64| along * (decay / ratio);
        let (first, second) = (on_ray(self.decay), on_ray(horizon));
        let slant = Piece {
            from: if self.decay == 0.0 { start } else { first },
            along,
            length: (horizon - self.decay) / ratio,
        };
        let last = up(second, f64::INFINITY);
        if self.decay == 0.0 {
            vec![slant, last]
        } else {
            vec![up(start, first.im), slant, last]
        }
    }

    /// The edge up to Im s = `top`, where h is real again as on the real axis. The piece that ends
    /// there is followed from both of its ends, so that each end is the start of a part.
    pub(super) fn pieces_below(&self, top: f64) -> Vec<Part> {
        let mut parts = Vec::new();
        for piece in self.pieces() {
            let from_axis = parts.is_empty();
            let whole = (top - piece.from.im) / piece.along.im;
            if piece.length < whole {
                parts.push(Part {
                    piece,
                    from_axis,
                    sign: 1,
                });
                continue;
            }
            if whole > 0.0 {
                let length = 0.5 * whole;
                let end = Complex64::new(piece.from.re + whole * piece.along.re, top);
                parts.push(Part {
                    piece: Piece { length, ..piece },
                    from_axis,
                    sign: 1,
                });
                parts.push(Part {
                    piece: Piece {
                        from: end,
                        along: -piece.along,
                        length,
                    },
                    from_axis: true,
                    sign: -1,
                });
            }
            break;
        }
        parts
    }

    /// Number of violating roots among those right of [`leftmost`](Self::leftmost); `None` where a
    /// disc meets the edge.
    pub(super) fn violating(&self, set: &RootSet) -> Option<u64> {
        let mut total = 0;
        for ((root, radius), multiplicity) in
            set.roots.iter().zip(&set.radii).zip(&set.multiplicities)
        {
            let rounding = ROUNDING * root.norm();
            let beyond = |distance: f64| match distance {
                d if d > radius + rounding => Some(true),
                d if d < -radius - rounding => Some(false),
                _ => None,
            };
            let slow = beyond(root.re + self.decay);
            let restless = match self.damping {
                None => Some(false),
                Some(Damping { ratio, horizon }) => {
                    let away = ray(ratio);
                    let weak = beyond(root.re * away.im - root.im.abs() * away.re);
                    match (beyond(root.re + horizon), weak) {
                        (Some(false), _) | (_, Some(false)) => Some(false),
                        (Some(true), Some(true)) => Some(true),
                        _ => None,
                    }
                }
            };
            match (slow, restless) {
                (Some(true), _) | (_, Some(true)) => total += u64::from(*multiplicity),
                (Some(false), Some(false)) => {}
                _ => return None,
            }
        }
        Some(total)
    }
}

/// Direction of the ray with a damping ratio.
fn ray(ratio: f64) -> Complex64 {
    Complex64::new(-ratio, ((1.0 - ratio) * (1.0 + ratio)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_is_one_path_upwards() {
        let damping = Some(Damping {
            ratio: 0.6,
            horizon: 3.0,
        });
        for decay in [0.0, 1.5] {
            let pieces = Specification { decay, damping }.pieces();
            for pair in pieces.windows(2) {
                let end = pair[0].from + pair[0].along * pair[0].length;
                assert!((end - pair[1].from).norm() < 1e-14);
            }
            let last = pieces[pieces.len() - 1];
            assert!((last.from - Complex64::new(-3.0, 4.0)).norm() < 1e-14);
        }
    }

    #[test]
    fn pieces_end_where_the_disc_does() {
        let damping = Some(Damping {
            ratio: 0.6,
            horizon: 3.0,
        });
        for radius in [2.0, 4.5, 6.0, 20.0] {
            for piece in (Specification {
                decay: 1.5,
                damping,
            })
            .pieces()
            {
                let end = piece.from + piece.along * piece.within(radius);
                assert!(piece.from.norm() > radius || (end.norm() / radius - 1.0).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn demands_that_make_no_sense_are_refused() {
        let with = |decay, ratio, horizon| Specification {
            decay,
            damping: Some(Damping { ratio, horizon }),
        };
        assert!(with(0.0, 0.5, 2.0).check().is_ok());
        for bad in [
            with(0.0, 0.0, 2.0),
            with(0.0, 1.0, 2.0),
            with(2.0, 0.5, 2.0),
            with(-1.0, 0.5, 2.0),
            with(0.0, f64::NAN, 2.0),
            with(f64::NAN, 0.5, 2.0),
            with(0.0, 0.5, f64::INFINITY),
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
    }
}
