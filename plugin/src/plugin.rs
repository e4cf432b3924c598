//! The plugin itself: resources and the order of its systems.

use bevy::prelude::*;

use crate::{
    action, agent, bot, demo, episode,
    fault::{FaultSystems, Faults, announce_faults},
    headless, observation, policy, reflect, reward, skill_prior, streams,
    systems::{ObserveSchedule, PlaybotSystems, run_observe_schedule},
};

/// Adds agents, episodes, skills, policies, recording and replay to a game.
///
/// It draws nothing, opens nothing and starts nothing: agents that the game spawns bring it to life.
#[derive(Default, Debug, Clone, Copy)]
pub struct PlaybotPlugin;

impl Plugin for PlaybotPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<agent::AgentOrder>()
            .init_resource::<Faults>()
            .init_resource::<headless::Tick>()
            .add_plugins((action::plugin, episode::plugin, observation::plugin))
            .add_plugins((streams::plugin, policy::plugin, skill_prior::plugin, reflect::plugin))
            .init_schedule(ObserveSchedule)
            .add_systems(Last, announce_faults.in_set(FaultSystems).after(PlaybotSystems::Reset))
            .configure_sets(
                FixedPreUpdate,
                (PlaybotSystems::Begin, PlaybotSystems::Observe, PlaybotSystems::Decide, PlaybotSystems::Act).chain(),
            )
            .configure_sets(
                FixedPostUpdate,
                (PlaybotSystems::Judge, PlaybotSystems::Record, PlaybotSystems::Reset).chain(),
            );
        add_decision_systems(app);
        add_outcome_systems(app);
    }
}

/// Everything up to the action.
fn add_decision_systems(app: &mut App) {
    app.add_systems(FixedFirst, headless::count_tick).add_systems(
        FixedPreUpdate,
        (
            (
                streams::seed_streams,
                agent::order_agents,
                reward::clear_rewards,
                episode::begin_episodes,
                skill_prior::end_skills,
            )
                .chain()
                .in_set(PlaybotSystems::Begin),
            (run_observe_schedule, observation::check_observations, observation::check_images)
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

/// Everything after the game has answered.
fn add_outcome_systems(app: &mut App) {
    app.add_systems(
        FixedPostUpdate,
        (
            (episode::judge, skill_prior::count_down_skills).chain().in_set(PlaybotSystems::Judge),
            (demo::recorder::record_ticks, demo::replay::check_replays).chain().in_set(PlaybotSystems::Record),
            episode::end_episodes.in_set(PlaybotSystems::Reset),
        ),
    );
}
