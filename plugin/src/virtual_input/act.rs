//! From the actions of this tick to the inputs that are held down.

use bevy::{ecs::system::SystemParam, prelude::*};

use super::{
    axis::VirtualAxis,
    button::VirtualButton,
    claims::is_virtual,
    component::VirtualInput,
    devices::{Change, Push, VirtualDevices, Wanted},
    direct::DirectInput,
    gamepad::VirtualGamepad,
    input_state::{InputState, Switch, Touch},
    messages::InputMessages,
    person::PressesForPeople,
    route::InputRoute,
};
use crate::{action::Action, agent::AgentOrder, control::Control, episode::Episode};

/// The gamepad of each agent.
pub(super) type Pads<'w, 's> = Query<'w, 's, (Entity, &'static VirtualGamepad)>;

/// The agents that virtual input plays for.
pub(super) type Players<'w, 's> =
    Query<'w, 's, (&'static VirtualInput, &'static Action, &'static Control, &'static Episode, Has<PressesForPeople>)>;

/// Returns the inputs that all agents hold and push in this tick. Inputs of a gamepad wait until it is plugged in.
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
                wanted.switches.push((agent, Switch { button, pad: pad.filter(|_| is_pad) }));
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

/// Sends messages on route [`Messages`](InputRoute::Messages); Bevy's own systems do the rest in this frame.
pub(super) fn send_messages(
    order: Res<AgentOrder>,
    players: Players,
    pads: Pads,
    state: InputState,
    mut devices: ResMut<VirtualDevices>,
    mut messages: InputMessages,
) {
    let wanted = wanted(&order, &players, &pads, &state);
    for change in devices.change(&wanted, |switch| switch.pad.is_some() || state.is_down(switch)) {
        messages.send(change);
    }
    messages.send_motion(wanted.motion, wanted.wheel);
}

/// The parameters for releasing an agent's inputs.
#[derive(SystemParam)]
pub(super) struct InputReleaser<'w, 's> {
    devices: ResMut<'w, VirtualDevices>,
    direct: ResMut<'w, DirectInput>,
    state: InputState<'w, 's>,
    messages: InputMessages<'w, 's>,
}

impl InputReleaser<'_, '_> {
    /// Releases the agent's inputs, as if they had never been pressed. A key that was down at the end of an episode
    /// must not affect the next one.
    pub(super) fn release(&mut self, agent: Entity, route: InputRoute) {
        for change in self.devices.release_agent(agent) {
            let before = change.read(&self.state);
            match change {
                Change::Button { switch, .. } => {
                    self.state.touch(switch, Touch::Reset);
                    self.direct.forget(switch);
                }
                Change::Axis { pad, axis, value } => {
                    if let Some((switch, _)) = self.state.set_axis(pad, axis, value) {
                        self.state.touch(switch, Touch::Settle);
                    }
                }
            }
            let after = change.read(&self.state);
            match route {
                InputRoute::Messages => self.messages.send_and_tell(change, before, after),
                InputRoute::Direct => self.messages.tell(change, before, after),
            }
        }
    }
}
