use super::*;
use crate::Task;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::{Edge, Region};
use num_complex::Complex64;

fn ring(n: usize, delay: f64, gain: f64) -> CharacteristicMatrix {
    let unit = (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    let coupled = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| match (j + n - i) % n {
                    0 => -gain,
                    1 => gain,
                    _ => 0.0,
                })
                .collect()
        })
        .collect();
    let damping = (0..n)
        .map(|i| (0..n).map(|j| if i == j { -0.5 } else { 0.0 }).collect())
        .collect();
    CharacteristicMatrix::new(unit, vec![], vec![(delay, coupled), (0.0, damping)]).unwrap()
}

#[test]
fn a_single_state_is_a_quasi_polynomial() {
    let task = Task::new();
    let system = CharacteristicMatrix::new(
        vec![vec![1.0]],
        vec![(0.36, vec![vec![0.3]])],
        vec![(0.36, vec![vec![-2.0]])],
    )
    .unwrap();
    let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![2.0, 0.3]], vec![0.0, 0.36]).unwrap();
    for (re, im) in [
        ((-12.0, 2.0), (0.0, 100.0)),
        ((-3.3, 1.0), (-40.0, 50.0)),
        ((-30.0, 1.0), (3.0, 200.0)),
    ] {
        let region = Region::new(re, im).unwrap();
        let expected = super::super::roots(&h, &region, &task).unwrap();
        let found = roots(&system, &region, Edge::Refused, &task).unwrap();
        assert_eq!(found.counted, expected.counted);
        assert_eq!(
            count(&system, &region, Edge::Refused, &task).unwrap(),
            expected.counted
        );
        for (k, root) in found.roots.iter().enumerate() {
            assert!(found.radii[k] < 1e-10 * root.norm());
            let near = expected
                .roots
                .iter()
                .any(|r| (r - root).norm() <= found.radii[k] + 1e-13);
            assert!(near);
        }
    }
    let set = rightmost(&system, 1, &task).unwrap();
    assert!((set.roots[0].re + 3.316_780_322_147_385).abs() <= set.radii[0]);
    assert!(is_stable(&system, true, &task).unwrap());
}

#[test]
fn rings_have_the_roots_of_their_modes() {
    let task = Task::new();
    let n = 8;
    let system = ring(n, 0.5, 0.8);
    let whole = Region::new((-4.0, 2.0), (-20.0, 20.0)).unwrap();
    let set = roots(&system, &whole, Edge::Refused, &task).unwrap();
    let parts: u64 = [(-20.0, 3.03), (3.03, 20.0)]
        .map(|im| {
            count(
                &system,
                &Region::new((-4.0, 2.0), im).unwrap(),
                Edge::Refused,
                &task,
            )
            .unwrap()
        })
        .iter()
        .sum();
    assert_eq!(set.counted, parts);
    for root in &set.roots {
        let least = (0..n)
            .map(|k| {
                let angle = std::f64::consts::TAU * k as f64 / n as f64;
                let mode = Complex64::new(angle.cos() - 1.0, angle.sin()) * 0.8;
                (root + 0.5 - mode * (-0.5 * root).exp()).norm()
            })
            .fold(f64::INFINITY, f64::min);
        assert!(least < 1e-10);
    }
}
