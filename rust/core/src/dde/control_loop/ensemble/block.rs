//! Sixteen sampled loops processed together, one in each column.

use crate::Error;
use crate::dde::control_loop::linear_loop::dot;
use crate::dde::control_loop::row::Row;
use crate::dde::control_loop::sampled::Timing;
use crate::dde::propagator::Propagator;

use super::sets::Sets;

/// Number of loops in a block: two vectors of the widest instruction set.
pub(super) const SETS: usize = 16;

/// Most states for which the vectorised code is compiled: an integrator, the integral of the error,
/// and a filter.
pub(super) const MOST_STATES: usize = 4;

/// Loops with more samples than this run one by one, so that they can be cancelled.
const MOST_SAMPLES: f64 = 1e6;

/// One number for each loop of a block.
pub(super) type Column = [f64; SETS];

/// x + F x + Γ w + g over one part of a sample, where g is the contribution of the reference.
#[derive(Debug)]
pub(super) struct Hold {
    /// F, row-major.
    pub(super) growth: Vec<Column>,
    pub(super) drive: Vec<Column>,
    pub(super) push: Vec<Column>,
}

/// The numbers of the loops of a block. Their delays hold equally many whole samples.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) states: usize,
    /// Whole samples in the delay.
    pub(super) samples: usize,
    /// Is there a set whose delay is not a whole number of samples?
    pub(super) is_split: bool,
    /// From a sample to the arrival of a command.
    pub(super) early: Hold,
    /// From there to the next sample.
    pub(super) late: Hold,
    pub(super) k: Vec<Column>,
    pub(super) c: Vec<Column>,
    pub(super) l: Column,
    /// M r.
    pub(super) command: Column,
    pub(super) limit: Column,
    pub(super) sample_time: Column,
    /// Time from a sample to the arrival of a command.
    pub(super) arrival: Column,
    /// Time by which the output is read ahead.
    pub(super) ahead: Column,
}

/// Whole samples in the delay of a loop that the vectorised code can run: a sampled loop whose
/// output between events is a line (c A = 0 and c E = 0) and cannot jump.
pub(super) fn samples_in_delay(row: &Row<'_>, span: f64) -> Option<usize> {
    let n = row.b.len();
    let numbers = [row.l, row.m, row.delay, row.sample_time];
    let mut all = numbers
        .iter()
        .chain(row.a)
        .chain(row.b)
        .chain(row.e)
        .chain(row.k);
    let is_sound = all.all(|v| v.is_finite()) && row.c.iter().all(|c| c.is_finite());
    let is_line = row.d == 0.0
        && dot(row.c, row.e) == 0.0
        && (0..n).all(|j| (0..n).all(|i| row.c[i] == 0.0 || row.a[i * n + j] == 0.0));
    let fits = (1..=MOST_STATES).contains(&n)
        && row.delay >= 0.0
        && row.sample_time > 0.0
        && row.limit > 0.0
        && (span + row.delay) / row.sample_time < MOST_SAMPLES;
    (is_sound && is_line && fits).then(|| Timing::new(row.delay, row.sample_time).samples)
}

impl Block {
    /// Upper limit on the samples of any lane for `span` seconds of its output.
    pub(super) fn most_samples(&self, span: f64) -> usize {
        let lanes = self.sample_time.iter().zip(&self.ahead);
        let longest = lanes.map(|(step, ahead)| (span + ahead) / step);
        self.samples + longest.fold(0.0, f64::max).ceil() as usize
    }

    /// A block of at most [`SETS`] loops with equally many samples; the last loop fills the unused
    /// columns.
    pub(super) fn new(sets: &Sets<'_>, members: &[usize]) -> Result<Self, Error> {
        let n = sets.states;
        let nothing = [0.0; SETS];
        let hold = || Hold {
            growth: vec![nothing; n * n],
            drive: vec![nothing; n],
            push: vec![nothing; n],
        };
        let mut block = Self {
            states: n,
            samples: 0,
            is_split: false,
            early: hold(),
            late: hold(),
            k: vec![nothing; n],
            c: vec![nothing; n],
            l: nothing,
            command: nothing,
            limit: nothing,
            sample_time: nothing,
            arrival: nothing,
            ahead: nothing,
        };
        for lane in 0..SETS {
            let member = members.get(lane).or(members.last()).copied();
            let row = sets.row(member.unwrap_or_default())?;
            let timing = Timing::new(row.delay, row.sample_time);
            block.samples = timing.samples;
            block.is_split |= timing.early > 0.0;
            block.early.fill(lane, &row, timing.early, sets.amplitude);
            block.late.fill(lane, &row, timing.late, sets.amplitude);
            for i in 0..n {
                block.k[i][lane] = row.k[i];
                block.c[i][lane] = row.c[i];
            }
            block.l[lane] = row.l;
            block.command[lane] = row.m * sets.amplitude;
            block.limit[lane] = row.limit;
            block.sample_time[lane] = row.sample_time;
            block.arrival[lane] = timing.early;
            block.ahead[lane] = sets.ahead(&row);
        }
        Ok(block)
    }
}

impl Hold {
    fn fill(&mut self, lane: usize, row: &Row<'_>, h: f64, reference: f64) {
        let n = row.b.len();
        if row.a.iter().all(|a| *a == 0.0) {
            // The result of the propagator, at less cost.
            for i in 0..n {
                self.drive[i][lane] = row.b[i] * h;
                self.push[i][lane] = row.e[i] * h * reference;
            }
            return;
        }
        let step = Propagator::new(row.a, &[row.b, row.e], h);
        for (place, growth) in self.growth.iter_mut().zip(step.growth()) {
            place[lane] = *growth;
        }
        for i in 0..n {
            self.drive[i][lane] = step.gamma(0)[i];
            self.push[i][lane] = step.gamma(1)[i] * reference;
        }
    }
}
