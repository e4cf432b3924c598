//! Steering for people: keys give a direction, and the walker walks.

use bevy::prelude::*;
use bevy_playbot::{agent::AgentOrder, fault::Faults};
use playbot_lab::prelude::*;

use super::{
    pilot::{Pilot, PilotInput},
    skeleton::JOINTS,
    state::AntState,
};

/// Keys for one direction along an axis.
type Keys = [KeyCode; 2];
const LEFT: Keys = [KeyCode::ArrowLeft, KeyCode::KeyA];
const RIGHT: Keys = [KeyCode::ArrowRight, KeyCode::KeyD];
const DOWN: Keys = [KeyCode::ArrowDown, KeyCode::KeyS];
const UP: Keys = [KeyCode::ArrowUp, KeyCode::KeyW];

/// Returns bindings without effect. No person can turn eight hinges at once, so an action cannot come from the keys
/// alone: [`steer`] writes it.
pub fn key_bindings() -> KeyBindings {
    let help = "arrow keys or W, A, S and D steer the ant's walker; without a key the ant lets go of its legs";
    KeyBindings::new(Vec::new(), |_| ActionValue::Continuous(vec![0.0; JOINTS]), help)
}

/// A component that holds an agent's ant.
pub trait AntComponent: Component {
    /// Returns the ant's positions and velocities.
    fn state(&self) -> AntState;
}

/// Walks for people in the direction of their keys. Runs after [`PlaybotSystems::Decide`], when the keyboard has
/// written an action that does nothing, in apps with a keyboard.
pub fn steer<C: AntComponent>(
    keys: Res<ButtonInput<KeyCode>>,
    order: Res<AgentOrder>,
    mut ants: Query<(&Control, &Episode, &C, &mut Action), With<KeyBindings>>,
    mut faults: ResMut<Faults>,
    mut input: Local<PilotInput>,
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
        let state = ant.state();
        input.push(&state, [state.qpos[0] + direction[0], state.qpos[1] + direction[1]]);
        match Pilot::shipped().and_then(|pilot| pilot.act(&input)) {
            Ok(torques) => action.0 = ActionValue::Continuous(torques.concat()),
            Err(error) => return faults.report(error.to_string()),
        }
    }
}
