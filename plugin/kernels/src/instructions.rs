//! The vector instructions that loops run with: the widest ones of the machine, up to a limit.
//!
//! No number depends on them. Sums are made in an order that depends on shapes alone, products are added to them with one
//! rounding (a *fused* multiply-add), and functions such as exp consist of sums and products. What a processor lacks is
//! computed by other instructions to the same bits.
//!
//! The limit is there to try that out, and to measure what another processor would get.

use std::{
    env, fmt,
    str::FromStr,
    sync::atomic::{AtomicU8, Ordering},
};

/// Sets of vector instructions, from the one of every machine on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Instructions {
    /// Those of every processor of this kind: SSE2 on x86-64. Multiply-adds are put together from others, which takes
    /// several times as long.
    Portable,
    /// 8 numbers at a time and multiply-adds (AVX2 and FMA), on x86-64 only.
    Avx2,
    /// The widest of this machine, such as AVX-512 or Neon.
    Widest,
}

impl Instructions {
    /// Every set, in order.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Widest];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Widest => "widest",
        }
    }

    /// Returns the limit that is set.
    #[inline]
    pub fn limit() -> Self {
        Self::ALL[usize::from(LIMIT.load(Ordering::Relaxed))]
    }

    /// Makes loops that begin from now on use at most these, on all threads. A machine that lacks them uses fewer.
    pub fn set_limit(self) {
        LIMIT.store(self as u8, Ordering::Relaxed);
    }
}

/// The variable of the environment that names the limit.
const VARIABLE: &str = "PLAYBOT_INSTRUCTIONS";

/// Sets the limit that the environment's `PLAYBOT_INSTRUCTIONS` names, if it is there and not empty.
///
/// # Errors
///
/// It names no set.
pub fn limit_by_environment() -> Result<(), String> {
    let Some(name) = env::var_os(VARIABLE).filter(|name| !name.is_empty()) else { return Ok(()) };
    let limit: Result<Instructions, String> = name.to_string_lossy().parse();
    limit.map(Instructions::set_limit).map_err(|error| format!("{VARIABLE}: {error}"))
}

/// The place of the limit in [`Instructions::ALL`].
static LIMIT: AtomicU8 = AtomicU8::new(Instructions::Widest as u8);

impl fmt::Display for Instructions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Instructions {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|set| set.name() == name);
        found.ok_or_else(|| format!("`{name}` is no set of vector instructions; there are {}", names()))
    }
}

/// Stands for the crate of this name in modules that use its attribute `with_simd`, whose code asks for `AutoArch`.
pub mod macerator {
    pub use ::macerator::*;

    use super::Instructions;

    /// The instructions of the next loop.
    #[derive(Debug)]
    pub struct AutoArch(Arch);

    impl AutoArch {
        /// Returns the widest instructions within the [limit](Instructions::limit).
        #[inline]
        #[allow(clippy::new_without_default, reason = "as the attribute calls it")]
        pub fn new() -> Self {
            let widest = Arch::detect();
            Self(match Instructions::limit() {
                Instructions::Widest => widest,
                limit => narrowed(widest, limit),
            })
        }

        /// Runs a loop that is compiled for each set of instructions.
        #[inline]
        pub fn dispatch<L: WithSimd>(self, of_loop: L) -> L::Output {
            #[expect(unsafe_code, reason = "the machine has the instructions, or wider ones, which include them")]
            unsafe {
                self.0.dispatch(of_loop)
            }
        }
    }

    #[cold]
    fn narrowed(widest: Arch, limit: Instructions) -> Arch {
        match (limit, widest) {
            (Instructions::Portable, _) => Arch::Scalar,
            #[cfg(target_arch = "x86_64")]
            (Instructions::Avx2, Arch::V4) => Arch::V3,
            _ => widest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read() {
        for set in Instructions::ALL {
            assert_eq!(set.name().parse(), Ok(set));
        }
        let error = "avx1024".parse::<Instructions>().expect_err("no such set");
        assert_eq!(error, "`avx1024` is no set of vector instructions; there are portable, avx2, widest");
    }
}
