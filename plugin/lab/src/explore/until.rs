//! The conditions that end an exploration.

use std::{fmt, str::FromStr};

use bevy_playbot::unknown_name::UnknownName;

/// The condition that ends an exploration before its budget does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Until {
    /// A solution.
    Solved,
    /// A solution, if the level has a goal, and all open cells, if they are known.
    #[default]
    Covered,
    /// No condition: shorter paths are searched for until the budget is used up.
    Spent,
}

impl Until {
    const ALL: [Self; 3] = [Self::Solved, Self::Covered, Self::Spent];

    fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Covered => "covered",
            Self::Spent => "spent",
        }
    }
}

impl fmt::Display for Until {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Until {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let known = Self::ALL.into_iter().find(|until| until.name() == name);
        known.ok_or_else(|| UnknownName::new("end of an exploration", name, &Self::ALL.map(Self::name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_read_back_and_others_are_told_the_nearest() {
        for until in Until::ALL {
            assert_eq!(until.to_string().parse(), Ok(until));
        }
        let error = "solvd".parse::<Until>().expect_err("no such end").to_string();
        assert!(error.contains("did you mean `solved`?"), "{error}");
    }
}
