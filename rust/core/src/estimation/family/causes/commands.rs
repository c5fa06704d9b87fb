//! What reaches the plant of a command, behind an actuator that is not linear.

use super::super::rows::{Part, Rows};
use super::CauseKind;
use super::asides::Aside;

/// Sizes of play and dead zone that are tried: the least and the largest, as shares of what the
/// command moves, and how many. More see each size better and take longer.
const SIZES: (f64, f64, usize) = (0.005, 0.6, 14);

/// The same for stiction, whose likelihood has many minima: sizes at equal distances.
const STUCK: (f64, f64, usize) = (0.01, 0.6, 60);

/// The same for limits, as shares of the largest command of their side.
const LIMITS: (f64, f64, usize) = (0.3, 0.97, 14);

/// Step of the derivative over a size, as a share.
const STEP: f64 = 0.02;

/// The command behind a cause of this size.
pub(super) fn behind(kind: CauseKind, size: f64, command: &[f64]) -> Vec<f64> {
    let mut last = command.first().copied().unwrap_or(0.0);
    let each = |u: &f64| match kind {
        CauseKind::DeadZone => u - u.clamp(-size, size),
        CauseKind::UpperLimit => u.min(size),
        CauseKind::LowerLimit => u.max(-size),
        CauseKind::Play => {
            last = last.clamp(u - 0.5 * size, u + 0.5 * size);
            last
        }
        CauseKind::Stiction => {
            if (u - last).abs() > size {
                last = *u;
            }
            last
        }
        _ => *u,
    };
    command.iter().map(each).collect()
}

/// The sizes of a cause that may be in these rows.
pub(super) fn sizes(kind: CauseKind, rows: &Rows) -> Vec<f64> {
    let ends = rows.parts.iter().map(Part::ends);
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |all, own| {
        (all.0.min(own.0), all.1.max(own.1))
    });
    let even = |(least, most, count): (f64, f64, usize), scale: f64| -> Vec<f64> {
        let step = (most - least) / (count - 1) as f64;
        (0..count)
            .map(|at| scale * (least + step * at as f64))
            .collect()
    };
    let ratio = |(least, most, count): (f64, f64, usize), scale: f64| -> Vec<f64> {
        let growth = (most / least).powf(1.0 / (count - 1) as f64);
        (0..count)
            .map(|at| scale * least * growth.powi(at as i32))
            .collect()
    };
    match kind {
        CauseKind::Play => ratio(SIZES, high - low),
        CauseKind::DeadZone if low < 0.0 && high > 0.0 => ratio(SIZES, high.max(-low)),
        CauseKind::Stiction => even(STUCK, high - low),
        CauseKind::UpperLimit if high > 0.0 => even(LIMITS, high),
        CauseKind::LowerLimit if low < 0.0 => even(LIMITS, -low),
        _ => Vec::new(),
    }
}

/// The distance from one size to the next, as a factor or of a scale.
pub(super) fn neighbours(sizes: &[f64], at: usize) -> (f64, f64) {
    let before = at
        .checked_sub(1)
        .map_or(0.5 * sizes[at], |place| sizes[place]);
    let after = sizes.get(at + 1).copied().unwrap_or(1.3 * sizes[at]);
    (before, after)
}

impl Part {
    /// The least and the largest command.
    fn ends(&self) -> (f64, f64) {
        let each = self.command.iter().map(|u| u + self.base);
        each.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| {
            (low.min(u), high.max(u))
        })
    }

    /// With the command behind a cause; its slope over the size stands aside.
    fn behind(&self, kind: CauseKind, size: f64) -> Self {
        let full: Vec<f64> = self.command.iter().map(|u| u + self.base).collect();
        let moved = behind(kind, size, &full);
        let (more, less) = (
            behind(kind, size * (1.0 + STEP), &full),
            behind(kind, size * (1.0 - STEP), &full),
        );
        let slopes = more.iter().zip(&less);
        let slope = slopes.map(|(more, less)| (more - less) / (2.0 * STEP * size));
        let mut out = self.clone();
        // What sticks does not move with the size by little and little.
        out.asides.push(
            (kind != CauseKind::Stiction)
                .then(|| Aside::input(self.sent.clone(), slope.collect(), self.straight)),
        );
        out.base = moved.first().copied().unwrap_or(0.0);
        out.command = moved.iter().map(|u| u - out.base).collect();
        out
    }
}

impl Rows {
    /// With the commands behind a cause.
    pub(super) fn behind(&self, kind: CauseKind, size: f64) -> Self {
        let mut out = self.clone();
        out.parts = self
            .parts
            .iter()
            .map(|part| part.behind(kind, size))
            .collect();
        out.causes.push(kind);
        out
    }

    /// What the cause takes from the commands of a record, as an input of its own.
    pub(super) fn taken(&self, kind: CauseKind, size: f64, part: &Part) -> Aside {
        let full: Vec<f64> = part.command.iter().map(|u| u + part.base).collect();
        let moved = behind(kind, size, &full);
        let pairs = moved.iter().zip(&full);
        let taken = pairs.map(|(moved, full)| moved - full).collect();
        Aside::input(part.sent.clone(), taken, part.straight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_actuator_with_play_follows_behind_half_of_it() {
        let command = [0.0, 1.0, 2.0, 1.5, 0.0, 0.4];
        assert_eq!(
            behind(CauseKind::Play, 1.0, &command),
            [0.0, 0.5, 1.5, 1.5, 0.5, 0.5]
        );
        assert_eq!(
            behind(CauseKind::Stiction, 0.9, &command),
            [0.0, 1.0, 2.0, 2.0, 0.0, 0.0]
        );
        assert_eq!(
            behind(CauseKind::DeadZone, 0.5, &[-1.0, 0.2, 0.7]),
            [-0.5, 0.0, 0.7 - 0.5]
        );
    }
}
