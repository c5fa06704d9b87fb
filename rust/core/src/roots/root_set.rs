//! Roots of a region with their discs and multiplicities.

use num_complex::Complex64;

use super::disc::{Disc, RESOLVED};
use super::region::Region;

/// Roots with discs proved to hold exactly their multiplicity.
///
/// Sorted by falling real part, then rising |Im|, then Im ≥ 0 first.
#[derive(Debug, Clone, PartialEq)]
pub struct RootSet {
    /// Centres of the discs, 1/s.
    pub roots: Vec<Complex64>,
    /// Roots in each disc.
    pub multiplicities: Vec<u32>,
    /// Radii of the discs, 1/s.
    pub radii: Vec<f64>,
    /// Is the disc one point to working precision? `false` for a multiple root or cluster whose
    /// disc is wider than 1e-12 of its distance from 0.
    pub resolved: Vec<bool>,
    /// Number of roots in `region`, with multiplicity, by the argument principle; equal to the
    /// sum of the multiplicities.
    pub counted: u64,
    /// Where the roots were sought.
    pub region: Region,
}

impl RootSet {
    /// Sort the discs; `counted` is the sum of their multiplicities.
    pub(crate) fn new(mut discs: Vec<Disc>, region: Region) -> Self {
        discs.sort_by(|a, b| {
            rank(a)
                .partial_cmp(&rank(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        Self {
            roots: discs.iter().map(|d| d.center).collect(),
            multiplicities: discs.iter().map(|d| d.multiplicity).collect(),
            radii: discs.iter().map(|d| d.radius).collect(),
            resolved: discs
                .iter()
                .map(|d| d.multiplicity == 1 || d.radius <= RESOLVED * d.center.norm())
                .collect(),
            counted: discs.iter().map(|d| u64::from(d.multiplicity)).sum(),
            region,
        }
    }

    /// The roots, selected by their index with `kept`, as those of `region`.
    pub(crate) fn part(&self, region: Region, kept: impl Fn(usize) -> bool) -> Self {
        fn chosen<T: Copy>(list: &[T], kept: impl Fn(usize) -> bool) -> Vec<T> {
            let numbered = list.iter().enumerate();
            numbered
                .filter(|(i, _)| kept(*i))
                .map(|(_, item)| *item)
                .collect()
        }
        let multiplicities = chosen(&self.multiplicities, &kept);
        Self {
            roots: chosen(&self.roots, &kept),
            radii: chosen(&self.radii, &kept),
            resolved: chosen(&self.resolved, &kept),
            counted: multiplicities.iter().map(|m| u64::from(*m)).sum(),
            multiplicities,
            region,
        }
    }
}

fn rank(disc: &Disc) -> (f64, f64, f64) {
    let Complex64 { re, im } = disc.center;
    (-re, im.abs(), -im)
}
