//! Defects of walls in which the physics and the pictures differ.

use bevy::prelude::*;
use playbot_lab::defect::DefectKind;

use crate::{
    ant::AntBody,
    antmaze::{
        components::{InMaze, MazeAnt},
        plugin::AntMazeSystems,
        walls::wall_boxes,
    },
    maze::defects::{ChangeMaze, of_walls},
};

pub(super) fn defects() -> Vec<DefectKind> {
    of_walls(stand)
}

/// Gives the physics other walls as soon as a level has been built.
fn stand(app: &mut App, variant: u32, change: ChangeMaze) {
    let exchange = move |mut ants: Query<(&InMaze, &mut MazeAnt), Changed<InMaze>>| {
        for (level, mut ant) in &mut ants {
            let level = &level.0;
            // Coordinates begin at the start of the map, which stays where it is.
            let Some(maze) = change(&level.maze, level.start, level.goal, variant) else { continue };
            let mut body = AntBody::new(&wall_boxes(&maze));
            body.set_state(&level.reset);
            ant.0 = body;
        }
    };
    app.add_systems(FixedUpdate, exchange.before(AntMazeSystems));
}

#[cfg(test)]
mod tests {
    use bevy_playbot::test_app::test_app;
    use playbot_lab::{defect::Plant, prelude::*};

    use super::*;
    use crate::{
        ant::WallBox,
        antmaze::{AntMaze, game::spawn_agent},
        defect_variant::PLACES,
        maze::Maze,
    };

    /// Returns the level of an agent and the walls around its ant, with this defect planted.
    fn planted(class: &str, variant: u32) -> (Maze, Vec<WallBox>) {
        let mut app = test_app();
        AntMaze.build(&mut app, "medium");
        let kind = defects().into_iter().find(|kind| kind.class == class).expect("there is such a defect");
        let Plant::Rules { plant, .. } = kind.plant else { panic!("`{class}` is one of rules") };
        plant(&mut app, variant);
        let agent = spawn_agent(app.world_mut(), 0);
        let still = Action(ActionValue::Continuous(vec![0.0; 8]));
        app.world_mut().entity_mut(agent).insert((Control::Human, still, LevelQueue::Always(0)));
        app.tick().expect("sound");
        let (level, ant) = (app.world().get::<InMaze>(agent), app.world().get::<MazeAnt>(agent));
        let ant = ant.expect("it plays").0.walls().boxes().to_vec();
        (level.expect("it plays").0.maze.clone(), ant)
    }

    #[test]
    fn the_ant_meets_other_walls_than_its_level_has() {
        let area = |boxes: &[WallBox]| boxes.iter().map(|wall| wall.half[0] * wall.half[1] / 4.0).sum::<f32>();
        for variant in 0..PLACES {
            let (maze, boxes) = planted("invisible-wall", variant);
            assert_ne!(boxes, wall_boxes(&maze), "{variant}");
            let (maze, boxes) = planted("missing-collider", variant);
            assert!(area(&boxes) < area(&wall_boxes(&maze)), "{variant}");
        }
    }
}
