//! The commands that show what is wrong with a level.

use std::path::Path;

use crate::{
    detectors::DetectorChoice,
    shell_word::shell_word,
    verdict::{LevelVerdict, TestRecord, rerun_commands},
};

/// Commands of a program.
pub(super) struct Commands<'a> {
    /// How the program is called.
    pub program: &'a str,
    /// What was tested, without testers that the program does not know.
    pub record: TestRecord,
    /// Name and path of each policy.
    pub policies: Vec<(String, String)>,
    /// What looked for defects.
    pub detectors: &'a DetectorChoice,
}

impl Commands<'_> {
    /// Those that play a level again: the same episodes.
    pub fn again(&self, level: &LevelVerdict) -> Vec<String> {
        let mut commands = rerun_commands(self.program, &self.record, level);
        // Findings are named with their own files, and all is run from the same folder.
        commands
            .retain(|command| !command.starts_with(&format!("{} replay ", self.program)) && !command.starts_with('#'));
        let tests = format!("{} test ", self.program);
        for command in &mut commands {
            for (name, path) in &self.policies {
                *command = command.replace(&format!("--policy {name} "), &format!("--policy {} ", shell_word(path)));
            }
            if command.starts_with(&tests) {
                *command += &options(self.detectors);
            }
        }
        commands
    }

    /// The one that plays a finding again.
    pub fn replay(&self, file: &Path) -> String {
        replay(self.program, file)
    }
}

/// The command that plays a finding again.
pub(super) fn replay(program: &str, file: &Path) -> String {
    format!("{program} replay {}", shell_word(&file.display().to_string()))
}

fn options(choice: &DetectorChoice) -> String {
    let list = |option: &str, names: &[String]| {
        if names.is_empty() { String::new() } else { format!(" {option} {}", shell_word(&names.join(","))) }
    };
    let settings = choice.settings.iter().map(|setting| format!(" --detector {}", shell_word(setting)));
    list("--detect", &choice.with) + &list("--no-detect", &choice.without) + &settings.collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_and_settings_are_words_of_a_shell() {
        assert_eq!(replay("jump", "a/b-1.finding".as_ref()), "jump replay a/b-1.finding");
        assert_eq!(replay("jump", "my levels/it's".as_ref()), r"jump replay 'my levels/it'\''s'");
        let choice = DetectorChoice {
            with: vec!["determinism".to_owned(), "shortcut".to_owned()],
            without: vec!["all".to_owned()],
            settings: vec!["determinism.every=1".to_owned()],
        };
        let expected = " --detect determinism,shortcut --no-detect all --detector determinism.every=1";
        assert_eq!((options(&choice).as_str(), options(&DetectorChoice::default()).as_str()), (expected, ""));
    }
}
