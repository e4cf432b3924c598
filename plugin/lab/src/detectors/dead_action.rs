//! Actions that never do anything.

use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue},
    episode::{Episode, EpisodeCount},
    fault::Fault,
    vision::ObservationConfig,
};

use super::{
    determinism::hash_of_state,
    level_detector::{LevelDefect, LevelDetector, TestedBy, TestedLevel},
    probe::Probe,
};
use crate::{
    detector::Setting,
    eval::Player,
    game::Game,
    idle::{idle_action, is_named_idle},
};

/// An action that does what doing nothing does, wherever it is tried in an episode that was solved: who is stuck somewhere
/// says nothing of actions.
///
/// Actions are tried at a few moments of the episode, each held for some ticks; an episode in which these would overlap is
/// too short to say anything. What an action does must show in the state hash, the observation or the reward. Games have
/// actions that do nothing in some levels, and some have such that never do, so it is not usual.
pub struct DeadAction {
    every: f64,
    moments: f64,
    ticks: f64,
}

impl Default for DeadAction {
    fn default() -> Self {
        Self { every: 10.0, moments: 6.0, ticks: 20.0 }
    }
}

impl LevelDetector for DeadAction {
    fn name(&self) -> &'static str {
        "dead-action"
    }

    fn describe(&self) -> &'static str {
        "an action that does what doing nothing does, wherever it is tried"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("every", &mut self.every, "look at every so many-th level of the range").at_least(1.0),
            Setting::new("moments", &mut self.moments, "moments of the episode in which it is tried").at_least(1.0),
            Setting::new("ticks", &mut self.ticks, "ticks for which it is held").at_least(1.0),
        ]
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let solver = level.testers.iter().find(|tester| has_solved(tester));
        let Some(tester) = solver.filter(|_| level.is_sample(self.every)) else { return Vec::new() };
        // A game that breaks is found by others.
        let dead = self.dead(&Script::new(level, tester)).unwrap_or_default();
        let defect = |name: String| LevelDefect {
            tester: Some(tester.name.to_owned()),
            episode: Some(0),
            tick: None,
            message: format!("{name} does what doing nothing does, wherever it was tried in the episode"),
        };
        dead.into_iter().map(defect).collect()
    }
}

fn has_solved(tester: &TestedBy<'_>) -> bool {
    tester.episodes.iter().any(|(number, result)| *number == 0 && result.success)
}

impl DeadAction {
    /// Names of the actions that are dead.
    fn dead(&self, script: &Script<'_>) -> Result<Vec<String>, Fault> {
        let (actions, idle) = (script.actions()?, idle_action(script.game));
        let (moments, ticks) = (self.moments as usize, self.ticks as usize);
        if actions.len() < moments.saturating_add(1).saturating_mul(ticks) {
            return Ok(Vec::new());
        }
        let mut left = tried(script.game);
        for moment in 1..=moments {
            let before = &actions[..actions.len() * moment / (moments + 1)];
            let nothing = script.play(before, &idle, ticks)?;
            let mut still = Vec::new();
            for (name, ways) in left {
                let mut is_dead = true;
                for way in &ways {
                    is_dead = is_dead && script.play(before, way, ticks)? == nothing;
                }
                if is_dead {
                    still.push((name, ways));
                }
            }
            left = still;
            if left.is_empty() {
                break;
            }
        }
        Ok(left.into_iter().map(|(name, _)| name).collect())
    }
}

/// What is tried: each choice that is not called doing nothing, or each value of continuous actions, far up and far down.
fn tried(game: &dyn Game) -> Vec<(String, Vec<ActionValue>)> {
    let (names, idle) = (game.action_names(), idle_action(game));
    let named =
        |number: usize| names.get(number).map_or_else(|| format!("action {number}"), |name| format!("`{name}`"));
    match game.actions() {
        ActionSpace::Discrete(count) => {
            let choices = (0..count as u32).map(|choice| (choice, ActionValue::Discrete(choice)));
            let is_something =
                |(choice, action): &(u32, ActionValue)| *action != idle && !is_named_idle(&names, *choice);
            choices.filter(is_something).map(|(choice, action)| (named(choice as usize), vec![action])).collect()
        }
        ActionSpace::Continuous(count) => {
            let way = |number: usize, value: f32| {
                let mut values = vec![0.0; count];
                values[number] = value;
                ActionValue::Continuous(values)
            };
            (0..count).map(|number| (named(number), [1.0, -1.0].map(|value| way(number, value)).to_vec())).collect()
        }
    }
}

/// An episode of a tester, which can be played up to any of its ticks and then otherwise.
struct Script<'a> {
    game: &'a dyn Game,
    mode: &'a str,
    level: u64,
    player: &'a Player,
    observation_config: ObservationConfig,
    seed: u64,
}

/// Ticks and frames after which nobody waits any longer.
const MOST_RUNS: u32 = 200_000;

impl<'a> Script<'a> {
    fn new(level: &TestedLevel<'a>, tester: &TestedBy<'a>) -> Self {
        let TestedBy { player, observation_config, seed, .. } = *tester;
        Self { game: level.game, mode: level.mode, level: level.level, player, observation_config, seed }
    }

    /// What the tester did; nothing if it does not solve the level again.
    fn actions(&self) -> Result<Vec<ActionValue>, Fault> {
        let config = &self.observation_config;
        let probe = Probe::new(self.game, self.mode, self.level, self.player, config, vec![self.seed]);
        let mut probe = probe.map_err(|error| Fault(error.to_string()))?;
        let mut actions = Vec::new();
        for _ in 0..MOST_RUNS {
            let is_active = probe.tick()?;
            if ticks(&probe) > actions.len() {
                actions.extend(probe.world.get::<Action>(probe.agent).map(|action| action.0.clone()));
            }
            if !is_active || probe.is_over() {
                break;
            }
        }
        let has_solved = probe.world.get::<EpisodeCount>(probe.agent).is_some_and(|count| count.successes > 0);
        Ok(if has_solved { actions } else { Vec::new() })
    }

    /// Hashes of the states that follow if these actions are done, and then another one for so many ticks.
    fn play(&self, before: &[ActionValue], then: &ActionValue, ticks_then: usize) -> Result<Vec<u64>, Fault> {
        let mut probe =
            Probe::led(self.game, self.mode, self.level, self.seed).map_err(|error| Fault(error.to_string()))?;
        let mut hashes = Vec::new();
        for _ in 0..MOST_RUNS {
            let played = ticks(&probe);
            let action = before.get(played).unwrap_or(then).clone();
            probe.world.entity_mut(probe.agent).insert(Action(action));
            let is_active = probe.tick()?;
            let now = ticks(&probe);
            if now > played && now > before.len() {
                hashes.push(hash_of_state(&probe.world, probe.agent));
            }
            if !is_active || probe.is_over() || now >= before.len() + ticks_then {
                break;
            }
        }
        Ok(hashes)
    }
}

/// Ticks of the episode.
fn ticks(probe: &Probe) -> usize {
    probe.world.get::<Episode>(probe.agent).map_or(0, |episode| episode.tick as usize)
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use bevy_playbot::episode::EpisodeEnd;

    use super::*;
    use crate::foreign::ForeignGame;

    #[derive(Component)]
    struct Runner;

    /// Space does nothing, unless the runner is far enough and it works at all.
    fn game(works: bool) -> ForeignGame {
        let game = move |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Runner, Transform::default()));
            })
            .add_systems(
                Update,
                move |keys: Res<ButtonInput<KeyCode>>, mut at: Single<&mut Transform, With<Runner>>| {
                    at.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
                    if works && at.translation.x > 20.0 && keys.pressed(KeyCode::Space) {
                        at.translation.y += 1.0;
                    }
                },
            );
        };
        ForeignGame::new("runner", 1, game)
            .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::Space]])
            .observe(["x"], |at: Single<&Transform, With<Runner>>| [at.translation.x])
            .end(|at: Single<&Transform, With<Runner>>| (at.translation.x >= 40.0).then_some(EpisodeEnd::WON))
            .time_limit(100)
            .demonstrator("runs", || 1_u32)
    }

    fn dead(works: bool, ticks: f64) -> Vec<String> {
        let game = game(works);
        let player = Player::Demonstrator;
        let observation_config = ObservationConfig::default();
        let script = Script { game: &game, mode: "default", level: 0, player: &player, observation_config, seed: 3 };
        DeadAction { ticks, ..DeadAction::default() }.dead(&script).expect("sound")
    }

    #[test]
    fn an_action_that_never_does_anything_is_found_and_one_that_does_later_on_is_not() {
        assert_eq!(dead(false, 5.0), ["`Space`"]);
        assert!(dead(true, 5.0).is_empty());
        assert!(dead(false, 20.0).is_empty(), "the episode has 40 ticks, which is too short");
    }

    #[test]
    fn values_of_continuous_actions_are_tried_to_both_sides() {
        let game = ForeignGame::new("ball", 1, |_: &mut App| {}).actions(ActionSpace::Continuous(2), || {});
        let tried = tried(&game);
        assert_eq!(tried.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["action 0", "action 1"]);
        let down = ActionValue::Continuous(vec![0.0, -1.0]);
        assert_eq!(tried[1].1[1], down);
    }
}
