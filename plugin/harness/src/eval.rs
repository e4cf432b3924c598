//! Evaluation: each level equally often, every episode counted once.

use crate::{
    game::Game,
    machine::{MemoryError, check_bytes},
    parallel::on_threads,
    randomise::Randomise,
    split::LevelSplit,
    worlds::{Arrangement, BuildingCosts, EndedEpisodes, arenas_within, build_observing_world},
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::{Agent, Control},
    bot::BlindBot,
    engine::tick_world,
    episode::Episode,
    fault::Fault,
    level::LevelQueue,
    policy::{ActionDraw, ActivePolicy},
    skill_prior::SkillPrior,
    unknown_name::UnknownName,
    vision::{ObservationConfig, ObservationKind, VisionError},
};
use playbot_learner::{HasExitCode, Policy, PolicyFile, settings::is_off};
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    str::FromStr,
};
use thiserror::Error;

pub use bevy_playbot::episode::EpisodeResult;

/// Name of the bot that every game has in addition to its own: [`BlindBot::Chaos`].
pub const CHAOS: &str = "chaos";

/// The player that is evaluated.
#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "one per measurement")]
pub enum Player {
    /// A learned policy, with its skills if it has any.
    Policy {
        /// The policy.
        policy: Policy,
        /// The source of its skills.
        prior: Option<SkillPrior>,
        /// The drawing of actions.
        draw: ActionDraw,
    },
    /// A bot without sensors.
    Blind(BlindBot),
    /// The game's own demonstrator, without noise.
    Demonstrator,
    /// One of the game's [other scripted bots](crate::game::BotTools::scripted_bots), by its name.
    Scripted(&'static str),
}

/// The reason why an evaluation failed.
#[derive(Debug, Error)]
pub enum EvalError {
    /// The pictures cannot be drawn.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The results of the episodes do not fit into memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

impl HasExitCode for EvalError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) => 2,
            Self::Vision(_) | Self::Memory(_) => 3,
        }
    }
}

impl Player {
    /// Creates a player from the policy of a file, with its skills.
    pub fn of_file(file: &PolicyFile, draw: ActionDraw) -> Self {
        Self::Policy { policy: file.policy.clone(), prior: file.skills.as_ref().map(SkillPrior::from), draw }
    }

    /// Returns the bot of a game with this name: one of [`all_bots`].
    ///
    /// # Errors
    ///
    /// [`UnknownName`] with the game's bots.
    pub fn bot(game: &dyn Game, name: &str) -> Result<Self, UnknownName> {
        let (names, players): (Vec<_>, Vec<_>) = all_bots(game).into_iter().unzip();
        let found = names.iter().zip(players).find(|(known, _)| **known == name);
        found.map(|(_, player)| player).ok_or_else(|| UnknownName::new("bot", name, &names))
    }

    /// Installs the player's networks and its source of skills in a World, once.
    pub fn install(&self, world: &mut World) {
        if let Self::Policy { policy, prior, draw } = self {
            ActivePolicy { policy: policy.clone(), draw: *draw }.install(world, prior.clone());
        }
    }

    /// Prepares an agent for the player, and returns the control under which the player decides for it.
    pub fn seat(&self, game: &dyn Game, world: &mut World, agent: Entity) -> Control {
        match self {
            Self::Policy { .. } => Control::Policy,
            Self::Blind(bot) => {
                world.entity_mut(agent).insert(bot.clone());
                Control::Bot
            }
            Self::Demonstrator => {
                game.tools().bots.attach_demonstrator(world, agent, 0.0);
                Control::Bot
            }
            Self::Scripted(name) => {
                game.tools().bots.attach_scripted(world, agent, name);
                Control::Bot
            }
        }
    }
}

/// Returns the blind bots that can play a game: [its own](crate::game::BotTools::blind_bots), and [`CHAOS`].
pub fn blind_bots(game: &dyn Game) -> Vec<(&'static str, BlindBot)> {
    let mut bots = game.tools().bots.blind_bots();
    if bots.iter().all(|(name, _)| *name != CHAOS) {
        bots.push((CHAOS, BlindBot::Chaos));
    }
    bots
}

/// Returns the bots of a game that read its World: its demonstrator, if there is one, and [those that test
/// it](crate::game::BotTools::scripted_bots).
pub fn scripted_bots(game: &dyn Game) -> Vec<(&'static str, Player)> {
    let bots = game.tools().bots;
    let demonstrator = bots.demonstrator().map(|name| (name, Player::Demonstrator));
    let others = bots.scripted_bots().into_iter().map(|name| (name, Player::Scripted(name)));
    demonstrator.into_iter().chain(others).collect()
}

/// Returns all bots of a game: its demonstrator, if there is one, its [`blind_bots`], and its other [`scripted_bots`].
/// The first one plays where none is named.
pub fn all_bots(game: &dyn Game) -> Vec<(&'static str, Player)> {
    let mut bots = scripted_bots(game);
    let others = bots.split_off(usize::from(game.tools().bots.demonstrator().is_some()));
    bots.extend(blind_bots(game).into_iter().map(|(name, bot)| (name, Player::Blind(bot))));
    bots.extend(others);
    bots
}

/// The settings of an evaluation.
#[derive(Clone, Debug)]
pub struct EvalPlan {
    /// Levels.
    pub split: LevelSplit,
    /// Levels among them that are not played: see [`HeldOut::seen_in`](crate::held_out::HeldOut::seen_in).
    pub left_out: BTreeSet<u64>,
    /// The observation of a learned policy. Bots have vectors, which are cheaper.
    pub observation_config: ObservationConfig,
    /// Episodes on each level.
    pub episodes_per_level: u32,
    /// Random seed of the players.
    pub seed: u64,
    /// Arenas, spread evenly over the Worlds.
    pub arenas: u32,
    /// Worlds. With more threads arenas are spread over more of them, which changes no result.
    pub worlds: u32,
    /// Threads. They change no result.
    pub threads: usize,
    /// Values of the game that each level draws anew.
    pub randomise: Randomise,
}

/// Most Worlds of a plan for bots.
const BOT_WORLDS: u32 = 8;

impl EvalPlan {
    /// Makes the plan of a bot: one episode on each level, with random seed 0, by at most `arenas` arenas.
    pub fn of_bot(split: LevelSplit, arenas: u32, threads: usize) -> Self {
        let arenas = arenas.min(u32::try_from(split.len()).unwrap_or(arenas));
        Self {
            split,
            left_out: BTreeSet::new(),
            observation_config: ObservationConfig::default(),
            episodes_per_level: 1,
            seed: 0,
            arenas,
            worlds: BOT_WORLDS.min(arenas),
            threads,
            randomise: Randomise::default(),
        }
    }

    /// Returns the arenas that play the plan: those of the plan, or fewer in a game of few arenas for each World. It gets
    /// no more Worlds than the plan has, except for more threads.
    fn arrangement(&self, game: &dyn Game) -> Arrangement {
        let arrangement = Arrangement::of_agents(game, arenas_within(game, self.arenas, self.worlds), self.worlds);
        let arrangement = if self.randomise.is_empty() { arrangement } else { arrangement.apart(game) };
        match self.observation_config.kind {
            // A graphics card draws for few Worlds sooner.
            ObservationKind::Camera => arrangement,
            _ => arrangement.for_threads(game, self.threads),
        }
    }

    /// Returns the levels to play, in order.
    pub fn levels(&self) -> impl Iterator<Item = u64> + '_ {
        self.split.levels().filter(|level| !self.left_out.contains(level))
    }

    /// Returns the number of episodes to play.
    pub fn episodes(&self) -> u64 {
        let levels = self.split.len() - self.left_out.iter().filter(|&&level| self.has(level)).count() as u64;
        levels.saturating_mul(self.episodes_per_level.into())
    }

    fn has(&self, level: u64) -> bool {
        self.split.contains(&self.split.mode, level)
    }

    /// Checks that the Worlds and the results of all episodes fit into free memory.
    ///
    /// # Errors
    ///
    /// [`MemoryError`].
    pub fn check_memory(&self) -> Result<(), MemoryError> {
        let (levels, episodes) = (self.split.len(), u64::from(self.episodes_per_level));
        // The result of each episode, and its number in the list of those to play.
        let bytes = levels.saturating_mul(episodes).saturating_mul((size_of::<Trail>() + size_of::<u64>()) as u64);
        let what = format!("the results of {levels} levels × {episodes} episodes");
        let worlds = Arrangement { worlds: self.worlds, arenas: self.arenas / self.worlds.max(1) };
        check_bytes(what, bytes, "the number of levels, or `eval.episodes_per_level`", worlds)
    }
}

/// An evaluated episode with its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Trail {
    /// The episode.
    pub result: EpisodeResult,
    /// Position of the agent after each tick, on the game's [`FloorPlan`](crate::floor_plan::FloorPlan). Empty if the
    /// game does not report it.
    pub positions: Vec<Vec2>,
}

/// Plays every level of the plan and returns all episodes, sorted by level. `progress` receives each finished episode,
/// from several threads.
///
/// # Errors
///
/// The game broke its contract, or cannot be observed this way.
pub fn evaluate(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    progress: impl Fn(u64) + Sync,
) -> Result<Vec<EpisodeResult>, EvalError> {
    evaluate_until(game, player, plan, progress, &|| false)
}

/// Evaluates as [`evaluate`] does until the caller stops, and returns the episodes that ended by then.
///
/// # Errors
///
/// As for [`evaluate`].
pub fn evaluate_until(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    progress: impl Fn(u64) + Sync,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<EpisodeResult>, EvalError> {
    let trails = play(game, player, plan, false, progress, stop)?;
    Ok(trails.into_iter().map(|trail| trail.result).collect())
}

/// Evaluates as [`evaluate`] does, and also returns the path of every episode. The results are the same.
///
/// # Errors
///
/// The game broke its contract, or cannot be observed this way.
pub fn evaluate_with_trails(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    progress: impl Fn(u64) + Sync,
) -> Result<Vec<Trail>, EvalError> {
    play(game, player, plan, true, progress, &|| false)
}

fn play(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    follow: bool,
    progress: impl Fn(u64) + Sync,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Trail>, EvalError> {
    if let Some(problem) = game.problem() {
        return Err(Fault(problem).into());
    }
    plan.check_memory()?;
    let arrangement = plan.arrangement(game);
    // Agents that share an arena play the same episode.
    let sharing = game.tools().host.agents_per_arena().max(1);
    let progress = |ended: u64| progress(ended.div_ceil(u64::from(sharing)));
    let (costs, followed) = (BuildingCosts::default(), follow.then_some(game));
    let build = |first| costs.of(|| build_eval_world(game, player, plan, arrangement, first));
    // Worlds that draw share graphics cards, and are built one after the other. The others live as long as they play.
    let draws = observation_of(player, plan).is_image();
    let busy = arrangement.first_agents().filter(|first| u64::from(*first / sharing) < plan.episodes());
    let shares = busy.map(|first| Ok((first, if draws { Some(build(first)?) } else { None })));
    let mut shares = shares.collect::<Result<Vec<_>, VisionError>>()?;
    let parts = on_threads(&mut shares, plan.threads, |(first, built)| -> Result<Vec<Trail>, EvalError> {
        match built {
            Some(world) => Ok(play_out(world, followed, &progress, stop)?),
            None => Ok(play_out(&mut build(*first)?, followed, &progress, stop)?),
        }
    });
    tracing::info!("{costs} for `{}`", game.name());
    let mut trails = Vec::new();
    for part in parts {
        trails.extend(part?);
    }
    trails.sort_by_key(|trail| trail.result.level);
    Ok(trails)
}

/// Returns the observation of a player. Bots have vectors.
fn observation_of(player: &Player, plan: &EvalPlan) -> ObservationConfig {
    if matches!(player, Player::Policy { .. }) { plan.observation_config } else { ObservationConfig::default() }
}

/// Builds a World whose agents hold their share of the plan: agent i plays the i-th episode of every round. Agents that
/// share an arena play the same episodes.
fn build_eval_world(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    arrangement: Arrangement,
    first: u32,
) -> Result<World, VisionError> {
    let sharing = game.tools().host.agents_per_arena().max(1);
    let (per_world, total) = (arrangement.arenas, (arrangement.total() / sharing) as usize);
    let observation_config = observation_of(player, plan);
    let (mut world, agents) =
        build_observing_world(game, &plan.split.mode, &observation_config, plan.seed, first, per_world)?;
    EndedEpisodes::note_in(&mut world);
    plan.randomise.install(&mut world);
    let all: Vec<u64> = (0..plan.episodes_per_level).flat_map(|_| plan.levels()).collect();
    for (offset, &agent) in agents.iter().enumerate() {
        let levels: Vec<u64> =
            all.iter().skip((first as usize + offset) / sharing as usize).step_by(total).copied().collect();
        world.entity_mut(agent).insert(LevelQueue::list(levels));
        let control = player.seat(game, &mut world, agent);
        world.entity_mut(agent).insert(control);
    }
    player.install(&mut world);
    Ok(world)
}

/// Ticks until every agent has played its list, or the caller stops. With a game, stores the position of each agent after
/// each tick.
fn play_out(
    world: &mut World,
    followed: Option<&dyn Game>,
    progress: &(impl Fn(u64) + Sync),
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Trail>, Fault> {
    let everybody = world.query_filtered::<Entity, With<Agent>>().iter(world).collect::<Vec<_>>();
    let mut positions: HashMap<Entity, Vec<Vec2>> = HashMap::new();
    let mut trails = Vec::new();
    while everybody.iter().any(|&agent| Control::of(world, agent).is_active()) && !stop() {
        tick_world(world)?;
        let ended = EndedEpisodes::take(world);
        for (game, &agent) in followed.iter().flat_map(|game| everybody.iter().map(move |agent| (game, agent))) {
            let is_playing = world.get::<Episode>(agent).is_some_and(Episode::is_running);
            let is_seen = is_playing || ended.iter().any(|(entity, _)| *entity == agent);
            if let Some(position) = is_seen.then(|| game.tools().state.position(world, agent)).flatten() {
                positions.entry(agent).or_default().push(position);
            }
        }
        if !ended.is_empty() {
            progress(ended.len() as u64);
        }
        let trail = |(agent, result)| Trail { result, positions: positions.remove(&agent).unwrap_or_default() };
        trails.extend(ended.into_iter().map(trail));
    }
    Ok(trails)
}

// Summaries of evaluated episodes.

/// The summary of an evaluation: one row of a result table.
///
/// Standard errors estimate the distance of the means from those of all levels like these, see [`error_over_levels`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EvalSummary {
    /// Name of the player.
    pub method: String,
    /// Levels, as `mode:first..last`.
    pub split: String,
    /// Levels that were played.
    pub levels: u64,
    /// Levels of the range that were left out, since the compared players know them.
    #[serde(skip_serializing_if = "is_off")]
    pub left_out: u64,
    /// Levels that were played although the compared players know them. [`summarize`] sets 0.
    #[serde(skip_serializing_if = "is_off")]
    pub seen: u64,
    /// Different layouts of the levels that were played; `None` if unknown: see
    /// [`HeldOut::different`](crate::held_out::HeldOut::different). [`summarize`] sets `None`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layouts: Option<u64>,
    /// Episodes.
    pub episodes: u64,
    /// Mean return.
    pub return_mean: f64,
    /// Its standard error, over levels.
    pub return_se: f64,
    /// Share of episodes that reached the level's goal.
    pub success: f64,
    /// Its standard error, over levels.
    pub success_se: f64,
    /// Mean length, ticks.
    pub length_mean: f64,
    /// Share of all ticks whose action was clipped to the game's range.
    pub clipped: f64,
    /// Mean return on each level, in ascending order of levels, for comparisons level by level. It is not part of a
    /// table's JSON.
    #[serde(skip)]
    pub level_returns: Vec<f64>,
}

/// Summarises the episodes of one player on one split, all of whose other levels were left out.
pub fn summarize(method: &str, split: &LevelSplit, results: &[EpisodeResult]) -> EvalSummary {
    let by_level = |value: fn(&EpisodeResult) -> f64| -> Vec<(u64, f64)> {
        results.iter().map(|result| (result.level, value(result))).collect()
    };
    let returns = by_level(|result| result.total_reward);
    let successes = by_level(|result| f64::from(u8::from(result.success)));
    let lengths = by_level(|result| f64::from(result.ticks));
    let clipped = by_level(|result| f64::from(result.clipped));
    let level_returns = means_of_levels(&returns);
    EvalSummary {
        method: method.to_owned(),
        split: split.to_string(),
        levels: level_returns.len() as u64,
        left_out: split.len().saturating_sub(level_returns.len() as u64),
        seen: 0,
        layouts: None,
        episodes: results.len() as u64,
        return_mean: mean(&returns),
        return_se: error_over_levels(&returns),
        success: mean(&successes),
        success_se: error_over_levels(&successes),
        length_mean: mean(&lengths),
        clipped: mean(&clipped) / mean(&lengths).max(1.0),
        level_returns,
    }
}

/// A measure of an [`EvalSummary`] that can have a lower bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EvalMeasure {
    /// Share of episodes that reached the level's goal, 0 to 1.
    Success,
    /// Mean return.
    Return,
}

/// A lower bound of a measure. Written `success=0.9` or `return=8.5`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtLeast {
    /// The measure.
    pub measure: EvalMeasure,
    /// The smallest value that passes.
    pub least: f64,
}

impl AtLeast {
    /// Describes how far a measurement is below the bound, with its player and levels; `None` if it is not below.
    pub fn shortfall(&self, summary: &EvalSummary) -> Option<String> {
        let (name, value) = match self.measure {
            EvalMeasure::Success => ("success", summary.success),
            EvalMeasure::Return => ("return", summary.return_mean),
        };
        // A measure that is no number passes no bound.
        let passes = value >= self.least;
        (!passes).then(|| {
            format!("{} on {}: {name} is {value}, below the required {}", summary.method, summary.split, self.least)
        })
    }
}

/// Text that is not a valid lower bound.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum AtLeastError {
    /// The text has another form.
    #[error("`{0}` is not a lower bound: write success=0.9 or return=8.5")]
    NotABound(String),
    /// The share is larger than 1 or negative.
    #[error("`{0}`: success is a share from 0 to 1; write success=0.9 for 90 %")]
    NotAShare(String),
}

impl FromStr for AtLeast {
    type Err = AtLeastError;

    fn from_str(text: &str) -> Result<Self, AtLeastError> {
        let parse = || {
            let (name, least) = text.split_once('=')?;
            let measure = match name.trim() {
                "success" => EvalMeasure::Success,
                "return" => EvalMeasure::Return,
                _ => return None,
            };
            let least = least.trim().parse::<f64>().ok().filter(|least| least.is_finite())?;
            Some(Self { measure, least })
        };
        let bound = parse().ok_or_else(|| AtLeastError::NotABound(text.to_owned()))?;
        if bound.measure == EvalMeasure::Success && !(0.0..=1.0).contains(&bound.least) {
            return Err(AtLeastError::NotAShare(text.to_owned()));
        }
        Ok(bound)
    }
}

/// Returns the standard error of the mean of values that come in clusters, the levels. It is s / √L, with s the sample
/// standard deviation of the L level means.
///
/// Episodes of one level are alike, and those of a player without randomness are equal. Repeats of a level say nothing
/// about other levels, so they must not reduce the error. Every level counts as if it had equally many values. With a
/// single level the error is that over its episodes, and 0 for a single episode.
pub fn error_over_levels(values: &[(u64, f64)]) -> f64 {
    match &means_of_levels(values)[..] {
        [_] => standard_error(&values.iter().map(|(_, value)| *value).collect::<Vec<_>>()),
        levels => standard_error(levels),
    }
}

fn means_of_levels(values: &[(u64, f64)]) -> Vec<f64> {
    let mut levels: BTreeMap<u64, (f64, f64)> = BTreeMap::new();
    for (level, value) in values {
        let (sum, count) = levels.entry(*level).or_default();
        (*sum, *count) = (*sum + value, *count + 1.0);
    }
    levels.into_values().map(|(sum, count)| sum / count).collect()
}

fn mean(values: &[(u64, f64)]) -> f64 {
    values.iter().map(|(_, value)| value).sum::<f64>() / values.len() as f64
}

fn standard_error(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (n - 1.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;
    use bevy_playbot::episode::EpisodeEnd;

    /// Levels 0, 1 and 2 with the returns 0, 3 and 6, each repeated `times` times.
    fn repeated(times: usize) -> Vec<(u64, f64)> {
        [(0, 0.0), (1, 3.0), (2, 6.0)].into_iter().flat_map(|value| std::iter::repeat_n(value, times)).collect()
    }

    #[test]
    fn repeats_of_a_level_do_not_make_the_error_smaller() {
        // Deviations from 3: -3, 0, 3; squares 18 over n - 1 = 2 and n = 3.
        assert_eq!(error_over_levels(&repeated(1)), 3f64.sqrt());
        assert_eq!(error_over_levels(&repeated(16)), 3f64.sqrt());
    }

    #[test]
    fn what_differs_within_a_level_counts_by_its_mean() {
        let values = [(7, 1.0), (3, 4.0), (7, 3.0), (3, 6.0)];
        // Level means 5 and 2: squares 4.5 over n - 1 = 1 and n = 2.
        assert_eq!(error_over_levels(&values), 1.5);
    }

    #[test]
    fn a_single_level_has_the_error_of_its_episodes() {
        assert_eq!(error_over_levels(&[(5, 1.0), (5, 3.0)]), 1.0);
        assert_eq!(error_over_levels(&[(5, 1.0)]), 0.0);
        assert_eq!(error_over_levels(&[]), 0.0);
    }

    #[test]
    fn a_summary_counts_levels_and_episodes() {
        let split: LevelSplit = "plain:0..1".parse().expect("valid");
        let end = EpisodeEnd::LOST;
        let result =
            |level, success, total_reward| EpisodeResult { level, end, success, ticks: 10, clipped: 1, total_reward };
        let results = [result(0, true, 2.0), result(0, true, 2.0), result(1, false, 0.0), result(1, true, 0.0)];
        let summary = summarize("bot", &split, &results);
        assert_eq!((summary.levels, summary.episodes, summary.left_out), (2, 4, 0));
        assert_eq!(summarize("bot", &split, &results[2..]).left_out, 1);
        assert_eq!((summary.return_mean, summary.return_se), (1.0, 1.0));
        assert_eq!((summary.success, summary.success_se), (0.75, 0.25));
        assert_eq!((summary.length_mean, summary.clipped), (10.0, 0.1));
    }

    #[test]
    fn a_bound_names_the_measure_the_player_and_the_levels_below_it() {
        let split: LevelSplit = "plain:0..1".parse().expect("valid");
        let result = |level, success, total_reward| EpisodeResult {
            level,
            end: EpisodeEnd::LOST,
            success,
            ticks: 10,
            clipped: 0,
            total_reward,
        };
        let summary = summarize("bot", &split, &[result(0, true, 3.0), result(1, false, 2.0)]);
        let shortfall = |text: &str| text.parse::<AtLeast>().expect("valid").shortfall(&summary);
        assert_eq!(shortfall("success=0.5"), None, "equal is enough");
        assert_eq!(shortfall("return=-1"), None);
        let words = "bot on plain:0..1: success is 0.5, below the required 0.75";
        assert_eq!(shortfall("success=0.75").as_deref(), Some(words));
        let words = "bot on plain:0..1: return is 2.5, below the required 2.6";
        assert_eq!(shortfall(" return = 2.6").as_deref(), Some(words));
        assert!(shortfall("return=0").is_none() && summary.return_mean == 2.5);
        let nothing = summarize("bot", &split, &[]);
        let bound = AtLeast { measure: EvalMeasure::Return, least: 0.0 };
        assert!(bound.shortfall(&nothing).is_some(), "nothing was measured");
    }

    #[test]
    fn text_that_is_no_bound_is_refused_with_an_example() {
        let error = |text: &str| text.parse::<AtLeast>().expect_err("refused").to_string();
        for text in ["success", "wins=3", "return=much", "return=NaN", "return=inf"] {
            assert_eq!(error(text), format!("`{text}` is not a lower bound: write success=0.9 or return=8.5"));
        }
        assert_eq!(error("success=90"), "`success=90`: success is a share from 0 to 1; write success=0.9 for 90 %");
    }

    #[test]
    fn every_bot_of_a_game_is_found_by_its_name() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {}).bot("mole", || 0);
        let names = |game: &ForeignGame| all_bots(game).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
        assert_eq!(names(&game), ["random", "chaos", "mole"]);
        let game = game.demonstrator("gardener", || 1);
        assert_eq!(names(&game), ["gardener", "random", "chaos", "mole"]);
        assert!(matches!(Player::bot(&game, "mole"), Ok(Player::Scripted("mole"))));
        assert!(matches!(Player::bot(&game, "gardener"), Ok(Player::Demonstrator)));
        assert!(matches!(Player::bot(&game, "chaos"), Ok(Player::Blind(BlindBot::Chaos))));
        let error = Player::bot(&game, "mule").map(drop).expect_err("there is no such bot").to_string();
        assert_eq!(error, "unknown bot `mule` (did you mean `mole`?); valid: gardener, random, chaos, mole");
    }

    #[test]
    fn every_game_has_chaos_behind_its_own_bots() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let bots = blind_bots(&game);
        assert_eq!(bots.last(), Some(&(CHAOS, BlindBot::Chaos)));
        assert_eq!(bots.len(), game.tools().bots.blind_bots().len() + 1);
    }
}
