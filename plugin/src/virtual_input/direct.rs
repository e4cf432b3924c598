//! The route [`Direct`](super::InputRoute::Direct): the state that games read is written in the fixed tick itself.
//!
//! Bevy clears `just_pressed` once a frame. A frame may run several fixed ticks, or none, and each tick must see a
//! press exactly once. So the marks of the tick before are removed before each tick. The marks of all ticks of the
//! frame are restored after the last one, for systems in `Update`. Messages are sent as well, for games that read
//! them. In the next frame, Bevy's systems process them a second time, and that effect is undone there.

use bevy::prelude::*;

use super::{
    act::{Pads, Players, wanted},
    devices::{Change, VirtualDevices},
    input_state::{InputState, Switch, Touch},
    messages::InputMessages,
};
use crate::agent::AgentOrder;

/// Marks and motions of this tick and of this frame.
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
    let wanted = wanted(&order, &players, &pads, &state);
    for change in devices.change(&wanted, |switch| state.is_down(switch)) {
        let before = change.read(&state);
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
        messages.tell(change, before, change.read(&state));
    }
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
