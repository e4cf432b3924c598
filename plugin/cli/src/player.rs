//! Players named on the command line.

use std::path::{Path, PathBuf};

use bevy_playbot::{
    policy::ActionDraw,
    policy_file::{PolicyMisfit, check_policy, policy_observation},
    skill_prior::SkillPrior,
    vision::ObservationConfig,
};
use playbot_lab::sensors::GameSensors;
use playbot_lab::{
    eval::Player,
    game::Game,
    report::whole,
    train::{
        checkpoint::CheckpointChoice,
        run_dir::{OpenedRun, RunDir},
    },
};
use playbot_learner::{DeviceKind, SeenLevels};

use super::{compute::Device, error::CliError, methods, open, unseen::seen_by_run};

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
    /// Checkpoint of the run: last, best (highest return in training), or its number of environment steps.
    #[arg(long, default_value = "last", requires = "run")]
    checkpoint: CheckpointChoice,
    /// The policy takes its most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
    #[command(flatten)]
    device: Device,
}

/// A player, its name and its observation.
pub struct Chosen {
    /// Its name in messages.
    pub name: String,
    /// The player.
    pub player: Player,
    /// The observation that it was trained with; vectors for bots.
    pub observation_config: ObservationConfig,
    /// The levels that it has learned from, if noted; `None` for bots.
    pub seen: Option<SeenLevels>,
}

impl Chosen {
    /// Returns a bot of the game by its name.
    ///
    /// # Errors
    ///
    /// The game has no such bot.
    pub fn bot(game: &dyn Game, name: &str) -> Result<Self, CliError> {
        Ok(Self {
            name: name.to_owned(),
            player: methods::bot(game, name)?,
            observation_config: ObservationConfig::default(),
            seen: None,
        })
    }

    /// Returns the demonstrator, or else the first of the game's bots.
    ///
    /// # Errors
    ///
    /// The game has none.
    pub fn usual(game: &dyn Game) -> Result<Self, CliError> {
        let bots = methods::bot_names(game);
        let name = game.tools().bots.demonstrator().or(bots.first().copied());
        let nobody = || CliError::Usage(format!("`{}` has no bot: name a --policy or a --run", game.name()));
        Self::bot(game, name.ok_or_else(nobody)?)
    }

    /// Loads the policy in a file, under the name of its algorithm.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn policy_file(game: &dyn Game, path: &Path, draw: ActionDraw, device: DeviceKind) -> Result<Self, CliError> {
        let file = open::policy(path, device)?;
        check_policy(&game.card(), &file).map_err(|misfit| does_not_fit(path, &misfit))?;
        let (player, observation_config) = (Player::of_file(&file, draw), policy_observation(&file)?);
        Ok(Self { name: file.card.algorithm, player, observation_config, seen: file.card.seen })
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
        if choice == CheckpointChoice::Last && done < wanted {
            let path = run.path().display();
            tell!("{path} is not trained to its end: it has {} of {} steps", whole(done as f64), whole(wanted as f64));
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
pub fn check_run_of(path: &Path, own: &str, named: &str) -> Result<(), CliError> {
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

impl PlayerArgs {
    /// Loads the player; `None` if none is named.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn load(&self, game: &dyn Game) -> Result<Option<Chosen>, CliError> {
        let draw = if self.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
        if let Some(name) = &self.bot {
            return Ok(Some(Chosen::bot(game, name)?));
        }
        if let Some(path) = &self.policy {
            return Ok(Some(Chosen::policy_file(game, path, draw, self.device.device)?));
        }
        let Some(path) = &self.run else { return Ok(None) };
        let opened = RunDir::open(path)?;
        check_run_of(path, &opened.experiment.game, game.name())?;
        let chosen = Chosen::run(game, &opened, self.checkpoint, draw, self.device.device)?;
        chosen.check_fit(game)?;
        Ok(Some(chosen))
    }

    /// Returns true if a player is named.
    #[cfg(feature = "window")]
    pub fn is_named(&self) -> bool {
        self.policy.is_some() || self.run.is_some() || self.bot.is_some()
    }
}
