//! Method of steps for a positive delay.

use crate::dde::control_loop::linear_loop::{Bounds, LinearLoop, Start, saturate};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::limits::{check_growth, slack};
use crate::dde::scalar::{Scalar, is_reached};
use crate::{Error, Task};

use super::effort::watch;
use super::expansion::Expansion;
use super::impulses::Impulses;
use super::pieces::{Order, Pieces, REPORTED, SMOOTH};
use super::saturation::{Mode, Stretch, stretches};
use crate::dde::control_loop::series::{DEGREE, Series};

/// Factor on the length of a shortened element, so that the bound on its series holds with a
/// margin.
const MARGIN: f64 = 0.95;

pub(super) fn run<S: Scalar>(
    plant: &LinearLoop<S>,
    start: &Start<S>,
    reference: &Reference,
    mut requested: RequestedOutput<'_, S>,
    task: &Task,
) -> Result<Trajectory<S>, Error> {
    let equations = plant.equations();
    let (delay, bounds) = (plant.delay(), plant.bounds());
    let orders = Orders::new(plant);
    let mut pieces = Pieces::new(start.command, delay);
    let mut impulses = Impulses::default();
    let mut cursor = reference.cursor(&start.kicks);
    cursor.advance(0.0, -slack(S::default(), delay));
    let mut x = start.state.clone();
    let mut forcing = vec![S::default(); x.len()];
    let mut expansion = Expansion::new(&equations.a, x.len());
    let held = bounds.map(|(low, high)| [high, low].map(Series::constant));
    let values = bounds.map(|(low, high)| (low.value(), high.value()));
    let mut modes: Vec<Stretch> = Vec::new();
    let mut mode = Mode::Free;
    let mut w = Series::constant(S::default());
    let mut u = w;
    let mut t = S::default();
    let mut elements = 0;
    while !requested.is_done() {
        watch(elements, task)?;
        let tolerance = slack(t, delay);
        let arriving = pieces.reach(t);
        let jumps = elements == 0 || is_reached(S::from(cursor.next_jump()), t, tolerance);
        let before = cursor.value();
        let r = if jumps {
            cursor.advance(t.value(), tolerance)
        } else {
            before
        };
        let struck = impulses.arrived(t, tolerance);
        for (x, &b) in x.iter_mut().zip(&equations.b) {
            *x += b * struck;
        }
        let kicked = if jumps {
            cursor.kick(t.value(), tolerance, equations, &mut x)
        } else {
            None
        };
        let made = if bounds.is_none() {
            equations.impulse * S::from(r - before) + kicked.unwrap_or_default()
        } else {
            S::default()
        };
        impulses.push(t + delay, made + equations.l * struck);
        let state_jumps = kicked.is_some() || !struck.is_nothing();
        for (forcing, &e) in forcing.iter_mut().zip(&equations.e) {
            *forcing = e * S::from(r);
        }
        let piece = pieces.front();
        let jump = S::from(cursor.next_jump());
        let stop = piece.end.earlier(jump).earlier(impulses.next());
        let mut h = stop - t;
        let mut next = stop;
        // Events at one time that move at different speeds: the element between them has length
        // zero, but its length has a derivative. It passes the command on and provides no output.
        let is_instant = S::MOVES && h.value() <= tolerance;
        if is_instant {
            h = h.pinned(0.0);
        } else if h.value() > expansion.trial {
            h = S::from(expansion.trial);
            next = t + h;
        }
        piece.in_local_time(t, h, &mut w);
        let part = MARGIN * expansion.expand(&equations.a, &equations.b, &forcing, &x, &w, h);
        if part < MARGIN && !is_instant {
            expansion.shorten(part);
            w.shift(S::default(), S::from(part));
            h *= S::from(part);
            next = t + h;
        }
        expansion.command(equations, &w, r, &mut u);
        let mut scale = h;
        if is_instant {
            u.set_degree(0);
            scale = S::from(1.0);
        }
        if state_jumps || orders.of_output(arriving, jumps) <= REPORTED {
            requested.output_break(t)?;
        }
        if requested.is_measured() {
            let y = expansion.output(equations, &w);
            requested.measure(t.value(), h.value(), 1.0, &y.values());
        }
        requested.output_blocks(next.value() - tolerance, |times| {
            expansion.outputs_at(equations, &w, times.map(|time| (time - t) / h))
        });
        requested.input_blocks(next.value() - tolerance, |times| {
            let values = u.at_each(times.map(|time| (time - t) / h));
            values.map(|u| saturate(u, bounds))
        });

        modes.clear();
        match values {
            Some(values) if !is_instant => stretches(&u, values, &mut modes),
            _ => modes.push(Stretch {
                mode: at_start(&u, values),
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
                requested.input_break(t + S::from(stretch.start) * h)?;
            }
            let start = t + S::from(stretch.start) * h;
            let end = if stretch.end >= 1.0 {
                next
            } else {
                t + S::from(stretch.end) * h
            };
            if stretch.mode != Mode::Free {
                requested.limited(start, end);
            }
            let mut piece = pieces.blank();
            piece.start = delay + t + S::from(stretch.start) * h;
            piece.end = delay + end;
            piece.origin = t + delay;
            piece.scale = scale;
            piece.series.copy_from(clipped(&u, stretch.mode, &held));
            piece.order = order;
            pieces.push(piece)?;
        }
        expansion.end(S::from(1.0), &mut x);
        check_growth(&x, u.coefficients[0], next)?;
        t = next;
        elements += 1;
    }
    Ok(requested.trajectory)
}

/// The command after its bounds, `held` being those at the bounds, the upper one first.
fn clipped<'a, S: Scalar>(
    u: &'a Series<S>,
    mode: Mode,
    held: &'a Option<[Series<S>; 2]>,
) -> &'a Series<S> {
    match (mode, held) {
        (Mode::High, Some([high, _])) => high,
        (Mode::Low, Some([_, low])) => low,
        _ => u,
    }
}

/// The mode of the command at σ = 0.
fn at_start<S: Scalar>(u: &Series<S>, bounds: Option<Bounds>) -> Mode {
    bounds.map_or(Mode::Free, |bounds| {
        Mode::of(u.coefficients[0].value(), bounds)
    })
}

/// The orders of breaks behind the loop: an integration raises the order by one, a direct path
/// keeps it.
pub(super) struct Orders {
    command_is_direct: bool,
    output_is_direct: bool,
    reference_in_command: Order,
    reference_in_output: Order,
}

impl Orders {
    pub(super) fn new<S: Scalar>(plant: &LinearLoop<S>) -> Self {
        let equations = plant.equations();
        let reaches_states = !equations.e.iter().all(|e| e.is_nothing());
        Self {
            command_is_direct: !equations.l.is_nothing(),
            output_is_direct: !equations.d.is_nothing(),
            reference_in_command: match (!equations.m.is_nothing(), reaches_states) {
                (true, _) => 0,
                (false, true) => 1,
                (false, false) => SMOOTH,
            },
            reference_in_output: if reaches_states { 1 } else { SMOOTH },
        }
    }

    /// Order of the break of the command where w breaks with order `arriving` and the reference may
    /// jump.
    pub(super) fn of_command(&self, arriving: Order, jumps: bool) -> Order {
        let jump = jumps.then_some(self.reference_in_command);
        Self::pass(arriving, self.command_is_direct).min(jump.unwrap_or(SMOOTH))
    }

    /// Order of the break of the output, likewise.
    pub(super) fn of_output(&self, arriving: Order, jumps: bool) -> Order {
        let jump = jumps.then_some(self.reference_in_output);
        Self::pass(arriving, self.output_is_direct).min(jump.unwrap_or(SMOOTH))
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
