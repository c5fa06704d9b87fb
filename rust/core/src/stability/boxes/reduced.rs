//! A family over the parameters that vary, with values put in for the others.
//!
//! Delays are taken relative to one row, the reference: h e^(s τ_r) has the zeros of h and, on the
//! imaginary axis, its modulus. `digits` counts the rounding errors of the sums and products below,
//! in units of u = 2⁻⁵³ relative to the moduli of the summands: one for each factor and summand.

use crate::Error;
use crate::stability::family::{Affine, Family};
use crate::stability::specification::{Piece, Specification};

/// A family over `D` parameters.
#[derive(Debug, Clone)]
pub(crate) struct Reduced<'a, const D: usize> {
    /// The whole family.
    pub(crate) family: &'a Family,
    /// Values of all its parameters; those that vary are stored at their `places`.
    values: Vec<f64>,
    /// Indices of the varying parameters; `None` for one that does not exist.
    places: [Option<usize>; D],
    pub(crate) rows: Vec<Row<D>>,
    /// The highest power of s.
    pub(crate) degree: usize,
    /// The specification for the roots, and the edge of the region that it excludes.
    pub(crate) specification: Specification,
    pub(crate) edge: Vec<Piece>,
    /// Number of rounding errors in a coefficient.
    pub(crate) digits: f64,
}

/// The terms that share a delay.
#[derive(Debug, Clone)]
pub(crate) struct Row<const D: usize> {
    /// The delay, relative to the reference, where all varying parameters are zero.
    pub(crate) delay: f64,
    pub(crate) slopes: [f64; D],
    /// Sum of the moduli from which `delay` was added up.
    pub(crate) size: f64,
    /// The same as `slopes`, with moduli.
    pub(crate) slope_sizes: [f64; D],
    pub(crate) monomials: Vec<Monomial<D>>,
}

#[derive(Debug, Clone)]
pub(crate) struct Monomial<const D: usize> {
    pub(crate) coefficient: f64,
    pub(crate) exponents: [u32; D],
    /// The power of s.
    pub(crate) power: usize,
}

impl<'a, const D: usize> Reduced<'a, D> {
    /// The family with `values` put in, except for the parameters at `places`.
    pub(crate) fn new(family: &'a Family, values: &[f64], places: &[usize]) -> Self {
        let mut own = [None; D];
        for (slot, place) in own.iter_mut().zip(places) {
            *slot = Some(*place);
        }
        let mut rows: Vec<Row<D>> = Vec::new();
        let (mut degree, mut digits) = (0, 0.0);
        for (delay, terms) in family.rows() {
            let mut row = Row::with_delay(delay, values, own);
            for term in terms {
                let mut coefficient = term.coefficient;
                let mut factors = 1.0;
                for (index, (value, exponent)) in values.iter().zip(&term.exponents).enumerate() {
                    factors += f64::from(*exponent);
                    if !own.contains(&Some(index)) {
                        for _ in 0..*exponent {
                            coefficient *= value;
                        }
                    }
                }
                if coefficient == 0.0 {
                    continue;
                }
                let power = |place: &Option<usize>| {
                    place.and_then(|place| term.exponents.get(place).copied())
                };
                let exponents = own.each_ref().map(|place| power(place).unwrap_or(0));
                let power = term.power as usize;
                degree = degree.max(power);
                digits = factors.max(digits);
                row.monomials.push(Monomial {
                    coefficient,
                    exponents,
                    power,
                });
            }
            if !row.monomials.is_empty() {
                rows.push(row);
            }
        }
        let longest = rows.iter().map(|row| row.monomials.len()).max();
        digits += longest.unwrap_or(0) as f64;
        let mut reduced = Self {
            family,
            values: values.to_vec(),
            places: own,
            rows,
            degree,
            specification: Specification::default(),
            edge: Specification::default().pieces(),
            digits,
        };
        reduced.merge();
        reduced
    }

    /// The same family with this specification.
    pub(crate) fn with_specification(self, specification: Specification) -> Self {
        Self {
            specification,
            edge: specification.pieces(),
            ..self
        }
    }

    /// Merge rows with the same delay.
    fn merge(&mut self) {
        let mut merged: Vec<Row<D>> = Vec::with_capacity(self.rows.len());
        for row in self.rows.drain(..) {
            let same = |known: &&mut Row<D>| {
                // By the same rule as members of a family merge them.
                known.slopes == row.slopes
                    && (known.delay - row.delay).abs() <= 4.0 * f64::EPSILON * row.size
            };
            match merged.iter_mut().find(same) {
                Some(known) => known.monomials.extend(row.monomials),
                None => merged.push(row),
            }
        }
        let longest = merged.iter().map(|row| row.monomials.len()).max();
        self.digits += longest.unwrap_or(0) as f64;
        self.rows = merged;
    }

    /// Take all delays relative to the smallest one at `centre`.
    pub(crate) fn refer_to_first(&mut self, centre: &[f64; D]) {
        let delay = |row: &Row<D>| {
            let moved = row.slopes.iter().zip(centre).map(|(s, c)| s * c);
            row.delay + moved.sum::<f64>()
        };
        let first = self
            .rows
            .iter()
            .min_by(|a, b| delay(a).total_cmp(&delay(b)))
            .map(|row| (row.delay, row.slopes, row.size, row.slope_sizes));
        let Some((own, slopes, size, slope_sizes)) = first else {
            return;
        };
        for row in &mut self.rows {
            row.delay -= own;
            row.size += size;
            for (slope, own) in row.slopes.iter_mut().zip(slopes) {
                *slope -= own;
            }
            for (total, own) in row.slope_sizes.iter_mut().zip(slope_sizes) {
                *total += own;
            }
        }
    }

    /// The index in the family of a varying parameter.
    pub(crate) fn place(&self, parameter: usize) -> usize {
        self.places.get(parameter).copied().flatten().unwrap_or(0)
    }

    /// The values of all parameters where those that vary are `point`.
    pub(crate) fn values_at(&self, point: &[f64; D]) -> Vec<f64> {
        let mut values = self.values.clone();
        for (place, value) in self.places.iter().zip(point) {
            if let Some(slot) = place.and_then(|place| values.get_mut(place)) {
                *slot = *value;
            }
        }
        values
    }

    /// Refuse a family of which every member has a root at 0, because no box of it could be proved.
    pub(crate) fn refuse_root_at_zero(&self) -> Result<(), Error> {
        let mut sums: Vec<([u32; D], f64, f64)> = Vec::new();
        let constants = self.rows.iter().flat_map(|row| &row.monomials);
        for monomial in constants.filter(|monomial| monomial.power == 0) {
            let c = monomial.coefficient;
            let known = |sum: &&mut ([u32; D], f64, f64)| sum.0 == monomial.exponents;
            match sums.iter_mut().find(known) {
                Some(sum) => {
                    sum.1 += c;
                    sum.2 += c.abs();
                }
                None => sums.push((monomial.exponents, c, c.abs())),
            }
        }
        let rounding = f64::EPSILON * self.digits;
        refuse_if!(
            sums.iter()
                .all(|(_, sum, size)| sum.abs() <= rounding * size),
            "s = 0 is a root for all values of the parameters, so the equation is never stable: \
             divide the equation by s to examine the other roots"
        );
        Ok(())
    }
}

impl<const D: usize> Row<D> {
    fn with_delay(delay: &Affine, values: &[f64], own: [Option<usize>; D]) -> Self {
        let (mut constant, mut size) = (delay.constant, delay.constant.abs());
        for (index, (slope, value)) in delay.slopes.iter().zip(values).enumerate() {
            if *slope != 0.0 && !own.contains(&Some(index)) {
                constant += slope * value;
                size += (slope * value).abs();
            }
        }
        let slope = |place: &Option<usize>| {
            place
                .and_then(|place| delay.slopes.get(place).copied())
                .unwrap_or(0.0)
        };
        let slopes = own.each_ref().map(slope);
        Self {
            delay: constant,
            slopes,
            size,
            slope_sizes: slopes.map(f64::abs),
            monomials: Vec::new(),
        }
    }
}
