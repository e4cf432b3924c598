//! Defects of walls in which the rules and the pictures differ.

use std::sync::Arc;

use bevy::prelude::*;
use playbot_lab::defect::DefectKind;

use crate::{
    maze::defects::{ChangeMaze, of_walls},
    maze2d::{
        components::MazeArena, level::Maze2dLevel, mode::Contact, physics::MazePhysics, plugin::Maze2dSystems,
        walls::Walls,
    },
};

pub(super) fn defects() -> Vec<DefectKind> {
    of_walls(stand)
}

/// Gives the rules other walls as soon as a level has been built.
fn stand(app: &mut App, variant: u32, change: ChangeMaze) {
    let exchange = move |mut arenas: Query<(&mut MazeArena, Option<&mut MazePhysics>), Changed<MazeArena>>| {
        for (mut arena, physics) in &mut arenas {
            let arena = arena.bypass_change_detection();
            let Maze2dLevel { maze, start_cell, goal_cell, start, .. } = &*arena.level;
            let Some(maze) = change(maze, *start_cell, *goal_cell, variant) else { continue };
            let walls = Walls::new(&maze, arena.rules.wall_offset());
            if let Some(mut physics) = physics {
                let solves = arena.rules.contact == Contact::Rapier;
                let stand = if solves { MazePhysics::solving } else { MazePhysics::following };
                *physics = stand(&walls, start);
            }
            arena.level = Arc::new(Maze2dLevel { walls, ..Maze2dLevel::clone(&arena.level) });
        }
    };
    app.add_systems(FixedUpdate, exchange.before(Maze2dSystems));
}

#[cfg(test)]
mod tests {
    use bevy_playbot::test_app::test_app;
    use playbot_lab::{defect::Plant, prelude::*};

    use super::*;
    use crate::maze2d::{Maze2d, components::PlaysIn, game::spawn_agent};

    #[test]
    fn the_ball_meets_one_wall_more_or_less_than_its_level_has() {
        for (kind, more) in defects().into_iter().zip([1, -1]) {
            let Plant::Rules { plant, variants } = kind.plant else { panic!("`{}` is one of rules", kind.class) };
            for variant in 0..variants {
                let mut app = test_app();
                Maze2d::default().build(&mut app, "medium+fixed-start");
                plant(&mut app, variant);
                let agent = spawn_agent(app.world_mut(), 0);
                let still = Action(ActionValue::Continuous(vec![0.0; 2]));
                app.world_mut().entity_mut(agent).insert((Control::Human, still, LevelQueue::Always(0)));
                app.tick().expect("sound");
                let arena = app.world().get::<PlaysIn>(agent).expect("it plays").0;
                let level = &app.world().get::<MazeArena>(arena).expect("it plays").level;
                let walls = [level.walls.cells().count(), level.maze.wall_cells().count()].map(|count| count as i64);
                assert_eq!(walls[0] - walls[1], more, "{} {variant}", kind.class);
            }
        }
    }
}
