//! e^x, sin y and cos y of double-double arguments, within 8 u² (u = 2⁻⁵³).
//!
//! As in `exponential` and `circular`, with the same tables, whose entries are within u² (Tang
//! 1989), and the step (ln 2/32, π/32) as the sum of three doubles. The multiples of the first two
//! words are exact products; each of the three differences loses 3.1 u² of what it leaves (below
//! 0.05), the third word and what follows it less than 2⁻¹²⁰ for |k| < 2¹⁶, |n| < 2⁴⁴: the reduced
//! r is within 0.5 u². *Exponential.* |r| ≤ 0.01084. The series ends at r¹²/12!, cut by 2⁻¹¹⁷; its
//! part from r⁷ on is computed in doubles, 10 u r⁷/5040 < 0.4 u². Products and sums of the rest
//! lose 10 u² of r²/2 and 3.1 u² of r: together with r, p = e^r − 1 is within 1 u². T + T p: 1 u²
//! (table), 1 u² (p), 0.1 u² (product), 3.2 u² (sum): below 6 u² of the result. Powers of two are
//! exact unless words underflow. *Circular.* |r| ≤ 0.0492. sin r to r¹⁵ (cut by 2⁻¹²²), from r⁹ in
//! doubles (0.4 u²); cos r − 1 to r¹⁴ (2⁻¹¹³), from r¹⁰ in doubles (0.1 u²). S + (C sin r + S (cos
//! r − 1)): 1 u² (table), 0.5 + 0.4 + 0.1 u² (r and series), 0.5 u² (products), 3.1 u² (sum) and
//! 0.2 u² (inner sum): below 6 u².

use super::double_double::DoubleDouble;
use super::nearest::nearest;
use super::tables::{POWERS, SINES};

const EXP_STEPS_PER_UNIT: f64 = 46.166_241_308_446_83;
/// ln 2/32 as the sum of three doubles.
const EXP_STEP: [f64; 3] = [
    0.021_660_849_392_498_29,
    7.247_021_293_269_686e-19,
    1.783_658_887_005_066_3e-35,
];
const ANGLE_STEPS_PER_UNIT: f64 = 10.185_916_357_881_302;
/// π/32 as the sum of three doubles.
const ANGLE_STEP: [f64; 3] = [
    0.098_174_770_424_681_03,
    3.827_021_247_335_479e-18,
    -9.358_655_655_369_811e-35,
];
/// Largest argument of sine and cosine.
const LARGEST_ANGLE: f64 = 1_099_511_627_776.0;
/// Largest |x| for which e^x is computed; up to it neither the result nor its low word leaves the
/// normal numbers.
pub const LARGEST_EXPONENT: f64 = 600.0;

/// 1/2, −1/6 and so on as double-doubles are taken from here: 1/2!, 1/3!, …, 1/8!.
const INVERSE_FACTORIALS: [DoubleDouble; 7] = [
    DoubleDouble::new(0.5, 0.0),
    DoubleDouble::new(0.166_666_666_666_666_66, 9.251_858_538_542_97e-18),
    DoubleDouble::new(0.041_666_666_666_666_664, 2.312_964_634_635_742_7e-18),
    DoubleDouble::new(0.008_333_333_333_333_333, 1.156_482_317_317_871_4e-19),
    DoubleDouble::new(0.001_388_888_888_888_889, -5.300_543_954_373_577e-20),
    DoubleDouble::new(0.000_198_412_698_412_698_4, 1.720_955_829_342_070_5e-22),
    DoubleDouble::new(2.480_158_730_158_73e-5, 2.151_194_786_677_588_2e-23),
];

/// x − k step.
#[inline(always)]
fn reduced(x: DoubleDouble, k: f64, step: [f64; 3]) -> DoubleDouble {
    let [first, second, third] = step;
    let left = x - DoubleDouble::product(k, first);
    let left = left - DoubleDouble::product(k, second);
    left + -(k * third)
}

/// e^x within 8 · 2⁻¹⁰⁶ of itself for |x| ≤ 600; NaN beyond.
///
/// ```
/// use deadtime::elementary::{DoubleDouble, precise};
/// let e = precise::exp(1.0.into());
/// assert_eq!((e.high, e.low), (std::f64::consts::E, 1.4456468917292502e-16));
/// ```
pub fn exp(x: DoubleDouble) -> DoubleDouble {
    if x.high.is_nan() || x.high.abs() > LARGEST_EXPONENT {
        return DoubleDouble::new(f64::NAN, f64::NAN);
    }
    let k = nearest(x.high * EXP_STEPS_PER_UNIT);
    let r = reduced(x, k, EXP_STEP);
    let t = r.high;
    let tail = 1.0 / 5_040.0
        + t * (1.0 / 40_320.0
            + t * (1.0 / 362_880.0
                + t * (1.0 / 3_628_800.0 + t * (1.0 / 39_916_800.0 + t / 479_001_600.0))));
    let [half, third, fourth, fifth, sixth, ..] = INVERSE_FACTORIALS;
    let mut series = r * tail + sixth;
    for coefficient in [fifth, fourth, third, half] {
        series = series * r + coefficient;
    }
    let p = r + r * r * series;
    let k = k as i64;
    let (high, low) = POWERS[(k & 31) as usize];
    let power = DoubleDouble::new(high, low);
    (power + power * p).scaled(f64::from_bits((((k >> 5) + 1023) as u64) << 52))
}

/// (sin y, cos y), each within 8 · 2⁻¹⁰⁶, for |y| ≤ 2⁴⁰; NaN beyond.
///
/// ```
/// use deadtime::elementary::{DoubleDouble, precise};
/// let (sine, _) = precise::sin_cos(std::f64::consts::PI.into());
/// // What π as a double lacks.
/// assert!((sine.high - 1.2246467991473532e-16).abs() < 1e-31);
/// ```
pub fn sin_cos(y: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    if y.high.is_nan() || y.high.abs() > LARGEST_ANGLE {
        let nothing = DoubleDouble::new(f64::NAN, f64::NAN);
        return (nothing, nothing);
    }
    let n = nearest(y.high * ANGLE_STEPS_PER_UNIT);
    let r = reduced(y, n, ANGLE_STEP);
    let square = r * r;
    let q = square.high;
    let [half, third, fourth, fifth, sixth, seventh, eighth] = INVERSE_FACTORIALS;
    let sine_tail = 1.0 / 362_880.0
        - q * (1.0 / 39_916_800.0 - q * (1.0 / 6_227_020_800.0 - q / 1_307_674_368_000.0));
    let cosine_tail = -1.0 / 3_628_800.0 + q * (1.0 / 479_001_600.0 - q / 87_178_291_200.0);
    let mut sine = square * sine_tail - seventh;
    sine = sine * square + fifth;
    sine = sine * square - third;
    let sine = r + r * (square * sine);
    let mut drop = square * cosine_tail + eighth;
    drop = drop * square - sixth;
    drop = drop * square + fourth;
    drop = drop * square - half;
    let drop = square * drop;
    let n = n as i64;
    let entry = |index: i64| {
        let (high, low) = SINES[(index & 63) as usize];
        DoubleDouble::new(high, low)
    };
    let (s, c) = (entry(n), entry(n + 16));
    (s + (c * sine + s * drop), c + (c * drop - s * sine))
}
