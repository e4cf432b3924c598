//! `playbot train`.

mod length;
mod new_run;
mod repeated;

use std::path::PathBuf;

use playbot_lab::{
    games::{Artifact, Games},
    report::whole,
    train::{
        Algorithm, Experiment, LearnerKind, TrainError, Trainer, UpdateReport,
        checkpoint::CheckpointChoice,
        run_dir::{OpenedRun, RunDir, check_new},
    },
};

use super::{
    compute::Compute,
    differences::{Options, in_words},
    error::{CliError, Outcome},
    experiment::{ExperimentArgs, sets_key},
    interrupt, open, program, progress,
    read_demos::{Recorded, read_rollouts},
    unread_settings::tell_unread,
};
use bevy_playbot::unknown_name::UnknownName;
use playbot_learner::SkillModel;
use repeated::resumed;

pub use length::{never_learns, rounded};
pub use new_run::{Source, create_run, run_info};

/// Train a policy, headless, over the experiment's training levels.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot train GAME --skills skills.safetensors --run runs/first
  playbot train --algorithm ppo --run runs/baseline --steps 200000
  playbot train --skills skills.safetensors --run runs/weak --set score.kl_coef=0.01 --set ppo.lr=0.0003
  playbot train --run runs/first --resume
  playbot train --run runs/first --resume --steps 1000000")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// score-ppo, ppo, score-sac, sac, spirl-ppo, spirl-sac or rlpd, instead of the experiment's.
    #[arg(long, value_parser = trained)]
    algorithm: Option<Algorithm>,
    /// Skill model, as written by `playbot learn-skills --out FILE`; needed by score-ppo, score-sac, spirl-ppo and spirl-sac.
    #[arg(long, value_name = "FILE")]
    skills: Option<PathBuf>,
    /// Folder of the run.
    #[arg(long)]
    run: PathBuf,
    /// Go on from the last checkpoint of the run, with the settings that it has. Other options may be given again with the
    /// same values; --steps and --checkpoint-every with new ones.
    #[arg(long)]
    resume: bool,
    /// Delete the folder of the run first if it exists.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Environment steps from the beginning, instead of the experiment's; rounded up to whole updates.
    #[arg(long)]
    steps: Option<u64>,
    /// Seed, instead of the experiment's.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    compute: Compute,
    /// Save a checkpoint every so many updates, instead of the experiment's.
    #[arg(long)]
    checkpoint_every: Option<u64>,
}

/// An algorithm that can be trained.
fn trained(name: &str) -> Result<Algorithm, String> {
    let names = Algorithm::TRAINED.map(Algorithm::name);
    match name.parse::<Algorithm>() {
        Ok(algorithm) if algorithm.is_trained() => Ok(algorithm),
        Ok(algorithm) => {
            let why = program::named(&TrainError::NotTrained(algorithm).to_string());
            Err(format!("{why}; those that are: {}", names.join(", ")))
        }
        Err(_) => Err(UnknownName::new("algorithm", name, &names).to_string()),
    }
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let (run, mut trainer) = if args.resume { resume(&args, games)? } else { start(&args, games)? };
    let (path, program) = (args.run.display(), program::name());
    if trainer.is_done() {
        tell!(
            "{path} is finished: it was trained for {0} steps. Train it further with `{program} train --run {path} --resume \
             --steps N`, where N is more than {0}, or test it with `{program} eval --run {path}`",
            trainer.steps()
        );
        return Ok(Outcome::Pass);
    }
    // A training that goes on has said so when it began.
    let is_new_length = args.steps.is_some() || args.from.set.iter().any(|set| sets_key(set, "steps"));
    if !args.resume || is_new_length {
        tell_length(trainer.experiment());
    }
    interrupt::go_on_with(format!("`{program} train --run {path} --resume`"));
    let finished = drive(&run, &mut trainer, "train", |_| {})?;
    if finished {
        tell!("done: test it with `{program} eval --run {path}`");
        Ok(Outcome::Pass)
    } else {
        let (steps, wanted) = (trainer.steps(), trainer.experiment().whole_steps());
        tell!(
            "stopped and saved after {steps} of {wanted} steps, so the training is incomplete: go on with \
             `{program} train --run {path} --resume`"
        );
        Ok(Outcome::Stopped)
    }
}

/// Says so if a training will have more steps than were asked for.
pub fn tell_length(experiment: &Experiment) {
    if let Some(words) = rounded(experiment) {
        tell!("{words}");
    }
    if let Some(words) = never_learns(experiment) {
        tell!("warning: {words}");
    }
}

fn start(args: &Args, games: &Games) -> Result<(RunDir, Trainer), CliError> {
    let experiment = args.from.load(games, args.settings())?;
    tell_unread("--set ", &args.from.set, &[&experiment]);
    check_new(&args.run, args.force)?;
    let game = open::game(games, &args.from, &experiment)?;
    // Levels are checked by the trainer, which takes longer.
    experiment.check_memory(game).map_err(|error| args.from.locate(games, args.settings(), error))?;
    let skills = match &args.skills {
        Some(path) if experiment.algorithm.needs_skills() => {
            Some(open::skills(path, args.compute.device(), &args.from)?)
        }
        Some(path) => {
            tell!("{} learns without skills, so that {} is not used", experiment.algorithm, path.display());
            None
        }
        None => None,
    };
    skills.iter().try_for_each(|model| check_asked(args, &experiment, model))?;
    let (device, threads) = (args.compute.device(), args.compute.threads());
    interrupt::leave("nothing is trained yet".to_owned());
    let Recorded { rollouts, seen } = read_rollouts(game, &experiment, &args.from, games, threads)?;
    let trainer = Trainer::with_demos(game, &experiment, skills.as_ref(), &rollouts, device, threads)
        .map_err(|error| explain(error, args, &experiment, games))?;
    let source = Source::new(args.skills.as_deref(), skills.as_ref(), seen);
    let run = create_run(&args.run, game, &experiment, &source, device, args.force)?;
    if args.from.experiment.is_none() {
        tell!("no --experiment is named: training on {}, held out for the test {}", experiment.train, experiment.test);
    }
    Ok((run, trainer))
}

/// Refuses settings of skills that the model does not have: it was learned before. What only a file says otherwise is what `learn-skills`
/// was told at that time.
fn check_asked(args: &Args, experiment: &Experiment, model: &SkillModel) -> Result<(), CliError> {
    let learned = Experiment { skills: model.config().clone(), ..experiment.clone() };
    let asked = Experiment { skills: learned.with_set(&args.from.set)?.skills, ..experiment.clone() };
    let options = Options { from: &args.from, own: &[] };
    let differences = options.differences(&asked, &learned, "the skill model", &[]);
    if differences.is_empty() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "the skills were learned before, and this differs: {}; drop the option, or learn other skills with it, `playbot learn-skills`",
        in_words(differences)
    )))
}

/// The error of a training that cannot begin: with the place of the key to blame, and where skills are missing, with the
/// commands that make and use them.
fn explain(error: TrainError, args: &Args, experiment: &Experiment, games: &Games) -> CliError {
    let algorithm = match error {
        TrainError::NoSkills(algorithm) => algorithm,
        TrainError::Experiment(error) => return args.from.locate(games, args.settings(), error).into(),
        TrainError::ForeignSkills { .. } | TrainError::SkillObservation { .. } | TrainError::SeenSkills { .. } => {
            let file = args.skills.iter().map(|path| format!("{}: ", path.display())).collect::<String>();
            return CliError::Usage(format!("{file}{error}"));
        }
        other => return other.into(),
    };
    let plain = match experiment.algorithm.learner() {
        LearnerKind::Ppo => Algorithm::Ppo,
        LearnerKind::Sac => Algorithm::Sac,
    };
    CliError::Usage(format!(
        "{algorithm} needs a skill model: learn one with `playbot learn-skills{} --out skills.safetensors`, then give the \
         same command again with `--skills skills.safetensors`; or train without skills, with `--algorithm {plain}`",
        args.from.words()
    ))
}

fn resume(args: &Args, games: &Games) -> Result<(RunDir, Trainer), CliError> {
    let OpenedRun { run, experiment: saved, info } = RunDir::open_to_write(&args.run)?;
    let game = games.of_file(Artifact::Run, &args.run, &saved.game)?;
    if !info.algorithm.is_trained() {
        return Err(open::untrained(&args.run, info.algorithm));
    }
    let experiment = resumed(args, &saved, &info, games)?;
    let trainer = run.resume(game, &experiment, args.compute.device(), args.compute.threads())?;
    if trainer.is_done() {
        let (steps, whole) = (trainer.steps(), saved.whole_steps());
        if steps < whole {
            return Err(CliError::Usage(format!(
                "{} has {steps} steps already, and no fewer can be asked for: leave --steps out to go on to {whole}",
                args.run.display()
            )));
        }
        // Nothing is to be trained, so the run stays what it is.
        return Ok((run, trainer));
    }
    if experiment != saved {
        run.write_experiment(&experiment)?;
    }
    tell!("going on at step {} of {}", trainer.steps(), experiment.whole_steps());
    let device = args.compute.device();
    if device != info.device {
        tell!("it was begun on {} and goes on on {device}: what it learns is alike, but not the same", info.device);
    }
    Ok((run, trainer))
}

/// Trains to the end of the experiment or to Ctrl-C, with progress bar, log and checkpoints. Returns whether the end
/// was reached.
///
/// # Errors
///
/// Training or saving fails; the last checkpoint is kept.
pub fn drive(
    run: &RunDir,
    trainer: &mut Trainer,
    title: &str,
    mut after_update: impl FnMut(&UpdateReport),
) -> Result<bool, CliError> {
    interrupt::listen();
    trainer.report_panics_to(run.path());
    let (per_update, every) = (trainer.experiment().steps_per_update(), trainer.experiment().checkpoints.every);
    let bar = progress::bar(title, trainer.experiment().whole_steps(), "steps");
    let mut saved = trainer.updates();
    match run.checkpoint(CheckpointChoice::Last) {
        Ok(checkpoint) => note_saved(run, checkpoint.summary.step),
        // Whatever goes wrong later, there is something good to go back to.
        Err(_) => save(run, trainer)?,
    }
    while !trainer.is_done() && !interrupt::asked() {
        bar.set_position(trainer.steps());
        let report = trainer.update().map_err(|error| stopped_by(run, error))?;
        run.log(&report, per_update)?;
        bar.set_position(report.step);
        bar.set_message(message(&report, per_update));
        after_update(&report);
        if report.update.is_multiple_of(every) {
            save(run, trainer)?;
            saved = report.update;
        }
    }
    if trainer.updates() > saved {
        save(run, trainer)?;
    }
    bar.finish_and_clear();
    Ok(trainer.is_done())
}

fn save(run: &RunDir, trainer: &mut Trainer) -> Result<(), CliError> {
    run.save(trainer).map_err(|error| {
        let is_first = run.checkpoint(CheckpointChoice::Last).is_err();
        let (error, run) = (error.into(), run.path().into());
        if is_first { CliError::NeverSaved { error, run } } else { CliError::NotSaved { error, run } }
    })?;
    note_saved(run, trainer.steps());
    Ok(())
}

/// For whoever stops the training at once.
fn note_saved(run: &RunDir, step: u64) {
    let step = whole(step as f64);
    interrupt::leave(format!("the last checkpoint of {} is that of step {step}", run.path().display()));
}

/// The error of a training, with the checkpoint that is left if its numbers ran away.
fn stopped_by(run: &RunDir, error: TrainError) -> CliError {
    match (&error, run.checkpoint(CheckpointChoice::Last)) {
        (TrainError::Learn(learn), Ok(checkpoint)) if learn.is_divergence() => {
            CliError::Diverged { error: error.into(), step: checkpoint.summary.step, checkpoint: checkpoint.path }
        }
        _ => error.into(),
    }
}

fn message(report: &UpdateReport, steps_per_update: u64) -> String {
    let sps = steps_per_update as f64 / (report.timing.collect_s + report.timing.learn_s);
    let current = report.episodic_return.map_or("-".to_owned(), |value| format!("{value:.2}"));
    format!("{sps:.0} steps/s, return {current}")
}
