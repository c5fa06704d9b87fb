//! One integrator whose command depends on nothing but its state, in elements of one delay.
//!
//! From x′(t) = b (M r + k x(t − Td)) + E r follows, with v_m = x′ at the start of element m and
//! v_0 = b u_0 + E r of the command u_0 before the start,
//!
//!   x(σ) = x(0) + Σ_j g_j v_{m−j} σ^{j+1},  g_j = Td (k b Td)^j/(j + 1)!,  j = 0, 1, …, m,
//!
//! on element m: no coefficient waits for another one.

use crate::dde::control_loop::series::DEGREE;

use super::polynomial::Polynomial;

/// Slopes that are kept, those in use among them. More are moved more rarely.
const ROOM: usize = 4 * DEGREE;

/// The slopes at the starts of the last elements.
pub(super) struct Slopes {
    /// The last one stands at `last`, each one before it behind.
    values: [f64; ROOM],
    last: usize,
    /// g_j.
    gains: [f64; DEGREE],
}

impl Slopes {
    /// For k b, the delay, and the slope at the start.
    #[inline(always)]
    pub(super) fn new(feedback: f64, delay: f64, first: f64) -> Self {
        let mut gains = [0.0; DEGREE];
        let mut gain = delay;
        for (j, place) in gains.iter_mut().enumerate() {
            *place = gain;
            gain *= feedback * delay * (1.0 / (j + 2) as f64);
        }
        let mut values = [0.0; ROOM];
        let last = ROOM - DEGREE;
        values[last] = first;
        Self {
            values,
            last,
            gains,
        }
    }

    /// Let x be the state on the element whose slope at the start came last.
    #[inline(always)]
    pub(super) fn integrate(&self, x: &mut Polynomial, start: f64) {
        if let Some(slopes) = self.values[self.last..].first_chunk() {
            x.integrate(start, &self.gains, slopes);
        }
    }

    /// Go to the next element.
    #[inline(always)]
    pub(super) fn push(&mut self, slope: f64) {
        if self.last == 0 {
            self.values.copy_within(..DEGREE - 1, ROOM - DEGREE + 1);
            self.last = ROOM - DEGREE + 1;
        }
        self.last -= 1;
        self.values[self.last] = slope;
    }
}
