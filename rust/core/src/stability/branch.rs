//! Roots of A + k B, followed as k varies, several of them and several values of k at a time.
//!
//! From the last two values of k the next roots are extrapolated (cubic, with the slopes ds/dk = −B/h′),
//! and Newton's step taken there, at s₀, to s₁. Let a = |h′(s₀)| − e₁, η = (|h(s₀)| + e₀)/a, and M bound |h″|
//! within 2η of s₀. If M η ≤ a/4, then by Rouché's theorem exactly one root lies within 2η of s₀: on that circle
//! |h′ (s − s₀)| ≥ 2aη exceeds |h(s₀)| + e₀ + M (2η)²/2 ≤ 1.5 aη. By Taylor's formula at s₀ it lies within
//! (2Mη² + e₀ + 2 e₁ η)/a of s₁ (Kantorovich 1948), besides the rounding of s₁ itself. e₀ and e₁ are bounds on
//! rounding (`plane`), which also cover coefficients that are sums of a few rounded products.
//!
//! Each root at each k is one lane. Its proof depends on nothing but its own start, so that a root that is lost
//! costs those after it only.

use num_complex::Complex64;

use super::plane::{Around, Plane};
use crate::lanes::{Columns, Complex, Kernel, Real, SHORT, Simd, sweep};
use crate::quasipoly::modulus;

/// Roots that are followed at most.
pub(super) const FOLLOWED: usize = 4;

/// Values of k at a time.
const STRETCH: usize = 16;

/// Elements of a block.
const ELEMENTS: usize = FOLLOWED * STRETCH;

/// A radius as wide as this, relative to the root, is worth another step.
const SHARP: f64 = 1e-13;

/// A radius that rounding keeps wider is taken up to this, relative to the root or to one over the longest delay.
const WIDEST: f64 = 1e-11;

/// Steps before a branch is taken for lost.
const MAX_STEPS: u32 = 8;

/// Starts lie within this share of the radius of their bounds, what Newton's steps lead to within half of it.
const NEAR_CENTER: f64 = 0.4;

/// Rounding of the bounds themselves.
const ROOM: f64 = 1.0 + 1e-9;

/// Squares of moduli in this range have lost nothing.
const SQUARES: std::ops::Range<f64> = 1e-280..1e300;

/// Added to a square it outweighs what underflow took.
const TINY: f64 = 1e-300;

/// A simple root and its disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Root {
    pub(super) s: Complex64,
    pub(super) radius: f64,
}

impl Root {
    /// Does it stand for its mirror image as well? `None` where that cannot be told.
    pub(super) fn weight(&self) -> Option<i32> {
        if self.s.im == 0.0 {
            Some(1)
        } else {
            (self.s.im.abs() > self.radius).then_some(2)
        }
    }
}

/// The discs of the roots next to starting values.
struct Settle<'a>(&'a Plane);

/// Start, k, the three bounds there, the centre of these and how far starts may be from it.
const ARGUMENTS: usize = 9;

/// Root, radius, ds/dk; the radius is infinite where nothing is proved.
const VALUES: usize = 5;

impl Kernel<ARGUMENTS, VALUES> for Settle<'_> {
    #[inline(always)]
    fn lanes<S: Simd>(&self, arguments: [Real<S>; ARGUMENTS]) -> [Real<S>; VALUES] {
        let [re, im, k, error, slope_error, bend, x, y, within] = arguments;
        let pace = self.0.pace();
        let center = Complex::new(x, y);
        let mut s = Complex::new(re, im);
        let mut root = s;
        let mut radius = re.constant(f64::INFINITY);
        let mut along = s;
        // Neither proved nor lost.
        let mut open = distance(s, center).le(within);
        for _ in 0..MAX_STEPS {
            if !open.any() {
                break;
            }
            let [a, da, b, db] = self.0.at(s);
            let (h, dh) = (a + b.scaled(k), da + db.scaled(k));
            let (square, slope_square) = (h.square_modulus(), dh.square_modulus());
            let usable = slope_square.gt(SQUARES.start)
                & slope_square.lt(SQUARES.end)
                & square.lt(SQUARES.end);
            let least = (slope_square.sqrt() - slope_error) * (1.0 - 1e-9);
            let inverse = re.constant(1.0) / least;
            let reach = ((square + TINY).sqrt() + error) * inverse * ROOM;
            let inverse_slope = re.constant(1.0) / slope_square;
            let next = s - over(h, dh, inverse_slope);
            let wide =
                (bend * reach * reach * 2.0 + error + slope_error * reach * 2.0) * inverse * ROOM
                    + (s.re.abs() + s.im.abs() + reach) * (8.0 * f64::EPSILON);
            let proved =
                usable & least.gt(0.0) & (bend * reach * 4.0).le(least) & (reach * 2.0).le(within);
            let size = next.re.abs().larger(next.im.abs());
            let unit = if pace > 0.0 { size.larger(pace) } else { size };
            let rounded = wide.le(error * inverse * 4.0) & wide.le(unit * WIDEST);
            let sharp = proved & (wide.le(size * SHARP) | rounded);
            let done = open & sharp;
            root = done.choose(next, root);
            radius = done.select(wide, radius);
            along = done.choose(-over(b, dh, inverse_slope), along);
            // Comparisons with NaN are false.
            open = open & !sharp & usable & distance(next, center).le(within);
            s = open.choose(next, s);
        }
        [root.re, root.im, radius, along.re, along.im]
    }
}

/// A bound on |s − t|, larger by √2 at most.
#[inline(always)]
fn distance<S: Simd>(s: Complex<S>, t: Complex<S>) -> Real<S> {
    let gap = s - t;
    gap.re.abs() + gap.im.abs()
}

/// s/t, given 1/|t|².
#[inline(always)]
fn over<S: Simd>(s: Complex<S>, t: Complex<S>, inverse: Real<S>) -> Complex<S> {
    Complex::new(
        s.re.mul_add(t.re, s.im * t.im) * inverse,
        s.im.mul_sub(t.re, s.re * t.im) * inverse,
    )
}

/// A root at one k, and its slope.
#[derive(Debug, Clone, Copy)]
struct Knot {
    k: f64,
    s: Complex64,
    slope: Complex64,
}

/// A root on its way along k.
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
        // In powers of t from the newer root on; at t = −1 lies the older one.
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
            self.around = plane.around(center, farthest(center) / NEAR_CENTER)?;
        }
        Some(())
    }
}

/// Several roots on their way along k.
#[derive(Debug, Clone)]
pub(super) struct Branches {
    all: Vec<Branch>,
    arguments: Columns<ARGUMENTS, ELEMENTS>,
    values: Columns<VALUES, ELEMENTS>,
    /// Values of k in a block, those of them at which no root is lost, and the first that has not been asked for.
    width: usize,
    ahead: usize,
    next: usize,
    /// Values of k to try at once.
    stretch: usize,
}

impl Branches {
    pub(super) fn none() -> Self {
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

    /// No root is followed any more.
    pub(super) fn clear(&mut self) {
        self.all.clear();
        (self.ahead, self.next, self.stretch) = (0, 0, 1);
    }

    /// Follow the roots next to these at k, [`FOLLOWED`] at most; none at all where one of them is not proved to be simple.
    pub(super) fn start(&mut self, plane: &Plane, roots: impl Iterator<Item = Complex64>, k: f64) {
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
        if self.follow(plane, &[k]) == 0 {
            return self.clear();
        }
        for branch in &mut self.all {
            branch.before = branch.now;
        }
        (self.ahead, self.next) = (0, 0);
    }

    /// Put down the roots at the first of the values of k that are still to come; false where one of them is lost, or
    /// would be the mirror image of one that is followed as well.
    pub(super) fn advance(&mut self, plane: &Plane, points: &[f64], roots: &mut Vec<Root>) -> bool {
        roots.clear();
        if self.all.is_empty() {
            return true;
        }
        if self.next == self.ahead {
            let tried = self.stretch.min(points.len());
            let mut found = points
                .get(..tried)
                .map_or(0, |some| self.follow(plane, some));
            if found == 0 && tried > 1 {
                found = points.get(..1).map_or(0, |one| self.follow(plane, one));
            }
            if found == 0 {
                return false;
            }
            self.stretch = if found == tried {
                (2 * self.stretch).min(STRETCH)
            } else {
                found
            };
        }
        let [re, im, radius, ..] = &self.values;
        for place in (0..self.all.len()).map(|branch| branch * self.width + self.next) {
            roots.push(Root {
                s: Complex64::new(re[place], im[place]),
                radius: radius[place],
            });
        }
        self.next += 1;
        true
    }

    /// At how many of these k, one after the other, every root is found.
    fn follow(&mut self, plane: &Plane, points: &[f64]) -> usize {
        self.width = points.len();
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
        // What fills the last vectors is nowhere near.
        let filled = elements.next_multiple_of(SHORT).min(ELEMENTS);
        within[elements..filled].fill(-1.0);
        sweep(&Settle(plane), &self.arguments, &mut self.values, elements);
        let found = (0..self.all.len()).fold(points.len(), |found, place| {
            self.proved(plane, place, found)
        });
        if found > 0 {
            for place in 0..self.all.len() {
                let knot = |index: usize| {
                    let k = points.get(index).copied().unwrap_or(f64::NAN);
                    let [s, slope] = self.column(place, index);
                    Knot { k, s, slope }
                };
                let (last, previous) = (knot(found - 1), (found > 1).then(|| knot(found - 2)));
                if let Some(branch) = self.all.get_mut(place) {
                    branch.before = previous.unwrap_or(branch.now);
                    branch.now = last;
                }
            }
        }
        (self.ahead, self.next) = (found, 0);
        found
    }

    /// Root and slope of a branch.
    fn column(&self, place: usize, index: usize) -> [Complex64; 2] {
        let at = place * self.width + index;
        let [re, im, _, slope_re, slope_im] = [0, 1, 2, 3, 4].map(|row| self.values[row][at]);
        [Complex64::new(re, im), Complex64::new(slope_re, slope_im)]
    }

    /// How many of the first `limit` roots of a branch are proved.
    fn proved(&self, plane: &Plane, place: usize, limit: usize) -> usize {
        let mut last = self
            .all
            .get(place)
            .map_or(Complex64::ZERO, |branch| branch.now.s);
        let [re, im, radius, ..] = &self.values;
        for index in 0..limit {
            let column = place * self.width + index;
            let s = Complex64::new(re[column], im[column]);
            // Newton's step from next to a multiple root leads anywhere.
            let near = modulus(s - last) <= plane.unit(modulus(last));
            if !(radius[column].is_finite() && s.im >= 0.0 && near) {
                return index;
            }
            last = s;
        }
        limit
    }
}
