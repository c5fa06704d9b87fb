//! Block-triangular form of a square matrix from its pattern of entries that may not be zero.
//!
//! Rows are assigned to columns so that the diagonal has such entries (Kuhn 1955); the blocks are
//! then the strongly connected components of the graph with an edge from the row of each entry to
//! the row assigned to its column (Duff and Reid 1978). The determinant is, but for its sign, the
//! product of those of the blocks.

/// Numbers of rows and of columns of a block, each ascending.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Block {
    pub(crate) rows: Vec<usize>,
    pub(crate) columns: Vec<usize>,
}

/// The blocks of a matrix, given for each row the columns of its entries; `None` where the pattern
/// makes the determinant zero.
pub(crate) fn blocks(pattern: &[Vec<usize>]) -> Option<Vec<Block>> {
    let n = pattern.len();
    let mut row_of = vec![None; n];
    for (row, columns) in pattern.iter().enumerate() {
        // The diagonal first, so that blocks have equal rows and columns where they can.
        if let Some(place) = row_of.get_mut(row)
            && columns.contains(&row)
        {
            *place = Some(row);
        }
    }
    for row in 0..n {
        if !row_of.contains(&Some(row)) && !assign(row, pattern, &mut row_of, &mut vec![false; n]) {
            return None;
        }
    }
    let row_of: Vec<usize> = row_of.into_iter().collect::<Option<_>>()?;
    let reached: Vec<Vec<bool>> = (0..n).map(|row| reached(row, pattern, &row_of)).collect();
    let leads = |from: usize, to: usize| {
        let row = reached.get(from).and_then(|row| row.get(to));
        row.copied().unwrap_or(false)
    };
    let mut done = vec![false; n];
    let mut found = Vec::new();
    for row in 0..n {
        if done.get(row).copied().unwrap_or(true) {
            continue;
        }
        let rows: Vec<usize> = (row..n)
            .filter(|other| leads(row, *other) && leads(*other, row))
            .collect();
        for row in &rows {
            if let Some(done) = done.get_mut(*row) {
                *done = true;
            }
        }
        let columns = row_of.iter().enumerate();
        let columns = columns
            .filter(|(_, row)| rows.contains(row))
            .map(|(column, _)| column);
        let columns = columns.collect();
        found.push(Block { rows, columns });
    }
    Some(found)
}

/// Assign `row` to a column, and others to further ones where they have to give way.
fn assign(
    row: usize,
    pattern: &[Vec<usize>],
    row_of: &mut [Option<usize>],
    tried: &mut [bool],
) -> bool {
    for column in pattern.get(row).into_iter().flatten() {
        match tried.get_mut(*column) {
            Some(tried) if !*tried => *tried = true,
            _ => continue,
        }
        let free = match row_of.get(*column).copied().flatten() {
            None => true,
            Some(other) => assign(other, pattern, row_of, tried),
        };
        if free && let Some(place) = row_of.get_mut(*column) {
            *place = Some(row);
            return true;
        }
    }
    false
}

/// The rows to which edges lead from `row`, itself included.
fn reached(row: usize, pattern: &[Vec<usize>], row_of: &[usize]) -> Vec<bool> {
    let mut seen = vec![false; pattern.len()];
    let mut waiting = vec![row];
    while let Some(row) = waiting.pop() {
        match seen.get_mut(row) {
            Some(seen) if !*seen => *seen = true,
            _ => continue,
        }
        let columns = pattern.get(row).into_iter().flatten();
        waiting.extend(columns.filter_map(|column| row_of.get(*column).copied()));
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows_of(pattern: &[&[usize]]) -> Option<Vec<(Vec<usize>, Vec<usize>)>> {
        let pattern: Vec<Vec<usize>> = pattern.iter().map(|row| row.to_vec()).collect();
        let list = blocks(&pattern)?.into_iter();
        Some(list.map(|block| (block.rows, block.columns)).collect())
    }

    #[test]
    fn triangles_fall_into_entries_and_cycles_do_not() {
        let own = |k: usize| (vec![k], vec![k]);
        let lower: &[&[usize]] = &[&[0], &[0, 1], &[1, 2]];
        assert_eq!(rows_of(lower), Some(vec![own(0), own(1), own(2)]));
        let ring: &[&[usize]] = &[&[0, 1], &[1, 2], &[2, 0]];
        assert_eq!(rows_of(ring), Some(vec![(vec![0, 1, 2], vec![0, 1, 2])]));
        let two: &[&[usize]] = &[&[0, 2], &[1, 2], &[2, 0]];
        let blocks = vec![(vec![0, 2], vec![0, 2]), own(1)];
        assert_eq!(rows_of(two), Some(blocks));
    }

    #[test]
    fn rows_are_assigned_to_columns_off_the_diagonal() {
        let swapped: &[&[usize]] = &[&[1], &[0]];
        let blocks = vec![(vec![0], vec![1]), (vec![1], vec![0])];
        assert_eq!(rows_of(swapped), Some(blocks));
        // Row 2 has to take column 0 from row 0, and that column 1.
        let chain: &[&[usize]] = &[&[0, 1], &[1, 2], &[0]];
        assert_eq!(rows_of(chain).map(|list| list.len()), Some(3));
        assert_eq!(rows_of(&[&[0], &[0]]), None);
    }
}
