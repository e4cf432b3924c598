//! The parts for programs that train and test bots: Worlds that are driven tick by tick, on many threads, over many
//! episodes.
//!
//! A game that ships a bot needs none of them. [`playbot_harness`](https://docs.rs/playbot_harness) builds its Worlds
//! with them; a harness of your own can do the same. They are stable within a version of the plugin, and change with
//! less notice than the rest.
//!
//! | to | use |
//! |---|---|
//! | drive a World without an app | [`headless_frame_app`], [`into_world`], [`run_on_one_thread`], [`tick_world`] |
//! | begin an episode in a World as new | [`Renewal`], [`NextEpisode`], [`EpisodeSeeds`], [`LevelFiles`] |
//! | let other agents play along | [`PlaysAlong`], [`begin_beside`], [`OwnPolicy`] |
//! | find the tick of a game, whatever its frames | [`TickSchedules`], [`is_tick`], [`set_tick_rate`] |
//! | survive a game that panics or logs errors | [`panics`], [`system_errors`] |
//! | name the tick in which a game logs a message | [`tick_of_thread`], [`LevelTick`] |
//! | let frames wait for the assets of a game, and name them | [`deliver_between_frames`], [`wait_for_assets`], [`deliver_assets`], [`UnloadedAssets`] |
//! | let frames wait for the tasks of a game | [`TasksEndWithFrames`], [`wait_for_tasks`], [`tasks_in_order`] |
//! | name the level of a call that does not return | [`GameCall`], [`SlowCalls`], [`SlowCall`] |
//! | decide for many agents at once | [`PolicyBatch`], [`PolicyRows`], [`SharedBatch`], [`Playing`], [`draw_skills`] |
//! | keep systems in one order | [`put_in_order`], [`leave_open`], [`FaultSystems`], [`run_observe_schedule`] |
//! | check what agents see and do | [`check_actions`], [`check_observations`], [`misfit`], [`has_no_actions`], [`AgentLimit`] |
//! | compare two pictures of a state | [`PictureDifference`], [`CLOSE`], [`BlankEpisodes`] |
//! | record and replay | [`record_ticks`], [`flush_unfinished`] |
//! | read, join, select and repair recordings | [`find_demos`], [`merge_demos`], [`select_demos`], [`relabel_demo`], [`repeated_episodes`], [`repair()`] |
//! | read what a policy file sees | [`policy_observation`] |
//! | let a person play in a window | [`PressesForPeople`], [`TappedKeys`] |
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::engine::{into_world, tick_world};
//! use bevy_playbot::prelude::*;
//!
//! #[derive(Resource, Default)]
//! struct Ticks(u32);
//!
//! let mut app = headless_app();
//! app.init_resource::<Ticks>().add_systems(FixedUpdate, |mut ticks: ResMut<Ticks>| ticks.0 += 1);
//! let mut world = into_world(app);
//! tick_world(&mut world).expect("no system fails");
//! assert_eq!(world.resource::<Ticks>().0, 1);
//! ```

// Documented in their own modules, which are public.
#[doc(no_inline)]
pub use crate::{
    action::{check_actions, misfit},
    agent::{AgentLimit, PlaysAlong, has_no_actions},
    demo::{
        file::{find_demos, merge_demos, relabel_demo, repair::repair, repeated_episodes, select_demos},
        recorder::{flush_unfinished, record_ticks},
    },
    episode::{LevelTick, begin_beside, tick_of_thread},
    fault::FaultSystems,
    headless::{headless_frame_app, into_world, run_on_one_thread, set_tick_rate, tick_world},
    key_bindings::TappedKeys,
    level::LevelFiles,
    observation::check_observations,
    placement::{TickSchedules, is_tick},
    policy_file::policy_observation,
    skill_prior::draw_skills,
    streams::EpisodeSeeds,
    systems::{leave_open, put_in_order, run_observe_schedule},
    virtual_input::PressesForPeople,
    vision::{BlankEpisodes, CLOSE, PictureDifference},
};
// Documented here: games do not need their modules, which are private.
pub use crate::{
    calls::{GameCall, SlowCall, SlowCalls},
    loading::{
        TasksEndWithFrames, UnloadedAssets, deliver_assets, deliver_between_frames, tasks_in_order, wait_for_assets,
        wait_for_tasks,
    },
    own_policy::OwnPolicy,
    policy_batch::{Playing, PolicyBatch, PolicyRows, SharedBatch},
    renewal::{NextEpisode, Renewal},
};

/// Panics of a game: turned into faults, with a file that replays to the panic.
pub mod panics {
    pub use crate::panics::{
        EpisodeTrace, PanicReports, hear, lacks_render_app, note_actions, place_of_panic, refusal, refuse,
        report_at_once,
    };
}

/// Errors of systems in a headless World: reported as text instead of a panic.
pub mod system_errors {
    pub use crate::system_errors::{explain, take};
}
