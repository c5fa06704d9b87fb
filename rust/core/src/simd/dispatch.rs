//! Which instruction set runs: the widest the machine has, unless the environment asks for less.

use std::sync::LazyLock;

use pulp::{Arch, Scalar128b, Simd, WithSimd};

/// Environment variable that keeps wider instructions out: `avx512`, `avx2`, `neon` or `plain`.
/// Results do not depend on it; what it serves is comparison.
const VARIABLE: &str = "DEADTIME_INSTRUCTIONS";

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

static CHOSEN: LazyLock<Instructions> = LazyLock::new(|| {
    let wanted = std::env::var(VARIABLE).unwrap_or_default();
    let available = Instructions::available();
    let named = available.iter().find(|set| set.name() == wanted);
    *named.or(available.first()).unwrap_or(&Instructions::Plain)
});

impl Instructions {
    /// What this machine can run, the widest first.
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

    /// What kernels run on.
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

    #[inline]
    pub(crate) fn run<Op: WithSimd>(self, op: Op) -> Op::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => Simd::vectorize(simd, op),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => Simd::vectorize(simd, op),
            #[cfg(target_arch = "aarch64")]
            Self::Neon(simd) => Simd::vectorize(simd, op),
            Self::Plain => Simd::vectorize(Scalar128b, op),
        }
    }
}

/// The instruction set that kernels run on: `avx512`, `avx2`, `neon` or `plain`.
///
/// ```
/// assert!(["avx512", "avx2", "neon", "plain"].contains(&deadtime::instructions()));
/// ```
pub fn instructions() -> &'static str {
    Instructions::chosen().name()
}
