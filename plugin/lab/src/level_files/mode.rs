//! The mode of levels that are files, as text.

/// What the mode of levels that are files begins with.
pub const LEVEL_FILES: &str = "files:";

/// Whether the levels of a mode are files.
pub fn is_level_files(mode: &str) -> bool {
    level_file_pattern(mode).is_some()
}

/// The pattern of the files, if the levels of a mode are files.
pub fn level_file_pattern(mode: &str) -> Option<&str> {
    mode.strip_prefix(LEVEL_FILES)
}

/// The mode whose only level is this file, whatever characters its path has.
pub fn level_files_mode(path: &str) -> String {
    format!("{LEVEL_FILES}{}", glob::Pattern::escape(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_of_files_has_a_pattern_and_others_have_none() {
        assert_eq!(level_file_pattern("files:levels/*.json"), Some("levels/*.json"));
        assert!(!is_level_files("hard") && is_level_files("files:"));
        assert_eq!(level_files_mode("a[1].json"), "files:a[[]1[]].json");
    }
}
