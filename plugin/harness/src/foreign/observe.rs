//! Readings of a foreign game after a tick: its agent's observation and position, reward and end, and the default
//! state hash.

use crate::foreign::runtime::{Baseline, Sensor, playing_agent, with_foreign};
use bevy::prelude::*;
use bevy_playbot::{
    engine::{TickSchedules, is_tick},
    episode::{Episode, EpisodeEnd},
    observation::{Observation, VectorSensor},
    reward::Reward,
    state_hash::StateHash,
    systems::{ObserveSchedule, PlaybotSystems},
    vision::VisionSystems,
};

/// Adds the system that reads the observation.
pub(super) fn add_observation(app: &mut App) {
    app.add_systems(ObserveSchedule, observe.before(VisionSystems::Sync));
}

/// Fills the agent's vector, unless it has no sensor for one.
pub(super) fn observe(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let Some(expected) = world.get::<VectorSensor>(agent).map(|sensor| sensor.space().len()) else { return };
    let values = with_foreign(world, agent, |world, foreign| {
        let values = match &mut foreign.sensor {
            Sensor::System(system) => system.demand(world)?,
            Sensor::Paths(paths) => paths
                .iter_mut()
                .map(|path| path.read(world))
                .collect::<Result<_, _>>()
                .map_err(|error| error.to_string())?,
            Sensor::Nothing => Vec::new(),
        };
        if values.len() == expected {
            return Ok(values);
        }
        let system = foreign.game.description.sensor_name();
        Err(format!(
            "`.observe` names {expected} values, but its system `{system}` returned {} in this tick: it must return every \
             value in each tick",
            values.len()
        ))
    });
    if let (Some(values), Some(mut observation)) = (values, world.get_mut::<Observation>(agent)) {
        observation.set(values);
    }
}

/// Position of the agent on its level's plan. Missing while it is unknown.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(super) struct ForeignPosition(pub(super) Vec2);

/// Adds the systems that read the position: before each tick, so that the start of an episode is known, and after it.
pub(super) fn add_position(app: &mut App) {
    let judge = TickSchedules::of(app).judge;
    app.add_systems(ObserveSchedule, locate.before(observe).before(VisionSystems::Sync))
        .add_systems(judge, locate.before(read_outcome).before(PlaybotSystems::Judge).run_if(is_tick));
}

fn locate(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let position = with_foreign(world, agent, |world, foreign| match &mut foreign.position {
        Some(system) => system.run(world),
        None => Ok(None),
    });
    match position.flatten() {
        Some(position) => world.entity_mut(agent).insert(ForeignPosition(position)),
        None => world.entity_mut(agent).remove::<ForeignPosition>(),
    };
}

/// Reads reward and end, after the game's frame.
pub(super) fn read_outcome(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let tick = world.get::<Episode>(agent).map_or(0, |episode| episode.tick);
    let outcome = with_foreign(world, agent, |world, foreign| {
        let mut reward = 0.0;
        for part in &mut foreign.rewards {
            // A value of an entity that does not exist now pays nothing.
            let Some(value) = part.system.run(world)? else { continue };
            reward += if part.is_delta { value - part.last.unwrap_or(value) } else { value };
            part.last = Some(value);
        }
        let end = match &mut foreign.end {
            Some(system) => system.run(world)?.flatten(),
            None => None,
        };
        let time_is_up = foreign.game.description.limit.is_some_and(|limit| tick + 1 >= limit);
        let end = end.or(time_is_up.then_some(EpisodeEnd::Truncated));
        let state = match &mut foreign.hash {
            Some(system) => system.demand(world)?,
            None => foreign.baseline.as_ref().map_or(0, |baseline| of_transforms(world, baseline)),
        };
        Ok((reward, end, state))
    });
    let Some((reward, end, state)) = outcome else { return };
    let mut agent = world.entity_mut(agent);
    if let Some(mut paid) = agent.get_mut::<Reward>() {
        paid.add(reward);
    }
    let hash = with_agent(state, agent.get(), agent.get());
    agent.insert(StateHash(hash));
    if let Some(mut episode) = agent.get_mut::<Episode>() {
        match end {
            Some(EpisodeEnd::Terminated { success }) => episode.terminate(success),
            Some(EpisodeEnd::Truncated) => episode.truncate(),
            None => {}
        }
    }
}

/// Returns a hash of the transforms of all entities of the game. The ids of entities and their order in memory do not
/// matter.
pub(super) fn of_transforms(world: &World, baseline: &Baseline) -> u64 {
    let mut sum = 0_u64;
    for entity in baseline.spawned(world) {
        let Some(transform) = world.get::<Transform>(entity) else { continue };
        if !baseline.is_placed(world, entity) {
            continue;
        }
        let Transform { translation, rotation, scale } = transform;
        let numbers = [translation.to_array(), scale.to_array()].into_iter().flatten().chain(rotation.to_array());
        sum = sum.wrapping_add(StateHash::of(numbers.map(|number| u64::from(number.to_bits()))).0);
    }
    sum
}

/// Returns the hash of the state, with the agent's observation and reward.
pub(super) fn with_agent(state: u64, observation: Option<&Observation>, reward: Option<&Reward>) -> u64 {
    let reward = reward.map_or(0, |reward| u64::from(reward.get().to_bits()));
    let seen = observation.into_iter().flat_map(|seen| seen.vector.iter().map(|value| u64::from(value.to_bits())));
    StateHash::of([state, reward].into_iter().chain(seen)).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        floor_plan::FloorPlan,
        foreign::{ForeignGame, Restart},
        prelude::*,
        worlds::build_world,
    };

    #[derive(Component)]
    struct Snail;

    /// A snail that crawls 1 to the right in each frame, and is home after three.
    fn snail() -> ForeignGame {
        let game = |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Snail, Transform::from_xyz(2.0, 5.0, 0.0)));
            })
            .add_systems(Update, |mut at: Single<&mut Transform, With<Snail>>| at.translation.x += 1.0);
        };
        ForeignGame::new("snail", 1, game)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], |at: Single<&Transform, With<Snail>>| [at.translation.x])
            .position(|at: Single<&Transform, With<Snail>>| at.translation.truncate())
            .plan(|level| FloorPlan { goal: Vec2::new(level as f32, 0.0), ..FloorPlan::default() })
            .levels(3)
            .time_limit(3)
            .restart(Restart::Startup)
    }

    #[test]
    fn positions_are_known_after_each_tick_and_begin_anew_with_each_episode() {
        let game = snail();
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        let agent = agents[0];
        assert_eq!(game.tools().state.position(&world, agent), None, "nothing is played");
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([7, 8])));
        let mut positions = Vec::new();
        for _ in 0..20 {
            world.tick().expect("sound");
            if Control::of(&world, agent).is_active() {
                positions.extend(game.tools().state.position(&world, agent).map(|position| position.x));
            }
        }
        let episodes: Vec<&[f32]> = positions.chunk_by(|one, next| one <= next).collect();
        // Two frames pass before the first tick.
        assert_eq!(episodes, [[4.0, 5.0, 6.0]; 2], "{positions:?}");
    }

    #[test]
    fn plans_are_those_of_the_level_that_is_played() {
        let goal = |level| snail().tools().levels.floor_plan("default", level).map(|plan| plan.goal.x);
        assert_eq!([goal(1), goal(7)], [Some(1.0), Some(1.0)]);
        let bare = ForeignGame::new("bare", 1, |_: &mut App| {});
        assert_eq!(bare.tools().levels.floor_plan("default", 0), None);
    }
}
