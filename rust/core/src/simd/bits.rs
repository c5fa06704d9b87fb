//! Operations on the bits of a double: signs and exponents.

use pulp::Simd;
use pulp::bytemuck::{cast, cast_slice_mut};

use super::real::{Mask, Real};

const SIGN: u64 = 0x8000_0000_0000_0000;
/// All bits of the exponent.
const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
/// All bits below the exponent.
const FRACTION: u64 = 0x000f_ffff_ffff_ffff;
/// From the last bits of the upper half to the exponent.
const PLACES: u32 = 20;
/// 2^32, the place value of the upper half of the bits.
const HALF: f64 = 4_294_967_296.0;
/// 1.5 * 2^52: added to a whole number below 2^51, its last bits are those of that number.
const WHOLE: f64 = 6_755_399_441_055_744.0;
/// 2^52: a double with these bits above a whole number in its lower bits has that number added.
const CARRIER: f64 = 4_503_599_627_370_496.0;

/// A method that shifts both halves of the bits of each number by [`PLACES`].
macro_rules! shift {
    ($name:ident, $halves:ident, $operator:tt) => {
        #[inline(always)]
        fn $name(self) -> Self {
            let (simd, mut bits) = (self.simd, self.bits());
            if S::IS_SCALAR {
                // A vector of halves is one half there.
                for half in cast_slice_mut::<_, u32>(&mut bits) {
                    *half $operator PLACES;
                }
                return Self::from_bits(simd, bits);
            }
            let ([a, b], places) = (bits, simd.splat_u32s(PLACES));
            let shifted = [
                cast(simd.$halves(cast(a), places)),
                cast(simd.$halves(cast(b), places)),
            ];
            Self::from_bits(simd, shifted)
        }
    };
}

impl<S: Simd> Real<S> {
    #[inline(always)]
    fn bits(self) -> [S::u64s; 2] {
        let [a, b] = self.lanes;
        [
            self.simd.transmute_u64s_f64s(a),
            self.simd.transmute_u64s_f64s(b),
        ]
    }

    #[inline(always)]
    fn from_bits(simd: S, [a, b]: [S::u64s; 2]) -> Self {
        Self::new(
            simd,
            [simd.transmute_f64s_u64s(a), simd.transmute_f64s_u64s(b)],
        )
    }

    /// The bits that are also set in `mask`.
    #[inline(always)]
    fn masked(self, mask: u64) -> Self {
        let ([a, b], mask) = (self.bits(), self.simd.splat_u64s(mask));
        let simd = self.simd;
        Self::from_bits(simd, [simd.and_u64s(a, mask), simd.and_u64s(b, mask)])
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        self.masked(!SIGN)
    }

    /// The sign alone: +0 or -0.
    #[inline(always)]
    pub(crate) fn sign(self) -> Self {
        self.masked(SIGN)
    }

    /// Negated where `sign`, which is +0 or -0, has its bit set.
    #[inline(always)]
    pub(crate) fn flipped(self, sign: Self) -> Self {
        let ([a, b], [c, d]) = (self.bits(), sign.bits());
        Self::from_bits(
            self.simd,
            [self.simd.xor_u64s(a, c), self.simd.xor_u64s(b, d)],
        )
    }

    /// With the bits of `other` set as well.
    #[inline(always)]
    fn joined(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.bits(), other.bits());
        Self::from_bits(
            self.simd,
            [self.simd.or_u64s(a, c), self.simd.or_u64s(b, d)],
        )
    }

    /// The modulus of `self` with the sign of `sign`, which is +0 or -0.
    #[inline(always)]
    pub(crate) fn signed(self, sign: Self) -> Self {
        self.abs().joined(sign)
    }

    /// Is the sign bit set (also of a zero)?
    #[inline(always)]
    pub(crate) fn is_negative(self) -> Mask<S> {
        self.constant(1.0).signed(self.sign()).lt(0.0)
    }

    /// The nearest whole number, for moduli below 2^51.
    #[inline(always)]
    pub(crate) fn nearest(self) -> Self {
        (self + WHOLE) - WHOLE
    }

    shift!(halves_up, wrapping_dyn_shl_u32s, <<=);
    shift!(halves_down, wrapping_dyn_shr_u32s, >>=);

    /// `2^self` for a whole number from -1022 to 1023.
    #[inline(always)]
    pub(crate) fn power_of_two(self) -> Self {
        // The biased exponent is moved to the last bits of the upper half, which is then shifted.
        let biased = self.mul_add(HALF, WHOLE + 1023.0 * HALF);
        biased.halves_up()
    }

    /// The power of two at or below the modulus of a normal number.
    #[inline(always)]
    pub(crate) fn binade(self) -> Self {
        self.masked(EXPONENT)
    }

    /// The modulus of a normal number brought to [1, 2) by a power of two.
    #[inline(always)]
    pub(crate) fn mantissa(self) -> Self {
        self.masked(FRACTION).joined(self.constant(1.0))
    }

    /// `log2` of a positive power of two.
    #[inline(always)]
    pub(crate) fn exponent(self) -> Self {
        // Shifted to the last bits of the upper half, then read as the whole number there.
        let shifted = self.halves_down();
        let whole = shifted.joined(self.constant(CARRIER));
        (whole - CARRIER) * (1.0 / HALF) - 1023.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_normal_power_of_two_goes_there_and_back() {
        for n in -1022..=1023 {
            let n = f64::from(n);
            assert_eq!(Real::first(Real::lane(n).power_of_two()), n.exp2());
            assert_eq!(Real::first(Real::lane(n.exp2()).exponent()), n);
            assert_eq!(Real::first(Real::lane(n.exp2() * 1.999).binade()), n.exp2());
            assert_eq!(Real::first(Real::lane(n.exp2() * -1.75).mantissa()), 1.75);
        }
    }

    #[test]
    fn signs_of_zeros_are_signs() {
        for (value, negative) in [(0.0, false), (-0.0, true), (-2.5, true), (3.0, false)] {
            assert_eq!(Real::lane(value).is_negative().any(), negative);
            assert_eq!(
                Real::first(Real::lane(value).sign()).to_bits(),
                (if negative { -0.0_f64 } else { 0.0 }).to_bits()
            );
            assert_eq!(
                Real::first(Real::lane(7.0).signed(Real::lane(value).sign())) < 0.0,
                negative
            );
            assert_eq!(
                Real::first(Real::lane(-7.0).flipped(Real::lane(value).sign())) > 0.0,
                negative
            );
        }
        assert_eq!(Real::first(Real::lane(2.5).nearest()), 2.0);
        assert_eq!(Real::first(Real::lane(-1e6 - 0.4).nearest()), -1e6);
    }
}
