//! Who plays, as the command line names them.

use std::path::PathBuf;

use bevy_playbot::{
    eval::Player,
    game::Game,
    learner::{DeviceKind, PolicyFile},
    policy::ActionDraw,
    policy_file::{check_policy, policy_sight},
    skill_prior::SkillPrior,
    train::{Learner, checkpoint::Which, run_dir::RunDir},
    vision::Sight,
};

use super::{error::CliError, eval::check_fit, methods};

/// A policy, a run or a bot.
#[derive(clap::Args, Clone, Debug)]
pub struct PlayerArgs {
    /// Policy file, as written by `playbot policy export`.
    #[arg(long, value_name = "FILE", group = "player")]
    policy: Option<PathBuf>,
    /// Folder of a run.
    #[arg(long, value_name = "DIR", group = "player")]
    run: Option<PathBuf>,
    /// Bot of the game, such as random, right-jump or search.
    #[arg(long, value_name = "NAME", group = "player")]
    bot: Option<String>,
    /// Checkpoint of the run: last, best (highest return in training), or its number of environment steps.
    #[arg(long, default_value = "last", requires = "run")]
    checkpoint: Which,
    /// The policy takes its most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
    /// Where the policy computes: flex or ndarray.
    #[arg(long, default_value_t)]
    device: DeviceKind,
}

/// A player, its name and what it sees.
pub struct Chosen {
    /// Its name, for people.
    pub name: String,
    /// The player.
    pub player: Player,
    /// What it was trained to see; vectors for bots.
    pub sight: Sight,
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
            let player = methods::bot(game, name)?;
            return Ok(Some(Chosen { name: name.clone(), player, sight: Sight::default() }));
        }
        if let Some(path) = &self.policy {
            let file = PolicyFile::load(path, self.device)?;
            check_policy(game, &file)?;
            let (prior, sight) = (file.skills.as_ref().map(SkillPrior::from), policy_sight(&file)?);
            let player = Player::Policy { policy: file.policy, prior, draw };
            return Ok(Some(Chosen { name: file.card.algorithm, player, sight }));
        }
        let Some(path) = &self.run else { return Ok(None) };
        let (run, experiment, info) = RunDir::open(path)?;
        if experiment.game != game.name() {
            return Err(CliError::Usage(format!("{} is a run of `{}`", path.display(), experiment.game)));
        }
        let learner = Learner::load(info.algorithm, &run.checkpoint(self.checkpoint)?.learner_file(), self.device)?;
        let (name, policy, sight) = (info.algorithm.name().to_owned(), learner.policy(), experiment.sight());
        check_fit(game, &name, &sight, &policy)?;
        let prior = learner.skills().as_ref().map(SkillPrior::from);
        Ok(Some(Chosen { name, player: Player::Policy { policy, prior, draw }, sight }))
    }

    /// Whether somebody is named.
    #[cfg(feature = "window")]
    pub fn is_named(&self) -> bool {
        self.policy.is_some() || self.run.is_some() || self.bot.is_some()
    }
}
