//! The plugin: resources and the order of its systems.
//!
//! ```
//! use bevy::{prelude::*, time::TimePlugin};
//! use bevy_playbot::{prelude::*, tick::Tick};
//!
//! let mut app = App::new();
//! // A game with a window adds `DefaultPlugins`, which include time.
//! app.add_plugins((TimePlugin, PlaybotPlugin::default()));
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform));
//! app.update();
//! assert!(app.world().contains_resource::<Tick>());
//! ```

use bevy::{ecs::schedule::ScheduleLabel, input::InputSystems, prelude::*};

use crate::{
    action, agent, bot, demo, episode,
    fault::{FaultSystems, Faults, announce_faults},
    observation,
    placement::{self, FrameGate, TickPlacement, TickSchedules},
    policy, reward, skill_prior, streams,
    systems::{ObserveSchedule, PlaybotSystems, run_observe_schedule},
    tick, vision,
};

/// Adds agents, episodes, skills, policies, recording and replay to a game.
///
/// It draws nothing and opens nothing. It acts on the agents that the game spawns.
#[derive(Default, Debug, Clone, Copy)]
pub struct PlaybotPlugin {
    /// The extent of a tick.
    pub placement: TickPlacement,
}

impl Plugin for PlaybotPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<agent::AgentOrder>()
            .init_resource::<Faults>()
            .init_resource::<tick::Tick>()
            .add_plugins((action::plugin, episode::plugin, observation::plugin))
            .add_plugins((streams::plugin, policy::plugin, skill_prior::plugin))
            .init_schedule(ObserveSchedule)
            .add_systems(Last, announce_faults.in_set(FaultSystems).after(PlaybotSystems::Reset));
        let schedules = TickSchedules::new(self.placement);
        app.insert_resource(schedules)
            .configure_sets(
                schedules.decide,
                (
                    PlaybotSystems::Begin,
                    PlaybotSystems::Load,
                    PlaybotSystems::Observe,
                    PlaybotSystems::Decide,
                    PlaybotSystems::Act,
                )
                    .chain(),
            )
            .configure_sets(
                schedules.judge,
                (PlaybotSystems::Judge, PlaybotSystems::Record, PlaybotSystems::Reset).chain(),
            );
        match self.placement {
            TickPlacement::Fixed => {
                app.add_systems(FixedFirst, tick::count_tick);
            }
            TickPlacement::Frame => place_in_frames(app),
        }
        add_decision_systems(app, schedules.decide);
        add_outcome_systems(app, schedules.judge);
    }
}

/// Makes each frame a tick, except the first and those in which a level is being built.
fn place_in_frames(app: &mut App) {
    use PlaybotSystems::{Act, Begin, Decide, Judge, Load, Observe, Record, Reset};
    app.init_resource::<FrameGate>()
        .configure_sets(PreUpdate, Act.before(InputSystems))
        .configure_sets(PreUpdate, (Begin, Load).run_if(placement::has_begun))
        .configure_sets(PreUpdate, (Observe, Decide, Act).run_if(placement::is_tick))
        .configure_sets(Last, (Judge, Record, Reset).run_if(placement::is_tick))
        .add_systems(
            PreUpdate,
            (
                placement::begin_frame.before(Begin),
                placement::open_gate.after(Load).before(Observe).run_if(placement::has_begun),
            ),
        );
}

/// Adds the systems up to the action.
fn add_decision_systems(app: &mut App, schedule: impl ScheduleLabel) {
    app.add_systems(
        schedule,
        (
            (
                streams::seed_streams,
                agent::check_agents,
                agent::order_agents,
                reward::clear_rewards,
                episode::begin_episodes,
                skill_prior::end_skills,
            )
                .chain()
                .in_set(PlaybotSystems::Begin),
            (run_observe_schedule, observation::check_observations, vision::check_images)
                .chain()
                .in_set(PlaybotSystems::Observe),
            (
                bot::run_blind_bots,
                demo::replay::run_replays,
                skill_prior::draw_skills.run_if(resource_exists::<skill_prior::SkillPrior>),
                policy::run_policy.run_if(resource_exists::<policy::ActivePolicy>),
            )
                .chain()
                .in_set(PlaybotSystems::Decide),
            action::check_actions.in_set(PlaybotSystems::Act),
        ),
    );
}

/// Adds the systems that follow the game's step.
fn add_outcome_systems(app: &mut App, schedule: impl ScheduleLabel) {
    app.add_systems(
        schedule,
        (
            (episode::count_tick_and_reward, skill_prior::count_down_skills).chain().in_set(PlaybotSystems::Judge),
            (demo::recorder::record_ticks, demo::replay::check_replays).chain().in_set(PlaybotSystems::Record),
            episode::end_episodes.in_set(PlaybotSystems::Reset),
        ),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{agent::Agent, headless::headless_app};

    #[test]
    fn inspectors_know_everything_that_agents_have() {
        let mut app = headless_app();
        let agent = app.world_mut().spawn(Agent::new(0, playbot_learner::ActionSpace::Discrete(2))).id();
        let registry = app.world().resource::<AppTypeRegistry>().read();
        let components: Vec<_> = app.world().inspect_entity(agent).expect("it is there").collect();
        assert!(components.len() > 10, "an agent has {}", components.len());
        for component in components {
            let is_known = component.type_id().is_some_and(|id| registry.contains(id));
            assert!(is_known, "{} is not registered", component.name());
        }
    }
}
