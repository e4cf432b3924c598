//! Who tests, as the command line names them.

use std::path::{Path, PathBuf};

use bevy_playbot::policy::ActionDraw;
use playbot_lab::{
    game::Game,
    train::{
        checkpoint::CheckpointChoice,
        checksum::file_checksum,
        run_dir::{OpenedRun, RunDir},
    },
    verdict::{Tester, TesterRecord},
};
use playbot_learner::DeviceKind;

use crate::{error::CliError, player::Chosen};

/// Bots, policies and runs.
#[derive(clap::Args, Clone, Debug)]
pub struct TesterArgs {
    /// Bots of the game, such as random, separated by commas; a name that it does not have lists all. Its demonstrator, or
    /// else its first bot, if nobody is named.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    bot: Vec<String>,
    /// Policy file, as written by `playbot policy export`; may be given several times.
    #[arg(long, value_name = "FILE")]
    policy: Vec<PathBuf>,
    /// Folder of a run; may be given several times.
    #[arg(long, value_name = "DIR")]
    run: Vec<PathBuf>,
    /// Checkpoint of the runs: last, best (highest return in training), or its number of environment steps.
    #[arg(long, default_value = "last", requires = "run")]
    checkpoint: CheckpointChoice,
    /// Policies take their most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
}

impl TesterArgs {
    /// The testers. Policies and runs have the names of their files and folders.
    ///
    /// # Errors
    ///
    /// One of them does not exist, or was made for another game.
    pub fn load(&self, game: &dyn Game, device: DeviceKind) -> Result<Vec<Tester>, CliError> {
        let draw = if self.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
        let mut testers = Vec::new();
        for name in &self.bot {
            testers.push(of_bot(Chosen::bot(game, name)?));
        }
        for path in &self.policy {
            let chosen = Chosen::policy_file(game, path, draw, device)?;
            chosen.check_fit(game)?;
            testers.push(self.of_policy(chosen, path, file_checksum(path)?));
        }
        for path in &self.run {
            let OpenedRun { run, experiment, info } = RunDir::open(path)?;
            if experiment.game != game.name() {
                return Err(CliError::Usage(format!(
                    "{}: a run of the game `{}`, not of `{}`: name a run of that one",
                    path.display(),
                    experiment.game,
                    game.name()
                )));
            }
            let checksum = file_checksum(&run.checkpoint(self.checkpoint)?.learner_file())?;
            let chosen = Chosen::run(&run, &experiment, info.algorithm, self.checkpoint, draw, device)?;
            chosen.check_fit(game)?;
            testers.push(self.of_policy(chosen, path, checksum));
        }
        if testers.is_empty() {
            testers.push(of_bot(Chosen::usual(game)?));
        }
        Ok(testers)
    }

    fn of_policy(&self, chosen: Chosen, path: &Path, checksum: String) -> Tester {
        let name = path.file_name().map_or(chosen.name, |name| name.to_string_lossy().into_owned());
        let record = TesterRecord { name, checksum: Some(checksum), greedy: self.greedy };
        Tester { record, player: chosen.player, observation_config: chosen.observation_config }
    }
}

fn of_bot(chosen: Chosen) -> Tester {
    let Chosen { name, player, observation_config } = chosen;
    Tester { record: TesterRecord::bot(name), player, observation_config }
}
