//! Eigenvalues against closed forms, invariants and the smallest singular value.

use super::*;
use crate::linear_algebra::elimination::Eliminated;
use crate::linear_algebra::rows::Rows;

const UNIT: f64 = f64::EPSILON;

/// Numbers in −1 … 1.
fn random(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let next = |_| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / 2f64.powi(52) - 1.0
    };
    (0..count).map(next).collect()
}

fn filled(n: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    (0..n * n).map(|at| entry(at / n, at % n)).collect()
}

/// x^n + …, from its coefficients without the first, falling.
fn companion(coefficients: &[f64]) -> Vec<f64> {
    filled(coefficients.len(), |i, j| match i {
        0 => -coefficients[j],
        _ => f64::from(u8::from(j + 1 == i)),
    })
}

/// The coefficients of Π (x − z) without the first, falling.
fn polynomial(roots: &[Complex64]) -> Vec<f64> {
    let mut found = vec![Complex64::ONE];
    for z in roots {
        found.push(Complex64::ZERO);
        for k in (1..found.len()).rev() {
            let before = found[k - 1];
            found[k] -= z * before;
        }
    }
    found[1..].iter().map(|c| c.re).collect()
}

fn real(list: &[f64]) -> Vec<Complex64> {
    list.iter().copied().map(Complex64::from).collect()
}

/// H A H with the reflection H = I − 2 v vᵀ / vᵀv of a vector without zeros.
fn reflected(a: &[f64], n: usize) -> Vec<f64> {
    let v: Vec<f64> = (0..n).map(|i| 1.0 / (i + 2) as f64).collect();
    let square: f64 = v.iter().map(|v| v * v).sum();
    let h = filled(n, |i, j| {
        f64::from(u8::from(i == j)) - 2.0 * v[i] * v[j] / square
    });
    let product =
        |a: &[f64], b: &[f64]| filled(n, |i, j| (0..n).map(|k| a[i * n + k] * b[k * n + j]).sum());
    product(&product(&h, a), &h)
}

/// Each known eigenvalue is the nearest one left of those found, within an error.
fn assert_close(a: &[f64], n: usize, known: &[Complex64], error: f64) {
    let mut found = eigenvalues(a, n).unwrap();
    assert_eq!(found.len(), known.len());
    for z in known {
        let gap = |w: &Complex64| (w - z).norm();
        let near = (0..found.len()).min_by(|i, j| gap(&found[*i]).total_cmp(&gap(&found[*j])));
        let near = found.swap_remove(near.unwrap());
        assert!(
            gap(&near) <= error,
            "{near} is not {z} within {error:e}, n = {n}"
        );
    }
}

#[test]
fn small_and_empty_matrices_have_formulas() {
    assert_eq!(eigenvalues(&[], 0), Some(vec![]));
    assert_eq!(eigenvalues(&[-0.1], 1), Some(real(&[-0.1])));
    for n in [1, 2, 3, 6] {
        assert_eq!(eigenvalues(&vec![0.0; n * n], n), Some(real(&vec![0.0; n])));
    }
    assert_close(&[1.0, 2.0, 0.0, -3.0], 2, &real(&[1.0, -3.0]), 0.0);
    assert_close(&[0.0, 1.0, 0.0, 0.0], 2, &real(&[0.0, 0.0]), 0.0);
    assert_close(&[2.0, 1.0, 1.0, 2.0], 2, &real(&[3.0, 1.0]), UNIT);
    let turn = [Complex64::new(0.5, 3.0), Complex64::new(0.5, -3.0)];
    assert_eq!(eigenvalues(&[0.5, 9.0, -1.0, 0.5], 2), Some(turn.to_vec()));
    // The smaller one cancels in (a + d)/2 − √…
    assert_close(&[1e9, 1.0, 1.0, 0.0], 2, &real(&[1e9, -1e-9]), 2e-7);
    let small = eigenvalues(&[1e9, 1.0, 1.0, 0.0], 2).unwrap()[1].re;
    assert!((small + 1e-9).abs() < 1e-24, "{small}");
}

#[test]
fn cyclic_permutations_have_the_roots_of_one() {
    // Double shifts alone leave them as they are.
    for n in [3, 4, 7, 30] {
        let matrix = filled(n, |i, j| f64::from(u8::from(j == (i + 1) % n)));
        let angle = |k| std::f64::consts::TAU * k as f64 / n as f64;
        let known: Vec<_> = (0..n).map(|k| Complex64::cis(angle(k))).collect();
        assert_close(&matrix, n, &known, 1e-13);
    }
}

#[test]
fn circulants_have_the_transform_of_their_row() {
    for n in [3, 8, 25] {
        let row = random(n as u64, n);
        let matrix = filled(n, |i, j| row[(j + n - i) % n]);
        let angle = |k| std::f64::consts::TAU * k as f64 / n as f64;
        let sum = |k| {
            let terms = row.iter().enumerate();
            terms
                .map(|(j, c)| c * Complex64::cis(angle(j * k % n)))
                .sum()
        };
        let known: Vec<_> = (0..n).map(sum).collect();
        // A normal matrix: the error is that of the matrix.
        assert_close(&matrix, n, &known, 20.0 * n as f64 * UNIT);
    }
}

#[test]
fn companions_have_the_roots_of_their_polynomials() {
    let pairs = [(-1.0, 2.0), (0.5, 1.0), (-3.0, 0.25)];
    let pairs = pairs.map(|(re, im)| [Complex64::new(re, im), Complex64::new(re, -im)]);
    let cases = [
        real(&[1.0, 2.0, 3.0]),
        real(&[1e-3, 1.0, 1e3, -1e3]),
        real(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        pairs.concat(),
    ];
    for roots in cases {
        // Backward stable for the balanced companion; |λ| / |p′(λ)| Σ |a_k λ^k| is below 1e8 here.
        assert_close(&companion(&polynomial(&roots)), roots.len(), &roots, 1e-9);
    }
}

#[test]
fn chains_have_their_eigenvalue_within_a_root_of_rounding() {
    for n in [2, 3, 5, 9] {
        let chain = filled(n, |i, j| match (i == j, i + 1 == j) {
            (true, _) => -0.75,
            (_, next) => f64::from(u8::from(next)),
        });
        let known = real(&vec![-0.75; n]);
        assert_close(&chain, n, &known, 0.0);
        let error = (20.0 * n as f64 * UNIT).powf(1.0 / n as f64);
        assert_close(&reflected(&chain, n), n, &known, error);
    }
}

#[test]
fn a_block_triangular_matrix_has_the_eigenvalues_of_its_blocks() {
    // 2 ± 3i, -1, 0.5 and zero in a chain of two.
    let matrix = [
        2.0, -3.0, 1.0, 4.0, 0.0, 1.0, //
        3.0, 2.0, 0.0, 1.0, 5.0, 0.0, //
        0.0, 0.0, -1.0, 7.0, 1.0, 2.0, //
        0.0, 0.0, 0.0, 0.5, 1.0, 1.0, //
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0, //
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ];
    let mut known = real(&[-1.0, 0.5, 0.0, 0.0]);
    known.extend([Complex64::new(2.0, 3.0), Complex64::new(2.0, -3.0)]);
    assert_close(&matrix, 6, &known, 1e-14);
    assert_close(&reflected(&matrix, 6), 6, &known, 1e-6);
}

#[test]
fn units_do_not_matter() {
    for n in [3, 6, 12] {
        let matrix = random(7, n * n);
        let known = eigenvalues(&matrix, n).unwrap();
        let exponent = |i: usize| (i * i * 37 % 401) as i32 - 200;
        let scaled = filled(n, |i, j| {
            libm::ldexp(matrix[i * n + j], exponent(i) - exponent(j))
        });
        assert_close(&scaled, n, &known, 1e-13);
    }
}

#[test]
fn sizes_at_the_ends_of_the_range_are_possible() {
    // Integers times the smallest number and near the largest: the matrix is exact.
    let roots = [1.0, 2.0, 4.0];
    for exponent in [-1074, -900, 900, 1018] {
        let matrix = companion(&polynomial(&real(&roots)));
        let a: Vec<f64> = matrix.iter().map(|x| libm::ldexp(*x, exponent)).collect();
        let found = eigenvalues(&a, 3).unwrap();
        let mut sizes: Vec<f64> = found.iter().map(|z| z.re).collect();
        sizes.sort_by(f64::total_cmp);
        for (size, root) in sizes.iter().zip(roots) {
            let known = libm::ldexp(root, exponent);
            assert!(
                (size - known).abs() <= 1e-13 * known,
                "{size:e} is not {known:e}"
            );
        }
    }
    // 2 MAX is no number.
    assert_eq!(eigenvalues(&[f64::MAX; 4], 2), None);
}

#[test]
fn what_is_not_finite_has_none() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(eigenvalues(&[1.0, bad, 0.0, 1.0], 2), None);
        assert_eq!(eigenvalues(&[bad], 1), None);
    }
}

#[test]
fn eigenvalues_are_those_of_a_near_matrix_with_its_trace() {
    for n in [3, 4, 5, 10, 24, 40] {
        for seed in 1..6 {
            let mut a = random(seed, n * n);
            // Some without most of their entries.
            if seed > 3 {
                let keep = random(seed + 10, n * n);
                a.iter_mut()
                    .zip(keep)
                    .filter(|(_, k)| *k > -0.4)
                    .for_each(|(a, _)| *a = 0.0);
            }
            let size = a.iter().map(|x| x * x).sum::<f64>().sqrt();
            let error = 10.0 * n as f64 * UNIT * size;
            let found = eigenvalues(&a, n).unwrap();
            let trace: f64 = a.iter().step_by(n + 1).sum();
            let sum: Complex64 = found.iter().sum();
            assert!((sum - trace).norm() <= error && sum.im == 0.0);
            for z in found {
                let mut shifted = Rows::zeros(n);
                for (at, x) in a.iter().enumerate() {
                    shifted.add(at / n, at % n, Complex64::from(*x));
                }
                (0..n).for_each(|i| shifted.add(i, i, -z));
                // The smallest singular value is at most √n over this norm.
                if let Some(factors) = Eliminated::new(shifted) {
                    let norms = factors.inverse().norms();
                    let norm = norms.iter().map(|x| x * x).sum::<f64>().sqrt();
                    assert!((n as f64).sqrt() / norm <= error, "{z}, n = {n}");
                }
            }
        }
    }
}
