//! The picture of AntMaze.

use crate::{
    ant::view::{AntPose, AntViewPlugin, AntViewSystems, ArenaGround, GoalMark, OnGround},
    antmaze::{
        arena::{GOAL_RADIUS, InMaze, MazeAnt, PlaysIn},
        geometry::{CELL, centre_of, wall_boxes},
        level::AntMazeLevel,
    },
    maze::{Cell, Maze},
};
use bevy::{
    math::{Rect, Vec2},
    prelude::*,
};
use playbot_harness::{floor_plan::FloorPlan, prelude::*};

/// Adds sprites to [`AntMazePlugin`](crate::antmaze::AntMazePlugin). Add it after the plugins that bring images, such
/// as Bevy's own or a sensor's.
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

fn ground(maze: &Maze) -> ArenaGround {
    let first = centre_of(maze, Cell::default());
    let cells = (0..maze.rows()).flat_map(|row| (0..maze.columns()).map(move |col| Cell { row, col }));
    ArenaGround {
        cell: CELL,
        corner: first.map(|x| x - CELL / 2.0),
        columns: maze.columns() as u32,
        is_wall: cells.map(|cell| !maze.is_free(cell)).collect(),
        walled: true,
        boxes: wall_boxes(maze),
    }
}

impl AntMazeLevel {
    /// Returns the maze from above: columns go along x, to the right, and rows along y, up.
    pub fn floor_plan(&self) -> FloorPlan {
        let place = |cell| Vec2::from_array(centre_of(&self.maze, cell));
        let plan = self.maze.floor_plan(|cell| Rect::from_center_size(place(cell), Vec2::splat(CELL)), place);
        FloorPlan { start: place(self.start), goal: Vec2::from_array(self.goal_at), ..plan }
    }
}
