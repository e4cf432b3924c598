//! Opening a recording to write.

use std::path::Path;

use bevy_playbot::demo::file::{DemoHeader, DemoWriter};

use super::{error::CliError, output::make_folder_of};

/// What becomes of a recording that exists.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct OverwriteArgs {
    /// Add to a recording that exists.
    #[arg(long, conflicts_with = "force")]
    append: bool,
    /// Overwrite a recording that exists.
    #[arg(long)]
    force: bool,
}

impl OverwriteArgs {
    /// Opens the file, and makes the folder it lies in.
    ///
    /// # Errors
    ///
    /// The file exists and nobody said what to do about it, was recorded under other conditions, or cannot be written.
    pub fn open(self, path: &Path, header: DemoHeader) -> Result<DemoWriter, CliError> {
        make_folder_of(path)?;
        if self.append {
            return Ok(DemoWriter::append(path, &header)?);
        }
        if self.force {
            return Ok(DemoWriter::replace(path, header)?);
        }
        Ok(DemoWriter::create(path, header)?)
    }
}
