//! Elements sorted by the branch of code that they need.
//!
//! A vector executes every branch that one of its lanes needs. Sorting a block by branch avoids
//! this; no bit of a result depends on it.

use num_complex::Complex64;

use super::branch_point::INVERSE_E;
use super::guess::{BEHIND_RADIUS, PRINCIPAL_RADIUS};
use super::kernel::{SERIES_ANSWERS, SMALL};

/// One element in this many is examined before a block is sorted.
const SAMPLED: usize = 8;
/// Bits of one count; four counts share one word.
const FIELD: u32 = 16;

/// 0: no step follows; 1: rational starting value; 2: starting value from the logarithm; 3: from
/// two steps on it.
#[inline(always)]
fn code_branch(z: Complex64, k: i64) -> u8 {
    let (along, across, shifted) = (z.re.abs(), z.im.abs(), (z.re + INVERSE_E).abs());
    let largest = if along > across { along } else { across };
    let distance = if shifted > across { shifted } else { across };
    // Without branches, which would be mispredicted.
    let (principal, first) = (k == 0, k.unsigned_abs() == 1);
    let behind = first & (z.im.is_sign_negative() == (k > 0));
    let near = distance < SERIES_ANSWERS;
    let direct = (principal & ((largest < SMALL) | near)) | (behind & near);
    let rational =
        (principal & (largest < PRINCIPAL_RADIUS)) | (behind & (distance < BEHIND_RADIUS));
    let logarithm = 2 + u8::from(first);
    let stepped = if rational { 1 } else { logarithm };
    if direct { 0 } else { stepped }
}

/// The order in which the elements of a block are processed.
pub(super) struct Order<const W: usize> {
    branches: [u8; W],
    indices: [u16; W],
}

impl<const W: usize> Order<W> {
    pub(super) fn new() -> Self {
        Self {
            branches: [0; W],
            indices: [0; W],
        }
    }

    /// Sort a block by branch. Returns false if most elements need the same branch; there is no
    /// order then.
    pub(super) fn sort(&mut self, z: &[Complex64], k: &[i64]) -> bool {
        let length = z.len().min(k.len()).min(W);
        // Examine some of them: a few elements of another branch cost less than sorting.
        let mut seen = [0; 4];
        for (z, k) in z.iter().zip(k).step_by(SAMPLED) {
            if let Some(count) = seen.get_mut(usize::from(code_branch(*z, *k))) {
                *count += 1;
            }
        }
        let most = seen.iter().max().copied().unwrap_or_default();
        if 8 * most >= 7 * seen.iter().sum::<usize>() {
            return false;
        }
        for (place, (z, k)) in self.branches.iter_mut().zip(z.iter().zip(k)) {
            *place = code_branch(*z, *k);
        }
        let branches = self.branches.get(..length).unwrap_or_default();
        let mut counts = 0_u64;
        for branch in branches {
            counts += 1 << (u32::from(*branch) * FIELD);
        }
        // Start of each branch: the sum of the counts before it.
        let mut next = (counts << FIELD) + (counts << (2 * FIELD)) + (counts << (3 * FIELD));
        for (i, branch) in (0..).zip(branches) {
            let shift = u32::from(*branch) * FIELD;
            let position = (next >> shift) as u16;
            if let Some(place) = self.indices.get_mut(usize::from(position)) {
                *place = i;
            }
            next += 1 << shift;
        }
        true
    }

    /// Index of the element processed as number `i`.
    #[inline]
    pub(super) fn index(&self, i: usize) -> Option<usize> {
        self.indices.get(i).map(|&index| usize::from(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_holds_every_element_once_and_keeps_routes_together() {
        let z: Vec<_> = (0..200)
            .map(|i| Complex64::from_polar((f64::from(i) * 0.2 - 25.0).exp(), f64::from(i)))
            .collect();
        let k: Vec<_> = (0..200).map(|i| i % 3).collect();
        let mut order = Order::<256>::new();
        assert!(order.sort(&z, &k));
        let indices: Vec<_> = (0..200).filter_map(|i| order.index(i)).collect();
        let mut sorted = indices.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..200).collect::<Vec<_>>());
        let branches: Vec<_> = indices.iter().map(|&i| code_branch(z[i], k[i])).collect();
        assert!(branches.is_sorted());
        assert_eq!((branches[0], branches[199]), (0, 3));
        assert!(!order.sort(&z[180..], &[5; 20]));
    }
}
