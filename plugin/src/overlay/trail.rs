//! The trail: where the agent has been in this episode, coloured by skill.

use crate::{
    agent::{AgentOrder, Control},
    episode::Episode,
    overlay::{Overlay, OverlayPosition},
    skill_prior::ActiveSkill,
};
use bevy::{gizmos::config::GizmoConfigStore, prelude::*};
use std::{collections::VecDeque, f32::consts::TAU};

/// Largest number of positions that are kept.
const LONGEST: usize = 256;

/// Colour where no skill is followed.
const PLAIN: LinearRgba = LinearRgba::new(1.0, 1.0, 1.0, 0.55);

/// Records the trail, and draws it in apps that have gizmos.
pub(super) fn build(app: &mut App) {
    app.init_resource::<Trail>()
        .add_systems(Last, follow)
        .add_systems(PostUpdate, draw.run_if(resource_exists::<GizmoConfigStore>));
}

/// The positions of the agent in its episode, one for each frame in which it moved.
#[derive(Resource, Debug, Default, Reflect)]
#[reflect(Resource)]
struct Trail {
    level: u64,
    tick: u32,
    // In the form that gizmos keep, since they are drawn anew in each frame.
    points: VecDeque<(Vec3, LinearRgba)>,
}

/// Adds the agent's position. A new episode begins a new trail.
fn follow(
    order: Res<AgentOrder>,
    agents: Query<(&Control, &Episode, &ActiveSkill, Option<&OverlayPosition>)>,
    transforms: Query<&GlobalTransform>,
    mut trail: ResMut<Trail>,
) {
    let Some(agent) = order.entities().first().copied() else { return };
    let Ok((control, episode, skill, elsewhere)) = agents.get(agent) else { return };
    if episode.level != trail.level || episode.tick < trail.tick {
        trail.points.clear();
    }
    (trail.level, trail.tick) = (episode.level, episode.tick);
    let Ok(transform) = transforms.get(elsewhere.map_or(agent, |elsewhere| elsewhere.0)) else { return };
    let position = transform.translation();
    if trail.points.back().is_some_and(|(last, _)| *last == position) {
        return;
    }
    let colour = if *control == Control::Policy { colour(&skill.z) } else { PLAIN };
    trail.points.push_back((position, colour));
    if trail.points.len() > LONGEST {
        trail.points.pop_front();
    }
}

/// Returns the colour of a skill: the direction of its first two values as a hue.
fn colour(z: &[f32]) -> LinearRgba {
    let hue = match *z {
        [] => return PLAIN,
        [x] => 180.0 + 90.0 * x.clamp(-2.0, 2.0),
        [x, y, ..] => (libm::atan2f(y, x) / TAU).rem_euclid(1.0) * 360.0,
    };
    Color::hsla(hue, 0.85, 0.62, 0.9).into()
}

fn draw(overlay: Res<Overlay>, trail: Res<Trail>, mut gizmos: Gizmos) {
    if overlay.is_shown {
        gizmos.linestrip_gradient(trail.points.iter().copied());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{agent::Agent, prelude::*};

    #[test]
    fn a_trail_follows_its_agent_and_ends_with_its_episode() {
        let mut app = headless_app();
        app.init_resource::<Overlay>();
        build(&mut app);
        let walk = |mut agents: Query<(&mut GlobalTransform, &mut Episode)>| {
            for (mut transform, mut episode) in &mut agents {
                *transform = GlobalTransform::from_xyz(episode.tick as f32, 0.0, 0.0);
                if episode.tick == 4 {
                    episode.terminate(true);
                }
            }
        };
        app.add_systems(FixedUpdate, walk);
        let player = (Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform);
        app.world_mut().spawn((player, GlobalTransform::default()));
        let mut length = |ticks| {
            app.ticks(ticks).expect("no agent broke its contract");
            app.world().resource::<Trail>().points.len()
        };
        assert_eq!(length(3), 3);
        assert!(length(3) <= 2, "the second episode has begun");
    }

    #[test]
    fn opposite_skills_have_different_hues() {
        let hue = |z: &[f32]| Hsla::from(colour(z)).hue;
        assert!((hue(&[1.0, 0.0]) - hue(&[-1.0, 0.0])).abs() > 170.0);
        assert!((hue(&[-1.0]) - hue(&[1.0])).abs() > 170.0);
        assert_eq!(colour(&[]), PLAIN);
    }
}
