//! Conversion of the actions of this tick into the inputs that are held down.

use crate::{
    action::Action,
    agent::{AgentOrder, Control},
    episode::Episode,
    virtual_input::{
        InputRoute, PressesForPeople, VirtualInput,
        button::{VirtualAxis, VirtualButton},
        claims::is_virtual,
        devices::{Change, Push, VirtualDevices, Wanted},
        input_state::{InputState, Switch, Touch},
        messages::{InputMessages, VirtualGamepad},
    },
};
use bevy::{ecs::system::SystemParam, prelude::*};

/// The gamepad of each agent.
pub(super) type Pads<'w, 's> = Query<'w, 's, (Entity, &'static VirtualGamepad)>;

/// The agents that virtual input plays for.
pub(super) type Players<'w, 's> =
    Query<'w, 's, (&'static VirtualInput, &'static Action, &'static Control, &'static Episode, Has<PressesForPeople>)>;

/// Returns the inputs that all agents hold and push in this tick. Inputs of a gamepad wait until it is plugged in. In a
/// minimised window nothing is clicked, because the cursor would still be at an old position.
pub(super) fn wanted(
    order: &AgentOrder,
    players: &Players,
    pads: &Pads,
    state: &InputState,
    is_minimised: bool,
) -> Wanted {
    let mut wanted = Wanted::default();
    for &agent in order.entities() {
        let Ok((input, action, control, episode, for_people)) = players.get(agent) else { continue };
        if !is_virtual(*control, for_people) || !episode.is_running() {
            continue;
        }
        let pad = pads.iter().find(|(_, owner)| owner.agent == agent).map(|(pad, _)| pad);
        let pad = pad.filter(|pad| state.is_connected(*pad));
        let held = input.held(&action.0);
        wanted.agents.push(agent);
        wanted.cursor = held.cursor.map(|position| (agent, position)).or(wanted.cursor);
        wanted.tap = held.tap.map(|position| (agent, position)).or(wanted.tap);
        wanted.text.push_str(&held.text);
        let misses = is_minimised && held.cursor.is_some();
        let is_mouse = |button: &VirtualButton| matches!(button, VirtualButton::Mouse(_));
        for button in held.buttons.into_iter().filter(|button| !(misses && is_mouse(button))) {
            let is_pad = matches!(button, VirtualButton::Gamepad(_));
            if !is_pad || pad.is_some() {
                let switch = Switch { button, pad: pad.filter(|_| is_pad) };
                wanted.switches.push((agent, switch));
                if held.clicks && is_mouse(&button) {
                    wanted.anew.push((agent, switch));
                }
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
    let wanted = wanted(&order, &players, &pads, &state, messages.is_minimised());
    let changes = devices.change(&wanted, |switch| switch.pad.is_some() || state.is_down(switch));
    let (released, others) = releases_first(changes);
    released.into_iter().for_each(|change| messages.send(change));
    messages.point(&mut devices, &wanted);
    others.into_iter().for_each(|change| messages.send(change));
    messages.send_text(&wanted.text);
    messages.send_motion(wanted.motion, wanted.wheel);
}

/// Splits changes into released buttons and the others. A mouse button is released before the cursor moves, and
/// pressed afterwards.
fn releases_first(changes: Vec<Change>) -> (Vec<Change>, Vec<Change>) {
    changes.into_iter().partition(|change| matches!(change, Change::Button { down: false, .. }))
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
                InputRoute::Messages => self.messages.send_with_processed(change, before, after),
                InputRoute::Direct => self.messages.send_processed(change, before, after),
            }
        }
        self.messages.leave(&mut self.devices, agent);
    }
}

// Route `Direct`: the state that games read is written in the fixed tick itself.

/// Marks and motions of this tick and of this frame.
///
/// Bevy clears `just_pressed` once a frame. A frame may run several fixed ticks, or none, and each tick must see a
/// press exactly once. So the marks of the tick before are removed before each tick. The marks of all ticks of the
/// frame are restored after the last one, for systems in `Update`. Messages are sent as well, for games that read
/// them. In the next frame, Bevy's systems process them a second time, and that effect is undone there.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct DirectInput {
    tick: Marks,
    frame: Marks,
    /// Ticks that this frame has run.
    ticks: u32,
    /// Buttons with messages on their way to Bevy's systems.
    sent: Vec<(Switch, bool)>,
    /// Motion with messages on their way.
    sent_motion: Motion,
}

/// The marks of a span of time.
#[derive(Clone, Debug, Default, Reflect)]
struct Marks {
    down: Vec<Switch>,
    up: Vec<Switch>,
    motion: Motion,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
struct Motion {
    mouse: Vec2,
    wheel: Vec2,
}

impl Motion {
    fn add(&mut self, other: Self) {
        self.mouse += other.mouse;
        self.wheel += other.wheel;
    }
}

impl Marks {
    fn note(&mut self, switch: Switch, down: bool) {
        let list = if down { &mut self.down } else { &mut self.up };
        if !list.contains(&switch) {
            list.push(switch);
        }
    }
}

impl DirectInput {
    /// Drops the marks of a button that was released for good.
    pub fn forget(&mut self, switch: Switch) {
        for marks in [&mut self.tick, &mut self.frame] {
            marks.down.retain(|marked| *marked != switch);
            marks.up.retain(|marked| *marked != switch);
        }
    }

    fn note(&mut self, switch: Switch, down: bool) {
        self.tick.note(switch, down);
        self.frame.note(switch, down);
        if switch.pad.is_none() {
            self.sent.retain(|(sent, _)| *sent != switch);
            self.sent.push((switch, down));
        }
    }
}

/// Writes the state in each fixed tick.
pub(super) fn write_directly(
    order: Res<AgentOrder>,
    players: Players,
    pads: Pads,
    mut state: InputState,
    mut direct: ResMut<DirectInput>,
    mut devices: ResMut<VirtualDevices>,
    mut messages: InputMessages,
) {
    let past = std::mem::take(&mut direct.tick);
    for &switch in past.down.iter().chain(&past.up) {
        state.touch(switch, Touch::Settle);
    }
    let wanted = wanted(&order, &players, &pads, &state, messages.is_minimised());
    let (released, others) = releases_first(devices.change(&wanted, |switch| state.is_down(switch)));
    for change in released {
        write_change(change, &mut state, &mut direct, &mut messages);
    }
    messages.point(&mut devices, &wanted);
    for change in others {
        write_change(change, &mut state, &mut direct, &mut messages);
    }
    messages.send_text(&wanted.text);
    let now = Motion { mouse: wanted.motion, wheel: wanted.wheel };
    if now != Motion::default() || past.motion != Motion::default() {
        move_by(&mut state, past.motion, now);
    }
    messages.send_motion(now.mouse, now.wheel);
    direct.ticks += 1;
    direct.tick.motion = now;
    direct.frame.motion.add(now);
    direct.sent_motion.add(now);
}

/// Writes a change into the state that games read, and sends its messages.
fn write_change(change: Change, state: &mut InputState, direct: &mut DirectInput, messages: &mut InputMessages) {
    let before = change.read(state);
    match change {
        Change::Button { switch, down } => {
            state.touch(switch, if down { Touch::Press } else { Touch::Release });
            direct.note(switch, down);
        }
        Change::Axis { pad, axis, value } => {
            if let Some((switch, down)) = state.set_axis(pad, axis, value) {
                direct.note(switch, down);
            }
        }
    }
    messages.send_processed(change, before, change.read(state));
}

/// Shows `Update` everything that happened in the frame, after its last fixed tick.
pub(super) fn show_frame(mut state: InputState, mut direct: ResMut<DirectInput>) {
    let frame = std::mem::take(&mut direct.frame);
    if std::mem::take(&mut direct.ticks) < 2 {
        return;
    }
    for &switch in frame.down.iter().chain(frame.up.iter().filter(|switch| !frame.down.contains(switch))) {
        let (pressed, released) = (frame.down.contains(&switch), frame.up.contains(&switch));
        state.touch(switch, Touch::Flag { pressed, released });
        // The next tick removes them again, in whatever frame it falls.
        direct.tick.note(switch, pressed);
        direct.tick.note(switch, !released);
    }
    if frame.motion != direct.tick.motion {
        move_by(&mut state, direct.tick.motion, frame.motion);
        direct.tick.motion = frame.motion;
    }
}

/// Undoes the effect of messages about past ticks. Runs among Bevy's own input systems.
pub(super) fn settle(mut state: InputState, mut direct: ResMut<DirectInput>, devices: Res<VirtualDevices>) {
    for (switch, _) in std::mem::take(&mut direct.sent) {
        let is_held = devices.held().any(|(_, button)| button == switch.button);
        state.touch(switch, if is_held { Touch::Press } else { Touch::Release });
        state.touch(switch, Touch::Settle);
    }
    let sent = std::mem::take(&mut direct.sent_motion);
    if sent != Motion::default() {
        move_by(&mut state, sent, Motion::default());
    }
    // Bevy has reset the motion of the frame before.
    direct.tick.motion = Motion::default();
}

/// Replaces one motion by another in the state that games read.
fn move_by(state: &mut InputState, from: Motion, to: Motion) {
    state.motion.delta = state.motion.delta - from.mouse + to.mouse;
    state.scroll.delta = state.scroll.delta - from.wheel + to.wheel;
}
