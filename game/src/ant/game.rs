//! The open floor as a game for training, evaluation and replay.

use std::sync::{Arc, LazyLock};

use bevy::prelude::*;
use bevy_playbot::vision::{Picture, VisionSystems};
use playbot_lab::prelude::*;
use playbot_lab::{
    floor_plan::FloorPlan,
    game::{InputTools, LevelTools, PictureTools, StateTools},
};

use super::{
    picture::AntPicturePlugin,
    sense::{joint_names, names},
    skeleton::{ACTUATED, JOINTS},
    steering::{key_bindings, steer},
    walk::{Task, Walker, observe, start_episode, walk},
};
use crate::ant::view::VIEW;

/// Control steps per second.
pub const ANT_HZ: f64 = 10.0;

/// Returns the names of an action's numbers, in order.
pub fn action_names() -> Vec<String> {
    let joints = joint_names();
    ACTUATED.iter().map(|&joint| joints[joint].clone()).collect()
}

/// The game `ant`: an open floor, goals in all directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ant;

static SPACE: LazyLock<Arc<ObservationSpace>> = LazyLock::new(|| Arc::new(ObservationSpace { names: names() }));

impl Game for Ant {
    fn name(&self) -> &'static str {
        "ant"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &Task::NAMES
    }

    fn tick_hz(&self) -> f64 {
        ANT_HZ
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Continuous(JOINTS)
    }

    fn observation(&self) -> ObservationSpace {
        (**SPACE).clone()
    }

    fn build(&self, app: &mut App, mode: &str) {
        app.add_plugins(AntPlugin { task: Task::named(mode).expect("callers check the mode against `modes`") });
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let agent = Agent::new(index, self.actions());
        world.spawn((agent, VectorSensor::from_space(SPACE.clone()), Walker::default())).id()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, state: self, pictures: self, input: self, ..GameTools::default() }
    }
}

impl LevelTools for Ant {
    fn floor_plan(&self, mode: &str, level: u64) -> Option<FloorPlan> {
        Task::named(mode)?.floor_plan(level)
    }
}

impl StateTools for Ant {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<Walker>(agent).map(Walker::place)
    }
}

impl PictureTools for Ant {
    fn picture(&self) -> Option<Picture> {
        Some(Picture { width: VIEW, least_height: 0.0 })
    }

    fn build_picture(&self, app: &mut App) {
        app.add_plugins(AntPicturePlugin);
    }

    fn has_space_view(&self) -> bool {
        true
    }

    #[cfg(feature = "view3d")]
    fn build_space_view(&self, app: &mut App) {
        app.add_plugins(crate::ant::view::SolidViewPlugin);
    }
}

impl InputTools for Ant {
    fn action_names(&self) -> Vec<String> {
        action_names()
    }

    fn key_bindings(&self) -> Option<KeyBindings> {
        Some(key_bindings())
    }
}

/// The tick of the ant, in `FixedUpdate`. Add what your game adds before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AntSystems;

/// Adds ants on an open floor.
#[derive(Clone, Copy, Debug)]
pub struct AntPlugin {
    /// The task of the ants.
    pub task: Task,
}

impl Plugin for AntPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(self.task)
            .add_observer(start_episode)
            .add_systems(ObserveSchedule, observe.before(VisionSystems::Sync))
            .add_systems(
                FixedPreUpdate,
                steer::<Walker>
                    .after(PlaybotSystems::Decide)
                    .before(PlaybotSystems::Act)
                    .run_if(resource_exists::<ButtonInput<KeyCode>>),
            )
            .add_systems(FixedUpdate, walk.in_set(AntSystems));
    }
}
