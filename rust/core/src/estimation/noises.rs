//! −2 ln L under several noises at once, for the same numbers of the mean.
//!
//! Difference quotients by the numbers of the noise take most of the evaluations of a search. Their
//! columns are the same, and so are the operations of the Kalman pass of `whiten`: each lane of a
//! register takes one noise. The whitened rows are not kept; R of `triangle` is made of them block
//! by block.

use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};

use super::disturbance::Joint;
use super::kept::Kept;
use super::path::{SETTLED, settled};
use super::propagation::Propagation;
use super::whiten::{Kick, LARGE, SAME_ROWS};
use crate::linear_algebra::triangle::Triangle;
use crate::simd::Instructions;
use crate::{Error, Task, memory};

/// Lanes of the widest registers.
const WIDEST: usize = 4;

/// Rows between two updates of R: few enough for the first cache.
const BLOCK: usize = 64;

/// What begins where half a line of the cache does: the widest registers would else be read from two.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Line<T>(T);

/// One of the noises.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct One {
    pub(super) joint: Joint,
    /// Scatter of the time of a row, s, times the gain.
    pub(super) stamps: f64,
    /// Factor on the kicks.
    pub(super) kick: f64,
}

/// The rows, and what moves them the same under all noises.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shared<'a> {
    pub(super) time: &'a [f64],
    pub(super) used: &'a [bool],
    /// Slope of the response at each row, where its time may scatter.
    pub(super) speed: &'a [f64],
    /// Columns, one after the other, zero in rows that are not used.
    pub(super) columns: &'a [f64],
    /// Those of a scatter of one.
    pub(super) kicks: &'a [Kick],
}

/// ln det V and R of the whitened columns under each of these noises, which have equally many states.
pub(super) fn triangles(
    shared: Shared<'_>,
    noises: &[One],
    task: &Task,
) -> Result<Vec<(f64, Triangle)>, Error> {
    let set = Instructions::chosen();
    macro_rules! run {
        ($states:literal) => {
            set.run(Passes::<$states> {
                shared,
                noises,
                task,
            })
        };
    }
    match noises.first().map_or(0, |one| one.joint.c.len()) {
        0 => run!(0),
        1 => run!(1),
        2 => run!(2),
        3 => run!(3),
        4 => run!(4),
        5 => run!(5),
        6 => run!(6),
        7 => run!(7),
        8 => run!(8),
        n => refuse!("plant and noise have {n} states, but the likelihood can use at most 8"),
    }
}

/// Passes with N states, each of as many noises as a register has lanes.
struct Passes<'a, const N: usize> {
    shared: Shared<'a>,
    noises: &'a [One],
    task: &'a Task,
}

impl<const N: usize> WithSimd for Passes<'_, N> {
    type Output = Result<Vec<(f64, Triangle)>, Error>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let mut found = Vec::with_capacity(self.noises.len());
        for noises in self.noises.chunks(S::F64_LANES) {
            pass::<S, N>(simd, self.shared, noises, self.task, &mut found)?;
        }
        Ok(found)
    }
}

/// A value of each noise; lanes without one repeat the first.
#[inline(always)]
fn lanes<S: Simd>(simd: S, noises: &[One], of: impl Fn(&One) -> f64) -> S::f64s {
    let mut values = [0.0; WIDEST];
    for (lane, value) in values.iter_mut().enumerate() {
        *value = noises.get(lane).or(noises.first()).map_or(0.0, &of);
    }
    simd.partial_load_f64s(&values[..S::F64_LANES])
}

/// Square matrices in lanes.
type Matrix<V, const N: usize> = [[V; N]; N];

#[inline(always)]
fn matrix<S: Simd, const N: usize>(
    simd: S,
    noises: &[One],
    of: impl Fn(&One, usize) -> f64,
) -> Matrix<S::f64s, N> {
    let mut found = [[simd.splat_f64s(0.0); N]; N];
    for (i, row) in found.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = lanes(simd, noises, |one| of(one, i * N + j));
        }
    }
    found
}

/// Φ and Q of one step length.
#[repr(align(32))]
struct Step<V, const N: usize> {
    phi: Matrix<V, N>,
    q: Matrix<V, N>,
}

#[inline(always)]
fn step<S: Simd, const N: usize>(simd: S, noises: &[One], length: f64) -> Step<S::f64s, N> {
    let zero = simd.splat_f64s(0.0);
    let mut found = Step {
        phi: [[zero; N]; N],
        q: [[zero; N]; N],
    };
    for lane in 0..S::F64_LANES {
        let Some(one) = noises.get(lane).or(noises.first()) else {
            continue;
        };
        let square = |flat: &[f64]| -> [[f64; N]; N] {
            std::array::from_fn(|i| std::array::from_fn(|j| flat[i * N + j]))
        };
        let own = Propagation::new(&square(&one.joint.a), &square(&one.joint.noise), length);
        for (to, from) in [(&mut found.phi, &own.phi), (&mut found.q, &own.q)] {
            for (to, from) in to.iter_mut().flatten().zip(from.iter().flatten()) {
                cast_slice_mut(std::slice::from_mut(to))[lane] = *from;
            }
        }
    }
    found
}

/// Φ P Φᵀ + Q, for the symmetric P.
#[expect(
    clippy::needless_range_loop,
    reason = "entries of two matrices by the same numbers"
)]
#[inline(always)]
fn predict<S: Simd, const N: usize>(simd: S, p: &mut Matrix<S::f64s, N>, by: &Step<S::f64s, N>) {
    let mut left = [[simd.splat_f64s(0.0); N]; N];
    for i in 0..N {
        for k in 0..N {
            for j in 0..N {
                left[i][j] = simd.mul_add_f64s(by.phi[i][k], p[k][j], left[i][j]);
            }
        }
    }
    for i in 0..N {
        for j in 0..=i {
            let mut sum = by.q[i][j];
            for k in 0..N {
                sum = simd.mul_add_f64s(left[i][k], by.phi[j][k], sum);
            }
            p[i][j] = sum;
            p[j][i] = sum;
        }
    }
}

#[expect(
    clippy::needless_range_loop,
    reason = "entries of two matrices by the same numbers"
)]
#[inline(always)]
fn pass<S: Simd, const N: usize>(
    simd: S,
    shared: Shared<'_>,
    noises: &[One],
    task: &Task,
    found: &mut Vec<(f64, Triangle)>,
) -> Result<(), Error> {
    let Shared {
        time,
        used,
        speed,
        columns,
        kicks,
    } = shared;
    let rows = time.len();
    let count = columns.len() / rows.max(1);
    let (zero, one) = (simd.splat_f64s(0.0), simd.splat_f64s(1.0));
    let mut p = matrix::<S, N>(simd, noises, |one, place| one.joint.start[place]);
    let mut c = [zero; N];
    for (i, c) in c.iter_mut().enumerate() {
        *c = lanes(simd, noises, |one| one.joint.c[i]);
    }
    let stamps = lanes(simd, noises, |one| one.stamps * one.stamps);
    let kicked = lanes(simd, noises, |one| one.kick * one.kick);
    let mut states = memory::filled(WHAT, Line([zero; N]), count)?;
    let mut steps = Kept::new();
    let mut kicks = kicks.iter().peekable();
    let mut factor = Factor::new(simd, count)?;
    let mut log_det = [0.0; WIDEST];
    let mut large = one;
    let mut length = f64::NAN;
    for row in 0..rows {
        if row % SETTLED as usize == 0 {
            for Line(state) in &mut states {
                for state in cast_slice_mut::<_, f64>(state) {
                    *state = settled(*state);
                }
            }
        }
        let mut by: Option<&Step<S::f64s, N>> = None;
        if row > 0 {
            let between = time[row] - time[row - 1];
            let tolerance = SAME_ROWS.0 * time[row].abs() + SAME_ROWS.1 * between;
            if length.is_nan() || (between - length).abs() > tolerance {
                length = between;
            }
            let own = steps.at(length, time[row], || step::<S, N>(simd, noises, length));
            predict(simd, &mut p, own);
            by = Some(own);
            while let Some(kick) = kicks.next_if(|kick| kick.row <= row) {
                for i in 0..N {
                    for j in 0..N {
                        let both = simd.splat_f64s(kick.state[i] * kick.state[j]);
                        p[i][j] = simd.mul_add_f64s(both, kicked, p[i][j]);
                    }
                }
            }
        }
        let place = row % BLOCK;
        let (mut gain, mut scale) = ([zero; N], zero);
        if used[row] {
            let moved = speed.get(row).copied().unwrap_or(0.0);
            let mut variance = simd.mul_add_f64s(stamps, simd.splat_f64s(moved * moved), one);
            let mut pc = [zero; N];
            for i in 0..N {
                for j in 0..N {
                    pc[i] = simd.mul_add_f64s(p[i][j], c[j], pc[i]);
                }
                variance = simd.mul_add_f64s(pc[i], c[i], variance);
            }
            let inverse = simd.div_f64s(one, variance);
            scale = simd.sqrt_f64s(inverse);
            gain = pc.map(|pc| simd.mul_f64s(pc, inverse));
            for i in 0..N {
                for j in 0..N {
                    let less = simd.mul_f64s(pc[i], gain[j]);
                    p[i][j] = simd.sub_f64s(p[i][j], less);
                }
            }
            let larger = simd.mul_f64s(large, variance);
            let over = simd.greater_than_or_equal_f64s(larger, simd.splat_f64s(LARGE));
            if simd.first_true_m64s(over) == S::F64_LANES {
                large = larger;
            } else {
                // Those of the other lanes are of one.
                let taken = simd.select_f64s(over, large, one);
                add_logarithms(&mut log_det, cast_slice(&[taken]));
                let taken = simd.select_f64s(over, variance, one);
                add_logarithms(&mut log_det, cast_slice(&[taken]));
                large = simd.select_f64s(over, one, larger);
            }
        }
        for (column, Line(state)) in states.iter_mut().enumerate() {
            // At the first row all are zero.
            let mut moved = [zero; N];
            if let Some(by) = by {
                for i in 0..N {
                    for j in 0..N {
                        moved[i] = simd.mul_add_f64s(by.phi[i][j], state[j], moved[i]);
                    }
                }
            }
            // In a row that is not used the gain and the scale are zero.
            let mut innovation = simd.splat_f64s(columns[column * rows + row]);
            for i in 0..N {
                innovation = simd.negate_mul_add_f64s(c[i], moved[i], innovation);
            }
            for i in 0..N {
                moved[i] = simd.mul_add_f64s(gain[i], innovation, moved[i]);
            }
            *state = moved;
            factor.put(column, place, simd.mul_f64s(innovation, scale));
        }
        if place == BLOCK - 1 || row == rows - 1 {
            task.check()?;
            factor.take_in(simd, place + 1);
        }
    }
    add_logarithms(&mut log_det, cast_slice(&[large]));
    let each = log_det.iter().take(noises.len()).enumerate();
    found.extend(each.map(|(lane, log_det)| (*log_det, factor.triangle(lane))));
    Ok(())
}

fn add_logarithms(sums: &mut [f64], of: &[f64]) {
    for (sum, of) in sums.iter_mut().zip(of) {
        *sum += of.ln();
    }
}

/// What memory is asked for.
const WHAT: &str = "the triangular factors";

/// R of the rows so far, by modified Gram–Schmidt as in `Triangle`, and the rows since.
struct Factor<V> {
    count: usize,
    /// Column by column; row i of column j at j (j + 1)/2 + i.
    factor: Vec<V>,
    /// Each column of R above the rows of a block.
    stacked: Vec<Line<V>>,
}

impl<V: Copy + pulp::bytemuck::Pod> Factor<V> {
    #[inline(always)]
    fn new<S: Simd<f64s = V>>(simd: S, count: usize) -> Result<Self, Error> {
        let zero = simd.splat_f64s(0.0);
        Ok(Self {
            count,
            factor: memory::filled(WHAT, zero, count * (count + 1) / 2)?,
            stacked: memory::filled(WHAT, Line(zero), count * (count + BLOCK))?,
        })
    }

    #[inline(always)]
    fn put(&mut self, column: usize, row: usize, value: V) {
        self.stacked[column * (self.count + BLOCK) + self.count + row] = Line(value);
    }

    /// Update R by the first rows of the block. A page, whose code has one instruction set, needs one
    /// copy for all numbers of states.
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    fn take_in<S: Simd<f64s = V>>(&mut self, simd: S, rows: usize) {
        let (count, stride) = (self.count, self.count + BLOCK);
        let zero = simd.splat_f64s(0.0);
        for j in 0..count {
            let above = &mut self.stacked[j * stride..][..count];
            above.fill(Line(zero));
            let from = &self.factor[j * (j + 1) / 2..][..=j];
            for (above, from) in above.iter_mut().zip(from) {
                *above = Line(*from);
            }
        }
        for j in 0..count {
            let (before, rest) = self.stacked.split_at_mut(j * stride);
            let own = &mut rest[..count + rows];
            let parts = &mut self.factor[j * (j + 1) / 2..][..=j];
            for (part, q) in parts.iter_mut().zip(before.chunks_exact(stride)) {
                let q = &q[..own.len()];
                *part = product(simd, q, own);
                for (Line(q), Line(own)) in q.iter().zip(own.iter_mut()) {
                    *own = simd.negate_mul_add_f64s(*part, *q, *own);
                }
            }
            let left = simd.sqrt_f64s(product(simd, own, own));
            let mut inverse = left;
            for inverse in cast_slice_mut::<V, f64>(std::slice::from_mut(&mut inverse)) {
                *inverse = if *inverse > 0.0 { 1.0 / *inverse } else { 0.0 };
            }
            for Line(own) in own.iter_mut() {
                *own = simd.mul_f64s(*own, inverse);
            }
            parts[j] = left;
        }
    }

    /// R under one noise.
    fn triangle(&self, lane: usize) -> Triangle {
        let lanes = size_of::<V>() / size_of::<f64>();
        let entries = cast_slice::<V, f64>(&self.factor).chunks_exact(lanes);
        Triangle::of(entries.map(|entry| entry[lane]).collect())
    }
}

/// The inner product of two columns, in four sums that are computed side by side.
#[inline(always)]
fn product<S: Simd>(simd: S, x: &[Line<S::f64s>], y: &[Line<S::f64s>]) -> S::f64s {
    let mut sums = [simd.splat_f64s(0.0); 4];
    let (left, right) = (x.chunks_exact(4), y.chunks_exact(4));
    for (sum, (Line(x), Line(y))) in sums
        .iter_mut()
        .zip(left.remainder().iter().zip(right.remainder()))
    {
        *sum = simd.mul_f64s(*x, *y);
    }
    for (x, y) in left.zip(right) {
        for (sum, (Line(x), Line(y))) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum = simd.mul_add_f64s(*x, *y, *sum);
        }
    }
    let [a, b, c, d] = sums;
    simd.add_f64s(simd.add_f64s(a, b), simd.add_f64s(c, d))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A noise of one time constant of 1 s and this variance.
    fn noise(variance: f64) -> One {
        One {
            joint: Joint {
                a: vec![-1.0],
                noise: vec![2.0 * variance],
                c: vec![1.0],
                start: vec![variance],
            },
            stamps: 0.0,
            kick: 0.0,
        }
    }

    /// The product of the variances of one lane once grew so large that all lanes took their logarithms,
    /// so that the bits of a likelihood depended on the noises beside it.
    #[test]
    fn a_noise_has_the_same_bits_beside_others() {
        let time: Vec<f64> = (0..400).map(f64::from).collect();
        let columns: Vec<f64> = time.iter().map(|t| (0.3 * t).sin()).collect();
        let used = vec![true; time.len()];
        let shared = Shared {
            time: &time,
            used: &used,
            speed: &[],
            columns: &columns,
            kicks: &[],
        };
        let noises: Vec<One> = [0.1, 1e7, 3.0, 1e20, 0.7, 40.0].map(noise).to_vec();
        let task = Task::new();
        let together = triangles(shared, &noises, &task).unwrap();
        for (noise, found) in noises.iter().zip(&together) {
            let alone = triangles(shared, std::slice::from_ref(noise), &task).unwrap();
            assert_eq!(alone[0].0.to_bits(), found.0.to_bits());
            assert_eq!(alone[0].1, found.1);
        }
    }
}
