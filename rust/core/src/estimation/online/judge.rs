//! Do the innovations say that the model is right?
//!
//! Under it they are white and independent of every command that was sent before (Ljung 1999,
//! section 16.6). Both are tested over a memory that fades: the product of neighbours, and the
//! covariance with changes of the command at several ages. The prediction uses only what came
//! before, so each sum is a martingale whatever the delay does.

/// Ages of changes of the command.
pub(super) const AGES: usize = 6;

/// Sums that fade.
#[derive(Debug, Clone)]
pub(super) struct Judge {
    memory: f64,
    last: Option<f64>,
    neighbours: (f64, f64),
    by_age: [f64; AGES],
    squares: [[f64; AGES]; AGES],
    rows: f64,
}

impl Judge {
    pub(super) const fn new(memory: f64) -> Self {
        Self {
            memory,
            last: None,
            neighbours: (0.0, 0.0),
            by_age: [0.0; AGES],
            squares: [[0.0; AGES]; AGES],
            rows: 0.0,
        }
    }

    /// Start again, as after a change of the delay.
    pub(super) const fn forget(&mut self) {
        *self = Self::new(self.memory);
    }

    /// A normalised innovation `length` after the one before, and the changes of the command.
    pub(super) fn hear(&mut self, innovation: f64, length: f64, changes: &[f64; AGES]) {
        let fade = (-length / self.memory).exp();
        self.rows = fade * self.rows + 1.0;
        if let Some(last) = self.last.replace(innovation) {
            let product = last * innovation;
            self.neighbours.0 = fade * self.neighbours.0 + product;
            self.neighbours.1 = fade * fade * self.neighbours.1 + product * product;
        }
        for i in 0..AGES {
            self.by_age[i] = fade * self.by_age[i] + changes[i] * innovation;
            for j in 0..AGES {
                self.squares[i][j] = fade * fade * self.squares[i][j] + changes[i] * changes[j];
            }
        }
    }

    /// The product of neighbours in its standard deviations: about Gaussian.
    pub(super) fn colour(&self) -> f64 {
        let (sum, square) = self.neighbours;
        if square > 0.0 {
            sum / square.sqrt()
        } else {
            0.0
        }
    }

    /// The covariance with the commands: about χ² of `AGES` degrees.
    pub(super) fn unexplained(&self) -> f64 {
        // Cholesky, without directions in which the command does not change.
        let most = (0..AGES).map(|i| self.squares[i][i]).fold(0.0, f64::max);
        let mut l = [[0.0; AGES]; AGES];
        let mut white = [0.0; AGES];
        let mut sum = 0.0;
        for i in 0..AGES {
            for j in 0..i {
                let inner: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
                l[i][j] = if l[j][j] > 0.0 {
                    (self.squares[i][j] - inner) / l[j][j]
                } else {
                    0.0
                };
            }
            let left = self.squares[i][i] - (0..i).map(|k| l[i][k] * l[i][k]).sum::<f64>();
            if left > 1e-9 * most && left > 0.0 {
                l[i][i] = left.sqrt();
                let explained: f64 = (0..i).map(|k| l[i][k] * white[k]).sum();
                white[i] = (self.by_age[i] - explained) / l[i][i];
                sum += white[i] * white[i];
            }
        }
        sum
    }
}

/// The variance of the white noise, from innovations over a memory that fades.
#[derive(Debug, Clone)]
pub(super) struct Scale {
    memory: f64,
    freedom: f64,
    sum: f64,
}

impl Scale {
    /// From a deviation known from as many rows as `freedom`, which may be infinite: then it stays.
    pub(super) fn new(deviation: f64, freedom: f64, memory: f64) -> Self {
        Self {
            memory,
            freedom,
            sum: deviation * deviation * if freedom.is_finite() { freedom } else { 1.0 },
        }
    }

    pub(super) fn variance(&self) -> f64 {
        if self.freedom.is_finite() {
            self.sum / self.freedom
        } else {
            self.sum
        }
    }

    /// Logarithm of the density of an innovation, but for what is the same in every cell: Student's,
    /// or where the variance is known Gauss's.
    #[inline(always)]
    pub(super) fn log_density(&self, innovation: f64, variance: f64) -> f64 {
        let square = innovation * innovation / variance;
        -0.5 * variance.ln()
            - if self.freedom.is_finite() {
                0.5 * (self.freedom + 1.0) * (square / self.sum).ln_1p()
            } else {
                0.5 * square / self.sum
            }
    }

    pub(super) fn hear(&mut self, square: f64, length: f64) {
        if self.freedom.is_finite() {
            let fade = (-length / self.memory).exp();
            self.sum = fade * self.sum + square;
            self.freedom = fade * self.freedom + 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::gaussian;
    use super::*;

    #[test]
    fn innovations_that_follow_the_command_are_seen_and_others_are_not() {
        let (noise, commands) = (gaussian(3, 4000), gaussian(4, 4000));
        let stat = |effect: f64, colour: f64| {
            let mut judge = Judge::new(30.0);
            let mut last = 0.0;
            for i in 10..4000 {
                let changes = std::array::from_fn(|k| commands[i - k]);
                let innovation = noise[i] + effect * commands[i - 3] + colour * last;
                last = innovation;
                judge.hear(innovation, 0.065, &changes);
            }
            (judge.unexplained(), judge.colour().abs())
        };
        assert!(stat(0.0, 0.0).0 < 17.0 && stat(0.0, 0.0).1 < 3.0);
        assert!(stat(0.4, 0.0).0 > 40.0);
        assert!(stat(0.0, 0.4).1 > 5.0);
    }

    #[test]
    fn the_scale_follows_the_noise() {
        let mut scale = Scale::new(0.01, 50.0, 20.0);
        for noise in gaussian(5, 3000) {
            scale.hear((0.03 * noise).powi(2), 0.065);
        }
        assert!((scale.variance().sqrt() - 0.03).abs() < 0.003);
    }
}
