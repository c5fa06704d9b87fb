//! Choice of the instruction set: the widest one of the machine, unless an environment variable
//! limits it.
//!
//! A kernel is compiled for AVX-512 only where that makes it about 15 % faster than AVX2, since each
//! instruction set takes a third of the compiler's time for a kernel. [`Instructions::run_widest`] uses
//! it, [`Instructions::run`] does not. Time with AVX2 over time with AVX-512, on an AMD EPYC:
//!
//! * 1.2 to 1.5 for Lambert W, 1.35 for roots along chains, 1.1 to 1.4 for most sweeps of loops;
//! * 0.95 to 1.05 for certified branches of maps, likelihoods, single linear loops, the spectral method
//!   and characteristic matrices.
//!
//! Plain arithmetic has one lane, which is the least to compile.

use std::sync::LazyLock;

use pulp::{Arch, Scalar, Simd, WithSimd};

/// Environment variable that limits the instruction set: `avx512`, `avx2`, `neon` or `plain`.
/// Results do not depend on it; it is used for comparisons.
const VARIABLE: &str = "DEADTIME_INSTRUCTIONS";

static CHOSEN: LazyLock<Instructions> = LazyLock::new(|| {
    let wanted = std::env::var(VARIABLE).unwrap_or_default();
    let available = Instructions::available();
    let named = available.iter().find(|set| set.name() == wanted);
    *named.or(available.first()).unwrap_or(&Instructions::Plain)
});

/// Instruction sets the kernels are compiled for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Instructions {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    #[cfg(target_arch = "aarch64")]
    Neon(pulp::aarch64::Neon),
    /// Plain arithmetic; the fused multiply-add in software where the machine has none.
    Plain,
}

impl Instructions {
    /// The instruction sets of this machine, the widest first.
    pub(crate) fn available() -> Vec<Self> {
        let mut sets = Vec::new();
        match Arch::new() {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(simd) => {
                sets.push(Self::Avx512(simd));
                sets.push(Self::Avx2(*simd));
            }
            #[cfg(target_arch = "x86_64")]
            Arch::V3(simd) => sets.push(Self::Avx2(simd)),
            #[cfg(target_arch = "aarch64")]
            Arch::Neon(simd) => sets.push(Self::Neon(simd)),
            _ => {}
        }
        sets.push(Self::Plain);
        sets
    }

    /// The instruction set on which kernels run.
    pub(crate) fn chosen() -> Self {
        *CHOSEN
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "avx512",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "avx2",
            #[cfg(target_arch = "aarch64")]
            Self::Neon(_) => "neon",
            Self::Plain => "plain",
        }
    }

    /// Run with these instructions, but for AVX-512: with AVX2.
    pub(crate) fn run<Op: WithSimd>(self, op: Op) -> Op::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => Simd::vectorize(*simd, op),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => Simd::vectorize(simd, op),
            #[cfg(target_arch = "aarch64")]
            Self::Neon(simd) => Simd::vectorize(simd, op),
            Self::Plain => Simd::vectorize(Scalar, op),
        }
    }

    /// Run with these instructions.
    pub(crate) fn run_widest<Op: WithSimd>(self, op: Op) -> Op::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => Simd::vectorize(simd, op),
            _ => self.run(op),
        }
    }
}

struct Call<F>(F);

impl<T, F: FnOnce() -> T> WithSimd for Call<F> {
    type Output = T;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> T {
        (self.0)()
    }
}

/// Run `part` with the instructions of `simd`, in a function of its own: a part of a kernel that is
/// compiled once and called, where inlining it everywhere would make the kernel too large for the
/// compiler. Closures that are given are `#[inline(always)]`.
#[inline(never)]
pub(crate) fn outlined<S: Simd, T>(simd: S, part: impl FnOnce() -> T) -> T {
    simd.vectorize(Call(part))
}
