//! Experiments and their settings.
//!
//! The folder, in reading order:
//!
//! - `file`: experiment files in RON with their bases, and `--set`, which override one another key by key.
//! - `keys`: the setting of each key, and messages about wrong ones.
//! - `checks`: checks of an experiment, alone, against its game and against the machine's memory.
//! - `levels_and_rivals`: settings of the levels that a training plays, which are earlier lessons and their order, and of
//!   a training against rivals.
//! - `error`: errors of experiment files and of `--set`, with their positions.
//! - `page`: the reference page of all settings.

pub(crate) mod checks;
pub(crate) mod error;
pub mod file;
pub(crate) mod keys;
mod levels_and_rivals;
pub mod page;

use bevy_playbot::{
    unknown_name::UnknownName,
    vision::{ImageOptions, ObservationConfig},
};
use playbot_harness::{
    eval::EvalPlan, game::Game, games::Games, inspect::ExperimentText, machine::MOST_WORLDS, randomise::Randomise,
    split::LevelSplit,
};
use playbot_learner::{
    EntityKind, ImitationConfig, PpoConfig, RlpdConfig, SacConfig, ScoreConfig, SkillConfig, SpirlConfig, settings,
    settings::{Range, is_off},
};
use serde::{Deserialize, Serialize, Serializer};
use std::{collections::BTreeSet, fmt, path::PathBuf, str::FromStr};

pub use crate::experiment::{
    checks::ExperimentError,
    levels_and_rivals::{CurriculumConfig, CurriculumLesson, LevelOrder, LevelsConfig, MOST_SCORED, SelfPlayConfig},
};
pub use bevy_playbot::vision::ObservationKind;
pub use playbot_assets::{ExperimentFile, PRESETS};

settings! {
    /// One experiment: game, levels, data, networks and tuning. Read from a RON file; keys that the file leaves out
    /// have these defaults.
    ///
    /// Networks belong to their part: `ppo.hidden` and `ppo.activation` (or `sac.…`) are those of actor and critic,
    /// `skills.hidden`, `skills.encoder_hidden`, `skills.gru_hidden` and `skills.gru_layers` those of the skill model.
    /// A policy that starts as a copy of the decoder has the decoder's layers.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Experiment with sections;

    /// Name of the game.
    game: String, such as "\"coinrun\"";
    /// Observations of the agents.
    observation: ObservationKind = ObservationKind::default(), serde(default);
    /// Size and form of the pictures, for agents that see some.
    image: ImageOptions, keys of ImageOptions, serde(default);
    /// Name of the algorithm: `score-ppo`, `ppo`, `score-sac`, `sac`, `spirl-ppo`, `spirl-sac`, `rlpd` or `bc`; `imitation`
    /// in the runs of the verb `imitate`.
    algorithm: Algorithm = score_ppo(), serde(default = "score_ppo");
    /// Levels to train on.
    train: LevelSplit, such as "\"hard:0..63\"";
    /// Lessons before `train`.
    curriculum: CurriculumConfig, keys of CurriculumConfig,
        serde(default, skip_serializing_if = "is_off");
    /// The choice among the levels.
    levels: LevelsConfig, keys of LevelsConfig,
        serde(default, skip_serializing_if = "is_off");
    /// A training against rivals, in a game whose agents share an arena.
    self_play: SelfPlayConfig, keys of SelfPlayConfig,
        serde(default, skip_serializing_if = "is_off");
    /// Numbers of the game that each level multiplies by factors of its own, in training and evaluation, by their paths.
    /// A path is `Resource.field` or `Marker.Component.field`; the types derive `Reflect`.
    randomise: Randomise = Randomise::default(), such as "{\"Gravity.0\": \"0.8..1.2\"}",
        serde(default, skip_serializing_if = "Randomise::is_empty");
    /// Held-out levels to evaluate on; never trained on.
    test: LevelSplit, such as "\"hard:64..127\"";
    /// File or folder of recordings; `None` for algorithms that learn nothing from any. A relative path in a file, also
    /// one of level files in `train` and `test`, starts in the folder of that file, or else in the current one.
    demos: Option<PathBuf> = None, such as "\"demos/coinrun\"", serde(default, serialize_with = "plain");
    /// Learn from at most so many recorded steps: whole episodes, drawn evenly over the recordings. `None` takes all.
    demo_steps: Option<u64> = None, in Range::COUNT, serde(default);
    /// Learn only from recorded episodes that ended at the goal, for demonstrators that do not always get there.
    /// Episodes of games that go on at the goal end nowhere, and are left out.
    demo_wins: bool = false, serde(default, skip_serializing_if = "is_off");
    /// Levels that the demonstrator has learned from, such as the training levels of a recorded policy. They count as
    /// recorded: held-out levels with one of their layouts are no unseen ones.
    demo_learned: Vec<LevelSplit> = Vec::new(), serde(default, skip_serializing_if = "Vec::is_empty");
    /// Random seed of everything.
    seed: u64 = one(), serde(default = "one");
    /// Random seeds of a study, which runs everything once with each; `seed` alone if the list is empty.
    seeds: Vec<u64> = Vec::new(), serde(default);
    /// Environment steps to train for, over all arenas together; rounded up to whole rollouts.
    // Numbers in metrics and plots are floating-point ones.
    steps: u64, in Range::Count(1 << 53), such as "1000000";
    /// Arenas that play at the same time.
    arenas: u32 = default_arenas(), in Range::COUNT, serde(default = "default_arenas");
    /// Worlds the arenas are spread over. Each World plays on a thread of its own. With more threads arenas are spread
    /// over more Worlds, which changes no result.
    worlds: u32 = default_worlds(), in Range::Count(MOST_WORLDS), serde(default = "default_worlds");
    /// The skill model.
    skills: SkillConfig, keys of SkillConfig, serde(default);
    /// The learner of score-ppo, ppo and spirl-ppo.
    ppo: PpoConfig, keys of PpoConfig, serde(default);
    /// The learner of score-sac, sac, spirl-sac and rlpd.
    sac: SacConfig, keys of SacConfig, serde(default);
    /// Imitation of recordings or of a demonstrator, by the verb `imitate`. Its networks are those of `ppo`.
    imitation: ImitationConfig, keys of ImitationConfig, serde(default);
    /// The three steps of SCORE.
    score: ScoreConfig, keys of ScoreConfig, serde(default);
    /// Additions of spirl-ppo and spirl-sac.
    spirl: SpirlConfig, keys of SpirlConfig, serde(default);
    /// Additions of rlpd to `sac`.
    rlpd: RlpdConfig, keys of RlpdConfig, serde(default);
    /// Evaluation.
    eval: EvalConfig, keys of EvalConfig, serde(default);
    /// When the state of the training is saved.
    checkpoints: CheckpointConfig, keys of CheckpointConfig, serde(default);
    /// Measurements of a study.
    study: StudyConfig, keys of StudyConfig, serde(default);
    /// Variants that a study compares; empty in the experiment of a single run.
    variants: Vec<Variant> = Vec::new(), serde(default);
}

/// Writes a path as text, as files have it, and not as `Some(text)`.
fn plain<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    match path {
        Some(path) => path.serialize(serializer),
        None => serializer.serialize_none(),
    }
}

fn score_ppo() -> Algorithm {
    Algorithm::ScorePpo
}

fn one() -> u64 {
    1
}

fn default_arenas() -> u32 {
    64
}

fn default_worlds() -> u32 {
    2
}

settings! {
    /// Evaluation of policies.
    #[derive(Clone, Debug, PartialEq)]
    pub struct EvalConfig in "eval", read by &[];

    /// Episodes on each level; every level is played equally often. More levels say more than more episodes on the same
    /// ones.
    episodes_per_level: u32 = 1, in Range::COUNT;
    /// Take the most probable action instead of drawing one.
    greedy: bool = false;
    /// Measure held-out levels of a layout that was trained on or recorded, too. By default they are left out. A study
    /// measures them apart, and adds a table of all levels.
    include_seen: bool = false, off "is_off";
}

settings! {
    /// When checkpoints are written and how many stay.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct CheckpointConfig in "checkpoints", read by &[];

    /// Updates between two checkpoints; there is always one at the start and one at the end.
    every: u64 = 10, in Range::COUNT;
    /// How many of the latest stay; the best one stays besides.
    keep: usize = 3, in Range::COUNT;
}

settings! {
    /// Measurements of a study.
    #[derive(Clone, Debug, PartialEq)]
    pub struct StudyConfig in "study", read by &[];

    /// Success rate over the last 100 training episodes, whose first step is looked for.
    threshold: f64 = 0.8, in Range::SHARE;
}

/// One side of a comparison: the experiment with some of its values changed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Its name in tables and folders: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// Its changes, as `key=value`, in the manner of `--set`.
    #[serde(default)]
    pub set: Vec<String>,
}

impl Experiment {
    /// Returns whether its run needs recordings: for skills, for its own training, or to imitate them.
    pub fn learns_from_demos(&self) -> bool {
        let imitates = self.algorithm == Algorithm::Imitation && !self.imitation.dagger;
        imitates || self.algorithm.learns_from_demos()
    }

    /// Returns the kind of observations with their settings.
    pub fn observation_config(&self) -> ObservationConfig {
        ObservationConfig { kind: self.observation, image: self.image }
    }

    /// Returns the plan of an evaluation on these levels, for a player with the experiment's observation.
    pub fn eval_plan(&self, split: &LevelSplit, threads: usize) -> EvalPlan {
        EvalPlan {
            split: split.clone(),
            left_out: BTreeSet::new(),
            observation_config: self.observation_config(),
            episodes_per_level: self.eval.episodes_per_level,
            seed: self.seed,
            arenas: self.arenas,
            worlds: self.worlds,
            threads,
            randomise: self.randomise.clone(),
        }
    }

    /// Returns the experiment of a single run, without the settings of a study.
    pub fn without_study(&self) -> Self {
        Self { seeds: Vec::new(), variants: Vec::new(), ..self.clone() }
    }

    /// Returns the settings of PPO for the learner: a falling learning rate falls over the whole training by default.
    pub fn ppo_config(&self) -> PpoConfig {
        let mut config = self.ppo.clone();
        let changes = config.anneal_lr || self.score.kl_coef_end.is_some();
        if changes && self.steps_per_update() > 0 {
            config.total_updates = config.total_updates.or_else(|| Some(self.updates()));
        }
        config
    }

    /// Returns the experiment with the sets of things that the game's observation has, for networks that read them as sets
    /// (`ppo.entities`, `skills.entities`). SAC reads all values alike, and so do skills that it is tied to.
    pub fn with_sets(&self, game: &dyn Game) -> Self {
        let sets = match self.observation_config().is_image() {
            true => Vec::new(),
            false => game.observation().sets().into_iter().map(|set| set.block).collect::<Vec<_>>(),
        };
        let mut with = self.clone();
        with.ppo.entities = self.ppo.entities.with_blocks(sets.clone());
        with.skills.entities = match self.algorithm.learner() {
            LearnerKind::Sac if !sets.is_empty() => EntityKind::Flat,
            _ => self.skills.entities.with_blocks(sets),
        };
        with
    }

    /// Returns the ticks of one rollout.
    pub fn rollout_steps(&self) -> usize {
        match self.algorithm.learner() {
            LearnerKind::Ppo => self.ppo.num_steps,
            LearnerKind::Sac => self.sac.num_steps,
        }
    }

    /// Returns the environment steps of one rollout.
    pub fn steps_per_update(&self) -> u64 {
        u64::from(self.arenas).saturating_mul(self.rollout_steps() as u64)
    }

    /// Returns the rollouts, and so updates, of the whole training.
    pub fn updates(&self) -> u64 {
        self.steps.div_ceil(self.steps_per_update())
    }

    /// Returns the environment steps of the training: [`steps`](Self::steps), rounded up to whole rollouts.
    pub fn whole_steps(&self) -> u64 {
        // `check` refuses rollouts of no steps; this function must not fail.
        self.steps.checked_next_multiple_of(self.steps_per_update()).unwrap_or(self.steps)
    }

    /// Writes the experiment as RON, all defaults filled in.
    ///
    /// # Errors
    ///
    /// The path of the demonstrations is not Unicode.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        ron::ser::to_string_pretty(self, ron::ser::PrettyConfig::default())
    }
}

// Algorithms.

/// An algorithm that makes a policy. Files and the command line use its [`name`](Self::name).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Algorithm {
    /// PPO with skills: the paper's method.
    ScorePpo,
    /// PPO without skills: the same network, steps and tuning.
    Ppo,
    /// SAC with skills: the decoder's penalty under SAC.
    ScoreSac,
    /// SAC without skills.
    Sac,
    /// Policy over skills by PPO (SPiRL): it learns which skill the decoder plays.
    SpirlPpo,
    /// Policy over skills by SAC.
    SpirlSac,
    /// SAC with recordings in each batch (RLPD).
    Rlpd,
    /// Behaviour cloning: the skill model's decoder under its prior, as learned from demonstrations.
    BehaviourCloning,
    /// Imitation without skills, by the verb `imitate`: of recordings, or of a demonstrator that is asked (DAgger).
    Imitation,
}

impl Algorithm {
    /// All algorithms.
    pub const ALL: [Self; 9] = [
        Self::ScorePpo,
        Self::Ppo,
        Self::ScoreSac,
        Self::Sac,
        Self::SpirlPpo,
        Self::SpirlSac,
        Self::Rlpd,
        Self::BehaviourCloning,
        Self::Imitation,
    ];

    /// Algorithms that learn from play, see [`is_trained`](Self::is_trained).
    pub const TRAINED: [Self; 7] =
        [Self::ScorePpo, Self::Ppo, Self::ScoreSac, Self::Sac, Self::SpirlPpo, Self::SpirlSac, Self::Rlpd];

    /// Returns the name on the command line, in files and in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScorePpo => "score-ppo",
            Self::Ppo => "ppo",
            Self::ScoreSac => "score-sac",
            Self::Sac => "sac",
            Self::SpirlPpo => "spirl-ppo",
            Self::SpirlSac => "spirl-sac",
            Self::Rlpd => "rlpd",
            Self::BehaviourCloning => "bc",
            Self::Imitation => "imitation",
        }
    }

    /// Returns whether a skill model is needed.
    pub fn needs_skills(self) -> bool {
        match self {
            Self::ScorePpo | Self::ScoreSac | Self::SpirlPpo | Self::SpirlSac | Self::BehaviourCloning => true,
            Self::Ppo | Self::Sac | Self::Rlpd | Self::Imitation => false,
        }
    }

    /// Returns whether it learns which skill to play, instead of drawing it from the prior.
    pub fn learns_prior(self) -> bool {
        matches!(self, Self::SpirlPpo | Self::SpirlSac)
    }

    /// Returns whether it needs recordings, for skills or for its own training.
    pub fn learns_from_demos(self) -> bool {
        self.needs_skills() || self.trains_on_demos()
    }

    /// Returns whether it trains on recordings too; skills are learned from them beforehand.
    pub fn trains_on_demos(self) -> bool {
        self == Self::Rlpd
    }

    /// Returns the learner whose settings apply. Behaviour cloning trains no learner; it has the settings of PPO, and so
    /// do the networks of imitation.
    pub fn learner(self) -> LearnerKind {
        match self {
            Self::ScorePpo | Self::Ppo | Self::SpirlPpo | Self::BehaviourCloning | Self::Imitation => LearnerKind::Ppo,
            Self::ScoreSac | Self::Sac | Self::SpirlSac | Self::Rlpd => LearnerKind::Sac,
        }
    }

    /// Returns whether it learns from the reward of its play, by the verb `train`. Behaviour cloning is ready once it has
    /// its skills, and imitation has a verb of its own.
    pub fn is_trained(self) -> bool {
        !matches!(self, Self::BehaviourCloning | Self::Imitation)
    }

    /// Returns whether its runs have checkpoints.
    pub fn has_checkpoints(self) -> bool {
        self != Self::BehaviourCloning
    }
}

/// The learner behind an algorithm. Dependent code matches every variant, so the compiler lists the places for a new
/// learner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LearnerKind {
    /// Proximal policy optimisation.
    Ppo,
    /// Soft actor-critic.
    Sac,
}

impl LearnerKind {
    /// Returns the key of its settings in an experiment.
    pub fn key(self) -> &'static str {
        match self {
            Self::Ppo => "ppo",
            Self::Sac => "sac",
        }
    }
}

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Algorithm {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let names = Self::ALL.map(Self::name);
        Self::ALL
            .into_iter()
            .find(|algorithm| algorithm.name() == name)
            .ok_or_else(|| UnknownName::new("algorithm", name, &names))
    }
}

impl TryFrom<String> for Algorithm {
    type Error = UnknownName;

    fn try_from(name: String) -> Result<Self, UnknownName> {
        name.parse()
    }
}

impl From<Algorithm> for String {
    fn from(algorithm: Algorithm) -> Self {
        algorithm.name().to_owned()
    }
}

// The default experiment, and presets.

/// Largest number of training levels, and of test levels after them, for a game without its own experiment.
const LEVELS: u64 = 64;

/// Returns the experiment of a program's first game, see [`experiment_of`].
pub fn default_experiment(games: &Games) -> ExperimentText {
    experiment_of(games.first())
}

/// Returns the default experiment of a game. A game without its own experiment gets the simplest: SCORE-PPO in its
/// first mode, from the recording in `demos/` with the game's name. It trains on the first half of the levels and holds
/// out the second, up to 64 each. A single level is in both.
pub fn experiment_of(game: &dyn Game) -> ExperimentText {
    game.tools().training.experiment().unwrap_or_else(|| ExperimentText {
        origin: format!("the experiment of {}", game.name()).into(),
        text: plainest(game).into(),
    })
}

fn plainest(game: &dyn Game) -> String {
    let (name, mode) = (game.name(), game.modes().first().copied().unwrap_or_default());
    let last = game.tools().levels.last_level().unwrap_or(u64::MAX).min(2 * LEVELS - 1);
    let held_out = last.div_ceil(2);
    let trained = held_out.saturating_sub(1);
    format!(
        "(game: \"{name}\", train: \"{mode}:0..{trained}\", test: \"{mode}:{held_out}..{last}\", demos: \
         \"demos/{name}\", steps: 500000)"
    )
}

/// Returns the preset with this name, which `base` in an experiment names.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn find_preset(name: &str) -> Result<ExperimentFile, UnknownName> {
    let found = PRESETS.into_iter().find(|preset| preset.name == name);
    found.ok_or_else(|| UnknownName::new("preset", name, &PRESETS.map(|preset| preset.name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::file::parse_experiment;
    use bevy::prelude::App;
    use playbot_harness::foreign::ForeignGame;
    use std::path::Path;

    #[test]
    fn the_default_experiment_has_no_level_past_the_last_one() {
        let game = |count| ForeignGame::new("rooms", 1, |_: &mut App| {}).levels(count);
        let of = |game: &ForeignGame| {
            let experiment = parse_experiment(&experiment_of(game).text, Path::new("x.ron")).expect("valid");
            experiment.check_levels(game).expect("levels of the game");
            (experiment.train.to_string(), experiment.test.to_string())
        };
        for (count, train, test) in [
            (1, "default:0..0", "default:0..0"),
            (2, "default:0..0", "default:1..1"),
            (7, "default:0..2", "default:3..6"),
            (8, "default:0..3", "default:4..7"),
            (127, "default:0..62", "default:63..126"),
            (128, "default:0..63", "default:64..127"),
            (500, "default:0..63", "default:64..127"),
        ] {
            assert_eq!(of(&game(count)), (train.to_owned(), test.to_owned()), "{count} levels");
        }
        let endless = ForeignGame::new("rooms", 1, |_: &mut App| {});
        assert_eq!(of(&endless), ("default:0..63".to_owned(), "default:64..127".to_owned()));
    }

    #[test]
    fn a_single_level_is_trained_and_tested_only_if_there_is_no_other() {
        let text = r#"(game: "rooms", train: "default:0", test: "default:0", demos: "d", steps: 10)"#;
        let experiment = parse_experiment(text, Path::new("x.ron")).expect("valid");
        let game = |count| ForeignGame::new("rooms", 1, |_: &mut App| {}).levels(count);
        assert_eq!(experiment.check_levels(&game(1)), Ok(()));
        let words = experiment.check_levels(&game(2)).expect_err("level 1 can be held out").to_string();
        assert_eq!(
            words,
            "level 0 of the training levels default:0..0 is one of the held-out levels default:0..0: choose others"
        );
        let text = text.replace("default:0", "default:3");
        let third = parse_experiment(&text, Path::new("x.ron")).expect("readable");
        let words = third.check().expect_err("they overlap").to_string();
        assert!(words.contains("choose ranges that share no level"), "{words}");
    }

    #[test]
    fn those_that_are_trained_are_all_but_cloning_and_imitation() {
        let trained: Vec<_> = Algorithm::ALL.into_iter().filter(|algorithm| algorithm.is_trained()).collect();
        assert_eq!(trained, Algorithm::TRAINED);
    }
}
