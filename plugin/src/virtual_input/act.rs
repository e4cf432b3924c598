//! From the actions of this tick to what is held down.

use bevy::prelude::*;

use super::{
    axis::VirtualAxis,
    button::VirtualButton,
    claims::is_virtual,
    component::VirtualInput,
    devices::{Push, VirtualDevices, Wanted},
    direct::DirectInput,
    gamepad::VirtualGamepad,
    input_state::{InputState, Line, Touch},
    messages::InputMessages,
    person::PressesForPeople,
};
use crate::{
    action::Action,
    agent::AgentOrder,
    control::Control,
    episode::{Episode, EpisodeEnded, StartEpisode},
};

/// The gamepad of each agent.
pub(super) type Pads<'w, 's> = Query<'w, 's, (Entity, &'static VirtualGamepad)>;

/// The agents that virtual input plays for.
pub(super) type Players<'w, 's> =
    Query<'w, 's, (&'static VirtualInput, &'static Action, &'static Control, &'static Episode, Has<PressesForPeople>)>;

/// What all agents want to hold and push in this tick. What a gamepad does waits until it is plugged in.
pub(super) fn wanted(order: &AgentOrder, players: &Players, pads: &Pads, state: &InputState) -> Wanted {
    let mut wanted = Wanted::default();
    for &agent in order.entities() {
        let Ok((input, action, control, episode, for_people)) = players.get(agent) else { continue };
        if !is_virtual(*control, for_people) || !episode.is_running() {
            continue;
        }
        let pad = pads.iter().find(|(_, owner)| owner.agent == agent).map(|(pad, _)| pad);
        let pad = pad.filter(|pad| state.is_connected(*pad));
        let held = input.held(&action.0);
        for button in held.buttons {
            let is_pad = matches!(button, VirtualButton::Gamepad(_));
            if !is_pad || pad.is_some() {
                wanted.lines.push((agent, Line { button, pad: pad.filter(|_| is_pad) }));
            }
        }
        for (axis, value) in held.axes {
            match (axis, pad) {
                (VirtualAxis::MouseX, _) => wanted.motion.x += value,
                (VirtualAxis::MouseY, _) => wanted.motion.y += value,
                (VirtualAxis::WheelX, _) => wanted.wheel.x += value,
                (VirtualAxis::WheelY, _) => wanted.wheel.y += value,
                (_, Some(pad)) => wanted.pushes.push(Push { agent, pad, axis, value }),
                (_, None) => {}
            }
        }
    }
    wanted
}

/// Route [`Messages`](super::InputRoute::Messages): Bevy's own systems do the rest in this frame.
pub(super) fn send_messages(
    order: Res<AgentOrder>,
    players: Players,
    pads: Pads,
    state: InputState,
    mut devices: ResMut<VirtualDevices>,
    mut messages: InputMessages,
) {
    let wanted = wanted(&order, &players, &pads, &state);
    for change in devices.change(&wanted, |line| line.pad.is_some() || state.is_down(line)) {
        messages.send(change);
    }
    messages.send_motion(wanted.motion, wanted.wheel);
}

/// Lets go of everything at the start of an episode, so that it begins with nothing held.
pub(super) fn release_at_start(event: On<StartEpisode>, mut hands: Hands) {
    hands.release(event.entity);
}

/// Lets go of everything at the end of an episode.
pub(super) fn release_at_end(event: On<EpisodeEnded>, mut hands: Hands) {
    hands.release(event.entity);
}

/// What it takes to let go.
#[derive(bevy::ecs::system::SystemParam)]
pub(super) struct Hands<'w, 's> {
    devices: ResMut<'w, VirtualDevices>,
    direct: ResMut<'w, DirectInput>,
    state: InputState<'w, 's>,
    messages: InputMessages<'w, 's>,
}

impl Hands<'_, '_> {
    /// Lets go of what the agent holds, as if it had never been pressed: whether the episode before ended with a key down
    /// must not be seen in the next one.
    fn release(&mut self, agent: Entity) {
        use super::devices::Change;
        for change in self.devices.release_agent(agent) {
            match change {
                Change::Button { line, .. } => {
                    self.state.touch(line, Touch::Reset);
                    self.direct.forget(line);
                }
                Change::Axis { pad, axis, value } => {
                    if let Some((line, _)) = self.state.set_axis(pad, axis, value) {
                        self.state.touch(line, Touch::Settle);
                    }
                }
            }
            self.messages.send(change);
        }
    }
}
