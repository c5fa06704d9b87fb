//! What a cause puts beside the command.

use super::super::aside::Aside;
use super::super::cause::CauseKind;
use super::super::model::{Model, Point};
use super::super::rows::{Part, Rows};
use super::super::shape::behind_slope;

/// The length of an impulse, in rows.
const SHORT: f64 = 0.05;

/// What begins at a time.
pub(super) fn from_time(kind: CauseKind, part: &Part, time: f64) -> Aside {
    match kind {
        CauseKind::OutputStep => Aside::Step(time),
        CauseKind::DelayChange => Aside::Later(time),
        _ => {
            // Nothing before it.
            let sent = vec![time.min(part.time[0]) - part.row, time];
            Aside::input(sent, vec![0.0, 1.0], false)
        }
    }
}

/// The columns of what begins at a time, that of its size last.
pub(super) fn columns_from(kind: CauseKind, part: &Part, time: f64) -> Vec<Aside> {
    let own = from_time(kind, part, time);
    if kind != CauseKind::Load {
        return vec![own];
    }
    // The slope over the time: an impulse.
    let (early, width) = (time.min(part.time[0]) - part.row, SHORT * part.row);
    let sent = vec![early, time, time + width];
    vec![Aside::input(sent, vec![0.0, 1.0 / width, 0.0], false), own]
}

/// The input of a gain that changes or of a drag, as the plant of a minimum moves. The gain is that of changes from
/// the first command: with the level it would feed the output back, which is a part of the plant, and with the time it
/// would be any drift.
pub(super) fn moving(
    kind: CauseKind,
    model: &Model<'_>,
    point: &Point,
    at: usize,
) -> Option<Aside> {
    let rows: &Rows = model.rows;
    let (part, place) = (&rows.parts[at], rows.places()[at].clone());
    let numbers = model.numbers(&point.x);
    let delay = numbers.delay;
    let times: Vec<f64> = part.used.iter().map(|row| part.time[*row]).collect();
    let (mut sent, mut command, mut straight) =
        (part.sent.clone(), part.command.clone(), part.straight);
    if let Some(most) = part.slope {
        (sent, command) = behind_slope(&sent, &command, most, numbers.lag(), part.row);
        straight = true;
    }
    let changes = || sent.iter().zip(&command);
    match kind {
        CauseKind::GainRamp => {
            let middle = 0.5 * (part.time[0] + part.time[part.time.len() - 1]);
            let value = changes().map(|(t, u)| u * (t - middle) / part.span);
            let value = value.collect();
            Some(Aside::input(sent, value, straight))
        }
        CauseKind::GainByLevel => {
            let residual = &point.residual[place];
            let pairs = part.output.iter().zip(residual);
            let level: Vec<f64> = pairs.map(|(output, left)| output - left).collect();
            let (low, high) = ends(&level);
            let range = high - low;
            if range.is_nan() || range <= 0.0 {
                return None;
            }
            let middle = level.iter().sum::<f64>() / level.len() as f64;
            let value =
                changes().map(|(t, u)| u * (between(&times, &level, t + delay) - middle) / range);
            let value = value.collect();
            Some(Aside::input(sent, value, straight))
        }
        CauseKind::Drag if model.class.integrating => {
            let gain = model.gain(point);
            let speed = point.speed(place).map(|v| gain * v);
            let value = speed.map(|v| -v * v.abs() * gain.signum()).collect();
            let sent = times.iter().map(|t| t - delay).collect();
            Some(Aside::input(sent, value, true))
        }
        _ => None,
    }
}

fn ends(values: &[f64]) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let wider = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
    values.iter().fold(start, wider)
}

/// The value between points at a time, of the nearest one outside.
fn between(times: &[f64], values: &[f64], time: f64) -> f64 {
    let after = times.partition_point(|own| *own <= time);
    if after == 0 {
        return values[0];
    }
    if after == times.len() {
        return values[after - 1];
    }
    let share = (time - times[after - 1]) / (times[after] - times[after - 1]);
    values[after - 1] + share * (values[after] - values[after - 1])
}

impl Rows {
    /// With the columns of a cause aside in some of its records.
    pub(super) fn with_asides(&self, kind: CauseKind, asides: Vec<Option<Vec<Aside>>>) -> Self {
        let mut out = self.clone();
        for (part, aside) in out.parts.iter_mut().zip(asides) {
            match aside {
                Some(own) => part.asides.extend(own.into_iter().map(Some)),
                None => part.asides.extend((0..kind.columns()).map(|_| None)),
            }
        }
        out.causes.push(kind);
        out.shapes.push(None);
        out
    }
}
