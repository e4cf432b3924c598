//! Writing of a level's picture into a file.

use playbot_lab::inspect::LevelPicture;

use crate::{error::CliError, output, plot::PlotFile, view::film::Film};

/// Writes it.
///
/// # Errors
///
/// It is made of pixels and the file is no .png, it is too large, or it cannot be written.
pub fn write(file: &PlotFile, picture: &LevelPicture, tick_hz: f64) -> Result<(), CliError> {
    match picture {
        LevelPicture::Drawing(drawing) => file.write(drawing),
        LevelPicture::Pixels { image, pixels } => {
            let path = file.path();
            output::png(&path.to_string_lossy())
                .map_err(|why| CliError::Usage(format!("{}: {why}", path.display())))?;
            output::write(path, &Film::new(*image, 1, tick_hz)?.still(pixels)?.0)
        }
    }
}
