//! The whole road as functions, for those who do not go it on the command line: [`record`], [`learn_skills`], [`train`],
//! [`evaluate`], [`policy`].
//!
//! ```no_run
//! use playbot_lab::{eval::Player, pipeline, prelude::*, train::config_file::parse_experiment};
//! use playbot_learner::DeviceKind;
//! # fn road(game: &dyn Game) -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"(game: "lander", train: "moon:0..63", test: "moon:64..127", demos: "lander.demo", steps: 100000)"#;
//! let experiment = parse_experiment(text, "lander.ron".as_ref())?;
//! pipeline::record(game, &"moon:128..255".parse()?, 0.1, "lander.demo".as_ref())?;
//! let skills = pipeline::learn_skills(game, &experiment, DeviceKind::default(), 2)?;
//! let trainer = pipeline::train(game, &experiment, Some(&skills), DeviceKind::default(), 2, |report| {
//!     println!("{} steps, return {:?}", report.step, report.episodic_return);
//! })?;
//! let policy = pipeline::policy(game, &trainer);
//! let player = Player::of_file(&policy, ActionDraw::Sample);
//! let measured = pipeline::evaluate(game, &experiment, "score-ppo", &player, 2)?;
//! println!("{:.0} % success on {}", 100.0 * measured.success, measured.split);
//! playbot_lab::policy_export::export_policy(game, &policy, &experiment.train, 1, "lander.policy".as_ref())?;
//! # Ok(())
//! # }
//! ```

use std::{ops::ControlFlow, path::Path};

use bevy_playbot::{
    demo::file::{DemoFileError, DemoWriter},
    fault::Fault,
    prelude::*,
};
use playbot_learner::{DeviceKind, LearnError, PolicyFile, SkillModel, SkillTrainer};
use thiserror::Error;

use crate::{
    demo::{dataset::Demonstrations, demonstration::DemonstrationPlan, verify::VerifyError},
    eval::{self, EvalError, EvalPlan, EvalSummary, Player, summarize},
    game::Game,
    mode::ModeError,
    policy_export::{Provenance, policy_file},
    split::LevelSplit,
    train::{Experiment, TrainError, Trainer, UpdateReport, config::ExperimentError},
};

/// A step of the road failed.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// Nobody demonstrates the game.
    #[error("`{0}` has no demonstrator: play it yourself, or train without demonstrations")]
    NoDemonstrator(&'static str),
    /// There is no such mode.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The experiment makes no sense.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The recording cannot be written.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    /// The recordings cannot be learned from.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The learner failed.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// The training failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Nothing could be measured.
    #[error(transparent)]
    Eval(#[from] EvalError),
}

/// Records the game's demonstrator on each of these levels into a new file, and returns the number of episodes. `noise` is
/// the share of random actions, or the deviation of continuous ones, drawn from seed 1, as the command line does unless told
/// otherwise.
///
/// # Errors
///
/// Nobody demonstrates the game, it broke its contract, or the file exists or cannot be written.
pub fn record(game: &dyn Game, levels: &LevelSplit, noise: f64, path: &Path) -> Result<u64, PipelineError> {
    levels.check(game)?;
    if game.demonstrator().is_none() {
        return Err(PipelineError::NoDemonstrator(game.name()));
    }
    let plan = DemonstrationPlan {
        mode: levels.mode.clone(),
        levels: levels.levels().collect(),
        noise,
        seed: 1,
        steps: None,
        keep_observations: false,
    };
    let writer = DemoWriter::create(path, plan.header(game))?;
    let (mut world, agent) = plan.build_world(game, writer);
    while Control::of(&world, agent).is_active() {
        world.tick()?;
    }
    Ok(world.resource::<Recorder>().episodes())
}

/// Learns the skill model of an experiment from its recordings.
///
/// # Errors
///
/// The experiment names no recordings, they cannot be read or do not replay, or a loss is not a number.
pub fn learn_skills(
    game: &dyn Game,
    experiment: &Experiment,
    device: DeviceKind,
    threads: usize,
) -> Result<SkillModel, PipelineError> {
    experiment.check_agent(game)?;
    let dataset = Demonstrations::of(game, experiment, experiment.recordings()?)?.dataset(game, threads, |_| {})?;
    let mut trainer = SkillTrainer::new(experiment.skills.clone(), dataset, experiment.seed, device)?;
    while trainer.epochs_done() < experiment.skills.epochs as u64 && !trainer.is_over() {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(()))?;
    }
    Ok(trainer.into_model().with_picture(experiment.observation_config().card()))
}

/// Trains to the end of the experiment; `after_update` hears of each update. Nothing is written: a training that is to be
/// resumed saves itself with [`RunDir`](crate::train::run_dir::RunDir).
///
/// # Errors
///
/// See [`TrainError`].
pub fn train(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&SkillModel>,
    device: DeviceKind,
    threads: usize,
    mut after_update: impl FnMut(&UpdateReport),
) -> Result<Trainer, PipelineError> {
    let mut trainer = if experiment.algorithm.trains_on_demos() {
        let demos = Demonstrations::of(game, experiment, experiment.recordings()?)?;
        let seen = demos.seen_levels(game);
        let rollouts = demos.rollouts(game, threads, |_| {})?;
        let mut trainer = Trainer::with_demos(game, experiment, skills, &rollouts, device, threads)?;
        trainer.note_seen(&seen);
        trainer
    } else {
        Trainer::new(game, experiment, skills, device, threads)?
    };
    while !trainer.is_done() {
        after_update(&trainer.update()?);
    }
    Ok(trainer)
}

/// Measures a player on the experiment's held-out levels, each equally often. `name` is the summary's.
///
/// # Errors
///
/// There is no such mode, the game broke its contract, or it cannot be seen as the experiment says.
pub fn evaluate(
    game: &dyn Game,
    experiment: &Experiment,
    name: &str,
    player: &Player,
    threads: usize,
) -> Result<EvalSummary, PipelineError> {
    experiment.check_test(game)?;
    let plan = EvalPlan::of(experiment, &experiment.test, threads);
    Ok(summarize(name, &plan.split, &eval::evaluate(game, player, &plan, |_| {})?))
}

/// What a training has learned so far, as the file that a game ships with:
/// [`export_policy`](crate::policy_export::export_policy) writes it, and a game plays with it at once with
/// [`install_policy`](bevy_playbot::policy_file::install_policy).
pub fn policy(game: &dyn Game, trainer: &Trainer) -> PolicyFile {
    let experiment = trainer.experiment();
    let provenance = Provenance {
        algorithm: experiment.algorithm.name().to_owned(),
        training: format!("{} steps on {}, seed {}", trainer.steps(), experiment.train, experiment.seed),
        seen: trainer.seen().cloned(),
        code: format!("playbot {}", env!("CARGO_PKG_VERSION")),
    };
    policy_file(game, &experiment.observation_config(), trainer.policy(), trainer.skill_source(), provenance)
}
