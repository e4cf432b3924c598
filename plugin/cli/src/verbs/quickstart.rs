//! `playbot quickstart`: learn, train, test and report in one command.

use crate::{
    arguments::{
        Threads, check_start_and_steps,
        experiment::{ExperimentArgs, include_seen, option},
        number_of_steps, player, revision,
    },
    error::{CliError, Outcome},
    output::{print_line, program},
    progress::{self, console::Console, interrupt},
    verbs::{learn_skills, train::report_length},
};
use bevy_playbot::policy::ActionDraw;
use playbot_harness::{
    eval::{EvalPlan, Player},
    game::Game,
    games::Games,
    held_out::{HeldOut, KnownLevels},
    sealed_file::write_atomically,
};
use playbot_learner::{Dataset, DeviceKind, SeenLevels, SkillModel, disk};
use playbot_report::{
    Chart, Curve, Report, ResultRow, ResultTable, Section, Table, counted,
    statistics::{median, steps_to_reach},
    times, to_text_table, whole,
};
use playbot_train::{
    Algorithm, Experiment,
    diagnose::{Diagnosis, of_metrics},
    learn_skills::{behaviour_cloning, learn},
    metrics_log::{SUCCESS_RATE, range_of},
    recordings::read_dataset,
    run_dir::{RunLock, check_replaceable, is_unstarted},
    runs::RunCurves,
    train_run::{NewRun, Reached, Training, TrainingSetup, train_to_success},
};
use serde_json::json;
use std::{
    path::{Path, PathBuf},
    time::Instant,
};

/// Seeds for the steps to success.
const SEEDS: u64 = 3;

/// The file of the skill model.
const SKILLS: &str = "skills.safetensors";

/// Learn skills, train SCORE-PPO and PPO, test both on unseen levels, write a report.
///
/// Both train for the same number of steps on the experiment's training levels, with its recordings. Behaviour cloning
/// and the blind baselines are measured beside them, on levels of layouts that none of them has seen. Then the steps to
/// success, at which a method mostly succeeds, are measured with further seeds, which train only that long.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot
  playbot quickstart --json --run runs/another --seed 2

Needs recordings at the experiment's `demos` (default: demos/ and the name of the game). The verbs record and play make
them.")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Folder for all output. The output of an earlier quickstart there is replaced.
    #[arg(long, default_value = "runs/quickstart")]
    run: PathBuf,
    /// Random seed, instead of the experiment's.
    #[arg(long)]
    seed: Option<u64>,
    /// Number of random seeds for the steps to success: that seed and those after it.
    #[arg(long, default_value_t = SEEDS, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Environment steps for each learner, instead of the experiment's.
    #[arg(long, value_parser = number_of_steps)]
    steps: Option<u64>,
    /// Passes over the recordings, instead of the experiment's.
    #[arg(long)]
    epochs: Option<usize>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Measure held-out levels of a layout that was trained on or recorded with the others, instead of leaving them out.
    #[arg(long)]
    include_seen: bool,
    /// One line of JSON per method instead of a table.
    #[arg(long)]
    json: bool,
}

impl Default for Args {
    fn default() -> Self {
        Self {
            from: ExperimentArgs::default(),
            run: "runs/quickstart".into(),
            seed: None,
            seeds: SEEDS,
            steps: None,
            epochs: None,
            include_seen: false,
            threads: Threads::default(),
            json: false,
        }
    }
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let start = Instant::now();
    let experiment = read_experiment(&args, games)?;
    let game = args.from.find_game(games, &experiment)?;
    let trained = Experiment { algorithm: Algorithm::ScorePpo, ..experiment.clone() };
    trained.check_levels(game)?;
    trained.check_memory(game)?;
    check_start_and_steps(game, &experiment.train.mode, experiment.train.first)?;
    check_folder(&args.run)?;
    // Not later: without recordings no folder is made.
    let demos = args.from.recordings(&experiment, games)?;
    interrupt::leave(format!("nothing is saved yet: start again with `{} quickstart`", program::name()));
    let dataset = read_dataset(game, &experiment, &demos, args.threads.count(), &mut Console::default())?;
    let _lock = take_folder(&args.run)?;
    report_length(&trained);
    let Some(skills) = skills(&experiment.with_sets(game), dataset.clone(), &args)? else {
        report!("stopped while learning skills; nothing was saved, start again with `{} quickstart`", program::name());
        return Ok(Outcome::Stopped);
    };
    let draw = if experiment.eval.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
    let mut trained = Vec::new();
    for algorithm in [Algorithm::ScorePpo, Algorithm::Ppo] {
        let one = train_one(game, &experiment, algorithm, &skills, &args, draw)?;
        let finished = one.finished;
        trained.push(one);
        if !finished {
            return Ok(stopped(&args, algorithm));
        }
    }
    interrupt::leave(format!("both trainings are saved in {}, without a report", args.run.display()));
    interrupt::go_on_with(format!("`{} eval --run {}`", program::name(), args.run.join("score-ppo").display()));
    let mut players: Vec<_> = trained.iter().map(|one| (one.algorithm.name().to_owned(), one.player.clone())).collect();
    players.push(("bc".to_owned(), behaviour_cloning(&skills, &experiment, draw)));
    players.extend(game.tools().bots.blind_bots().into_iter().map(|(name, bot)| (name.to_owned(), Player::Blind(bot))));
    let known = known_levels(game, &experiment, &skills);
    let (mut rows, mut lines) = (Vec::new(), Vec::new());
    for (name, player) in &players {
        let all = experiment.eval_plan(&experiment.test, args.threads.count());
        let plan = EvalPlan { left_out: known.left_out.clone(), ..all };
        let mut measured = player::measure(game, name, player, &plan)?;
        (measured.summary.seen, measured.summary.layouts) = (known.seen, known.layouts);
        lines.push(json!(measured.summary));
        let mut row = measured.into_row();
        if let Some(one) = trained.iter().find(|one| one.algorithm.name() == name) {
            row.steps_per_s = Some(one.steps_per_s);
        }
        rows.push(row);
    }
    if !args.json {
        print_line(to_text_table(&rows))?;
    }
    let (report, comparison) = (args.run.join("report.html"), compare(&trained));
    let write = |words: &str| {
        write_report(&report, &experiment, &trained, &rows, words, start.elapsed().as_secs_f64())?;
        report!("{words}");
        report!("report: {} ({:.0} s in all)", report.display(), start.elapsed().as_secs_f64());
        Ok::<_, CliError>(())
    };
    if args.seeds > 1 {
        // Their training may take as long as all before.
        write(&comparison)?;
        report!("steps to success: {} more", counted(args.seeds - 1, "seed"));
    }
    let Some((seeds, first)) = first_success(game, &experiment, &trained, &dataset, &args)? else {
        report!("stopped; {}", interrupt::remains());
        return Ok(Outcome::Stopped);
    };
    if args.json {
        for mut line in lines {
            if let Some(one) = first.iter().find(|one| line["method"] == one.algorithm.name()) {
                line["steps_to_success"] = json!(one.steps);
            }
            print_line(line)?;
        }
    }
    write(&format!("{}; {comparison}", headline(&first, &seeds, experiment.study.threshold)))?;
    Ok(Outcome::Pass)
}

/// Finds the held-out levels of a layout that the trainings or the recordings show, and reports how many they are.
fn known_levels(game: &dyn Game, experiment: &Experiment, skills: &SkillModel) -> KnownLevels {
    let mut seen = experiment.seen_by_training(game);
    seen.extend(skills.demos().unwrap_or(&SeenLevels::default()));
    let held_out = HeldOut::new(game, &experiment.test);
    let known = progress::comparing(|progress| held_out.seen_in(&seen, progress));
    let (test, levels) = (&experiment.test, counted(known.len() as u64, "level"));
    let of_layout = "of a layout that was recorded or trained on under another number";
    // Without a new level the known ones are better than none.
    let is_all = known.len() as u64 == test.len();
    match known.len() {
        0 => {}
        _ if is_all => report!("warning: each of the held-out levels {test} is {of_layout}"),
        _ if experiment.eval.include_seen => report!("measured with the others of {test}: {levels} {of_layout}"),
        _ => report!("left out of {test}: {levels} {of_layout}"),
    }
    held_out.without(known, experiment.eval.include_seen || is_all)
}

/// A training in the report.
struct Trained {
    algorithm: Algorithm,
    player: Player,
    curve: Vec<CurvePoint>,
    /// Steps until its success rate first reached the experiment's threshold.
    steps_to_threshold: Option<u64>,
    steps_per_s: f64,
    finished: bool,
    /// What settings and metrics show.
    diagnosis: Diagnosis,
}

struct CurvePoint {
    step: u64,
    episodic_return: f64,
    success_rate: f64,
}

fn read_experiment(args: &Args, games: &Games) -> Result<Experiment, CliError> {
    Ok(args.from.load(
        games,
        [
            option("seed", &args.seed),
            option("steps", &args.steps),
            option("skills.epochs", &args.epochs),
            include_seen(args.include_seen),
        ],
    )?)
}

/// Learns the skill model and saves it; `None` after Ctrl-C.
fn skills(experiment: &Experiment, dataset: Dataset, args: &Args) -> Result<Option<SkillModel>, CliError> {
    let mut log = String::new();
    let mut console = Console::default().on_epoch(|epoch, metrics| {
        log.push_str(&format!("{}\n", learn_skills::epoch_json(epoch, metrics)));
        Ok(())
    });
    let model = learn(experiment, dataset, DeviceKind::default(), None, &mut console)?;
    drop(console);
    let Some(model) = model else { return Ok(None) };
    write_atomically(&args.run.join("skills.jsonl"), log.as_bytes())?;
    model.save(&args.run.join(SKILLS))?;
    Ok(Some(model))
}

/// Returns the setup of all trainings.
fn setup(args: &Args) -> TrainingSetup<'static> {
    TrainingSetup { revision: revision(), ..TrainingSetup::new(DeviceKind::default(), args.threads.count()) }
}

fn train_one(
    game: &dyn Game,
    experiment: &Experiment,
    algorithm: Algorithm,
    skills: &SkillModel,
    args: &Args,
    draw: ActionDraw,
) -> Result<Trained, CliError> {
    let experiment = Experiment { algorithm, ..experiment.clone() };
    let skills = algorithm.needs_skills().then_some(skills);
    let (folder, skill_file) = (args.run.join(algorithm.name()), args.run.join(SKILLS));
    let skill_file = Some(skill_file.as_path());
    let new = NewRun { path: &folder, experiment: &experiment, skills, skill_file, from: None, force: true };
    let mut curve = Vec::new();
    let mut console = Console::new(format!("train {algorithm}")).on_update(|report| {
        if let Some(kl) = report.initial_kl {
            report!("{algorithm}: the first policy is the decoder, KL {kl}");
        }
        if let (Some(episodic_return), Some(success_rate)) = (report.episodic_return, report.success_rate) {
            curve.push(CurvePoint { step: report.step, episodic_return, success_rate });
        }
    });
    let mut training = Training::begin(game, &new, &setup(args), &mut console)?;
    interrupt::go_on_with(format!(
        "this training alone, `{} train --run {} --resume`",
        program::name(),
        folder.display()
    ));
    let start = Instant::now();
    let finished = training.drive(&mut console)?;
    drop(console);
    let Training { run, trainer, .. } = training;
    let steps_per_s = trainer.steps() as f64 / start.elapsed().as_secs_f64();
    let player = Player::Policy { policy: trainer.policy(), prior: trainer.skill_prior(), draw };
    let settled = RunCurves::read(run.path())?;
    let steps_to_threshold = steps_to_reach(settled.settled(SUCCESS_RATE), experiment.study.threshold);
    let diagnosis = of_metrics(&experiment, run.path())?;
    Ok(Trained { algorithm, player, curve, steps_to_threshold, steps_per_s, finished, diagnosis })
}

fn stopped(args: &Args, algorithm: Algorithm) -> Outcome {
    let run = args.run.join(algorithm.name());
    report!(
        "stopped and saved; there is no report yet: go on with this training alone, `{program} train --run {} --resume`, \
         or start again with `{program} quickstart`",
        run.display(),
        program = program::name()
    );
    Outcome::Stopped
}

/// Returns the steps to success of each method, for the fully trained seed and for the others of `--seeds`. `None`
/// after Ctrl-C.
fn first_success(
    game: &dyn Game,
    experiment: &Experiment,
    trained: &[Trained],
    dataset: &Dataset,
    args: &Args,
) -> Result<Option<(Vec<u64>, Vec<FirstSuccess>)>, CliError> {
    interrupt::leave(format!(
        "both trainings and their report are saved in {}, without the steps to success",
        args.run.display()
    ));
    let of = |one: &Trained| FirstSuccess { algorithm: one.algorithm, steps: vec![one.steps_to_threshold] };
    let (mut seeds, mut first) = (vec![experiment.seed], trained.iter().map(of).collect::<Vec<_>>());
    let algorithms: Vec<_> = trained.iter().map(|one| one.algorithm).collect();
    for seed in (1..args.seeds).map(|more| experiment.seed.wrapping_add(more)) {
        let experiment = Experiment { seed, ..experiment.clone() };
        let steps = steps_of_seed(game, &experiment, &algorithms, dataset, &setup(args))?;
        let Some(steps) = steps else { return Ok(None) };
        seeds.push(seed);
        first.iter_mut().zip(steps).for_each(|(one, steps)| one.steps.push(steps));
    }
    Ok(Some((seeds, first)))
}

/// Describes how many steps SCORE needed for PPO's final success rate.
fn compare(trained: &[Trained]) -> String {
    let [score, ppo] = trained else { return String::new() };
    let (Some(target), Some(total)) = (ppo.curve.last().map(|point| point.episodic_return), ppo.curve.last()) else {
        return "no episode ended during training: train for longer".to_owned();
    };
    match score.curve.iter().find(|point| point.episodic_return >= target) {
        Some(point) => format!(
            "SCORE-PPO reached PPO's final training return of {target:.2} after {} of {} steps ({:.0} %)",
            point.step,
            total.step,
            100.0 * point.step as f64 / total.step as f64
        ),
        None => format!("SCORE-PPO did not reach PPO's final training return of {target:.2}"),
    }
}

/// Checks that a folder is new or of an earlier quickstart, and not in use.
///
/// # Errors
///
/// It holds something else, or is in use.
fn check_folder(path: &Path) -> Result<(), CliError> {
    let is_run = path.join("run.json").exists();
    let was_ours = RunLock::is_known(path) || path.join(Algorithm::ScorePpo.name()).join("run.json").is_file();
    if path.exists() && !is_unstarted(path) && (is_run || !was_ours) {
        return Err(CliError::Usage(format!(
            "{} is not the folder of a quickstart, so it is left alone: choose another --run",
            path.display()
        )));
    }
    if RunLock::is_known(path) {
        RunLock::take(path)?;
    }
    for run in [Algorithm::ScorePpo, Algorithm::Ppo].map(|algorithm| path.join(algorithm.name())) {
        if run.exists() {
            // Checked before skills are learned.
            check_replaceable(&run)?;
            RunLock::take(&run)?;
        }
    }
    Ok(())
}

/// Makes the folder of the quickstart and locks it.
///
/// # Errors
///
/// The system refuses, or it is in use.
fn take_folder(path: &Path) -> Result<RunLock, CliError> {
    disk::create_dir_all(path).map_err(|error| CliError::Io(format!("cannot create {}: {error}", path.display())))?;
    Ok(RunLock::take(path)?)
}

// Steps to success of each method, over several seeds.

/// The steps until a method's success rate in training first reached the experiment's threshold.
struct FirstSuccess {
    algorithm: Algorithm,
    /// The steps of each seed, `None` where the threshold was not reached.
    steps: Vec<Option<u64>>,
}

impl FirstSuccess {
    /// Returns the median over the seeds. A seed that never succeeds counts as the largest.
    fn median(&self) -> Option<u64> {
        let steps = self.steps.iter().map(|steps| steps.map_or(f64::INFINITY, |steps| steps as f64));
        median(steps.collect()).filter(|steps| steps.is_finite()).map(|steps| steps as u64)
    }
}

/// Trains `algorithms` with another seed, its own skills included, until each mostly succeeds. Only the number of steps
/// is kept. `None` after Ctrl-C.
///
/// # Errors
///
/// A loss is not a number, or the game broke its contract.
fn steps_of_seed(
    game: &dyn Game,
    experiment: &Experiment,
    algorithms: &[Algorithm],
    dataset: &Dataset,
    setup: &TrainingSetup<'_>,
) -> Result<Option<Vec<Option<u64>>>, CliError> {
    let learned = learn(&experiment.with_sets(game), dataset.clone(), setup.device, None, &mut Console::default())?;
    let Some(skills) = learned else { return Ok(None) };
    let mut all = Vec::new();
    for &algorithm in algorithms {
        let experiment = Experiment { algorithm, ..experiment.clone() };
        let mut console = Console::new(format!("train {algorithm}, seed {}", experiment.seed));
        let skills = algorithm.needs_skills().then_some(&skills);
        match train_to_success(game, &experiment, skills, setup, &mut console)? {
            Reached::After(steps) => all.push(Some(steps)),
            Reached::Never => all.push(None),
            Reached::Stopped => return Ok(None),
        }
    }
    Ok(Some(all))
}

/// Describes the median of each method, and its seeds.
fn headline(methods: &[FirstSuccess], seeds: &[u64], threshold: f64) -> String {
    let words = |steps: Option<u64>| steps.map_or("not reached".to_owned(), |steps| whole(steps as f64));
    let each = methods.iter().map(|method| format!("{} {}", method.algorithm, words(method.median())));
    let headline =
        format!("steps to {:.0} % success in training: {}", 100.0 * threshold, each.collect::<Vec<_>>().join(", "));
    if seeds.len() < 2 {
        return headline;
    }
    let by_seed = methods.iter().map(|FirstSuccess { algorithm, steps }| {
        format!("{algorithm} {}", steps.iter().map(|steps| words(*steps)).collect::<Vec<_>>().join(" and "))
    });
    let seeds = seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    format!("{headline} (the medians of seeds {seeds}: {})", by_seed.collect::<Vec<_>>().join("; "))
}

// The report.

/// Writes the report as one HTML file.
fn write_report(
    path: &Path,
    experiment: &Experiment,
    trained: &[Trained],
    rows: &[ResultRow],
    comparison: &str,
    seconds: f64,
) -> Result<(), CliError> {
    let curve = |value: fn(&CurvePoint) -> f64| -> Vec<Curve> {
        let points = |one: &Trained| one.curve.iter().map(|point| (point.step as f64, value(point))).collect();
        trained.iter().map(|one| Curve::new(one.algorithm.name(), points(one))).collect()
    };
    let chart = |title: &str, y_label: &str, curves| Chart {
        title: title.to_owned(),
        x_label: "environment steps".to_owned(),
        y_label: y_label.to_owned(),
        curves,
        y_range: None,
        ..Chart::default()
    };
    let references = paper_rows(&experiment.game);
    let orientation = match references.is_empty() {
        true => "",
        false => "The paper does not say which unseen levels it used; its figures are shown for orientation. ",
    };
    let times = times(experiment.eval.episodes_per_level);
    let table = ResultTable {
        caption: format!(
            "Return per episode on {}, each level {times}, ± one standard error over the levels; steps/s are those of the \
             training where there was one",
            experiment.test
        ),
        rows: rows.to_vec(),
        references,
    };
    let config = ron::ser::to_string_pretty(experiment, ron::ser::PrettyConfig::default())
        .map_err(|error| CliError::Io(format!("cannot write the experiment as RON: {error}")))?;
    let faulty = trained.iter().filter(|one| !one.diagnosis.is_healthy());
    let why = faulty.map(|one| {
        let section = one.diagnosis.section();
        Section { heading: format!("{}: {}", one.algorithm, section.heading), ..section }
    });
    let report = Report {
        title: format!("{}: skills from recordings, tested on unseen levels", experiment.game),
        subtitle: format!(
            "{} steps on {}, seed {}, {seconds:.0} seconds on this machine",
            experiment.steps, experiment.train, experiment.seed
        ),
        sections: why
            .chain([
                Section {
                    heading: "Unseen levels".to_owned(),
                    text: format!(
                        "{comparison}.\n\n{orientation}A blind player is a baseline that any learner must beat."
                    ),
                    tables: vec![Table::Results(table)],
                    ..Section::default()
                },
                Section {
                    heading: "Learning curves".to_owned(),
                    text: "Means over the last 100 training episodes.".to_owned(),
                    charts: vec![
                        chart("Return on training levels", "return", curve(|point| point.episodic_return)),
                        Chart {
                            y_range: range_of(SUCCESS_RATE),
                            ..chart("Success on training levels", "success rate", curve(|point| point.success_rate))
                        },
                    ],
                    ..Section::default()
                },
                Section { heading: "Experiment".to_owned(), code: vec![config], ..Section::default() },
            ])
            .collect(),
    };
    report.write(path).map_err(|error| CliError::Io(error.to_string()))
}

/// The game of the paper's measurements.
const GAME_OF_THE_PAPER: &str = "coinrun";

/// Returns Table 3 of the paper: 64 unseen hard levels, 100,000 steps of evaluation. Empty for other games.
fn paper_rows(game: &str) -> Vec<ResultRow> {
    if game != GAME_OF_THE_PAPER {
        return Vec::new();
    }
    let row = |method: &str, return_mean, return_se| ResultRow {
        method: method.to_owned(),
        split: "64 unseen hard levels".to_owned(),
        episodes: 0,
        return_mean,
        return_se,
        level_returns: Vec::new(),
        success: f64::NAN,
        length_mean: f64::NAN,
        steps_per_s: None,
    };
    vec![row("SCORE-PPO, paper", 5.32, 0.0), row("PPO, paper", 1.63, 0.03)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_headline_has_medians_and_every_seed() {
        let method = |algorithm, steps: &[u64]| FirstSuccess {
            algorithm,
            steps: steps.iter().map(|&steps| (steps > 0).then_some(steps)).collect(),
        };
        let one = [method(Algorithm::ScorePpo, &[16_384]), method(Algorithm::Ppo, &[0])];
        assert_eq!(headline(&one, &[7], 0.8), "steps to 80 % success in training: score-ppo 16,384, ppo not reached");
        let three = [method(Algorithm::ScorePpo, &[16_384, 8_192, 24_576]), method(Algorithm::Ppo, &[278_528, 0, 0])];
        assert_eq!(
            headline(&three, &[1, 2, 3], 0.8),
            "steps to 80 % success in training: score-ppo 16,384, ppo not reached (the medians of seeds 1, 2, 3: score-ppo \
             16,384 and 8,192 and 24,576; ppo 278,528 and not reached and not reached)"
        );
    }
}
