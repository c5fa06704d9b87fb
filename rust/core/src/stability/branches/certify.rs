//! The disc of the root of a member h next to a start, one in each lane.
//!
//! Newton's step leads from s₀ to s₁. Let a = |h′(s₀)| − e₁, η = (|h(s₀)| + e₀)/a, and M bound |h″|
//! within 2η of s₀. If M η ≤ a/4, then by Rouché's theorem exactly one root lies within 2η of s₀:
//! on that circle |h′ (s − s₀)| ≥ 2aη exceeds |h(s₀)| + e₀ + M (2η)²/2 ≤ 1.5 aη. By Taylor's
//! formula at s₀ it lies within (2Mη² + e₀ + 2 e₁ η)/a of s₁ (Kantorovich 1948), apart from the
//! rounding error of s₁ itself. e₀ and e₁ are bounds on rounding errors (`plane`), which also cover
//! coefficients that are sums of a few rounded products.
//!
//! The result in a lane depends only on the start in that lane.

use super::plane::Plane;
use crate::simd::{Complex, Kernel, Real, Simd};

/// Relative radius above which another step is made.
const PRECISE_ENOUGH: f64 = 1e-13;

/// Largest accepted radius, relative to the root or to one over the longest delay, where rounding
/// errors keep it wide.
const WIDEST: f64 = 1e-11;

/// Steps after which a branch counts as lost.
const MAX_STEPS: u32 = 8;

/// Covers the rounding errors of the bounds themselves.
const ROOM: f64 = 1.0 + 1e-9;

/// Range in which squares of moduli are accurate.
const SQUARES: std::ops::Range<f64> = 1e-280..1e300;

/// Added to a square, this exceeds every effect of underflow.
const TINY: f64 = 1e-300;

/// Number of arguments: start, k, the three bounds there, the centre of these and how far starts
/// may be from it.
pub(crate) const ARGUMENTS: usize = 9;

/// Number of values: root, radius, ds/dk. The radius is infinite where nothing is proved.
pub(crate) const VALUES: usize = 5;

/// The discs of the roots next to starting values.
pub(crate) struct Certify<'a>(pub(crate) &'a Plane);

impl Kernel<ARGUMENTS, VALUES> for Certify<'_> {
    const IS_WIDE: bool = false;

    #[inline(always)]
    fn lanes<S: Simd>(&self, arguments: [Real<S>; ARGUMENTS]) -> [Real<S>; VALUES] {
        let [re, im, k, error, slope_error, bend, x, y, within] = arguments;
        let pace = self.0.pace();
        let center = Complex::new(x, y);
        let mut s = Complex::new(re, im);
        let mut root = s;
        let mut radius = re.constant(f64::INFINITY);
        let mut along = s;
        // Neither proved nor lost.
        let mut open = distance(s, center).le(within);
        for _ in 0..MAX_STEPS {
            if !open.any() {
                break;
            }
            let [h, dh, rate] = self.0.member(s, k);
            let (square, slope_square) = (h.square_modulus(), dh.square_modulus());
            let usable = slope_square.gt(SQUARES.start)
                & slope_square.lt(SQUARES.end)
                & square.lt(SQUARES.end);
            let least = (slope_square.sqrt() - slope_error) * (1.0 - 1e-9);
            let inverse = re.constant(1.0) / least;
            let reach = ((square + TINY).sqrt() + error) * inverse * ROOM;
            let inverse_slope = re.constant(1.0) / slope_square;
            let next = s - over(h, dh, inverse_slope);
            let wide =
                (bend * reach * reach * 2.0 + error + slope_error * reach * 2.0) * inverse * ROOM
                    + (s.re.abs() + s.im.abs() + reach) * (8.0 * f64::EPSILON);
            let proved =
                usable & least.gt(0.0) & (bend * reach * 4.0).le(least) & (reach * 2.0).le(within);
            let size = next.re.abs().larger(next.im.abs());
            let unit = if pace > 0.0 { size.larger(pace) } else { size };
            let rounded = wide.le(error * inverse * 4.0) & wide.le(unit * WIDEST);
            let precise = proved & (wide.le(size * PRECISE_ENOUGH) | rounded);
            let done = open & precise;
            root = done.choose(next, root);
            radius = done.select(wide, radius);
            along = done.choose(over(rate, dh, inverse_slope), along);
            // Comparisons with NaN are false.
            open = open & !precise & usable & distance(next, center).le(within);
            s = open.choose(next, s);
        }
        [root.re, root.im, radius, along.re, along.im]
    }
}

/// A bound on |s − t| that is at most √2 times as large.
#[inline(always)]
fn distance<S: Simd>(s: Complex<S>, t: Complex<S>) -> Real<S> {
    let gap = s - t;
    gap.re.abs() + gap.im.abs()
}

/// s/t, given 1/|t|².
#[inline(always)]
fn over<S: Simd>(s: Complex<S>, t: Complex<S>, inverse: Real<S>) -> Complex<S> {
    Complex::new(
        s.re.mul_add(t.re, s.im * t.im) * inverse,
        s.im.mul_sub(t.re, s.re * t.im) * inverse,
    )
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::lambertw::lambertw;
    use crate::quasipoly::make;
    use crate::simd::{Columns, Instructions, sweep_on};

    /// s + k e^(−s), whose roots are W_j(−k).
    fn plane() -> Plane {
        Plane::new(
            &make(&[&[0.0, 1.0]], &[0.0]),
            &make(&[&[1.0]], &[1.0]),
            None,
            None,
        )
    }

    #[test]
    fn discs_hold_the_roots_and_are_the_same_with_all_instructions() {
        let plane = plane();
        let mut arguments: Columns<ARGUMENTS, 64> = [[0.0; 64]; ARGUMENTS];
        let mut roots = Vec::new();
        for column in 0..64 {
            let k = 0.5 + 0.3 * column as f64;
            let root = lambertw(Complex64::new(-k, 0.0), (column % 5) as i64);
            // From the root itself to too far away.
            let start = root + Complex64::from_polar(1e-12 * 1.55f64.powi(column as i32), k);
            let around = plane.around(start, 0.2).unwrap();
            let [error, slope_error, bend] = around.bounds(k);
            let (center, within) = (around.center, 0.5 * around.radius);
            let place = [start.re, start.im, k];
            let bounds = [error, slope_error, bend];
            let element = [place, bounds, [center.re, center.im, within]];
            for (row, value) in arguments.iter_mut().zip(element.concat()) {
                row[column] = value;
            }
            roots.push(root);
        }
        let mut first: Option<Columns<VALUES, 64>> = None;
        for instructions in Instructions::available() {
            let mut values: Columns<VALUES, 64> = [[0.0; 64]; VALUES];
            sweep_on(instructions, &Certify(&plane), &arguments, &mut values, 64);
            let mut proved = 0;
            for (column, root) in roots.iter().enumerate() {
                let [re, im, radius, ..] = values.map(|row| row[column]);
                if radius.is_finite() {
                    let off = (Complex64::new(re, im) - root).norm();
                    assert!(off <= radius + 4e-16 * root.norm() && radius < 1e-10);
                    proved += 1;
                }
            }
            assert!(proved > 50 && proved < 64, "{proved} proved");
            let bits = |values: &Columns<VALUES, 64>| values.map(|row| row.map(f64::to_bits));
            let first = first.get_or_insert(values);
            assert_eq!(bits(first), bits(&values), "{}", instructions.name());
        }
    }
}
