//! Actions without an effect.

use crate::{
    detectors::{
        LevelDefect, LevelDetector, TestedBy, TestedLevel,
        determinism::{Course, Script},
    },
    explore::CellGrid,
};
use bevy_playbot::{action::ActionValue, episode::EpisodeResult, fault::Fault};
use playbot_harness::{
    detector::DetectorSetting,
    game::{Game, idle_action},
    single_actions::{SingleAction, single_actions},
};

/// A finding for actions that do the same as doing nothing, at every moment of an episode at which they are tried.
///
/// Actions are tried at a few moments of the episode, each held for some ticks. An episode that is too short for that
/// is skipped. An effect must show in the state hash, the observation or the reward.
///
/// A moment in which the action is illegal does not count, and there must be two in which it is legal.
///
/// A stuck agent says nothing about actions. So the episode is one that was solved or, on an unsolved level, the one
/// with the best reward. Its agent must be at different positions at these moments. An action that the agent took itself,
/// such as a click on a menu's button, must have no effect where it was taken first, either. It is opt-in, because games
/// may have actions without an effect in some levels or in all.
pub struct DeadAction {
    every: f64,
    moments: f64,
    ticks: f64,
}

/// Fewest moments in which a dead action must have been legal, unless there are fewer moments.
const LEAST_MOMENTS: usize = 2;

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

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("every", &mut self.every, "look at every n-th level of the range").at_least(1.0),
            DetectorSetting::new("moments", &mut self.moments, "moments of the episode in which it is tried")
                .at_least(1.0),
            DetectorSetting::new("ticks", &mut self.ticks, "ticks for which it is held").at_least(1.0),
        ]
    }

    fn least_ticks(&self) -> u32 {
        self.least().try_into().unwrap_or(u32::MAX)
    }

    fn most_ticks(&self, level: &TestedLevel<'_>) -> Option<u32> {
        teller(level).and_then(first_episode).map(|result| result.ticks)
    }

    fn setting_for(&self, ticks: u32) -> Option<String> {
        let held = f64::from(ticks) / (self.moments.floor() + 1.0);
        (held >= 1.0).then(|| format!("ticks={}", held.floor()))
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let Some(tester) = teller(level).filter(|_| level.is_sample(self.every)) else { return Vec::new() };
        // Other detectors report a panic.
        let has_solved = level.episodes().any(|(_, _, result)| result.success);
        let dead = self.dead(&Script::new(level, tester), has_solved).unwrap_or_default();
        let defect = |name: String| LevelDefect {
            tester: Some(tester.name.to_owned()),
            episode: Some(0),
            tick: None,
            settings: Vec::new(),
            message: format!("{name} does what doing nothing does, wherever it was tried in the episode"),
        };
        dead.into_iter().map(defect).collect()
    }
}

/// Returns the tester whose first episode is examined: the first tester that solved the level in it, else the one with
/// the best reward.
fn teller<'a, 'b>(level: &'b TestedLevel<'a>) -> Option<&'b TestedBy<'a>> {
    let firsts = || level.testers.iter().filter_map(|tester| Some((tester, first_episode(tester)?)));
    if level.episodes().any(|(_, _, result)| result.success) {
        return firsts().find(|(_, result)| result.success).map(|(tester, _)| tester);
    }
    // The first of equal ones.
    let best = firsts().rev().max_by(|(_, one), (_, other)| one.total_reward.total_cmp(&other.total_reward));
    best.map(|(tester, _)| tester)
}

fn first_episode<'b>(tester: &'b TestedBy<'_>) -> Option<&'b EpisodeResult> {
    tester.episodes.iter().find(|(number, _)| *number == 0).map(|(_, result)| result)
}

impl DeadAction {
    /// Returns the ticks of the shortest episode in which it can look.
    fn least(&self) -> usize {
        (self.moments as usize).saturating_add(1).saturating_mul(self.ticks as usize)
    }

    /// Returns the names of the dead actions. `has_solved`: whether the episode was solved in the test.
    fn dead(&self, script: &Script<'_>, has_solved: bool) -> Result<Vec<String>, Fault> {
        let (course, idle, led) = (script.course()?, idle_action(script.game), script.led_episodes());
        let (moments, ticks) = (self.moments as usize, self.ticks as usize);
        let length = course.actions.len();
        if length < self.least() {
            return Ok(Vec::new());
        }
        let moments: Vec<usize> = (1..=moments).map(|moment| length * moment / (moments + 1)).collect();
        let is_same = course.is_solved == has_solved;
        if !is_same || !(has_solved || gets_around(script, &course, &moments)) {
            return Ok(Vec::new());
        }
        let enough = moments.len().min(LEAST_MOMENTS);
        let mut left: Vec<_> = tried(script.game).into_iter().map(|(name, ways)| (name, ways, 0)).collect();
        for moment in moments {
            let before = &course.actions[..moment];
            let nothing = led.play(before, &idle, ticks)?;
            let mut still = Vec::new();
            for (name, ways, mut times) in left {
                let (mut has_effect, mut is_tried) = (false, false);
                for way in &ways {
                    if !has_effect {
                        let held = led.play(before, way, ticks)?;
                        has_effect = held.hashes != nothing.hashes;
                        // Instead of an illegal action, the idle one was played.
                        is_tried |= held.actions != nothing.actions;
                    }
                }
                times += usize::from(is_tried);
                if !has_effect {
                    still.push((name, ways, times));
                }
            }
            left = still;
            if left.is_empty() {
                break;
            }
        }
        let mut dead = Vec::new();
        for (name, ways, _) in left.into_iter().filter(|(_, _, times)| *times >= enough) {
            let first = course.actions.iter().position(|action| ways.contains(action));
            let has_effect = match first.map(|moment| course.actions.split_at(moment)) {
                Some((before, after)) => {
                    let held = |action| led.play(before, action, ticks).map(|held| held.hashes);
                    held(&after[0])? != held(&idle)?
                }
                None => false,
            };
            if !has_effect {
                dead.push(name);
            }
        }
        Ok(dead)
    }
}

/// Returns whether the agent is on different tiles in at least half of these moments, more than one.
fn gets_around(script: &Script<'_>, course: &Course, moments: &[usize]) -> bool {
    let grid = CellGrid::new(script.game.tools().levels.floor_plan(script.mode, script.level).as_ref(), None);
    let position = |moment: &usize| course.positions.get(*moment - 1).copied().flatten();
    let mut cells: Vec<_> = moments.iter().filter_map(position).filter_map(|position| grid.cell_at(position)).collect();
    cells.sort();
    cells.dedup();
    cells.len() > 1 && cells.len() >= moments.len().div_ceil(2)
}

/// Returns the actions to try: each option that is not named as doing nothing, or each number, far up and far down.
pub(super) fn tried(game: &dyn Game) -> Vec<(String, Vec<ActionValue>)> {
    let doing = single_actions(game).into_iter().filter(|single| !single.is_idle);
    let named = |SingleAction { name, number, ways, .. }| {
        let of_number = || format!("action {number}");
        (name.map_or_else(of_number, |name| format!("`{name}`")), ways)
    };
    doing.map(named).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use bevy::prelude::*;
    use bevy_playbot::{action::ActionSpace, bot::BlindBot, episode::EpisodeEnd, vision::ObservationConfig};

    use super::*;
    use playbot_harness::{eval::Player, foreign::ForeignGame};

    #[derive(Component)]
    struct Runner;

    /// Space does nothing, unless the runner is far enough and the action works. The end of the track wins.
    fn game(works: bool, goal: f32) -> ForeignGame {
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
            .end(move |at: Single<&Transform, With<Runner>>| (at.translation.x >= goal).then_some(EpisodeEnd::WON))
            .time_limit(100)
            .demonstrator("runs", || 1_u32)
    }

    /// The dead actions of the game, with a player that runs until the time limit, or one that never acts.
    fn dead(game: &ForeignGame, player: &Player, ticks: f64) -> Vec<String> {
        let observation_config = ObservationConfig::default();
        let stop = &|| false;
        let script = Script { game, mode: "default", level: 0, player, observation_config, seed: 3, stop };
        let has_solved = script.course().expect("sound").is_solved;
        let dead =
            |has_solved: bool| DeadAction { ticks, ..DeadAction::default() }.dead(&script, has_solved).expect("sound");
        assert!(dead(!has_solved).is_empty(), "who does not play the same again says nothing");
        dead(has_solved)
    }

    #[test]
    fn an_action_that_never_does_anything_is_found_and_one_that_does_later_on_is_not() {
        let dead = |works: bool, ticks: f64| dead(&game(works, 40.0), &Player::Demonstrator, ticks);
        assert_eq!(dead(false, 5.0), ["`Space`"]);
        assert!(dead(true, 5.0).is_empty());
        assert!(dead(false, 20.0).is_empty(), "the episode has 40 ticks, which is too short");
    }

    #[test]
    fn an_action_that_has_an_effect_where_the_agent_takes_it_is_not_dead() {
        let begins_by_enter = |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Runner, Transform::default()));
            })
            .add_systems(
                Update,
                |keys: Res<ButtonInput<KeyCode>>, mut at: Single<&mut Transform, With<Runner>>| {
                    let x = &mut at.translation.x;
                    let moves = if *x < 1.0 { KeyCode::Enter } else { KeyCode::ArrowRight };
                    *x += f32::from(u8::from(keys.pressed(moves)));
                },
            );
        };
        let game = ForeignGame::new("runner", 1, begins_by_enter)
            .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::Enter]])
            .observe(["x"], |at: Single<&Transform, With<Runner>>| [at.translation.x])
            .end(|at: Single<&Transform, With<Runner>>| (at.translation.x >= 40.0).then_some(EpisodeEnd::WON))
            .time_limit(100)
            .demonstrator("runs", |at: Single<&Transform, With<Runner>>| 1 + u32::from(at.translation.x < 1.0));
        assert!(dead(&game, &Player::Demonstrator, 5.0).is_empty());
    }

    #[test]
    fn an_episode_without_success_tells_if_its_agent_gets_around() {
        let position = |at: Single<&Transform, With<Runner>>| at.translation.truncate();
        let rests = Player::Blind(BlindBot::Constant(ActionValue::Discrete(0)));
        let reported = |game: ForeignGame, player: &Player| dead(&game, player, 5.0);
        assert_eq!(reported(game(false, 1e9).position(position), &Player::Demonstrator), ["`Space`"]);
        assert!(reported(game(true, 1e9).position(position), &Player::Demonstrator).is_empty());
        assert!(reported(game(false, 1e9).position(position), &rests).is_empty(), "it may be stuck");
        assert!(reported(game(false, 1e9), &Player::Demonstrator).is_empty(), "its position is unknown");
    }

    #[test]
    fn the_tester_that_solves_the_level_counts_or_else_the_one_with_the_best_return() {
        let reported = |episodes: &[(u32, bool, f64)]| {
            let tested = |&(number, success, total_reward): &(u32, bool, f64)| {
                let end = EpisodeEnd::Terminated { success };
                let result = EpisodeResult { level: 0, end, success, ticks: 1, clipped: 0, total_reward };
                TestedBy {
                    name: "random",
                    player: &Player::Demonstrator,
                    observation_config: ObservationConfig::default(),
                    seed: 0,
                    episodes: vec![(number, result)],
                    positions: BTreeMap::new(),
                }
            };
            let (game, testers) = (game(true, 1.0), episodes.iter().map(tested).collect());
            let mode = "default";
            let level = TestedLevel { game: &game, mode, level: 0, index: 0, par: None, testers, stop: &|| false };
            teller(&level).map(|tester| tester.episodes[0].1.total_reward)
        };
        assert_eq!(reported(&[(0, false, 9.0), (0, true, 1.0), (0, true, 2.0)]), Some(1.0));
        assert_eq!(reported(&[(0, false, 1.0), (0, false, 9.0), (1, false, 12.0)]), Some(9.0));
        assert_eq!(reported(&[(0, false, 9.0), (1, true, 2.0)]), None, "the first episodes of others say nothing");
        assert_eq!(reported(&[]), None);
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
