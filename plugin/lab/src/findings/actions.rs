//! Conversions between lists of actions and those of recordings.

use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    demo::{file::EpisodeActions, replay::recorded_action},
};

/// Returns the number of actions with an effect.
pub(super) fn efforts(actions: &[ActionValue], idle: &ActionValue) -> u32 {
    u32::try_from(actions.iter().filter(|action| *action != idle).count()).unwrap_or(u32::MAX)
}

/// Returns the actions of a recorded episode.
pub(super) fn listed(actions: &EpisodeActions) -> Vec<ActionValue> {
    (0..).map_while(|tick| recorded_action(actions, tick)).collect()
}

/// Returns the actions for a recording. Actions that do not fit the space are left out.
pub(super) fn recorded(actions: &[ActionValue], space: &ActionSpace) -> EpisodeActions {
    match space {
        ActionSpace::Discrete(_) => {
            let index = |action: &ActionValue| match action {
                ActionValue::Discrete(index) => Some(*index),
                ActionValue::Continuous(_) => None,
            };
            EpisodeActions::Discrete(actions.iter().filter_map(index).collect())
        }
        ActionSpace::Continuous(dim) => {
            let values = actions.iter().filter_map(|action| match action {
                ActionValue::Continuous(values) => Some(values.iter().copied()),
                ActionValue::Discrete(_) => None,
            });
            EpisodeActions::Continuous { dim: *dim, values: values.flatten().collect() }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_go_into_recordings_and_come_back() {
        let space = ActionSpace::Discrete(3);
        let actions = [2, 0, 1].map(ActionValue::Discrete);
        assert_eq!(listed(&recorded(&actions, &space)), actions);
        let space = ActionSpace::Continuous(2);
        let actions = [ActionValue::Continuous(vec![0.5, -1.0]), ActionValue::Continuous(vec![0.0, 0.0])];
        assert_eq!(listed(&recorded(&actions, &space)), actions);
        assert!(listed(&recorded(&[], &space)).is_empty());
        assert_eq!(efforts(&actions, &actions[1]), 1);
    }
}
