//! Opening of a recording to write.

use std::path::Path;

use bevy_playbot::demo::file::{DemoFault, DemoFileError, DemoHeader, DemoWriter};

use super::{error::CliError, output::prepare};

/// Options for an existing recording.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct OverwriteArgs {
    /// Add to an existing recording.
    #[arg(long, conflicts_with = "force")]
    append: bool,
    /// Overwrite an existing recording.
    #[arg(long)]
    force: bool,
}

impl OverwriteArgs {
    /// Opens the file, and makes its folder.
    ///
    /// # Errors
    ///
    /// The file exists without --append or --force, was recorded under other conditions, or cannot be written.
    pub fn open(self, path: &Path, header: DemoHeader) -> Result<DemoWriter, CliError> {
        let grows = self.append && path.is_file();
        if !grows {
            prepare(path)?;
        }
        let opened = match self {
            Self { append: true, .. } => DemoWriter::append(path, &header),
            Self { force: true, .. } => DemoWriter::replace(path, header),
            _ => DemoWriter::create(path, header),
        };
        opened.map_err(explain)
    }
}

/// Explains the error of a recording that was not opened, with the options that would open it.
fn explain(error: DemoFileError) -> CliError {
    match error.fault {
        DemoFault::Exists => CliError::Usage(format!(
            "{error}: add to it with --append, overwrite it with --force, or name another file"
        )),
        DemoFault::HeaderDiffers { .. } => CliError::Usage(format!("{error}, or overwrite this one with --force")),
        _ => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use bevy_playbot::demo::file::DemoActions;

    use super::*;

    #[test]
    fn what_is_in_the_way_is_named_with_the_options_that_help() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("new/a.demo");
        let said = |args: OverwriteArgs, game: &str, path: &Path| {
            let header = DemoHeader::new(game, 1, "easy", 60.0, DemoActions::Discrete(3));
            args.open(path, header).map(|_| ()).map_err(|error| (error.exit_code(), error.to_string()))
        };
        let (plain, append) = (OverwriteArgs::default(), OverwriteArgs { append: true, force: false });
        said(plain, "runner", &path).expect("nothing is there yet");
        let (code, words) = said(plain, "runner", &path).expect_err("there already");
        assert_eq!(code, 3);
        assert!(words.contains("exists already; nothing was written: add to it with --append"), "{words}");
        assert!(words.contains("--force"), "{words}");
        let (code, words) = said(append, "maze", &path).expect_err("another game");
        assert_eq!(code, 3);
        assert!(words.contains("record to another file, or overwrite this one with --force"), "{words}");
        said(append, "runner", &path).expect("of the same game");
        let (code, words) = said(plain, "runner", folder.path()).expect_err("a folder");
        assert!(code == 3 && words.contains("is a folder: name a file"), "{words}");
        let (code, words) = said(plain, "runner", &path.join("b.demo")).expect_err("below a file");
        assert!(code == 2 && words.contains("name a file in another folder"), "{words}");
    }
}
