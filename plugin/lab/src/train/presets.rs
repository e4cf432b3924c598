//! Settings with a name, to build experiments on: those of the paper and of its released code.

use bevy_playbot::unknown_name::UnknownName;

/// A part of an experiment that comes with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// Its name in `base`.
    pub name: &'static str,
    /// The RON text: keys of an experiment, not all of them.
    pub text: &'static str,
}

macro_rules! presets {
    ($($name:literal),* $(,)?) => {
        [$(Preset { name: $name, text: include_str!(concat!("../../assets/presets/", $name, ".ron")) }),*]
    };
}

/// All of them.
pub const PRESETS: [Preset; 9] = presets![
    "coinrun-ppo",
    "coinrun-sac",
    "d4rl-ppo",
    "d4rl-sac",
    "maze-hour",
    "skill-paper",
    "skill-released",
    "score-released-coinrun",
    "score-released-d4rl",
];

impl Preset {
    /// The preset with this name.
    ///
    /// # Errors
    ///
    /// [`UnknownName`] with the valid names.
    pub fn find(name: &str) -> Result<Self, UnknownName> {
        let found = PRESETS.into_iter().find(|preset| preset.name == name);
        found.ok_or_else(|| UnknownName::new("preset", name, &PRESETS.map(|preset| preset.name)))
    }

    /// What it is, in one line: the first line of its file.
    pub fn about(self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches('/').trim()
    }
}
