//! Explicit Runge–Kutta formulas of fixed step, by the names block-diagram tools give them.
//!
//! ode1: Euler. ode2: Heun's trapezoidal formula. ode3: Bogacki and Shampine (Appl. Math. Lett. 2,
//! 1989, the third-order formula). ode4: the classical formula of Kutta. ode5: Dormand and Prince
//! (J. Comput. Appl. Math. 6, 1980, the fifth-order formula, six stages). ode8: Prince and Dormand
//! (J. Comput. Appl. Math. 7, 1981, the eighth-order formula of RK8(7)13M). Stage i is evaluated
//! at t + c_i h with y + h Σ_j a_ij k_j; the step adds h Σ b_i k_i.

use super::prince_dormand::ODE8;

/// One formula.
#[derive(Debug)]
pub(super) struct Tableau {
    /// c_i.
    pub(super) nodes: &'static [f64],
    /// a_ij, row i with the entries j < i.
    pub(super) rows: &'static [&'static [f64]],
    /// b_i.
    pub(super) weights: &'static [f64],
}

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

const ODE1: Tableau = Tableau {
    nodes: &[0.0],
    rows: &[&[]],
    weights: &[1.0],
};

const ODE2: Tableau = Tableau {
    nodes: &[0.0, 1.0],
    rows: &[&[], &[1.0]],
    weights: &[0.5, 0.5],
};

const ODE3: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.75],
    rows: &[&[], &[0.5], &[0.0, 0.75]],
    weights: &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0],
};

const ODE4: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.5, 1.0],
    rows: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
};

const ODE5: Tableau = Tableau {
    nodes: &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0],
    rows: &[
        &[],
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[
            19372.0 / 6561.0,
            -25360.0 / 2187.0,
            64448.0 / 6561.0,
            -212.0 / 729.0,
        ],
        &[
            9017.0 / 3168.0,
            -355.0 / 33.0,
            46732.0 / 5247.0,
            49.0 / 176.0,
            -5103.0 / 18656.0,
        ],
    ],
    weights: &[
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_the_sums_of_their_rows_and_weights_sum_to_one() {
        for (name, solver) in Solver::NAMED {
            let formula = solver.tableau();
            assert_eq!(formula.nodes.len(), formula.weights.len(), "{name}");
            // The published coefficients of ode8 are fractions good to 18 digits.
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
