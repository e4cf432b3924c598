//! Building a level as entities.

use crate::{
    maze::MazeModeError,
    maze2d::{
        ball::{Ball, clip_action},
        level::Maze2dLevel,
        level_text::DrawnLevel,
        mode::{ContactModel, Maze2dMode},
        physics::MazePhysics,
        sim::{hash_state, is_at_goal, reward, step_rapier, step_soft},
    },
};
use bevy::{ecs::system::SystemParam, prelude::*};
use bevy_playbot::fault::Faults;
use playbot_harness::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files},
    prelude::*,
};
use std::sync::Arc;

/// Every arena has a physics context, even if the contact is not rapier's.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
pub(super) struct WithPhysics(pub bool);

/// Makes the level of an episode and puts it into the agent's arena.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    levels: Levels,
    with_physics: Res<WithPhysics>,
    players: Query<(&Agent, &PlaysIn)>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok((agent, plays_in)) = players.get(event.entity) else { return };
    let (level, rules) = match levels.get(event.level) {
        Ok(found) => found,
        Err(error) => return faults.report(format!("agent {}, level {}: {error}", agent.index, event.level)),
    };
    let mut arena = commands.entity(plays_in.0);
    if rules.contact == ContactModel::Rapier {
        arena.insert(MazePhysics::solving(&level.walls, &level.start));
    } else if with_physics.0 {
        arena.insert(MazePhysics::following(&level.walls, &level.start));
    } else {
        // The last level may have come from a file with other rules.
        arena.remove::<MazePhysics>();
    }
    let ball = MazeBall(level.start);
    arena.insert(MazeArena { level, rules, player: event.entity });
    commands.entity(event.entity).insert(ball);
}

// The game as entities.

/// Map and rules of all arenas whose levels bring no rules of their own.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct Maze2dRules(pub Maze2dMode);

/// One running copy of a level. With a physics context it also has [`MazePhysics`].
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub struct MazeArena {
    /// The level.
    #[reflect(ignore)]
    pub level: Arc<Maze2dLevel>,
    /// The rules of the level: those of the mode, unless the level brings its own.
    #[reflect(ignore)]
    pub rules: Maze2dMode,
    /// Its agent.
    pub player: Entity,
}

/// The ball of an agent. Belongs to the entity with the [`Agent`].
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct MazeBall(pub Ball);

/// The arena of an agent.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct PlaysIn(pub Entity);

// Levels of a mode, from a seed or from a file.

/// The levels of a World, each with its rules.
#[derive(SystemParam)]
pub(super) struct Levels<'w> {
    rules: Res<'w, Maze2dRules>,
    designs: Option<Res<'w, LevelDesigns>>,
}

impl Levels<'_> {
    /// Returns a level and its rules, or an explanation why there is none.
    pub fn get(&self, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
        match &self.designs {
            Some(designs) => drawn(designs, level),
            None => generated(self.rules.0.clone(), level),
        }
    }
}

/// Returns a level of a mode that has been checked, and its rules, or an explanation why there is none.
pub(super) fn level_of(game: &dyn Game, mode: &str, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
    if is_level_files(mode) {
        let designs = level_designs(game, mode);
        return drawn(&designs.map_err(|error| error.to_string())?, level);
    }
    generated(mode.parse().map_err(|error: MazeModeError| error.to_string())?, level)
}

pub(super) fn drawn(designs: &LevelDesigns, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
    let drawn = designs.get::<DrawnLevel>(level)?;
    Ok((Arc::new(drawn.level.clone()), drawn.rules.clone()))
}

fn generated(rules: Maze2dMode, level: u64) -> Result<(Arc<Maze2dLevel>, Maze2dMode), String> {
    let level = Maze2dLevel::new(&rules, level).map_err(|error| error.to_string())?;
    Ok((Arc::new(level), rules))
}

// The tick of every arena.

/// Moves every ball whose agent plays, and pays for its new position.
pub(super) fn play(
    mut players: Query<(&Control, &Action, &PlaysIn, &mut Episode, &mut MazeBall, &mut Reward, &mut StateHash)>,
    mut arenas: Query<(&MazeArena, Option<&mut MazePhysics>)>,
) {
    for (control, action, plays_in, mut episode, mut ball, mut paid, mut hash) in &mut players {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        // Actions of another kind were reported before, and their agents stopped.
        let Some(&[x, y]) = action.continuous() else { continue };
        let Ok((arena, physics)) = arenas.get_mut(plays_in.0) else { continue };
        let (push, clipped) = clip_action([x, y]);
        if clipped {
            episode.note_clipped();
        }
        let (ball, level, mode) = (&mut ball.0, &arena.level, &arena.rules);
        match (physics, mode.contact) {
            (Some(mut physics), ContactModel::Rapier) => step_rapier(ball, push, &mut physics),
            (physics, _) => {
                step_soft(ball, push, &level.walls);
                if let Some(mut physics) = physics {
                    physics.follow(ball);
                }
            }
        }
        let steps = episode.tick + 1;
        hash.0 = hash_state(ball, steps);
        paid.add(reward(ball.position, level.goal(), mode.sparse));
        end_if_over(mode, is_at_goal(ball.position, level.goal()), steps, &mut episode);
    }
}

fn end_if_over(mode: &Maze2dMode, at_goal: bool, steps: u32, episode: &mut Episode) {
    if at_goal {
        episode.reach();
        if mode.end_at_goal {
            episode.terminate(true);
        }
    }
    if steps >= mode.limit {
        episode.truncate();
    }
}

/// Names of the observed values: position, m, and velocity, m/s, along the rows (x) and columns (y).
pub(super) const OBSERVED: [&str; 4] = ["x", "y", "vx", "vy"];

/// Fills the vector of every playing agent that reads one.
pub(super) fn observe(mut players: Query<(&Episode, &MazeBall, &mut Observation), With<VectorSensor>>) {
    for (episode, ball, mut observation) in &mut players {
        if episode.is_running() {
            let ball = &ball.0;
            observation.set(ball.position.iter().chain(&ball.velocity).map(|&value| value as f32));
        }
    }
}
