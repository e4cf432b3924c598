//! An output file for a drawing.

use std::path::{Path, PathBuf};

use playbot_lab::drawing::Drawing;

use super::painter;
use crate::{error::CliError, output};

/// A file for a drawing, a PNG or an SVG.
#[derive(Clone, Debug)]
pub struct PlotFile {
    path: PathBuf,
    is_svg: bool,
}

impl PlotFile {
    /// Takes a path whose ending is the kind. Its folder is made, and it is tested for writing, so that nothing is
    /// computed in vain.
    ///
    /// # Errors
    ///
    /// The ending is neither `.png` nor `.svg`, the path is that of a folder, or nothing can be written there.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        let is_svg = match ending.as_deref() {
            Some("svg") => true,
            Some("png") => false,
            _ => {
                return Err(CliError::Usage(format!(
                    "{}: a picture is written as .png or .svg; choose one of them",
                    path.display()
                )));
            }
        };
        output::prepare(path)?;
        Ok(Self { path: path.to_owned(), is_svg })
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a drawing.
    ///
    /// # Errors
    ///
    /// It is too large for a PNG, or cannot be written.
    pub fn write(&self, drawing: &Drawing) -> Result<(), CliError> {
        let bytes = if self.is_svg { drawing.to_svg().into_bytes() } else { painter::to_png(drawing)? };
        output::write(&self.path, &bytes)
    }
}
