//! The commands of a controller at samples that are missing between its rows.

use super::gaps::{Gap, gaps_of};
use super::sent::Sent;
use super::tolerances::GAPS;

/// The rows of a recording up to the end of its window, and the controller that sent its commands.
#[derive(Debug, Clone, PartialEq)]
pub struct Controlled {
    /// s, increasing.
    pub time: Vec<f64>,
    /// The reference.
    pub reference: Vec<f64>,
    /// The output.
    pub output: Vec<f64>,
    /// The command of each row.
    pub command: Vec<f64>,
    /// Time between samples of the controller, s; none of a continuous one.
    pub sample_time: Option<f64>,
    /// Proportional gain, zero where there is none.
    pub gain: f64,
    /// Is that all of the controller?
    pub is_proportional: bool,
    /// Largest size of its command.
    pub limit: f64,
}

/// What is known of missing samples besides the output there.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Assumed {
    /// After how many missing samples the reference changes, where it changes between rows that are
    /// further apart than samples. If not given, the mean command there is unknown.
    pub(super) step: Option<usize>,
    /// The error of the output that many missing rows share, in deviations of the white noise. If not
    /// given, their mean command is unknown besides.
    pub(super) shared: Option<f64>,
}

impl Controlled {
    /// The commands of all samples, from a straight line between the outputs.
    pub fn sent(&self, step: Option<usize>) -> Sent {
        let gaps = self.gaps();
        let mut outputs = Vec::new();
        for gap in &gaps {
            outputs.extend(self.between(&self.output, gap));
        }
        let assumed = Assumed {
            step,
            ..Assumed::default()
        };
        self.filled(&gaps, &outputs, assumed, None)
    }

    pub(super) fn gaps(&self) -> Vec<Gap> {
        self.sample_time
            .map_or_else(Vec::new, |apart| gaps_of(&self.time, apart))
    }

    /// A straight line between the values of the rows around a gap.
    pub(super) fn between(&self, values: &[f64], gap: &Gap) -> Vec<f64> {
        let [from, to] = [values[gap.row], values[gap.row + 1]];
        let [start, end] = [self.time[gap.row], self.time[gap.row + 1]];
        let slope = (to - from) / (end - start);
        let places = gap.places.iter();
        places.map(|at| slope * (at - start) + from).collect()
    }

    /// The command of a P controller.
    fn law(&self, reference: f64, output: f64) -> f64 {
        (self.gain * (reference - output)).clamp(-self.limit, self.limit)
    }

    /// Do the rows show that a P controller is in charge?
    fn is_in_charge(&self) -> bool {
        let rows = self.reference.iter().zip(&self.output).zip(&self.command);
        let differs = rows.map(|((r, y), command)| self.law(*r, *y) - command);
        self.is_proportional
            && deviation(&differs.collect::<Vec<_>>()) <= GAPS.alike * deviation(&self.command)
    }

    /// The commands for outputs at the missing samples; `response` is that of the plant to a command of
    /// one sample where the loop answers errors of the outputs across many missing rows.
    pub(super) fn filled(
        &self,
        gaps: &[Gap],
        outputs: &[f64],
        assumed: Assumed,
        response: Option<&[f64]>,
    ) -> Sent {
        if gaps.is_empty() {
            return Sent::complete(self.time.clone(), self.command.clone());
        }
        let is_in_charge = self.is_in_charge();
        let mut found = Sent {
            ways: 1,
            ..Sent::default()
        };
        let (mut together, mut ambiguous) = (Vec::new(), Vec::new());
        let mut outputs = outputs.iter();
        let mut rows = 0;
        for gap in gaps {
            let changes = self.reference[gap.row] != self.reference[gap.row + 1];
            let sent = self.sent_in(gap, &mut outputs, assumed.step, is_in_charge);
            let mut unknown = !is_in_charge;
            if is_in_charge && changes {
                found.ways = found.ways.max(gap.count() + 1);
                unknown = assumed.step.is_none();
            }
            let slope = |command: &f64| {
                if command.abs() < self.limit {
                    self.gain.abs()
                } else {
                    0.0
                }
            };
            let mut slopes: Vec<f64> = sent.iter().map(slope).collect();
            if gap.count() >= GAPS.hole {
                // The output that is predicted has errors too, which all these commands share.
                let mut by_all = slopes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                if let Some(response) = response {
                    (slopes, by_all) = closed(&slopes, response);
                }
                let first = gap
                    .places
                    .iter()
                    .zip(&slopes)
                    .find(|(_, slope)| **slope > 0.0);
                if let Some((first, _)) = first {
                    let error = assumed.shared.unwrap_or(GAPS.shared);
                    together.push((*first, gap.end, error * by_all));
                }
                unknown |= assumed.shared.is_none();
            }
            let ends = gap.ends().zip(&slopes);
            found
                .computed
                .extend(ends.map(|((from, to), slope)| (from, to, *slope)));
            if unknown {
                ambiguous.push(gap);
            }
            found.longest = found.longest.max(gap.count());
            found.time.extend(&self.time[rows..=gap.row]);
            found.command.extend(&self.command[rows..=gap.row]);
            rows = gap.row + 1;
            found.time.extend(&gap.places);
            found.command.extend(sent);
        }
        found.time.extend(&self.time[rows..]);
        found.command.extend(&self.command[rows..]);
        found.computed.extend(together);
        found.computed.sort_by(|p, q| p.1.total_cmp(&q.1));
        // The longest gaps come first.
        ambiguous.sort_by_key(|gap| std::cmp::Reverse(gap.count()));
        ambiguous.truncate(((GAPS.most_unknown * self.time.len() as f64) as usize).max(1));
        ambiguous.sort_by_key(|gap| gap.row);
        let ends = ambiguous.iter().map(|gap| (gap.places[0], gap.end));
        found.unknown = ends.collect();
        found
    }

    /// The commands in a gap, from the outputs there or from the rows around it.
    fn sent_in<'a>(
        &self,
        gap: &Gap,
        outputs: &mut impl Iterator<Item = &'a f64>,
        step: Option<usize>,
        is_in_charge: bool,
    ) -> Vec<f64> {
        let own = outputs.take(gap.count()).enumerate();
        let commands = own.map(|(number, output)| {
            if is_in_charge {
                let is_before = number < step.unwrap_or(0);
                let row = if is_before { gap.row } else { gap.row + 1 };
                self.law(self.reference[row], *output)
            } else {
                0.5 * (self.command[gap.row] + self.command[gap.row + 1])
            }
        });
        commands.collect()
    }
}

/// Change of the sum of the commands by an error of each output they are computed from.
///
/// The loop answers an error: with the response M of the outputs to the commands and their slopes K, the
/// commands change by (I + K M)⁻¹ K e. The second number is the mean change of a command by an error that
/// all outputs share.
pub(super) fn closed(slopes: &[f64], response: &[f64]) -> (Vec<f64>, f64) {
    // w = (I + K M)⁻ᵀ 1, from the last sample to the first: M is lower triangular.
    let count = slopes.len();
    let at = |age: usize| response.get(age).copied().unwrap_or(0.0);
    let mut w = vec![0.0; count];
    for j in (0..count).rev() {
        let later = (j + 1..count).map(|i| slopes[i] * at(i - j) * w[i]);
        w[j] = (1.0 - later.sum::<f64>()) / (1.0 + slopes[j] * at(0));
    }
    let sums: Vec<f64> = w.iter().zip(slopes).map(|(w, slope)| w * slope).collect();
    let moving = slopes.iter().filter(|slope| **slope != 0.0).count();
    let shared = sums.iter().sum::<f64>().abs() / moving.max(1) as f64;
    (sums.iter().map(|sum| sum.abs()).collect(), shared)
}

/// Standard deviation about the mean.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count).sqrt()
}
