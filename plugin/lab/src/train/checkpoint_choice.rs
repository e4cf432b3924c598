//! Checkpoints as people name them.

use std::str::FromStr;

use bevy_playbot::unknown_name::UnknownName;

/// Which checkpoint of a run is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CheckpointChoice {
    /// The latest.
    #[default]
    Last,
    /// The one with the highest return in training.
    Best,
    /// The one at this step.
    Step(u64),
}

impl FromStr for CheckpointChoice {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        match name {
            "last" => Ok(Self::Last),
            "best" => Ok(Self::Best),
            step => step.parse().map(Self::Step).map_err(|_| {
                UnknownName::new("checkpoint", name, &["last", "best", "the number of environment steps of one"])
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_are_named_on_the_command_line() {
        assert_eq!("last".parse(), Ok(CheckpointChoice::Last));
        assert_eq!("best".parse(), Ok(CheckpointChoice::Best));
        assert_eq!("4096".parse(), Ok(CheckpointChoice::Step(4096)));
        assert!("newest".parse::<CheckpointChoice>().expect_err("no such word").to_string().contains("last, best"));
    }
}
