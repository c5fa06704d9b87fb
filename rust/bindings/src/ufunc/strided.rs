//! NumPy's inner loop: elements gathered into blocks, a kernel run on each, results scattered.
//!
//! Operands come as addresses with any strides and may be the same memory (`out=z`), which Rust's
//! references must never be; so elements are copied in and out, a few hundred at a time, small
//! beside the work of a kernel. Long loops go to the thread pool in pieces. Ctrl-C is heard while
//! a loop runs, and between the many short ones of a broadcast or a cast in pieces.
#![allow(unsafe_code)]

use std::cell::Cell;
use std::ffi::{c_char, c_int};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use num_complex::{Complex32, Complex64};
use numpy::npyffi::{NpyAuxData, npy_intp};
use numpy::{PyArrayDescr, dtype};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use rayon::prelude::*;

use super::flags;
use crate::runtime;

/// Most operands, inputs and outputs together, that a ufunc of this package has.
pub(super) const MAX_OPERANDS: usize = 6;

/// Elements of a block: the blocks of all operands stay in the first-level cache.
const BLOCK: usize = 512;

/// Loops up to this length, scalars above all, use blocks of this size: larger ones cost more to
/// clear than a few elements to compute.
const SHORT: usize = 8;

/// Elements that one thread takes at a time, and between two looks at the task: whole blocks, up
/// to a millisecond.
const PIECE: usize = 8 * BLOCK;

/// Elements after which a loop looks how long they took, and decides on the thread pool.
const SAMPLE: usize = 2 * BLOCK;

/// Work left from which on the thread pool pays; its start takes some 20 us to 60 us.
const WORTHWHILE: Duration = Duration::from_micros(200);

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

/// One loop of a ufunc: a kernel with the types of its operands.
pub(crate) trait Loop {
    /// Inputs, then outputs.
    const TYPES: &'static [Type];
    const INPUTS: usize;

    /// Compute the elements of `range` in blocks of at most `N`.
    fn compute<const N: usize>(operands: &Operands, range: Range<usize>);
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
    /// `data` and `strides` hold an entry for each of `L`'s operands, which describes `length`
    /// elements of the operand's type, the outputs' writable; inputs and outputs may only be the
    /// same memory where element i is the same in both.
    unsafe fn new<L: Loop>(
        data: *const *mut c_char,
        strides: *const npy_intp,
        length: usize,
    ) -> Self {
        let mut address = [std::ptr::null_mut(); MAX_OPERANDS];
        let mut stride = [0; MAX_OPERANDS];
        for i in 0..L::TYPES.len() {
            // SAFETY: both hold an entry for each operand.
            unsafe {
                address[i] = data.add(i).read().cast();
                stride[i] = strides.add(i).read();
            }
        }
        Self {
            types: L::TYPES,
            inputs: L::INPUTS,
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

    /// The stride of `operand`, which is of type `M` and has `count` elements from `start` on.
    #[inline(always)]
    fn checked<M: Memory>(&self, operand: usize, start: usize, count: usize) -> isize {
        assert!(self.types[operand] == M::TYPE && start + count <= self.length);
        self.stride[operand]
    }

    /// Whether different elements of an output are different memory, as threads need it.
    fn outputs_apart(&self) -> bool {
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

/// The loop `L` as NumPy calls it, with or without the interpreter's lock.
///
/// # Safety
/// As NumPy promises for a `PyArrayMethod_StridedLoop` registered with the types of `L`.
pub(super) unsafe extern "C" fn strided<L: Loop>(
    _context: *mut std::ffi::c_void,
    data: *const *mut c_char,
    dimensions: *const npy_intp,
    strides: *const npy_intp,
    _auxiliary: *mut NpyAuxData,
) -> c_int {
    // SAFETY: NumPy gives one dimension and an entry per operand; it makes copies where operands
    // overlap in any way but element by element.
    let operands = unsafe {
        let length = usize::try_from(dimensions.read()).unwrap_or(0);
        Operands::new::<L>(data, strides, length)
    };
    let raised = flags::read();
    let outcome = catch_unwind(AssertUnwindSafe(|| compute::<L>(&operands)))
        .unwrap_or_else(|panic| Err(runtime::internal(panic.as_ref())));
    flags::restore(raised);
    match outcome {
        Ok(()) => 0,
        Err(error) => {
            runtime::attached(|py| error.restore(py));
            -1
        }
    }
}

fn compute<L: Loop>(operands: &Operands) -> PyResult<()> {
    let length = operands.length;
    if length <= SHORT {
        L::compute::<SHORT>(operands, 0..length);
        return listen(length);
    }
    let mut done = 0;
    if length > PIECE && operands.outputs_apart() {
        let start = Instant::now();
        L::compute::<BLOCK>(operands, 0..SAMPLE);
        done = SAMPLE;
        if start.elapsed() * u32::try_from(length / SAMPLE).unwrap_or(u32::MAX) > WORTHWHILE {
            let threads = runtime::wanted(LIMIT.get())?;
            if threads > 1 {
                return in_pool::<L>(operands, done, threads);
            }
        }
    }
    for start in (done..length).step_by(PIECE) {
        let end = length.min(start + PIECE);
        L::compute::<BLOCK>(operands, start..end);
        listen(end - start)?;
    }
    Ok(())
}

/// The elements from `done` on, by several threads.
fn in_pool<L: Loop>(operands: &Operands, done: usize, threads: usize) -> PyResult<()> {
    let length = operands.length;
    runtime::run_detached(threads, |task| {
        let pieces = (length - done).div_ceil(PIECE);
        (0..pieces).into_par_iter().try_for_each(|piece| {
            task.check()?;
            let start = done + piece * PIECE;
            L::compute::<BLOCK>(operands, start..length.min(start + PIECE));
            Ok(())
        })
    })
}

thread_local! {
    /// Number of threads for the ufuncs that this thread calls, None for the usual.
    static LIMIT: Cell<Option<usize>> = const { Cell::new(None) };
    /// Elements since the last look at the clock, and when this thread last looked for signals.
    static SILENCE: Cell<(usize, Option<Instant>)> = const { Cell::new((0, None)) };
    /// Whether signals are delivered to this thread.
    static HEARS: Cell<Option<bool>> = const { Cell::new(None) };
}

/// Elements between two looks at the clock.
const CLOCK: usize = 4 * PIECE;

/// Look for signals now and then, after `count` more elements on this thread.
#[inline]
fn listen(count: usize) -> PyResult<()> {
    let (silent, last) = SILENCE.get();
    if silent + count < CLOCK {
        SILENCE.set((silent + count, last));
        return Ok(());
    }
    if last.is_some_and(|last| last.elapsed() < runtime::POLL) {
        SILENCE.set((0, last));
        return Ok(());
    }
    SILENCE.set((0, Some(Instant::now())));
    // Waiting for the interpreter's lock slows a loop down: only where a signal may be found.
    if HEARS.get() == Some(false) {
        return Ok(());
    }
    runtime::attached(|py| {
        if HEARS.get().is_none() {
            HEARS.set(Some(is_main_thread(py)?));
        }
        py.check_signals()
    })
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    static THREADING: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let threading = THREADING
        .get_or_try_init(py, || py.import("threading").map(Bound::unbind))?
        .bind(py);
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    main.eq(threading.call_method0("get_ident")?)
}

/// Set the number of threads for ufuncs called on this thread; the number before it comes back.
#[pyfunction]
#[pyo3(signature = (threads))]
pub(crate) fn limit_threads(threads: Option<usize>) -> PyResult<Option<usize>> {
    if let Some(threads) = threads {
        runtime::wanted(Some(threads))?;
    }
    Ok(LIMIT.replace(threads))
}
