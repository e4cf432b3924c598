//! Testers of `playbot bugs score`, from the command line.

use crate::{
    arguments::{
        name_in_list, open,
        player::{LoadedPlayer, action_draw},
    },
    error::CliError,
    verbs::explore::ExplorerSetup,
};
use bevy_playbot::{policy::ActionDraw, unknown_name::UnknownName};
use playbot_harness::{
    eval::Player,
    game::Game,
    games::{Artifact, Games},
    sealed_file::file_checksum,
};
use playbot_learner::DeviceKind;
use playbot_mutation::score::{Contestant, ContestantRecord, EXPLORE_SKILLS, Means};
use playbot_test::explore::Explorer;
use std::{
    path::{Path, PathBuf, is_separator},
    str::FromStr,
};

/// The name for the demonstrators of all games.
const DEMONSTRATOR: &str = "demonstrator";

/// Bots, explorers and policies.
#[derive(clap::Args, Clone, Debug)]
pub struct ContestantArgs {
    /// Testers, separated by commas (default: all). They are random, hold, chaos, explore, explore-skills and
    /// demonstrator. The tester hold repeats the action that a bot of the game holds, or else the game's last action.
    /// The tester chaos holds random actions for up to 30 ticks each. The tester explore-skills uses a skill model, or
    /// else the first policy that has skills. The demonstrator is the game's own bot, also by its own name. Other
    /// scripted bots of a game test by their names. Policies given with --policy test in any case.
    #[arg(long = "tester", value_name = "NAME", value_delimiter = ',', value_parser = name_in_list)]
    testers: Vec<String>,
    /// Policy file and its name in the score (repeatable). A name is used once for each game.
    #[arg(long, value_name = "NAME=FILE")]
    policy: Vec<Named>,
    /// Policies take their most probable action instead of drawing one.
    #[arg(long)]
    greedy: bool,
    /// Skill model for explore-skills (repeatable). It serves the games that it fits, or with GAME= in front only that
    /// one.
    #[arg(long, value_name = "FILE")]
    skills: Vec<String>,
}

impl ContestantArgs {
    /// Returns the testers of each of these games. A game for which no tester was named has an empty list.
    ///
    /// # Errors
    ///
    /// A file cannot be read or was made for another game, or no game has a tester of a name.
    pub fn load(
        &self,
        chosen: &[&dyn Game],
        games: &Games,
        device: DeviceKind,
    ) -> Result<Vec<Vec<Contestant>>, CliError> {
        let draw = action_draw(self.greedy, !self.policy.is_empty())?;
        let mut all: Vec<Vec<Contestant>> = chosen.iter().map(|game| Contestant::defaults(*game)).collect();
        for Named { name, path } in &self.policy {
            let metadata = open::policy(path, device)?.metadata;
            let game = games.of_file(Artifact::Policy, path, &metadata.game)?;
            // A game that is not tested needs no policy.
            if let Some(place) = chosen.iter().position(|chosen| chosen.name() == game.name()) {
                all[place].push(self.policy(name, path, game, draw, device)?);
            }
        }
        for text in &self.skills {
            self.add_skills(text, chosen, games, device, &mut all)?;
        }
        for testers in &mut all {
            let has_skills = testers.iter().any(|tester| tester.record.name == EXPLORE_SKILLS);
            let explorer = with_policy(testers).filter(|_| !has_skills);
            testers.extend(explorer);
        }
        self.keep_named(chosen, &mut all)?;
        Ok(all)
    }

    fn policy(
        &self,
        name: &str,
        path: &Path,
        game: &dyn Game,
        draw: ActionDraw,
        device: DeviceKind,
    ) -> Result<Contestant, CliError> {
        let chosen = LoadedPlayer::policy_file(game, path, draw, device)?;
        chosen.check_fit(game)?;
        let skilled = matches!(&chosen.player, Player::Policy { prior: Some(_), .. });
        let checksum = Some(file_checksum(path)?);
        let record = ContestantRecord { checksum, greedy: self.greedy, skilled, ..ContestantRecord::bot(name) };
        let (means, observation_config) = (Means::Plays(chosen.player), chosen.observation_config);
        Ok(Contestant { record, means, observation_config })
    }

    /// Gives a skill model to the games that it fits.
    fn add_skills(
        &self,
        text: &str,
        chosen: &[&dyn Game],
        games: &Games,
        device: DeviceKind,
        all: &mut [Vec<Contestant>],
    ) -> Result<(), CliError> {
        let named = text.split_once('=').filter(|(name, _)| games.get(name).is_ok());
        let path = Path::new(named.map_or(text, |(_, path)| path));
        let mut misfit = None;
        let mut has_game = false;
        for (game, testers) in chosen.iter().zip(all) {
            if named.is_some_and(|(name, _)| name != game.name()) {
                continue;
            }
            match ExplorerSetup::skills(path, *game, games, device) {
                Ok(setup) => {
                    let record = ContestantRecord {
                        checksum: Some(file_checksum(path)?),
                        skilled: true,
                        ..ContestantRecord::bot(EXPLORE_SKILLS)
                    };
                    let (means, observation_config) = (Means::Explores(setup.explorer), setup.observation_config);
                    testers.push(Contestant { record, means, observation_config });
                    has_game = true;
                }
                Err(error @ CliError::Usage(_)) => misfit = Some(error),
                Err(error) => return Err(error),
            }
        }
        match misfit.filter(|_| !has_game) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// Removes the testers that were not named.
    fn keep_named(&self, chosen: &[&dyn Game], all: &mut [Vec<Contestant>]) -> Result<(), CliError> {
        if self.testers.is_empty() {
            return Ok(());
        }
        let mut known: Vec<&str> = vec![DEMONSTRATOR];
        known.extend(all.iter().flatten().map(|tester| tester.record.name.as_str()));
        known.sort_unstable();
        known.dedup();
        if let Some(unknown) = self.testers.iter().find(|name| !known.contains(&name.as_str())) {
            if unknown == EXPLORE_SKILLS {
                return Err(CliError::Usage(format!(
                    "the tester `{EXPLORE_SKILLS}` needs skills: give a skill model with --skills FILE, or a policy that has \
                     skills with --policy NAME=FILE"
                )));
            }
            return Err(UnknownName::new("tester", unknown, &known).into());
        }
        for (game, testers) in chosen.iter().zip(all) {
            let is_named = |name: &str| {
                let is_demonstrator = game.tools().bots.demonstrator() == Some(name);
                // A policy that was given is always tested.
                let is_given = self.policy.iter().any(|policy| policy.name == name);
                is_given || self.testers.iter().any(|known| known == name || (is_demonstrator && known == DEMONSTRATOR))
            };
            testers.retain(|tester| is_named(&tester.record.name));
        }
        Ok(())
    }
}

/// Returns the explorer with the first policy that has skills.
fn with_policy(testers: &[Contestant]) -> Option<Contestant> {
    testers.iter().find_map(|tester| match &tester.means {
        Means::Plays(Player::Policy { policy, prior: Some(prior), draw }) => {
            let explorer = Explorer::Policy { policy: policy.clone(), prior: Some(prior.clone()), draw: *draw };
            let record = ContestantRecord { name: EXPLORE_SKILLS.to_owned(), ..tester.record.clone() };
            let observation_config = tester.observation_config;
            Some(Contestant { record, means: Means::Explores(explorer), observation_config })
        }
        _ => None,
    })
}

/// A file with a name in front of it: `NAME=FILE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// The name.
    pub name: String,
    /// The file.
    pub path: PathBuf,
}

impl Named {
    /// Parses an argument whose name is optional. `None` if it is just a file, which holds whenever a file of that
    /// whole name exists.
    pub fn given(given: &Path) -> Option<Self> {
        if given.exists() { None } else { given.to_str()?.parse().ok() }
    }
}

impl FromStr for Named {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_name = |name: &str| !name.is_empty() && !name.contains(is_separator);
        let parts = text.split_once('=').filter(|(name, file)| is_name(name) && !file.is_empty());
        let (name, file) = parts.ok_or("write a name and a file, as in ppo=bot.policy")?;
        Ok(Self { name: name.to_owned(), path: file.into() })
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::KeyCode;
    use playbot_harness::foreign::ForeignGame;

    use super::*;

    fn arguments(testers: &[&str]) -> ContestantArgs {
        let testers = testers.iter().map(|name| (*name).to_owned()).collect();
        ContestantArgs { testers, policy: Vec::new(), greedy: false, skills: Vec::new() }
    }

    #[test]
    fn testers_are_chosen_by_name_and_others_are_refused_with_the_nearest() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {}).keys([vec![], vec![KeyCode::Space]]);
        let all: [&dyn Game; 1] = [&game];
        let games = Games::new(&all).expect("one game");
        let load = |testers: &[&str]| arguments(testers).load(&all, &games, DeviceKind::default());
        let names = |testers: &[&str]| -> Vec<String> {
            let loaded = load(testers).expect("they are there");
            loaded[0].iter().map(|tester| tester.record.name.clone()).collect()
        };
        assert_eq!(names(&[]), ["random", "hold", "chaos", "explore"]);
        assert_eq!(names(&["explore", "chaos"]), ["chaos", "explore"]);
        assert!(names(&["demonstrator"]).is_empty(), "it has none");
        let words = load(&["choas"]).map(drop).expect_err("unknown").to_string();
        assert!(words.contains("did you mean `chaos`?"), "{words}");
        let words = load(&["explore-skills"]).map(drop).expect_err("no skills").to_string();
        assert!(words.contains("--skills FILE"), "{words}");
    }

    #[test]
    fn scripted_bots_test_by_their_names_and_the_demonstrator_by_two() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .demonstrator("jumper", || 1)
            .bot("idler", || 0);
        let all: [&dyn Game; 1] = [&game];
        let games = Games::new(&all).expect("one game");
        let names = |testers: &[&str]| -> Vec<String> {
            let loaded = arguments(testers).load(&all, &games, DeviceKind::default()).expect("they are there");
            loaded[0].iter().map(|tester| tester.record.name.clone()).collect()
        };
        assert_eq!(names(&["idler"]), ["idler"]);
        assert_eq!(
            (names(&["jumper"]), names(&["demonstrator"])),
            (vec!["jumper".to_owned()], vec!["jumper".to_owned()])
        );
        assert!(game.clone().bot(DEMONSTRATOR, || 0).problem().is_some(), "the name is that of all demonstrators");
    }

    #[test]
    fn a_name_stands_in_front_of_a_file() {
        let named = Named { name: "ppo".to_owned(), path: "a=b.policy".into() };
        assert_eq!("ppo=a=b.policy".parse(), Ok(named));
        for text in ["bot.policy", "=bot.policy", "ppo=", "runs/a=b.policy"] {
            assert!(text.parse::<Named>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_file_that_exists_needs_no_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let there = folder.path().join("ppo=bot.policy");
        std::fs::write(&there, "").expect("writable");
        assert_eq!(Named::given(&there), None);
        // A prefix that is no name is part of a path.
        assert_eq!(Named::given(&folder.path().join("ppo=none.policy")), None);
        assert_eq!(Named::given(Path::new("none.policy")), None);
        let named = Named { name: "ppo".to_owned(), path: there.clone() };
        assert_eq!(Named::given(Path::new(&format!("ppo={}", there.display()))), Some(named));
    }
}
