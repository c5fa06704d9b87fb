//! Roots along chains, many at a time.
//!
//! From the law of a chain a few steps of Newton's iteration lead to each of its roots, and the
//! test of `newton` proves a disc about it, one root in each lane. What this finds is handed to the
//! search as discs already known: it completes the list where roots are missing (next to 0, where
//! the laws do not hold yet) and the count of the region shows that none is left out.

use std::f64::consts::{FRAC_PI_2, PI};

use num_complex::Complex64;

use super::chain_laws::{Law, laws};
use super::newton::{ARRIVED, ENLARGED, LEAST, LOST, MOST, PRECISE_ENOUGH, SHRUNK};
use crate::elementary::exp;
use crate::lambertw::{rough_angle, rough_log};
use crate::order::sort_up;
use crate::quasipoly::{Lanes, QuasiPolynomial, modulus};
use crate::roots::counting::Cell;
use crate::roots::disc::Disc;
use crate::simd::{Columns, Complex, Kernel, Real, Simd, sweep};
use crate::{Error, Task};

/// Roots computed between two checks for cancellation.
const BLOCK: usize = 256;

/// Upper limit on Newton's steps. Close to 0, where more are needed, the search finds the roots.
const MAX_STEPS: usize = 6;

/// Upper limit on further steps where the value still exceeds its error.
const MAX_REPEATS: usize = 2;

/// Fixed-point iterations for the law.
const LAW_STEPS: usize = 4;

/// Spacings by which the range of a chain is extended, because the law is an approximation.
const MARGIN: f64 = 2.0;

/// Distance from the region, in spacings, up to which a neutral chain may have roots in it.
const SIDE: f64 = 0.25;

/// Logarithm of the factor by which the height may differ at which another chain enters the region.
const ALONG: f64 = 0.5;

/// Upper limit on the numbers tried, in roots of the region.
const MOST_TRIED: f64 = 4.0;

/// Largest error left by the last step, as a share of the modulus: well below rounding errors.
const CONVERGED: f64 = 0.0625 * f64::EPSILON;

/// Discs about roots of `h` in the upper half of a cell: disjoint, one root in each.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn discs_along_chains(
    h: &QuasiPolynomial,
    cell: &Cell,
    task: &Task,
) -> Result<Vec<Disc>, Error> {
    let mut discs = Vec::new();
    for law in &laws(h) {
        let (first, last) = numbers(law, cell);
        // NaN where the law says nothing.
        let few = last - first <= MOST_TRIED * cell.count as f64;
        if !few {
            continue;
        }
        let kernel = Along {
            lanes: Lanes::new(h, law.row),
            law: *law,
            span: h.delays().last().copied().unwrap_or(0.0),
        };
        let total = (last - first + 1.0).max(0.0) as usize;
        discs.reserve(total);
        for start in (0..total).step_by(BLOCK) {
            task.check()?;
            let length = BLOCK.min(total - start);
            let mut heights: Columns<1, BLOCK> = [[0.0; BLOCK]];
            let mut found: Columns<4, BLOCK> = [[0.0; BLOCK]; 4];
            for (i, height) in heights.iter_mut().flatten().enumerate() {
                *height = law.phase + law.spacing * (first + (start + i) as f64);
            }
            sweep(&kernel, &heights, &mut found, length);
            let [re, im, radius, isolation] = &found;
            let columns = re.iter().zip(im).zip(radius.iter().zip(isolation));
            for ((re, im), (radius, isolation)) in columns.take(length) {
                let center = Complex64::new(*re, *im);
                if *isolation > 0.0 && cell.holds(center) {
                    discs.push(Disc {
                        center,
                        radius: *radius,
                        isolation: *isolation,
                        multiplicity: 1,
                    });
                }
            }
        }
    }
    sort_up(&mut discs, |disc| disc.center.im);
    Ok(disjoint(discs))
}

/// The discs, sorted by height, without those that meet one before.
fn disjoint(mut discs: Vec<Disc>) -> Vec<Disc> {
    let widest = discs.iter().map(|disc| disc.radius).fold(0.0, f64::max);
    let most = 2.0 * ENLARGED * widest;
    let beside = |low: &Disc, high: &Disc| high.center.im - low.center.im <= most;
    let pairs = discs.iter().zip(discs.iter().skip(1));
    if !pairs.into_iter().any(|(low, high)| beside(low, high)) {
        return discs;
    }
    let mut kept: Vec<Disc> = Vec::with_capacity(discs.len());
    for disc in discs.drain(..) {
        let meets = |other: &Disc| {
            let apart = modulus(disc.center - other.center) * SHRUNK;
            apart <= disc.radius + other.radius
        };
        let mut near = kept.iter().rev().take_while(|other| beside(other, &disc));
        if !near.any(meets) {
            kept.push(disc);
        }
    }
    kept
}

/// The first and the last number k of a chain whose root may lie in the cell.
fn numbers(law: &Law, cell: &Cell) -> (f64, f64) {
    let Law { bend, offset, .. } = *law;
    let (mut low, mut high) = (cell.im.0.max(0.0), cell.im.1);
    if bend == 0.0 {
        let aside = SIDE * law.spacing;
        if offset < cell.re.0 - aside || offset > cell.re.1 + aside {
            return (0.0, -1.0);
        }
    } else {
        // Re s = c − μ log |s|.
        let height = |x: f64| exp((offset - x) / bend);
        let (one, other) = (height(cell.re.0), height(cell.re.1));
        low = low.max(one.min(other) * exp(-ALONG) - cell.width());
        high = high.min(one.max(other) * exp(ALONG));
    }
    // Im s = Im v − μ arg s.
    let margin = MARGIN * law.spacing;
    let (down, up) = ((bend * PI).min(0.0), (bend * PI).max(0.0));
    let number = |height: f64| (height - law.phase) / law.spacing;
    (
        number(low + down - margin).ceil(),
        number(high + up + margin).floor(),
    )
}

/// From the height Im v to a root and the disc about it: Re s, Im s, radius, radius of isolation,
/// which is zero where no disc is proved.
struct Along<'a> {
    lanes: Lanes<'a>,
    law: Law,
    /// The largest delay, in s.
    span: f64,
}

impl Along<'_> {
    /// The solution of s + μ log s = v, roughly.
    #[inline(always)]
    fn start<S: Simd>(&self, height: Real<S>) -> Complex<S> {
        let Law { bend, offset, .. } = self.law;
        let mut s = Complex::new(height.constant(offset), height);
        if bend != 0.0 {
            s.im = (height - bend * FRAC_PI_2).larger(bend.abs());
            for _ in 0..LAW_STEPS {
                let log = Complex::new(rough_log(s.square_modulus()) * 0.5, rough_angle(s));
                s = Complex::new(s.re.constant(offset), height) - log.scaled(bend);
            }
        }
        s
    }
}

impl Kernel<1, 4> for Along<'_> {
    #[inline(always)]
    fn lanes<S: Simd>(&self, [height]: [Real<S>; 1]) -> [Real<S>; 4] {
        let mut s = self.start(height);
        let mut open = s.re.eq(s.re);
        for _ in 0..MAX_STEPS {
            let (value, slope) = self.lanes.jet(s);
            let step = value.over(slope);
            s = open.choose(s - step, s);
            // The next step would be about the square of this one times the delay.
            let rest = step.square_modulus() * self.span;
            open = open & rest.gt(s.im.abs() * CONVERGED);
            if !open.any() {
                break;
            }
        }
        // As in `newton::disc_from`, with one bound on the curvature.
        let mut around = self.lanes.enclosure(s);
        for _ in 0..MAX_REPEATS {
            let rough = around.value.gt(around.error * (1.0 + ARRIVED));
            if !rough.any() {
                break;
            }
            let (value, slope) = self.lanes.jet(s);
            s = rough.choose(s - value.over(slope), s);
            around = self.lanes.enclosure(s);
        }
        let (a, b) = (around.value, around.slope);
        let square = b * b;
        let root = (square * SHRUNK - around.bend * a * 2.0).sqrt();
        let radius = (a * 2.0) / (b + root) * ENLARGED;
        let isolation = ((b + root) / around.bend).smaller(around.reach) * SHRUNK;
        let arrived = a.le(around.error * (1.0 + LOST));
        let usable = arrived & b.gt(LEAST) & b.lt(MOST) & a.lt(MOST) & root.gt(0.0);
        // Clear of the real axis, and one point to working precision.
        let small = radius.lt(s.im) & radius.le(s.im * PRECISE_ENOUGH) & radius.le(isolation);
        let isolation = (usable & small).select(isolation, a.constant(0.0));
        [s.re, s.im, radius + f64::MIN_POSITIVE, isolation]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lambertw::dde_root;
    use crate::quasipoly::make;
    use crate::roots::counting::Walker;

    fn along(height: f64) -> Result<(Cell, Vec<Disc>), Error> {
        let (h, task) = (make(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]), Task::new());
        let cell = Cell::new(
            &mut Walker::new(&h, &task),
            (-12.0, 2.0),
            (0.0, height),
            true,
        )?;
        let discs = discs_along_chains(&h, &cell, &task)?;
        Ok((cell, discs))
    }

    #[test]
    fn each_disc_holds_a_root_of_its_own() -> Result<(), Error> {
        let (cell, discs) = along(1000.0)?;
        assert!(2 * discs.len() as u64 + 8 >= cell.count);
        let first = discs.first().map_or(0.0, |disc| disc.center.im);
        let skipped = ((first - 1.0) / std::f64::consts::TAU).round() as i64;
        for (k, disc) in (skipped..).zip(&discs) {
            let exact = dde_root(0.0, -1.0, 1.0, k);
            let apart = (disc.center - exact).norm();
            assert!(
                apart <= disc.radius + f64::EPSILON * exact.norm(),
                "{k} {apart}"
            );
            assert!(disc.radius < disc.isolation);
        }
        Ok(())
    }

    #[test]
    fn of_two_discs_that_meet_one_is_kept() -> Result<(), Error> {
        let (_, discs) = along(500.0)?;
        let mut twice: Vec<Disc> = discs.iter().flat_map(|disc| [*disc; 2]).collect();
        assert_eq!(disjoint(twice.clone()), discs);
        twice.truncate(1);
        assert_eq!(disjoint(twice).len(), 1);
        Ok(())
    }
}
