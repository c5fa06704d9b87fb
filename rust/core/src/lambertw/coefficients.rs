//! Rational starting values for the branches that meet at -1/e, in y = sqrt(2 (e z + 1)).
//!
//! In y both sheets are analytic across the branch point. The coefficients are real (the
//! function is real on the real axis of y) and were fitted by linear least squares with the
//! weights of Sanathanan & Koerner (1963) and Lawson (1961) on the boundary of the region, where
//! an analytic error is largest. Ascending powers of y; the denominator starts with 1.

/// Numerator of W_0(z)/z on |z| <= 1449, Re y >= 0: relative error 1.2e-4.
pub(super) const PRINCIPAL_NUMERATOR: [f64; 7] = [
    2.718_598_776_526_885_5,
    1.296_518_846_237_051_4,
    0.156_124_140_591_705_98,
    0.005_472_265_598_009_772,
    4.823_218_575_605_810_6e-5,
    3.017_952_621_588_143e-8,
    -3.726_280_744_630_558e-11,
];
/// Denominator that belongs to [`PRINCIPAL_NUMERATOR`].
pub(super) const PRINCIPAL_DENOMINATOR: [f64; 7] = [
    1.0,
    1.477_440_803_620_741_6,
    0.700_568_392_295_711_8,
    0.125_521_134_867_066_34,
    0.008_355_993_808_071_855,
    0.000_187_225_563_372_916_53,
    1.068_985_342_690_769_6e-6,
];

/// Numerator of W_{-1} and W_1 on the sheet behind the branch point, at -y, |y| <= 1.2:
/// relative error 2.9e-5.
pub(super) const BEHIND_NUMERATOR: [f64; 5] = [
    -1.000_028_272_232_801_6,
    -0.658_753_308_073_211_1,
    0.396_720_028_711_040_4,
    0.333_407_676_733_676_77,
    0.047_873_495_467_559_986,
];
/// Denominator that belongs to [`BEHIND_NUMERATOR`].
pub(super) const BEHIND_DENOMINATOR: [f64; 5] = [
    1.0,
    1.658_633_947_531_961_4,
    0.928_341_957_270_121_5,
    0.194_536_471_190_430_77,
    0.010_735_523_836_686_491,
];
