//! What a loop feels of a plant behind a delay: size, angle and equivalent delay at frequencies.

use std::f64::consts::FRAC_PI_2;

use num_complex::Complex64;

use super::polynomial::roots;
use crate::elementary::log;

/// A plant at some frequencies.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Felt {
    /// Logarithm of its size.
    pub size: Vec<f64>,
    /// Its angle, rad, without jumps; of −G where its gain is negative.
    pub angle: Vec<f64>,
    /// −(angle + 90° for each integrator)/ω, s.
    pub delay: Vec<f64>,
}

/// The plant num/den, coefficients from the highest power on, behind a delay.
pub fn felt(num: &[f64], den: &[f64], late: f64, omega: &[f64]) -> Felt {
    let zeros = roots(num).unwrap_or_default();
    let (at_zero, poles): (Vec<_>, Vec<_>) = roots(den)
        .unwrap_or_default()
        .into_iter()
        .partition(|pole| *pole == Complex64::ZERO);
    let turned = FRAC_PI_2 * at_zero.len() as f64;
    let turn = |root: &Complex64, at: f64| (Complex64::ONE - Complex64::I * at / root).arg();
    let mut found = Felt::default();
    for at in omega {
        let above: f64 = zeros.iter().map(|zero| turn(zero, *at)).sum();
        let below: f64 = poles.iter().map(|pole| turn(pole, *at)).sum();
        let angle = -at * late - turned + above - below;
        let s = Complex64::new(0.0, *at);
        let value = |part: &[f64]| {
            let sum = part.iter().fold(Complex64::ZERO, |sum, c| sum * s + c);
            sum.norm()
        };
        found.size.push(log(value(num) / value(den)));
        found.angle.push(angle);
        found.delay.push(-(angle + turned) / at);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_integrator_behind_a_lag_and_a_delay() {
        // 2 e^(−0.1 s)/(s (0.5 s + 1)) at 2 rad/s.
        let found = felt(&[2.0], &[0.5, 1.0, 0.0], 0.1, &[2.0]);
        assert!((found.size[0] - (1.0 / 2.0_f64.sqrt()).ln()).abs() < 1e-14);
        let angle = -FRAC_PI_2 - 0.2 - 1.0_f64.atan();
        assert!((found.angle[0] - angle).abs() < 1e-14);
        assert!((found.delay[0] + (angle + FRAC_PI_2) / 2.0).abs() < 1e-14);
    }
}
