//! Testers on the command line.

use crate::{
    arguments::{
        name_in_list, open,
        player::{LoadedPlayer, MeasuredLevels, action_draw, check_run_of},
    },
    error::CliError,
    verbs::{bugs::testers::Named, skills::SkillNames},
};
use playbot_harness::{game::Game, sealed_file::file_checksum, split::LevelSplit};
use playbot_learner::DeviceKind;
use playbot_test::verdict::{TestedRun, Tester, TesterRecord};
use playbot_train::{checkpoint::CheckpointChoice, run_dir::RunDir};
use std::path::PathBuf;

/// Bots, policies and runs.
#[derive(clap::Args, Clone, Debug)]
pub struct TesterArgs {
    /// Bots of the game, such as random, separated by commas. An unknown name lists all. Default: the game's
    /// demonstrator, or else its first bot.
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = name_in_list)]
    bot: Vec<String>,
    /// Policy file, as written by `playbot policy export` (repeatable). Results have the name of the file, or a name in
    /// front of it, as in ppo=runs/bot.policy. With such a name, --against recognises a file that was moved.
    #[arg(long, value_name = "[NAME=]FILE")]
    policy: Vec<PathBuf>,
    /// Folder of a run (repeatable).
    #[arg(long, value_name = "DIR")]
    run: Vec<PathBuf>,
    /// Checkpoint of the runs: last, best (highest return in training, or rating against
    /// rivals), or its number of environment steps.
    #[arg(long, default_value = "last", requires = "run")]
    checkpoint: CheckpointChoice,
    /// Policies take their most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
}

impl TesterArgs {
    /// Loads the testers. Policies and runs have the names of their files and folders, unless a policy is given another
    /// name. Levels that they have learned from are reported.
    ///
    /// # Errors
    ///
    /// One of them does not exist, or was made for another game, or two have one name, or the file with the names of a
    /// policy's skills is damaged.
    pub fn load(&self, game: &dyn Game, split: &LevelSplit, device: DeviceKind) -> Result<Vec<Tester>, CliError> {
        let levels = std::slice::from_ref(split);
        let mut measured = MeasuredLevels::new(game, levels, true);
        let draw = action_draw(self.greedy, !(self.policy.is_empty() && self.run.is_empty()))?;
        let mut testers = Vec::new();
        for name in &self.bot {
            testers.push(of_bot(LoadedPlayer::bot(game, name)?));
        }
        for given in &self.policy {
            let named = Named::given(given);
            let path = named.as_ref().map_or(given.as_path(), |named| named.path.as_path());
            let chosen = LoadedPlayer::policy_file(game, path, draw, device)?;
            chosen.check_fit(game)?;
            let known = measured.check(path, chosen.seen.as_ref())?;
            let name = named.as_ref().map(|named| named.name.clone());
            let skill_names = SkillNames::beside_policy(path)?.regions;
            let record = TesterRecord { known, skill_names, ..TesterRecord::policy(name, path, file_checksum(path)?) };
            testers.push(self.of_policy(chosen, record));
        }
        for path in &self.run {
            let opened = RunDir::open(path)?;
            check_run_of(path, &opened.experiment.game, game.name())?;
            let checkpoint = open::checkpoint(&opened.run, opened.info.algorithm, self.checkpoint)?;
            let checksum = Some(file_checksum(&checkpoint.learner_file())?);
            // Another checkpoint may be the last one by now, while the run is trained.
            let step = checkpoint.summary.step;
            let chosen = LoadedPlayer::run(game, &opened, CheckpointChoice::Step(step), draw, device)?;
            chosen.check_fit(game)?;
            let known = measured.check(path, chosen.seen.as_ref())?;
            let name = path.file_name().map_or(chosen.name.clone(), |name| name.to_string_lossy().into_owned());
            let tested = Some(TestedRun { folder: path.display().to_string(), step });
            let skill_names = SkillNames::of_run(path)?.regions;
            let record = TesterRecord { checksum, run: tested, known, skill_names, ..TesterRecord::bot(name) };
            testers.push(self.of_policy(chosen, record));
        }
        if testers.is_empty() {
            testers.push(of_bot(LoadedPlayer::default_of(game)?));
        }
        check_names(testers.iter().map(|tester| &tester.record))?;
        Ok(testers)
    }

    fn of_policy(&self, chosen: LoadedPlayer, record: TesterRecord) -> Tester {
        let record = TesterRecord { greedy: self.greedy, ..record };
        Tester { record, player: chosen.player, observation_config: chosen.observation_config }
    }
}

fn of_bot(chosen: LoadedPlayer) -> Tester {
    let LoadedPlayer { name, player, observation_config, .. } = chosen;
    Tester { record: TesterRecord::bot(name), player, observation_config }
}

/// Refuses two testers of one name, which results could not keep apart.
fn check_names<'a>(testers: impl Iterator<Item = &'a TesterRecord>) -> Result<(), CliError> {
    let mut known: Vec<&TesterRecord> = Vec::new();
    for tester in testers {
        let name = &tester.name;
        if let Some(other) = known.iter().find(|other| other.name == *name) {
            let next = if other.checksum.is_none() && tester.checksum.is_none() {
                "name each bot once"
            } else {
                "write a name of its own in front of a policy's file, as in --policy other=bot.policy; a run has the name of \
                 its folder"
            };
            return Err(CliError::Usage(format!("two testers are called `{name}`: {next}")));
        }
        known.push(tester);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_testers_of_one_name_are_refused_with_advice() {
        let policy = |name: &str| TesterRecord { checksum: Some("0f".to_owned()), ..TesterRecord::bot(name) };
        let bot = TesterRecord::bot;
        let said = |testers: &[TesterRecord]| check_names(testers.iter()).map_err(|error| error.to_string());
        assert_eq!(said(&[bot("random"), policy("bot.policy"), policy("ppo")]), Ok(()));
        let bots = "two testers are called `random`: name each bot once".to_owned();
        assert_eq!(said(&[bot("random"), policy("ppo"), bot("random")]), Err(bots));
        for other in [policy("ppo"), bot("ppo")] {
            let words = said(&[policy("ppo"), other]).expect_err("one name");
            assert!(words.contains("two testers are called `ppo`: "), "{words}");
            assert!(words.contains("--policy other=bot.policy"), "{words}");
        }
    }
}
