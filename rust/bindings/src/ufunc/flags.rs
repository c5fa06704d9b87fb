//! Floating-point exception flags, kept as they were around a loop.
//!
//! A kernel overflows, underflows and divides by zero on its way to a right answer. NumPy is told
//! not to look at the flags after our loops, but it looks after casts around them, and would
//! warn of what a kernel did. Where the registers have other names, nothing is kept.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod register {
    pub(in super::super) fn read() -> u32 {
        let mut status = 0_u32;
        // SAFETY: stores the register to a variable of its size.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut status, options(nostack, preserves_flags));
        }
        status
    }

    pub(in super::super) fn restore(status: u32) {
        // SAFETY: loads what `read` has stored: rounding and masks unchanged, flags as before.
        unsafe {
            std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const status, options(nostack, preserves_flags));
        }
    }
}

#[cfg(target_arch = "aarch64")]
mod register {
    pub(in super::super) fn read() -> u64 {
        let status: u64;
        // SAFETY: reads the status register.
        unsafe { std::arch::asm!("mrs {}, fpsr", out(reg) status, options(nomem, nostack)) };
        status
    }

    pub(in super::super) fn restore(status: u64) {
        // SAFETY: writes what `read` has read.
        unsafe { std::arch::asm!("msr fpsr, {}", in(reg) status, options(nomem, nostack)) };
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod register {
    pub(in super::super) fn read() {}
    pub(in super::super) fn restore((): ()) {}
}

pub(super) use register::{read, restore};
