//! `playbot imitate`.

use crate::{
    arguments::{
        Compute, check_start,
        experiment::{ExperimentArgs, in_words, option, sets_key},
        revision,
    },
    error::{CliError, Outcome},
    output::program,
    progress::{console::Console, interrupt},
};
use playbot_harness::games::{Artifact, Games};
use playbot_report::{counted, whole};
use playbot_train::{
    UpdateReport,
    imitate::{Imitation, ImitationProgress},
    run_dir::RunDir,
    train_run::{NewRun, TrainingSetup},
};
use std::path::{Path, PathBuf};

/// Imitate recordings, or a demonstrator that is asked in the states that the policy visits (DAgger).
///
/// With --dagger the policy plays, and the game's demonstrator is asked for its action in each state. The policy learns
/// from all states of all rounds, and the share of the demonstrator's own actions falls from round to round. Without
/// --dagger the policy learns from recordings alone.
///
/// After each round the policy is measured on the last training levels, on which the demonstrator is never asked;
/// recordings may show them. Imitation ends after some rounds without a better result. The run holds the best policy: `eval`, `test` and `policy` take it, and
/// `train --algorithm ppo --from RUN` trains it further.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot imitate GAME --dagger --run runs/asked
  playbot imitate GAME --demos demos/GAME --run runs/imitated
  playbot imitate GAME --dagger --rounds 20 --steps 5000 --set ppo.hidden=[64,64] --run runs/asked
  playbot imitate --run runs/asked --resume")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Ask the game's demonstrator in the states that the policy visits.
    #[arg(long, conflicts_with = "demos")]
    dagger: bool,
    /// File or folder of recordings to imitate, instead of the experiment's.
    #[arg(long, value_name = "PATH")]
    demos: Option<PathBuf>,
    /// Folder of the run.
    #[arg(long)]
    run: PathBuf,
    /// Most rounds, instead of the experiment's.
    #[arg(long)]
    rounds: Option<u64>,
    /// Steps that are labelled in a round of --dagger, instead of the experiment's.
    #[arg(long)]
    steps: Option<u64>,
    /// Random seed, instead of the experiment's.
    #[arg(long)]
    seed: Option<u64>,
    /// Resume from the last checkpoint of the run, with its settings.
    #[arg(long, conflicts_with_all = ["dagger", "demos", "rounds", "steps", "seed", "force"])]
    resume: bool,
    /// Delete the folder of the run first if it exists.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    pub(crate) compute: Compute,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let mut console = Console::new("imitate");
    let locate = |path: &Path| match &args.demos {
        Some(_) => path.to_owned(),
        None => args.from.find_recordings(path, games),
    };
    let (device, threads) = (args.compute.device(), args.compute.threads());
    let setup = TrainingSetup { device, threads, revision: revision(), recordings: &locate };
    let (path, program) = (args.run.display(), program::name());
    let mut imitation = match args.resume {
        true => resume(&args, games, &setup)?,
        false => begin(&args, games, &setup, &mut console)?,
    };
    if imitation.is_done() {
        report!("{path} is finished: test it with `{program} eval --run {path}`");
        return Ok(Outcome::Pass);
    }
    let levels = imitation.levels();
    match &levels.held_out {
        Some(held_out) if imitation.experiment().imitation.dagger => {
            report!("imitating on {}, and measuring rounds on {held_out}", levels.labelled);
        }
        Some(held_out) => report!("imitating recordings, and measuring rounds on {held_out}, which they may show"),
        None => report!("imitating on {}; no level is left to measure rounds on", levels.labelled),
    }
    interrupt::go_on_with(format!("`{program} imitate --run {path} --resume`"));
    if imitation.drive(&mut console, &mut report_round)? {
        if let Some(best) = imitation.progress().best {
            let (round, success) = (best.round, 100.0 * best.success);
            report!(
                "the policy of round {round} is kept: it reaches the goal in {success:.0} % of the measured episodes"
            );
        }
        report!("done: test it with `{program} eval --run {path}`");
        return Ok(Outcome::Pass);
    }
    let rounds = counted(imitation.progress().rounds, "round");
    report!("stopped and saved after {rounds}: go on with `{program} imitate --run {path} --resume`");
    Ok(Outcome::Stopped)
}

/// Reports a round with its result.
fn report_round(progress: &ImitationProgress, report: &UpdateReport) {
    let steps = whole(progress.steps as f64);
    let measured = match (report.success_rate, report.episodic_return) {
        (Some(success), Some(value)) => format!(", goal reached in {:.0} %, return {value:.2}", 100.0 * success),
        _ => String::new(),
    };
    let loss = report.learner.scalars().find(|(tag, _)| *tag == "losses/imitation_loss");
    let loss = loss.map_or(String::new(), |(_, loss)| format!(", loss {loss:.3}"));
    report!("round {}: {steps} steps{loss}{measured}", progress.rounds);
}

fn begin<'a>(
    args: &Args,
    games: &Games<'a>,
    setup: &TrainingSetup<'_>,
    console: &mut Console<'_>,
) -> Result<Imitation<'a>, CliError> {
    let settings = [
        option("algorithm", &Some("imitation")),
        option("imitation.dagger", &args.dagger.then_some(true)),
        option("imitation.rounds", &args.rounds),
        option("imitation.steps", &args.steps),
        option("seed", &args.seed),
    ];
    let (mut experiment, game) = args.from.open(games, settings)?;
    if args.demos.is_some() {
        experiment.demos.clone_from(&args.demos);
    }
    if !experiment.imitation.dagger && experiment.demos.is_none() {
        return Err(CliError::Usage(
            "nothing to imitate: name recordings with --demos, or ask the game's demonstrator with --dagger".to_owned(),
        ));
    }
    let sets_steps = args.steps.is_some() || args.from.set.iter().any(|set| sets_key(set, "imitation.steps"));
    if sets_steps && !experiment.imitation.dagger {
        report!("warning: `imitation.steps` changes nothing without --dagger: recordings are learned from as a whole");
    }
    check_start(game, &experiment.train.mode, experiment.train.first)?;
    interrupt::leave("nothing is learned yet".to_owned());
    let new = NewRun {
        path: &args.run,
        experiment: &experiment,
        skills: None,
        skill_file: None,
        from: None,
        force: args.force,
    };
    Ok(Imitation::begin(game, &new, setup, console)?)
}

fn resume<'a>(args: &Args, games: &Games<'a>, setup: &TrainingSetup<'_>) -> Result<Imitation<'a>, CliError> {
    if !args.from.set.is_empty() || args.from.experiment.is_some() || args.from.game.is_some() {
        let given = args.from.set.iter().map(|set| format!("--set {set}"));
        let named = args.from.game.iter().cloned();
        let file = args.from.experiment.iter().map(|path| format!("--experiment {}", path.display()));
        let given: Vec<String> = named.chain(file).chain(given).collect();
        return Err(CliError::Usage(format!(
            "{} is resumed with its own settings: leave out {}",
            args.run.display(),
            in_words(given)
        )));
    }
    let opened = RunDir::open_to_write(&args.run)?;
    let game = games.of_file(Artifact::Run, &args.run, &opened.experiment.game)?;
    let imitation = Imitation::resume(game, opened, setup)?;
    if !imitation.is_done() {
        report!("going on after {}", counted(imitation.progress().rounds, "round"));
    }
    Ok(imitation)
}
