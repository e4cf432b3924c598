//! The program's name: that of its file, whatever games are in it.

use std::{
    env,
    ffi::OsStr,
    io,
    path::{Path, PathBuf},
    sync::OnceLock,
};

/// The name in texts that do not know their program, such as the errors of libraries.
pub(crate) const DEFAULT_NAME: &str = "playbot";

/// Returns the program's name, for commands in messages.
pub(crate) fn name() -> &'static str {
    static NAME: OnceLock<String> = OnceLock::new();
    NAME.get_or_init(|| env::args_os().next().as_deref().and_then(of_file).unwrap_or(DEFAULT_NAME).to_owned())
}

/// Returns the file that this program was called by, to start it once more: after a build it is the new one. `None` if it
/// was found by its name alone.
pub(crate) fn called_file() -> Option<PathBuf> {
    env::args_os().next().map(PathBuf::from).filter(|path| path.is_file())
}

/// Returns a file of this program, to start it once more.
///
/// # Errors
///
/// The system does not know it.
pub(crate) fn file() -> io::Result<PathBuf> {
    called_file().map_or_else(env::current_exe, Ok)
}

fn of_file(path: &OsStr) -> Option<&str> {
    Path::new(path).file_name()?.to_str()?.strip_suffix(env::consts::EXE_SUFFIX)
}

/// Puts this program's name into the commands that a text quotes.
pub(crate) fn named(text: &str) -> String {
    with_name(text, name())
}

/// Puts a program's name into the commands that a text quotes.
pub(crate) fn with_name(text: &str, program: &str) -> String {
    text.replace(&format!("`{DEFAULT_NAME} "), &format!("`{program} "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_called_as_its_file() {
        let called = |name: &str| of_file(OsStr::new(&format!("{name}{}", env::consts::EXE_SUFFIX))).map(str::to_owned);
        assert_eq!(called("target/release/runner").as_deref(), Some("runner"));
        assert_eq!(called("my.game").as_deref(), Some("my.game"));
        assert_eq!(of_file(OsStr::new("..")), None);
    }

    #[test]
    fn quoted_commands_get_the_name_and_other_words_keep_theirs() {
        let text = "playbot 0.2 wrote it: `playbot eval --run a` and `playbot demo repair FILE`";
        let own = "playbot 0.2 wrote it: `runner eval --run a` and `runner demo repair FILE`";
        assert_eq!(with_name(text, "runner"), own);
        assert_eq!(with_name(text, "playbot"), text);
    }
}
