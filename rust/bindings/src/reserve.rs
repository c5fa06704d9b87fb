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
use std::sync::atomic::{AtomicPtr, Ordering};
use std::thread::sleep;
use std::time::Duration;

use deadtime::Error;
use deadtime::memory::{HEADROOM, end_shortage, out_of_memory, report_shortage};

#[global_allocator]
static ALLOCATOR: Reserve = Reserve {
    kept: AtomicPtr::new(null_mut()),
};

/// How often a request is tried again, and how long after: for a fraction of a second.
const TURNS: usize = 2000;
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

    /// Free the reserve for a request of so many bytes, and try it again; null for one that it does not serve.
    #[cold]
    fn again(&self, bytes: usize, allocate: impl Fn() -> *mut u8) -> *mut u8 {
        if bytes >= KEPT.size() {
            return null_mut();
        }
        report_shortage();
        let memory = self.kept.swap(null_mut(), Ordering::AcqRel);
        if !memory.is_null() {
            // SAFETY: it is from `fill`, and nobody else has it.
            unsafe { System.dealloc(memory, KEPT) };
        }
        // Another thread may be about to free the reserve. Or it asks how much memory there is, which takes all for a
        // moment.
        for _ in 0..TURNS {
            let made = allocate();
            if !made.is_null() {
                return made;
            }
            sleep(TURN);
        }
        null_mut()
    }
}

// SAFETY: all memory is that of the system's allocator, with the layouts that the caller gave.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Reserve {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let made = unsafe { System.alloc(layout) };
        if made.is_null() {
            return self.again(layout.size(), || unsafe { System.alloc(layout) });
        }
        made
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        let made = unsafe { System.alloc_zeroed(layout) };
        if made.is_null() {
            return self.again(layout.size(), || unsafe { System.alloc_zeroed(layout) });
        }
        made
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let made = unsafe { System.realloc(memory, layout, size) };
        if made.is_null() {
            return self.again(size, || unsafe { System.realloc(memory, layout, size) });
        }
        made
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        unsafe { System.dealloc(memory, layout) };
    }
}
