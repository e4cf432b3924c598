//! The items that almost every game with agents needs.
//!
//! ```
//! use bevy_playbot::prelude::*;
//!
//! let mut app = headless_app();
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform));
//! app.ticks(10).expect("no agent broke its contract");
//! ```

pub use crate::{
    action::{Action, ActionSpace, ActionValue},
    agent::{Agent, Control},
    bot::BlindBot,
    demo::{
        recorder::{Recorder, Recording},
        replay::Replay,
    },
    entities::EntitySensor,
    episode::{Episode, EpisodeCount, EpisodeEnd, EpisodeEnded, StartEpisode},
    headless::{PlaybotAppExt, headless_app},
    key_bindings::{KeyAxis, KeyBindings},
    level::{LevelQueue, LevelSource},
    observation::{Observation, ObservationSpace, VectorSensor},
    placement::TickPlacement,
    plugin::{PlaybotPlugin, PlaybotPlugins},
    policy::{ActionDraw, ActivePolicy},
    reward::Reward,
    skill_prior::{ActiveSkill, SkillPrior},
    state_hash::StateHash,
    streams::PlaybotSeed,
    systems::{ObserveSchedule, PlaybotSystems},
    virtual_input::{VirtualInput, VirtualInputPlugin},
};
