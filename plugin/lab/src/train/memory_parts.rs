//! What a program keeps, added up and held against what the machine has left.

use super::{
    config::ExperimentError,
    free_memory::{free_of, memory_left, space_left},
    free_threads::{ThreadLimit, free_threads},
    thread_space::Threads,
};
use crate::arrangement::Arrangement;

/// Bytes that a World without agents takes at least, with what its thread uses of its stack, and those of an agent. Those of
/// the games here take 1.4 MiB.
const WORLD: u64 = 1 << 20;
const ARENA: u64 = 1 << 10;

/// What the machine has left for a program.
pub(super) struct Room {
    /// Bytes of memory.
    pub memory: u64,
    /// Bytes of address space.
    pub space: u64,
    pub threads: ThreadLimit,
}

impl Room {
    /// That of this process.
    pub(super) fn now() -> Self {
        Self { memory: memory_left(), space: space_left(), threads: free_threads() }
    }

    /// Bytes for what is kept.
    pub(super) fn free(&self) -> u64 {
        free_of(self.memory, self.space)
    }
}

/// Something that is kept.
pub(super) struct Part {
    /// It, with the factors of its size.
    pub what: String,
    pub bytes: u64,
    /// The keys to lower.
    pub keys: String,
}

/// Worlds with their arenas.
pub(super) fn worlds_part(arrangement: Arrangement) -> Part {
    let (worlds, arenas) = (u64::from(arrangement.worlds), u64::from(arrangement.total()));
    Part {
        what: format!("{worlds} Worlds with {arenas} arenas"),
        bytes: product(&[worlds, WORLD]).saturating_add(product(&[arenas, ARENA])),
        keys: "`worlds`, `arenas`".to_owned(),
    }
}

/// The address space of all threads, of which so many are for Worlds.
pub(super) fn threads_part(worlds: u32) -> Part {
    let worlds = u64::from(worlds);
    Part {
        what: format!("the program's threads, {worlds} of them for Worlds, with their address space under `ulimit -v`"),
        // A World takes more than the least.
        bytes: Threads::now().space(worlds).saturating_add(product(&[worlds, WORLD])),
        keys: "`worlds`, or raise that limit".to_owned(),
    }
}

/// Checks that all of it fits into what is free.
pub(super) fn check_parts(parts: &[Part], free: u64) -> Result<(), ExperimentError> {
    let needed = parts.iter().fold(0u64, |sum, part| sum.saturating_add(part.bytes));
    match parts.iter().max_by_key(|part| part.bytes) {
        Some(largest) if needed > free => {
            let beside = if largest.bytes > free { "" } else { ", and what else is kept," };
            let (what, keys) = (format!("{}{beside}", largest.what), largest.keys.clone());
            Err(ExperimentError::Memory {
                what,
                needed: if beside.is_empty() { largest.bytes } else { needed },
                free,
                keys,
            })
        }
        _ => Ok(()),
    }
}

/// A product; the largest number there is where it would be larger.
pub(super) fn product(factors: &[u64]) -> u64 {
    factors.iter().fold(1, |product, factor| product.saturating_mul(*factor))
}
