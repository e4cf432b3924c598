//! The position of a foreign game's agent.

use bevy::prelude::*;

use super::{
    outcome::read_outcome,
    runtime::{playing_agent, with_foreign},
    sense::observe,
};
use bevy_playbot::{
    placement::{TickSchedules, is_tick},
    systems::{ObserveSchedule, PlaybotSystems},
    vision::VisionSystems,
};

/// Position of the agent on its level's plan. Missing while it is unknown.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(super) struct ForeignPlace(pub(super) Vec2);

/// Adds the systems that read the position: before each tick, so that the start of an episode is known, and after it.
pub(super) fn build(app: &mut App) {
    let judge = TickSchedules::of(app).judge;
    app.add_systems(ObserveSchedule, locate.before(observe).before(VisionSystems::Sync))
        .add_systems(judge, locate.before(read_outcome).before(PlaybotSystems::Judge).run_if(is_tick));
}

fn locate(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let place = with_foreign(world, agent, |world, foreign| match &mut foreign.place {
        Some(system) => system.run(world),
        None => Ok(None),
    });
    match place.flatten() {
        Some(place) => world.entity_mut(agent).insert(ForeignPlace(place)),
        None => world.entity_mut(agent).remove::<ForeignPlace>(),
    };
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
            .place(|at: Single<&Transform, With<Snail>>| at.translation.truncate())
            .plan(|level| FloorPlan { goal: Vec2::new(level as f32, 0.0), ..FloorPlan::default() })
            .levels(3)
            .time_limit(3)
            .restart(Restart::Startup)
    }

    #[test]
    fn places_are_known_after_each_tick_and_begin_anew_with_each_episode() {
        let game = snail();
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        let agent = agents[0];
        assert_eq!(game.tools().state.position(&world, agent), None, "nothing is played");
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([7, 8])));
        let mut places = Vec::new();
        for _ in 0..20 {
            world.tick().expect("sound");
            if Control::of(&world, agent).is_active() {
                places.extend(game.tools().state.position(&world, agent).map(|place| place.x));
            }
        }
        let episodes: Vec<&[f32]> = places.chunk_by(|one, next| one <= next).collect();
        // Two frames pass before the first tick.
        assert_eq!(episodes, [[4.0, 5.0, 6.0]; 2], "{places:?}");
    }

    #[test]
    fn plans_are_those_of_the_level_that_is_played() {
        let goal = |level| snail().tools().levels.floor_plan("default", level).map(|plan| plan.goal.x);
        assert_eq!([goal(1), goal(7)], [Some(1.0), Some(1.0)]);
        let bare = ForeignGame::new("bare", 1, |_: &mut App| {});
        assert_eq!(bare.tools().levels.floor_plan("default", 0), None);
    }
}
