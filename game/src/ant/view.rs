//! The look of ants and of the ground they walk on, for every game with ants.
//!
//! A game describes its scene with [`AntPose`], [`GoalMark`] and [`OnGround`] on its agents and [`ArenaGround`] on
//! their arenas, in [`AntViewSystems::Show`]. It is drawn from above with sprites, for sensors and windows, and with
//! the feature `view3d` also in space with meshes, for windows.
//!
//! The folder, in reading order:
//!
//! - `flat`: the view from above, with sprites.
//! - `solid`: the view in space, with meshes, a sun and shadows.

mod flat;
#[cfg(feature = "view3d")]
mod solid;

use crate::ant::{
    body::{PARTS, Part},
    contact::WallBox,
    view::flat::FlatViewPlugin,
    walk::{GOAL_RADIUS, Walker},
};
use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_harness::prelude::*;

pub use crate::ant::view::flat::VIEW;
#[cfg(feature = "view3d")]
pub use crate::ant::view::solid::{SolidAnt, SolidViewPlugin};

/// Draws ants. Add it after the plugins that bring images, such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct AntViewPlugin;

impl Plugin for AntViewPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(
            ObserveSchedule,
            (AntViewSystems::Show, AntViewSystems::Draw).chain().in_set(VisionSystems::Sync),
        )
        .add_plugins(FlatViewPlugin);
    }
}

/// Parts of [`VisionSystems::Sync`] for games with ants, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AntViewSystems {
    /// The game updates poses, goals and grounds.
    Show,
    /// Sprites and meshes follow them.
    Draw,
}

// Components that are drawn.

/// The torso and the limbs of an agent's ant, in the coordinates of its arena, as
/// [`AntBody::parts`](crate::ant::AntBody::parts) has them.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct AntPose(pub [Part; PARTS]);

/// The goal of an agent's ant.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component)]
pub struct GoalMark {
    /// `[x, y]` in metres.
    pub at: [f32; 2],
    /// Distance at which it counts as reached, metres.
    pub radius: f32,
}

/// The arena in which an agent's ant walks: an entity with a [`ArenaGround`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct OnGround(pub Entity);

/// Floor and walls of an arena, in square cells.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct ArenaGround {
    /// Side of a cell, metres.
    pub cell: f32,
    /// The corner of the first cell, `[x, y]` in metres: cells go from there along x, and rows of them along y.
    pub corner: [f32; 2],
    /// Cells in a row; 0 for an open floor.
    pub columns: u32,
    /// Marks walls among the cells, row by row.
    pub is_wall: Vec<bool>,
    /// Everything outside the cells is wall, instead of floor.
    pub walled: bool,
    /// The walls.
    pub boxes: Vec<WallBox>,
}

impl ArenaGround {
    /// Returns a floor without walls.
    pub fn open() -> Self {
        Self { cell: 4.0, corner: [0.0; 2], columns: 0, is_wall: Vec::new(), walled: false, boxes: Vec::new() }
    }
}

// The picture of the open floor.

/// Adds sprites to [`AntPlugin`](crate::ant::AntPlugin). Add it after the plugins that bring images, such as Bevy's own
/// or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct AntPicturePlugin;

impl Plugin for AntPicturePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(AntViewPlugin)
            .add_systems(ObserveSchedule, (lay_floors, show_ants).chain().in_set(AntViewSystems::Show));
    }
}

/// Gives each ant a floor of its own.
fn lay_floors(new: Query<Entity, (With<Walker>, Without<OnGround>)>, mut commands: Commands) {
    for agent in &new {
        let floor = commands.spawn(ArenaGround::open()).id();
        commands.entity(agent).insert(OnGround(floor));
    }
}

fn show_ants(
    mut ants: Query<(Entity, &Walker, Option<(&mut AntPose, &mut GoalMark)>), With<OnGround>>,
    mut commands: Commands,
) {
    for (agent, walker, shown) in &mut ants {
        let pose = AntPose(walker.body.parts());
        let goal = GoalMark { at: walker.goal.to_array(), radius: GOAL_RADIUS };
        match shown {
            Some((mut shown_pose, mut shown_goal)) => {
                *shown_pose = pose;
                shown_goal.set_if_neq(goal);
            }
            None => {
                commands.entity(agent).insert((pose, goal));
            }
        }
    }
}
