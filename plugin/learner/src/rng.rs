//! Owned randomness: one seed, many independent named streams.
//!
//! A stream's 256-bit ChaCha key is made from the seed, the FNV-1a hash (64 bit) of the stream's name and its index.
//! The three are chained through SplitMix64, which then gives the key's four words. The recipe is fixed here and uses
//! no hasher of the standard library, so a seed means the same stream in every build.

use crate::LearnError;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

pub use rand_chacha::ChaCha8Rng;

/// Source of the named generators of one seed.
///
/// ```
/// use playbot_learner::rng::{Streams, unit};
/// let streams = Streams::new(7);
/// let mut a = streams.stream("actions", 0);
/// let mut b = streams.stream("actions", 1);
/// assert_ne!(unit(&mut a), unit(&mut b));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Streams {
    seed: u64,
}

impl Streams {
    /// Returns the streams of `seed`.
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// Returns the seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Returns the generator called `name`, number `index`, at its start.
    pub fn stream(&self, name: &str, index: u64) -> ChaCha8Rng {
        let mut state = split_mix(self.seed);
        state = split_mix(state ^ fnv1a(name.as_bytes()));
        state = split_mix(state ^ index);
        let mut key = [0u8; 32];
        for word in key.chunks_exact_mut(8) {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            word.copy_from_slice(&split_mix(state).to_le_bytes());
        }
        ChaCha8Rng::from_seed(key)
    }
}

/// Returns the FNV-1a hash (64 bit) of `bytes`.
pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xCBF2_9CE4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3))
}

fn split_mix(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The state of a generator, in a form that files can hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RngState {
    /// The 256-bit key, 64 hexadecimal digits.
    pub key: String,
    /// The position in 32-bit words, in decimal.
    pub word: String,
}

impl RngState {
    /// Returns the state of `rng`.
    pub fn of(rng: &ChaCha8Rng) -> Self {
        let key = rng.get_seed().iter().map(|byte| format!("{byte:02x}")).collect();
        Self { key, word: rng.get_word_pos().to_string() }
    }

    /// Returns a generator that continues exactly where the saved one stopped.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the key or the position cannot be read.
    pub fn restore(&self) -> Result<ChaCha8Rng, LearnError> {
        let bad = || LearnError::Config(format!("generator state {self:?} cannot be read"));
        if self.key.len() != 64 || !self.key.is_ascii() {
            return Err(bad());
        }
        let mut key = [0u8; 32];
        for (i, byte) in key.iter_mut().enumerate() {
            *byte = u8::from_str_radix(&self.key[2 * i..2 * i + 2], 16).map_err(|_| bad())?;
        }
        let mut rng = ChaCha8Rng::from_seed(key);
        rng.set_word_pos(self.word.parse().map_err(|_| bad())?);
        Ok(rng)
    }
}

/// Returns a uniform number in [0, 1) with 53 random bits.
pub fn unit<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns a standard normal number (Box and Muller; always two 64-bit draws, so positions stay predictable).
pub fn normal<R: Rng + ?Sized>(rng: &mut R) -> f32 {
    let radius = (-2.0 * libm::log(1.0 - unit(rng))).sqrt();
    let angle = std::f64::consts::TAU * unit(rng);
    (radius * libm::cos(angle)) as f32
}

/// Returns a uniform whole number below `bound`, without bias (Lemire's method).
///
/// `bound` 0 gives 0.
pub fn below<R: Rng + ?Sized>(rng: &mut R, bound: u64) -> u64 {
    let threshold = bound.wrapping_neg().checked_rem(bound).unwrap_or(0);
    loop {
        let product = u128::from(rng.next_u64()) * u128::from(bound);
        if product as u64 >= threshold {
            return (product >> 64) as u64;
        }
    }
}

/// Shuffles `items` into a uniformly random order (Fisher and Yates).
pub fn shuffle<T, R: Rng + ?Sized>(items: &mut [T], rng: &mut R) {
    for i in (1..items.len()).rev() {
        items.swap(i, below(rng, i as u64 + 1) as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_fixed_and_differ_by_name_and_index() {
        let streams = Streams::new(1);
        let first = |name: &str, index| streams.stream(name, index).next_u64();
        assert_eq!(first("a", 0), first("a", 0));
        assert_ne!(first("a", 0), first("a", 1));
        assert_ne!(first("a", 0), first("b", 0));
        assert_ne!(first("a", 0), Streams::new(2).stream("a", 0).next_u64());
    }

    #[test]
    fn a_restored_generator_goes_on_where_it_stood() {
        let mut rng = Streams::new(3).stream("x", 9);
        for _ in 0..5 {
            rng.next_u32();
        }
        let mut copy = RngState::of(&rng).restore().expect("own state");
        assert_eq!(rng.next_u64(), copy.next_u64());
        assert!(RngState { key: "zz".into(), word: "0".into() }.restore().is_err());
    }

    #[test]
    fn normal_draws_have_mean_zero_and_variance_one() {
        let mut rng = Streams::new(5).stream("n", 0);
        let n = 20_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let x = f64::from(normal(&mut rng));
            sum += x;
            squares += x * x;
        }
        assert!((sum / f64::from(n)).abs() < 0.03);
        assert!((squares / f64::from(n) - 1.0).abs() < 0.04);
    }

    #[test]
    fn shuffle_keeps_every_item() {
        let mut items: Vec<usize> = (0..100).collect();
        shuffle(&mut items, &mut Streams::new(1).stream("s", 0));
        assert_ne!(items, (0..100).collect::<Vec<_>>());
        items.sort_unstable();
        assert_eq!(items, (0..100).collect::<Vec<_>>());
    }
}
