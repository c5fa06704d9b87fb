//! A loop in one mode of its command, and the element that it is on.

use crate::dde::control_loop::linear_loop::LinearLoop;
use crate::dde::control_loop::reference::Cursor;
use crate::dde::control_loop::requested_output::RequestedOutput;
use crate::dde::control_loop::series::Series;
use crate::dde::scalar::Scalar;

use super::expansion::Expansion;
use super::field::{Field, Mode, Signal};
use super::impulses::Impulses;
use super::pieces::{Order, Orders, Pieces};
use super::saturation::{Side, Stretch};

/// Rounding error of a signal, relative to the sum of its parts.
pub(super) const NOISE: f64 = 16.0 * f64::EPSILON;

pub(super) struct Run<'a, 'r, S: Scalar> {
    pub(super) plant: &'a LinearLoop<S>,
    /// Those of the modes so far, with their expansions.
    pub(super) fields: Vec<(Field<S>, Expansion<S>)>,
    /// The present one.
    pub(super) place: usize,
    /// None without a delay.
    pub(super) pieces: Option<Pieces<S>>,
    /// Are the states the same on both sides of a bound, so that the command alone is cut there?
    pub(super) is_cut: bool,
    /// Of a command that is cut, the side of its bounds, and the intervals of the element.
    pub(super) side: Side,
    pub(super) stretches: Vec<Stretch>,
    pub(super) impulses: Impulses<S>,
    pub(super) cursor: Cursor<'a>,
    pub(super) z: Vec<S>,
    /// What acts on z′ besides z and w.
    pub(super) forced: Vec<S>,
    pub(super) t: S,
    /// w on the element; zero without a delay.
    pub(super) w: Series<S>,
    /// v and y on the element.
    pub(super) series: [Series<S>; 2],
    pub(super) r: f64,
    /// The slope by which the last change of mode comes later, and that of v before it.
    pub(super) last_change: (S, f64),
    /// What began where a mode ended at once: the order of w, a jump, a kick.
    pub(super) begun: Option<(Order, bool, bool)>,
    /// Changes of mode since time went on.
    pub(super) changes: u32,
    pub(super) orders: Orders,
    /// An end of time for loops without breaks.
    pub(super) horizon: f64,
    pub(super) requested: RequestedOutput<'r, S>,
}

impl<S: Scalar> Run<'_, '_, S> {
    pub(super) fn field(&self) -> &Field<S> {
        &self.fields[self.place].0
    }

    /// Take up a mode.
    pub(super) fn enter(&mut self, mode: Mode) {
        let known = self.fields.iter().position(|(field, _)| field.mode == mode);
        self.place = known.unwrap_or_else(|| {
            let field = Field::new(self.plant, mode, self.pieces.is_some());
            let expansion = Expansion::new(&field.a, self.z.len());
            self.fields.push((field, expansion));
            self.fields.len() - 1
        });
    }

    /// The values of the bounds.
    pub(super) fn bounds(&self) -> Option<(f64, f64)> {
        let bounds = self.plant.bounds();
        bounds.map(|(low, high)| (low.value(), high.value()))
    }

    /// A signal on the element.
    pub(super) fn series(&self, signal: &Signal<S>) -> Series<S> {
        let mut out = Series::constant(S::default());
        let expansion = &self.fields[self.place].1;
        signal.on(expansion, &self.w, self.r, &mut out);
        out.trim();
        out
    }

    /// Rounding errors of a signal on the element.
    pub(super) fn noise(&self, signal: &Signal<S>) -> f64 {
        let expansion = &self.fields[self.place].1;
        let w: f64 = self.w.terms().iter().map(|c| c.value().abs()).sum();
        let forced = signal.constant.value().abs() + (signal.r.value() * self.r).abs();
        NOISE * (expansion.size(&signal.states) + signal.w.value().abs() * w + forced)
    }
}
