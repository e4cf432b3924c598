//! The level argument of `playbot explore`.

use playbot_lab::split::{LevelSplit, SplitError};

/// Parses a level.
///
/// # Errors
///
/// The text is no level; the message shows the form of one.
pub fn one_level(text: &str) -> Result<LevelSplit, String> {
    text.parse::<LevelSplit>().map_err(|error| match error {
        SplitError::NotARange(_) => {
            // Numbers and files are no modes.
            let is_file = text.contains(['.', '/', '\\']);
            let is_mode = |mode: &&str| mode.starts_with(char::is_alphabetic) && !is_file;
            let mode = text.split(':').next().filter(is_mode).unwrap_or("MODE");
            let file = match (is_file, text.ends_with(".json")) {
                (_, true) => format!(", or files:{text}"),
                (true, false) => ", or a level file, which is JSON, such as files:levels/a.json".to_owned(),
                (false, false) => String::new(),
            };
            format!("`{text}` names no level: write its mode and its number, such as {mode}:7{file}")
        }
        other => other.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_read_and_others_are_told_how_to_write_one() {
        assert_eq!(one_level("plain:7").map(|level| (level.first, level.len())), Ok((7, 1)));
        for (text, example) in [
            ("plain", "plain:7"),
            ("plain:x", "plain:7"),
            ("", "MODE:7"),
            (":3", "MODE:7"),
            ("7", "MODE:7"),
            ("levels/a.json", "MODE:7, or files:levels/a.json"),
            ("C:\\levels\\a.json", "MODE:7, or files:C:\\levels\\a.json"),
            ("a.txt", "MODE:7, or a level file, which is JSON, such as files:levels/a.json"),
        ] {
            let error = one_level(text).expect_err(text);
            assert!(error.contains(&format!("`{text}` names no level")) && error.ends_with(example), "{error}");
        }
        assert!(one_level("plain:9..3").is_err_and(|error| error.contains("write plain:3..9")));
    }
}
