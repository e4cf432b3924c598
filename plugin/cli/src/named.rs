//! Files with a name in front on the command line, `NAME=FILE`.

use std::{
    path::{Path, PathBuf, is_separator},
    str::FromStr,
};

/// A file with a name in front of it: `NAME=FILE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// The name.
    pub name: String,
    /// The file.
    pub path: PathBuf,
}

impl Named {
    /// Parses an argument whose name is optional. `None` if it is just a file, which holds whenever a file of that
    /// whole name exists.
    pub fn given(given: &Path) -> Option<Self> {
        if given.exists() { None } else { given.to_str()?.parse().ok() }
    }
}

impl FromStr for Named {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_name = |name: &str| !name.is_empty() && !name.contains(is_separator);
        let parts = text.split_once('=').filter(|(name, file)| is_name(name) && !file.is_empty());
        let (name, file) = parts.ok_or("write a name and a file, as in ppo=bot.policy")?;
        Ok(Self { name: name.to_owned(), path: file.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_stands_in_front_of_a_file() {
        let named = Named { name: "ppo".to_owned(), path: "a=b.policy".into() };
        assert_eq!("ppo=a=b.policy".parse(), Ok(named));
        for text in ["bot.policy", "=bot.policy", "ppo=", "runs/a=b.policy"] {
            assert!(text.parse::<Named>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_file_that_exists_needs_no_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let there = folder.path().join("ppo=bot.policy");
        std::fs::write(&there, "").expect("writable");
        assert_eq!(Named::given(&there), None);
        // A prefix that is no name is part of a path.
        assert_eq!(Named::given(&folder.path().join("ppo=none.policy")), None);
        assert_eq!(Named::given(Path::new("none.policy")), None);
        let named = Named { name: "ppo".to_owned(), path: there.clone() };
        assert_eq!(Named::given(Path::new(&format!("ppo={}", there.display()))), Some(named));
    }
}
