//! The quadruped of AntMaze, and the game `ant` in which it learns to walk.
//!
//! [`AntBody`] moves exactly as D4RL's ant does in MuJoCo: free flight to the last printed digit, and contacts too, as
//! `tests/ant_golden.rs` shows. Its dynamics are written here, over joint coordinates, for lack of an engine that has
//! them. A hinge of this ant carries a rotor of 1 kg·m² while a limb has 0.01 kg·m². rapier's impulse joints with a
//! motor in the rotor's place reach 40 % of the right joint speed at 4 solver iterations and 75 % at 16. Its multibody
//! joints, which support rotors, let the ant rest at 0.49 m instead of 0.37 m and take ten times as long. rapier is
//! used here to hold floor and walls, find those nearby, and answer rays ([`Walls`]).
//!
//! The parts, from the bottom: [`skeleton`] has the measures and the state, [`kinematics`] the pose, [`dynamics`] the mass
//! matrix and the forces without contacts. [`contact`] finds contacts, [`constraint`] turns joint limits and contacts into
//! accelerations, [`body`] integrates. [`pilot`] is the shipped walking policy, [`view`] draws ants.

pub mod body;
pub mod constraint;
pub mod contact;
pub mod dynamics;
pub mod kinematics;
pub mod pilot;
pub mod skeleton;
pub mod view;
pub mod walk;

use crate::ant::{
    skeleton::{ACTUATED, JOINTS, joint_names, names},
    view::{AntPicturePlugin, VIEW},
    walk::{Task, Walker, key_bindings, observe, start_episode, steer, walk},
};
use bevy::prelude::*;
use bevy_playbot::vision::{Picture, VisionSystems};
use playbot_harness::{
    floor_plan::FloorPlan,
    game::{InputTools, LevelTools, PictureTools, StateTools},
    prelude::*,
};
use std::sync::{Arc, LazyLock};

pub use crate::ant::{
    body::{AntBody, PARTS, Part},
    contact::{WallBox, Walls},
    pilot::{Pilot, PilotError},
    skeleton::AntState,
};

/// Control steps per second.
pub const ANT_HZ: f64 = 10.0;

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
        world.get::<Walker>(agent).map(Walker::position)
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

/// Returns the names of an action's numbers, in order.
pub fn action_names() -> Vec<String> {
    let joints = joint_names();
    ACTUATED.iter().map(|&joint| joints[joint].clone()).collect()
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
