//! Memory kept for the moment at which there is none.
//!
//! Rust ends the process where an allocation fails whose failure nobody can return. The allocator
//! of this module therefore keeps [`HEADROOM`] in reserve. Where the system has no memory for a
//! smaller request, it frees the reserve, tries again and reports the shortage, so that running
//! tasks end with an error at their next check. The next call takes the reserve again, and is
//! refused where it cannot. Requests for the headroom or more fail as they did: they ask how much
//! there is, or the caller handles their failure.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::thread::sleep;
use std::time::Duration;

use deadtime::Error;
use deadtime::memory::{HEADROOM, end_shortage, out_of_memory, report_shortage};

#[global_allocator]
static ALLOCATOR: Reserve = Reserve {
    kept: AtomicPtr::new(null_mut()),
    freeing: AtomicUsize::new(0),
};

/// How often, and for how long, a thread waits for another one that frees the reserve: a second at most, because a
/// process that was forked meanwhile has no such thread.
const TURNS: usize = 10_000;
const TURN: Duration = Duration::from_micros(100);

/// The memory in reserve.
const KEPT: Layout = match Layout::from_size_align(HEADROOM, 16) {
    Ok(layout) => layout,
    Err(_) => Layout::new::<u128>(),
};

/// The allocator of the system, with memory in reserve.
struct Reserve {
    /// Null where the reserve is in use.
    kept: AtomicPtr<u8>,
    /// Threads that are freeing it.
    freeing: AtomicUsize,
}

/// Have memory in reserve before work begins.
///
/// # Errors
/// [`Error::Memory`] where there is none.
pub(crate) fn ready() -> Result<(), Error> {
    if ALLOCATOR.kept.load(Ordering::Relaxed).is_null() {
        return ALLOCATOR.fill();
    }
    Ok(())
}

#[allow(unsafe_code)]
impl Reserve {
    /// Take memory into reserve.
    #[cold]
    fn fill(&self) -> Result<(), Error> {
        // SAFETY: the layout has a size.
        let memory = unsafe { System.alloc(KEPT) };
        if memory.is_null() {
            return Err(out_of_memory("the call", KEPT.size()));
        }
        let before = self.kept.swap(memory, Ordering::AcqRel);
        if !before.is_null() {
            // SAFETY: it is from `fill` on another thread, and nobody else has it.
            unsafe { System.dealloc(before, KEPT) };
        }
        end_shortage();
        Ok(())
    }

    /// Free the reserve for a request of so many bytes; false for one that it does not serve.
    #[cold]
    fn give(&self, bytes: usize) -> bool {
        if bytes >= KEPT.size() {
            return false;
        }
        report_shortage();
        self.freeing.fetch_add(1, Ordering::AcqRel);
        let memory = self.kept.swap(null_mut(), Ordering::AcqRel);
        if !memory.is_null() {
            // SAFETY: it is from `fill`, and nobody else has it.
            unsafe { System.dealloc(memory, KEPT) };
        }
        self.freeing.fetch_sub(1, Ordering::AcqRel);
        // Another thread may have it, and not have freed it yet.
        for _ in 0..TURNS {
            if self.freeing.load(Ordering::Acquire) == 0 {
                break;
            }
            sleep(TURN);
        }
        true
    }
}

// SAFETY: all memory is that of the system's allocator, with the layouts that the caller gave.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Reserve {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let made = unsafe { System.alloc(layout) };
        if made.is_null() && self.give(layout.size()) {
            return unsafe { System.alloc(layout) };
        }
        made
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        let made = unsafe { System.alloc_zeroed(layout) };
        if made.is_null() && self.give(layout.size()) {
            return unsafe { System.alloc_zeroed(layout) };
        }
        made
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let made = unsafe { System.realloc(memory, layout, size) };
        if made.is_null() && self.give(size) {
            return unsafe { System.realloc(memory, layout, size) };
        }
        made
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        unsafe { System.dealloc(memory, layout) };
    }
}
