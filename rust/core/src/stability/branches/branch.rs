//! Roots of the members of a row, A + k B or A + e^(−s d) B with a delay d of k, followed as k varies,
//! several of them and several values of k at a time.
//!
//! From the last two values of k the next roots are extrapolated (cubic, with the slopes ds/dk =
//! −(∂h/∂k)/h′), and each root is refined from there and proved by itself (`certify`). If a root is lost,
//! only the values of k after it are repeated.

use num_complex::Complex64;

use super::certify::{ARGUMENTS, Certify, VALUES};
use super::plane::{Around, Plane};
use crate::quasipoly::modulus;
use crate::simd::{Columns, SHORT, sweep};

/// Upper limit on the roots that are followed.
const FOLLOWED: usize = 4;

/// Values of k processed together.
const STRETCH: usize = 16;

/// Elements of a block.
const ELEMENTS: usize = FOLLOWED * STRETCH;

/// Starts lie within this share of the radius of their bounds; points that Newton's steps lead to,
/// within half of it.
const NEAR_CENTER: f64 = 0.4;

/// Covers the rounding error of a distance.
const ROOM: f64 = 1.0 + 1e-9;

/// A simple root and its disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Root {
    pub(crate) s: Complex64,
    pub(crate) radius: f64,
}

impl Root {
    /// Does it stand for its mirror image as well? h is real where Im s is 0 or `top`. `None` where
    /// this cannot be decided.
    pub(crate) fn weight(&self, top: f64) -> Option<i32> {
        if self.s.im == 0.0 || self.s.im == top {
            Some(1)
        } else {
            (self.s.im.abs() > self.radius && top - self.s.im > self.radius).then_some(2)
        }
    }
}

/// Are all discs disjoint?
pub(super) fn are_apart(roots: &[Root]) -> bool {
    roots.iter().enumerate().all(|(place, one)| {
        roots
            .iter()
            .skip(place + 1)
            .all(|other| modulus(one.s - other.s) > (one.radius + other.radius) * ROOM)
    })
}

/// A root at one k, and its slope.
#[derive(Debug, Clone, Copy)]
struct Knot {
    k: f64,
    s: Complex64,
    slope: Complex64,
}

/// A root followed along k.
#[derive(Debug, Clone)]
struct Branch {
    around: Around,
    before: Knot,
    now: Knot,
}

impl Branch {
    /// Hermite's cubic through the last two roots and slopes, or the tangent.
    fn extrapolation(&self) -> impl Fn(f64) -> Complex64 + use<> {
        let (old, new) = (self.before, self.now);
        let span = if new.k == old.k { 1.0 } else { new.k - old.k };
        // In powers of t, with t = 0 at the newer root and t = −1 at the older one.
        let (d0, d1) = (old.slope * span, new.slope * span);
        let gap = new.s - old.s;
        let (square, cube) = if new.k == old.k {
            (Complex64::ZERO, Complex64::ZERO)
        } else {
            (2.0 * d1 + d0 - 3.0 * gap, d1 + d0 - 2.0 * gap)
        };
        move |k| {
            let t = (k - new.k) / span;
            new.s + (d1 + (square + cube * t) * t) * t
        }
    }

    /// Bounds that hold around the starts at these k.
    fn bounded(&mut self, plane: &Plane, points: &[f64]) -> Option<()> {
        let start = self.extrapolation();
        let farthest = |from: Complex64| {
            let gaps = points.iter().map(|k| start(*k) - from);
            gaps.fold(0.0, |most: f64, gap| most.max(gap.re.abs() + gap.im.abs()))
        };
        if farthest(self.around.center) > NEAR_CENTER * self.around.radius {
            let center = start(*points.get(points.len() / 2)?);
            // Where single steps are taken, the starts are poor and Newton's steps long.
            let needed = if points.len() > 1 {
                farthest(center) / NEAR_CENTER
            } else {
                f64::INFINITY
            };
            self.around = plane.around(center, needed)?;
        }
        Some(())
    }
}

/// Several roots followed along k.
#[derive(Debug, Clone)]
pub(crate) struct Branches {
    all: Vec<Branch>,
    arguments: Columns<ARGUMENTS, ELEMENTS>,
    values: Columns<VALUES, ELEMENTS>,
    /// Values of k in a block, how many of them lose no root, and how many were requested.
    width: usize,
    ahead: usize,
    next: usize,
    /// Values of k to try at once.
    stretch: usize,
}

impl Branches {
    pub(crate) fn none() -> Self {
        Self {
            all: Vec::new(),
            arguments: [[0.0; ELEMENTS]; ARGUMENTS],
            values: [[0.0; ELEMENTS]; VALUES],
            width: 0,
            ahead: 0,
            next: 0,
            stretch: 1,
        }
    }

    /// Follow no root any more.
    pub(crate) fn clear(&mut self) {
        self.all.clear();
        (self.ahead, self.next, self.stretch) = (0, 0, 1);
    }

    /// Follow the roots next to these at k, at most [`FOLLOWED`]. No root is followed where one of
    /// them is not proved to be simple.
    pub(crate) fn start(&mut self, plane: &Plane, roots: impl Iterator<Item = Complex64>, k: f64) {
        self.clear();
        for s in roots.take(FOLLOWED) {
            let Some(around) = plane.around(s, 0.0) else {
                return self.clear();
            };
            let slope = Complex64::ZERO;
            let knot = Knot { k, s, slope };
            self.all.push(Branch {
                around,
                before: knot,
                now: knot,
            });
        }
        if self.follow(plane, &[k], 1) == 0 {
            return self.clear();
        }
        self.pass(1);
        for branch in &mut self.all {
            branch.before = branch.now;
        }
    }

    /// The roots that were found at the start.
    pub(crate) fn started(&self) -> Vec<Root> {
        let [re, im, radius, ..] = &self.values;
        let root = |place: usize| Root {
            s: Complex64::new(re[place], im[place]),
            radius: radius[place],
        };
        (0..self.all.len()).map(root).collect()
    }

    /// Store the roots at the first of the remaining values of k. Returns false where one of them
    /// is lost, or would be the mirror image of another one that is followed.
    pub(crate) fn advance(&mut self, plane: &Plane, points: &[f64], roots: &mut Vec<Root>) -> bool {
        if self.next == self.ahead && !self.all.is_empty() {
            self.pass(self.next);
            let tried = self.stretch.min(points.len());
            let mut found = self.follow(plane, points, tried);
            if found == 0 && tried > 1 {
                found = self.follow(plane, points, 1);
            }
            if found == 0 {
                return false;
            }
            self.stretch = if found == tried {
                (2 * tried).min(STRETCH)
            } else {
                found
            };
        }
        self.put(roots);
        true
    }

    /// Store the roots at the next k of the block.
    fn put(&mut self, roots: &mut Vec<Root>) {
        let [re, im, radius, ..] = &self.values;
        roots.clear();
        roots.extend((0..self.all.len()).map(|place| {
            let at = place * self.width + self.next;
            Root {
                s: Complex64::new(re[at], im[at]),
                radius: radius[at],
            }
        }));
        self.next += 1;
    }

    /// Continue after the `taken` values of k that were requested.
    fn pass(&mut self, taken: usize) {
        for place in 0..self.all.len() {
            let knot = |index| self.knot(place, index);
            let last = taken.checked_sub(1).map(knot);
            let previous = taken.checked_sub(2).map(knot);
            if let Some((branch, last)) = self.all.get_mut(place).zip(last) {
                branch.before = previous.unwrap_or(branch.now);
                branch.now = last;
            }
        }
        (self.ahead, self.next) = (0, 0);
    }

    /// The number of consecutive k, among the first `width`, at which every root is found.
    fn follow(&mut self, plane: &Plane, points: &[f64], width: usize) -> usize {
        (self.width, self.ahead, self.next) = (width, 0, 0);
        let points = points.get(..width).unwrap_or_default();
        for (place, branch) in self.all.iter_mut().enumerate() {
            if branch.bounded(plane, points).is_none() {
                return 0;
            }
            let around = &branch.around;
            let start = branch.extrapolation();
            for (column, k) in (place * self.width..).zip(points) {
                let s = start(*k);
                let [error, slope_error, bend] = around.bounds(*k);
                let (center, within) = (around.center, 0.5 * around.radius);
                let element = [
                    s.re,
                    s.im,
                    *k,
                    error,
                    slope_error,
                    bend,
                    center.re,
                    center.im,
                    within,
                ];
                for (row, value) in self.arguments.iter_mut().zip(element) {
                    row[column] = value;
                }
            }
        }
        let elements = self.all.len() * self.width;
        let [.., within] = &mut self.arguments;
        // The elements that fill the last vectors are not used.
        let filled = elements.next_multiple_of(SHORT).min(ELEMENTS);
        within[elements..filled].fill(-1.0);
        sweep(&Certify(plane), &self.arguments, &mut self.values, elements);
        self.put_on_top(plane.top());
        let found = (0..self.all.len()).fold(points.len(), |found, place| {
            self.proved(plane, place, found)
        });
        (self.ahead, self.next) = (found, 0);
        found
    }

    /// A branch at one k of the block.
    fn knot(&self, place: usize, index: usize) -> Knot {
        let at = place * self.width + index;
        let [re, im, _, slope_re, slope_im] = [0, 1, 2, 3, 4].map(|row| self.values[row][at]);
        Knot {
            k: self.arguments[2][at],
            s: Complex64::new(re, im),
            slope: Complex64::new(slope_re, slope_im),
        }
    }

    /// Where h is real at Im s = `top`, a simple root there stays there: its mirror image would lie
    /// in the same disc.
    fn put_on_top(&mut self, top: f64) {
        let [_, im, radius, _, slope_im] = &mut self.values;
        for (place, branch) in self.all.iter().enumerate() {
            if branch.now.s.im != top {
                continue;
            }
            for column in place * self.width..(place + 1) * self.width {
                let off = (im[column] - top).abs();
                if off <= radius[column] {
                    im[column] = top;
                    slope_im[column] = 0.0;
                    radius[column] += off;
                }
            }
        }
    }

    /// How many of the first `limit` roots of a branch are proved.
    fn proved(&self, plane: &Plane, place: usize, limit: usize) -> usize {
        let mut last = self
            .all
            .get(place)
            .map_or(Complex64::ZERO, |branch| branch.now.s);
        let top = plane.top();
        let [re, im, radius, ..] = &self.values;
        for index in 0..limit {
            let column = place * self.width + index;
            let s = Complex64::new(re[column], im[column]);
            // Newton's step from a point next to a multiple root is unreliable.
            let near = modulus(s - last) <= plane.unit(modulus(last));
            if !(radius[column].is_finite() && s.im >= 0.0 && s.im <= top && near) {
                return index;
            }
            last = s;
        }
        limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lambertw::lambertw;
    use crate::quasipoly::make;

    #[test]
    fn branches_of_lambert_w_are_followed() {
        let plane = Plane::new(
            &make(&[&[0.0, 1.0]], &[0.0]),
            &make(&[&[1.0]], &[1.0]),
            None,
            None,
        );
        for cells in [100, 1000] {
            let points: Vec<f64> = (0..=cells)
                .map(|index| 0.5 + 9.5 * f64::from(index) / f64::from(cells))
                .collect();
            let truth = |k: f64| [0, 1, 2].map(|j| lambertw(Complex64::new(-k, 0.0), j));
            let mut branches = Branches::none();
            branches.start(&plane, truth(points[0]).into_iter(), points[0]);
            let mut roots = Vec::new();
            for index in 1..points.len() {
                let rest = &points[index..];
                assert!(branches.advance(&plane, rest, &mut roots), "{index}");
                assert_eq!(roots.len(), 3);
                for (root, exact) in roots.iter().zip(truth(points[index])) {
                    let off = (root.s - exact).norm();
                    assert!(off <= root.radius + 4e-16 * exact.norm() && root.radius < 1e-11);
                }
            }
        }
    }

    #[test]
    fn a_double_root_is_not_passed() {
        // At k = 1/e the first two roots of s + k e^(−s) meet.
        let plane = Plane::new(
            &make(&[&[0.0, 1.0]], &[0.0]),
            &make(&[&[1.0]], &[1.0]),
            None,
            None,
        );
        let points: Vec<f64> = (0..100)
            .map(|index| 0.3 + 0.002 * f64::from(index))
            .collect();
        let mut branches = Branches::none();
        let start = lambertw(Complex64::new(-0.3, 0.0), 0);
        branches.start(&plane, std::iter::once(start), 0.3);
        let mut roots = Vec::new();
        let passed = (1..100)
            .take_while(|index| branches.advance(&plane, &points[*index..], &mut roots))
            .count();
        assert!((25..35).contains(&passed), "{passed}");
    }
}
