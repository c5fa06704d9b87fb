//! Rational starting values for the branches that meet at -1/e, in y = sqrt(2 (e z + 1)).
//!
//! In y both sheets are analytic across the branch point. The coefficients are real (the
//! function is real on the real axis of y) and were fitted by linear least squares with the
//! weights of Sanathanan & Koerner (1963) and Lawson (1961) on the boundary of the region, where
//! an analytic error is largest. Ascending powers of y; the denominator starts with 1.

/// Numerator of W_0(z)/z on |z| <= 23, Re y >= 0: relative error 1.2e-5.
pub(super) const PRINCIPAL_NUMERATOR: [f64; 6] = [
    2.718_313_557_824_961,
    1.747_764_721_921_232_2,
    0.299_164_057_573_535_15,
    0.013_742_269_814_467_642,
    5.908_877_640_445_326e-5,
    -3.556_926_445_778_412e-7,
];
/// Denominator that belongs to [`PRINCIPAL_NUMERATOR`].
pub(super) const PRINCIPAL_DENOMINATOR: [f64; 6] = [
    1.0,
    1.643_023_933_580_899_4,
    0.919_607_790_238_078_8,
    0.208_483_546_808_462_96,
    0.018_104_601_638_990_55,
    4.519_059_069_673_065_5e-4,
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
