//! The rows of a map of a sampled loop: a gain varies along a row, the other number across.

use deadtime::Error;
use deadtime::stability::LoopRows;

use crate::control_loop::{ControlLoop, Number};
use crate::equations::Input;

/// The gains of a controller.
const GAINS: [Number; 3] = [Number::Kp, Number::Ki, Number::Kd];

/// The arrays of [`LoopRows`].
pub(crate) struct Rows {
    rows: usize,
    states: usize,
    used: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    k: Vec<f64>,
    l: Vec<f64>,
    k_slope: Vec<f64>,
    l_slope: Vec<f64>,
    delay: Vec<f64>,
    sample_time: Vec<f64>,
    points: Vec<f64>,
}

/// One loop at gain 1, its states, and the feedback of each gain alone at 1.
struct Model {
    a: Vec<f64>,
    b: Vec<f64>,
    shares: Vec<(Number, Vec<f64>, f64)>,
}

impl ControlLoop {
    /// The gain that varies along rows: one that moves a pole at z = 1, or else the finer axis.
    pub(crate) fn along(&self, axes: [(Number, &[f64]); 2]) -> Option<usize> {
        let moves_rest = |number: Number| match number {
            Number::Gain => true,
            Number::Kp => !self.terms.integrates,
            Number::Ki => self.terms.integrates,
            _ => false,
        };
        let order = |place: &usize| {
            axes.get(*place)
                .map(|(number, points)| (moves_rest(*number), points.len(), axes.len() - place))
        };
        let is_gain = |place: &usize| axes.get(*place).is_some_and(|(one, _)| one.is_gain());
        (0..axes.len()).filter(is_gain).max_by_key(order)
    }

    fn model(&self) -> Result<Model, Error> {
        let mut alone = self.with(Number::Gain, 1.0);
        for gain in GAINS {
            alone = alone.with(gain, 0.0);
        }
        let linear = alone.linear(Input::Reference)?;
        let equations = linear.equations();
        let mut shares = Vec::new();
        for gain in GAINS {
            let linear = alone.with(gain, 1.0).linear(Input::Reference)?;
            let one = linear.equations();
            shares.push((gain, one.k.clone(), one.l));
        }
        Ok(Model {
            a: equations.a.clone(),
            b: equations.b.clone(),
            shares,
        })
    }

    /// The rows of a map, whose number `across` has these values from row to row.
    ///
    /// # Errors
    /// As [`linear`](Self::linear).
    pub(crate) fn rows(
        &self,
        across: &[(Number, f64)],
        along: Option<(Number, &[f64])>,
    ) -> Result<Rows, Error> {
        let changes = |number: Number| across.iter().any(|(one, _)| *one == number);
        let loops: Vec<Self> = across
            .iter()
            .map(|(number, value)| self.with(*number, *value))
            .collect();
        let models: Vec<Model> = if changes(Number::Lag) {
            loops.iter().map(Self::model).collect::<Result<_, _>>()?
        } else {
            vec![self.model()?]
        };
        let states = models.iter().map(|model| model.b.len()).max().unwrap_or(0);
        let mut rows = Rows {
            rows: across.len(),
            states,
            used: models.iter().map(|model| model.b.len() as f64).collect(),
            a: models
                .iter()
                .flat_map(|model| padded(&model.a, model.b.len(), states))
                .collect(),
            b: models
                .iter()
                .flat_map(|model| padded_row(&model.b, states))
                .collect(),
            k: Vec::new(),
            l: Vec::new(),
            k_slope: Vec::new(),
            l_slope: Vec::new(),
            delay: each(&loops, changes(Number::Delay), Number::Delay),
            sample_time: each(&loops, changes(Number::SampleTime), Number::SampleTime),
            points: along.map_or_else(|| vec![0.0], |(_, points)| points.to_vec()),
        };
        let along = along.map(|(number, _)| number);
        // A row for each loop where the feedback changes from row to row.
        let differs = models.len() > 1 || across.iter().any(|(number, _)| number.is_gain());
        let own = if differs {
            &loops[..]
        } else {
            loops.get(..1).unwrap_or_default()
        };
        for (index, one) in own.iter().enumerate() {
            let Some(model) = models.get(index).or(models.first()) else {
                continue;
            };
            let (mut fixed, mut slope) = ((vec![0.0; states], 0.0), (vec![0.0; states], 0.0));
            let gain = if along == Some(Number::Gain) {
                1.0
            } else {
                one.number(Number::Gain)
            };
            for (number, k, l) in &model.shares {
                let is_along = along == Some(*number);
                let own = if is_along {
                    gain
                } else {
                    gain * one.number(*number)
                };
                let into = if is_along || along == Some(Number::Gain) {
                    &mut slope
                } else {
                    &mut fixed
                };
                for (place, k) in into.0.iter_mut().zip(k) {
                    *place += own * k;
                }
                into.1 += own * l;
            }
            rows.k.extend(fixed.0);
            rows.l.push(fixed.1);
            rows.k_slope.extend(slope.0);
            rows.l_slope.push(slope.1);
        }
        Ok(rows)
    }
}

impl Rows {
    pub(crate) fn view(&self) -> LoopRows<'_> {
        LoopRows {
            rows: self.rows,
            states: self.states,
            used: &self.used,
            a: &self.a,
            b: &self.b,
            k: &self.k,
            l: &self.l,
            k_slope: &self.k_slope,
            l_slope: &self.l_slope,
            delay: &self.delay,
            sample_time: &self.sample_time,
            points: &self.points,
        }
    }
}

/// One value for all rows, or one for each.
fn each(loops: &[ControlLoop], changes: bool, number: Number) -> Vec<f64> {
    let own = if changes {
        loops
    } else {
        loops.get(..1).unwrap_or_default()
    };
    own.iter().map(|one| one.number(number)).collect()
}

fn padded_row(row: &[f64], size: usize) -> Vec<f64> {
    let mut row = row.to_vec();
    row.resize(size, 0.0);
    row
}

fn padded(matrix: &[f64], states: usize, size: usize) -> Vec<f64> {
    let mut rows: Vec<f64> = matrix
        .chunks(states.max(1))
        .flat_map(|row| padded_row(row, size))
        .collect();
    rows.resize(size * size, 0.0);
    rows
}
