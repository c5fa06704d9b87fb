//! The characteristic matrix in block-triangular form.
//!
//! det M(s) = ± Π det M_k(s) over the blocks of the common pattern of E, N and A, exactly: nothing is
//! rounded. A block of one state is a quasi-polynomial, and equal blocks are one with roots of that
//! multiplicity, so that repeated roots of chains and cascades have discs as small as simple ones.

use crate::Error;
use crate::linear_algebra::block_triangular::{Block, blocks};
use crate::quasipoly::QuasiPolynomial;

use super::system::{ByDelay, Irreducible, Matrix};

/// Upper limit on the number of states (bounds the time of the dense factorisations).
const MAX_STATES: usize = 200;

/// A block that is no further block-triangular.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Part {
    Scalar(QuasiPolynomial),
    Matrix(Box<Irreducible>),
}

/// The characteristic matrix M(s) = s E + Σ (s N_j − A_j) e^(−s τ_j), checked once.
#[derive(Debug, Clone, PartialEq)]
pub struct CharacteristicMatrix {
    size: usize,
    /// Blocks with roots, and how many of each there are.
    parts: Vec<(Part, u32)>,
}

impl CharacteristicMatrix {
    /// From E, and N and A with their delays in s: all matrices square, by rows.
    ///
    /// # Errors
    /// [`Error::Argument`] where shapes differ, a number is not finite or far from 1 in size, a
    /// delay is negative, or the pattern of zeros makes the determinant zero.
    ///
    /// ```
    /// use deadtime::roots::matrix::CharacteristicMatrix;
    /// let oscillator = CharacteristicMatrix::new(
    ///     vec![vec![1.0, 0.0], vec![0.0, 1.0]],
    ///     vec![],
    ///     vec![(0.0, vec![vec![0.0, 1.0], vec![-4.0, -0.4]])],
    /// )?;
    /// assert_eq!(oscillator.size(), 2);
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn new(e: Matrix, n: ByDelay, a: ByDelay) -> Result<Self, Error> {
        let size = e.len();
        refuse_if!(
            size == 0 || size > MAX_STATES,
            "the system has {size} states: give 1 to {MAX_STATES} states"
        );
        for (delay, _) in n.iter().chain(&a) {
            refuse_if!(
                !(delay.is_finite() && *delay >= 0.0),
                "a delay is {delay} s: give finite delays of zero or more"
            );
        }
        let all = || std::iter::once(&e).chain(n.iter().chain(&a).map(|(_, matrix)| matrix));
        for matrix in all() {
            refuse_if!(
                matrix.len() != size || matrix.iter().any(|row| row.len() != size),
                "E is {size} by {size}, but another matrix has another size"
            );
        }
        let is_used = |row: usize, column: usize| {
            let entry = |matrix: &Matrix| matrix.get(row).and_then(|row| row.get(column)).copied();
            all().any(|matrix| entry(matrix) != Some(0.0))
        };
        let columns = |row| (0..size).filter(|column| is_used(row, *column)).collect();
        let pattern: Vec<Vec<usize>> = (0..size).map(columns).collect();
        let Some(blocks) = blocks(&pattern) else {
            refuse!(
                "the determinant of the characteristic matrix is zero for every s, because the \
                 zeros of E, N and A leave an equation without a state. Look for a row or a \
                 column of zeros"
            );
        };
        let mut kinds: Vec<((Matrix, ByDelay, ByDelay), u32)> = Vec::new();
        for block in &blocks {
            let kind = (
                within(&e, block),
                group_within(&n, block),
                group_within(&a, block),
            );
            match kinds.iter_mut().find(|(known, _)| *known == kind) {
                Some((_, times)) => *times += 1,
                None => kinds.push((kind, 1)),
            }
        }
        let mut parts = Vec::new();
        for ((e, n, a), times) in kinds {
            if e.len() > 1 {
                let system = Irreducible::new(e, n, a)?;
                parts.push((Part::Matrix(Box::new(system)), times));
                continue;
            }
            let h = scalar(&e, &n, &a)?;
            // A single exponential has no roots.
            if h.degree() > 0 || h.delays().len() > 1 {
                parts.push((Part::Scalar(h), times));
            }
        }
        Ok(Self { size, parts })
    }

    /// The number of states.
    pub fn size(&self) -> usize {
        self.size
    }

    pub(super) fn parts(&self) -> &[(Part, u32)] {
        &self.parts
    }
}

fn within(matrix: &Matrix, block: &Block) -> Matrix {
    let rows = block.rows.iter().filter_map(|row| matrix.get(*row));
    let entries = |row: &Vec<f64>| {
        let columns = block.columns.iter();
        columns
            .filter_map(|column| row.get(*column).copied())
            .collect()
    };
    rows.map(entries).collect()
}

/// Those of a group that are not zero in a block.
fn group_within(group: &ByDelay, block: &Block) -> ByDelay {
    let parts = group
        .iter()
        .map(|(delay, matrix)| (*delay, within(matrix, block)));
    parts
        .filter(|(_, part)| part.iter().flatten().any(|x| *x != 0.0))
        .collect()
}

/// s e + Σ (s n_j − a_j) e^(−s τ_j).
fn scalar(e: &Matrix, n: &ByDelay, a: &ByDelay) -> Result<QuasiPolynomial, Error> {
    let entry = |matrix: &Matrix| matrix.first().and_then(|row| row.first()).copied();
    let slopes = n
        .iter()
        .map(|(delay, n)| (*delay, vec![0.0, entry(n).unwrap_or(0.0)]));
    let values = a
        .iter()
        .map(|(delay, a)| (*delay, vec![-entry(a).unwrap_or(0.0)]));
    let terms = std::iter::once((0.0, vec![0.0, entry(e).unwrap_or(0.0)])).chain(slopes);
    let (delays, rows) = terms.chain(values).unzip();
    QuasiPolynomial::new(rows, delays)
}
