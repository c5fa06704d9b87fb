//! NumPy's inner loop: blocks of elements on this thread, or pieces of them on many.
//!
//! Long loops go to the thread pool, judged by the time that their first elements take. Ctrl-C is
//! heard while a loop runs, and between the many short ones of a broadcast or a cast in pieces.
#![allow(unsafe_code)]

use std::cell::Cell;
use std::ffi::{c_char, c_int};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use numpy::npyffi::{NpyAuxData, npy_intp};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use rayon::prelude::*;

use super::flags;
use super::operands::{Operands, Type};
use crate::runtime;

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

/// One loop of a ufunc: a kernel with the types of its operands.
pub(crate) trait Loop {
    /// Inputs, then outputs.
    const TYPES: &'static [Type];
    const INPUTS: usize;

    /// Compute the elements of `range` in blocks of at most `N`.
    fn compute<const N: usize>(operands: &Operands, range: Range<usize>);
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
        Operands::new(L::TYPES, L::INPUTS, data, strides, length)
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
    let length = operands.length();
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
            let threads = runtime::thread_count(LIMIT.get())?;
            if threads > 1 {
                in_pool::<L>(operands, done, threads)?;
                // A loop that is shorter than the pool's interval of polling is not polled there.
                return listen(length);
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
    let length = operands.length();
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
        runtime::thread_count(Some(threads))?;
    }
    Ok(LIMIT.replace(threads))
}
