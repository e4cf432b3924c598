//! The commands that reproduce a broken level.

use std::path::Path;

use crate::{
    shell_word::shell_word,
    verdict::{LevelVerdict, TestRecord, rerun_commands},
};

/// Commands of a program.
pub(super) struct Commands<'a> {
    /// The command that starts the program.
    pub program: &'a str,
    /// The test, without testers that the program does not know.
    pub record: TestRecord,
    /// Name and path of each policy.
    pub policies: Vec<(String, String)>,
}

impl Commands<'_> {
    /// Returns the commands that play the same episodes of a level again.
    pub fn again(&self, level: &LevelVerdict) -> Vec<String> {
        let mut commands = rerun_commands(self.program, &self.record, level);
        // Findings are named with their own files, and all commands run in the same folder.
        commands
            .retain(|command| !command.starts_with(&format!("{} replay ", self.program)) && !command.starts_with('#'));
        for command in &mut commands {
            for (name, path) in &self.policies {
                *command = command.replace(&format!("--policy {name} "), &format!("--policy {} ", shell_word(path)));
            }
        }
        commands
    }

    /// Returns the command that replays a finding.
    pub fn replay(&self, file: &Path) -> String {
        replay(self.program, file)
    }
}

/// Returns the command that replays a finding.
pub(super) fn replay(program: &str, file: &Path) -> String {
    format!("{program} replay {}", shell_word(&file.display().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_words_of_a_shell() {
        assert_eq!(replay("jump", "a/b-1.finding".as_ref()), "jump replay a/b-1.finding");
        assert_eq!(replay("jump", "my levels/it's".as_ref()), r"jump replay 'my levels/it'\''s'");
    }
}
