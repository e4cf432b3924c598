//! Defects of the walls, which pictures and levels do not show.

use bevy::prelude::*;
use playbot_lab::defect::DefectKind;

use super::cells::{wall_gone_beside_the_way, walled_on_the_way};
use crate::{
    defect_variant::PLACES,
    maze::{Cell, Maze},
};

/// Makes another maze for the rules, by start, goal and variant; `None` where the defect has no suitable position.
pub(crate) type ChangeMaze = fn(&Maze, Cell, Cell, u32) -> Option<Maze>;

/// Returns the defects of the walls of a game; `stand` gives its rules another maze as soon as a level has been built.
pub(crate) fn of_walls(stand: fn(&mut App, u32, ChangeMaze)) -> Vec<DefectKind> {
    let kind = |class, about, change: ChangeMaze| {
        DefectKind::rules(class, about, PLACES, move |app: &mut App, variant: u32| stand(app, variant, change))
    };
    vec![
        kind("invisible-wall", "an empty cell blocks players", walled_on_the_way),
        kind("missing-collider", "a wall can be gone through", wall_gone_beside_the_way),
    ]
}
