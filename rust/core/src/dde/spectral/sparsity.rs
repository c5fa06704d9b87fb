//! Which components a right-hand side depends on: pattern, groups of columns, order of rows.
//!
//! Columns without a common row form a group, whose differences come from one evaluation (Curtis,
//! Powell and Reid, 1974; colours by the greedy rule). Cuthill and McKee's order, reversed (1969),
//! moves the entries of a sparse matrix near its diagonal, where its factors remain.

use std::collections::VecDeque;

use crate::Error;

/// Longest row, as a share of all columns, for which grouping pays.
const GROUPED: f64 = 0.25;

/// The indices of a square matrix that may be other than zero, column by column.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sparsity {
    /// Where each column starts in `rows`, and the end of the last one.
    pub(super) starts: Vec<usize>,
    pub(super) rows: Vec<usize>,
}

impl Sparsity {
    /// A pattern from the row and column of each entry.
    pub fn new(dim: usize, rows: &[usize], columns: &[usize]) -> Result<Self, Error> {
        refuse_if!(
            rows.len() != columns.len() || rows.iter().chain(columns).any(|index| *index >= dim),
            "jac_sparsity has entries outside {dim} rows and columns: give the pattern of a \
             ({dim}, {dim}) matrix"
        );
        let mut entries: Vec<(usize, usize)> = columns
            .iter()
            .copied()
            .zip(rows.iter().copied())
            // Newton's matrix has its diagonal in any case.
            .chain((0..dim).map(|d| (d, d)))
            .collect();
        entries.sort_unstable();
        entries.dedup();
        let mut pattern = Self::default();
        for (column, row) in entries {
            while pattern.starts.len() <= column {
                pattern.starts.push(pattern.rows.len());
            }
            pattern.rows.push(row);
        }
        pattern.starts.push(pattern.rows.len());
        Ok(pattern)
    }

    /// Number of columns.
    pub(super) fn dim(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Rows of the entries of a column.
    pub(super) fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.starts[column]..self.starts[column + 1]
    }

    fn transposed(&self) -> Vec<Vec<usize>> {
        let mut columns = vec![Vec::new(); self.dim()];
        for column in 0..self.dim() {
            for &row in &self.rows[self.column(column)] {
                columns[row].push(column);
            }
        }
        columns
    }

    /// A group for each column, and how many groups there are.
    pub(super) fn groups(&self) -> (Vec<usize>, usize) {
        let dim = self.dim();
        let across = self.transposed();
        let longest = across.iter().map(Vec::len).max().unwrap_or(0);
        if longest as f64 > GROUPED * dim as f64 {
            return ((0..dim).collect(), dim);
        }
        let mut group = vec![usize::MAX; dim];
        let mut count = 0;
        // The last column for which each group was found to be used.
        let mut taken: Vec<usize> = Vec::new();
        for column in 0..dim {
            for &row in &self.rows[self.column(column)] {
                for &other in &across[row] {
                    if let Some(mark) = taken.get_mut(group[other]) {
                        *mark = column;
                    }
                }
            }
            let free = taken.iter().position(|mark| *mark != column);
            let own = free.unwrap_or(count);
            if own == count {
                count += 1;
                taken.push(usize::MAX);
            }
            group[column] = own;
        }
        (group, count)
    }

    /// A new index for each component, and the largest distance of an entry from the diagonal then.
    pub(super) fn banded(&self) -> (Vec<usize>, usize) {
        let dim = self.dim();
        let mut near = self.transposed();
        for (column, near) in near.iter_mut().enumerate() {
            near.extend_from_slice(&self.rows[self.column(column)]);
            near.sort_unstable();
            near.dedup();
        }
        let mut order = Vec::with_capacity(dim);
        let mut seen = vec![false; dim];
        for first in 0..dim {
            if seen[first] {
                continue;
            }
            // The component that is found last lies at an end of its connected set.
            let mut reached = vec![first];
            let end = sweep(&near, first, &mut seen, &mut reached);
            reached.iter().for_each(|&index| seen[index] = false);
            order.push(end);
            sweep(&near, end, &mut seen, &mut order);
        }
        let mut place = vec![0; dim];
        for (position, &index) in order.iter().rev().enumerate() {
            place[index] = position;
        }
        let mut width = 0;
        for column in 0..dim {
            for &row in &self.rows[self.column(column)] {
                width = width.max(place[row].abs_diff(place[column]));
            }
        }
        (place, width)
    }
}

/// Append what is connected with `first`, the last one of `order`: the nearest ones first, and of
/// those the least connected ones. Returns the one found last.
fn sweep(near: &[Vec<usize>], first: usize, seen: &mut [bool], order: &mut Vec<usize>) -> usize {
    let mut open = VecDeque::from([first]);
    seen[first] = true;
    let mut last = first;
    while let Some(index) = open.pop_front() {
        last = index;
        let mut next: Vec<usize> = near[index].iter().copied().filter(|i| !seen[*i]).collect();
        next.sort_by_key(|i| near[*i].len());
        for index in next {
            seen[index] = true;
            order.push(index);
            open.push_back(index);
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbours on a ring, numbered crosswise.
    fn ring(dim: usize) -> Sparsity {
        let name = |i: usize| (i * 7) % dim;
        let pairs = (0..dim).flat_map(|i| [(i, i), (i, (i + 1) % dim), ((i + 1) % dim, i)]);
        let (rows, columns): (Vec<_>, Vec<_>) = pairs.map(|(i, j)| (name(i), name(j))).unzip();
        Sparsity::new(dim, &rows, &columns).unwrap()
    }

    #[test]
    fn a_ring_numbered_crosswise_becomes_a_narrow_band() {
        let (place, width) = ring(100).banded();
        assert_eq!(width, 2);
        let mut sorted = place;
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..100));
    }

    #[test]
    fn columns_of_a_group_share_no_row() {
        let pattern = ring(100);
        let (group, count) = pattern.groups();
        assert!(count <= 5, "{count}");
        for across in pattern.transposed() {
            let mut groups: Vec<_> = across.iter().map(|column| group[*column]).collect();
            groups.sort_unstable();
            groups.dedup();
            assert_eq!(groups.len(), across.len());
        }
    }

    #[test]
    fn a_full_matrix_has_a_group_for_each_column() {
        let all: Vec<usize> = (0..36).collect();
        let rows: Vec<usize> = all.iter().map(|i| i / 6).collect();
        let columns: Vec<usize> = all.iter().map(|i| i % 6).collect();
        let pattern = Sparsity::new(6, &rows, &columns).unwrap();
        assert_eq!(pattern.groups().1, 6);
        assert_eq!(pattern.banded().1, 5);
        assert!(Sparsity::new(5, &rows, &columns).is_err());
    }
}
