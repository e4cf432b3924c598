//! The picture of AntMaze.

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::{
    components::{InMaze, MazeAnt, PlaysIn},
    geometry::{CELL, centre_of},
    play::GOAL_RADIUS,
    walls::wall_boxes,
};
use crate::{
    ant::view::{AntPose, AntViewPlugin, AntViewSystems, GoalMark, Ground, OnGround},
    maze::{Cell, Maze},
};

/// Adds sprites to [`AntMazePlugin`](super::AntMazePlugin). Add it after the plugins that bring images, such as Bevy's
/// own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct AntMazePicturePlugin;

impl Plugin for AntMazePicturePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(AntViewPlugin)
            .add_systems(ObserveSchedule, (show_levels, show_ants).chain().in_set(AntViewSystems::Show));
    }
}

fn show_levels(new: Query<(Entity, &PlaysIn, &InMaze), Changed<InMaze>>, mut commands: Commands) {
    for (agent, plays_in, level) in &new {
        commands.entity(plays_in.0).insert(ground(&level.0.maze));
        let goal = GoalMark { at: level.0.goal_at, radius: GOAL_RADIUS };
        commands.entity(agent).insert((OnGround(plays_in.0), goal));
    }
}

fn show_ants(mut ants: Query<(Entity, &MazeAnt, Option<&mut AntPose>)>, mut commands: Commands) {
    for (agent, ant, pose) in &mut ants {
        let now = AntPose(ant.0.parts());
        match pose {
            Some(mut pose) => *pose = now,
            None => {
                commands.entity(agent).insert(now);
            }
        }
    }
}

fn ground(maze: &Maze) -> Ground {
    let first = centre_of(maze, Cell::default());
    let cells = (0..maze.rows()).flat_map(|row| (0..maze.columns()).map(move |col| Cell { row, col }));
    Ground {
        cell: CELL,
        corner: first.map(|x| x - CELL / 2.0),
        columns: maze.columns() as u32,
        is_wall: cells.map(|cell| !maze.is_free(cell)).collect(),
        walled: true,
        boxes: wall_boxes(maze),
    }
}
