//! Simulation of a loop in fixed steps.

use crate::dde::control_loop::linear_loop::{Bounds, dot, saturate};
use crate::dde::control_loop::reference::Reference;
use crate::dde::limits::{RESPONSE, check_growth};
use crate::memory::{require, reserved};
use crate::{Error, Task};

use super::buffer::{Buffer, SLACK};
use super::solver::Solver;

/// Steps between two checks for cancellation.
const CHECK_EVERY: usize = 4096;

/// Upper limit on the number of steps; their outputs take 0.8 GB.
const MOST_STEPS: usize = 50_000_000;

/// Plant and controller; matrices row-major.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Blocks {
    /// A.
    pub plant_matrix: Vec<f64>,
    /// B.
    pub plant_input: Vec<f64>,
    /// C.
    pub plant_output: Vec<f64>,
    /// D.
    pub plant_direct: f64,
    /// F.
    pub controller_matrix: Vec<f64>,
    /// G.
    pub controller_input: Vec<f64>,
    /// H.
    pub controller_reference: Vec<f64>,
    /// P.
    pub controller_output: Vec<f64>,
    /// p.
    pub proportional: f64,
    /// q.
    pub derivative: f64,
    /// M.
    pub reference: f64,
    /// i.
    pub reference_derivative: f64,
}

/// Where the delay is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Path {
    /// Between controller and plant.
    Command,
    /// Between plant and controller.
    Measurement,
}

/// Delay, limit and sampling of the loop, and how it is simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Td, s.
    pub delay: f64,
    /// Its place.
    pub path: Path,
    /// The least and the greatest command; none where there is no limit.
    pub bounds: Option<Bounds>,
    /// Whole steps between two samples of the controller; none in continuous time.
    pub sample_steps: Option<usize>,
    /// The formula.
    pub solver: Solver,
    /// h, s.
    pub step: f64,
    /// Number of steps.
    pub steps: usize,
}

/// What drives the loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// r.
    pub reference: Reference,
    /// Added to what the plant receives.
    pub load: Reference,
    /// Added to the output.
    pub output: Reference,
    /// Added to what the controller receives.
    pub noise: Reference,
}

/// Initial values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rest {
    /// x_p, then x_c.
    pub state: Vec<f64>,
    /// y before the start.
    pub output: f64,
    /// u before the start.
    pub command: f64,
}

/// y and u at t = 0, h, …, `steps` h.
pub fn run(
    blocks: &Blocks,
    settings: &Settings,
    rest: &Rest,
    driven: &Driven,
    task: &Task,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    check(blocks, settings, rest)?;
    let lag = settings.delay / settings.step;
    require::<[f64; 2]>(
        "the buffer of the delay",
        (lag as usize).min(settings.steps),
    )?;
    let mut simulation = Simulation {
        blocks,
        settings,
        driven,
        late: Buffer::new(
            match settings.path {
                Path::Command => rest.command,
                Path::Measurement => rest.output,
            },
            lag,
        ),
        held: None,
        last: None,
        quotient: 0.0,
    };
    let formula = settings.solver.tableau();
    let h = settings.step;
    let n = rest.state.len();
    let mut x = rest.state.clone();
    let mut stage = vec![0.0; n];
    let mut slopes = vec![0.0; n * formula.weights.len()];
    let times = settings.steps.saturating_add(1);
    let (mut outputs, mut inputs) = (reserved(RESPONSE, times)?, reserved(RESPONSE, times)?);
    for k in 0..=settings.steps {
        if k.is_multiple_of(CHECK_EVERY) {
            task.check()?;
        }
        let (y, u) = simulation.arrive(&x, k);
        check_growth(&x, u, k as f64 * h)?;
        outputs.push(y);
        inputs.push(u);
        for (i, (node, row)) in formula.nodes.iter().zip(formula.rows).enumerate() {
            stage.copy_from_slice(&x);
            advance(&mut stage, h, row, &slopes);
            let slope = &mut slopes[i * n..(i + 1) * n];
            simulation.slope(&stage, k, *node, slope);
        }
        advance(&mut x, h, formula.weights, &slopes);
    }
    Ok((outputs, inputs))
}

/// Add the weighted slopes over a step of length h.
fn advance(x: &mut [f64], h: f64, weights: &[f64], slopes: &[f64]) {
    for (weight, slope) in weights.iter().zip(slopes.chunks_exact(x.len().max(1))) {
        for (value, k) in x.iter_mut().zip(slope) {
            *value += h * weight * k;
        }
    }
}

/// The signals at one instant.
struct Signals {
    /// What the plant receives.
    w: f64,
    /// What the plant gives.
    y: f64,
    /// What the controller receives.
    v: f64,
    /// What the controller gives.
    u: f64,
    /// The reference.
    r: f64,
}

struct Simulation<'a> {
    blocks: &'a Blocks,
    settings: &'a Settings,
    driven: &'a Driven,
    late: Buffer,
    /// The command of the latest sample.
    held: Option<f64>,
    /// The input of the ideal derivative at the latest whole step.
    last: Option<f64>,
    /// Its difference quotient there.
    quotient: f64,
}

impl Simulation<'_> {
    /// Advance to the whole step `k`: returns y and u there and updates the buffer and the hold.
    fn arrive(&mut self, x: &[f64], k: usize) -> (f64, f64) {
        if self
            .settings
            .sample_steps
            .is_some_and(|every| k.is_multiple_of(every))
        {
            self.held = None;
        }
        let now = self.signals(x, k as f64, 1.0);
        if self.settings.sample_steps.is_some() {
            self.held = Some(now.u);
        }
        let last = self.differentiated(now.v, now.r);
        self.quotient = self.since_last(last, 1.0);
        self.last = Some(last);
        self.late.push(match self.settings.path {
            Path::Command => now.u,
            Path::Measurement => now.y,
        });
        (now.y, now.u)
    }

    /// x′ at the fraction `node` of step `k`.
    fn slope(&self, x: &[f64], k: usize, node: f64, slope: &mut [f64]) {
        let blocks = self.blocks;
        let now = self.signals(x, k as f64 + node, node);
        let (plant, controller) = x.split_at(blocks.plant_input.len());
        let (of_plant, of_controller) = slope.split_at_mut(plant.len());
        let rows = blocks.plant_matrix.chunks_exact(plant.len().max(1));
        for ((slope, row), b) in of_plant.iter_mut().zip(rows).zip(&blocks.plant_input) {
            *slope = dot(row, plant) + b * now.w;
        }
        let rows = blocks
            .controller_matrix
            .chunks_exact(controller.len().max(1));
        let along = blocks
            .controller_input
            .iter()
            .zip(&blocks.controller_reference);
        for ((slope, row), (g, h)) in of_controller.iter_mut().zip(rows).zip(along) {
            *slope = dot(row, controller) + g * now.v + h * now.r;
        }
    }

    /// All signals at `time`, in steps, `since` steps after the latest whole one.
    fn signals(&self, x: &[f64], time: f64, since: f64) -> Signals {
        let blocks = self.blocks;
        let (plant, controller) = x.split_at(blocks.plant_input.len());
        let now = (time + SLACK) * self.settings.step;
        let at = |input: &Reference| input.at(now);
        let (r, load) = (at(&self.driven.reference), at(&self.driven.load));
        let (output, noise) = (at(&self.driven.output), at(&self.driven.noise));
        let inner = dot(&blocks.plant_output, plant);
        let late = if self.settings.delay > 0.0 {
            self.late
                .read(time - self.settings.delay / self.settings.step)
        } else {
            // There is no delay in between, and no feedthrough either (checked).
            match self.settings.path {
                Path::Command => self.command(controller, inner + output + noise, r, since),
                Path::Measurement => inner + output,
            }
        };
        match self.settings.path {
            Path::Command => {
                let w = late + load;
                let y = inner + blocks.plant_direct * w + output;
                let v = y + noise;
                let u = self.command(controller, v, r, since);
                Signals { w, y, v, u, r }
            }
            Path::Measurement => {
                let v = late + noise;
                let u = self.command(controller, v, r, since);
                let w = u + load;
                let y = inner + blocks.plant_direct * w + output;
                Signals { w, y, v, u, r }
            }
        }
    }

    fn command(&self, controller: &[f64], v: f64, r: f64, since: f64) -> f64 {
        if let Some(held) = self.held {
            return held;
        }
        let blocks = self.blocks;
        let u = dot(&blocks.controller_output, controller)
            + blocks.proportional * v
            + self.since_last(self.differentiated(v, r), since)
            + blocks.reference * r;
        saturate(u, self.settings.bounds)
    }

    /// The difference quotient of the input of the derivative, which is now `value`, `since` steps
    /// after the latest whole step.
    fn since_last(&self, value: f64, since: f64) -> f64 {
        match self.last {
            _ if since == 0.0 => self.quotient,
            Some(last) => (value - last) / (since * self.settings.step),
            None => 0.0,
        }
    }

    fn differentiated(&self, v: f64, r: f64) -> f64 {
        self.blocks.derivative * v + self.blocks.reference_derivative * r
    }
}

fn check(blocks: &Blocks, settings: &Settings, rest: &Rest) -> Result<(), Error> {
    let (n, m) = (blocks.plant_input.len(), blocks.controller_input.len());
    let fits = blocks.plant_matrix.len() == n * n
        && blocks.plant_output.len() == n
        && blocks.controller_matrix.len() == m * m
        && blocks.controller_reference.len() == m
        && blocks.controller_output.len() == m
        && rest.state.len() == n + m;
    refuse_if!(
        !fits,
        "the matrices of {n} plant states and {m} controller states, or the {} initial states, do \
         not fit together",
        rest.state.len()
    );
    refuse_if!(
        !(settings.step > 0.0 && settings.step.is_finite()),
        "step={} s: give a step above zero",
        settings.step
    );
    refuse_if!(
        !(settings.delay >= 0.0 && settings.delay.is_finite()),
        "delay={} s: give zero or more",
        settings.delay
    );
    refuse_if!(
        settings.delay == 0.0 && blocks.plant_direct != 0.0,
        "without a delay, a plant with direct feedthrough (D={}) makes an algebraic loop, which \
         fixed steps cannot simulate: use the exact simulation",
        blocks.plant_direct
    );
    refuse_if!(
        settings.sample_steps == Some(0),
        "the sample time is shorter than a step of the simulation"
    );
    if settings.steps > MOST_STEPS {
        return Err(Error::TooMuch {
            what: "the run in fixed steps",
            limit: MOST_STEPS as u64,
            unit: "steps",
            advice: "take a longer step or end the run earlier".to_owned(),
        });
    }
    Ok(())
}
