// A stand-in for the crate `rand`, from which the game takes an unseeded generator for the heights of its board. The
// build script puts it below the game's file, which finds it under the name of the crate.

mod rand {
    pub use os_rand::{RngExt, SeedableRng};

    // The game's own seed: it takes this one if an environment variable marks a test. A program could set that variable
    // for itself with unsafe code only.
    pub fn make_rng<R: SeedableRng>() -> R {
        R::seed_from_u64(19878367467713)
    }
}
