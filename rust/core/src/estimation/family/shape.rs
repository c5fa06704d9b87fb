//! What reaches the plant of a command, behind an actuator that is not linear.

use super::aside::Signal;
use super::cause::CauseKind;
use crate::elementary::exp;

/// Time in which a signal jumps, in rows.
const JUMP: f64 = 1e-6;

/// A cause that the command passes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) kind: CauseKind,
    pub(super) size: f64,
    /// The lag of the plant, s.
    pub(super) lag: f64,
}

impl Shape {
    /// What is behind it of a command.
    pub(super) fn passed(&self, given: &Signal, row: f64) -> Signal {
        if !self.kind.limits_slope() {
            return Signal {
                sent: given.sent.clone(),
                value: behind(self.kind, self.size, &given.value),
                straight: given.straight,
            };
        }
        let lag = if self.kind == CauseKind::SlopeLimit {
            self.lag
        } else {
            0.0
        };
        let (sent, value) = behind_slope(&given.sent, &given.value, self.size, lag, row);
        Signal {
            sent,
            value,
            straight: true,
        }
    }
}

/// What a linear plant with this lag needs in place of a command that is held, so that it moves as one whose lag has a
/// limited slope.
pub(super) fn behind_slope(
    sent: &[f64],
    command: &[f64],
    most: f64,
    lag: f64,
    row: f64,
) -> (Vec<f64>, Vec<f64>) {
    slow(sent, command, most, lag, JUMP * row)
        .into_iter()
        .unzip()
}

/// The command that a linear lag needs so that its output v goes where that of a held command goes whose
/// slope is limited: v + lag v′, a ramp while the limit is reached. Without a lag, the command itself ramps.
fn slow(sent: &[f64], command: &[f64], most: f64, lag: f64, jump: f64) -> Vec<(f64, f64)> {
    let mut v = command.first().copied().unwrap_or(0.0);
    let mut end = v;
    let mut out: Vec<(f64, f64)> = Vec::with_capacity(2 * sent.len());
    for (at, (time, u)) in sent.iter().zip(command).enumerate() {
        let long = sent.get(at + 1).map_or(f64::INFINITY, |next| next - time);
        let off = u - v;
        let ramp = (off.abs() / most - lag).max(0.0);
        let slope = most.copysign(off);
        let start = if ramp > 0.0 { v + lag * slope } else { *u };
        out.push((*time, end));
        if (start - end).abs() > 0.0 {
            out.push((time + jump, start));
        }
        if ramp >= long {
            v += slope * long;
            end = v + lag * slope;
            continue;
        }
        if ramp > jump {
            out.push((time + ramp, *u));
            v += slope * ramp;
        }
        end = *u;
        if long.is_finite() {
            let decay = if lag > 0.0 {
                exp(-(long - ramp) / lag)
            } else {
                0.0
            };
            v = u - (u - v) * decay;
        }
    }
    if let Some((time, _)) = out.last().copied() {
        out.push((time + 1.0, end));
    }
    out
}

/// The command behind a cause of this size, at the same times.
fn behind(kind: CauseKind, size: f64, command: &[f64]) -> Vec<f64> {
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

    #[test]
    fn a_lag_behind_the_ramps_moves_as_one_whose_slope_is_limited() {
        let (sent, command) = ([0.0, 1.0, 2.0, 3.2], [0.0, 2.0, 1.5, -1.0]);
        for (lag, most) in [(0.4, 1.5), (0.0, 1.5), (0.4, 100.0)] {
            let points = slow(&sent, &command, most, lag, 1e-7);
            assert!(points.windows(2).all(|two| two[0].0 < two[1].0));
            let at = |time: f64| {
                let next = points.partition_point(|point| point.0 <= time);
                let ((a, x), (b, y)) = (points[next - 1], points[next]);
                x + (y - x) * (time - a) / (b - a)
            };
            // Both by small steps.
            let (step, mut limited, mut linear) = (1e-4, 0.0, 0.0);
            for count in 0..40_000 {
                let time = (f64::from(count) + 0.5) * step;
                let held = command[sent.partition_point(|own| *own <= time) - 1];
                if lag > 0.0 {
                    limited += step * ((held - limited) / lag).clamp(-most, most);
                    linear += step * (at(time) - linear) / lag;
                } else {
                    limited += (held - limited).clamp(-most * step, most * step);
                    linear = at(time);
                }
                assert!(
                    f64::abs(limited - linear) < 2e-3,
                    "{time} {limited} {linear}"
                );
            }
        }
    }
}
