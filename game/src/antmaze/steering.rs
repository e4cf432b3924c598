//! People: keys say which way, and the walker walks.

use bevy::prelude::*;
use bevy_playbot::{agent::AgentOrder, fault::Faults, prelude::*};

use super::{
    components::MazeAnt,
    walker::{Walker, WalkerInput},
};

/// Keys for one way along an axis.
type Keys = [KeyCode; 2];
const LEFT: Keys = [KeyCode::ArrowLeft, KeyCode::KeyA];
const RIGHT: Keys = [KeyCode::ArrowRight, KeyCode::KeyD];
const DOWN: Keys = [KeyCode::ArrowDown, KeyCode::KeyS];
const UP: Keys = [KeyCode::ArrowUp, KeyCode::KeyW];

/// What the keyboard does. No person can turn eight hinges at once, so an action cannot come from the keys alone: the
/// keys of this map do nothing, and [`steer`] writes the action.
pub(super) fn input_map() -> InputMap {
    let help =
        "arrow keys or W, A, S and D tell the ant's walker where to go; without a key the ant lets go of its legs";
    InputMap::new(Vec::new(), |_| ActionValue::Continuous(vec![0.0; 8]), help)
}

/// Walks for people in the direction of their keys.
pub(super) fn steer(
    keys: Res<ButtonInput<KeyCode>>,
    order: Res<AgentOrder>,
    mut ants: Query<(&Control, &Episode, &MazeAnt, &mut Action), With<InputMap>>,
    mut faults: ResMut<Faults>,
    mut input: Local<WalkerInput>,
) {
    let way = |back, ahead| f32::from(i8::from(keys.any_pressed(ahead)) - i8::from(keys.any_pressed(back)));
    let direction = [way(LEFT, RIGHT), way(DOWN, UP)];
    if direction == [0.0, 0.0] {
        return;
    }
    for &agent in order.entities() {
        let Ok((control, episode, ant, mut action)) = ants.get_mut(agent) else { continue };
        if *control != Control::Human || !episode.is_running() {
            continue;
        }
        input.clear();
        let state = ant.0.state();
        input.push(&state, [state.qpos[0] + direction[0], state.qpos[1] + direction[1]]);
        match Walker::shipped().and_then(|walker| walker.act(&input)) {
            Ok(torques) => action.0 = ActionValue::Continuous(torques.concat()),
            Err(error) => return faults.report(error.to_string()),
        }
    }
}
