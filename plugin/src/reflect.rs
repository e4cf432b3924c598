//! Inspection: the components and resources of every app with agents are known to Bevy's type registry.

use bevy::prelude::*;

use crate::{
    agent::{Agent, AgentLimit, AgentOrder},
    bot::BlindBot,
    control::Control,
    demo::{
        recorder::{Recorder, Recording},
        replay::Replay,
    },
    fault::{FaultOccurred, Faults},
    key_bindings::KeyBindings,
    level::LevelQueue,
    panics::{EpisodeTrace, PanicReports},
    placement::{FrameGate, TickSchedules},
    renewal::Renewal,
    reward::Reward,
    state_hash::StateHash,
    tick::Tick,
};

pub(crate) fn plugin(app: &mut App) {
    app.register_type::<Agent>()
        .register_type::<AgentLimit>()
        .register_type::<AgentOrder>()
        .register_type::<BlindBot>()
        .register_type::<Control>()
        .register_type::<EpisodeTrace>()
        .register_type::<FaultOccurred>()
        .register_type::<Faults>()
        .register_type::<FrameGate>()
        .register_type::<KeyBindings>()
        .register_type::<LevelQueue>()
        .register_type::<PanicReports>()
        .register_type::<Recorder>()
        .register_type::<Recording>()
        .register_type::<Renewal>()
        .register_type::<Replay>()
        .register_type::<Reward>()
        .register_type::<StateHash>()
        .register_type::<Tick>()
        .register_type::<TickSchedules>();
}
