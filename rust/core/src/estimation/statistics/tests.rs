//! Against values computed with 40 digits, by mpmath 1.3.
use super::*;

/// Largest error of `found` as a share of the value of the table.
fn worst<const N: usize>(table: &[[f64; N]], found: impl Fn(&[f64; N]) -> f64) -> f64 {
    let errors = table
        .iter()
        .map(|row| (found(row) / row[N - 1] - 1.0).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn tails_of_chi_squared_are_those_of_the_table() {
    let table = [
        [1e-06, 1.0, 0.9992021155721779],
        [0.3, 1.0, 0.5838824207703652],
        [3.7, 1.0, 0.05441246799160142],
        [60.0, 1.0, 9.485737571073848e-15],
        [2.9, 2.0, 0.23457028809379765],
        [18.3, 10.0, 0.05010906141146245],
        [37.2, 18.44, 0.005949373329091163],
        [5.0, 20.0, 0.9997226479053791],
        [900.0, 20.0, 7.859350439695908e-178],
        [100000.0, 99000.5, 0.012539439645846166],
    ];
    assert!(worst(&table, |row| chi_squared_beyond(row[0], row[1])) < 1e-9);
    assert_eq!(chi_squared_beyond(0.0, 3.0), 1.0);
    assert_eq!(chi_squared_beyond(f64::INFINITY, 3.0), 0.0);
}

#[test]
fn tails_of_f_are_those_of_the_table() {
    let table = [
        [0.2, 3.3, 8.1, 0.9072829663991231],
        [1.0, 40.0, 40.0, 0.5],
        [1.7, 11.3, 95.2, 0.08297442893865498],
        [4.4, 60.5, 3.2, 0.11190787826840941],
        [12.0, 9.9, 400.5, 4.699829115404836e-18],
        [1.02, 60000.0, 31000.5, 0.022818464430860247],
        [0.001, 2.0, 5.0, 0.9990006995802309],
    ];
    assert!(worst(&table, |row| f_beyond(row[0], row[1], row[2])) < 1e-9);
    assert_eq!(f_beyond(0.0, 3.0, 4.0), 1.0);
}

#[test]
fn reaches_of_students_distribution_are_those_of_the_table() {
    let table = [
        [0.5, 1.0, 1.0],
        [0.95, 1.0, 12.706204736174692],
        [0.95, 4.0, 2.7764451051977934],
        [0.95, 8.4, 2.2870293755125255],
        [0.999, 2.5, 18.27789352813064],
        [0.9, 30.0, 1.697260886593958],
        [0.95, 300.0, 1.9679030112610867],
        [0.99, 9999.0, 2.5763210958565974],
        [0.95, 10001.0, 1.9602012161646407],
        [0.95, 10000000.0, 1.959964221767205],
    ];
    assert!(worst(&table, |row| student_reach(row[0], row[1])) < 1e-11);
}

#[test]
fn normal_tails_and_quantiles_are_those_of_the_table() {
    let table = [
        [-2.0, 0.9772498680518208],
        [0.0, 0.5],
        [0.3, 0.3820885778110474],
        [2.5, 0.006209665325776135],
        [9.0, 1.1285884059538405e-19],
        [30.0, 4.906713927148187e-198],
    ];
    assert!(worst(&table, |row| normal_beyond(row[0])) < 1e-12);
    for probability in [0.01, 0.4, 0.9, 0.975, 0.99, 1.0 - 1e-9] {
        let found = normal_beyond(normal_quantile(probability)) / (1.0 - probability);
        assert!((found - 1.0).abs() < 1e-6, "{probability} {found}");
    }
}
