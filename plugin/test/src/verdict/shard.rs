//! Shards: parts of a test for several machines.

use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};
use thiserror::Error;

/// Part `index` of `count`, counted from 0: the levels whose index in the range, divided by `count`, has the
/// remainder `index`. Written `0/4` to `3/4`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    /// Index of the part.
    pub index: u64,
    /// Number of parts.
    pub count: u64,
}

impl Shard {
    /// Returns the indices of its levels in a range of this length.
    pub fn places(self, length: u64) -> impl Iterator<Item = u64> + use<> {
        (self.index..length).step_by(usize::try_from(self.count).unwrap_or(usize::MAX))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// Text that is not a valid shard.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum ShardError {
    /// The text has another form.
    #[error("`{0}` is not a shard: write index/count, such as 0/4, 1/4, 2/4 and 3/4 for four machines")]
    NotAShard(String),
    /// The index is too large.
    #[error("`{index}/{count}`: shards are counted from 0, so the last one is {}/{count}", count - 1)]
    Beyond {
        /// The requested index.
        index: u64,
        /// Number of parts, at least 1.
        count: u64,
    },
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parse = || {
            let (index, count) = text.split_once('/')?;
            Some((index.parse().ok()?, count.parse().ok()?))
        };
        match parse() {
            None | Some((_, 0)) => Err(ShardError::NotAShard(text.to_owned())),
            Some((index, count)) if index >= count => Err(ShardError::Beyond { index, count }),
            Some((index, count)) => Ok(Self { index, count }),
        }
    }
}

impl TryFrom<String> for Shard {
    type Error = ShardError;

    fn try_from(text: String) -> Result<Self, ShardError> {
        text.parse()
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_counted_from_0_and_share_out_every_level_once() {
        let shard = |text: &str| text.parse::<Shard>();
        let mut all: Vec<u64> =
            ["0/3", "1/3", "2/3"].iter().flat_map(|text| shard(text).expect("valid").places(8)).collect();
        assert_eq!(all[..3], [0, 3, 6]);
        all.sort_unstable();
        assert_eq!(all, (0..8).collect::<Vec<_>>());
        assert_eq!(shard("4/7").expect("valid").places(3).count(), 0);
        assert_eq!(shard("2/7").expect("valid").to_string(), "2/7");
        for bad in ["", "1", "1/0", "a/2", "-1/2", "1/2/3"] {
            assert_eq!(shard(bad), Err(ShardError::NotAShard(bad.to_owned())), "{bad}");
        }
        assert!(shard("3/3").expect_err("too many").to_string().contains("the last one is 2/3"));
    }
}
