//! `playbot study`.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use bevy_playbot::unknown_name::UnknownName;
use indicatif::ProgressBar;
use playbot_lab::games::Games;
use playbot_lab::{
    report::{StudyReport, to_svg},
    train::{
        Experiment,
        run_dir::{is_unstarted, write_atomically},
        sealed_file::read_sealed,
        study::{StudyError, StudyRun, study_runs, study_variants},
    },
};
use playbot_learner::DeviceKind;
use serde_json::json;

use super::{
    compute::Compute,
    error::{CliError, Outcome, print_line},
    experiment::{ExperimentArgs, quoted, sets_key},
    interrupt, open, output, program, progress,
    study_cost::cost_table,
    study_rewrite::rewrite,
    study_run::Runner,
    train::{never_learns, rounded},
    unread_settings::tell_unread,
};

/// Compare variants of an experiment over several seeds.
///
/// Every variant with every seed learns skills, trains, and is measured on the held-out levels. The tables and the
/// plot say nothing of the machine: the same study gives the same files. Only cost.md says what it took.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot study GAME --seeds 1,2,3 --out study
  playbot study --experiment my.ron --out study
  playbot study --experiment my.ron --seeds 1,2,3,4,5 --set steps=200000 --out study
  playbot study --experiment my.ron --variant full --variant no-kl --out study
  playbot study --experiment my.ron --seeds 1,2,3,4,5 --set steps=200000 --out study --resume
  playbot study --out study --rewrite")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Only this variant of the experiment's; may be given several times. All of them if none is named.
    #[arg(long, value_name = "NAME")]
    variant: Vec<String>,
    /// Seeds, instead of the experiment's.
    #[arg(long, value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Folder for table.md, curves.svg, results.json and cost.md, which are replaced.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Folder of the runs; `runs/` and the name of the experiment file, or else of the game, if none is named.
    #[arg(long, value_name = "FOLDER")]
    runs: Option<PathBuf>,
    /// Go on with the runs that are there: finished ones are not repeated.
    #[arg(long)]
    resume: bool,
    /// Replace the runs that are there.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Run nothing: write table.md anew from the results.json that is in the folder.
    #[arg(long, conflicts_with_all = ["game", "experiment", "set", "variant", "seeds", "runs", "resume", "force", "json"])]
    rewrite: bool,
    #[command(flatten)]
    compute: Compute,
    /// One line of JSON per run instead of the table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    if args.rewrite {
        rewrite(&args.out)?;
        return Ok(Outcome::Pass);
    }
    let seeds = (!args.seeds.is_empty()).then(|| format!("seeds={:?}", args.seeds));
    let mut experiment = args.from.load(games, [seeds])?;
    keep(&mut experiment, &args.variant)?;
    let runs = study_runs(&experiment)?;
    check_games(&runs, &args.from, games)?;
    tell_taken_back(&experiment, &args.from.set);
    tell_idle_settings(&experiment, &runs, &args.from.set);
    let folder = runs_folder(&args, &experiment);
    check_folder(&folder, &runs, &args)?;
    check_results(&runs, &args)?;
    for path in [&folder, &args.out] {
        output::make_folder(path)?;
    }
    let trained = runs.iter().filter(|run| run.experiment.algorithm.is_trained());
    let lengths: BTreeSet<String> = trained.filter_map(|run| rounded(&run.experiment)).collect();
    lengths.iter().for_each(|words| tell!("{words}"));
    let idle: BTreeSet<String> = runs
        .iter()
        .filter_map(|run| Some((&run.variant, never_learns(&run.experiment)?)))
        .map(|(variant, words)| format!("{variant}: {words}"))
        .collect();
    idle.iter().for_each(|words| tell!("warning: {words}"));
    interrupt::listen();
    interrupt::go_on_with(format!("`{} --resume`", restart(&args)));
    let threads = args.compute.threads();
    let mut runner = Runner::new(games, &args.from, &folder, args.force, args.compute.device(), threads);
    runner.check_folders(&runs)?;
    runner.check_demos(&runs)?;
    let Some(report) = all(&mut runner, &runs, command(&args), experiment)? else {
        tell!(
            "stopped and saved; the study is incomplete, and its tables are not written: go on with `{} --resume`",
            restart(&args)
        );
        return Ok(Outcome::Stopped);
    };
    write(&args.out, &report)?;
    let cost = cost_table(&runs, &folder, &command(&args), threads);
    write_atomically(&args.out.join("cost.md"), cost.as_bytes())?;
    if args.json {
        report.results.iter().try_for_each(|result| print_line(json!(result)))?;
    } else {
        print_line(report.summary().trim_end())?;
    }
    tell!("written to {}: table.md, curves.svg, results.json, cost.md", args.out.display());
    Ok(Outcome::Pass)
}

/// Every run, one after the other; `None` after Ctrl-C.
fn all(
    runner: &mut Runner<'_>,
    runs: &[StudyRun],
    command: String,
    experiment: Experiment,
) -> Result<Option<StudyReport>, CliError> {
    let steps = |run: &StudyRun| if run.experiment.algorithm.is_trained() { run.experiment.whole_steps() } else { 0 };
    let whole = progress::bar("study", runs.iter().map(steps).sum(), "steps");
    let mut report = StudyReport { command, experiment, results: Vec::new(), curves: Vec::new() };
    let mut done = 0;
    for (index, run) in runs.iter().enumerate() {
        let id = run.id();
        whole.set_message(format!("run {} of {}", index + 1, runs.len()));
        let ended = runner.run(run, &id, |step| whole.set_position(done + step.min(steps(run))))?;
        let Some((result, curves)) = ended.filter(|_| !interrupt::asked() || index + 1 == runs.len()) else {
            return Ok(None);
        };
        done += steps(run);
        whole.set_position(done);
        say(&whole, &format!("{id}: held-out return {:.2} ± {:.2}", result.test.return_mean, result.test.return_se));
        report.results.push(result);
        report.curves.push(curves);
    }
    whole.finish_and_clear();
    Ok(Some(report))
}

fn say(bar: &ProgressBar, line: &str) {
    bar.suspend(|| tell!("{line}"));
}

/// Keeps the variants that are named, in the order of the experiment; all of them if none is named. What a `--set` makes of the
/// others is nobody's concern.
fn keep(experiment: &mut Experiment, named: &[String]) -> Result<(), CliError> {
    let known = study_variants(experiment)?;
    let names: Vec<&str> = known.iter().map(|variant| variant.name.as_str()).collect();
    if let Some(unknown) = named.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(UnknownName::new("variant", unknown, &names).into());
    }
    experiment.variants.retain(|variant| named.is_empty() || named.contains(&variant.name));
    Ok(())
}

fn check_games(runs: &[StudyRun], from: &ExperimentArgs, games: &Games) -> Result<(), CliError> {
    for StudyRun { variant, experiment } in runs {
        let game = open::game(games, from, experiment)?;
        let of_variant = |source| StudyError::Values { variant: variant.clone(), source };
        experiment.check_game(game).map_err(of_variant)?;
        experiment.check_memory(game).map_err(of_variant)?;
    }
    Ok(())
}

/// Says which of the `--set` some variants take back.
fn tell_taken_back(experiment: &Experiment, sets: &[String]) {
    for (key, value) in sets.iter().filter_map(|set| set.split_once('=')) {
        let variants = experiment.variants.iter();
        let own = variants.filter(|variant| variant.set.iter().any(|set| sets_key(set, key.trim())));
        let names: Vec<&str> = own.map(|variant| variant.name.as_str()).collect();
        if !names.is_empty() {
            tell!("warning: --set {key}={value} does not change {}: their own value comes last", names.join(", "));
        }
    }
}

/// Says which settings are not read: of the `--set` by no run, and of a variant's own by none of its runs.
fn tell_idle_settings(experiment: &Experiment, runs: &[StudyRun], sets: &[String]) {
    let of = |is_meant: &dyn Fn(&StudyRun) -> bool| -> Vec<&Experiment> {
        runs.iter().filter(|run| is_meant(run)).map(|run| &run.experiment).collect()
    };
    tell_unread("--set ", sets, &of(&|_| true));
    for variant in &experiment.variants {
        tell_unread(&format!("{}: ", variant.name), &variant.set, &of(&|run| run.variant == variant.name));
    }
}

/// Where the runs are: those of different games lie apart.
fn runs_folder(args: &Args, experiment: &Experiment) -> PathBuf {
    let usual = if args.from.names_game() { &experiment.game } else { "study" };
    let name = args.from.experiment.as_deref().and_then(Path::file_stem).unwrap_or(usual.as_ref());
    args.runs.clone().unwrap_or_else(|| Path::new("runs").join(name))
}

/// Runs that are there are neither overwritten nor gone on with unless somebody says so; those of other variants and seeds may
/// lie beside them.
fn check_folder(folder: &Path, runs: &[StudyRun], args: &Args) -> Result<(), CliError> {
    let begun = runs.iter().map(|run| folder.join(run.id())).find(|run| run.exists() && !is_unstarted(run));
    let Some(begun) = begun.filter(|_| !args.resume && !args.force) else { return Ok(()) };
    Err(CliError::Usage(format!(
        "{} is there already: go on with --resume, replace all runs of this study with --force, or choose another folder \
         with --runs",
        begun.display()
    )))
}

/// Results of other runs that stand where those of this study are to be written are not thrown away unless somebody says so.
fn check_results(runs: &[StudyRun], args: &Args) -> Result<(), CliError> {
    let path = args.out.join("results.json");
    let Some((there, _)) = read_sealed::<StudyReport>(&path).ok().filter(|_| !args.force) else {
        return Ok(());
    };
    let is_new = |variant: &str, seed| runs.iter().any(|run| run.variant == variant && run.experiment.seed == seed);
    let lost: Vec<String> = there
        .results
        .iter()
        .filter(|result| !is_new(&result.variant, result.seed))
        .map(|result| format!("{} with seed {}", result.variant, result.seed))
        .collect();
    if lost.is_empty() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "{} holds results that this study lacks: {}; choose another folder with --out, or remove the file first",
        path.display(),
        lost.join(", ")
    )))
}

fn write(out: &Path, report: &StudyReport) -> Result<(), CliError> {
    let unreadable = |error: &dyn std::error::Error| CliError::Usage(format!("cannot write the experiment: {error}"));
    let table = report.to_markdown().map_err(|error| unreadable(&error))?;
    let json = report.to_json().map_err(|error| unreadable(&error))?;
    write_atomically(&out.join("table.md"), table.as_bytes())?;
    write_atomically(&out.join("curves.svg"), to_svg(&report.charts()).as_bytes())?;
    Ok(write_atomically(&out.join("results.json"), json.as_bytes())?)
}

/// The command that gives the same files: without what does not change them.
fn command(args: &Args) -> String {
    let game = args.from.game.iter().map(|game| quoted(game));
    let mut words: Vec<String> = [format!("{} study", program::name())].into_iter().chain(game).collect();
    let mut push = |name: &str, value: String| words.push(format!("--{name} {}", quoted(&value)));
    if let Some(path) = &args.from.experiment {
        push("experiment", path.display().to_string());
    }
    for set in &args.from.set {
        push("set", set.clone());
    }
    for variant in &args.variant {
        push("variant", variant.clone());
    }
    if !args.seeds.is_empty() {
        push("seeds", args.seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(","));
    }
    if args.compute.device() != DeviceKind::default() {
        push("device", args.compute.device().to_string());
    }
    push("out", args.out.display().to_string());
    words.join(" ")
}

/// The command with what it needs to find its runs again.
fn restart(args: &Args) -> String {
    let runs = args.runs.as_ref().map(|path| format!(" --runs {}", quoted(&path.display().to_string())));
    command(args) + &runs.unwrap_or_default()
}
