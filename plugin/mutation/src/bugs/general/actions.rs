//! Games that receive other actions than their agents decided on.

use crate::bugs::general::{
    When,
    history::{History, PlantedSystems, remember},
    one_of,
};
use bevy::{app::MainScheduleOrder, ecs::schedule::ScheduleLabel, prelude::*};
use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue},
    agent::{Agent, Control},
    bot::BlindBot,
    engine::{TickSchedules, is_tick},
    episode::Episode,
    placement::TickPlacement,
    systems::PlaybotSystems,
};
use playbot_harness::{
    defect::DefectKind,
    game::{Game, is_named_idle},
};

/// An agent after its decision.
pub(super) struct Doing<'a> {
    /// The action space.
    pub(super) space: &'a ActionSpace,
    /// The agent's episode.
    pub(super) episode: &'a Episode,
    /// The agent's actions so far, with that of this tick.
    pub(super) history: &'a History,
    /// The action of this tick.
    pub(super) action: &'a ActionValue,
}

/// Replaces the agent's action by the one that `change` returns; `None` leaves it. Recordings, detectors and learners
/// see the agent's decision, so the difference is a defect of the game.
pub(super) fn change_actions(
    app: &mut App,
    mut change: impl FnMut(&Doing<'_>) -> Option<ActionValue> + Send + Sync + 'static,
) {
    remember(app);
    let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
    let hand_over = move |mut agents: Query<(&Agent, &Control, &Episode, &mut Action, &mut History)>| {
        for (agent, control, episode, mut action, mut history) in &mut agents {
            if !control.is_active() || !episode.is_running() {
                continue;
            }
            let doing = Doing { space: &agent.actions, episode, history: &history, action: &action.0 };
            if let Some(other) = change(&doing) {
                history.meant = Some(std::mem::replace(&mut action.0, other));
            }
        }
    };
    app.add_systems(decide, hand_over.in_set(PlantedSystems::Change))
        .add_systems(judge, give_back.before(PlaybotSystems::Judge).run_if(is_tick));
}

fn give_back(mut agents: Query<(&mut Action, &mut History)>) {
    for (mut action, mut history) in &mut agents {
        if let Some(meant) = history.meant.take() {
            action.0 = meant;
        }
    }
}

/// The start of the defect, and the index of the dead action among those that matter.
const VARIANTS: [(When, usize); 5] =
    [(When::Tick(0), 0), (When::Tick(25), 0), (When::Held(7), 0), (When::Tick(0), 1), (When::Tick(0), 2)];

/// Makes one action do nothing.
pub(super) fn dead_action(moves: &Moves) -> DefectKind {
    let moves = moves.clone();
    DefectKind::rules("dead-action", "one action does nothing", VARIANTS.len() as u32, move |app, variant| {
        let (moves, (when, which)) = (moves.clone(), one_of(&VARIANTS, variant));
        change_actions(app, move |doing| {
            when.is_now(doing.history, doing.episode).then(|| moves.without(which, doing.action)).flatten()
        });
    })
}

/// The actions of an agent.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    space: ActionSpace,
    /// The choice that does nothing; the last one if no choice has such a name.
    idle: u32,
    /// The other choices: first those that the game's blind bots hold, then from the last to the first.
    choices: Vec<u32>,
}

impl Moves {
    /// Returns the actions of a game.
    pub(super) fn of(game: &dyn Game) -> Self {
        let space = game.actions();
        let ActionSpace::Discrete(count) = space else { return Self { space, idle: 0, choices: Vec::new() } };
        let names = game.tools().input.action_names();
        let is_idle = |choice: &u32| is_named_idle(&names, *choice);
        let last = (count as u32).saturating_sub(1);
        let idle = (0..=last).find(is_idle).unwrap_or(last);
        let bots = game.tools().bots.blind_bots().into_iter().filter_map(|(_, bot)| match bot {
            BlindBot::Constant(ActionValue::Discrete(choice)) => Some(choice),
            _ => None,
        });
        let mut choices: Vec<u32> = Vec::new();
        for choice in bots.chain((0..=last).rev()) {
            if choice != idle && !is_idle(&choice) && !choices.contains(&choice) {
                choices.push(choice);
            }
        }
        Self { space, idle, choices }
    }

    /// Returns the action that does nothing.
    pub(super) fn idle(&self) -> ActionValue {
        match self.space {
            ActionSpace::Discrete(_) => ActionValue::Discrete(self.idle),
            ActionSpace::Continuous(_) | ActionSpace::Mixed(_) => self.space.first(),
        }
    }

    /// Returns the action without its effect, if it is the n-th choice that matters or has an n-th value; `None` if
    /// that changes nothing.
    pub(super) fn without(&self, n: usize, action: &ActionValue) -> Option<ActionValue> {
        match action {
            ActionValue::Discrete(choice) => {
                let dead = self.choices.get(n % self.choices.len().max(1))?;
                (choice == dead).then(|| self.idle())
            }
            ActionValue::Continuous(values) => {
                let mut values = values.clone();
                let at = n % values.len().max(1);
                *values.get_mut(at)? = 0.0;
                Some(ActionValue::Continuous(values))
            }
            // The n-th choice stays at its first option, or the n-th number behind them at 0.
            ActionValue::Mixed { choices, numbers } => {
                let (mut choices, mut numbers) = (choices.clone(), numbers.clone());
                let at = n % (choices.len() + numbers.len()).max(1);
                match choices.get_mut(at) {
                    Some(option) => *option = 0,
                    None => *numbers.get_mut(at - choices.len())? = 0.0,
                }
                let without = ActionValue::Mixed { choices, numbers };
                (without != *action).then_some(without)
            }
        }
    }

    /// Returns whether an action is the one that a reward farm pays for: doing nothing. With continuous actions it is a
    /// first value near the top, since exact zeros are never drawn.
    pub(super) fn is_farming(&self, action: &ActionValue) -> bool {
        match action {
            ActionValue::Discrete(choice) => *choice == self.idle,
            ActionValue::Mixed { choices, .. } if !choices.is_empty() => choices.iter().all(|&option| option == 0),
            ActionValue::Continuous(values) | ActionValue::Mixed { numbers: values, .. } => {
                values.first().is_some_and(|value| *value > 0.5)
            }
        }
    }
}

// Games that stand still.

const FROZEN_VARIANTS: [When; 4] = [When::Tick(30), When::Held(7), When::Later { episode: 2, tick: 5 }, When::Tick(60)];

/// Tick of the time limit in a frozen game: its clock goes on, so that testers can finish the episode.
const LAST_TICK: u32 = 800;

/// Stops every movement.
pub(super) fn frozen_world() -> DefectKind {
    let about = "the game stands still, whatever the agent does";
    DefectKind::rules("frozen-world", about, FROZEN_VARIANTS.len() as u32, |app, variant| {
        remember(app);
        let when = one_of(&FROZEN_VARIANTS, variant);
        let TickSchedules { placement, decide, judge } = TickSchedules::of(app);
        match placement {
            TickPlacement::Fixed => {
                // Games leave the arena of an idle agent alone.
                let idle_agents = move |mut agents: Query<(&mut Control, &Episode, &mut History)>| {
                    for (mut control, episode, mut history) in &mut agents {
                        if control.is_active() && episode.is_running() && when.is_now(&history, episode) {
                            history.control = Some(*control);
                            *control = Control::Idle;
                        }
                    }
                };
                app.add_systems(decide, idle_agents.after(PlaybotSystems::Act))
                    .add_systems(judge, wake_agents.before(PlaybotSystems::Judge));
            }
            // These games have no agents of the plugin's own, and one arena in a World.
            TickPlacement::Frame => {
                app.add_plugins(FreezePlugin(when));
            }
        }
        let time_is_up = move |mut agents: Query<(&Control, &History, &mut Episode)>| {
            for (control, history, mut episode) in &mut agents {
                let is_late = episode.tick + 1 >= LAST_TICK && control.is_active();
                if is_late && when.is_now(history, &episode) {
                    episode.truncate();
                }
            }
        };
        let after = time_is_up.after(wake_agents).before(PlaybotSystems::Judge);
        app.add_systems(judge, after.run_if(is_tick));
    })
}

fn wake_agents(mut agents: Query<(&mut Control, &mut History)>) {
    for (mut control, mut history) in &mut agents {
        if let Some(before) = history.control.take() {
            *control = before;
        }
    }
}

/// Skips the schedules that games run in a frame.
struct FreezePlugin(When);

/// The label under which a schedule of the game is kept.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum UnlessFrozen {
    FixedLoop,
    Update,
}

impl Plugin for FreezePlugin {
    fn build(&self, app: &mut App) {
        let pairs = [(UnlessFrozen::FixedLoop, RunFixedMainLoop.intern()), (UnlessFrozen::Update, Update.intern())];
        let when = self.0;
        for (instead, label) in pairs {
            app.add_systems(instead, move |world: &mut World| {
                let mut agents = world.query::<(&Control, &Episode, &History)>();
                let is_frozen = agents.iter(world).any(|(control, episode, history)| {
                    control.is_active() && episode.is_running() && when.is_now(history, episode)
                });
                if !is_frozen {
                    // Some programs have nothing in it.
                    let _ = world.try_run_schedule(label);
                }
            });
        }
    }

    /// Runs after all plugins are built, because they find their places by the names of these schedules.
    fn finish(&self, app: &mut App) {
        let mut order = app.world_mut().resource_mut::<MainScheduleOrder>();
        for label in &mut order.labels {
            if *label == RunFixedMainLoop.intern() {
                *label = UnlessFrozen::FixedLoop.intern();
            } else if *label == Update.intern() {
                *label = UnlessFrozen::Update.intern();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;
    use playbot_harness::foreign::ForeignGame;

    use super::*;
    use crate::bugs::general::testing::{Track, play, play_sound};

    #[test]
    fn an_agent_that_needs_the_action_does_not_get_on_but_is_recorded_as_it_decided() {
        let kind = dead_action(&Moves::of(&Track));
        let sound = play_sound(40, |_| 1);
        assert_eq!(sound.episodes, [(true, 30)]);
        for (variant, place) in [(0, 0), (1, 25), (2, 6)] {
            let played = play(&kind, variant, 40, |_| 1);
            assert_eq!((played.place, played.episodes.len()), (place, 0), "variant {variant}");
            assert!(played.actions.iter().all(|action| *action == 1));
        }
        assert_eq!(play(&kind, 3, 40, |_| 1).episodes, [(true, 30)], "another action is dead");
    }

    #[test]
    fn the_choice_that_does_nothing_is_known_by_its_name_and_held_ones_come_first() {
        let game =
            ForeignGame::new("keys", 1, |_: &mut App| {}).keys_by_name([vec!["ArrowUp"], vec![], vec!["ArrowLeft"]]);
        let moves = Moves::of(&game);
        assert_eq!((moves.idle, moves.choices.as_slice()), (1, &[2, 0][..]));
        let moves = Moves::of(&Track);
        assert_eq!((moves.idle(), moves.choices.as_slice()), (ActionValue::Discrete(0), &[1, 2][..]));
        assert_eq!(moves.without(0, &ActionValue::Discrete(1)), Some(ActionValue::Discrete(0)));
        assert_eq!(moves.without(0, &ActionValue::Discrete(2)), None);
    }

    #[test]
    fn a_value_of_continuous_actions_can_be_dead() {
        let moves = Moves { space: ActionSpace::Continuous(2), idle: 0, choices: Vec::new() };
        let action = ActionValue::Continuous(vec![1.0, -1.0]);
        assert_eq!(moves.without(3, &action), Some(ActionValue::Continuous(vec![1.0, 0.0])));
        assert_eq!(moves.idle(), ActionValue::Continuous(vec![0.0; 2]));
    }

    #[test]
    fn nothing_moves_from_its_moment_on() {
        let kind = frozen_world();
        let slowly = |tick: u32| u32::from(tick.is_multiple_of(3));
        assert_eq!(play_sound(75, slowly).place, 25);
        assert_eq!(play(&kind, 0, 75, slowly).place, 10);
        assert_eq!(play(&kind, 1, 29, |_| 1).place, 6);
        assert_eq!(play(&kind, 2, 55, |_| 1).place, 5);
        assert_eq!(play(&kind, 3, 75, slowly).place, 20);
    }
}
