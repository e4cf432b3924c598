//! Experiments that are not read from a file.

use std::borrow::Cow;

/// An experiment in RON that comes with a game.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExperimentText {
    /// The origin, for messages: the path of its file below the game's sources, or words.
    pub origin: Cow<'static, str>,
    /// Its text.
    pub text: Cow<'static, str>,
}
