//! The kernels for a page in a browser: one loop in, its map, roots, margins and responses out.
//!
//! A page writes a request into the memory that [`reserve`] returns, calls one of the functions, and
//! reads the answer at [`answer`], or the reason of a failure at [`message`]. All numbers are 64-bit
//! floats. The request begins with the loop, as `request` reads it; the functions say what follows
//! and what they answer. There are no threads, clocks or imports.

#![expect(unsafe_code, reason = "names of exports are not mangled")]

mod design;
mod estimate;
mod exchange;
mod maps;
mod margins;
mod request;
mod responses;
mod roots;

use exchange::answered;

/// Reserve memory for `count` numbers of a request, and return where they go.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(count: usize) -> *mut f64 {
    exchange::reserve(count)
}

/// Where the answer is.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const f64 {
    exchange::answer().0
}

/// How many numbers the answer has.
#[unsafe(no_mangle)]
pub extern "C" fn answer_count() -> usize {
    exchange::answer().1
}

/// Where the reason of the last failure is, in UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn message() -> *const u8 {
    exchange::message().0
}

/// How many bytes the reason of the last failure has.
#[unsafe(no_mangle)]
pub extern "C" fn message_count() -> usize {
    exchange::message().1
}

/// Functions that read the request and write the answer; false where there is none.
macro_rules! answering {
    ($($(#[$about:meta])* $name:ident = $work:path;)+) => {$(
        $(#[$about])*
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> bool {
            answered($work)
        }
    )+};
}

answering! {
    /// Counts of unstable roots of a map: see [`maps::cells`].
    map = maps::cells;
    /// The curves on which roots lie on the edge of stability: see [`maps::boundaries`].
    boundaries = maps::boundaries;
    /// The rightmost roots: see [`roots::rightmost`].
    rightmost = roots::rightmost;
    /// Gain, phase and delay margins: see [`margins::margins`].
    margins = margins::margins;
    /// The response to steps of the reference and of the load: see [`responses::step`].
    step = responses::step;
    /// Gains for loads: see [`design::design`].
    design = design::design;
    /// Delay, gain and lag of a recording: see [`estimate::estimate`].
    estimate = estimate::estimate;
}
