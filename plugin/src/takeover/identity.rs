//! The identity of the game, for recordings and policies.

use bevy::prelude::*;

/// The identity of this game. Recordings carry it, and policies and recordings of another game are
/// refused.
///
/// ```
/// use bevy_playbot::takeover::GameIdentity;
///
/// let game = GameIdentity::new("breakout", 3).with_mode("endless");
/// assert_eq!((game.version, game.mode.as_str()), (3, "endless"));
/// ```
#[derive(Resource, Clone, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct GameIdentity {
    /// Name of the game.
    pub name: String,
    /// Version of its rules: raise it whenever an old recording would no longer replay.
    pub version: u32,
    /// Mode, such as a difficulty; `default` unless the game says otherwise.
    pub mode: String,
}

impl GameIdentity {
    /// Creates a game in its only mode.
    pub fn new(name: &str, version: u32) -> Self {
        Self { name: name.to_owned(), version, mode: "default".to_owned() }
    }

    /// Returns the same game in another mode.
    pub fn with_mode(mut self, mode: &str) -> Self {
        self.mode = mode.to_owned();
        self
    }
}
