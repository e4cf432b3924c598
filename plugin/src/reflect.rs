//! Inspection: the components and resources of every app with agents are known to Bevy's type registry.

use bevy::prelude::*;

use crate::{
    agent::{Agent, AgentOrder},
    bot::BlindBot,
    control::Control,
    demo::{
        recorder::{Recorder, Recording},
        replay::Replay,
    },
    fault::{FaultOccurred, Faults},
    key_bindings::KeyBindings,
    level::LevelQueue,
    reward::Reward,
    state_hash::StateHash,
    tick::Tick,
};

pub(crate) fn plugin(app: &mut App) {
    app.register_type::<Agent>()
        .register_type::<AgentOrder>()
        .register_type::<BlindBot>()
        .register_type::<Control>()
        .register_type::<FaultOccurred>()
        .register_type::<Faults>()
        .register_type::<KeyBindings>()
        .register_type::<LevelQueue>()
        .register_type::<Recorder>()
        .register_type::<Recording>()
        .register_type::<Replay>()
        .register_type::<Reward>()
        .register_type::<StateHash>()
        .register_type::<Tick>();
}
