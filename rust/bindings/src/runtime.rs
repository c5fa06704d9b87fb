//! The one place where long work releases the interpreter: thread pool, GIL, Ctrl-C, panics.
//!
//! A kernel runs inside one process-local rayon pool while the calling thread, detached from the
//! interpreter, waits and looks for signals. Any number of Python threads may call at once. The
//! pool belongs to the process that built it: threads do not survive a fork, so a child builds
//! its own. The pool is held without a lock, because a lock taken by another thread at the
//! moment of the fork would stay locked in the child.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use arc_swap::ArcSwapOption;
use deadtime::{Error, Task};
use pyo3::exceptions::{PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::arrays::converted;
use crate::errors::to_python;
use crate::reserve;

/// How often the waiting thread checks for signals and reports progress.
pub(crate) const POLL: Duration = Duration::from_millis(20);

/// Environment variables that limit the number of threads, the first one set wins.
const THREAD_VARIABLES: [&str; 2] = ["DEADTIME_NUM_THREADS", "RAYON_NUM_THREADS"];

/// Upper limit on the number of threads: a million of them would hang the machine.
const MAX_THREADS: usize = 1024;

struct Pool {
    process: u32,
    threads: usize,
    pool: ThreadPool,
}

static POOL: LazyLock<ArcSwapOption<Pool>> = LazyLock::new(ArcSwapOption::empty);

/// Run `work` in the pool with the interpreter released; Ctrl-C stops it at its next check.
///
/// `progress`, if given, is called at intervals of `POLL` with the number of finished items.
pub(crate) fn run<T, F>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Py<PyAny>>,
    work: F,
) -> PyResult<T>
where
    T: Send,
    F: FnOnce(&Task) -> Result<T, Error> + Send,
{
    let pool = pool(threads)?;
    let task = Task::new();
    let (result, interrupted) = py.detach(|| wait(&pool, &task, progress, work));
    into_py_result(result, interrupted)
}

/// [`run`] for a caller that may or may not be detached from the interpreter, by NumPy.
pub(crate) fn run_detached<T, F>(threads: usize, work: F) -> PyResult<T>
where
    T: Send,
    F: FnOnce(&Task) -> Result<T, Error> + Send,
{
    let pool = pool(Some(threads))?;
    let (result, interrupted) = wait(&pool, &Task::new(), None, work);
    into_py_result(result, interrupted)
}

type Finished<T> = std::thread::Result<Result<T, Error>>;

/// Run `work` in the pool, checking for signals and reporting progress until it is done.
///
/// Returns the result, if there is one, and the exception that stopped it, if one did.
fn wait<T, F>(
    pool: &Arc<Pool>,
    task: &Task,
    progress: Option<&Py<PyAny>>,
    work: F,
) -> (Option<Finished<T>>, Option<PyErr>)
where
    T: Send,
    F: FnOnce(&Task) -> Result<T, Error> + Send,
{
    let mut result = None;
    let place = &mut result;
    let job = move || *place = Some(catch_unwind(AssertUnwindSafe(|| work(task))));
    let interrupted = wait_for(pool, task, progress, Box::new(job));
    (result, interrupted)
}

/// Run a job in the pool; the exception that stopped it, if one did.
fn wait_for<'a>(
    pool: &Arc<Pool>,
    task: &Task,
    progress: Option<&Py<PyAny>>,
    work: Box<dyn FnOnce() + Send + 'a>,
) -> Option<PyErr> {
    let (sender, receiver) = channel();
    let job: Box<dyn FnOnce() + Send + 'a> = Box::new(move || {
        work();
        // The receiver outlives this job: the caller waits below until it is told.
        let _ = sender.send(());
    });
    // SAFETY: only the lifetime of the borrowed values changes. `Waiting` keeps the caller here
    // until the job has said that it is done, after which the job uses no borrowed value. A scope of
    // rayon would do the same, but it cannot be left in a forked child, in which the job never
    // ends: its thread does not exist there, so it uses no borrowed value there either.
    #[allow(unsafe_code)]
    let job: Box<dyn FnOnce() + Send + 'static> = unsafe { std::mem::transmute(job) };
    pool.pool.spawn(job);
    let mut waiting = Waiting {
        receiver,
        process: pool.process,
        is_finished: false,
    };
    let mut interrupted = None;
    loop {
        match waiting.poll() {
            Ok(()) | Err(RecvTimeoutError::Disconnected) => return interrupted,
            Err(RecvTimeoutError::Timeout) if interrupted.is_none() => {
                task.look_at_memory();
                if let Err(error) = attached(|py| poll_python(py, task, progress)) {
                    task.stop();
                    interrupted = Some(error);
                }
                if waiting.is_in_forked_child() {
                    // The pool has no threads in this process that could be joined: forget it.
                    std::mem::forget(Arc::clone(pool));
                    return interrupted.or_else(|| Some(fork_error()));
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Waits for a job to end when it is dropped, except in a forked child.
struct Waiting {
    receiver: Receiver<()>,
    process: u32,
    is_finished: bool,
}

impl Waiting {
    /// Whether the job is done, within `POLL`.
    fn poll(&mut self) -> Result<(), RecvTimeoutError> {
        let received = self.receiver.recv_timeout(POLL);
        self.is_finished = !matches!(received, Err(RecvTimeoutError::Timeout));
        received
    }

    fn is_in_forked_child(&self) -> bool {
        std::process::id() != self.process
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        if !self.is_finished && !self.is_in_forked_child() {
            // Either it is done, or there is an error because the job no longer exists.
            let _ = self.receiver.recv();
        }
    }
}

fn fork_error() -> PyErr {
    PyRuntimeError::new_err(
        "this process was forked within the progress function. The computation continues only in \
         the parent, so end the child there, or start it in another way",
    )
}

/// The result of the work, or the exception that interrupted it or that its failure raises.
fn into_py_result<T>(result: Option<Finished<T>>, interrupted: Option<PyErr>) -> PyResult<T> {
    match (result, interrupted) {
        (_, Some(error)) => Err(error),
        (Some(Ok(result)), None) => result.map_err(|error| attached(|py| to_python(py, error))),
        (Some(Err(panic)), None) => Err(internal(panic.as_ref())),
        (None, None) => Err(internal(&"the worker vanished")),
    }
}

/// Call `work` attached to the interpreter, whether or not this thread is attached.
///
/// pyo3 keeps its own count of attached threads, and NumPy detaches without changing it.
#[allow(unsafe_code)]
pub(crate) fn attached<T>(work: impl FnOnce(Python<'_>) -> T) -> T {
    struct Release(pyo3::ffi::PyGILState_STATE);
    impl Drop for Release {
        fn drop(&mut self) {
            // SAFETY: the state is from the call below on the same thread, and released once.
            unsafe { pyo3::ffi::PyGILState_Release(self.0) };
        }
    }
    // SAFETY: it may be called attached or not; the interpreter is running, since Python called.
    let _release = Release(unsafe { pyo3::ffi::PyGILState_Ensure() });
    Python::attach(work)
}

/// Run single-threaded `work` on the calling thread with the interpreter released; Ctrl-C stops it
/// at its next check for signals. A call costs a tenth of one through the pool.
pub(crate) fn run_here<T, F>(py: Python<'_>, work: F) -> PyResult<T>
where
    T: Send,
    F: FnOnce(&Task) -> Result<T, Error> + Send,
{
    converted(reserve::ready())?;
    let task = Task::asking(POLL, goes_on);
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(|| work(&task))));
    into_py_result(Some(result), PyErr::take(py))
}

/// [`run_here`] for work that calls Python often: the interpreter is not released.
pub(crate) fn run_attached<T, F>(py: Python<'_>, work: F) -> PyResult<T>
where
    F: FnOnce(&Task) -> Result<T, Error>,
{
    converted(reserve::ready())?;
    let task = Task::asking(POLL, goes_on);
    let result = catch_unwind(AssertUnwindSafe(|| work(&task)));
    into_py_result(Some(result), PyErr::take(py))
}

/// Has no signal raised an exception? One that was raised stays with this thread until the work ends.
fn goes_on() -> bool {
    attached(|py| match py.check_signals() {
        Ok(()) => true,
        Err(error) => {
            error.restore(py);
            false
        }
    })
}

/// Check for signals and report progress.
fn poll_python(py: Python<'_>, task: &Task, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    if let Some(progress) = progress {
        progress.call1(py, (task.done(),))?;
    }
    Ok(())
}

pub(crate) fn internal(panic: &(dyn Any + Send)) -> PyErr {
    let reason = panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "unknown reason".to_owned());
    PyRuntimeError::new_err(format!(
        "a defect in deadtime has stopped this call ({reason}). Please report it, with the \
         arguments of the call"
    ))
}

/// The pool of this process with the requested number of threads, built where there is none.
fn pool(threads: Option<usize>) -> PyResult<Arc<Pool>> {
    converted(reserve::ready())?;
    let threads = thread_count(threads)?;
    let process = std::process::id();
    let current = POOL.load_full();
    if let Some(pool) = &current
        && pool.process == process
        && pool.threads == threads
    {
        return Ok(Arc::clone(pool));
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("deadtime-{index}"))
        .build()
        .map_err(|error| {
            PyMemoryError::new_err(format!(
                "{threads} threads cannot be started ({error}): give fewer threads by threads= or \
                 DEADTIME_NUM_THREADS, or raise the limits of memory and threads"
            ))
        })?;
    let built = Arc::new(Pool {
        process,
        threads,
        pool,
    });
    let replaced = POOL.swap(Some(Arc::clone(&built)));
    // A pool inherited through a fork has no threads left to join: forget it, never drop it.
    for inherited in [current, replaced].into_iter().flatten() {
        if inherited.process != process {
            std::mem::forget(inherited);
        }
    }
    Ok(built)
}

/// Number of threads: argument, then environment, then the machine.
pub(crate) fn thread_count(threads: Option<usize>) -> PyResult<usize> {
    if let Some(threads) = threads {
        return check_thread_count("threads", threads);
    }
    for variable in THREAD_VARIABLES {
        if let Ok(text) = std::env::var(variable) {
            if text.trim().is_empty() {
                continue;
            }
            let threads = text.trim().parse().map_err(|_| {
                PyValueError::new_err(format!(
                    "{variable}={text:?} is not a number of threads: give a whole number of at \
                     least 1"
                ))
            })?;
            // Rayon reads 0 as "the machine decides".
            if threads > 0 {
                return check_thread_count(variable, threads);
            }
        }
    }
    Ok(std::thread::available_parallelism().map_or(1, usize::from))
}

fn check_thread_count(name: &str, threads: usize) -> PyResult<usize> {
    if (1..=MAX_THREADS).contains(&threads) {
        return Ok(threads);
    }
    Err(PyValueError::new_err(format!(
        "{name}={threads}: give a whole number from 1 to {MAX_THREADS}, or None for all cores"
    )))
}
