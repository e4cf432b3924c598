//! The replay of an episode, by its actions or by its player.

use crate::{detectors::ErrorLogReader, findings::StoredFinding};
use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue, Actions},
    agent::Control,
    bot::BlindBot,
    demo::{file::DemoEpisode, replay::Replay},
    engine::{EpisodeSeeds, LevelFiles, misfit, panics::PanicReports, tick_world},
    episode::{Episode, EpisodeResult},
    fault::Fault,
    level::{LevelFile, LevelQueue},
    reward::Reward,
    state_hash::StateHash,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    eval::Player,
    game::{Game, idle_action, read_level_designs},
    level_files::{LevelFileError, is_level_files},
    worlds::{EndedEpisodes, build_observing_world},
};
use playbot_learner::HasExitCode;
use std::sync::Arc;
use thiserror::Error;

/// Ticks after which an episode counts as endless, as in tests of levels.
const MOST_TICKS: u32 = 1_000_000;

/// Beginning of the message of a game's panic, after its position.
const PANICKED: &str = "the game panicked: ";

/// Part of the message of a game that panicked while its World was built.
const UNBUILT: &str = "panicked when it was added to the app: ";

/// Beginning of the message of an agent whose pictures were all blank.
const BLANK: &str = "each picture of an episode of ";

/// The result of a replayed episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Action of each tick, as it was played: an illegal one is replaced, see [`LegalActions`].
    ///
    /// [`LegalActions`]: bevy_playbot::legal::LegalActions
    pub actions: Vec<ActionValue>,
    /// Reward of each tick.
    pub rewards: Vec<f32>,
    /// Hash of the game's state after each tick.
    pub state_hashes: Vec<u32>,
    /// The result of the episode, if it ended.
    pub end: Option<EpisodeResult>,
    /// The panic or fault of the game, if there was one.
    pub broken: Option<Breakage>,
    /// The tick in which a watcher saw the finding; the replay ends there.
    pub noticed: Option<u32>,
    /// The file of the level, for levels from files.
    pub level_file: Option<LevelFile>,
}

impl Replayed {
    /// Returns the hash of the state after a tick, or after the last one before it.
    pub fn state_hash(&self, tick: u32) -> Option<u32> {
        self.state_hashes.get(tick as usize).or(self.state_hashes.last()).copied()
    }

    /// Adds a tick. Returns whether the episode goes on.
    fn note(&mut self, solo: &Solo, watcher: Option<&mut Watcher>) -> bool {
        let (reward, hash) = solo.outcome();
        self.actions.extend(solo.action());
        self.rewards.push(reward);
        self.state_hashes.push(hash);
        self.end = solo.end();
        self.noticed = watcher.and_then(|watch| watch(&solo.moment()));
        self.end.is_none() && self.noticed.is_none()
    }
}

/// Plays actions up to their end, to that of the episode, or to the tick in which the watcher saw the finding.
pub(crate) fn play_actions(setting: Setting, actions: &[ActionValue], watcher: Option<Watcher>) -> Replayed {
    play_on(setting, watcher, |solo| {
        let action = actions.get(solo.ticks() as usize);
        action.is_some_and(|action| {
            solo.act(action.clone());
            true
        })
    })
}

/// Plays a recorded episode as `demo verify` does: what people pressed stays, legal or not, on the recorded file if the
/// levels are files.
pub(super) fn play_recording(setting: Setting, recorded: &DemoEpisode, watcher: Option<Watcher>) -> Replayed {
    let mut has_begun = false;
    play_on(setting, watcher, |solo| {
        if !std::mem::replace(&mut has_begun, true) {
            solo.replay(recorded);
        }
        (solo.ticks() as usize) < recorded.len()
    })
}

/// Plays while `prepare`, which is called before each tick, returns true; at most to the end of the episode, or to the
/// tick in which the watcher saw the finding.
fn play_on(setting: Setting, mut watcher: Option<Watcher>, mut prepare: impl FnMut(&mut Solo) -> bool) -> Replayed {
    // The watcher examines the World, not the observations.
    let built = Solo::new(setting, &ObservationConfig::default());
    let mut solo = built.expect("nothing can be wrong with a vector");
    if watcher.is_some() {
        solo.listen();
    }
    let mut replayed = Replayed { level_file: solo.level_file(), ..Replayed::default() };
    while prepare(&mut solo) {
        match solo.tick() {
            Err(broken) => {
                replayed.broken = Some(broken);
                return replayed;
            }
            Ok(is_tick) => {
                if is_tick && !replayed.note(&solo, watcher.as_mut()) {
                    return replayed;
                }
            }
        }
    }
    replayed.broken = solo.endless();
    replayed
}

/// Lets a player play to the end of the episode, or until the game breaks. The actions include that of the tick in
/// which it broke.
///
/// # Errors
///
/// The player's observation cannot be drawn.
pub(crate) fn play_player(
    setting: Setting,
    player: &Player,
    observation_config: &ObservationConfig,
) -> Result<(Vec<ActionValue>, Replayed), VisionError> {
    let sees = matches!(player, Player::Policy { .. });
    let observation_config = if sees { *observation_config } else { ObservationConfig::default() };
    let mut solo = Solo::new(setting, &observation_config)?;
    solo.seat(player);
    let (mut actions, mut replayed) = (Vec::new(), Replayed { level_file: solo.level_file(), ..Replayed::default() });
    let space = setting.game.actions();
    let done = |solo: &Solo| {
        // An action that does not fit had no effect.
        let action = solo.action().filter(|action| misfit(action, &space).is_none());
        action.unwrap_or_else(|| idle_action(setting.game))
    };
    loop {
        match solo.tick() {
            Err(broken) => {
                if broken.detector != "endless" {
                    actions.push(done(&solo));
                }
                replayed.broken = Some(broken);
                return Ok((actions, replayed));
            }
            Ok(true) => {
                actions.push(done(&solo));
                if !replayed.note(&solo, None) {
                    return Ok((actions, replayed));
                }
            }
            Ok(false) => {}
        }
    }
}

/// The episode to play.
#[derive(Clone, Copy)]
pub(crate) struct Setting<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    /// Random seed of the agent.
    pub seed: u64,
}

/// The World and its agent.
pub(super) struct Solo<'a> {
    game: &'a dyn Game,
    mode: &'a str,
    level: u64,
    world: World,
    agent: Entity,
    /// Ticks of the episode so far.
    ticks: u32,
    /// Ticks and frames of the World: a level may never be ready.
    runs: u32,
    /// Collects errors of the log, if they are needed.
    ear: Option<ErrorLogReader>,
    /// The errors of the last tick, and of the level's loading before it.
    errors: Vec<String>,
    /// Whether the last run was a tick of the episode.
    was_tick: bool,
}

impl<'a> Solo<'a> {
    /// Builds a World as tests of levels do, with an agent whose actions the caller sets.
    pub fn new(setting: Setting<'a>, observation_config: &ObservationConfig) -> Result<Self, VisionError> {
        let Setting { game, mode, level, seed } = setting;
        let (mut world, agents) = build_observing_world(game, mode, observation_config, 0, 0, 1)?;
        EndedEpisodes::note_in(&mut world);
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
            // The finding is the report.
            reports.keep_no_files();
        }
        let agent = agents[0];
        let queue = LevelQueue::list([level]);
        world.entity_mut(agent).insert((Control::Bot, queue, EpisodeSeeds::new([seed])));
        let (ear, errors) = (None, Vec::new());
        Ok(Self { game, mode, level, world, agent, ticks: 0, runs: 0, ear, errors, was_tick: false })
    }

    /// Collects errors of the log from now on.
    pub fn listen(&mut self) {
        self.ear = Some(ErrorLogReader::new());
    }

    /// Hands the agent over to a player.
    pub fn seat(&mut self, player: &Player) {
        let control = player.seat(self.game, &mut self.world, self.agent);
        self.world.entity_mut(self.agent).insert(control);
        player.install(&mut self.world);
    }

    /// Hands the agent over to a recorded episode.
    pub fn replay(&mut self, recorded: &DemoEpisode) {
        let mut agent = self.world.entity_mut(self.agent);
        agent.remove::<EpisodeSeeds>();
        Replay::begin(Arc::new(recorded.clone()), &mut agent);
    }

    /// Sets the agent's next action, as that of a bot that knows nothing else.
    ///
    /// A tester's bot is a component of the agent, and so is this one. Bevy orders the entities of a query by the
    /// numbers of their archetypes. An agent with a component less would shift the numbers of the game's own entities,
    /// and a game that depends on that order would play another episode than the tester has.
    pub fn act(&mut self, action: ActionValue) {
        self.world.entity_mut(self.agent).insert(BlindBot::Constant(action));
    }

    /// Runs the World. Returns whether that was a tick of the episode: a level that is still loading has no ticks.
    pub fn tick(&mut self) -> Result<bool, Breakage> {
        if let Some(endless) = self.endless() {
            return Err(endless);
        }
        self.runs += 1;
        if std::mem::take(&mut self.was_tick) {
            self.errors.clear();
        }
        let ticked = match &self.ear {
            Some(ear) => ear.listen(|| tick_world(&mut self.world)),
            None => tick_world(&mut self.world),
        };
        self.errors.extend(self.ear.as_ref().map(ErrorLogReader::take).unwrap_or_default());
        ticked.map_err(|fault| Breakage::of_fault(&fault, self.ticks))?;
        let played = match self.end() {
            Some(end) => end.ticks,
            None => self.world.get::<Episode>(self.agent).map_or(0, |episode| episode.tick),
        };
        let is_tick = played != self.ticks;
        self.ticks = played;
        self.was_tick = is_tick;
        Ok(is_tick)
    }

    /// Returns the ticks of the episode so far.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Returns the breakage if this many ticks mean that the episode is endless.
    pub fn endless(&self) -> Option<Breakage> {
        (self.ticks >= MOST_TICKS || self.runs >= 2 * MOST_TICKS).then(|| Breakage::endless(MOST_TICKS))
    }

    /// Returns the result of the episode, once it is over.
    pub fn end(&self) -> Option<EpisodeResult> {
        EndedEpisodes::of(&self.world).last().map(|(_, result)| *result)
    }

    /// Returns the agent's action in the last tick.
    pub fn action(&self) -> Option<ActionValue> {
        self.world.get::<Action>(self.agent).map(|action| action.0.clone())
    }

    /// Returns reward and state hash of the last tick.
    pub fn outcome(&self) -> (f32, u32) {
        let reward = self.world.get::<Reward>(self.agent).map_or(0.0, Reward::get);
        let hash = self.world.get::<StateHash>(self.agent).map_or(0, StateHash::folded);
        (reward, hash)
    }

    /// Returns the file of the level, for levels from files.
    pub fn level_file(&self) -> Option<LevelFile> {
        self.world.get_resource::<LevelFiles>()?.of(self.level).cloned()
    }

    /// Returns the World after its last tick.
    pub fn moment(&self) -> CheckTick<'_> {
        let (tick, end) = (self.ticks.saturating_sub(1), self.end());
        let (game, mode, world, agent) = (self.game, self.mode, &self.world, self.agent);
        CheckTick { game, mode, world, agent, tick, end, errors: &self.errors }
    }
}

/// An episode after one of its ticks.
#[derive(Clone, Copy)]
pub struct CheckTick<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its mode.
    pub mode: &'a str,
    /// Its World, with one agent.
    pub world: &'a World,
    /// The agent.
    pub agent: Entity,
    /// The tick that has just been played, from 0.
    pub tick: u32,
    /// The result of the episode, if it ended in this tick.
    pub end: Option<EpisodeResult>,
    /// Errors that were logged since the tick before, except by the engine.
    pub errors: &'a [String],
}

/// A function that receives every tick of an episode in order, and returns the tick of the finding, once it was seen.
pub type Watcher = Box<dyn FnMut(&CheckTick) -> Option<u32>>;

/// The reason why a finding cannot be replayed, in words.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct Unplayable(pub String);

impl HasExitCode for Unplayable {}

impl StoredFinding {
    /// Checks that the game is the one that was tested, and that the level is still there. A level file that was
    /// [edited](Self::edited_level) since then is there: a hand-made level is repaired by editing its file.
    ///
    /// # Errors
    ///
    /// [`Unplayable`]: another game or version, other actions, a mode that the game no longer has, a level file that is
    /// gone or cannot be read.
    pub fn check_playable(&self, game: &dyn Game) -> Result<(), Unplayable> {
        let StoredFinding { header, episode, .. } = self;
        if header.game != game.name() {
            return Err(Unplayable(format!("it was found in the game `{}`, not in `{}`", header.game, game.name())));
        }
        if header.game_version != game.version() {
            return Err(Unplayable(format!(
                "it was found in version {} of `{}`, but this is version {}: test the level again",
                header.game_version,
                header.game,
                game.version()
            )));
        }
        let actions = game.actions();
        if header.actions != actions {
            return Err(Unplayable(format!(
                "its actions are {}, but those of `{}` are {actions}",
                header.actions, header.game
            )));
        }
        if !is_level_files(&header.mode) {
            return game.check_mode(&header.mode).map_err(|error| {
                Unplayable(format!("the level no longer exists: {error}; test the levels again, or remove the finding"))
            });
        }
        let designs = read_level_designs(game, &header.mode).map_err(|error| gone(&error))?;
        match &episode.level_file {
            Some(file) if is_edited(&designs.files(), episode.level_seed, file) => Ok(()),
            Some(file) => {
                let difference = designs.files().difference(episode.level_seed, file);
                difference.map_or(Ok(()), |what| Err(Unplayable(format!("{what}, or remove the finding"))))
            }
            None => Err(Unplayable("it names no level file, though its levels are files".to_owned())),
        }
    }

    /// Returns the path of the level's file if it holds another level than in the test. `None` if it does not, if it
    /// cannot be read, and for levels that are not files.
    pub fn edited_level(&self, game: &dyn Game) -> Option<String> {
        let Self { header, episode, .. } = self;
        let file = episode.level_file.as_ref().filter(|_| is_level_files(&header.mode))?;
        let designs = read_level_designs(game, &header.mode).ok()?;
        is_edited(&designs.files(), episode.level_seed, file).then(|| file.path.clone())
    }
}

/// Returns whether the level's file is the recorded one by its path, but not by its hash.
fn is_edited(files: &LevelFiles, level: u64, recorded: &LevelFile) -> bool {
    files.of(level).is_some_and(|file| file.path == recorded.path && file.hash != recorded.hash)
}

/// Returns the words about an edited level file, as the end of a message.
pub(crate) fn since_edited(path: &str) -> String {
    format!("; the level file {path} has changed since the test")
}

/// Returns the error of a level file that cannot be read, without the general advice about patterns.
fn gone(error: &LevelFileError) -> Unplayable {
    Unplayable(match error {
        // The file may exist relative to the folder of the test.
        LevelFileError::NoFiles { pattern, folder } => format!(
            "there is no level file {pattern}, neither seen from {folder} nor unchanged in a folder above the finding: do \
             this from the folder where the test was run, or bring the recorded file back"
        ),
        error => {
            format!("the level cannot be read any more: {error}; bring the recorded file back, or remove the finding")
        }
    })
}

// Conversions between lists of actions and those of recordings.

/// Returns the number of actions with an effect.
pub(super) fn efforts(actions: &[ActionValue], idle: &ActionValue) -> u32 {
    u32::try_from(actions.iter().filter(|action| *action != idle).count()).unwrap_or(u32::MAX)
}

/// Returns the actions for a recording. Actions that do not fit the space are left out.
pub(super) fn recorded(actions: &[ActionValue], space: &ActionSpace) -> Actions {
    let mut all = Actions::empty(space);
    actions.iter().filter(|action| misfit(action, space).is_none()).for_each(|action| {
        // It was found to fit.
        let _ = all.push(action);
    });
    all
}

// Panics and faults of a game during an episode.

/// A failure of the game: it panicked, broke its contract, or the episode never ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breakage {
    /// `panic`, `fault`, `blank-picture` or `endless`.
    pub detector: &'static str,
    /// Tick of the episode, from 0.
    pub tick: u32,
    /// The game's message.
    pub message: String,
}

impl Breakage {
    /// Classifies a fault in this tick.
    pub fn of_fault(fault: &Fault, tick: u32) -> Self {
        let Fault(message) = fault;
        match message.split_once(PANICKED) {
            Some((_, words)) => Self { detector: "panic", tick, message: words.to_owned() },
            None => Self { detector: detector_of(message), tick, message: without_moment(message).to_owned() },
        }
    }

    /// Creates the breakage of an episode that has not ended after this many ticks.
    pub(super) fn endless(tick: u32) -> Self {
        let message = format!("the episode has not ended after {tick} ticks: give the game a time limit");
        Self { detector: "endless", tick, message }
    }
}

/// Returns the detector of a fault with this message.
pub(crate) fn detector_of(message: &str) -> &'static str {
    if [PANICKED, UNBUILT].iter().any(|part| message.contains(part)) {
        "panic"
    } else if message.contains(BLANK) {
        "blank-picture"
    } else {
        "fault"
    }
}

/// Returns a message such as `agent 0, level 3, tick 7: words` without its beginning.
fn without_moment(message: &str) -> &str {
    match message.split_once(": ") {
        Some((place, words)) if place.starts_with("agent ") => words,
        _ => message,
    }
}

/// Returns whether two messages are equal, except for numbers and, after a panic, the line of the source.
pub(super) fn say_the_same(one: &str, other: &str) -> bool {
    fn letters(message: &str) -> impl Iterator<Item = char> {
        let place = message.rfind(" (").filter(|_| message.ends_with(')'));
        let words = place.filter(|&at| message[at..].contains(".rs:")).map_or(message, |at| &message[..at]);
        words.chars().filter(|letter| !letter.is_ascii_digit())
    }
    letters(one).eq(letters(other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::testing::stored;
    use bevy::prelude::KeyCode;
    use playbot_harness::foreign::ForeignGame;

    #[test]
    fn a_level_file_that_is_gone_is_reported_without_patterns() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {}).keys([vec![], vec![KeyCode::Space]]);
        let mut finding = stored();
        finding.header.mode = "files:none/gone.json".to_owned();
        let words = finding.check_playable(&game).expect_err("it is gone").to_string();
        assert!(words.starts_with("there is no level file none/gone.json, neither seen from "), "{words}");
        assert!(words.ends_with("where the test was run, or bring the recorded file back"), "{words}");
        assert!(!words.contains('*'), "{words}");
    }

    #[test]
    fn other_games_and_versions_are_named() {
        let said = |name, version| {
            let game = ForeignGame::new(name, version, |_: &mut bevy::prelude::App| {});
            stored().check_playable(&game).expect_err("another one").to_string()
        };
        assert_eq!(said("forest", 1), "it was found in the game `garden`, not in `forest`");
        assert!(said("garden", 2).starts_with("it was found in version 1 of `garden`, but this is version 2"));
        assert!(said("garden", 1).starts_with("its actions are 2 discrete actions, but"));
    }

    #[test]
    fn actions_go_into_recordings_and_come_back() {
        let space = ActionSpace::Discrete(3);
        let actions = [2, 0, 1].map(ActionValue::Discrete);
        assert!(recorded(&actions, &space).iter().eq(actions.iter().cloned()));
        let space = ActionSpace::Continuous(2);
        let actions = [ActionValue::Continuous(vec![0.5, -1.0]), ActionValue::Continuous(vec![0.0, 0.0])];
        assert!(recorded(&actions, &space).iter().eq(actions.iter().cloned()));
        assert!(recorded(&[], &space).is_empty());
        assert_eq!(efforts(&actions, &actions[1]), 1);
    }

    #[test]
    fn a_panic_is_distinguished_from_a_fault_and_both_without_their_place() {
        let of = |words: &str| Breakage::of_fault(&Fault(words.to_owned()), 7);
        let panic = of("agent 0, level 3, tick 7: the game panicked: it burns (src/fire.rs:3:9)");
        assert_eq!((panic.detector, panic.message.as_str()), ("panic", "it burns (src/fire.rs:3:9)"));
        let fault = of("agent 0, level 3, tick 7: the reward is NaN: why");
        assert_eq!((fault.detector, fault.message.as_str(), fault.tick), ("fault", "the reward is NaN: why", 7));
        assert_eq!(of("no camera: none").message, "no camera: none");
        let blank =
            of("agent 0, level 3: each picture of an episode of 9 ticks was of a single colour; point it elsewhere");
        assert!(blank.detector == "blank-picture" && blank.message.starts_with("each picture"), "{blank:?}");
    }

    #[test]
    fn played_actions_make_as_many_archetypes_as_the_bot_that_chose_them() {
        let game = ForeignGame::new("line", 1, |_: &mut bevy::prelude::App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .demonstrator("runner", || 1)
            .time_limit(9);
        let archetypes = |player: Option<Player>| {
            let setting = Setting { game: &game, mode: "default", level: 0, seed: 3 };
            let mut solo = Solo::new(setting, &ObservationConfig::default()).expect("a vector");
            player.iter().for_each(|player| solo.seat(player));
            while solo.ticks() < 4 {
                if player.is_none() {
                    solo.act(ActionValue::Discrete(1));
                }
                solo.tick().expect("it goes on");
            }
            assert_eq!(solo.action(), Some(ActionValue::Discrete(1)));
            solo.world.archetypes().len()
        };
        let played = archetypes(None);
        assert_eq!(archetypes(Some(Player::Demonstrator)), played);
        assert_eq!(archetypes(Some(Player::Blind(BlindBot::Constant(ActionValue::Discrete(1))))), played);
    }

    #[test]
    fn numbers_and_lines_of_the_source_do_not_matter() {
        assert!(say_the_same("it burns (src/fire.rs:3:9)", "it burns (src/fire.rs:12:1)"));
        assert!(say_the_same("value 12 is NaN", "value 7 is NaN"));
        assert!(!say_the_same("it burns (a)", "it burns (b)"));
        assert!(!say_the_same("it burns", "it freezes"));
    }
}
