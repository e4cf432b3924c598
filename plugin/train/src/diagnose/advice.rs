//! Advice of a diagnosis: what to try, as commands and settings that exist.

use crate::experiment::{Algorithm, Experiment, LearnerKind};
use playbot_harness::brief::shell_word;

/// What the commands of an advice name.
#[derive(Clone, Debug, PartialEq)]
pub struct AdviceContext {
    /// The settings that advice changes.
    pub experiment: Experiment,
    /// Folder of the run; `None` before there is one.
    pub run: Option<String>,
    /// Path of the recordings; `None` if there are none.
    pub demos: Option<String>,
    /// File of the skill model; `None` if it is not known.
    pub skills: Option<String>,
}

impl AdviceContext {
    /// Creates the context of an experiment without a run.
    pub fn new(experiment: &Experiment) -> Self {
        let demos = experiment.demos.as_ref().map(|path| path.display().to_string());
        Self { experiment: experiment.clone(), run: None, demos, skills: None }
    }

    fn demos(&self) -> String {
        shell_word(self.demos.as_deref().unwrap_or("demos"))
    }

    /// Returns the experiment of a command: the file of the run, or the game.
    fn source(&self) -> String {
        match &self.run {
            Some(run) => {
                format!("--experiment {}", shell_word(&format!("{}/experiment.ron", run.trim_end_matches('/'))))
            }
            None => shell_word(&self.experiment.game),
        }
    }

    /// Returns the command that trains again with changed settings, beside those of the run.
    fn train_with(&self, settings: &[String]) -> String {
        let algorithm = self.experiment.algorithm;
        let skills = match algorithm.needs_skills() {
            true => format!(" --skills {}", shell_word(self.skills.as_deref().unwrap_or("skills.safetensors"))),
            false => String::new(),
        };
        let verb = if algorithm == Algorithm::Imitation { "imitate" } else { "train" };
        let (named, to) = match &self.run {
            Some(run) => (String::new(), format!("{}-next", run.trim_end_matches('/'))),
            None if verb == "train" => (format!(" --algorithm {algorithm}"), "runs/next".to_owned()),
            None => (String::new(), "runs/next".to_owned()),
        };
        format!("playbot {verb} {}{named}{skills} --run {}{}", self.source(), shell_word(&to), sets(settings))
    }

    /// Returns the command that learns skills again with changed settings.
    fn learn_with(&self, settings: &[String]) -> String {
        let demos = match &self.run {
            Some(_) => String::new(),
            None => self.demos.iter().map(|demos| format!(" --demos {}", shell_word(demos))).collect(),
        };
        format!("playbot learn-skills {}{demos} --out next.safetensors{}", self.source(), sets(settings))
    }
}

fn sets(settings: &[String]) -> String {
    settings.iter().map(|set| format!(" --set {}", shell_word(set))).collect()
}

/// Returns a smaller value: the usual one, or a third where that is no smaller.
fn lower(now: f64, usual: f64) -> f64 {
    if now > usual { usual } else { rounded(now / 3.0) }
}

/// Returns a larger value: the usual one, or three times the present one where that is no larger.
fn higher(now: f64, usual: f64) -> f64 {
    if now < usual { usual } else { rounded(now * 3.0) }
}

/// Returns three times as many steps, and two million at least.
fn longer(steps: u64) -> u64 {
    steps.saturating_mul(3).max(2_000_000)
}

/// Returns a discount with three times the horizon of `gamma`.
fn rounded_discount(gamma: f64) -> f64 {
    1.0 - rounded((1.0 - gamma) / 3.0)
}

/// Rounds to two digits, as people set values.
fn rounded(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
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
    /// Record the demonstrator with little noise.
    LessNoise,
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
    /// Clip as usual.
    UsualClip,
    /// Learn from the first step on.
    BeginAtOnce,
    /// Make a lesson easier.
    EasierLesson,
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
    pub const ALL: [Self; 40] = [
        Self::Doctor,
        Self::Verify,
        Self::ShowRecordings,
        Self::RecordAgain,
        Self::LessNoise,
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
        Self::UsualClip,
        Self::BeginAtOnce,
        Self::EasierLesson,
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
    pub fn settings(self, experiment: &Experiment) -> Vec<String> {
        let Experiment { algorithm, ppo, sac, score, skills, imitation, .. } = experiment;
        let section = algorithm.learner().key();
        let is_ppo = algorithm.learner() == LearnerKind::Ppo;
        let imitates = *algorithm == Algorithm::Imitation;
        let own = |set: &str| vec![format!("{section}.{set}")];
        let one = |set: &str| vec![set.to_owned()];
        let change = |key: &str, value: f64| vec![format!("{key}={value}")];
        let rates = |change: fn(f64, f64) -> f64, usual: f64| {
            let (actor, critic) = (change(sac.actor_lr, usual), change(sac.critic_lr, usual));
            vec![format!("sac.actor_lr={actor}"), format!("sac.critic_lr={critic}")]
        };
        match self {
            Self::LowerRate if imitates => change("imitation.lr", lower(imitation.lr, 0.001)),
            Self::RaiseRate if imitates => change("imitation.lr", higher(imitation.lr, 0.003)),
            Self::LowerRate if is_ppo => change("ppo.lr", lower(ppo.lr, 0.0003)),
            Self::LowerRate => rates(lower, 0.0003),
            Self::RaiseRate if is_ppo => change("ppo.lr", higher(ppo.lr, 0.0005)),
            Self::RaiseRate => rates(higher, 0.001),
            Self::AllowGradients => one("ppo.max_grad_norm=0.5"),
            Self::UsualClip => one("ppo.clip=0.2"),
            Self::BeginAtOnce if is_ppo => one("ppo.critic_warmup=0"),
            Self::BeginAtOnce => {
                vec![format!("sac.learning_starts={}", sac.learning_starts.min(experiment.steps / 10))]
            }
            Self::LowerEntropy if is_ppo => change("ppo.ent_coef", lower(ppo.ent_coef, 0.003)),
            Self::RaiseEntropy if is_ppo => change("ppo.ent_coef", higher(ppo.ent_coef, 0.03)),
            Self::BeCurious if is_ppo && algorithm.is_trained() => one("ppo.curiosity=Rnd()"),
            Self::LookAhead => {
                let gamma = if is_ppo { ppo.gamma } else { sac.gamma };
                change(&format!("{section}.gamma"), if gamma < 0.99 { 0.99 } else { rounded_discount(gamma) })
            }
            Self::RaiseLambda => one("ppo.lambda=0.95"),
            Self::LowerPenalty => change("score.kl_coef", lower(score.kl_coef, 0.1)),
            Self::RaisePenalty => change("score.kl_coef", higher(score.kl_coef, 1.0)),
            Self::NormaliseObservations if algorithm.needs_skills() => one("skills.norm_obs=true"),
            Self::NormaliseObservations => own("norm_obs=true"),
            Self::NormaliseRewards => own("norm_reward=true"),
            Self::TrainCritic => one("ppo.vf_coef=0.5"),
            Self::FewerPasses => change("ppo.epochs", (ppo.epochs / 2).clamp(1, 2) as f64),
            Self::LearnSkillsLonger => change("skills.epochs", higher(skills.epochs as f64, 100.0)),
            Self::LowerBeta => change("skills.beta", lower(skills.beta, 0.01)),
            Self::KeepWins => one("demo_wins=true"),
            Self::TrainLonger => vec![format!("steps={}", longer(experiment.steps))],
            _ => Vec::new(),
        }
    }

    /// Returns its command; `None` if it is a change of the game.
    pub fn command(self, context: &AdviceContext) -> Option<String> {
        let Experiment { algorithm, train, steps, .. } = &context.experiment;
        let (game, levels) = (shell_word(&context.experiment.game), shell_word(&train.to_string()));
        let settings = self.settings(&context.experiment);
        Some(match self {
            Self::Doctor => format!("playbot doctor {game} --mode {}", shell_word(&train.mode)),
            Self::Verify => format!("playbot demo verify {}", context.demos()),
            Self::ShowRecordings => format!("playbot demo ls {}", context.demos()),
            Self::RecordAgain => format!("playbot record {game} --levels {levels} --out runs/demos/new.demo"),
            Self::LessNoise => {
                format!("playbot record {game} --levels {levels} --noise 0.2 --out runs/demos/new.demo")
            }
            Self::MeasureBots => format!("playbot eval {game} --bot random --bot chaos --levels {levels}"),
            Self::FindDeadActions => {
                format!("playbot test {game} --levels {levels} --detect dead-action --out runs/test")
            }
            Self::AskDemonstrator => format!("playbot imitate {} --dagger --run runs/asked", context.source()),
            Self::UseRecordings => format!("playbot quickstart {} --run runs/with-skills", context.source()),
            Self::KeepWins | Self::LearnSkillsLonger | Self::LowerBeta => context.learn_with(&settings),
            Self::NormaliseObservations if algorithm.needs_skills() => context.learn_with(&settings),
            Self::TrainLonger => match &context.run {
                Some(run) => {
                    format!("playbot train --run {} --resume --steps {}", shell_word(run), longer(*steps))
                }
                None => context.train_with(&settings),
            },
            Self::MoreLevels => format!("playbot levels {game} --levels {levels}"),
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
            Self::LessNoise => "record the demonstrator with less noise",
            Self::KeepWins => "learn from won episodes only",
            Self::FillObservation => "fill the named values in `ObserveSchedule`, from the state of the tick",
            Self::MeasureBots => "measure what blind players get",
            Self::FindDeadActions => "look for actions without an effect on each level",
            Self::UseRecordings => "begin with skills from recordings, which reach the reward",
            Self::BeCurious => "reward what is new",
            Self::AskDemonstrator => {
                "let a policy imitate the demonstrator, from which `playbot train --from runs/asked` goes on,"
            }
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
            Self::UsualClip => "let actions become likelier by a fifth in an update, as usual",
            Self::BeginAtOnce => "let it begin to learn earlier",
            Self::EasierLesson => "give the lesson easier levels, or a smaller `success`",
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
    use crate::experiment::file::parse_experiment;
    use std::path::Path;

    fn experiment(settings: &str) -> Experiment {
        let text = format!(
            r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "my demos", steps: 1000, {settings})"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("valid")
    }

    #[test]
    fn every_setting_exists_and_is_valid_for_every_algorithm() {
        let mut settings = 0;
        // Also where the values are beyond the usual ones already.
        for values in
            ["", "ppo: (lr: 0.00001, ent_coef: 0.0001, gamma: 0.999, epochs: 1), skills: (beta: 0.0001, epochs: 900)"]
        {
            let experiment = experiment(values);
            for algorithm in Algorithm::ALL {
                let experiment = Experiment { algorithm, ..experiment.clone() };
                for advice in Advice::ALL {
                    let sets = advice.settings(&experiment);
                    let changed = experiment.with_set(&sets).unwrap_or_else(|error| panic!("{advice:?}: {error}"));
                    changed.check().unwrap_or_else(|error| panic!("{advice:?}: {error}"));
                    settings += sets.len();
                }
            }
        }
        assert!(settings > 200, "{settings}");
    }

    #[test]
    fn lower_is_lower_and_higher_is_higher_whatever_the_run_has() {
        let sets = |advice: Advice, settings: &str| {
            let experiment = Experiment { algorithm: Algorithm::ScorePpo, ..experiment(settings) };
            advice.settings(&experiment).join(" ")
        };
        assert_eq!(sets(Advice::LowerRate, "ppo: (lr: 0.019)"), "ppo.lr=0.0003");
        assert_eq!(sets(Advice::LowerRate, "ppo: (lr: 0.0003)"), "ppo.lr=0.0001");
        assert_eq!(sets(Advice::RaiseRate, "ppo: (lr: 0.0001)"), "ppo.lr=0.0005");
        assert_eq!(sets(Advice::RaiseRate, "ppo: (lr: 0.019)"), "ppo.lr=0.057");
        assert_eq!(sets(Advice::LookAhead, "ppo: (gamma: 0.5)"), "ppo.gamma=0.99");
        assert_eq!(sets(Advice::LookAhead, "ppo: (gamma: 0.997)"), "ppo.gamma=0.999");
        assert_eq!(sets(Advice::FewerPasses, "ppo: (epochs: 2)"), "ppo.epochs=1");
        assert_eq!(sets(Advice::LowerBeta, "skills: (beta: 0.003)"), "skills.beta=0.001");
        assert_eq!(sets(Advice::LearnSkillsLonger, "skills: (epochs: 200)"), "skills.epochs=600");
    }

    #[test]
    fn words_name_the_command_or_the_change_of_the_game() {
        let ppo = Experiment { algorithm: Algorithm::Ppo, ..experiment("ppo: (lr: 1.0)") };
        let context = AdviceContext::new(&Experiment { game: "a b".to_owned(), ..ppo.clone() });
        let words = Advice::LowerRate.words(&context);
        assert_eq!(
            words,
            "lower the learning rate with `playbot train 'a b' --algorithm ppo --run runs/next --set ppo.lr=0.0003`"
        );
        let of_run = AdviceContext { run: Some("runs/a".to_owned()), ..context.clone() };
        let words = "playbot train --experiment runs/a/experiment.ron --run runs/a-next --set ppo.lr=0.0003";
        assert_eq!(Advice::LowerRate.command(&of_run).as_deref(), Some(words));
        let with_skills = AdviceContext {
            experiment: Experiment { algorithm: Algorithm::ScorePpo, ..ppo.clone() },
            skills: Some("good.safetensors".to_owned()),
            ..of_run.clone()
        };
        let words = "playbot train --experiment runs/a/experiment.ron --skills good.safetensors --run runs/a-next --set ppo.lr=0.0003";
        assert_eq!(Advice::LowerRate.command(&with_skills).as_deref(), Some(words));
        let words =
            "playbot learn-skills --experiment runs/a/experiment.ron --out next.safetensors --set demo_wins=true";
        assert_eq!(Advice::KeepWins.command(&with_skills).as_deref(), Some(words));
        let before = "playbot learn-skills 'a b' --demos 'my demos' --out next.safetensors --set demo_wins=true";
        assert_eq!(Advice::KeepWins.command(&context).as_deref(), Some(before));
        let imitated = Experiment { algorithm: Algorithm::Imitation, ..ppo };
        let imitated = AdviceContext { experiment: imitated, ..of_run };
        let command = Advice::LowerRate.command(&imitated).expect("it has one");
        let words = "playbot imitate --experiment runs/a/experiment.ron --run runs/a-next --set imitation.lr=";
        assert!(command.starts_with(words), "{command}");
        assert!(Advice::PayReward.command(&context).is_none());
        assert!(Advice::PayReward.words(&context).starts_with("call `reward.add(1.0)`"));
    }
}
