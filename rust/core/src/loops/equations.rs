//! The equations of a loop: x′ = A x + B w + E r, u = K x + L w + M r, y = C x + D w.
//!
//! The plant's states come first in x, the controller's after them.

use crate::Error;
use crate::dde::fixed_step::Blocks;
use crate::dde::{Equations, LinearLoop, Scalar, Update};

use super::control_loop::{ControlLoop, Values};
use super::controller::ControllerEquations;
use super::drive::{Column, Columns};
use super::entry::Number;
use super::filter::{Sampled, SampledFilter};
use super::plant::StateSpace;

/// What moves the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// The reference.
    Reference,
    /// A load, which is added to the command where it reaches the plant.
    Load,
}

impl ControlLoop {
    /// The equations for these numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for an ideal derivative of a plant that passes its command straight to its
    /// output, a load of such a plant, or a plant without a state space.
    pub fn equations<S: Number>(
        &self,
        values: &Values<S>,
        input: Input,
        sampled: Option<&SampledFilter<S>>,
    ) -> Result<Equations<S>, Error> {
        let fraction = self
            .plant()
            .fraction(&values.plant, values.given.as_ref())?;
        let plant = fraction.state_space()?;
        let controller = self.controller().equations(&values.controller, sampled);
        refuse_if!(
            !plant.d.is_zero() && !controller.q.is_zero(),
            "the plant has direct feedthrough, so its output has no ideal derivative: give the \
             controller a DerivativeFilter"
        );
        refuse_if!(
            !plant.d.is_zero() && input == Input::Load,
            "the plant has direct feedthrough, so its response to a load cannot be computed"
        );
        let first = plant.b.len();
        let tracking = self.controller().tracking(&values.controller);
        let mut equations = closed(plant, controller, input);
        if let Some(gain) = tracking {
            equations.excess = vec![S::from(0.0); equations.b.len()];
            equations.excess[first] = gain;
        }
        Ok(equations)
    }

    /// The loop for the kernels that take steps in time.
    ///
    /// # Errors
    /// As [`equations`](Self::equations), and for numbers that these kernels refuse.
    pub fn linear(&self, input: Input) -> Result<LinearLoop, Error> {
        let values = self.values();
        let (equations, update) = self.on_samples(values, input)?;
        self.bounded(equations, update, values)
    }

    /// The loop of these equations, with its delay, its samples and the bounds of its command.
    pub(super) fn bounded<S: Scalar>(
        &self,
        equations: Equations<S>,
        update: Option<Update>,
        values: &Values<S>,
    ) -> Result<LinearLoop<S>, Error> {
        let limit = values.limit.filter(|_| values.low.is_none());
        let mut made = LinearLoop::new(equations, values.delay, values.sample_time, limit)?;
        if let Some(low) = values.low {
            let high = values.limit.unwrap_or_else(|| S::from(f64::INFINITY));
            made = made.with_bounds(low, high)?;
        }
        if let Some(rate) = values.rate {
            made = made.with_rate(rate)?;
        }
        let controller = self.controller();
        if controller.stops && controller.kind.integrates() {
            let first = self.plant().order(&values.plant, values.given.as_ref())?;
            made = made.with_stop(first);
        }
        match update {
            Some(update) => made.with_update(update),
            None => Ok(made),
        }
    }

    /// How inputs act on the states and signals of the loop.
    ///
    /// # Errors
    /// As [`equations`](Self::equations).
    pub(super) fn columns(&self, values: &Values) -> Result<Columns, Error> {
        let controller = self.controller();
        let sampled = controller.sampled(&values.controller, values.sample_time.as_ref())?;
        let own = controller.equations(&values.controller, sampled.as_ref());
        let equations = self.equations(values, Input::Reference, sampled.as_ref())?;
        let still = vec![0.0; equations.states() - own.b.len()];
        let on_error = controller.derivative_weight(&values.controller);
        Ok(Columns {
            load: Column {
                states: equations.b,
                command: equations.l,
                output: equations.d,
                seen: equations.d,
                impulse: 0.0,
            },
            seen: Column {
                states: still.iter().copied().chain(own.b).collect(),
                command: own.p,
                output: 0.0,
                seen: 1.0,
                impulse: own.q,
            },
            reference: Column {
                states: equations.e,
                command: equations.m,
                output: 0.0,
                seen: -on_error,
                impulse: equations.impulse,
            },
        })
    }

    /// The equations for these numbers, and what a sample does to the states.
    ///
    /// # Errors
    /// As [`equations`](Self::equations).
    pub(super) fn on_samples<S: Sampled>(
        &self,
        values: &Values<S>,
        input: Input,
    ) -> Result<(Equations<S>, Option<Update<S>>), Error> {
        let controller = self.controller();
        let sampled = controller.sampled(&values.controller, values.sample_time.as_ref())?;
        let equations = self.equations(values, input, sampled.as_ref())?;
        let weight = controller.derivative_weight(&values.controller);
        let update = sampled.map(|filter| self.update(&filter, &equations, &weight));
        Ok((equations, update))
    }

    /// The loop in numbers with slopes; its filter must be continuous.
    ///
    /// # Errors
    /// As [`linear`](Self::linear).
    pub fn linear_in<S: Scalar>(&self, values: &Values<S>) -> Result<LinearLoop<S>, Error> {
        let equations = self.equations(values, Input::Reference, None)?;
        self.bounded(equations, None, values)
    }

    /// Plant and controller for a run in fixed steps.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plant without a state space.
    pub fn blocks(&self) -> Result<Blocks, Error> {
        let values = self.values();
        let fraction = self
            .plant()
            .fraction(&values.plant, values.given.as_ref())?;
        let plant = fraction.state_space()?;
        let controller = self.controller().equations(&values.controller, None);
        let mut output = vec![0.0; plant.b.len()];
        output.iter_mut().take(1).for_each(|first| *first = 1.0);
        Ok(Blocks {
            plant_matrix: plant.a,
            plant_input: plant.b,
            plant_output: output,
            plant_direct: plant.d,
            controller_matrix: controller.a,
            controller_input: controller.b,
            controller_reference: controller.e,
            controller_output: controller.c,
            proportional: controller.p,
            derivative: controller.q,
            reference: controller.m,
            reference_derivative: controller.impulse,
        })
    }

    /// What a sample does to all states: the filter reads the output, and its states come last.
    fn update<S: Number>(
        &self,
        filter: &SampledFilter<S>,
        equations: &Equations<S>,
        on_error: &S,
    ) -> Update<S> {
        let (n, m) = (equations.b.len(), filter.g.len());
        let mut states = vec![S::from(0.0); n * n];
        (0..n).for_each(|i| states[i * n + i] = S::from(1.0));
        let mut command = vec![S::from(0.0); n];
        let mut reference = command.clone();
        for i in 0..m {
            let row = n - m + i;
            for j in 0..m {
                states[row * n + n - m + j] = filter.f[i * m + j].clone();
            }
            if !equations.c[0].is_zero() {
                states[row * n] = filter.g[i].clone() * equations.c[0].clone();
            }
            command[row] = filter.g[i].clone() * equations.d.clone();
            reference[row] = -(on_error.clone() * filter.g[i].clone());
        }
        Update {
            states,
            command,
            reference,
        }
    }
}

fn closed<S: Number>(
    plant: StateSpace<S>,
    controller: ControllerEquations<S>,
    input: Input,
) -> Equations<S> {
    let (n, m) = (plant.b.len(), controller.b.len());
    let (zero, one) = (S::from(0.0), S::from(1.0));
    let size = n + m;
    let mut a = vec![zero.clone(); size * size];
    for i in 0..n {
        for j in 0..n {
            a[i * size + j] = plant.a[i * n + j].clone();
        }
    }
    for i in 0..m {
        for j in 0..m {
            a[(n + i) * size + n + j] = controller.a[i * m + j].clone();
        }
        // y = x₁ + D w.
        if n > 0 {
            a[(n + i) * size] = controller.b[i].clone();
        }
    }
    let is_ideal = !controller.q.is_zero();
    let direct = plant.b.first().cloned().unwrap_or_else(|| zero.clone());
    let mut l = controller.p.clone() * plant.d.clone();
    let mut k = vec![zero.clone(); n];
    if let Some(first) = k.first_mut() {
        *first = controller.p;
    }
    if is_ideal {
        for (k, slope) in k.iter_mut().zip(&plant.a) {
            *k = k.clone() + controller.q.clone() * slope.clone();
        }
        l = l + controller.q.clone() * direct.clone();
    }
    k.extend(controller.c);
    let d = plant.d;
    let fed = controller.b.into_iter().map(|b| b * d.clone());
    let b: Vec<S> = plant.b.into_iter().chain(fed).collect();
    let (e, m, impulse) = match input {
        Input::Reference => {
            let still = std::iter::repeat_n(zero.clone(), n);
            let e = still.chain(controller.e).collect();
            (e, controller.m, controller.impulse)
        }
        Input::Load => (b.clone(), controller.q * direct, zero.clone()),
    };
    let mut c = vec![zero; size];
    if let Some(first) = c.first_mut().filter(|_| n > 0) {
        *first = one;
    }
    Equations {
        a,
        b,
        e,
        k,
        l,
        m,
        c,
        d,
        impulse,
        impulses: Vec::new(),
        excess: Vec::new(),
    }
}
