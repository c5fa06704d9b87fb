//! Misfit at the lines of a spectrum (Pintelon & Schoukens 2012, chapters 8 to 12).
//!
//! Of a periodic experiment, the DFT of period m at the lines that the reference excites is U_m, Y_m; noise
//! differs from period to period, the response to the reference does not. Means over M periods have 1/M
//! of the covariances between the periods (section 10.2). The spectrum of the noise is smooth, so
//! covariances are also averaged over neighbouring lines. With G = gain H(z) the misfit of a line is
//! (Y − G U)/sqrt(s_y² + |G|² s_u² − 2 Re(s_yu G*)).
//!
//! Of one record, the misfit are the lines of y − gain F(t − Td) but for the mean. All of them have the
//! sum of squares of what they are lines of (Parseval), which then stands for them.

use num_complex::Complex64;

use super::super::least_squares::{Part, quotients};
use super::correlation::spectrum;
use super::held::{HeldPath, held_transfer};
use crate::{Error, Task};

/// What is known of spectra.
struct Spectra {
    /// Lines to either side over which covariances are averaged: with three more, standard errors are
    /// 10 % too small, because noise in a loop is not flat; with none, few periods are not enough.
    neighbours: usize,
    /// Least standard deviation of a line, as a share of the largest output: rounding.
    rounding: f64,
}

const SPECTRA: Spectra = Spectra {
    neighbours: 1,
    rounding: 1e-9,
};

/// Delay, gain and lag: known, or their places in a point.
#[derive(Debug, Clone)]
pub struct Plain {
    /// Where they are not fitted.
    pub known: [f64; 3],
    /// Where they are.
    pub places: [Option<usize>; 3],
    /// Time between two rows, s.
    pub row: f64,
}

impl Plain {
    fn at(&self, point: &[f64]) -> [f64; 3] {
        std::array::from_fn(|i| self.places[i].map_or(self.known[i], |place| point[place]))
    }

    fn slopes(
        &self,
        point: &[f64],
        misfit: impl Fn(&[f64]) -> Result<Vec<f64>, Error>,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let is_gain = |index: usize| self.places[1] == Some(index);
        let unit = |index: usize| if is_gain(index) { 0.0 } else { self.row };
        let units: Vec<f64> = (0..point.len()).map(unit).collect();
        quotients(misfit, point, &units, |index| !is_gain(index))
    }
}

/// The lines of periods, their noise known by the scatter between them.
#[derive(Debug, Clone)]
pub struct PeriodicLines {
    numbers: Plain,
    z: Vec<Complex64>,
    input: Vec<Complex64>,
    output: Vec<Complex64>,
    input_variance: Vec<f64>,
    output_variance: Vec<f64>,
    covariance: Vec<Complex64>,
    /// Lines whose covariances are averaged at the ends.
    pub together: usize,
}

impl PeriodicLines {
    /// From whole periods of this many samples.
    pub fn new(
        numbers: Plain,
        command: &[f64],
        output: &[f64],
        samples: usize,
        lines: &[usize],
    ) -> Self {
        let turn = |k: usize| {
            let angle = 2.0 * std::f64::consts::PI * k as f64 / samples as f64;
            Complex64::new(libm::cos(angle), libm::sin(angle))
        };
        let turns: Vec<Complex64> = (0..samples).map(turn).collect();
        let at_line = |period: &[f64], line: usize| -> Complex64 {
            let mut place = 0;
            let mut sum = Complex64::ZERO;
            for x in period {
                sum += x * turns[place].conj();
                place = (place + line) % samples;
            }
            sum
        };
        let spectra = |values: &[f64]| -> Vec<Vec<Complex64>> {
            let of = |line: &usize| {
                values
                    .chunks_exact(samples)
                    .map(|p| at_line(p, *line))
                    .collect()
            };
            lines.iter().map(of).collect()
        };
        let (u, y) = (spectra(command), spectra(output));
        let mean = |x: &Vec<Complex64>| x.iter().sum::<Complex64>() / x.len() as f64;
        let (input, mean_y): (Vec<_>, Vec<_>) =
            (u.iter().map(mean).collect(), y.iter().map(mean).collect());
        let scatter =
            |a: &[Vec<Complex64>], at: &[Complex64], b: &[Vec<Complex64>], bt: &[Complex64]| {
                let lines = a.iter().zip(at).zip(b.iter().zip(bt));
                let sums = lines.map(|((a, at), (b, bt))| {
                    let count = a.len() as f64;
                    let pairs = a.iter().zip(b);
                    let sum: Complex64 = pairs.map(|(x, y)| (x - at) * (y - bt).conj()).sum();
                    sum / (count * (count - 1.0))
                });
                averaged(&sums.collect::<Vec<_>>())
            };
        let real = |x: Vec<Complex64>| x.iter().map(|x| x.re).collect();
        Self {
            numbers,
            z: lines.iter().map(|line| turns[line % samples]).collect(),
            input_variance: real(scatter(&u, &input, &u, &input)),
            output_variance: real(scatter(&y, &mean_y, &y, &mean_y)),
            covariance: scatter(&y, &mean_y, &u, &input),
            input,
            output: mean_y,
            together: lines.len().min(SPECTRA.neighbours + 1),
        }
    }
}

/// Means over neighbouring lines.
fn averaged(sums: &[Complex64]) -> Vec<Complex64> {
    let reach = SPECTRA.neighbours;
    if sums.len() < 2 * reach + 1 {
        let mean = sums.iter().sum::<Complex64>() / sums.len() as f64;
        return vec![mean; sums.len()];
    }
    let near = |i: usize| &sums[i.saturating_sub(reach)..(i + reach + 1).min(sums.len())];
    let mean = |part: &[Complex64]| part.iter().sum::<Complex64>() / part.len() as f64;
    (0..sums.len()).map(|i| mean(near(i))).collect()
}

impl Part for PeriodicLines {
    fn misfit(&self, point: &[f64], _: &Task) -> Result<Vec<f64>, Error> {
        let [delay, gain, lag] = self.numbers.at(point);
        let largest = self.output.iter().map(|y| y.norm()).fold(0.0, f64::max);
        let floor = (SPECTRA.rounding * largest).powi(2);
        let mut lines = Vec::new();
        for (i, z) in self.z.iter().enumerate() {
            let g = gain * held_transfer(*z, delay, lag, self.numbers.row);
            let variance = self.output_variance[i] + g.norm_sqr() * self.input_variance[i]
                - 2.0 * (self.covariance[i] * g.conj()).re;
            // Per real part; the sum of squares of all parts is then a chi-square.
            lines.push((self.output[i] - g * self.input[i]) / (0.5 * variance.max(floor)).sqrt());
        }
        Ok(parts(&lines))
    }

    fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        self.numbers.slopes(point, |point| self.misfit(point, task))
    }
}

/// Real parts, then imaginary ones.
fn parts(lines: &[Complex64]) -> Vec<f64> {
    let real = lines.iter().map(|x| x.re);
    real.chain(lines.iter().map(|x| x.im)).collect()
}

/// The lines of one record.
#[derive(Debug, Clone)]
pub struct RecordLines {
    /// Delay, gain and lag.
    pub numbers: Plain,
    /// The plant under its commands.
    pub path: HeldPath,
    /// Time stamps.
    pub time: Vec<f64>,
    /// What was recorded.
    pub output: Vec<f64>,
    /// Lines from the first to this one; all where there is none.
    pub last: Option<usize>,
}

impl Part for RecordLines {
    fn misfit(&self, point: &[f64], _: &Task) -> Result<Vec<f64>, Error> {
        let [delay, gain, lag] = self.numbers.at(point);
        let times: Vec<f64> = self.time.iter().map(|t| t - delay).collect();
        let path = self.path.at(&times, lag).value;
        let mut left: Vec<f64> = self
            .output
            .iter()
            .zip(path)
            .map(|(y, f)| y - gain * f)
            .collect();
        let mean = left.iter().sum::<f64>() / left.len() as f64;
        left.iter_mut().for_each(|x| *x -= mean);
        let Some(last) = self.last else {
            return Ok(left);
        };
        let size = left.len();
        let weight = |line: usize| if 2 * line == size { 1.0 } else { 2.0 } / size as f64;
        let lines = spectrum(&left).into_iter().enumerate().skip(1).take(last);
        let weighted = lines.map(|(line, x)| weight(line).sqrt() * x);
        Ok(parts(&weighted.collect::<Vec<_>>()))
    }

    fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        self.numbers.slopes(point, |point| self.misfit(point, task))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spectrum_of_any_length_is_that_of_its_sums() {
        for n in [2, 7, 12, 30] {
            let x: Vec<f64> = (0..n).map(|i| libm::sin(0.7 * (i * i) as f64)).collect();
            for (line, found) in spectrum(&x).iter().enumerate() {
                let turn = |t: usize| {
                    let angle = -2.0 * std::f64::consts::PI * (line * t) as f64 / n as f64;
                    Complex64::new(libm::cos(angle), libm::sin(angle))
                };
                let sum: Complex64 = x.iter().enumerate().map(|(t, x)| x * turn(t)).sum();
                assert!((found - sum).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn all_lines_have_the_sum_of_squares_of_the_record() {
        let time: Vec<f64> = (0..41).map(|i| 0.1 * f64::from(i)).collect();
        let output: Vec<f64> = time.iter().map(|t| libm::sin(3.0 * t)).collect();
        let command: Vec<f64> = time.iter().map(|t| libm::cos(2.0 * t)).collect();
        let lines = |last| RecordLines {
            numbers: Plain {
                known: [0.0, 1.0, 0.1],
                places: [Some(0), None, None],
                row: 0.1,
            },
            path: HeldPath::new(time.clone(), command.clone()),
            time: time.clone(),
            output: output.clone(),
            last,
        };
        let power = |last| -> f64 {
            let misfit = lines(last).misfit(&[0.23], &Task::new()).unwrap();
            misfit.iter().map(|x| x * x).sum()
        };
        assert!((power(None) / power(Some(20)) - 1.0).abs() < 1e-12);
    }
}
