//! Explicit Runge–Kutta formulas of fixed step, by the names block-diagram tools give them.
//!
//! ode1: Euler. ode2: Heun's trapezoidal formula. ode3: Bogacki and Shampine (Appl. Math. Lett. 2,
//! 1989, the third-order formula). ode4: the classical formula of Kutta. ode5: Dormand and Prince
//! (J. Comput. Appl. Math. 6, 1980, the fifth-order formula, six stages). ode8: Prince and Dormand
//! (J. Comput. Appl. Math. 7, 1981, the eighth-order formula of RK8(7)13M). Stage i is evaluated
//! at t + c_i h with y + h Σ_j a_ij k_j; the step adds h Σ b_i k_i.

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

pub(super) const ODE1: Tableau = Tableau {
    nodes: &[0.0],
    rows: &[&[]],
    weights: &[1.0],
};

pub(super) const ODE2: Tableau = Tableau {
    nodes: &[0.0, 1.0],
    rows: &[&[], &[1.0]],
    weights: &[0.5, 0.5],
};

pub(super) const ODE3: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.75],
    rows: &[&[], &[0.5], &[0.0, 0.75]],
    weights: &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0],
};

pub(super) const ODE4: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.5, 1.0],
    rows: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
};

pub(super) const ODE5: Tableau = Tableau {
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
