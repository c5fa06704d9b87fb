//! The one place where Python is left: thread pool, GIL, Ctrl-C, panics.
//!
//! A kernel runs inside one process-local rayon pool while the calling thread, detached from the
//! interpreter, waits and looks for signals. Any number of Python threads may call at once. The
//! pool belongs to the process that built it: threads do not survive a fork, so a child builds
//! its own. The pool is held without a lock, because a lock taken by another thread at the
//! moment of the fork would stay locked in the child.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use arc_swap::ArcSwapOption;
use deadtime::{Error, Task};
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::to_python;

/// How often the waiting thread looks for signals and reports progress.
pub(crate) const POLL: Duration = Duration::from_millis(20);

/// Environment variables that limit the number of threads, the first one set wins.
const THREAD_VARIABLES: [&str; 2] = ["DEADTIME_NUM_THREADS", "RAYON_NUM_THREADS"];

/// More threads than any machine this runs on has use for; asking for a million of them hangs it.
const MAX_THREADS: usize = 1024;

struct Pool {
    process: u32,
    threads: usize,
    pool: ThreadPool,
}

static POOL: LazyLock<ArcSwapOption<Pool>> = LazyLock::new(ArcSwapOption::empty);

/// Run `work` in the pool with the interpreter released; Ctrl-C stops it at its next check.
///
/// `progress`, if given, is called now and then with the number of finished items.
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
    let (result, refused) = py.detach(|| wait(&pool, &task, progress, work));
    settle(result, refused)
}

/// [`run`] for a caller that NumPy may have detached from the interpreter, or not.
pub(crate) fn run_detached<T, F>(threads: usize, work: F) -> PyResult<T>
where
    T: Send,
    F: FnOnce(&Task) -> Result<T, Error> + Send,
{
    let pool = pool(Some(threads))?;
    let (result, refused) = wait(&pool, &Task::new(), None, work);
    settle(result, refused)
}

type Finished<T> = std::thread::Result<Result<T, Error>>;

/// Have `work` done in the pool, looking for signals and reporting progress until it is.
///
/// What comes back is the result, if there is one, and the exception for which it was stopped.
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
    let (tell, hear) = channel();
    let job: Box<dyn FnOnce() + Send + '_> = Box::new(move || {
        let result = catch_unwind(AssertUnwindSafe(|| work(task)));
        // The receiver outlives this job: the caller waits below until it has the result.
        let _ = tell.send(result);
    });
    // SAFETY: the type of a job, but for the lifetime of what it borrows: `Waiting` keeps the
    // caller here until the job has sent its last word, after which it touches nothing borrowed.
    // A scope of rayon would do the same, but it cannot be left in a forked child, in which the
    // job never ends: its thread is not there, so nothing borrowed is touched there either.
    #[allow(unsafe_code)]
    let job: Box<dyn FnOnce() + Send + 'static> = unsafe { std::mem::transmute(job) };
    pool.pool.spawn(job);
    let mut waiting = Waiting {
        hear,
        process: pool.process,
        is_over: false,
    };
    let mut refused = None;
    loop {
        match waiting.listen() {
            Ok(result) => return (Some(result), refused),
            Err(RecvTimeoutError::Disconnected) => return (None, refused),
            Err(RecvTimeoutError::Timeout) if refused.is_none() => {
                task.look_at_memory();
                if let Err(error) = attached(|py| look_up(py, task, progress)) {
                    task.stop();
                    refused = Some(error);
                }
                if waiting.is_elsewhere() {
                    // It has no threads to join here: it is never dropped.
                    std::mem::forget(Arc::clone(pool));
                    return (None, refused.or_else(|| Some(forked())));
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// A job that is not left alone, unless a fork has taken the caller to another process.
struct Waiting<T> {
    hear: Receiver<Finished<T>>,
    process: u32,
    is_over: bool,
}

impl<T> Waiting<T> {
    fn listen(&mut self) -> Result<Finished<T>, RecvTimeoutError> {
        let heard = self.hear.recv_timeout(POLL);
        self.is_over = !matches!(heard, Err(RecvTimeoutError::Timeout));
        heard
    }

    fn is_elsewhere(&self) -> bool {
        std::process::id() != self.process
    }
}

impl<T> Drop for Waiting<T> {
    fn drop(&mut self) {
        if !self.is_over && !self.is_elsewhere() {
            // The word, or that the job is gone.
            let _ = self.hear.recv();
        }
    }
}

fn forked() -> PyErr {
    PyRuntimeError::new_err(
        "this process was forked from within the progress function: the computation goes on in \
         the parent only; end the child there, or start it in another way",
    )
}

fn settle<T>(result: Option<Finished<T>>, refused: Option<PyErr>) -> PyResult<T> {
    match (result, refused) {
        (_, Some(error)) => Err(error),
        (Some(Ok(result)), None) => result.map_err(|error| attached(|py| to_python(py, error))),
        (Some(Err(panic)), None) => Err(internal(panic.as_ref())),
        (None, None) => Err(internal(&"the worker vanished")),
    }
}

/// Call `work` attached to the interpreter, whatever this thread's state is.
///
/// pyo3 keeps books of its own on who is attached, and NumPy detaches without an entry in them.
#[allow(unsafe_code)]
pub(crate) fn attached<T>(work: impl FnOnce(Python<'_>) -> T) -> T {
    struct Release(pyo3::ffi::PyGILState_STATE);
    impl Drop for Release {
        fn drop(&mut self) {
            // SAFETY: made by the call below, on the same thread, released once.
            unsafe { pyo3::ffi::PyGILState_Release(self.0) };
        }
    }
    // SAFETY: may be called attached or not; the interpreter runs, as its caller is Python.
    let _release = Release(unsafe { pyo3::ffi::PyGILState_Ensure() });
    Python::attach(work)
}

/// Run `work` that knows no threads on the calling one, interpreter released; Ctrl-C stops it at
/// one of its next checks. A call costs a tenth of one through the pool.
pub(crate) fn run_here<T, F>(py: Python<'_>, work: F) -> PyResult<T>
where
    T: Send,
    F: FnOnce(&Task) -> Result<T, Error> + Send,
{
    let (task, refused) = listening();
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(|| work(&task))));
    settle(Some(result), refusal(&refused))
}

/// [`run_here`] for work that calls Python all the time: the interpreter is kept.
pub(crate) fn run_attached<T, F>(_py: Python<'_>, work: F) -> PyResult<T>
where
    F: FnOnce(&Task) -> Result<T, Error>,
{
    let (task, refused) = listening();
    let result = catch_unwind(AssertUnwindSafe(|| work(&task)));
    settle(Some(result), refusal(&refused))
}

type Refusal = Arc<Mutex<Option<PyErr>>>;

/// A task that looks for signals by itself, and where it puts the exception they raise.
fn listening() -> (Task, Refusal) {
    let refused = Refusal::default();
    let keep = Arc::clone(&refused);
    let task = Task::asking(POLL, move || match attached(|py| py.check_signals()) {
        Ok(()) => true,
        Err(error) => {
            if let Ok(mut place) = keep.lock() {
                *place = Some(error);
            }
            false
        }
    });
    (task, refused)
}

fn refusal(refused: &Refusal) -> Option<PyErr> {
    refused.lock().ok().and_then(|mut place| place.take())
}

fn look_up(py: Python<'_>, task: &Task, progress: Option<&Py<PyAny>>) -> PyResult<()> {
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
        "deadtime failed internally ({reason}); this is a defect, please report it with the \
         arguments of the call"
    ))
}

/// The pool of this process with the wanted number of threads, built where there is none.
fn pool(threads: Option<usize>) -> PyResult<Arc<Pool>> {
    let threads = wanted(threads)?;
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
        .map_err(|error| PyOSError::new_err(format!("no threads to be had: {error}")))?;
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
pub(crate) fn wanted(threads: Option<usize>) -> PyResult<usize> {
    if let Some(threads) = threads {
        return sensible("threads", threads);
    }
    for variable in THREAD_VARIABLES {
        if let Ok(text) = std::env::var(variable) {
            if text.trim().is_empty() {
                continue;
            }
            let threads = text.trim().parse().map_err(|_| {
                PyValueError::new_err(format!(
                    "{variable}={text:?} is not a number of threads: set it to a whole number \
                     of at least 1"
                ))
            })?;
            // Rayon reads 0 as "the machine decides".
            if threads > 0 {
                return sensible(variable, threads);
            }
        }
    }
    Ok(std::thread::available_parallelism().map_or(1, usize::from))
}

fn sensible(name: &str, threads: usize) -> PyResult<usize> {
    if (1..=MAX_THREADS).contains(&threads) {
        return Ok(threads);
    }
    Err(PyValueError::new_err(format!(
        "{name}={threads}: give a whole number from 1 to {MAX_THREADS}, or None for all cores"
    )))
}
