//! Players named on the command line.

use crate::{
    arguments::{Device, experiment::ExperimentArgs, open},
    error::CliError,
    output::print_line,
    progress::{self, console::report_clipped},
};
use bevy_playbot::{
    engine::policy_observation,
    policy::ActionDraw,
    policy_file::{PolicyMisfit, check_policy},
    skill_prior::SkillPrior,
    unknown_name::UnknownName,
    vision::ObservationConfig,
};
use playbot_harness::{
    eval::{
        EpisodeResult, EvalError, EvalPlan, EvalSummary, Player, Trail, all_bots, evaluate, evaluate_with_trails,
        summarize,
    },
    game::Game,
    games::Games,
    held_out::HeldOut,
    rivals::{RivalError, check_rivals, find_seat},
    sensors::GameSensors,
    split::LevelSplit,
};
use playbot_learner::{DeviceKind, SeenLevels, SkillModel};
use playbot_report::{ResultRow, whole};
use playbot_train::{
    Experiment,
    checkpoint::CheckpointChoice,
    run_dir::{OpenedRun, RunDir, RunInfo},
};
use serde_json::json;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Options for a policy, a run or a bot.
#[derive(clap::Args, Clone, Debug)]
#[command(mut_arg("device", |device| device.help("Device of the policy: flex or ndarray, or wgpu or cuda if built in")))]
pub struct PlayerArgs {
    /// Policy file, as written by `playbot policy export`.
    #[arg(long, value_name = "FILE", group = "player")]
    policy: Option<PathBuf>,
    /// Folder of a run.
    #[arg(long, value_name = "DIR", group = "player")]
    run: Option<PathBuf>,
    /// Bot of the game, such as random. An unknown name lists all.
    #[arg(long, value_name = "NAME", group = "player")]
    bot: Option<String>,
    /// Checkpoint of the run: last, best (highest return in training, or rating against
    /// rivals), or its number of environment steps.
    #[arg(long, default_value = "last", requires = "run", conflicts_with_all = ["policy", "bot"])]
    checkpoint: CheckpointChoice,
    /// The policy takes its most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
    #[command(flatten)]
    device: Device,
}

/// Name of the file with names of skills in the folder of a run, and the ending of one beside a policy.
pub(crate) const SKILL_NAMES: &str = "skill-names.json";

impl PlayerArgs {
    /// Returns the file with names of the policy's skills: in the folder of the run, or beside the policy. `None` for a
    /// bot.
    pub fn names_file(&self) -> Option<PathBuf> {
        let of_run = self.run.as_ref().map(|run| run.join(SKILL_NAMES));
        of_run.or_else(|| self.policy.as_ref().map(|policy| policy.with_extension(SKILL_NAMES)))
    }
}

/// A player, its name and its observation.
pub struct LoadedPlayer {
    /// Its name in messages.
    pub name: String,
    /// The player.
    pub player: Player,
    /// The observation that it was trained with; vectors for bots.
    pub observation_config: ObservationConfig,
    /// The levels that it has learned from, if noted; `None` for bots.
    pub seen: Option<SeenLevels>,
}

impl LoadedPlayer {
    /// Returns a bot of the game by its name.
    ///
    /// # Errors
    ///
    /// The game has no such bot.
    pub fn bot(game: &dyn Game, name: &str) -> Result<Self, CliError> {
        Ok(Self::of_bot(name, Player::bot(game, name)?))
    }

    fn of_bot(name: &str, player: Player) -> Self {
        Self { name: name.to_owned(), player, observation_config: ObservationConfig::default(), seen: None }
    }

    /// Returns the demonstrator, or else the first of the game's bots.
    ///
    /// # Errors
    ///
    /// The game has none.
    pub fn default_of(game: &dyn Game) -> Result<Self, CliError> {
        let no_bot = || CliError::Usage(format!("`{}` has no bot: name a --policy or a --run", game.name()));
        let (name, player) = all_bots(game).into_iter().next().ok_or_else(no_bot)?;
        Ok(Self::of_bot(name, player))
    }

    /// Loads the policy in a file, under the name of its algorithm.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn policy_file(game: &dyn Game, path: &Path, draw: ActionDraw, device: DeviceKind) -> Result<Self, CliError> {
        let file = open::policy(path, device)?;
        check_policy(&game.metadata(), &file).map_err(|misfit| does_not_fit(path, &misfit))?;
        let (player, observation_config) = (Player::of_file(&file, draw), policy_observation(&file)?);
        Ok(Self { name: file.metadata.algorithm, player, observation_config, seen: file.metadata.seen })
    }

    /// Loads the policy of a run, under the name of its algorithm. Reports it if the training has not ended.
    ///
    /// # Errors
    ///
    /// The checkpoint cannot be loaded.
    pub fn run(
        game: &dyn Game,
        opened: &OpenedRun,
        choice: CheckpointChoice,
        draw: ActionDraw,
        device: DeviceKind,
    ) -> Result<Self, CliError> {
        let OpenedRun { run, experiment, info } = opened;
        let checkpoint = open::checkpoint(run, info.algorithm, choice)?;
        let (done, wanted) = (checkpoint.summary.step, experiment.whole_steps());
        // Imitation has rounds of its own number of steps.
        if choice == CheckpointChoice::Last && done < wanted && info.algorithm.is_trained() {
            let path = run.path().display();
            report!(
                "{path} is not trained to its end: it has {} of {} steps",
                whole(done as f64),
                whole(wanted as f64)
            );
        }
        let learner = open::learner(run, info.algorithm, &checkpoint, device)?;
        let prior = learner.skills().as_ref().map(SkillPrior::from);
        Ok(Self {
            name: info.algorithm.name().to_owned(),
            player: Player::Policy { policy: learner.policy(), prior, draw },
            observation_config: experiment.observation_config(),
            seen: Some(seen_by_run(game, experiment, info)),
        })
    }

    /// Checks that a policy's observation and actions are the game's; bots always fit.
    ///
    /// # Errors
    ///
    /// The difference, in words.
    pub fn check_fit(&self, game: &dyn Game) -> Result<(), CliError> {
        let Player::Policy { policy, .. } = &self.player else { return Ok(()) };
        self.observation_config.check(game)?;
        let (seen, acts) = (self.observation_config.obs_kind(game), game.actions());
        if (policy.observation(), policy.action_space()) == (seen, acts) {
            return Ok(());
        }
        Err(CliError::Usage(format!(
            "the policy {} was made for {} and {}, but `{}` has {} and {}: use one that was trained for this game and \
             this version",
            self.name,
            policy.observation().describe(),
            policy.action_space(),
            game.name(),
            seen.describe(),
            acts
        )))
    }
}

/// Explains the misfit of a policy file that was made for another game, or another version of it.
fn does_not_fit(path: &Path, misfit: &PolicyMisfit) -> CliError {
    let path = path.display();
    CliError::Usage(match misfit {
        PolicyMisfit::Game { made_for, game } => format!("{path}: {misfit}: {}", way_out("policy", made_for, game)),
        _ => format!("{path}: {misfit}"),
    })
}

/// Checks that a run is of the named game.
///
/// # Errors
///
/// It is of another game.
pub(crate) fn check_run_of(path: &Path, own: &str, named: &str) -> Result<(), CliError> {
    if own == named {
        return Ok(());
    }
    let path = path.display();
    Err(CliError::Usage(format!("{path}: a run of the game `{own}`, not of `{named}`: {}", way_out("run", own, named))))
}

/// Returns the advice about a file of one game where another one was named.
fn way_out(what: &str, found: &str, named: &str) -> String {
    format!("name a {what} of `{named}`, or name the game `{found}`, in a program that has it")
}

/// Checks that a skill model was learned for a game, and returns its observation. Files of older versions do not name
/// their game.
///
/// # Errors
///
/// The model's observations or actions do not fit the game. The message names the game that they fit.
pub(crate) fn check_skills(
    path: &Path,
    model: &SkillModel,
    game: &dyn Game,
    from: &ExperimentArgs,
    games: &Games,
) -> Result<ObservationConfig, CliError> {
    let observation_config = ObservationConfig::from_metadata(model.picture(), &model.observation())?;
    let fits = |game: &dyn Game| {
        let can_see = observation_config.check(game).is_ok();
        can_see && (model.observation(), model.action_space()) == (observation_config.obs_kind(game), game.actions())
    };
    if fits(game) {
        return Ok(observation_config);
    }
    let others: Vec<_> = games.iter().filter(|game| fits(*game)).map(|game| game.name()).collect();
    let whose = if others.is_empty() { "no game here".to_owned() } else { others.join(" or ") };
    let advice = match others.first() {
        None => "use the program that has the game they were learned for".to_owned(),
        Some(_) if from.names_game() => "name another one".to_owned(),
        Some(game) => format!("name its experiment with --experiment, or its game, `{game}`, behind the verb"),
    };
    Err(CliError::Usage(format!(
        "{} holds skills for {} and {}, which are those of {whose}, not of `{}`: {advice}",
        path.display(),
        model.observation().describe(),
        model.action_space(),
        game.name()
    )))
}

/// Returns how policies choose their actions, by the value of --greedy.
///
/// # Errors
///
/// --greedy without a policy: bots choose their actions themselves.
pub(crate) fn action_draw(is_greedy: bool, has_policy: bool) -> Result<ActionDraw, CliError> {
    match (is_greedy, has_policy) {
        (true, true) => Ok(ActionDraw::Greedy),
        (false, _) => Ok(ActionDraw::Sample),
        (true, false) => Err(CliError::Usage("--greedy is for policies, and none is named: leave it out".to_owned())),
    }
}

impl PlayerArgs {
    /// Loads the player; `None` if none is named.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn load(&self, game: &dyn Game) -> Result<Option<LoadedPlayer>, CliError> {
        let draw = action_draw(self.greedy, self.policy.is_some() || self.run.is_some())?;
        if let Some(name) = &self.bot {
            return Ok(Some(LoadedPlayer::bot(game, name)?));
        }
        if let Some(path) = &self.policy {
            return Ok(Some(LoadedPlayer::policy_file(game, path, draw, self.device.device)?));
        }
        let Some(path) = &self.run else { return Ok(None) };
        let opened = RunDir::open(path)?;
        check_run_of(path, &opened.experiment.game, game.name())?;
        let chosen = LoadedPlayer::run(game, &opened, self.checkpoint, draw, self.device.device)?;
        chosen.check_fit(game)?;
        Ok(Some(chosen))
    }

    /// Returns true if a player is named.
    #[cfg(feature = "window")]
    pub fn is_named(&self) -> bool {
        self.policy.is_some() || self.run.is_some() || self.bot.is_some()
    }
}

// Players by name, and their measurement for `eval` and `quickstart`.

/// A measured player: its row of the result table, its episodes and its speed.
pub struct Measured {
    /// The row.
    pub summary: EvalSummary,
    /// Environment steps per second.
    pub steps_per_s: f64,
}

impl Measured {
    /// Returns the row in the form of reports.
    pub fn into_row(self) -> ResultRow {
        let summary = self.summary;
        ResultRow {
            method: summary.method,
            split: match (summary.left_out, summary.seen) {
                (0, 0) => summary.split,
                (0, seen) => format!("{} with {seen} seen", summary.split),
                (left_out, _) => format!("{} without {left_out}", summary.split),
            },
            episodes: summary.episodes as usize,
            return_mean: summary.return_mean,
            return_se: summary.return_se,
            level_returns: summary.level_returns,
            success: summary.success,
            length_mean: summary.length_mean,
            steps_per_s: Some(self.steps_per_s),
        }
    }
}

/// Measures one player, with a progress bar.
///
/// # Errors
///
/// The game broke its contract.
pub(crate) fn measure(game: &dyn Game, name: &str, player: &Player, plan: &EvalPlan) -> Result<Measured, CliError> {
    timed(name, plan, |progress| evaluate(game, player, plan, progress), |episode| episode)
        .map(|(measured, _)| measured)
}

/// As [`measure`], with the trail of every episode.
///
/// # Errors
///
/// The game broke its contract.
pub(crate) fn follow(
    game: &dyn Game,
    name: &str,
    player: &Player,
    plan: &EvalPlan,
) -> Result<(Measured, Vec<Trail>), CliError> {
    timed(name, plan, |progress| evaluate_with_trails(game, player, plan, progress), |trail| &trail.result)
}

fn timed<T>(
    name: &str,
    plan: &EvalPlan,
    play: impl FnOnce(&(dyn Fn(u64) + Sync)) -> Result<Vec<T>, EvalError>,
    result: impl Fn(&T) -> &EpisodeResult,
) -> Result<(Measured, Vec<T>), CliError> {
    let total = plan.episodes();
    let bar = progress::bar(&format!("test {name}"), total, "episodes");
    let start = std::time::Instant::now();
    let played = play(&|n| bar.inc(n))?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let episodes: Vec<_> = played.iter().map(|episode| *result(episode)).collect();
    let steps: u64 = episodes.iter().map(|episode| u64::from(episode.ticks)).sum();
    let summary = summarize(name, &plan.split, &episodes);
    report_clipped(&summary);
    Ok((Measured { summary, steps_per_s: steps as f64 / seconds }, played))
}

/// Prints a row as one line of JSON.
///
/// # Errors
///
/// Standard output is closed.
pub(crate) fn print_json(summary: &EvalSummary) -> Result<(), CliError> {
    print_line(json!(summary))
}

// Check that measured levels were not learned from.

/// The levels that players are measured on, and those of them that the players know.
pub struct MeasuredLevels<'a> {
    splits: Vec<MeasuredSplit<'a>>,
    /// The levels were named; else they are the held-out ones of the experiment.
    are_named: bool,
    /// Levels without layouts are compared by their play.
    compares_play: bool,
}

/// A range of levels that players are measured on.
struct MeasuredSplit<'a> {
    levels: HeldOut<'a>,
    /// Those that some player knows.
    known: BTreeSet<u64>,
    /// Those that players know by the levels that they have seen. The policies of a study have often learned from the same ones, and the
    /// comparison can take minutes.
    compared: Vec<(SeenLevels, BTreeSet<u64>)>,
}

impl MeasuredSplit<'_> {
    /// Returns the levels that are known to a player that has seen these.
    fn known_to(&mut self, seen: &SeenLevels) -> BTreeSet<u64> {
        if let Some((_, known)) = self.compared.iter().find(|(compared, _)| compared == seen) {
            return known.clone();
        }
        let known = progress::comparing(|progress| self.levels.seen_in(seen, progress));
        self.compared.push((seen.clone(), known.clone()));
        known
    }
}

impl<'a> MeasuredLevels<'a> {
    /// Takes ranges of levels that the game [has](LevelSplit::check).
    pub fn new(game: &'a dyn Game, splits: &'a [LevelSplit], are_named: bool) -> Self {
        let measured =
            |split| MeasuredSplit { levels: HeldOut::new(game, split), known: BTreeSet::new(), compared: Vec::new() };
        let splits = splits.iter().map(measured).collect();
        Self { splits, are_named, compares_play: game.tools().state.compares_levels() }
    }

    /// Checks that the policy in `path` has not learned from these levels. Levels that were named are only reported, and
    /// so are levels of a layout that it has seen under another number. Returns the number of levels that it knows.
    ///
    /// # Errors
    ///
    /// It has seen held-out levels.
    pub fn check(&mut self, path: &Path, seen: Option<&SeenLevels>) -> Result<u64, CliError> {
        let (path, mut known) = (path.display(), 0);
        for measured in &mut self.splits {
            let split = measured.levels.split();
            if let Some(own) = measured.levels.shown_by(seen) {
                if !self.are_named {
                    return Err(CliError::Usage(format!(
                        "{path} has learned from {own}, and the held-out levels {split} have some of these: choose \
                         levels that no player has seen, or measure there on purpose, with --levels"
                    )));
                }
                report!(
                    "{path} has learned from {own}, and the levels {split} have some of these: not all of them are unseen"
                );
            }
            let Some(seen) = seen else { continue };
            let own = measured.known_to(seen);
            if !own.is_empty() {
                let by = if self.compares_play { "number, layout or play" } else { "number or layout" };
                report!(
                    "{path} knows {} of the {} levels {}: by {by} they are among {seen}, from which it has learned",
                    whole(own.len() as f64),
                    whole(measured.levels.split().len() as f64),
                    measured.levels.split()
                );
            }
            known += own.len() as u64;
            measured.known.extend(own);
        }
        Ok(known)
    }

    /// Returns the levels of each range that some player knows.
    pub fn known(self) -> Vec<BTreeSet<u64>> {
        self.splits.into_iter().map(|measured| measured.known).collect()
    }
}

/// Returns the levels that a run has seen; for runs without a note, its training levels.
pub(crate) fn seen_by_run(game: &dyn Game, experiment: &Experiment, info: &RunInfo) -> SeenLevels {
    info.seen.clone().unwrap_or_else(|| experiment.seen_by_training(game))
}

// Rivals named on the command line: bots, policy files and runs.

/// Options for the player of the other agents of an arena.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct RivalArgs {
    /// Player of the other side, in a game whose agents play together: a bot of the game, a policy file, or the folder of
    /// a run.
    #[arg(long, value_name = "RIVAL")]
    pub rival: Option<String>,
    /// Seat of the player, by its name (default: all of them, one after the other).
    #[arg(long, value_name = "NAME", requires = "rival")]
    pub seat: Option<String>,
}

impl RivalArgs {
    /// Loads the rival; `None` if none is named. Policies draw their actions as `draw` says.
    ///
    /// # Errors
    ///
    /// The game has no rivals, no such bot and no such seat, or the policy was made for another game.
    pub fn load(
        &self,
        game: &dyn Game,
        mode: &str,
        draw: ActionDraw,
        device: DeviceKind,
    ) -> Result<Option<LoadedPlayer>, CliError> {
        let Some(name) = &self.rival else { return Ok(None) };
        check_rivals(game, mode)?;
        self.seat(game)?;
        let bots = all_bots(game);
        let names: Vec<&str> = bots.iter().map(|(name, _)| *name).collect();
        if names.contains(&name.as_str()) {
            return Ok(Some(LoadedPlayer::bot(game, name)?));
        }
        let path = Path::new(name);
        let mut rival = if path.is_dir() {
            let opened = RunDir::open(path)?;
            check_run_of(path, &opened.experiment.game, game.name())?;
            LoadedPlayer::run(game, &opened, CheckpointChoice::Last, draw, device)?
        } else if path.exists() || name.contains(['/', '\\', '.']) {
            LoadedPlayer::policy_file(game, path, draw, device)?
        } else {
            let unknown = UnknownName::new("rival", name, &names);
            return Err(CliError::Usage(format!("{unknown}; or name a policy file, or the folder of a run")));
        };
        rival.check_fit(game)?;
        if rival.observation_config.is_image() {
            return Err(CliError::Usage(format!(
                "{name}: the policy sees pictures, and rivals see vectors: name a policy that reads vectors, or a bot"
            )));
        }
        rival.name = name.clone();
        Ok(Some(rival))
    }

    /// Returns the place of the player's seat, if one is named.
    ///
    /// # Errors
    ///
    /// The game has no such seat.
    pub fn seat(&self, game: &dyn Game) -> Result<Option<usize>, RivalError> {
        self.seat.as_deref().map(|name| find_seat(game, name)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use playbot_harness::foreign::{ForeignGame, LevelSeed};
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn levels_are_compared_once_for_all_policies_that_have_seen_the_same() {
        static BUILT: AtomicUsize = AtomicUsize::new(0);
        let game = ForeignGame::new("dots", 1, |_: &mut App| {
            BUILT.fetch_add(1, Ordering::Relaxed);
        })
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["nothing"], || [0.0])
        .time_limit(3)
        .level(|_: Res<LevelSeed>| {});
        let splits: [LevelSplit; 1] = ["default:100..101".parse().expect("levels")];
        let mut measured = MeasuredLevels::new(&game, &splits, true);
        let mut built_for = |levels: &str| {
            let seen = SeenLevels { game: "dots".to_owned(), levels: vec![levels.to_owned()], ..SeenLevels::default() };
            measured.check(Path::new("a.policy"), Some(&seen)).expect("levels that are named are only reported");
            BUILT.load(Ordering::Relaxed)
        };
        let first = built_for("default:0..1");
        assert!(first > 0, "they are played");
        assert_eq!(built_for("default:0..1"), first);
        assert!(built_for("default:0..2") > first, "others");
    }
}
