//! `playbot diagnose`.

use crate::{
    arguments::{Compute, check_start, experiment::ExperimentArgs, open},
    error::{CliError, Outcome},
    output,
    output::{print_line, program},
    progress::{interrupt, interrupt::NothingToSave},
};
use bevy_playbot::{demo::file::DemoReader, engine::find_demos};
use playbot_harness::{
    game::Game,
    games::{Artifact, Games},
    sealed_file::file_checksum,
};
use playbot_learner::SkillModel;
use playbot_report::Report;
use playbot_train::{
    Experiment,
    diagnose::{DiagnoseError, Diagnosis, Evidence, Gathering, diagnose, of_game, of_recordings, of_run},
    run_dir::RunDir,
    self_play::ladder::Ladder,
};
use std::{
    path::{Path, PathBuf},
    time::Instant,
};

/// Find out why an agent does not learn: findings with evidence, the likely cause, and what to try, most likely first.
///
/// Looks at a run (finished, stopped or in training), at recordings, or at a game before anything is trained. Of a run it
/// reads settings, metrics and recordings. With --replays, random actions, chaos, doing nothing, the demonstrator and the
/// policy play, recordings are replayed, actions are forced in copies of a World, and the doctor examines the game. A
/// game is always played. Exit code 1 if something was found.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot diagnose --run runs/first
  playbot diagnose --run runs/first --replays
  playbot diagnose --run runs/first --replays --skills skills.safetensors --json
  playbot diagnose --run runs/first --replays --out why.html
  playbot diagnose --demo my.demo --replays
  playbot diagnose GAME
  playbot diagnose GAME --set algorithm=ppo --set ppo.gamma=0.5")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Folder of a run.
    #[arg(long, conflicts_with_all = ["game", "experiment", "set", "demo"])]
    run: Option<PathBuf>,
    /// Recording, or a folder of some (repeatable). They name their game.
    #[arg(long, value_name = "FILE")]
    demo: Vec<PathBuf>,
    /// Skill model of the run, which is compared with its recordings.
    #[arg(long, value_name = "FILE")]
    skills: Option<PathBuf>,
    /// Play, replay recordings, force actions and examine the game, too: up to three minutes on two cores.
    #[arg(long)]
    replays: bool,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
    /// Also write the findings as a page, an .html.
    #[arg(long, value_name = "FILE", value_parser = output::html)]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) compute: Compute,
}

/// Seconds after which steps are reported.
const SILENT_S: u64 = 2;

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    if let Some(out) = &args.out {
        output::prepare(out)?;
    }
    interrupt::leave("nothing is written: call it again".to_owned());
    let listening = NothingToSave::listen();
    let diagnosis = diagnose(&gather(&args, games)?);
    drop(listening);
    if args.json {
        print_line(diagnosis.to_json())?;
        diagnosis.notes.iter().for_each(|note| report!("note: {note}"));
    } else {
        print_line(program::named(&diagnosis.to_string()))?;
    }
    if let Some(out) = &args.out {
        write_page(out, &args, &diagnosis)?;
    }
    Ok(if diagnosis.is_healthy() { Outcome::Pass } else { Outcome::Findings })
}

fn gather(args: &Args, games: &Games) -> Result<Evidence, CliError> {
    let start = Instant::now();
    let progress = |step: &str| {
        if start.elapsed().as_secs() >= SILENT_S || args.replays {
            report!("diagnose: {step}");
        }
    };
    let locate = |path: &Path| args.from.find_recordings(path, games);
    let (threads, device) = (args.compute.threads(), args.compute.device());
    let gathering = Gathering { replays: args.replays, threads, device, progress: &progress, recordings: &locate };
    if let Some(path) = &args.run {
        let opened = RunDir::open(path)?;
        let game = games.of_file(Artifact::Run, path, &opened.experiment.game)?;
        if args.replays {
            check_plays(game, &opened.experiment)?;
        }
        check_skills(args, path, opened.info.skills.as_deref())?;
        let skills = skills(args)?;
        return of_run(game, path, skills.as_ref(), &gathering).map_err(explain);
    }
    if !args.demo.is_empty() {
        let (game, from) = of_demos(args, games)?;
        let experiment = from.load(games, [])?;
        let skills = skills(args)?;
        let mut evidence =
            of_recordings(game, &experiment, &args.demo, skills.as_ref(), &gathering).map_err(explain)?;
        if !args.from.names_game() {
            // They are compared with levels that somebody has named, and not with a default.
            evidence.other_modes.clear();
            evidence.held_out_recorded = 0;
        }
        return Ok(evidence);
    }
    if !args.from.names_game() {
        return Err(CliError::Usage(
            "nothing to look at: name a --run, a --demo, a game or an --experiment (see `playbot diagnose --help`)"
                .to_owned(),
        ));
    }
    let (experiment, game) = args.from.open(games, [])?;
    experiment.check_levels(game)?;
    check_plays(game, &experiment)?;
    let skills = skills(args)?;
    let gathering = Gathering { replays: true, ..gathering };
    of_game(game, &experiment, skills.as_ref(), &gathering).map_err(explain)
}

/// Reports a game that cannot start by its first panic.
fn check_plays(game: &dyn Game, experiment: &Experiment) -> Result<(), CliError> {
    experiment.train.check(game)?;
    check_start(game, &experiment.train.mode, experiment.train.first)
}

/// Refuses skills that are not those of the run, which would say nothing of it.
fn check_skills(args: &Args, run: &Path, own: Option<&str>) -> Result<(), CliError> {
    let Some(file) = &args.skills else { return Ok(()) };
    let why = match own {
        Some(own) if file_checksum(file)? != own => "the run was trained with the skills of another file",
        Some(_) => return Ok(()),
        None => "the run has no skills",
    };
    Err(CliError::Usage(format!("{} is no evidence of {}: {why}; leave out --skills", file.display(), run.display())))
}

fn skills(args: &Args) -> Result<Option<SkillModel>, CliError> {
    args.skills.as_deref().map(|path| open::skills(path, args.compute.device(), &args.from)).transpose()
}

/// Returns the game of the first recording, and the experiment that is its default unless another one is named.
fn of_demos<'a>(args: &Args, games: &Games<'a>) -> Result<(&'a dyn Game, ExperimentArgs), CliError> {
    if args.from.names_game() {
        let experiment = args.from.load(games, [])?;
        return Ok((args.from.find_game(games, &experiment)?, args.from.clone()));
    }
    let mut first: Option<(PathBuf, String)> = None;
    for path in &args.demo {
        for file in find_demos(path).map_err(open::missing_recording)? {
            let game = DemoReader::open(&file).map_err(open::missing_recording)?.header().game.clone();
            match &first {
                Some((other, known)) if *known != game => {
                    return Err(CliError::Usage(format!(
                        "{} is of {known}, and {} is of {game}: name recordings of one game, or the game that they should \
                         be of",
                        other.display(),
                        file.display()
                    )));
                }
                Some(_) => {}
                None => first = Some((file, game)),
            }
        }
    }
    let (file, game) = first.unwrap_or_else(|| (args.demo[0].clone(), String::new()));
    let game = games.of_file(Artifact::Recording, &file, &game)?;
    Ok((game, ExperimentArgs { set: args.from.set.clone(), ..ExperimentArgs::of_game(game.name()) }))
}

fn explain(error: DiagnoseError) -> CliError {
    match error {
        DiagnoseError::Recording(error) => open::missing_recording(error),
        other => other.into(),
    }
}

fn write_page(out: &Path, args: &Args, diagnosis: &Diagnosis) -> Result<(), CliError> {
    let subject = match (&args.run, args.demo.first()) {
        (Some(run), _) => run.display().to_string(),
        (None, Some(demo)) => demo.display().to_string(),
        (None, None) => diagnosis.context.experiment.game.clone(),
    };
    let Experiment { algorithm, train, .. } = &diagnosis.context.experiment;
    let subtitle = format!("{algorithm} on {train}");
    let ladder = args.run.as_deref().map(Ladder::read).transpose()?.flatten();
    let sections = [diagnosis.section()].into_iter().chain(ladder.map(|ladder| ladder.section())).collect();
    let report = Report { title: format!("Diagnosis of {subject}"), subtitle, sections };
    report.write(out).map_err(|error| CliError::Io(error.to_string()))?;
    report!("{}", out.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::command_line::check_usage;
    use playbot_train::{
        Algorithm, Experiment,
        diagnose::{Advice, AdviceContext},
        experiment::file::parse_experiment,
    };
    use std::path::Path;

    /// Splits the command as a shell does: single quotes keep blanks.
    fn words(command: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let mut is_quoted = false;
        for letter in command.chars() {
            match letter {
                '\'' => is_quoted = !is_quoted,
                ' ' if !is_quoted => words.push(String::new()),
                letter => words.last_mut().expect("there is one from the start").push(letter),
            }
        }
        words
    }

    #[test]
    fn every_command_that_is_advised_can_be_parsed() {
        let text = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 1000)"#;
        let experiment = parse_experiment(text, Path::new("x.ron")).expect("valid");
        let mut commands = 0;
        for algorithm in Algorithm::TRAINED {
            for (run, demos) in [(None, None), (Some("runs/a b"), Some("my demos"))] {
                let own = |path: Option<&str>| path.map(str::to_owned);
                let experiment = Experiment { algorithm, ..experiment.clone() };
                let context = AdviceContext { run: own(run), demos: own(demos), ..AdviceContext::new(&experiment) };
                for command in Advice::ALL.into_iter().filter_map(|advice| advice.command(&context)) {
                    check_usage(words(&command)).unwrap_or_else(|error| panic!("{command}\n{error}"));
                    commands += 1;
                }
            }
        }
        assert!(commands > 200, "{commands}");
    }
}
