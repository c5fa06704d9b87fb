//! Allocation of memory whose size depends on the request: failures become errors.
//!
//! Rust ends the process when an allocation fails. Every array whose size depends on the request is
//! therefore allocated here, where a failure is [`Error::Memory`] with the size, and only if
//! [`HEADROOM`] remains for small things: queues, series, matrices of one loop. These grow while a
//! kernel runs, so that the waiting thread checks [`is_scarce`] regularly and stops the kernel in
//! time. Where a small request fails before that, an allocator with memory in reserve reports it
//! ([`report_shortage`]), and every task ends at its next check. Nothing is guaranteed where the operating system promises more memory than it has and
//! kills processes later.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::Error;

/// Memory that has to remain free, in bytes: more than kernels allocate for small things between
/// two checks. It is above 32 MiB, so that freeing it does not change how glibc handles other
/// requests.
pub const HEADROOM: usize = 48 << 20;

/// Requests below this size are served from the headroom.
const SMALL: usize = 1 << 20;

/// Has an allocation failed, and been served from the reserve?
static SHORT: AtomicBool = AtomicBool::new(false);

/// Every task is to end at its next check: the reserve is in use.
pub fn report_shortage() {
    SHORT.store(true, Ordering::Relaxed);
}

/// There is a reserve again.
pub fn end_shortage() {
    SHORT.store(false, Ordering::Relaxed);
}

/// Is the reserve in use?
pub(crate) fn is_short() -> bool {
    SHORT.load(Ordering::Relaxed)
}

/// Is less than the headroom available?
pub fn is_scarce() -> bool {
    !there_is(HEADROOM)
}

fn there_is(bytes: usize) -> bool {
    Vec::<u8>::new().try_reserve_exact(bytes).is_ok()
}

/// Return an error if memory for `count` items of type `T` is not available.
pub fn require<T>(what: &'static str, count: usize) -> Result<(), Error> {
    let bytes = count.saturating_mul(size_of::<T>());
    if bytes < SMALL || there_is(bytes.saturating_add(HEADROOM)) {
        return Ok(());
    }
    Err(out_of_memory(what, bytes))
}

/// The error where so many bytes cannot be had.
pub fn out_of_memory(what: &'static str, bytes: usize) -> Error {
    Error::Memory {
        what,
        bytes: bytes as u64,
    }
}

/// An empty vector that holds `count` items without growing.
pub fn reserved<T>(what: &'static str, count: usize) -> Result<Vec<T>, Error> {
    require::<T>(what, count)?;
    let mut made = Vec::new();
    made.try_reserve_exact(count)
        .map_err(|_| out_of_memory(what, count.saturating_mul(size_of::<T>())))?;
    Ok(made)
}

/// `count` times the same value.
pub fn filled<T: Clone>(what: &'static str, value: T, count: usize) -> Result<Vec<T>, Error> {
    let mut made = reserved(what, count)?;
    made.resize(count, value);
    Ok(made)
}

/// A copy of a slice.
pub fn copied<T: Copy>(what: &'static str, values: &[T]) -> Result<Vec<T>, Error> {
    collected(what, values.iter().copied())
}

/// The items of an iterator of known length.
pub fn collected<T>(
    what: &'static str,
    items: impl ExactSizeIterator<Item = T>,
) -> Result<Vec<T>, Error> {
    let mut made = reserved(what, items.len())?;
    made.extend(items);
    Ok(made)
}

/// Append a value to a vector that grows with the length of a run.
pub fn push<T>(what: &'static str, to: &mut Vec<T>, value: T) -> Result<(), Error> {
    if to.len() == to.capacity() {
        grow(what, to, 1)?;
    }
    to.push(value);
    Ok(())
}

/// Append values to a vector that grows with the length of a run.
pub fn append<T: Copy>(what: &'static str, to: &mut Vec<T>, values: &[T]) -> Result<(), Error> {
    if to.capacity() - to.len() < values.len() {
        grow(what, to, values.len())?;
    }
    to.extend_from_slice(values);
    Ok(())
}

/// Append a value to a queue that grows with the length of a run.
pub fn push_back<T>(what: &'static str, to: &mut VecDeque<T>, value: T) -> Result<(), Error> {
    if to.len() == to.capacity() {
        let most = to.len().saturating_add(to.len().max(1));
        require::<T>(what, most)?;
        to.try_reserve(1)
            .map_err(|_| out_of_memory(what, most.saturating_mul(size_of::<T>())))?;
    }
    to.push_back(value);
    Ok(())
}

fn grow<T>(what: &'static str, to: &mut Vec<T>, more: usize) -> Result<(), Error> {
    let most = to.len().saturating_add(more.max(to.len()));
    require::<T>(what, most)?;
    to.try_reserve(more)
        .map_err(|_| out_of_memory(what, most.saturating_mul(size_of::<T>())))
}

/// A size in readable units.
pub(crate) fn readable_size(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    let mut size = bytes as f64 / 1024.0;
    let mut unit = UNITS[0];
    for larger in &UNITS[1..] {
        if size < 1000.0 {
            break;
        }
        size /= 1024.0;
        unit = larger;
    }
    format!("{size:.3} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_an_error_with_its_size() {
        let found = filled("the test", 0.0, 1 << 58);
        assert_eq!(
            found.unwrap_err().to_string(),
            "the test needs 2048.000 PiB of memory, which is not available: compute less \
             at once, or raise the limit of memory"
        );
        assert!(reserved::<f64>("the test", usize::MAX).is_err());
    }

    #[test]
    fn small_and_large_vectors_hold_what_was_asked_for() {
        assert_eq!(filled("the test", 7, 3), Ok(vec![7, 7, 7]));
        assert_eq!(collected("the test", 0..4), Ok(vec![0, 1, 2, 3]));
        let mut grown = Vec::new();
        for i in 0..300_000 {
            push("the test", &mut grown, i).unwrap();
        }
        append("the test", &mut grown, &[1, 2]).unwrap();
        assert_eq!(grown.len(), 300_002);
        assert!(!is_scarce());
    }
}
