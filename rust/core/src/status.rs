//! Outcome of one item of a batch.

/// Status of one cell of a stability map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum CellStatus {
    /// Count (and abscissa, where requested) are proved.
    Ok = 0,
    /// A root lies on the boundary line, to working precision.
    Boundary = 1,
    /// The abscissa is that of a neutral chain, approached but not attained by roots.
    Chain = 2,
    /// Infinitely many unstable roots.
    Infinite = 3,
    /// Double precision or the work limit did not suffice.
    Undecided = 4,
}
