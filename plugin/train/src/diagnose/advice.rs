//! Advice of a diagnosis: what to try, as commands and settings that exist.

use crate::experiment::{Algorithm, LearnerKind};
use playbot_harness::brief::shell_word;

/// What the commands of an advice name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdviceContext {
    /// Name of the game.
    pub game: String,
    /// Mode of the training levels.
    pub mode: String,
    /// Training levels.
    pub train: String,
    /// The algorithm.
    pub algorithm: Algorithm,
    /// Folder of the run; `None` before there is one.
    pub run: Option<String>,
    /// Path of the recordings; `None` if there are none.
    pub demos: Option<String>,
}

impl Default for AdviceContext {
    fn default() -> Self {
        let word = |text: &str| text.to_owned();
        let (game, mode, train) = (word("GAME"), word("MODE"), word("MODE:0..63"));
        Self { game, mode, train, algorithm: Algorithm::ScorePpo, run: None, demos: None }
    }
}

impl AdviceContext {
    fn demos(&self) -> String {
        shell_word(self.demos.as_deref().unwrap_or("demos"))
    }

    /// Returns the command that trains again with changed settings, beside those of the run.
    fn train_with(&self, settings: &[String]) -> String {
        let skills = if self.algorithm.needs_skills() { " --skills skills.safetensors" } else { "" };
        let sets: String = settings.iter().map(|set| format!(" --set {}", shell_word(set))).collect();
        let verb = if self.algorithm == Algorithm::Imitation { "imitate" } else { "train" };
        match &self.run {
            Some(run) => {
                let run = run.trim_end_matches('/');
                let (from, to) = (shell_word(&format!("{run}/experiment.ron")), shell_word(&format!("{run}-next")));
                format!("playbot {verb} --experiment {from}{skills} --run {to}{sets}")
            }
            None => {
                let game = shell_word(&self.game);
                let algorithm = match verb {
                    "train" => format!(" --algorithm {}", self.algorithm),
                    _ => String::new(),
                };
                format!("playbot {verb} {game}{algorithm}{skills} --run runs/next{sets}")
            }
        }
    }

    /// Returns the command that learns skills again with changed settings.
    fn learn_with(&self, settings: &[String]) -> String {
        let sets: String = settings.iter().map(|set| format!(" --set {}", shell_word(set))).collect();
        format!("playbot learn-skills {} --out next.safetensors{sets}", shell_word(&self.game))
    }
}

/// A next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advice {
    /// Examine the game.
    Doctor,
    /// Replay the recordings.
    Verify,
    /// Look at the recordings.
    ShowRecordings,
    /// Record the demonstrator.
    RecordAgain,
    /// Keep the recorded wins only.
    KeepWins,
    /// Fill the observation from the state.
    FillObservation,
    /// Test what the demonstrator gets.
    MeasureBots,
    /// Look for actions without an effect.
    FindDeadActions,
    /// Begin from recordings.
    UseRecordings,
    /// Reward what is new.
    BeCurious,
    /// Ask the demonstrator.
    AskDemonstrator,
    /// Train longer.
    TrainLonger,
    /// Lower the learning rate.
    LowerRate,
    /// Raise the learning rate.
    RaiseRate,
    /// Allow larger gradients.
    AllowGradients,
    /// Lower the weight of the entropy.
    LowerEntropy,
    /// Raise the weight of the entropy.
    RaiseEntropy,
    /// Look further ahead.
    LookAhead,
    /// Average advantages over more ticks.
    RaiseLambda,
    /// Lower the weight of the penalty.
    LowerPenalty,
    /// Raise the weight of the penalty.
    RaisePenalty,
    /// Normalise observations.
    NormaliseObservations,
    /// Normalise rewards.
    NormaliseRewards,
    /// Train the critic.
    TrainCritic,
    /// Fewer passes over a rollout.
    FewerPasses,
    /// Learn skills for longer.
    LearnSkillsLonger,
    /// Give the skills more room.
    LowerBeta,
    /// Train on more levels.
    MoreLevels,
    /// Make the game pay.
    PayReward,
    /// Make the game pay for the goal alone.
    PayGoal,
    /// Let the game take longer.
    RaiseTimeLimit,
    /// Show the agent more.
    ObserveMore,
    /// Let the game heed actions.
    HeedActions,
    /// Let masks allow it.
    AllowActions,
    /// Raise the version of the game's rules.
    RaiseVersion,
    /// Let the game divide its values.
    ScaleInGame,
}

impl Advice {
    /// All of them.
    pub const ALL: [Self; 36] = [
        Self::Doctor,
        Self::Verify,
        Self::ShowRecordings,
        Self::RecordAgain,
        Self::KeepWins,
        Self::FillObservation,
        Self::MeasureBots,
        Self::FindDeadActions,
        Self::UseRecordings,
        Self::BeCurious,
        Self::AskDemonstrator,
        Self::TrainLonger,
        Self::LowerRate,
        Self::RaiseRate,
        Self::AllowGradients,
        Self::LowerEntropy,
        Self::RaiseEntropy,
        Self::LookAhead,
        Self::RaiseLambda,
        Self::LowerPenalty,
        Self::RaisePenalty,
        Self::NormaliseObservations,
        Self::NormaliseRewards,
        Self::TrainCritic,
        Self::FewerPasses,
        Self::LearnSkillsLonger,
        Self::LowerBeta,
        Self::MoreLevels,
        Self::PayReward,
        Self::PayGoal,
        Self::RaiseTimeLimit,
        Self::ObserveMore,
        Self::HeedActions,
        Self::AllowActions,
        Self::RaiseVersion,
        Self::ScaleInGame,
    ];

    /// Returns the settings that it changes, as `key=value`.
    pub fn settings(self, algorithm: Algorithm) -> Vec<String> {
        let section = algorithm.learner().key();
        let is_ppo = algorithm.learner() == LearnerKind::Ppo;
        let own = |set: &str| vec![format!("{section}.{set}")];
        let one = |set: &str| vec![set.to_owned()];
        match self {
            Self::LowerRate if algorithm == Algorithm::Imitation => one("imitation.lr=0.001"),
            Self::RaiseRate if algorithm == Algorithm::Imitation => one("imitation.lr=0.003"),
            Self::LowerRate if is_ppo => own("lr=0.0003"),
            Self::LowerRate => vec!["sac.actor_lr=0.0003".to_owned(), "sac.critic_lr=0.0003".to_owned()],
            Self::RaiseRate if is_ppo => own("lr=0.0005"),
            Self::RaiseRate => vec!["sac.actor_lr=0.001".to_owned(), "sac.critic_lr=0.001".to_owned()],
            Self::AllowGradients => one("ppo.max_grad_norm=0.5"),
            Self::LowerEntropy if is_ppo => one("ppo.ent_coef=0.003"),
            Self::RaiseEntropy if is_ppo => one("ppo.ent_coef=0.03"),
            Self::BeCurious if is_ppo && algorithm.is_trained() => one("ppo.curiosity=Rnd()"),
            Self::LookAhead => own("gamma=0.99"),
            Self::RaiseLambda => one("ppo.lambda=0.95"),
            Self::LowerPenalty => one("score.kl_coef=0.1"),
            Self::RaisePenalty => one("score.kl_coef=1.0"),
            Self::NormaliseObservations if algorithm.needs_skills() => one("skills.norm_obs=true"),
            Self::NormaliseObservations => own("norm_obs=true"),
            Self::NormaliseRewards => own("norm_reward=true"),
            Self::TrainCritic => one("ppo.vf_coef=0.5"),
            Self::FewerPasses => one("ppo.epochs=2"),
            Self::LearnSkillsLonger => one("skills.epochs=100"),
            Self::LowerBeta => one("skills.beta=0.01"),
            Self::KeepWins => one("demo_wins=true"),
            Self::TrainLonger => one("steps=2000000"),
            _ => Vec::new(),
        }
    }

    /// Returns its command; `None` if it is a change of the game.
    pub fn command(self, context: &AdviceContext) -> Option<String> {
        let game = shell_word(&context.game);
        let settings = self.settings(context.algorithm);
        Some(match self {
            Self::Doctor => format!("playbot doctor {game} --mode {}", shell_word(&context.mode)),
            Self::Verify => format!("playbot demo verify {}", context.demos()),
            Self::ShowRecordings => format!("playbot demo ls {}", context.demos()),
            Self::RecordAgain => {
                format!("playbot record {game} --levels {} --out runs/demos/new.demo", shell_word(&context.train))
            }
            Self::MeasureBots => {
                format!("playbot eval {game} --bot random --bot chaos --levels {}", shell_word(&context.train))
            }
            Self::FindDeadActions => {
                format!(
                    "playbot test {game} --levels {} --detect dead-action --out runs/test",
                    shell_word(&context.train)
                )
            }
            Self::AskDemonstrator => format!("playbot imitate {game} --dagger --run runs/asked"),
            Self::UseRecordings => format!("playbot quickstart {game} --run runs/with-skills"),
            Self::KeepWins | Self::LearnSkillsLonger | Self::LowerBeta => context.learn_with(&settings),
            Self::NormaliseObservations if context.algorithm.needs_skills() => context.learn_with(&settings),
            Self::TrainLonger => match &context.run {
                Some(run) => format!("playbot train --run {} --resume --steps 2000000", shell_word(run)),
                None => context.train_with(&settings),
            },
            Self::MoreLevels => format!("playbot levels {game} --levels {}", shell_word(&context.train)),
            _ if !settings.is_empty() => context.train_with(&settings),
            _ => return None,
        })
    }

    /// Returns the advice in words, with its command.
    pub fn words(self, context: &AdviceContext) -> String {
        let why = match self {
            Self::Doctor => "look for the first difference",
            Self::Verify => "replay the recordings, which names the first tick that differs",
            Self::ShowRecordings => "look at versions, modes and results of the recordings",
            Self::RecordAgain => "record again with the present rules, on the training levels",
            Self::KeepWins => "learn from won episodes only",
            Self::FillObservation => "fill the named values in `ObserveSchedule`, from the state of the tick",
            Self::MeasureBots => "measure what blind players get",
            Self::FindDeadActions => "look for actions without an effect on each level",
            Self::UseRecordings => "begin with skills from recordings, which reach the reward",
            Self::BeCurious => "reward what is new",
            Self::AskDemonstrator => "let a policy imitate the demonstrator, and train it further",
            Self::TrainLonger => "train for longer",
            Self::LowerRate => "lower the learning rate",
            Self::RaiseRate => "raise the learning rate",
            Self::AllowGradients => "allow larger gradients",
            Self::LowerEntropy => "lower the weight of the entropy",
            Self::RaiseEntropy => "raise the weight of the entropy",
            Self::LookAhead => "raise the discount",
            Self::RaiseLambda => "raise λ",
            Self::LowerPenalty => "lower the weight of the penalty",
            Self::RaisePenalty => "raise the weight of the penalty",
            Self::NormaliseObservations => "normalise the observation",
            Self::NormaliseRewards => "normalise rewards",
            Self::TrainCritic => "give the critic's loss its weight",
            Self::FewerPasses => "learn less from each rollout",
            Self::LearnSkillsLonger => "learn skills for longer",
            Self::LowerBeta => "give the skill more room",
            Self::MoreLevels => "train on more levels; this lists equal ones",
            Self::PayReward => "call `reward.add(1.0)` in the tick in which the goal is reached",
            Self::PayGoal => "pay for progress and for the goal, not for each tick",
            Self::RaiseTimeLimit => "raise the time limit of the game's episodes, or train on shorter levels",
            Self::ObserveMore => "add what decides to the observation of the game",
            Self::HeedActions => "check the system that reads the action: a key, a condition or a set may be wrong",
            Self::AllowActions => "allow the action in `LegalActions` where it is possible",
            Self::RaiseVersion => "raise the version of the game when its rules change",
            Self::ScaleInGame => "let the game divide its values by their range",
        };
        match self.command(context) {
            Some(command) => format!("{why} with `{command}`"),
            None => why.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Experiment, file::parse_experiment};
    use std::path::Path;

    #[test]
    fn every_setting_exists_and_is_valid_for_every_algorithm() {
        let text = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "demos", steps: 1000)"#;
        let experiment = parse_experiment(text, Path::new("x.ron")).expect("valid");
        let mut settings = 0;
        for algorithm in Algorithm::ALL {
            let experiment = Experiment { algorithm, ..experiment.clone() };
            for advice in Advice::ALL {
                let sets = advice.settings(algorithm);
                let changed = experiment.with_set(&sets).unwrap_or_else(|error| panic!("{advice:?}: {error}"));
                changed.check().unwrap_or_else(|error| panic!("{advice:?}: {error}"));
                settings += sets.len();
            }
        }
        assert!(settings > 100, "{settings}");
    }

    #[test]
    fn words_name_the_command_or_the_change_of_the_game() {
        let context = AdviceContext { algorithm: Algorithm::Ppo, game: "a b".to_owned(), ..AdviceContext::default() };
        let words = Advice::LowerRate.words(&context);
        assert_eq!(
            words,
            "lower the learning rate with `playbot train 'a b' --algorithm ppo --run runs/next --set ppo.lr=0.0003`"
        );
        let of_run = AdviceContext { run: Some("runs/a".to_owned()), ..context.clone() };
        let words = "playbot train --experiment runs/a/experiment.ron --run runs/a-next --set ppo.lr=0.0003";
        assert_eq!(Advice::LowerRate.command(&of_run).as_deref(), Some(words));
        let imitated = AdviceContext { algorithm: Algorithm::Imitation, ..of_run };
        let words = "playbot imitate --experiment runs/a/experiment.ron --run runs/a-next --set imitation.lr=0.001";
        assert_eq!(Advice::LowerRate.command(&imitated).as_deref(), Some(words));
        assert!(Advice::PayReward.command(&context).is_none());
        assert!(Advice::PayReward.words(&context).starts_with("call `reward.add(1.0)`"));
    }
}
