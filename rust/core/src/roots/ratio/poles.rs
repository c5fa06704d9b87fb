//! The questions about the roots of a denominator, asked without those that the numerator hides.

use num_complex::Complex64;

use super::shared::Ratio;
use crate::quasipoly::Kind;
use crate::roots::chains::chain_abscissa;
use crate::roots::locating::{
    Edge, abscissa_with, count_with_edge, is_stable, rightmost, roots_with_edge, spectral_abscissa,
};
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Number of hidden roots among the rightmost ones after which no further pole is sought. A larger
/// one costs time where numerator and denominator have infinitely many roots in common.
const MOST_HIDDEN: usize = 64;

/// Roots of the denominator.
#[derive(Debug, Clone, PartialEq)]
pub struct Poles {
    /// Those that the numerator has not: the poles.
    pub poles: RootSet,
    /// Those that it has too.
    pub hidden: RootSet,
}

/// A verdict, and what it leaves out.
#[derive(Debug, Clone, PartialEq)]
pub struct Stability {
    /// Is every pole proved to lie left of the imaginary axis?
    pub stable: bool,
    /// Hidden roots that are not left of the axis, where the verdict rests on them.
    pub hidden: Vec<Complex64>,
}

impl Ratio {
    /// Poles of a region and hidden roots. Hidden roots on the edge are no obstacle.
    ///
    /// # Errors
    /// As [`roots_with_edge`].
    ///
    /// ```
    /// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{Edge, Ratio, Region}};
    /// // (1 − e^(−s))/s is finite at 0.
    /// let n = QuasiPolynomial::new(vec![vec![1.0], vec![-1.0]], vec![0.0, 1.0])?;
    /// let ratio = Ratio::new(n, QuasiPolynomial::variable());
    /// let found = ratio.poles(&Region::right_of(-1.0), Edge::Refused, &Task::new())?;
    /// assert_eq!((found.poles.counted, found.hidden.counted), (0, 1));
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn poles(&self, region: &Region, edge: Edge, task: &Task) -> Result<Poles, Error> {
        let sorted = |edge| roots_with_edge(&self.d, region, edge, task);
        match sorted(edge) {
            Err(refusal @ Error::OnEdge { .. }) => {
                let closed = self.divided(&sorted(Edge::Inside)?);
                let open = self.divided(&sorted(Edge::Outside)?);
                if closed.poles.counted == open.poles.counted {
                    Ok(closed)
                } else {
                    Err(refusal)
                }
            }
            found => found.map(|set| self.divided(&set)),
        }
    }

    /// The number of poles in a region.
    ///
    /// # Errors
    /// As [`Ratio::poles`].
    pub fn count(&self, region: &Region, edge: Edge, task: &Task) -> Result<u64, Error> {
        if self.has_no_zero(region, task)? {
            return count_with_edge(&self.d, region, edge, task);
        }
        Ok(self.poles(region, edge, task)?.poles.counted)
    }

    /// The `wanted` rightmost poles, as [`rightmost`] lists roots, and the hidden roots among them.
    /// Fewer also where very many roots are hidden.
    ///
    /// # Errors
    /// As [`rightmost`].
    pub fn rightmost(&self, wanted: usize, task: &Task) -> Result<Poles, Error> {
        let upper = |set: &RootSet| set.roots.iter().filter(|root| root.im >= 0.0).count();
        let mut asked = wanted;
        loop {
            let set = rightmost(&self.d, asked, task)?;
            let found = self.divided(&set);
            let missing = wanted.saturating_sub(upper(&found.poles));
            let last = upper(&set) < asked || upper(&found.hidden) >= MOST_HIDDEN;
            if missing == 0 || last {
                return Ok(found);
            }
            asked += missing;
        }
    }

    /// The largest real part of a pole, or the abscissa of the chains if that is larger; −∞ where
    /// there is no pole.
    ///
    /// # Errors
    /// As [`spectral_abscissa`]; [`Error::Argument`] where hidden roots were found and no pole.
    pub fn spectral_abscissa(&self, strong: bool, task: &Task) -> Result<f64, Error> {
        if !self.can_share() {
            return spectral_abscissa(&self.d, strong, task);
        }
        let Poles { poles, hidden } = self.rightmost(1, task)?;
        let searched = poles.region.re.0;
        let chain = chain_abscissa(&self.d);
        match poles.roots.first() {
            None if hidden.counted > 0 && searched == f64::NEG_INFINITY => Ok(searched),
            None if hidden.counted > 0 && chain == f64::NEG_INFINITY => {
                Err(Error::argument(format!(
                    "no pole was found, because all {} roots of the denominator right of \
                     {searched:.6} are roots of the numerator as well: divide out the common \
                     factors",
                    hidden.counted
                )))
            }
            first => {
                let isolated = first.map_or(f64::NEG_INFINITY, |root| root.re);
                abscissa_with(&self.d, isolated, strong, task)
            }
        }
    }

    /// Is every pole proved to lie left of the imaginary axis?
    ///
    /// As [`is_stable`] for the denominator. If that is not stable, its roots right of the axis or
    /// on it are located, and the answer is `true` if all of them are hidden. Where only exact delays
    /// keep the chains left of the axis, hidden roots are not sought, and the answer is `false`.
    ///
    /// # Errors
    /// As [`is_stable`].
    pub fn stability(&self, strong: bool, task: &Task) -> Result<Stability, Error> {
        let verdict = |stable, hidden| Ok(Stability { stable, hidden });
        if is_stable(&self.d, strong, task)? {
            return verdict(true, Vec::new());
        }
        let half_plane = Region::right_of(0.0);
        if self.d.kind() == Kind::Advanced
            || chain_abscissa(&self.d) >= 0.0
            || self.has_no_zero(&half_plane, task)?
        {
            return verdict(false, Vec::new());
        }
        // One pole right of the axis decides sooner than all of them.
        let right = |set: &RootSet| {
            let mut listed = set.roots.iter().zip(&set.radii);
            listed.any(|(root, radius)| root.re > *radius)
        };
        match rightmost(&self.d, 1, task) {
            Ok(set) if right(&self.divided(&set).poles) => return verdict(false, Vec::new()),
            Err(error) if error.ends_all() => return Err(error),
            _ => {}
        }
        match self.poles(&half_plane, Edge::Inside, task) {
            Ok(found) if found.poles.counted == 0 => verdict(true, found.hidden.roots),
            Err(error) if error.ends_all() => Err(error),
            _ => verdict(false, Vec::new()),
        }
    }

    /// Is the numerator known to have no zero in the closed region?
    fn has_no_zero(&self, region: &Region, task: &Task) -> Result<bool, Error> {
        if !self.can_share() {
            return Ok(true);
        }
        match count_with_edge(&self.n, region, Edge::Inside, task) {
            Ok(number) => Ok(number == 0),
            Err(error) if error.ends_all() => Err(error),
            Err(_) => Ok(false),
        }
    }

    /// Divide roots of the denominator into poles and hidden ones.
    fn divided(&self, set: &RootSet) -> Poles {
        let listed = set.roots.iter().zip(&set.multiplicities);
        let hidden: Vec<u32> = listed.map(|(root, m)| self.shared(*root, *m)).collect();
        let kept = set.multiplicities.iter().zip(&hidden);
        let kept = kept.map(|(all, hidden)| all - hidden).collect();
        let of = |multiplicities: Vec<u32>| {
            let set = RootSet {
                multiplicities,
                ..set.clone()
            };
            set.part(set.region, |i| set.multiplicities.get(i) > Some(&0))
        };
        Poles {
            poles: of(kept),
            hidden: of(hidden),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::{QuasiPolynomial, make};

    fn stable(n: &QuasiPolynomial, d: &QuasiPolynomial) -> bool {
        let ratio = Ratio::new(n.clone(), d.clone());
        ratio
            .stability(true, &Task::new())
            .is_ok_and(|found| found.stable)
    }

    #[test]
    fn one_pole_that_stays_is_enough() {
        let n = make(&[&[-1.0, 1.0]], &[0.5]);
        assert!(stable(&n, &make(&[&[-1.0, 0.0, 1.0]], &[0.0])));
        assert!(!stable(&n, &make(&[&[2.0, -3.0, 1.0]], &[0.0])));
        assert!(!stable(&n, &make(&[&[1.0, -2.0, 1.0]], &[0.0])));
        assert!(!stable(
            &QuasiPolynomial::zero(),
            &make(&[&[-1.0, 1.0]], &[0.0])
        ));
    }

    #[test]
    fn a_hidden_root_on_an_edge_is_no_obstacle() {
        let n = make(&[&[1.0], &[-1.0]], &[0.0, 1.0]);
        let found = |d: &[f64]| {
            let ratio = Ratio::new(n.clone(), make(&[d], &[0.0]));
            ratio.count(&Region::right_of(0.0), Edge::Refused, &Task::new())
        };
        assert_eq!(found(&[0.0, 1.0]), Ok(0));
        assert_eq!(found(&[0.0, -3.0, 1.0]), Ok(1));
        assert!(found(&[0.0, 0.0, 1.0]).is_err());
    }
}
