//! `playbot study`.

use crate::{
    arguments::{
        Compute, check_start,
        experiment::{ExperimentArgs, Options, in_words, include_seen, quoted, report_unread, sets_key},
        revision,
    },
    error::{CliError, Outcome},
    output,
    output::{print_line, program},
    progress,
    progress::{console::Console, interrupt},
    verbs::learn_skills,
};
use bevy_playbot::unknown_name::UnknownName;
use indicatif::ProgressBar;
use playbot_harness::{games::Games, sealed_file::read_sealed, split::LevelSplit};
use playbot_learner::DeviceKind;
use playbot_train::{
    Experiment,
    run_dir::is_unstarted,
    run_observer::{Advance, CountedWork, Counter, RunEvent, RunObserver},
    study::{
        RESULTS, StudyError, StudyReport, StudyRun, check_experiment_file, rewrite_table, study_runs, study_variants,
        write_cost, write_report,
    },
    study_runner::{StudyRunError, StudyRunner},
    train_run::{TrainingSetup, never_learns, rounded},
};
use serde_json::json;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

/// Compare variants of an experiment over several seeds.
///
/// Every variant with every seed learns skills, trains, and is measured on the held-out levels. Those of a layout that
/// some run trains on, or learns from recordings of, are left out for all runs, and counted. The tables and the plot do
/// not depend on the machine: the same study gives the same files. Only cost.md reports time.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot study GAME --seeds 1,2,3 --out study
  playbot study --experiment my.ron --out study
  playbot study --experiment my.ron --seeds 1,2,3,4,5 --set steps=200000 --out study
  playbot study --experiment my.ron --variant full --variant no-kl --out study
  playbot study --experiment my.ron --include-seen --out study
  playbot study --experiment my.ron --seeds 1,2,3,4,5 --set steps=200000 --out study --resume
  playbot study --out study --rewrite")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Run only this variant of the experiment's (default: all, repeatable).
    #[arg(long, value_name = "NAME")]
    variant: Vec<String>,
    /// Random seeds, instead of the experiment's.
    #[arg(long, value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Also measure the held-out levels that are left out otherwise, and add a table of all levels.
    #[arg(long)]
    include_seen: bool,
    /// Folder for table.md, experiment.ron, curves.svg, results.json and cost.md, which are replaced.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Folder of the runs (default: `runs/` and the name of the experiment file, or else of the game).
    #[arg(long, value_name = "FOLDER")]
    runs: Option<PathBuf>,
    /// Resume existing runs. Finished ones are not repeated.
    #[arg(long)]
    resume: bool,
    /// Replace existing runs.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Run nothing. Write table.md and experiment.ron anew from the results.json in the folder.
    #[arg(
        long,
        conflicts_with_all = ["game", "experiment", "set", "variant", "seeds", "include_seen", "runs", "resume", "force", "json"]
    )]
    rewrite: bool,
    /// Most runs that go on side by side, each on its share of the threads (default: as many as there are threads, and as fit
    /// into the free memory). The results do not depend on their number.
    #[arg(long, value_name = "RUNS", value_parser = clap::value_parser!(u64).range(1..))]
    side_by_side: Option<u64>,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// One line of JSON per run instead of the table.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    if args.rewrite {
        rewrite_table(&args.out)?;
        report!("written to {}: table.md and experiment.ron, from its results.json", args.out.display());
        return Ok(Outcome::Pass);
    }
    let seeds = (!args.seeds.is_empty()).then(|| format!("seeds={:?}", args.seeds));
    let mut experiment = args.from.load(games, [seeds, include_seen(args.include_seen)])?;
    keep(&mut experiment, &args.variant)?;
    let runs = study_runs(&experiment)?;
    check_games(&runs, &args.from, games)?;
    report_taken_back(&experiment, &args.from.set);
    report_idle_settings(&experiment, &runs, &args.from.set);
    let folder = runs_folder(&args, &experiment);
    check_folder(&folder, &runs, &args)?;
    check_results(&runs, &args)?;
    check_experiment_file(&args.out)?;
    for path in [&folder, &args.out] {
        output::make_folder(path)?;
    }
    let trained = runs.iter().filter(|run| run.experiment.algorithm.is_trained());
    let lengths: BTreeSet<String> = trained.filter_map(|run| rounded(&run.experiment)).collect();
    lengths.iter().for_each(|words| report!("{words}"));
    let idle: BTreeSet<String> = runs
        .iter()
        .filter_map(|run| Some((&run.variant, never_learns(&run.experiment)?)))
        .map(|(variant, words)| format!("{variant}: {words}"))
        .collect();
    idle.iter().for_each(|words| report!("warning: {words}"));
    interrupt::listen();
    interrupt::go_on_with(format!("`{} --resume`", restart(&args)));
    let locate = |path: &Path| args.from.find_recordings(path, games);
    let (device, threads) = (args.compute.device(), args.compute.threads());
    let setup = TrainingSetup { device, threads, revision: revision(), recordings: &locate };
    let mut console = StudyConsole::new(&runs);
    let most = args.side_by_side.map(|runs| runs as usize);
    let mut runner = StudyRunner::new(games, &folder, args.force, setup).side_by_side(most);
    let explained = |error| explain(error, &args.from);
    runner.check_folders(&runs)?;
    runner.check_recordings(&runs, &mut console).map_err(explained)?;
    console.begin();
    let ended = runner.run_all(&runs, command(&args), experiment, &mut console).map_err(explained)?;
    let Some(report) = ended else {
        drop(console);
        report!(
            "stopped and saved; the study is incomplete, and its tables are not written: go on with `{} --resume`",
            restart(&args)
        );
        return Ok(Outcome::Stopped);
    };
    console.end();
    write_report(&args.out, &report)?;
    write_cost(&args.out, &runs, &folder, &command(&args), setup.threads)?;
    if args.json {
        report.results.iter().try_for_each(|result| print_line(json!(result)))?;
    } else {
        print_line(report.summary().trim_end())?;
        let with_seen = report.with_seen();
        if !with_seen.is_empty() {
            print_line(format!("\n{}", with_seen.trim_end()))?;
        }
    }
    report!("written to {}: table.md, experiment.ron, curves.svg, results.json, cost.md", args.out.display());
    Ok(Outcome::Pass)
}

/// Explains an error of a study. Other settings than those of an existing run are named with the options that set them.
fn explain(error: StudyRunError, from: &ExperimentArgs) -> CliError {
    let options = Options { from, own: &[] };
    match error {
        StudyRunError::OtherSettings { folder, wanted, saved } => CliError::Usage(format!(
            "{} holds a run with other settings: {}; ask for the same, choose another folder with --runs, or replace all \
             with --force",
            folder.display(),
            in_words(options.differences(&wanted, &saved, "the run", &[]))
        )),
        StudyRunError::Skills(error) => learn_skills::explain(*error, &options),
        other => other.into(),
    }
}

/// Reports the progress of a study: that of its runs, and of all together.
struct StudyConsole {
    console: Console<'static>,
    /// The bar of all runs, once the first begins.
    whole: Option<ProgressBar>,
    /// Number of runs.
    runs: usize,
    /// Steps of all runs, and of those that have ended.
    steps: u64,
    done: u64,
    /// The present runs, by their names.
    present: BTreeMap<String, PresentRun>,
}

/// A run that goes on.
struct PresentRun {
    /// Its place among all, from 1.
    number: usize,
    /// Steps of its training, and those that are done.
    steps: u64,
    done: u64,
    /// Its skills, while it learns them.
    skills: String,
}

/// Most present runs that are named.
const MOST_NAMED: usize = 4;

impl StudyConsole {
    fn new(runs: &[StudyRun]) -> Self {
        let steps = runs.iter().map(trained_steps).sum();
        Self { console: Console::default(), whole: None, runs: runs.len(), steps, done: 0, present: BTreeMap::new() }
    }

    fn begin(&mut self) {
        self.whole = Some(progress::bar("study", self.steps, "steps"));
    }

    fn end(self) {
        self.whole.iter().for_each(ProgressBar::finish_and_clear);
    }

    /// Returns the steps of all runs that are done.
    fn steps_done(&self) -> u64 {
        self.done + self.present.values().map(|run| run.done).sum::<u64>()
    }

    /// Shows which runs go on, and how far all of them are.
    fn show(&self) {
        let Some(whole) = &self.whole else { return };
        whole.set_position(self.steps_done());
        let mut runs: Vec<&PresentRun> = self.present.values().collect();
        runs.sort_by_key(|run| run.number);
        let mut named: Vec<String> =
            runs.iter().take(MOST_NAMED).map(|run| format!("{}{}", run.number, run.skills)).collect();
        let more = runs.len().saturating_sub(MOST_NAMED);
        if more > 0 {
            named.push(format!("{more} more"));
        }
        let runs = if runs.len() == 1 { "run" } else { "runs" };
        whole.set_message(format!("{runs} {} of {}", named.join(", "), self.runs));
    }

    fn advance(&mut self, run: &StudyRun, advance: Advance) {
        if let Some(present) = self.present.get_mut(&run.id()) {
            match advance {
                Advance::Skills { batches, of } => {
                    present.skills = format!(" (skills {} %)", 100 * batches / of.max(1))
                }
                Advance::Steps(steps) => (present.done, present.skills) = (steps.min(present.steps), String::new()),
            }
        }
        self.show();
    }
}

impl RunObserver for StudyConsole {
    fn stopped(&self) -> bool {
        self.console.stopped()
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        let Some(whole) = self.whole.clone() else { return self.console.observe(event) };
        match event {
            RunEvent::KnownLevels { .. } | RunEvent::OtherModes { .. } | RunEvent::MasksUnknown { .. } => {
                whole.suspend(|| self.console.observe(event));
            }
            RunEvent::StudyRunBegun { index, run } => {
                self.console.set_title(run.id());
                let present =
                    PresentRun { number: index + 1, steps: trained_steps(run), done: 0, skills: String::new() };
                self.present.insert(run.id(), present);
                self.show();
            }
            RunEvent::StudyRunAdvanced { run, done } => self.advance(run, done),
            RunEvent::StudyRunEnded { run, result } => {
                self.done += self.present.remove(&run.id()).map_or(0, |run| run.steps);
                whole.set_position(self.steps_done());
                let test = &result.test;
                let line = format!("{}: held-out return {:.2} ± {:.2}", run.id(), test.return_mean, test.return_se);
                whole.suspend(|| report!("{line}"));
            }
            RunEvent::Updated { report, .. } => {
                // The only run.
                self.present.values_mut().for_each(|run| run.done = report.step.min(run.steps));
                self.show();
                self.console.observe(event);
            }
            other => self.console.observe(other),
        }
    }

    fn counter(&mut self, work: CountedWork<'_>) -> Counter {
        self.console.counter(work)
    }
}

/// Returns the steps of a run's training.
fn trained_steps(run: &StudyRun) -> u64 {
    if run.experiment.algorithm.is_trained() { run.experiment.whole_steps() } else { 0 }
}

/// Keeps the named variants, in the order of the experiment; all of them by default. A `--set` that does not fit the
/// others does no harm.
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
    let mut started = BTreeSet::new();
    for StudyRun { variant, experiment } in runs {
        let game = from.find_game(games, experiment)?;
        let of_variant = |source| StudyError::Values { variant: variant.clone(), source };
        experiment.check_game(game).map_err(of_variant)?;
        experiment.check_memory(game).map_err(of_variant)?;
        let LevelSplit { mode, first, .. } = &experiment.train;
        if started.insert((game.name(), mode)) {
            check_start(game, mode, *first)?;
        }
    }
    Ok(())
}

/// Reports `--set` values that variants override.
fn report_taken_back(experiment: &Experiment, sets: &[String]) {
    for (key, value) in sets.iter().filter_map(|set| set.split_once('=')) {
        let variants = experiment.variants.iter();
        let own = variants.filter(|variant| variant.set.iter().any(|set| sets_key(set, key.trim())));
        let names: Vec<&str> = own.map(|variant| variant.name.as_str()).collect();
        if !names.is_empty() {
            report!("warning: --set {key}={value} does not change {}: their own value comes last", names.join(", "));
        }
    }
}

/// Reports settings without effect: of `--set` in no run, and of a variant in none of its runs.
fn report_idle_settings(experiment: &Experiment, runs: &[StudyRun], sets: &[String]) {
    let of = |is_meant: &dyn Fn(&StudyRun) -> bool| -> Vec<&Experiment> {
        runs.iter().filter(|run| is_meant(run)).map(|run| &run.experiment).collect()
    };
    report_unread("--set ", sets, &of(&|_| true));
    for variant in &experiment.variants {
        report_unread(&format!("{}: ", variant.name), &variant.set, &of(&|run| run.variant == variant.name));
    }
}

/// Returns the folder of the runs: runs of different games lie apart.
fn runs_folder(args: &Args, experiment: &Experiment) -> PathBuf {
    let default = if args.from.names_game() { &experiment.game } else { "study" };
    let file = args.from.experiment.as_deref().filter(|file| *file != Path::new("-"));
    let name = file.and_then(Path::file_stem).unwrap_or(default.as_ref());
    args.runs.clone().unwrap_or_else(|| Path::new("runs").join(name))
}

/// Refuses existing runs without `--resume` or `--force`; those of other variants and seeds may lie beside them.
fn check_folder(folder: &Path, runs: &[StudyRun], args: &Args) -> Result<(), CliError> {
    let begun = runs.iter().map(|run| folder.join(run.id())).find(|run| run.exists() && !is_unstarted(run));
    let Some(begun) = begun.filter(|_| !args.resume && !args.force) else { return Ok(()) };
    Err(CliError::Usage(format!(
        "{} is there already: go on with --resume, replace all runs of this study with --force, or choose another folder \
         with --runs",
        begun.display()
    )))
}

/// Refuses to replace the results of other runs without `--force`.
fn check_results(runs: &[StudyRun], args: &Args) -> Result<(), CliError> {
    let path = args.out.join(RESULTS);
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

/// Returns the command that gives the same files, without options that do not change them.
fn command(args: &Args) -> String {
    let game = args.from.game.iter().map(|game| quoted(game));
    let mut words: Vec<String> = [format!("{} study", program::name())].into_iter().chain(game).collect();
    let option = |name: &str, value: String| format!("--{name} {}", quoted(&value));
    words.extend(args.from.experiment.iter().map(|path| option("experiment", path.display().to_string())));
    words.extend(args.from.set.iter().map(|set| option("set", set.clone())));
    words.extend(args.variant.iter().map(|variant| option("variant", variant.clone())));
    if !args.seeds.is_empty() {
        words.push(option("seeds", args.seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(",")));
    }
    words.extend(args.include_seen.then(|| "--include-seen".to_owned()));
    if args.compute.device() != DeviceKind::default() {
        words.push(option("device", args.compute.device().to_string()));
    }
    words.push(option("out", args.out.display().to_string()));
    words.join(" ")
}

/// Returns the command with the options that find its runs again.
fn restart(args: &Args) -> String {
    let runs = args.runs.as_ref().map(|path| format!(" --runs {}", quoted(&path.display().to_string())));
    command(args) + &runs.unwrap_or_default()
}
