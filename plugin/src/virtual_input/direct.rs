//! Route Direct: what games read is written in the fixed tick itself.
//!
//! Bevy clears `just_pressed` once a frame. A frame may run several fixed ticks, or none, and each tick must see a press
//! exactly once. So the marks of the tick before are taken away before each tick, and those of all ticks of the frame are
//! put back after the last one, for systems in `Update`. Messages are sent as well, for games that read them; what Bevy's
//! systems make of them in the next frame has happened already, and is taken back there.

use bevy::prelude::*;

use super::{
    act::{Pads, Players, wanted},
    devices::{Change, VirtualDevices},
    input_state::{InputState, Line, Touch},
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
    /// Buttons about which messages are on their way to Bevy's systems.
    sent: Vec<(Line, bool)>,
    /// Motion about which messages are on their way.
    sent_motion: Motion,
}

/// What happened in a span of time.
#[derive(Clone, Debug, Default, Reflect)]
struct Marks {
    down: Vec<Line>,
    up: Vec<Line>,
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
    fn note(&mut self, line: Line, down: bool) {
        let list = if down { &mut self.down } else { &mut self.up };
        if !list.contains(&line) {
            list.push(line);
        }
    }
}

impl DirectInput {
    /// Drops the marks of a button that was let go of for good.
    pub fn forget(&mut self, line: Line) {
        for marks in [&mut self.tick, &mut self.frame] {
            marks.down.retain(|marked| *marked != line);
            marks.up.retain(|marked| *marked != line);
        }
    }

    fn note(&mut self, line: Line, down: bool) {
        self.tick.note(line, down);
        self.frame.note(line, down);
        if line.pad.is_none() {
            self.sent.retain(|(sent, _)| *sent != line);
            self.sent.push((line, down));
        }
    }
}

/// In each fixed tick.
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
    for &line in past.down.iter().chain(&past.up) {
        state.touch(line, Touch::Settle);
    }
    let wanted = wanted(&order, &players, &pads, &state);
    for change in devices.change(&wanted, |line| state.is_down(line)) {
        match change {
            Change::Button { line, down } => {
                state.touch(line, if down { Touch::Press } else { Touch::Release });
                direct.note(line, down);
                if line.pad.is_none() {
                    messages.send(change);
                }
            }
            Change::Axis { pad, axis, value } => {
                if let Some((line, down)) = state.set_axis(pad, axis, value) {
                    direct.note(line, down);
                }
            }
        }
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

/// After the last fixed tick of a frame: `Update` sees everything that happened in the frame.
pub(super) fn show_frame(mut state: InputState, mut direct: ResMut<DirectInput>) {
    let frame = std::mem::take(&mut direct.frame);
    if std::mem::take(&mut direct.ticks) < 2 {
        return;
    }
    for &line in frame.down.iter().chain(frame.up.iter().filter(|line| !frame.down.contains(line))) {
        let (pressed, released) = (frame.down.contains(&line), frame.up.contains(&line));
        state.touch(line, Touch::Flag { pressed, released });
        // The next tick takes them away again, wherever it falls.
        direct.tick.note(line, pressed);
        direct.tick.note(line, !released);
    }
    if frame.motion != direct.tick.motion {
        move_by(&mut state, direct.tick.motion, frame.motion);
        direct.tick.motion = frame.motion;
    }
}

/// Among Bevy's own input systems: what they made of messages about the past is taken back.
pub(super) fn settle(mut state: InputState, mut direct: ResMut<DirectInput>, devices: Res<VirtualDevices>) {
    for (line, _) in std::mem::take(&mut direct.sent) {
        let is_held = devices.held().any(|(_, button)| button == line.button);
        state.touch(line, if is_held { Touch::Press } else { Touch::Release });
        state.touch(line, Touch::Settle);
    }
    let sent = std::mem::take(&mut direct.sent_motion);
    if sent != Motion::default() {
        move_by(&mut state, sent, Motion::default());
    }
    // Bevy has forgotten the motion of the frame before.
    direct.tick.motion = Motion::default();
}

/// Replaces one motion by another in what games read.
fn move_by(state: &mut InputState, from: Motion, to: Motion) {
    state.motion.delta = state.motion.delta - from.mouse + to.mouse;
    state.scroll.delta = state.scroll.delta - from.wheel + to.wheel;
}
