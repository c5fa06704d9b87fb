use num_complex::Complex64;
use proptest::prelude::*;

use super::*;
use crate::quasipoly::{QuasiPolynomial, make};
use crate::{Error, Task};

const OPEN: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

fn counted(h: &QuasiPolynomial, re: (f64, f64), im: (f64, f64)) -> Result<u64, Error> {
    count(h, &Region { re, im }, &Task::new())
}

fn listed(h: &QuasiPolynomial, re: (f64, f64), im: (f64, f64)) -> Result<RootSet, Error> {
    roots(h, &Region { re, im }, &Task::new())
}

#[test]
fn the_tall_region_of_the_scalar_equation() {
    let h = make(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]);
    assert_eq!(counted(&h, (-12.0, 2.0), (-1000.0, 1000.0)), Ok(318));
    assert_eq!(counted(&h, (-12.0, 2.0), (0.0, 1000.0)), Ok(159));
    let set = listed(&h, (-12.0, 2.0), (0.0, 1000.0));
    assert!(set.is_ok_and(|set| set.counted == 159 && set.radii.iter().all(|r| *r < 1e-12)));
}

#[test]
fn open_sides_are_closed_by_bounds() {
    let h = make(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]);
    assert_eq!(counted(&h, (-0.5, f64::INFINITY), OPEN), Ok(2));
    assert_eq!(counted(&h, OPEN, (0.0, 30.0)), Ok(5));
    assert!(matches!(counted(&h, OPEN, OPEN), Err(Error::Argument(_))));
    let cubic = make(&[&[-6.0, 11.0, -6.0, 1.0]], &[0.5]);
    assert_eq!(counted(&cubic, OPEN, OPEN), Ok(3));
    assert_eq!(listed(&cubic, OPEN, OPEN).map(|set| set.roots.len()), Ok(3));
}

#[test]
fn silly_input_gets_a_clear_answer() {
    let h = make(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]);
    let is_refused = |error: Option<Error>| matches!(error, Some(Error::Argument(_)));
    let count_in = |h, re| counted(h, re, (0.0, 1.0)).err();
    let count_beyond = |h, sigma| count_right_of(h, sigma, &Task::new()).err();
    let leading = |h, n| rightmost(h, n, &Task::new());
    let endless = f64::INFINITY;
    for re in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (endless, endless)] {
        assert!(is_refused(count_in(&h, re)));
    }
    let zero = QuasiPolynomial::zero();
    assert!(is_refused(count_in(&zero, (0.0, 1.0))));
    assert!(is_refused(leading(&zero, 1).err()));
    let constant = make(&[&[3.0]], &[0.0]);
    assert_eq!(counted(&constant, OPEN, OPEN), Ok(0));
    assert_eq!(leading(&constant, 1).map(|set| set.roots.len()), Ok(0));
    let advanced = make(&[&[1.0], &[0.0, 1.0]], &[0.0, 1.0]);
    assert!(is_refused(leading(&advanced, 1).err()));
    assert!(is_refused(count_beyond(&advanced, 0.0)));
    assert!(is_refused(leading(&h, 0).err()));
    assert!(is_refused(count_beyond(&h, f64::NAN)));
}

#[test]
fn a_root_on_the_contour_is_reported_with_its_place() {
    // (s² + 4)(s + e^(−s)) has a root at 2i.
    let h = make(&[&[0.0, 4.0, 0.0, 1.0], &[4.0, 0.0, 1.0]], &[0.0, 1.0]);
    match counted(&h, (0.0, 2.0), (0.0, 10.0)) {
        Err(Error::Contour { place, distance }) => {
            assert!((place - 2.0 * Complex64::I).norm() < 1e-6 && distance < 1e-3);
            assert_eq!(counted(&h, (-2.0 * distance, 2.0), (0.0, 10.0)), Ok(1));
            assert_eq!(counted(&h, (2.0 * distance, 2.0), (0.0, 10.0)), Ok(0));
        }
        other => assert!(matches!(other, Err(Error::Contour { .. }))),
    }
}

#[test]
fn multiple_roots_become_discs_with_their_multiplicity() {
    let h = make(&[&[6.0, -4.0, 1.0], &[-6.0, -2.0]], &[0.0, 1.0]);
    let set = listed(&h, (-8.0, 1.0), (-60.0, 60.0));
    assert!(set.is_ok_and(|set| {
        set.counted == 20
            && set.multiplicities.first() == Some(&4)
            && set.resolved.first() == Some(&true)
            && set.roots.first() == Some(&Complex64::ZERO)
            && set.radii.first() == Some(&0.0)
    }));
}

#[test]
fn a_root_close_above_the_chain() {
    let h = make(&[&[0.0, 1.0], &[2.0, 0.3]], &[0.0, 0.36]);
    let set = rightmost(&h, 1, &Task::new());
    assert!(set.is_ok_and(|set| (set.roots[0].re + 3.316_780_322_147_385_3).abs() < 1e-13));
}

#[test]
fn a_stopped_task_ends_the_count() {
    let h = make(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]);
    let task = Task::new();
    task.stop();
    let region = Region {
        re: (-14.0, 2.0),
        im: (0.0, 1e5),
    };
    assert_eq!(roots(&h, &region, &task), Err(Error::Interrupted));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_whole_is_the_sum_of_its_parts(
        a in -3.0..3.0f64, b in -3.0..3.0f64, c in -0.8..0.8f64, tau in 0.1..3.0f64,
        x in -1.5..0.5f64, y in -20.0..20.0f64,
    ) {
        let h = make(&[&[a, 1.0], &[b, c]], &[0.0, tau]);
        let part = |re, im| counted(&h, re, im);
        let (re, im) = ((-3.0, 2.0), (-31.0, 33.0));
        let parts = [
            part((re.0, x), (im.0, y)), part((x, re.1), (im.0, y)),
            part((re.0, x), (y, im.1)), part((x, re.1), (y, im.1)),
        ];
        let whole = part(re, im);
        // An error is acceptable here, a wrong number is not.
        if let (Ok(whole), Ok(sum)) = (whole, parts.into_iter().sum::<Result<u64, Error>>()) {
            prop_assert_eq!(whole, sum);
        }
    }

    #[test]
    fn all_roots_are_found_and_are_roots(
        a in -3.0..3.0f64, b in -3.0..3.0f64, c in -0.8..0.8f64, tau in 0.1..3.0f64,
    ) {
        let h = make(&[&[a, 1.0], &[b, c]], &[0.0, tau]);
        let region = ((-3.0, 2.0), (-31.0, 31.0));
        if let Ok(number) = counted(&h, region.0, region.1) {
            let set = listed(&h, region.0, region.1);
            prop_assert!(set.is_ok(), "{set:?}");
            let Ok(set) = set else { return Ok(()) };
            prop_assert_eq!(set.counted, number);
            for root in &set.roots {
                prop_assert!(set.roots.contains(&root.conj()));
            }
        }
    }
}
