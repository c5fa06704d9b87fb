//! The fixed-step solvers, by the names block-diagram tools give them.

use super::prince_dormand::ODE8;
use super::tableau::{ODE1, ODE2, ODE3, ODE4, ODE5, Tableau};

/// A fixed-step solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Solver {
    /// Euler, order 1.
    Ode1,
    /// Heun, order 2.
    Ode2,
    /// Bogacki–Shampine, order 3.
    Ode3,
    /// Kutta, order 4.
    Ode4,
    /// Dormand–Prince, order 5.
    Ode5,
    /// Prince–Dormand, order 8.
    Ode8,
}

impl Solver {
    /// All of them, by name.
    pub const NAMED: [(&'static str, Self); 6] = [
        ("ode1", Self::Ode1),
        ("ode2", Self::Ode2),
        ("ode3", Self::Ode3),
        ("ode4", Self::Ode4),
        ("ode5", Self::Ode5),
        ("ode8", Self::Ode8),
    ];

    /// The solver of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED
            .into_iter()
            .find_map(|(known, solver)| (known == name).then_some(solver))
    }

    pub(super) fn tableau(self) -> &'static Tableau {
        match self {
            Self::Ode1 => &ODE1,
            Self::Ode2 => &ODE2,
            Self::Ode3 => &ODE3,
            Self::Ode4 => &ODE4,
            Self::Ode5 => &ODE5,
            Self::Ode8 => &ODE8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_the_sums_of_their_rows_and_weights_sum_to_one() {
        for (name, solver) in Solver::NAMED {
            let formula = solver.tableau();
            assert_eq!(formula.nodes.len(), formula.weights.len(), "{name}");
            // The published coefficients of ode8 are fractions with an accuracy of 18 digits.
            let sum: f64 = formula.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-15, "{name}: {sum}");
            for (node, row) in formula.nodes.iter().zip(formula.rows) {
                // Entries of up to 36 cancel in a row.
                let sum: f64 = row.iter().sum();
                assert!((sum - node).abs() < 2e-14, "{name}: {sum} {node}");
            }
        }
    }

    #[test]
    fn errors_of_a_smooth_equation_fall_with_the_order_of_the_formula() {
        // y' = cos(t) y, y = e^(sin t): the error over halved steps.
        let orders = [1.0, 2.0, 3.0, 4.0, 5.0, 8.0];
        for ((name, solver), order) in Solver::NAMED.into_iter().zip(orders) {
            let formula = solver.tableau();
            let error = |steps: u32| {
                let h = 2.0 / f64::from(steps);
                let mut y = 1.0;
                for k in 0..steps {
                    let t = f64::from(k) * h;
                    let mut slopes: Vec<f64> = Vec::new();
                    for (node, row) in formula.nodes.iter().zip(formula.rows) {
                        let inner: f64 = row.iter().zip(&slopes).map(|(a, k)| a * k).sum();
                        slopes.push((t + node * h).cos() * (y + h * inner));
                    }
                    let sum: f64 = formula
                        .weights
                        .iter()
                        .zip(&slopes)
                        .map(|(b, k)| b * k)
                        .sum();
                    y += h * sum;
                }
                (y - 2.0_f64.sin().exp()).abs()
            };
            let (coarse, fine) = if order > 6.0 { (4, 8) } else { (32, 64) };
            let seen = (error(coarse) / error(fine)).log2();
            assert!((seen - order).abs() < 0.6, "{name}: order {seen}");
        }
    }
}
