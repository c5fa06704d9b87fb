//! The equations of a loop: x′ = A x + B w + E r, u = K x + L w + M r, y = C x + D w.
//!
//! The plant has its observable canonical form, the controller's states follow: the integral of the
//! error, then the filter of the derivative with the derivative over ω as its second state.

use deadtime::Error;
use deadtime::dde::{Equations, LinearLoop};

use crate::control_loop::{ControlLoop, Number};

/// What moves the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Input {
    Reference,
    /// Added to the command where it reaches the plant.
    Load,
}

/// x′ = A x + B w, y = C x + D w.
struct Plant {
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
    d: f64,
}

/// The controller: x′ = A x + B y + E r, u = C x + p y + q y′ + M r.
struct Controller {
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
    e: Vec<f64>,
    c: Vec<f64>,
    p: f64,
    q: f64,
    m: f64,
    impulse: f64,
}

impl ControlLoop {
    fn plant(&self) -> Plant {
        let parts = self.polynomials(&[]);
        let (den, num) = (parts.a.numbers(), parts.b.numbers());
        let lead = den.first().copied().unwrap_or(1.0);
        let n = den.len().saturating_sub(1);
        let gain = |power: usize| {
            let place = (power + num.len()).checked_sub(den.len());
            place
                .and_then(|place| num.get(place))
                .map_or(0.0, |c| c / lead)
        };
        let d = gain(0);
        let poles: Vec<f64> = den.iter().skip(1).map(|c| c / lead).collect();
        let row = |i: usize, pole: f64| {
            let entry = |j: usize| {
                if j == 0 {
                    0.0 - pole
                } else {
                    f64::from(u8::from(j == i + 1))
                }
            };
            (0..n).map(entry).collect::<Vec<f64>>()
        };
        Plant {
            a: poles.iter().enumerate().map(|(i, p)| row(i, *p)).collect(),
            b: poles
                .iter()
                .enumerate()
                .map(|(i, p)| gain(i + 1) - p * d)
                .collect(),
            d,
        }
    }

    fn controller(&self) -> Controller {
        let (terms, kd) = (self.terms, self.number(Number::Kd));
        let on_error = f64::from(u8::from(terms.derivative_of_error));
        let size = usize::from(terms.integrates) + 2 * usize::from(terms.filter.is_some());
        let mut made = Controller {
            a: vec![vec![0.0; size]; size],
            b: Vec::new(),
            e: Vec::new(),
            c: Vec::new(),
            p: -self.number(Number::Kp),
            q: 0.0,
            m: self.number(Number::Kp),
            impulse: 0.0,
        };
        if terms.integrates {
            made.b.push(-1.0);
            made.e.push(1.0);
            made.c.push(self.number(Number::Ki));
        }
        match terms.filter {
            Some((omega, damping)) => {
                let first = made.b.len();
                if let Some([one, two]) = made.a.get_mut(first..first + 2) {
                    one[first + 1] = omega;
                    two[first] = -omega;
                    two[first + 1] = -2.0 * damping * omega;
                }
                made.b.extend([0.0, omega]);
                made.e.extend([-on_error * 0.0, -on_error * omega]);
                made.c.extend([0.0, -kd * omega]);
            }
            None if terms.differentiates => {
                made.q = -kd;
                made.impulse = on_error * kd;
            }
            None => {}
        }
        made
    }

    /// The loop for the kernels that take steps in time.
    ///
    /// # Errors
    /// [`Error::Argument`] for an ideal derivative of a plant that passes its command straight to its
    /// output, for a load of such a plant, or for numbers that the kernel refuses.
    pub(crate) fn linear(&self, input: Input) -> Result<LinearLoop, Error> {
        let (plant, controller) = (self.plant(), self.controller());
        let (n, m) = (plant.b.len(), controller.b.len());
        let q = controller.q;
        if plant.d != 0.0 && (q != 0.0 || input == Input::Load) {
            return Err(Error::argument(
                "the plant passes its command straight to its output: it has no ideal derivative \
                 (filter it), and no response to a load here",
            ));
        }
        let mut a = vec![0.0; (n + m) * (n + m)];
        let mut put = |i: usize, j: usize, value: f64| {
            if let Some(place) = a.get_mut(i * (n + m) + j) {
                *place = value;
            }
        };
        for (i, row) in plant.a.iter().enumerate() {
            row.iter().enumerate().for_each(|(j, c)| put(i, j, *c));
        }
        for (i, row) in controller.a.iter().enumerate() {
            row.iter()
                .enumerate()
                .for_each(|(j, c)| put(n + i, n + j, *c));
        }
        // y = x₁ + D w.
        for (i, b) in controller.b.iter().enumerate().filter(|_| n > 0) {
            put(n + i, 0, *b);
        }
        let of_output = |i: usize| f64::from(u8::from(n > 0 && i == 0));
        let slope = |i: usize| {
            plant
                .a
                .first()
                .and_then(|row| row.get(i))
                .copied()
                .unwrap_or(0.0)
        };
        let own = (0..n).map(|i| {
            let k = controller.p * of_output(i);
            if q == 0.0 { k } else { k + q * slope(i) }
        });
        let direct = plant.b.first().copied().unwrap_or(0.0);
        let b: Vec<f64> = plant
            .b
            .iter()
            .copied()
            .chain(controller.b.iter().map(|b| b * plant.d))
            .collect();
        let (e, of_input, impulse) = match input {
            Input::Reference => {
                let e = std::iter::repeat_n(0.0, n).chain(controller.e.iter().copied());
                (e.collect(), controller.m, controller.impulse)
            }
            Input::Load => (b.clone(), q * direct, 0.0),
        };
        let mut l = controller.p * plant.d;
        if q != 0.0 {
            l += q * direct;
        }
        let equations = Equations {
            a,
            e,
            k: own.chain(controller.c.iter().copied()).collect(),
            l,
            m: of_input,
            c: (0..n + m).map(of_output).collect(),
            d: plant.d,
            impulse,
            b,
        };
        LinearLoop::new(
            equations,
            self.number(Number::Delay),
            self.sample_time(),
            self.limit,
        )
    }
}
