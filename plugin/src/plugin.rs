//! The plugin: resources and the order of its systems.
//!
//! ```
//! use bevy::{prelude::*, time::TimePlugin};
//! use bevy_playbot::{episode::Tick, prelude::*};
//!
//! let mut app = App::new();
//! // A game with a window adds `DefaultPlugins`, which include time.
//! app.add_plugins((TimePlugin, PlaybotPlugin::default()));
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform));
//! app.update();
//! assert!(app.world().contains_resource::<Tick>());
//! ```

use crate::{
    action, agent, bot, entities, episode,
    fault::{FaultSystems, Faults, announce_faults},
    key_bindings::KeyboardPlugin,
    legal, observation, own_policy, placement,
    placement::{FrameGate, TickPlacement, TickSchedules},
    policy, reward, skill_prior, streams,
    systems::{ObserveSchedule, PlaybotSystems, run_observe_schedule},
    takeover::{GameIdentity, TakeoverPlugin},
    virtual_input::{InputRoute, VirtualInputPlugin},
    vision,
};
use bevy::{app::PluginGroupBuilder, ecs::schedule::ScheduleLabel, input::InputSystems, prelude::*};

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
            .init_resource::<episode::Tick>()
            .add_plugins((action::plugin, episode::plugin, observation::plugin, entities::plugin))
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
                app.add_systems(FixedFirst, episode::count_tick);
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
                policy::forget,
                episode::note_level_tick,
            )
                .chain()
                .in_set(PlaybotSystems::Begin),
            (
                legal::return_masks.run_if(any_with_component::<legal::DecisionPeriod>),
                run_observe_schedule,
                legal::hold_decisions.run_if(any_with_component::<legal::DecisionPeriod>),
                observation::check_observations,
                vision::check_images,
                legal::check_legal_actions,
            )
                .chain()
                .in_set(PlaybotSystems::Observe),
            (
                bot::run_blind_bots,
                crate::demo::replay::run_replays,
                skill_prior::draw_skills.run_if(resource_exists::<skill_prior::SkillPrior>),
                policy::run_policy.run_if(resource_exists::<policy::ActivePolicy>),
                own_policy::run_own_policies.run_if(any_with_component::<own_policy::OwnPolicy>),
            )
                .chain()
                .in_set(PlaybotSystems::Decide),
            // After the controllers of games, each of which acts for its own agents.
            legal::keep_legal
                .after(PlaybotSystems::Decide)
                .before(PlaybotSystems::Act)
                .run_if(placement::is_tick)
                .ambiguous_with_all(),
            (action::check_actions, legal::note_decisions.run_if(any_with_component::<legal::DecisionPeriod>))
                .chain()
                .in_set(PlaybotSystems::Act),
        ),
    );
}

/// Adds the systems that follow the game's step.
fn add_outcome_systems(app: &mut App, schedule: impl ScheduleLabel) {
    app.add_systems(
        schedule,
        (
            (episode::count_tick_and_reward, skill_prior::count_down_skills).chain().in_set(PlaybotSystems::Judge),
            (crate::demo::recorder::record_ticks, crate::demo::replay::check_replays)
                .chain()
                .in_set(PlaybotSystems::Record),
            episode::end_episodes.in_set(PlaybotSystems::Reset),
        ),
    );
}

/// The plugins that a game with agents needs at run time:
///
/// | plugin | what it brings |
/// |---|---|
/// | [`PlaybotPlugin`] | agents, episodes, observations, skills, policies, recording and replay |
/// | [`VirtualInputPlugin`] | actions that press keys, for agents with a [`VirtualInput`](crate::virtual_input::VirtualInput) |
/// | [`KeyboardPlugin`] | keys that become actions, for agents with [`KeyBindings`](crate::key_bindings::KeyBindings) |
/// | [`TakeoverPlugin`] | `PLAYBOT=record:FILE`, `policy:FILE` and `replay:FILE`, and a key, in a shipped build |
///
/// Needs Bevy's time and input, which are part of `DefaultPlugins`.
///
/// ```
/// use bevy::{input::InputPlugin, prelude::*, time::TimePlugin};
/// use bevy_playbot::{plugin::PlaybotPlugins, prelude::*};
///
/// let mut app = App::new();
/// // A game with a window adds `DefaultPlugins` instead of these two.
/// app.add_plugins((TimePlugin, InputPlugin)).add_plugins(PlaybotPlugins::new("walk", 1));
/// app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human));
/// app.update();
/// ```
#[derive(Clone, Debug)]
pub struct PlaybotPlugins {
    game: GameIdentity,
    placement: TickPlacement,
}

impl PlaybotPlugins {
    /// Creates the plugins for a game of this name, at this version of its rules: see
    /// [`GameIdentity`].
    pub fn new(name: &str, version: u32) -> Self {
        Self { game: GameIdentity::new(name, version), placement: TickPlacement::Fixed }
    }

    /// Sets the mode of the game.
    pub fn with_mode(self, mode: &str) -> Self {
        Self { game: self.game.with_mode(mode), ..self }
    }

    /// Adapts to a game whose ticks are whole frames: virtual input then uses messages.
    pub fn in_frames(self) -> Self {
        Self { placement: TickPlacement::Frame, ..self }
    }
}

impl PluginGroup for PlaybotPlugins {
    fn build(self) -> PluginGroupBuilder {
        let route = match self.placement {
            TickPlacement::Fixed => InputRoute::Direct,
            TickPlacement::Frame => InputRoute::Messages,
        };
        PluginGroupBuilder::start::<Self>()
            .add(PlaybotPlugin { placement: self.placement })
            .add(VirtualInputPlugin { route })
            .add(KeyboardPlugin)
            .add(TakeoverPlugin::new(self.game))
    }
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
