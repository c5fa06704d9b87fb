//! The operands of an inner loop: elements of any stride, copied into blocks and back.
//!
//! Operands come as addresses and may be the same memory (`out=z`), which Rust's references must
//! never be; so elements are copied in and out, a few hundred at a time, for less than a
//! nanosecond each.
#![allow(unsafe_code)]

use std::ffi::c_char;

use num_complex::{Complex32, Complex64};
use numpy::npyffi::npy_intp;
use numpy::{PyArrayDescr, dtype};
use pyo3::prelude::*;

/// Most operands, inputs and outputs together, that a ufunc of this package has.
const MAX_OPERANDS: usize = 6;

/// The element types that loops read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Type {
    Single,
    Double,
    SingleComplex,
    DoubleComplex,
    Int64,
}

impl Type {
    pub(super) fn dtype(self, py: Python<'_>) -> Bound<'_, PyArrayDescr> {
        match self {
            Self::Single => dtype::<f32>(py),
            Self::Double => dtype::<f64>(py),
            Self::SingleComplex => dtype::<Complex32>(py),
            Self::DoubleComplex => dtype::<Complex64>(py),
            Self::Int64 => dtype::<i64>(py),
        }
    }
}

/// A type as it lies in an array.
pub(crate) trait Memory: Copy {
    const TYPE: Type;
}

impl Memory for f32 {
    const TYPE: Type = Type::Single;
}
impl Memory for f64 {
    const TYPE: Type = Type::Double;
}
impl Memory for Complex32 {
    const TYPE: Type = Type::SingleComplex;
}
impl Memory for Complex64 {
    const TYPE: Type = Type::DoubleComplex;
}
impl Memory for i64 {
    const TYPE: Type = Type::Int64;
}

/// Conversion between an array's type and the kernel's, rounded once where it narrows.
pub(crate) trait Cast<To>: Copy {
    fn cast(self) -> To;
}

impl<T: Copy> Cast<T> for T {
    #[inline(always)]
    fn cast(self) -> T {
        self
    }
}
impl Cast<f64> for f32 {
    #[inline(always)]
    fn cast(self) -> f64 {
        f64::from(self)
    }
}
impl Cast<f32> for f64 {
    #[inline(always)]
    fn cast(self) -> f32 {
        self as f32
    }
}
impl Cast<Complex64> for f64 {
    #[inline(always)]
    fn cast(self) -> Complex64 {
        Complex64::new(self, 0.0)
    }
}
impl Cast<Complex64> for Complex32 {
    #[inline(always)]
    fn cast(self) -> Complex64 {
        Complex64::new(f64::from(self.re), f64::from(self.im))
    }
}
impl Cast<Complex32> for Complex64 {
    #[inline(always)]
    fn cast(self) -> Complex32 {
        Complex32::new(self.re as f32, self.im as f32)
    }
}

/// The operands of one call of an inner loop.
pub(crate) struct Operands {
    types: &'static [Type],
    inputs: usize,
    length: usize,
    address: [*mut u8; MAX_OPERANDS],
    stride: [isize; MAX_OPERANDS],
}

// SAFETY: the addresses are of memory that NumPy keeps in place during the call, and threads
// write to parts of it that do not overlap (`outputs_apart`, disjoint ranges).
unsafe impl Sync for Operands {}

impl Operands {
    /// # Safety
    /// `data` and `strides` hold an entry for each of `types`, the first `inputs` of them inputs,
    /// which describes `length` elements of that type, the outputs' writable; inputs and outputs
    /// may only be the same memory where element i is the same in both.
    pub(super) unsafe fn new(
        types: &'static [Type],
        inputs: usize,
        data: *const *mut c_char,
        strides: *const npy_intp,
        length: usize,
    ) -> Self {
        let mut address = [std::ptr::null_mut(); MAX_OPERANDS];
        let mut stride = [0; MAX_OPERANDS];
        for i in 0..types.len() {
            // SAFETY: both hold an entry for each operand.
            unsafe {
                address[i] = data.add(i).read().cast();
                stride[i] = strides.add(i).read();
            }
        }
        Self {
            types,
            inputs,
            length,
            address,
            stride,
        }
    }

    /// Copy elements of input `operand`, from `start` on, into `block`.
    ///
    /// A value repeated for all elements is only copied where `first` tells a new `block`.
    #[inline(always)]
    pub(crate) fn gather<M, T>(&self, operand: usize, start: usize, block: &mut [T], first: bool)
    where
        M: Memory + Cast<T>,
        T: Copy,
    {
        let stride = self.checked::<M>(operand, start, block.len());
        let base = self.address[operand];
        if stride == 0 {
            if first {
                // SAFETY: the operand has elements of type M, all of them at its address.
                block.fill(unsafe { base.cast::<M>().read_unaligned() }.cast());
            }
        } else if stride == size_of::<M>() as isize {
            // SAFETY: `checked` has found elements of type M up to start + block.len().
            let from = unsafe { base.cast::<M>().add(start) };
            for (i, place) in block.iter_mut().enumerate() {
                // SAFETY: as above.
                *place = unsafe { from.add(i).read_unaligned() }.cast();
            }
        } else {
            for (place, i) in block.iter_mut().zip(start as isize..) {
                // SAFETY: as above.
                *place = unsafe { base.offset(i * stride).cast::<M>().read_unaligned() }.cast();
            }
        }
    }

    /// Copy `block` to elements of output `operand`, from `start` on.
    #[inline(always)]
    pub(crate) fn scatter<M, T>(&self, operand: usize, start: usize, block: &[T])
    where
        M: Memory,
        T: Cast<M>,
    {
        assert!(operand >= self.inputs);
        let stride = self.checked::<M>(operand, start, block.len());
        let base = self.address[operand];
        if stride == size_of::<M>() as isize {
            // SAFETY: `checked` has found elements of type M up to start + block.len(), and
            // outputs are writable.
            let to = unsafe { base.cast::<M>().add(start) };
            for (i, value) in block.iter().enumerate() {
                // SAFETY: as above.
                unsafe { to.add(i).write_unaligned((*value).cast()) };
            }
        } else {
            for (value, i) in block.iter().zip(start as isize..) {
                // SAFETY: as above.
                unsafe {
                    base.offset(i * stride)
                        .cast::<M>()
                        .write_unaligned((*value).cast());
                }
            }
        }
    }

    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// The stride of `operand`, which is of type `M` and has `count` elements from `start` on.
    #[inline(always)]
    fn checked<M: Memory>(&self, operand: usize, start: usize, count: usize) -> isize {
        assert!(self.types[operand] == M::TYPE && start + count <= self.length);
        self.stride[operand]
    }

    /// Whether different elements of an output are different memory, as threads need it.
    pub(super) fn outputs_apart(&self) -> bool {
        (self.inputs..self.types.len()).all(|i| {
            let size = match self.types[i] {
                Type::Single => size_of::<f32>(),
                Type::Double | Type::SingleComplex | Type::Int64 => size_of::<f64>(),
                Type::DoubleComplex => size_of::<Complex64>(),
            };
            self.stride[i].unsigned_abs() >= size
        })
    }
}
