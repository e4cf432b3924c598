//! The picture of the open floor.

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::walk::{GOAL_RADIUS, Walker};
use crate::ant::view::{AntPose, AntViewPlugin, AntViewSystems, GoalMark, Ground, OnGround};

/// Adds sprites to [`AntPlugin`](super::AntPlugin). Add it after the plugins that bring images, such as Bevy's own or a
/// sensor's.
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
        let floor = commands.spawn(Ground::open()).id();
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
