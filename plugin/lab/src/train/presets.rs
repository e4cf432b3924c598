//! Presets: named settings for experiments to build on, those of the paper and of its released code.

use bevy_playbot::unknown_name::UnknownName;
pub use playbot_assets::{ExperimentFile, PRESETS};

/// Returns the preset with this name, which `base` in an experiment names.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn find_preset(name: &str) -> Result<ExperimentFile, UnknownName> {
    let found = PRESETS.into_iter().find(|preset| preset.name == name);
    found.ok_or_else(|| UnknownName::new("preset", name, &PRESETS.map(|preset| preset.name)))
}
