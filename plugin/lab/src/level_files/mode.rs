//! The mode of levels from files, as text.

/// Prefix of the mode of levels from files.
pub const LEVEL_FILES: &str = "files:";

/// Returns whether the levels of a mode are files.
pub fn is_level_files(mode: &str) -> bool {
    level_file_pattern(mode).is_some()
}

/// Returns the file pattern of a mode, if its levels are files.
pub fn level_file_pattern(mode: &str) -> Option<&str> {
    mode.strip_prefix(LEVEL_FILES)
}

/// Returns the mode whose only level is this file, for any characters in the path.
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
