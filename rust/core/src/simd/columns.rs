//! Kernels applied to arrays: a block of elements as columns of doubles.
//!
//! A block is padded to whole vectors with a harmless element, so that the end of an array is
//! processed like its middle.

use pulp::WithSimd;

use pulp::Simd;

use super::dispatch::Instructions;
use super::real::Real;

/// Elements in two vectors of the widest instruction set: the shortest block.
pub(crate) const SHORT: usize = 16;

/// A function of `IN` doubles with `OUT` doubles as its value.
pub(crate) trait Kernel<const IN: usize, const OUT: usize>: Sync {
    /// Is it compiled for AVX-512 as well? See [`Instructions`].
    const IS_WIDE: bool = true;

    fn lanes<S: Simd>(&self, arguments: [Real<S>; IN]) -> [Real<S>; OUT];
}

/// Columns of one block.
pub(crate) type Columns<const N: usize, const W: usize> = [[f64; W]; N];

/// Columns of any length, so that a kernel is compiled once for all of them.
struct Sweep<'a, K, const IN: usize, const OUT: usize> {
    kernel: &'a K,
    arguments: [&'a [f64]; IN],
    values: [&'a mut [f64]; OUT],
    length: usize,
}

impl<K: Kernel<IN, OUT>, const IN: usize, const OUT: usize> WithSimd for Sweep<'_, K, IN, OUT> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let mut lanes = [Real::splat(simd, 0.0); IN];
        for pair in 0..self.length.div_ceil(2 * S::F64_LANES) {
            for (lane, column) in lanes.iter_mut().zip(&self.arguments) {
                if let Some([a, b]) = S::as_simd_f64s(column).0.as_chunks().0.get(pair) {
                    *lane = Real::new(simd, [*a, *b]);
                }
            }
            let results = self.kernel.lanes(lanes);
            for (result, column) in results.iter().zip(self.values.iter_mut()) {
                let places = S::as_mut_simd_f64s(column).0.as_chunks_mut().0;
                if let Some(place) = places.get_mut(pair) {
                    *place = result.lanes();
                }
            }
        }
    }
}

struct Along<'a, K> {
    kernel: &'a K,
    x: &'a [f64],
    values: &'a mut [f64],
}

impl<K: Kernel<1, 1>> WithSimd for Along<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = 2 * S::F64_LANES;
        let whole = self.x.len().min(self.values.len()) / lanes * lanes;
        let (x, x_end) = self.x.split_at(whole);
        let (values, end) = self.values.split_at_mut(whole);
        let pairs = S::as_simd_f64s(x).0.as_chunks().0.iter();
        for (lanes, place) in pairs.zip(S::as_mut_simd_f64s(values).0.as_chunks_mut().0) {
            let [value] = self.kernel.lanes([Real::new(simd, *lanes)]);
            *place = value.lanes();
        }
        let Some(&some) = x_end.first() else { return };
        // The last vectors are filled with an element like the others.
        let mut last = Real::splat(simd, some);
        for (lane, x) in last.numbers_mut().iter_mut().zip(x_end) {
            *lane = *x;
        }
        let [value] = self.kernel.lanes([last]);
        for ((place, value), _) in end.iter_mut().zip(value.numbers()).zip(x_end) {
            *place = *value;
        }
    }
}

/// `values[i] = kernel(x[i])` as far as both reach.
pub(crate) fn sweep_along<K: Kernel<1, 1>>(kernel: &K, x: &[f64], values: &mut [f64]) {
    Instructions::chosen().run_widest(Along { kernel, x, values });
}

/// Fill `values` for the first `length` elements and for those that complete their last vector.
pub(crate) fn sweep<K, const IN: usize, const OUT: usize, const W: usize>(
    kernel: &K,
    arguments: &Columns<IN, W>,
    values: &mut Columns<OUT, W>,
    length: usize,
) where
    K: Kernel<IN, OUT>,
{
    sweep_on(Instructions::chosen(), kernel, arguments, values, length);
}

/// [`sweep`] with these instructions.
pub(crate) fn sweep_on<K, const IN: usize, const OUT: usize, const W: usize>(
    instructions: Instructions,
    kernel: &K,
    arguments: &Columns<IN, W>,
    values: &mut Columns<OUT, W>,
    length: usize,
) where
    K: Kernel<IN, OUT>,
{
    let sweep = Sweep {
        kernel,
        arguments: arguments.each_ref().map(<[f64; W]>::as_slice),
        values: values.each_mut().map(<[f64; W]>::as_mut_slice),
        length,
    };
    if K::IS_WIDE {
        instructions.run_widest(sweep);
    } else {
        instructions.run(sweep);
    }
}
