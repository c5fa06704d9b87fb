//! The loop in continuous time, element by element.
//!
//! With a delay, the command that arrives is known. Where bounds change nothing but the command, elements do
//! not end there: the command is cut, and its parts are added to the queue ([`saturation`](super::saturation)).
//! In all other loops the state moves otherwise while the command is at a bound, or there is no delay.
//!
//! In each mode of the command the loop is linear ([`field`](super::field)), and an element ends where a
//! signal leaves the mode ([`transitions`](super::transitions)). Without a delay and for L < 1, or any L ≠ 1 without bounds,
//! w = v has one solution.

use crate::dde::control_loop::linear_loop::{LinearLoop, Start, saturate};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::limits::{check_growth, slack};
use crate::dde::scalar::{Scalar, is_reached};
use crate::{Error, Task};

use super::effort::watch;
use super::field::Mode;
use super::impulses::Impulses;
use super::motion::Run;
use super::pieces::{Order, Orders, Pieces, REPORTED, SMOOTH};
use super::saturation::{Stretch, side_of, stretches};
use crate::dde::control_loop::series::Series;

/// Factor on the length of a shortened element.
const MARGIN: f64 = 0.95;

pub(super) fn run<S: Scalar>(
    plant: &LinearLoop<S>,
    start: &Start<S>,
    reference: &Reference,
    requested: RequestedOutput<'_, S>,
    task: &Task,
) -> Result<Trajectory<S>, Error> {
    check::<S>(plant)?;
    let is_delayed = plant.delay().value() > 0.0;
    let mut z = start.state.clone();
    if plant.rate().is_some() {
        z.push(start.command);
    }
    let mut cursor = reference.cursor(&start.kicks);
    cursor.advance(
        0.0,
        -slack(S::default(), plant.delay()).max(f64::MIN_POSITIVE),
    );
    let mut run = Run {
        plant,
        fields: Vec::new(),
        place: 0,
        pieces: is_delayed.then(|| Pieces::new(start.command, plant.delay())),
        is_cut: is_delayed && !plant.is_watched(),
        side: 0,
        stretches: Vec::new(),
        impulses: Impulses::default(),
        cursor,
        z,
        forced: Vec::new(),
        t: S::default(),
        w: Series::constant(S::default()),
        series: [Series::constant(S::default()); 2],
        r: 0.0,
        last_change: (S::default(), 0.0),
        begun: None,
        changes: 0,
        orders: Orders::new(plant),
        horizon: 1.0 + 2.0 * requested.last(),
        requested,
    };
    run.enter(Mode::FREE);
    let mut elements = 0;
    while !run.requested.is_done() {
        watch(elements, task)?;
        run.element(elements == 0)?;
        elements += 1;
    }
    Ok(run.requested.trajectory)
}

fn check<S: Scalar>(plant: &LinearLoop<S>) -> Result<(), Error> {
    let l = plant.equations().l;
    let denominator = 1.0 - l.value();
    let is_bounded = plant.bounds().is_some() || plant.rate().is_some();
    refuse_if!(
        plant.delay().value() == 0.0 && (denominator == 0.0 || (denominator < 0.0 && is_bounded)),
        "without a delay the command depends on itself with gain L = {}, which {}: give \
         the loop a delay or filter the derivative",
        l.value(),
        if denominator == 0.0 {
            "no command satisfies"
        } else {
            "several limited commands satisfy"
        }
    );
    let jumps = plant.stops().is_some() || plant.rate().is_some();
    refuse_if!(
        jumps && !l.is_nothing(),
        "the command feeds back to itself without delay (L = {}), but its rate is limited or its \
         integral stops: give the derivative a DerivativeFilter",
        l.value()
    );
    refuse_if!(
        S::MOVES && plant.stops().is_some(),
        "sensitivities cannot be computed for conditional integration in continuous time: use \
         back-calculation or a sample_time"
    );
    Ok(())
}

impl<S: Scalar> Run<'_, '_, S> {
    /// Advance over one element of time, or to another mode.
    fn element(&mut self, is_first: bool) -> Result<(), Error> {
        let (t, delay) = (self.t, self.plant.delay());
        let tolerance = slack(t, delay);
        let mut arriving = self
            .pieces
            .as_mut()
            .map_or(SMOOTH, |pieces| pieces.reach(t));
        let mut jumps = is_first || is_reached(S::from(self.cursor.next_jump()), t, tolerance);
        let mut is_kicked = self.jump(jumps, tolerance);
        let stop = self.stop(tolerance);
        let mut h = stop - t;
        let mut next = stop;
        // Events at one time that move at different speeds: the element between them has length
        // zero, but its length has a derivative. It passes the command on and provides no output.
        let is_instant = S::MOVES && self.pieces.is_some() && h.value() <= tolerance;
        if is_instant {
            h = h.pinned(0.0);
        }
        // A limited rate keeps its mode there: only a jump of the reference moves what it follows.
        if (jumps || (is_instant && self.plant.rate().is_none())) && !self.is_cut {
            let at_start = self.arrives();
            self.settle(at_start);
        }
        if let Some((order, jumped, kicked)) = self.begun.take() {
            (arriving, jumps, is_kicked) =
                (arriving.min(order), jumps || jumped, is_kicked || kicked);
        }
        let trial = self.fields[self.place].1.trial;
        if !is_instant && h.value() > trial {
            h = S::from(trial);
            next = t + h;
        }
        if let Some(pieces) = &self.pieces {
            pieces.front().in_local_time(t, h, &mut self.w);
        }
        let part = self.expand(h);
        if part < MARGIN && !is_instant {
            self.fields[self.place].1.shorten(part);
            self.w.shift(S::default(), S::from(part));
            h *= S::from(part);
            next = t + h;
        }
        let change = if is_instant { None } else { self.change(h) };
        let mut end = 1.0;
        if let Some(change) = change {
            end = change.at;
            next = t + S::from(end) * h;
            if next.value() <= t.value() {
                self.changes += 1;
                self.leave_at_once(change);
                self.begun = Some((arriving, jumps, is_kicked));
                return Ok(());
            }
        }
        if next.value() > t.value() {
            self.changes = 0;
        }
        let order = if is_kicked {
            0
        } else {
            self.orders.of_command(arriving, jumps)
        };
        let order = if change.is_some() || self.changes > 0 {
            order.min(1)
        } else {
            order
        };
        if is_kicked || self.orders.of_output(arriving, jumps) <= REPORTED {
            self.requested.output_break(t)?;
        }
        self.emit(h, next, (end, order), is_instant)?;
        self.t = next;
        self.last_change = (S::default(), 0.0);
        if let Some(change) = change {
            self.last_change = (change.later * h, self.slope(h, end));
            self.leave(change);
            self.requested.input_break(next)?;
            if self.pieces.is_none() {
                self.requested.output_break(next)?;
            }
        }
        Ok(())
    }

    /// Let reference and inputs jump, and impulses arrive; do states jump?
    fn jump(&mut self, jumps: bool, tolerance: f64) -> bool {
        let (t, equations) = (self.t, self.plant.equations());
        let mut struck = self.impulses.arrived(t, tolerance);
        let mut made = S::default();
        let mut is_kicked = false;
        if jumps {
            let before = self.cursor.value();
            self.r = self.cursor.advance(t.value(), tolerance);
            let states = &mut self.z[..equations.states()];
            let kicked = self.cursor.kick(t.value(), tolerance, equations, states);
            is_kicked = kicked.is_some();
            if self.plant.bounds().is_none() && self.plant.rate().is_none() {
                made = equations.impulse * S::from(self.r - before) + kicked.unwrap_or_default();
            }
        }
        if self.pieces.is_some() {
            let arrival = t + self.plant.delay();
            self.impulses.push(arrival, made + equations.l * struck);
        } else {
            struck = made / (S::from(1.0) - equations.l);
        }
        for (z, &b) in self.z.iter_mut().zip(&equations.b) {
            *z += b * struck;
        }
        is_kicked || !struck.is_nothing()
    }

    /// The end of the next element, at the latest.
    fn stop(&self, tolerance: f64) -> S {
        let jump = S::from(self.cursor.next_jump());
        match &self.pieces {
            Some(pieces) => pieces
                .front()
                .end
                .earlier(jump)
                .earlier(self.impulses.next()),
            None => {
                let end = S::from(self.cursor.next_jump().min(self.horizon));
                let left = end - self.t;
                self.t + left.pinned(left.value().max(tolerance))
            }
        }
    }

    /// w at the start of the element.
    fn arrives(&self) -> S {
        let Some(pieces) = &self.pieces else {
            return S::default();
        };
        let piece = pieces.front();
        piece.series.at((self.t - piece.origin) / piece.scale)
    }

    /// Expand the states over an element; returns the part on which the series holds.
    fn expand(&mut self, h: S) -> f64 {
        let (field, expansion) = &mut self.fields[self.place];
        self.forced.clear();
        let forced = field.slopes.iter().map(|s| s.forced(self.r));
        self.forced.extend(forced);
        MARGIN * expansion.expand(&field.a, &field.b, &self.forced, &self.z, &self.w, h)
    }

    /// Store and pass on what happens on the element, and go to its end.
    fn emit(
        &mut self,
        h: S,
        next: S,
        (end, mut order): (f64, Order),
        is_instant: bool,
    ) -> Result<(), Error> {
        let (t, delay, bounds) = (self.t, self.plant.delay(), self.plant.bounds());
        let values = self.bounds();
        let until = next.value() - slack(t, delay);
        let (field, expansion) = &self.fields[self.place];
        let is_limited = field.mode.is_limited();
        let [v, y] = &mut self.series;
        field.v.on(expansion, &self.w, self.r, v);
        v.trim();
        if self.requested.is_measured() || self.requested.next_output() < until {
            field.y.on(expansion, &self.w, self.r, y);
            self.requested.measure(t.value(), h.value(), end, y);
            self.requested
                .output_blocks(until, |times| y.at_each(times.map(|time| (time - t) / h)));
        }
        self.requested.input_blocks(until, |times| {
            let values = v.at_each(times.map(|time| (time - t) / h));
            values.map(|v| saturate(v, bounds))
        });
        let mut scale = h;
        let last = v.at(S::from(end));
        if is_instant {
            v.set_degree(0);
            scale = S::from(1.0);
        }
        self.stretches.clear();
        match values.filter(|_| self.is_cut) {
            Some(bounds) if !is_instant => stretches(v, bounds, &mut self.stretches),
            bounds => self.stretches.push(Stretch {
                side: side_of(v.coefficients[0].value(), bounds),
                start: 0.0,
                end,
            }),
        }
        for stretch in &self.stretches {
            if stretch.side != self.side {
                order = order.min(1);
                self.side = stretch.side;
            }
            let (into, last) = (S::from(stretch.start) * h, S::from(stretch.end) * h);
            let last = if stretch.end >= end { next } else { t + last };
            if order <= REPORTED {
                self.requested.input_break(t + into)?;
            }
            if is_limited || stretch.side != 0 {
                self.requested.limited(t + into, last);
            }
            let Some(pieces) = &mut self.pieces else {
                continue;
            };
            let mut piece = pieces.blank();
            piece.start = delay + t + into;
            piece.end = delay + last;
            piece.origin = t + delay;
            piece.scale = scale;
            match (stretch.side, bounds) {
                (1, Some((_, bound))) | (-1, Some((bound, _))) => piece.series.set_constant(bound),
                _ => piece.series.copy_from(v),
            }
            piece.order = order;
            pieces.push(piece)?;
        }
        self.fields[self.place].1.end(S::from(end), &mut self.z);
        if self.plant.rate().is_some()
            && let Some(place) = self.z.last_mut()
        {
            *place = last;
        }
        check_growth(&self.z, v.coefficients[0], next)
    }
}
