//! Testers: players with names and observations.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use serde::{Deserialize, Serialize};

use crate::eval::Player;

/// A player with a name and its observations.
#[derive(Clone)]
pub struct Tester {
    /// Its description for files.
    pub record: TesterRecord,
    /// The player.
    pub player: Player,
    /// Observations of a learned policy; bots keep vectors.
    pub observation_config: ObservationConfig,
}

/// Description of a tester in files.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TesterRecord {
    /// Its name, unique in the test.
    pub name: String,
    /// Checksum of a policy's file: another file is another tester.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// True if a policy takes its most probable action instead of drawing one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub greedy: bool,
    /// The policy's file, if it differs from the tester's name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The policy's run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<TestedRun>,
}

/// A checkpoint of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TestedRun {
    /// The run's folder.
    pub folder: String,
    /// The checkpoint's number of environment steps.
    pub step: u64,
}

/// The path of a policy's file does not identify the tester.
impl PartialEq for TesterRecord {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.checksum, self.greedy) == (&other.name, &other.checksum, other.greedy)
    }
}

impl Eq for TesterRecord {}

impl TesterRecord {
    /// Makes the tester of a bot of the game.
    pub fn bot(name: impl Into<String>) -> Self {
        Self { name: name.into(), checksum: None, greedy: false, file: None, run: None }
    }

    /// Makes the tester of a policy's file, under its own name or else the file's.
    pub fn policy(name: Option<String>, path: &Path, checksum: String) -> Self {
        let of_file = || path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let name = name.unwrap_or_else(of_file);
        let file = (path != Path::new(&name)).then(|| path.display().to_string());
        Self { checksum: Some(checksum), file, ..Self::bot(name) }
    }

    /// Describes the tester.
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
