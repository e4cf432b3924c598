//! Building a level as entities.

use crate::{
    ant::{
        AntBody, AntState,
        skeleton::joint_names,
        walk::{AntComponent, torques},
    },
    antmaze::{
        geometry::{cell_at, distance, wall_boxes},
        level::{AntMazeLevel, generate},
        mode::{AntMazeMode, Pay},
    },
    maze::MazeModeError,
};
use bevy::{ecs::system::SystemParam, math::ops, prelude::*};
use bevy_playbot::fault::Faults;
use playbot_harness::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files},
    prelude::*,
};
use std::sync::Arc;

/// Makes the level of an episode and puts the agent's ant into it.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    levels: Levels,
    agents: Query<&Agent, With<PlaysIn>>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok(agent) = agents.get(event.entity) else { return };
    match levels.get(event.level) {
        Ok(level) => build(&mut commands, event.entity, level),
        Err(error) => {
            faults.report(format!("agent {}, level {}: {error}", agent.index, event.level));
            commands.entity(event.entity).insert(Control::Idle);
        }
    }
}

/// Puts an agent with a new ant into a level. The physics begins anew with every episode, so earlier episodes change
/// nothing, not even the order in which contacts are solved.
fn build(commands: &mut Commands, agent: Entity, level: Arc<AntMazeLevel>) {
    let mut body = AntBody::new(&wall_boxes(&level.maze));
    body.set_state(&level.reset);
    commands.entity(agent).insert((MazeAnt(body), InMaze(level)));
}

// The game as entities.

/// Mode of the generated levels.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct AntMazeRules(pub AntMazeMode);

/// The level of an agent, inserted with its first episode.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct InMaze(pub Arc<AntMazeLevel>);

/// An agent's ant with the floor and the walls around it: a physics world of its own. Inserted with the first episode.
#[derive(Component, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub struct MazeAnt(pub AntBody);

impl AntComponent for MazeAnt {
    fn state(&self) -> AntState {
        self.0.state()
    }
}

/// The arena of an agent: the drawings around it belong to this entity.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct PlaysIn(pub Entity);

// Levels of a mode, from a seed or from a file.

/// The levels of a World.
#[derive(SystemParam)]
pub(super) struct Levels<'w> {
    rules: Res<'w, AntMazeRules>,
    designs: Option<Res<'w, LevelDesigns>>,
}

impl Levels<'_> {
    /// Returns a level, or an explanation why there is none.
    pub fn get(&self, level: u64) -> Result<Arc<AntMazeLevel>, String> {
        match &self.designs {
            Some(designs) => designs.get(level),
            None => generated(&self.rules.0, level),
        }
    }
}

/// Returns a level of a mode that has been checked, or an explanation why there is none.
pub(super) fn level_of(game: &dyn Game, mode: &str, level: u64) -> Result<Arc<AntMazeLevel>, String> {
    if is_level_files(mode) {
        let designs = level_designs(game, mode);
        return designs.map_err(|error| error.to_string())?.get(level);
    }
    generated(&mode.parse().map_err(|error: MazeModeError| error.to_string())?, level)
}

fn generated(mode: &AntMazeMode, level: u64) -> Result<Arc<AntMazeLevel>, String> {
    generate(mode, level).map(Arc::new).map_err(|error| error.to_string())
}

// The tick of every arena.

/// Distance at which an ant has reached the goal, metres.
pub const GOAL_RADIUS: f32 = 0.5;

/// Possible heights of the middle of a torso, metres: between the floor and the reach of a jump.
const HEIGHTS: std::ops::Range<f32> = 0.0..20.0;

/// Computes physics, reward and end for every ant whose agent plays.
pub(super) fn play(
    mut ants: Query<(&Agent, &mut Control, &Action, &InMaze, &mut MazeAnt, &mut Episode, &mut Reward, &mut StateHash)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, mut control, action, level, mut ant, mut episode, mut reward, mut hash) in &mut ants {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        ant.0.step(&torques(action, &mut episode));
        let state = ant.0.state();
        if let Some(why) = astray(&state, &level.0) {
            faults.report(format!("{}: {why}", episode.moment(agent)));
            *control = Control::Idle;
            continue;
        }
        let away = distance([state.qpos[0], state.qpos[1]], level.0.goal_at);
        *hash = state.hash();
        reward.add(pay(level.0.pay, away));
        if away <= GOAL_RADIUS {
            match level.0.pay {
                // An episode that pays for every tick would never be ended.
                Pay::Exponential => episode.reach(),
                Pay::Distance | Pay::Sparse => episode.terminate(true),
            }
        }
        if episode.tick + 1 >= level.0.limit {
            episode.truncate();
        }
    }
}

/// Returns the reward of a tick that ends at this distance from the goal, in metres.
pub(super) fn pay(pay: Pay, away: f32) -> f32 {
    match pay {
        Pay::Distance => -away,
        Pay::Exponential => ops::exp(-away),
        Pay::Sparse => f32::from(u8::from(away <= GOAL_RADIUS)),
    }
}

/// Explains why an ant's position is impossible, if it is.
fn astray(state: &AntState, level: &AntMazeLevel) -> Option<String> {
    if !state.is_finite() {
        let mut named = names().into_iter().zip(values(state));
        let (name, value) = named.find(|(_, value)| !value.is_finite())?;
        return Some(format!("the ant's `{name}` is {value}: its physics has failed"));
    }
    let [x, y, z, ..] = state.qpos;
    let inside = cell_at(&level.maze, [x, y]).is_some() && HEIGHTS.contains(&z);
    (!inside).then(|| format!("the ant is at ({x}, {y}, {z}), outside the maze: its physics has failed"))
}

/// Fills the vector of every playing agent that reads one.
pub(super) fn observe(mut ants: Query<(&Episode, &MazeAnt, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, mut observation) in &mut ants {
        if episode.is_running() {
            observation.set(values(&ant.0.state()));
        }
    }
}

// Observation of an agent: the ant's own state, in the order of the original, without goal and walls.

/// Returns the names of the values.
pub fn names() -> Vec<String> {
    let axes = |of: &'static str, axes: &[&'static str]| axes.iter().map(move |axis| format!("{of} {axis}")).collect();
    let joints = |what: &'static str| joint_names().iter().map(|joint| format!("{joint} {what}")).collect();
    let groups: [Vec<String>; 6] = [
        ["x", "y", "z"].map(str::to_owned).into(),
        axes("quaternion", &["w", "x", "y", "z"]),
        joints("angle"),
        axes("velocity", &["x", "y", "z"]),
        axes("spin", &["x", "y", "z"]),
        joints("velocity"),
    ];
    groups.concat()
}

/// Returns the values in the order of [`names`]: metres, a unit quaternion, radians, metres and radians per second. The
/// velocity is along the world's axes, the spin along the torso's.
pub fn values(state: &AntState) -> impl Iterator<Item = f32> {
    state.qpos.into_iter().chain(state.qvel)
}
