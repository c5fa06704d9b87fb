//! Against values of 40 digits, by mpmath 1.3.
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
        [1e-06, 1.0, 0.99920211557217787],
        [0.3, 1.0, 0.58388242077036518],
        [3.7, 1.0, 0.054412467991601421],
        [60.0, 1.0, 9.4857375710738484e-15],
        [2.9, 2.0, 0.23457028809379766],
        [18.3, 10.0, 0.050109061411462452],
        [37.2, 18.44, 0.0059493733290911633],
        [5.0, 20.0, 0.99972264790537916],
        [900.0, 20.0, 7.8593504396959082e-178],
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
        [1.7, 11.3, 95.2, 0.082974428938654981],
        [4.4, 60.5, 3.2, 0.11190787826840941],
        [12.0, 9.9, 400.5, 4.6998291154048363e-18],
        [1.02, 60000.0, 31000.5, 0.022818464430860246],
        [0.001, 2.0, 5.0, 0.99900069958023088],
    ];
    assert!(worst(&table, |row| f_beyond(row[0], row[1], row[2])) < 1e-9);
    assert_eq!(f_beyond(0.0, 3.0, 4.0), 1.0);
}

#[test]
fn reaches_of_students_distribution_are_those_of_the_table() {
    let table = [
        [0.5, 1.0, 1.0],
        [0.95, 1.0, 12.706204736174693],
        [0.95, 4.0, 2.7764451051977935],
        [0.95, 8.4, 2.2870293755125256],
        [0.999, 2.5, 18.277893528130641],
        [0.9, 30.0, 1.697260886593958],
        [0.95, 300.0, 1.9679030112610866],
        [0.99, 9999.0, 2.5763210958565974],
        [0.95, 10001.0, 1.9602012161646407],
        [0.95, 10000000.0, 1.9599642217672051],
    ];
    assert!(worst(&table, |row| student_reach(row[0], row[1])) < 1e-11);
}

#[test]
fn normal_tails_and_quantiles_are_those_of_the_table() {
    let table = [
        [-2.0, 0.97724986805182079],
        [0.0, 0.5],
        [0.3, 0.38208857781104737],
        [2.5, 0.0062096653257761352],
        [9.0, 1.1285884059538406e-19],
        [30.0, 4.9067139271481871e-198],
    ];
    assert!(worst(&table, |row| normal_beyond(row[0])) < 1e-12);
    for probability in [0.01, 0.4, 0.9, 0.975, 0.99, 1.0 - 1e-9] {
        let found = normal_beyond(normal_quantile(probability)) / (1.0 - probability);
        assert!((found - 1.0).abs() < 1e-6, "{probability} {found}");
    }
}
