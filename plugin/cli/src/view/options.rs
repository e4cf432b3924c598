//! The form of the pictures, from the command line.

use bevy_playbot::{unknown_name::UnknownName, vision::ImageOptions};

use crate::error::CliError;

const KEYS: [&str; 5] = ["width", "height", "stack", "grayscale", "paint_velocity"];

/// Applies a `key=value`; a switch without a value is on.
///
/// # Errors
///
/// An unknown key, or a value that does not fit.
pub fn set(options: &mut ImageOptions, changes: &[String]) -> Result<(), CliError> {
    for change in changes {
        let (key, value) = change.split_once('=').unwrap_or((change, "true"));
        match key {
            "width" => options.width = number(key, value)?,
            "height" => options.height = number(key, value)?,
            "stack" => options.stack = number(key, value)?,
            "grayscale" => options.grayscale = switch(key, value)?,
            "paint_velocity" => options.paint_velocity = switch(key, value)?,
            _ => return Err(UnknownName::new("image option", key, &KEYS).into()),
        }
    }
    Ok(())
}

fn number(key: &str, value: &str) -> Result<u32, CliError> {
    value.parse().map_err(|_| CliError::Usage(format!("--image {key} must be a whole number, not {value}")))
}

fn switch(key: &str, value: &str) -> Result<bool, CliError> {
    value.parse().map_err(|_| CliError::Usage(format!("--image {key} must be true or false, not {value}")))
}
