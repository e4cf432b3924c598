//! The position of a tick within a frame, and the frames that have one.
//!
//! ```
//! use bevy::{prelude::*, time::TimePlugin};
//! use bevy_playbot::{engine::{TickSchedules, set_tick_rate}, prelude::*};
//!
//! #[derive(Resource, Default)]
//! struct Judged(u32);
//!
//! /// Works for both placements: the app knows the end of its ticks.
//! fn count_ticks(app: &mut App) {
//!     let judge = TickSchedules::of(app).judge;
//!     app.init_resource::<Judged>()
//!         .add_systems(judge, (|mut judged: ResMut<Judged>| judged.0 += 1).in_set(PlaybotSystems::Judge));
//! }
//!
//! for placement in [TickPlacement::Fixed, TickPlacement::Frame] {
//!     let mut app = App::new();
//!     app.add_plugins((TimePlugin, PlaybotPlugin { placement }));
//!     set_tick_rate(&mut app, 60.0);
//!     count_ticks(&mut app);
//!     app.ticks(5).expect("no agent broke its contract");
//!     assert_eq!(app.world().resource::<Judged>().0, 5);
//! }
//! ```

use crate::{
    agent::{Agent, Control},
    episode::{Episode, Tick},
};
use bevy::{
    ecs::schedule::{InternedScheduleLabel, ScheduleLabel},
    prelude::*,
};

/// The extent of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum TickPlacement {
    /// One run of Bevy's fixed schedules: agents decide in `FixedPreUpdate`, and outcomes are
    /// counted in `FixedPostUpdate`. For games that know the plugin and simulate in `FixedUpdate`.
    #[default]
    Fixed,
    /// One whole frame of a fixed length: agents decide in `PreUpdate`, before Bevy's own input,
    /// and outcomes are counted in `Last`. For games that do not know the plugin, in any schedules.
    Frame,
}

/// The schedules in which the parts of a tick run. [`PlaybotPlugin`](crate::plugin::PlaybotPlugin)
/// inserts it; use it to add systems to a [`PlaybotSystems`](crate::systems::PlaybotSystems) set.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct TickSchedules {
    /// The extent of a tick.
    pub placement: TickPlacement,
    /// Schedule of `Begin` to `Act`.
    pub decide: InternedScheduleLabel,
    /// Schedule of `Judge` to `Reset`.
    pub judge: InternedScheduleLabel,
}

impl TickSchedules {
    /// Returns the schedules of a placement.
    pub fn new(placement: TickPlacement) -> Self {
        let (decide, judge) = match placement {
            TickPlacement::Fixed => (FixedPreUpdate.intern(), FixedPostUpdate.intern()),
            TickPlacement::Frame => (PreUpdate.intern(), Last.intern()),
        };
        Self { placement, decide, judge }
    }

    /// Returns the schedules of an app; before it has the plugin, the fixed ones.
    pub fn of(app: &App) -> Self {
        app.world().get_resource().copied().unwrap_or(Self::new(TickPlacement::Fixed))
    }
}

/// The frames that are ticks, under [`TickPlacement::Frame`]. The first frame only starts the
/// clock, and a frame in which an agent waits for its level is no tick.
#[derive(Resource, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct FrameGate {
    frames: u64,
    is_tick: bool,
}

pub(crate) fn begin_frame(mut gate: ResMut<FrameGate>) {
    gate.frames += 1;
    gate.is_tick = false;
}

/// Returns whether agents may be given levels in this frame.
pub(crate) fn has_begun(gate: Res<FrameGate>) -> bool {
    gate.frames > 1
}

/// Returns whether this frame is a tick, as a run condition. Always true under
/// [`TickPlacement::Fixed`], where systems run only in ticks.
pub fn is_tick(gate: Option<Res<FrameGate>>) -> bool {
    gate.is_none_or(|gate| gate.is_tick)
}

/// Opens the gate and counts the tick, unless an agent waits for a level.
pub(crate) fn open_gate(
    agents: Query<(&Control, &Episode), With<Agent>>,
    mut gate: ResMut<FrameGate>,
    mut tick: ResMut<Tick>,
) {
    gate.is_tick = !agents.iter().any(|(control, episode)| control.is_active() && episode.is_loading());
    tick.0 += u64::from(gate.is_tick);
}
