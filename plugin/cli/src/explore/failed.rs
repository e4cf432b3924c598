//! What keeps a level from being explored, as the command line has it.

use bevy_playbot::fault::Fault;
use playbot_lab::explore::ExploreError;

use crate::error::CliError;

impl From<ExploreError> for CliError {
    fn from(error: ExploreError) -> Self {
        match error {
            ExploreError::Plan(why) => Self::Usage(why),
            ExploreError::Mode(error) => error.into(),
            ExploreError::Vision(error) => error.into(),
            ExploreError::Fault(error) => error.into(),
            ExploreError::Demo(error) => error.into(),
            // The game is at fault, and the words say what to do.
            ExploreError::Diverged { .. } => Fault(error.to_string()).into(),
        }
    }
}
