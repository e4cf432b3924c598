//! Who tests.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use serde::{Deserialize, Serialize};

use crate::eval::Player;

/// A player under a name, with what it sees.
#[derive(Clone)]
pub struct Tester {
    /// What files say of it.
    pub record: TesterRecord,
    /// The player.
    pub player: Player,
    /// What a learned policy sees; bots are left with vectors.
    pub observation_config: ObservationConfig,
}

/// What files say of a tester.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TesterRecord {
    /// Its name, unlike that of all others of the test.
    pub name: String,
    /// Checksum of the policy's file, for policies: another one is another tester.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// Whether a policy takes its most probable action instead of drawing one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub greedy: bool,
    /// The policy's file, where it is not the tester's name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The run that the policy is of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<TestedRun>,
}

/// The checkpoint of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TestedRun {
    /// The run's folder.
    pub folder: String,
    /// The checkpoint's number of environment steps.
    pub step: u64,
}

/// Where a policy's file lies does not make it another one.
impl PartialEq for TesterRecord {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.checksum, self.greedy) == (&other.name, &other.checksum, other.greedy)
    }
}

impl Eq for TesterRecord {}

impl TesterRecord {
    /// A bot of the game.
    pub fn bot(name: impl Into<String>) -> Self {
        Self { name: name.into(), checksum: None, greedy: false, file: None, run: None }
    }

    /// A policy's file, under a name of its own or else the file's.
    pub fn policy(name: Option<String>, path: &Path, checksum: String) -> Self {
        let of_file = || path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let name = name.unwrap_or_else(of_file);
        let file = (path != Path::new(&name)).then(|| path.display().to_string());
        Self { checksum: Some(checksum), file, ..Self::bot(name) }
    }

    /// As people read it.
    pub fn describe(&self) -> String {
        let checksum = self.checksum.as_ref().map_or_else(String::new, |sum| format!(" (file {sum})"));
        format!("{}{checksum}{}", self.name, if self.greedy { ", greedy" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_told_where_it_is_not_the_name() {
        let told = |name: Option<&str>, path: &str| {
            let record = TesterRecord::policy(name.map(str::to_owned), Path::new(path), "0f".to_owned());
            (record.name, record.file)
        };
        let wanted = |name: &str, file: Option<&str>| (name.to_owned(), file.map(str::to_owned));
        assert_eq!(told(None, "a.policy"), wanted("a.policy", None));
        assert_eq!(told(None, "new/a.policy"), wanted("a.policy", Some("new/a.policy")));
        assert_eq!(told(Some("ppo"), "a.policy"), wanted("ppo", Some("a.policy")));
    }

    #[test]
    fn a_policy_is_known_by_name_and_checksum_and_not_by_its_place() {
        let here = TesterRecord { checksum: Some("0f".to_owned()), ..TesterRecord::bot("ppo") };
        let there = TesterRecord { file: Some("runs/new.policy".to_owned()), ..here.clone() };
        assert_eq!(here, there);
        assert_ne!(here, TesterRecord { checksum: Some("1f".to_owned()), ..there.clone() });
        assert_ne!(here, TesterRecord { greedy: true, ..there.clone() });
        assert_ne!(here, TesterRecord { name: "bot".to_owned(), ..there.clone() });
        assert_eq!(there.describe(), "ppo (file 0f)");
        let text = serde_json::to_string(&there).expect("JSON");
        assert_eq!(text, r#"{"name":"ppo","checksum":"0f","file":"runs/new.policy"}"#);
        assert_eq!(serde_json::to_string(&here).expect("JSON"), r#"{"name":"ppo","checksum":"0f"}"#);
    }
}
