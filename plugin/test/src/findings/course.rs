//! The course of an episode tick by tick, and its comparison with another one.

use crate::{
    detectors::ShownBy,
    findings::{
        FindingHead, StoredFinding,
        checks::{Check, message_of, watcher as detector_watcher},
        play::{CheckTick, Replayed, Setting, Solo, Watcher, play_actions, play_player, play_recording},
    },
};
use bevy::math::Vec2;
use bevy_playbot::{
    action::{ActionValue, Actions},
    demo::file::{DemoEnd, DemoEpisode},
    episode::EpisodeEnd,
    level::LevelFile,
    vision::ObservationConfig,
};
use playbot_harness::{
    eval::Player,
    game::{Game, is_named_idle, level_designs, read_level_designs},
    level_files::{is_level_files, level_files_mode},
};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{
    cell::RefCell,
    fmt,
    path::{Path, PathBuf},
    rc::Rc,
    sync::Arc,
};

/// Returns the course of the episode of a bot with this seed.
pub fn course_of(game: &dyn Game, (mode, level): (&str, u64), seed: u64, bot: &Player) -> Replayed {
    let played = play_player(Setting { game, mode, level, seed }, bot, &ObservationConfig::default());
    let (_, course) = played.expect("nothing can be wrong with a vector");
    course
}

/// Returns whether a bot's episode is the same as before: the same rewards and states in each tick, and the same end.
/// It is played up to the first difference.
pub fn keeps_course(game: &dyn Game, (mode, level): (&str, u64), seed: u64, bot: &Player, course: &Replayed) -> bool {
    let built = Solo::new(Setting { game, mode, level, seed }, &ObservationConfig::default());
    let mut solo = built.expect("nothing can be wrong with a vector");
    solo.seat(bot);
    let mut ticks = 0;
    loop {
        match solo.tick() {
            Err(broken) => return course.broken.as_ref() == Some(&broken),
            Ok(false) => continue,
            Ok(true) => {}
        }
        let (reward, hash) = solo.outcome();
        let before = course.rewards.get(ticks).zip(course.state_hashes.get(ticks));
        let is_same = |(paid, state): (&f32, &u32)| paid.to_bits() == reward.to_bits() && *state == hash;
        if !before.is_some_and(is_same) {
            return false;
        }
        ticks += 1;
        match solo.end() {
            Some(end) => return course.end == Some(end),
            // The other one was over.
            None if course.end.is_some() && ticks == course.rewards.len() => return false,
            None => {}
        }
    }
}

/// The course of the actions of a recorded episode that was won, in the present game.
///
/// Its text says what has changed, for a level with the name before it: `the recording solves it in 120 ticks; its
/// actions lead elsewhere from tick 45 on, and do not reach the goal`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedCourse {
    /// Ticks of the recorded episode, which reached the goal in the last one.
    pub recorded_ticks: u64,
    /// Ticks until the actions end now.
    pub ticks: u64,
    /// The end of the actions now.
    pub end: CourseEnd,
    /// The first tick, from 0, whose reward, state or end is not the recorded one; `None` if the course is the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differs: Option<u32>,
    /// The name of the last action up to that tick that does something.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    /// Position of the agent in that tick, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f32; 2]>,
    /// Position with the largest distance from the first one, if positions are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub furthest: Option<[f32; 2]>,
}

impl RecordedCourse {
    /// Returns whether the actions reach the goal in the tick in which they were recorded to do so.
    pub fn ends_as_recorded(&self) -> bool {
        self.end == CourseEnd::Solved && self.ticks == self.recorded_ticks
    }
}

impl fmt::Display for RecordedCourse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { recorded_ticks, ticks, end, differs, action, position, furthest } = self;
        let at = |[x, y]: &[f32; 2]| format!("({x:.1}, {y:.1})");
        write!(f, "the recording solves it in {}; its actions ", counted(*recorded_ticks, "tick"))?;
        let Some(tick) = differs else { return f.write_str("still do") };
        write!(f, "lead elsewhere from tick {tick} on")?;
        action.iter().try_for_each(|action| write!(f, ", after `{action}`"))?;
        position.iter().try_for_each(|position| write!(f, ", at {}", at(position)))?;
        if self.ends_as_recorded() {
            return f.write_str(", and still reach the goal");
        }
        if *end == CourseEnd::Solved {
            return write!(f, ", and reach the goal after {}", counted(*ticks, "tick"));
        }
        f.write_str(", and do not reach the goal")?;
        furthest.iter().try_for_each(|furthest| write!(f, ": they come no further than {}", at(furthest)))
    }
}

/// The end of the actions of a recorded episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CourseEnd {
    /// They reach the goal.
    Solved,
    /// The game ends the episode without the goal.
    Lost,
    /// Time is up.
    TimedOut,
    /// The episode goes on after the last action.
    Unfinished,
    /// The game panics or breaks its contract.
    Broken,
}

/// Plays the actions of a recorded episode that was won. Positions are those that the game declares, or else guessed
/// ones.
pub fn course_of_recording(game: &dyn Game, mode: &str, recorded: &DemoEpisode) -> RecordedCourse {
    let noted = Rc::new(RefCell::new(Vec::new()));
    let positions = Rc::clone(&noted);
    let watcher: Watcher = Box::new(move |moment: &CheckTick| {
        let (state, world, agent) = (moment.game.tools().state, moment.world, moment.agent);
        let guessed = || state.guessed_position(world, agent).map(|guess| guess.position);
        let position = state.position(world, agent).or_else(guessed);
        // JSON has no other numbers.
        positions.borrow_mut().push(position.filter(|position| position.is_finite()));
        None
    });
    let setting = Setting { game, mode, level: recorded.level_seed, seed: 0 };
    let replayed = play_recording(setting, recorded, Some(watcher));
    let differs = first_difference(recorded, &replayed);
    let action = differs.and_then(|tick| last_action(game, &recorded.actions, tick));
    let positions = noted.borrow();
    let position = differs.and_then(|tick| positions.get(tick as usize).copied().flatten());
    let mut known = positions.iter().flatten().copied();
    let start = known.next();
    let furthest = start.map(|start| {
        known.fold(start, |far, next| if start.distance(next) > start.distance(far) { next } else { far })
    });
    let [position, furthest] = [position, furthest].map(|place| place.map(|place: Vec2| place.to_array()));
    let end = match (&replayed.broken, replayed.end) {
        (Some(_), _) => CourseEnd::Broken,
        (None, None) => CourseEnd::Unfinished,
        (None, Some(end)) if end.success => CourseEnd::Solved,
        (None, Some(end)) if end.end == EpisodeEnd::Truncated => CourseEnd::TimedOut,
        (None, Some(_)) => CourseEnd::Lost,
    };
    let (recorded_ticks, ticks) = (recorded.len() as u64, replayed.rewards.len() as u64);
    RecordedCourse { recorded_ticks, ticks, end, differs, action, position, furthest }
}

/// Returns the name of the last action up to a tick that does something by its name.
fn last_action(game: &dyn Game, actions: &Actions, tick: u32) -> Option<String> {
    let (names, choices) = (game.tools().input.action_names(), game.actions().choices());
    let doing = |row: usize| {
        let taken = choices.ranges().zip(actions.chosen(row)).map(|(at, &option)| at.start as u32 + option);
        taken.filter(|&number| !is_named_idle(&names, number)).last()
    };
    let last = (0..actions.len().min(tick as usize + 1)).rev().find_map(doing)?;
    names.get(last as usize).cloned()
}

/// Returns the first tick whose reward, state or end is not the recorded one.
fn first_difference(recorded: &DemoEpisode, replayed: &Replayed) -> Option<u32> {
    let (before, now) = (recorded.len(), replayed.rewards.len());
    let is_same = |tick: &usize| {
        let (paid, pays) = (recorded.rewards[*tick], replayed.rewards[*tick]);
        paid.to_bits() == pays.to_bits() && recorded.state_hashes[*tick] == replayed.state_hashes[*tick]
    };
    let shared = before.min(now);
    let end = replayed.end.map(|end| match end.end {
        EpisodeEnd::Terminated { success } => DemoEnd::Terminated { success },
        EpisodeEnd::Truncated => DemoEnd::Truncated,
    });
    let ends_differently = now < before || end.unwrap_or(DemoEnd::Aborted) != recorded.end;
    let last = || ends_differently.then_some(shared.saturating_sub(1));
    let first = (0..shared).find(|tick| !is_same(tick)).or_else(last);
    first.map(|tick| u32::try_from(tick).unwrap_or(u32::MAX))
}

impl StoredFinding {
    /// Returns the finding of this file with the right path of its level file. Level files are named relative to the
    /// folder of the test. A level file that is not in the current folder is searched for in each folder above the
    /// finding. It is accepted if it has the recorded level. Otherwise nothing changes.
    #[must_use]
    pub fn seen_from(mut self, game: &dyn Game, file: &Path) -> Self {
        if let Some(mode) = self.mode_above(game, file) {
            self.header.mode = mode;
            self.episode.level_seed = 0;
        }
        self
    }

    /// Replaces mode, number and path of the level by those of another finding, so that the level has the name from the
    /// test. The hash stays: the file may have been edited since.
    #[must_use]
    pub fn with_level_of(mut self, other: &Self) -> Self {
        self.header.mode.clone_from(&other.header.mode);
        self.episode.level_seed = other.episode.level_seed;
        let hash = self.episode.level_file.as_ref().map(|file| file.hash);
        let named = other.episode.level_file.clone();
        self.episode.level_file = named.map(|file| LevelFile { hash: hash.unwrap_or(file.hash), ..file });
        self
    }

    /// Returns the mode of the level file in a folder above this file.
    fn mode_above(&self, game: &dyn Game, file: &Path) -> Option<String> {
        let recorded = self.episode.level_file.as_ref().filter(|_| is_level_files(&self.header.mode))?;
        let path = Path::new(&recorded.path);
        if path.is_absolute() || path.exists() {
            return None;
        }
        let file = std::path::absolute(file).ok()?;
        let candidates = file.ancestors().skip(1).map(|folder| folder.join(path));
        candidates.filter(|candidate| candidate.is_file()).find_map(|candidate: PathBuf| {
            let mode = level_files_mode(candidate.to_str()?);
            let designs = read_level_designs(game, &mode).ok()?;
            // A file of that name may contain another level.
            (designs.hash(0) == Some(recorded.hash)).then_some(mode)
        })
    }
}

// Replay of actions in search of a finding.

/// The result of a replay.
pub(super) struct Look {
    /// Whether the finding is there.
    pub is_there: bool,
    /// Its tick, if it needs play.
    pub tick: Option<u32>,
    /// The replayed episode.
    pub replayed: Replayed,
    /// Its current message, if it is known.
    pub message: Option<String>,
}

/// Plays the actions, unless the check needs no play, and runs the check.
pub(super) fn look(setting: Setting, head: &FindingHead, actions: &[ActionValue], check: &Check) -> Look {
    match check {
        Check::Level(is_there) => in_level(setting, *is_there),
        Check::Episode(check) => {
            let found = in_episode(setting, actions, |replayed| check(head, replayed));
            let message = message_of(&head.detector, &found.replayed);
            Look { message, ..found }
        }
        Check::Ticks(watcher) => {
            let replayed = play_actions(setting, actions, Some(watcher(head)));
            let tick = replayed.noticed;
            Look { is_there: tick.is_some(), tick, replayed, message: None }
        }
        Check::Detector(detector) => {
            let (watcher, said) = detector_watcher(Arc::clone(detector));
            let replayed = play_actions(setting, actions, Some(watcher));
            let tick = replayed.noticed;
            Look { is_there: tick.is_some(), tick, replayed, message: said.take() }
        }
        Check::WholeLevel(detector) => match detector.shown_by() {
            ShownBy::Nothing => Look { is_there: false, tick: None, replayed: Replayed::default(), message: None },
            ShownBy::Level => in_level(setting, |game, mode, level| detector.is_in_level(game, mode, level)),
            ShownBy::Episode => in_episode(setting, actions, |replayed| {
                let end = replayed.end.filter(|end| detector.is_in_episode(end, head.tick))?;
                end.ticks.checked_sub(1)
            }),
        },
    }
}

/// Runs the check on the level, without play.
fn in_level(setting: Setting, is_there: impl Fn(&dyn Game, &str, u64) -> bool) -> Look {
    let Setting { game, mode, level, .. } = setting;
    let designs = is_level_files(mode).then(|| level_designs(game, mode).ok());
    let level_file = designs.flatten().and_then(|designs| designs.files().of(level).cloned());
    let replayed = Replayed { level_file, ..Replayed::default() };
    Look { is_there: is_there(game, mode, level), tick: None, replayed, message: None }
}

/// Plays, and runs the check on the result of the episode.
fn in_episode(setting: Setting, actions: &[ActionValue], tick: impl Fn(&Replayed) -> Option<u32>) -> Look {
    let replayed = play_actions(setting, actions, None);
    let tick = tick(&replayed);
    Look { is_there: tick.is_some(), tick, replayed, message: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::{Checks, FindingHead, keep::recheck};
    use bevy::prelude::*;
    use bevy_playbot::{
        action::{ActionSpace, ActionValue, Actions},
        bot::BlindBot,
        demo::file::{Decider, DemoEpisode},
    };
    use playbot_corridor::{Corridor, Rule, to_the_goal};
    use playbot_harness::{foreign::ForeignGame, level_files::LevelDesign};
    use std::fs;

    #[test]
    fn the_same_game_keeps_its_course_and_a_broken_one_does_not() {
        let level = ("plain", 3);
        for bot in [Player::Demonstrator, Player::Blind(BlindBot::Uniform)] {
            let course = course_of(&Corridor::default(), level, 5, &bot);
            assert!(course.end.is_some() && !course.rewards.is_empty());
            assert!(keeps_course(&Corridor::default(), level, 5, &bot, &course));
        }
        let guided = course_of(&Corridor::default(), level, 0, &Player::Demonstrator);
        let burning = Corridor { rule: Rule::Panics };
        assert!(!keeps_course(&burning, level, 0, &Player::Demonstrator, &guided));
        let idle = Player::Blind(BlindBot::Constant(ActionValue::Discrete(2)));
        assert!(!keeps_course(&Corridor::default(), level, 0, &idle, &guided), "another player goes another way");
        let broken = course_of(&burning, level, 0, &Player::Demonstrator);
        assert!(broken.broken.is_some() && keeps_course(&burning, level, 0, &Player::Demonstrator, &broken));
    }

    /// A recording of a person that walks for two ticks between the decisions of bots.
    #[test]
    fn what_a_person_has_pressed_between_decisions_is_played_again() {
        #[derive(Component)]
        struct Walker;
        let walk = |app: &mut App| {
            app.add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Walker, Transform::default()));
            })
            .add_systems(
                Update,
                |keys: Res<ButtonInput<KeyCode>>, mut walker: Single<&mut Transform, With<Walker>>| {
                    walker.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
                },
            );
        };
        let game = ForeignGame::new("walk", 1, walk)
            .keys([vec![], vec![KeyCode::ArrowRight]])
            .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
            .position(|walker: Single<&Transform, With<Walker>>| walker.translation.truncate())
            .every(4)
            .time_limit(100);
        let mut recorded = DemoEpisode::new(0, ActionSpace::Discrete(2));
        recorded.actions = Actions::Discrete(vec![0, 1, 1, 0]);
        (recorded.rewards, recorded.state_hashes) = (vec![0.0; 4], vec![0; 4]);
        recorded.deciders = vec![Decider::Human; 4];
        let course = course_of_recording(&game, "default", &recorded);
        assert_eq!(course.furthest, Some([2.0, 0.0]));
        assert_eq!((course.end, course.ticks), (CourseEnd::Unfinished, 4), "four actions reach no goal");
    }

    /// A path without a file, relative to the folder of this test.
    const LEVEL: &str = "lv-of-another-folder/a.json";

    #[test]
    fn a_level_is_found_above_its_finding_if_it_is_the_same_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let level = folder.path().join(LEVEL);
        fs::create_dir_all(level.parent().expect("a folder")).expect("writable");
        // Behind the wall.
        fs::write(&level, "9").expect("writable");
        let game = Corridor::default();
        let mode = level_files_mode(level.to_str().expect("text"));
        let head = FindingHead::new(LEVEL, "unreachable-goal", "walled in");
        let checks = Checks::default();
        let there = StoredFinding::of_actions(&game, &mode, 0, head, &to_the_goal(), &checks).expect("it is there");
        let hash = LevelDesign::new((), "9").hash();
        let mut stored = there.clone();
        stored.header.mode = level_files_mode(LEVEL);
        stored.episode.level_file = Some(LevelFile { path: LEVEL.to_owned(), hash });
        let file = folder.path().join("runs/test/findings/a.finding");
        let words = recheck(&game, &stored, &checks).expect_err("seen from elsewhere").to_string();
        assert!(words.contains("from the folder where the test was run") && !words.contains("remove"), "{words}");
        let seen = stored.clone().seen_from(&game, &file);
        assert_eq!(seen.header.mode, mode);
        assert!(recheck(&game, &seen, &checks).expect("it is found").is_same(&stored));
        assert_eq!(seen.with_level_of(&stored), stored, "what is written names no folder of a machine");
        assert_eq!(there.clone().seen_from(&game, &file), there, "what is found needs no search");
        // Another level under the name.
        fs::write(&level, "2").expect("writable");
        assert_eq!(stored.clone().seen_from(&game, &file), stored);
        fs::write(&level, "no level").expect("writable");
        assert_eq!(stored.clone().seen_from(&game, &file), stored);
    }

    #[test]
    fn levels_that_are_no_files_stay() {
        let stored = crate::findings::testing::stored();
        let file = Path::new("runs/a.finding");
        assert_eq!(stored.clone().seen_from(&Corridor::default(), file), stored);
        let mut drawn = stored;
        drawn.header.mode = level_files_mode(LEVEL);
        drawn.episode = DemoEpisode::new(0, drawn.header.actions);
        assert_eq!(drawn.clone().seen_from(&Corridor::default(), file), drawn, "it names no level file");
    }
}
