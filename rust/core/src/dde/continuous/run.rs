//! Method of steps for a positive delay.

use crate::dde::linear::{
    LinearLoop, Reference, Start, Trajectory, Wanted, check_growth, saturate, slack,
};
use crate::{Error, Task};

use super::crossing::{Mode, Stretch, stretches};
use super::impulses::Impulses;
use super::pieces::{Order, Piece, Pieces, REPORTED, SMOOTH};
use super::series::{DEGREE, Expansion, Series};
use super::watch;

/// Room left when an element is shortened, so that the bound on its series holds with margin.
const MARGIN: f64 = 0.95;

pub(super) fn run(
    plant: &LinearLoop,
    start: &Start,
    reference: &Reference,
    mut wanted: Wanted<'_>,
    task: &Task,
) -> Result<Trajectory, Error> {
    let equations = plant.equations();
    let (delay, limit) = (plant.delay(), plant.limit());
    let orders = Orders::new(plant);
    let mut pieces = Pieces::new(start.command, delay);
    let mut impulses = Impulses::default();
    let mut cursor = reference.cursor();
    cursor.advance(0.0, -slack(0.0, delay));
    let mut x = start.state.clone();
    let mut forcing = vec![0.0; x.len()];
    let mut expansion = Expansion::new(&equations.a, x.len());
    let mut modes: Vec<Stretch> = Vec::new();
    let mut mode = Mode::Free;
    let mut t = 0.0;
    let mut elements = 0;
    while !wanted.is_done() {
        watch(elements, task)?;
        let tolerance = slack(t, delay);
        let arriving = pieces.reach(t);
        let jumps = elements == 0 || cursor.next_jump() <= t + tolerance;
        let before = cursor.value();
        let r = cursor.advance(t, tolerance);
        let struck = impulses.arrived(t + tolerance);
        for (x, b) in x.iter_mut().zip(&equations.b) {
            *x += b * struck;
        }
        let made = if limit.is_none() {
            equations.impulse * (r - before)
        } else {
            0.0
        };
        impulses.push(t + delay, made + equations.l * struck);
        let state_jumps = struck != 0.0;
        for (forcing, e) in forcing.iter_mut().zip(&equations.e) {
            *forcing = e * r;
        }
        let piece = pieces.front();
        let stop = piece.end.min(cursor.next_jump()).min(impulses.next());
        let mut h = stop - t;
        let mut next = stop;
        if h > expansion.trial {
            h = expansion.trial;
            next = t + h;
        }
        let mut w = piece.local(t, h);
        let part = MARGIN * expansion.expand(&equations.a, &equations.b, &forcing, &x, &w, h);
        if part < MARGIN {
            expansion.shorten(part);
            w = w.shifted(0.0, part);
            h *= part;
            next = t + h;
        }
        let u = expansion.command(equations, &w, r);
        let y = expansion.output(equations, &w);

        if state_jumps || orders.of_output(arriving, jumps) <= REPORTED {
            wanted.output_break(t);
        }
        wanted.outputs_before(next - tolerance, |time| y.at((time - t) / h));
        wanted.inputs_before(next - tolerance, |time| {
            saturate(u.at((time - t) / h), limit)
        });

        modes.clear();
        match limit {
            Some(limit) => stretches(&u, limit, &mut modes),
            None => modes.push(Stretch {
                mode: Mode::Free,
                start: 0.0,
                end: 1.0,
            }),
        }
        let mut order = if state_jumps {
            0
        } else {
            orders.of_command(arriving, jumps)
        };
        for stretch in &modes {
            if stretch.mode != mode {
                order = order.min(1);
                mode = stretch.mode;
            }
            if order <= REPORTED {
                wanted.input_break(t + stretch.start * h);
            }
            let last = stretch.end >= 1.0;
            pieces.push(Piece {
                start: delay + t + stretch.start * h,
                end: delay + if last { next } else { t + stretch.end * h },
                origin: t + delay,
                scale: h,
                series: clipped(&u, stretch.mode, limit),
                order,
            })?;
        }
        expansion.end(1.0, &mut x);
        check_growth(&x, u.at(1.0), next)?;
        t = next;
        elements += 1;
    }
    Ok(wanted.trajectory)
}

/// The command after the limit.
fn clipped(u: &Series, mode: Mode, limit: Option<f64>) -> Series {
    match (mode, limit) {
        (Mode::High, Some(limit)) => Series::constant(limit),
        (Mode::Low, Some(limit)) => Series::constant(-limit),
        _ => *u,
    }
}

/// How breaks pass through the loop: an integration raises the order by one, a direct path keeps
/// it.
struct Orders {
    command_is_direct: bool,
    output_is_direct: bool,
    reference_in_command: Order,
    reference_in_output: Order,
}

impl Orders {
    fn new(plant: &LinearLoop) -> Self {
        let equations = plant.equations();
        let reaches_states = equations.e.iter().any(|e| *e != 0.0);
        Self {
            command_is_direct: equations.l != 0.0,
            output_is_direct: equations.d != 0.0,
            reference_in_command: match (equations.m != 0.0, reaches_states) {
                (true, _) => 0,
                (false, true) => 1,
                (false, false) => SMOOTH,
            },
            reference_in_output: if reaches_states { 1 } else { SMOOTH },
        }
    }

    /// Of the command, where w breaks with order `arriving` and the reference may jump.
    fn of_command(&self, arriving: Order, jumps: bool) -> Order {
        let passed = Self::pass(arriving, self.command_is_direct);
        if jumps {
            passed.min(self.reference_in_command)
        } else {
            passed
        }
    }

    /// Of the output.
    fn of_output(&self, arriving: Order, jumps: bool) -> Order {
        let passed = Self::pass(arriving, self.output_is_direct);
        if jumps {
            passed.min(self.reference_in_output)
        } else {
            passed
        }
    }

    fn pass(arriving: Order, direct: bool) -> Order {
        let order = if direct {
            arriving
        } else {
            arriving.saturating_add(1)
        };
        if usize::from(order) > DEGREE {
            SMOOTH
        } else {
            order
        }
    }
}
