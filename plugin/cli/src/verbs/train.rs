//! `playbot train`.

use crate::{
    arguments::{
        Compute, check_start_and_steps,
        cluster::{ClusterArgs, report_cluster},
        experiment::{ExperimentArgs, Options, in_words, option, reaches, sets_key},
        number_of_steps, open, revision,
    },
    error::{CliError, Outcome},
    output::program,
    progress::{console::Console, interrupt},
};
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::{
    brief::shell_word,
    game::Game,
    games::{Artifact, Games},
    held_out::{HeldOut, is_only_level},
    level_audit::{EqualLevels, levels_in_until},
    sealed_file::file_checksum,
    split::LevelSplit,
};
use playbot_learner::{SeenLevels, SkillModel};
use playbot_report::{counted, whole};
use playbot_train::{
    Algorithm, Experiment, LearnerKind, TrainError,
    begin_from::{BeginFrom, Started},
    checkpoint::CheckpointChoice,
    diagnose::FirstWarning,
    run_dir::{OpenedRun, RunDir, RunInfo},
    train_run::{NewRun, Training, TrainingError, TrainingSetup, goes_on_from, never_learns, rounded},
};
use std::path::{Path, PathBuf};

/// Train a policy, headless, over the experiment's training levels.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot train GAME --skills skills.safetensors --run runs/first
  playbot train --algorithm ppo --run runs/baseline --steps 200000
  playbot train --skills skills.safetensors --run runs/weak --set score.kl_coef=0.01 --set ppo.lr=0.0003
  playbot train --algorithm ppo --from runs/baseline --run runs/slow --set ppo.lr=0.0001
  playbot train GAME --algorithm ppo --run runs/many --cluster ray://head:10001 --workers 64
  playbot train --run runs/first --resume
  playbot train --run runs/first --resume --steps 1000000")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Algorithm instead of the experiment's: score-ppo, ppo, score-sac, sac, spirl-ppo, spirl-sac or rlpd.
    #[arg(long, value_parser = trained)]
    algorithm: Option<Algorithm>,
    /// Skill model, as written by `playbot learn-skills --out FILE`. Needed by score-ppo, score-sac, spirl-ppo and
    /// spirl-sac.
    #[arg(long, value_name = "FILE")]
    skills: Option<PathBuf>,
    /// Folder of the run.
    #[arg(long)]
    run: PathBuf,
    /// Resume from the last checkpoint of the run, with its settings. Other options may be given again with the same
    /// values, --steps and --checkpoint-every with new ones.
    #[arg(long)]
    resume: bool,
    /// Begin with the weights, normalisers and skills of another run. Settings, levels and rewards may differ, and the
    /// observation may have more values: they begin at weight 0. Layers that do not fit begin anew, and are listed. For
    /// ppo, score-ppo and spirl-ppo; the others take skills only.
    #[arg(long = "from", alias = "init-from", value_name = "RUN", conflicts_with = "resume")]
    begin_from: Option<PathBuf>,
    /// Checkpoint of the run of --from: last, best (highest return in training, or rating against
    /// rivals), or its number of environment steps.
    #[arg(long, value_name = "CHECKPOINT", default_value = "last", requires = "begin_from")]
    from_checkpoint: CheckpointChoice,
    /// Go on with Adam's moments of the run of --from, too, instead of beginning them anew.
    #[arg(long, requires = "begin_from")]
    from_moments: bool,
    /// Delete the folder of the run first if it exists.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Environment steps from the beginning, instead of the experiment's, rounded up to whole updates.
    #[arg(long, value_parser = number_of_steps)]
    steps: Option<u64>,
    /// Random seed, instead of the experiment's.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    pub(crate) compute: Compute,
    #[command(flatten)]
    cluster: ClusterArgs,
    /// Save a checkpoint every this many updates, instead of the experiment's.
    #[arg(long)]
    checkpoint_every: Option<u64>,
}

impl Args {
    /// Returns the options that have names of their own, as `key=value`.
    fn settings(&self) -> [Option<String>; 4] {
        [
            option("algorithm", &self.algorithm),
            option("seed", &self.seed),
            option("steps", &self.steps),
            option("checkpoints.every", &self.checkpoint_every),
        ]
    }
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let mut console = Console::new("train");
    let locate = |path: &Path| args.from.find_recordings(path, games);
    let (device, threads) = (args.compute.device(), args.compute.threads());
    let setup = TrainingSetup { device, threads, revision: revision(), recordings: &locate };
    let mut training = match args.resume {
        true => resume(&args, games, &setup)?,
        false => start(&args, games, &setup, &mut console)?,
    };
    let (path, program) = (args.run.display(), program::name());
    let (steps, wanted) = (training.trainer.steps(), training.trainer.experiment().whole_steps());
    if training.trainer.is_done() {
        report!(
            "{path} is finished: it was trained for {steps} steps. Train it further with `{program} train --run {path} --resume \
             --steps N`, where N is more than {steps}, or test it with `{program} eval --run {path}`"
        );
        return Ok(Outcome::Pass);
    }
    // A resumed training reported it at its beginning.
    let is_new_length = args.steps.is_some() || args.from.set.iter().any(|set| sets_key(set, "steps"));
    if !args.resume || is_new_length {
        report_length(training.trainer.experiment());
    }
    interrupt::go_on_with(format!("`{program} train --run {path} --resume`"));
    let game = games.get(&training.trainer.experiment().game)?;
    if let Some(crew) = args.cluster.crew(game, training.trainer.experiment())? {
        training.trainer.play_away(game, crew).map_err(TrainingError::from)?;
    }
    let mut warning = FirstWarning::new(training.trainer.experiment(), &args.run);
    let mut console = console.on_update(|report| {
        if let Some(words) = warning.note(report) {
            let words = program::named(&words);
            report!("warning: {words} (`{program} diagnose --run {path} --replays` looks further)");
        }
    });
    let is_done = training.drive(&mut console)?;
    training.trainer.cluster_report().iter().for_each(report_cluster);
    if is_done {
        if let Some((lesson, of)) = training.trainer.lesson().filter(|(lesson, of)| lesson < of) {
            report!(
                "warning: the training ended in lesson {lesson} of {of}, before that of `train`: train for longer with \
                 `{program} train --run {path} --resume --steps N`, or give the lesson a smaller `success`"
            );
        }
        report!("done: test it with `{program} eval --run {path}`");
        return Ok(Outcome::Pass);
    }
    report!(
        "stopped and saved after {} of {wanted} steps, so the training is incomplete: go on with \
         `{program} train --run {path} --resume`",
        training.trainer.steps()
    );
    Ok(Outcome::Stopped)
}

/// Parses an algorithm that can be trained.
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

/// Reports it if a training will have more steps than requested.
pub(crate) fn report_length(experiment: &Experiment) {
    if let Some(words) = rounded(experiment) {
        report!("{words}");
    }
    if let Some(words) = never_learns(experiment) {
        report!("warning: {words}");
    }
}

fn start(
    args: &Args,
    games: &Games,
    setup: &TrainingSetup<'_>,
    console: &mut Console<'_>,
) -> Result<Training, CliError> {
    let (experiment, game) = args.from.open(games, args.settings())?;
    let skills = match &args.skills {
        Some(path) if experiment.algorithm.needs_skills() => {
            Some(open::skills(path, args.compute.device(), &args.from)?)
        }
        Some(path) => {
            report!("{} learns without skills, so {} is not used", experiment.algorithm, path.display());
            None
        }
        None => None,
    };
    skills.iter().try_for_each(|model| check_asked(args, &experiment, model))?;
    check_start_and_steps(game, &experiment.train.mode, experiment.train.first)?;
    interrupt::leave("nothing is trained yet".to_owned());
    let (path, skill_file) = (args.run.as_path(), args.skills.as_deref());
    let (skills, force) = (skills.as_ref(), args.force);
    let (checkpoint, moments) = (args.from_checkpoint, args.from_moments);
    let from = args.begin_from.as_deref().map(|run| BeginFrom { run, checkpoint, moments });
    let new = NewRun { path, experiment: &experiment, skills, skill_file, from, force };
    let training = Training::begin(game, &new, setup, console).map_err(|error| match error {
        TrainingError::Train(error) => explain(*error, args, &experiment, games),
        other => other.into(),
    })?;
    if let (Some(from), Some(started)) = (&args.begin_from, &training.started) {
        report_start(from, started);
    }
    if args.from.experiment.is_none() {
        report!(
            "no --experiment is named: training on {}, held out for the test {}",
            experiment.train,
            experiment.test
        );
    }
    let seen = training.trainer.seen();
    equal_layouts(game, &experiment.train, &experiment.test, seen).iter().for_each(|words| report!("{words}"));
    Ok(training)
}

/// Reports what a run takes from another one, and whether its first policy is the same.
fn report_start(from: &Path, started: &Started) {
    let skills = if started.has_skills { " and skills" } else { "" };
    let Some(report) = &started.report else {
        return report!("beginning with the skills of {}, and with a policy of its own", from.display());
    };
    report!("beginning with the weights{skills} of {}: {report}", from.display());
    if report.is_same_policy {
        report!("the first policy gives the same outputs as the old one, to the bit");
    }
}

/// Largest number of levels of a range whose layouts are compared before a training, so that it begins at once.
const MOST_COMPARED: u64 = 10_000;

/// Describes how many training levels are equal, and how many held-out levels are equal to those that are `seen` in
/// training and in recordings. `None` if neither is the case, or is not known at once: without layouts, levels would have
/// to be played.
fn equal_layouts(game: &dyn Game, train: &LevelSplit, test: &LevelSplit, seen: Option<&SeenLevels>) -> Option<String> {
    if train.len() > MOST_COMPARED {
        let levels = whole(train.len() as f64);
        let words = format!(
            "{levels} training levels are too many to compare by their layouts at the start: `playbot levels` does it"
        );
        return game.layout(&train.mode, train.first).map(|_| words);
    }
    let (trained, held_out) = (HeldOut::levels_of(game, train), HeldOut::new(game, test));
    let equal = EqualLevels::of_layouts(trained.layouts().clone())?;
    let is_known_at_once =
        test.len() <= MOST_COMPARED && !is_only_level(game, &test.mode) && !held_out.layouts().is_empty();
    let known = if is_known_at_once { levels_in_until(test, &trained, &|| false).len() } else { 0 };
    let seen = seen.filter(|_| is_known_at_once).map_or(known, |seen| held_out.seen_in(seen, &|_, _| {}).len());
    let layouts = counted(equal.layouts, "layout");
    let of_training = format!("the {} {train} have {layouts}", counted(train.len(), "training level"));
    let of_held_out = |count: usize| format!("{count} of the {} held-out levels {test} have", whole(test.len() as f64));
    let held_out = match (equal.groups.is_empty(), known) {
        _ if seen.max(known) == 0 => None,
        (_, 0) => Some(format!("{} the layout of a level of a recording or lesson", of_held_out(seen))),
        (true, _) if seen > known => {
            Some(format!("{} the layout of a training level, or of one of a recording or lesson", of_held_out(seen)))
        }
        (true, known) => Some(format!("{} the layout of a training level", of_held_out(known))),
        (false, _) if seen > known => {
            Some(format!("{} one of these, or that of a level of a recording or lesson", of_held_out(seen)))
        }
        (false, known) => Some(format!("{} one of these", of_held_out(known))),
    };
    match (equal.groups.is_empty(), held_out) {
        (true, held_out) => held_out,
        (false, None) => Some(of_training),
        (false, Some(held_out)) => Some(format!("{of_training}, and {held_out}")),
    }
}

/// Refuses settings of skills that differ from the model's, which was learned before. Settings of a file are not
/// checked: they were those of `learn-skills` at that time.
fn check_asked(args: &Args, experiment: &Experiment, model: &SkillModel) -> Result<(), CliError> {
    let mut learned = Experiment { skills: model.config().clone(), ..experiment.clone() };
    // The sets are those of the game, and no option names them.
    learned.skills.entities = learned.skills.entities.with_blocks(Vec::new());
    let asked = Experiment { skills: learned.with_set(&args.from.set)?.skills, ..experiment.clone() };
    let options = Options { from: &args.from, own: &[] };
    let differences = options.differences(&asked, &learned, "the skill model", &[]);
    if differences.is_empty() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "the skills were learned with other settings: {}; drop the option, or learn other skills with it, \
         `playbot learn-skills`",
        in_words(differences)
    )))
}

/// Explains an error before a training, with the position of the faulty key. Where skills are missing, it names the
/// commands that make and use them.
fn explain(error: TrainError, args: &Args, experiment: &Experiment, games: &Games) -> CliError {
    let algorithm = match error {
        TrainError::NoSkills(algorithm) => algorithm,
        TrainError::Experiment(error) => return args.from.locate(games, args.settings(), error).into(),
        TrainError::ForeignSkills { .. }
        | TrainError::OtherSets { .. }
        | TrainError::SkillObservation { .. }
        | TrainError::SeenSkills { .. } => {
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

fn resume(args: &Args, games: &Games, setup: &TrainingSetup<'_>) -> Result<Training, CliError> {
    let opened = RunDir::open_to_write(&args.run)?;
    let OpenedRun { experiment: saved, info, .. } = &opened;
    let game = games.of_file(Artifact::Run, &args.run, &saved.game)?;
    if info.algorithm == Algorithm::Imitation {
        let run = args.run.display();
        return Err(CliError::Usage(format!(
            "{run} is a run of imitation: go on with `playbot imitate --run {run} --resume`, or train its policy in a new run, \
             `playbot train --algorithm ppo --from {run} --run NEW`"
        )));
    }
    if !info.algorithm.is_trained() {
        return Err(open::untrained(&args.run, info.algorithm));
    }
    let experiment = resumed(args, saved, info, games)?;
    check_start_and_steps(game, &experiment.train.mode, experiment.train.first)?;
    let (whole, begun_on) = (saved.whole_steps(), info.device);
    let training = Training::resume(game, opened, &experiment, setup)?;
    let steps = training.trainer.steps();
    if training.trainer.is_done() {
        if steps < whole {
            return Err(CliError::Usage(format!(
                "{} has {steps} steps already, so --steps cannot be less: leave --steps out to go on to {whole}",
                args.run.display()
            )));
        }
        // Nothing is left to train, so the run stays as it is.
        return Ok(training);
    }
    report!("going on at step {steps} of {}", experiment.whole_steps());
    let continued = training.trainer.continued_schedule();
    if let Some(words) = continued.and_then(|continued| goes_on_from(&experiment, continued)) {
        report!("{words}");
    }
    if setup.device != begun_on {
        report!(
            "it was begun on {begun_on} and goes on on {}: the result will be similar, but not equal",
            setup.device
        );
    }
    Ok(training)
}

// Options of a resumed training.

/// Settings of a run that may change at a resumption: its length and its checkpoint interval.
const FREE: [&str; 2] = ["steps", "checkpoints.every"];

/// Returns the experiment of a resumed run: the saved one, with the changeable settings of the options. All other
/// options must equal the run's, so that a whole command can be repeated with `--resume`.
///
/// # Errors
///
/// The options cannot be read, or have other values: each with that of the run.
fn resumed(args: &Args, saved: &Experiment, info: &RunInfo, games: &Games) -> Result<Experiment, CliError> {
    let sets = args.from.sets(args.settings());
    let mut wanted = match &args.from.experiment {
        Some(_) => args.from.load(games, args.settings())?.without_study(),
        None => saved.with_set(&sets)?.without_study(),
    };
    // A file has the first length of the run, which may have been made longer since.
    if !is_set(&sets, FREE[0]) {
        wanted.steps = saved.steps;
    }
    if !is_set(&sets, FREE[1]) {
        wanted.checkpoints.every = saved.checkpoints.every;
    }
    let mut differences = differences(args, saved, &wanted);
    differences.extend(args.skills.as_deref().map(|path| other_skills(path, info)).transpose()?.flatten());
    if differences.is_empty() {
        wanted.check()?;
        return Ok(wanted);
    }
    Err(CliError::Usage(format!(
        "{} is resumed with other settings: {}; drop the option, or start a new run with another --run, \
         without --resume, and with --from {} to begin with the weights of this one (--steps and --checkpoint-every \
         may change)",
        args.run.display(),
        in_words(differences),
        shell_word(&args.run.display().to_string())
    )))
}

/// Returns true if one of the `key=value` sets a key, alone or with its whole section.
fn is_set(sets: &[String], key: &str) -> bool {
    sets.iter().any(|set| reaches(set, key))
}

/// Returns the differences between the options and the run, but for the changeable settings.
fn differences(args: &Args, saved: &Experiment, wanted: &Experiment) -> Vec<String> {
    let own = [
        ("algorithm", args.algorithm.map(|algorithm| format!("--algorithm {algorithm}"))),
        ("seed", args.seed.map(|seed| format!("--seed {seed}"))),
    ];
    Options { from: &args.from, own: &own }.differences(wanted, saved, "the run", &FREE)
}

/// Returns a message about a skill model that is not the run's; `None` if the run has none, or does not note which.
fn other_skills(path: &Path, info: &RunInfo) -> Result<Option<String>, CliError> {
    let Some(kept) = &info.skills else { return Ok(None) };
    let given = file_checksum(path).map_err(|error| {
        CliError::Usage(format!("{error}; drop --skills: a run that goes on has the skills that it began with"))
    })?;
    Ok((given != *kept).then(|| {
        let path = path.display();
        format!("`--skills {path}` is the skill model {given}, and the run has {kept}")
    }))
}

#[cfg(test)]
mod tests {
    use crate::arguments::experiment::ExperimentArgs;
    use bevy::app::App;
    use clap::Parser;
    use playbot_harness::{foreign::ForeignGame, game::Game};
    use playbot_learner::DeviceKind;
    use playbot_train::Algorithm;

    use super::*;

    #[test]
    fn a_training_reports_equal_levels_of_its_ranges_if_there_are_any() {
        let game = |modulo: u64| ForeignGame::new("rooms", 1, |_: &mut App| {}).layout(move |_, level| level % modulo);
        let words = |game: &ForeignGame, train: &str, test: &str| {
            equal_layouts(game, &train.parse().expect("levels"), &test.parse().expect("levels"), None)
        };
        let (train, test) = ("default:0..7", "default:8..13");
        assert_eq!(
            words(&game(6), train, test).as_deref(),
            Some(
                "the 8 training levels default:0..7 have 6 layouts, and 6 of the 6 held-out levels default:8..13 have one of these"
            )
        );
        assert_eq!(
            words(&game(10), train, test).as_deref(),
            Some("4 of the 6 held-out levels default:8..13 have the layout of a training level")
        );
        let twice = game(100);
        assert_eq!(words(&twice, train, test), None);
        let of_training = words(&twice, "default:0..100", "default:150..160");
        // 100 is like 0, and all of 150 to 160 are like 50 to 60.
        assert!(of_training.is_some_and(|words| {
            words.starts_with("the 101 training levels default:0..100 have 100 layouts, and 11 of")
        }));
        let few = game(100).layout(|_, level| level.min(9));
        assert_eq!(
            words(&few, "default:8..10", "default:0..5").as_deref(),
            Some("the 3 training levels default:8..10 have 2 layouts")
        );
        let long = words(&game(6), "default:0..10000", test).expect("that would take long");
        assert!(long.starts_with("10,001 training levels are too many to compare"), "{long}");
        assert_eq!(
            words(&game(6).levels(1), "default:0", "default:0"),
            None,
            "it is measured on the level it trains on"
        );
        assert_eq!(words(&ForeignGame::new("rooms", 1, |_: &mut App| {}), train, test), None, "it has no layouts");
    }

    #[test]
    fn a_training_reports_held_out_levels_whose_layouts_were_recorded() {
        let game = |modulo: u64| ForeignGame::new("rooms", 1, |_: &mut App| {}).layout(move |_, level| level % modulo);
        let words = |game: &ForeignGame, train: &str, levels: &[&str]| {
            let levels = levels.iter().map(|&range| range.to_owned()).collect();
            let seen = SeenLevels { game: "rooms".to_owned(), levels, ..SeenLevels::default() };
            let (train, test) = (train.parse().expect("levels"), "default:100..109".parse().expect("levels"));
            equal_layouts(game, &train, &test, Some(&seen))
        };
        let (train, test) = ("default:0..3", "10 held-out levels default:100..109");
        assert_eq!(words(&game(1000), train, &["default:0..3", "default:20..30"]), None);
        assert_eq!(
            words(&game(50), "default:10..13", &["default:10..13", "default:2..3"]),
            Some(format!("2 of the {test} have the layout of a level of a recording or lesson"))
        );
        assert_eq!(
            words(&game(50), train, &[train, "default:58..59"]),
            Some(format!("6 of the {test} have the layout of a training level, or of one of a recording or lesson"))
        );
        let twice = words(&game(50), "default:0..50", &["default:0..50", "default:1000..1002"]);
        assert!(twice.as_ref().is_some_and(|words| words.ends_with(&format!("10 of the {test} have one of these"))));
        let some = words(&game(4).layout(|_, level| level.max(2) % 109), "default:0..2", &["default:108..108"]);
        assert!(
            some.as_ref().is_some_and(|words| words.ends_with("have the layout of a level of a recording or lesson")),
            "{some:?}"
        );
    }

    #[derive(Parser)]
    struct Train {
        #[command(flatten)]
        args: Args,
    }

    /// Returns the experiment of a run that began with some options and is resumed with others.
    fn again(begun: &[&str], options: &[&str]) -> Result<Experiment, String> {
        let game = ForeignGame::new("runner", 1, |_: &mut App| {});
        let games = [&game as &dyn Game];
        let games = Games::new(&games).expect("one game");
        let from = ExperimentArgs { set: begun.iter().map(|set| (*set).to_owned()).collect(), ..Default::default() };
        let saved = from.load(&games, []).expect("valid");
        let (version, revision) = ("1".to_owned(), "r".to_owned());
        let (algorithm, seed, device) = (Algorithm::Ppo, 1, DeviceKind::default());
        let info = RunInfo {
            algorithm,
            seed,
            version,
            revision,
            game_version: 1,
            skills: None,
            seen: None,
            begun_from: None,
            observed: Vec::new(),
            device,
        };
        let words = ["train", "--run", "runs/first", "--resume"].into_iter().chain(options.iter().copied());
        let args = Train::try_parse_from(words).unwrap_or_else(|error| panic!("{error}")).args;
        resumed(&args, &saved, &info, &games).map_err(|error| error.to_string())
    }

    const BEGUN: [&str; 3] = ["algorithm=ppo", "ppo.lr=0.01", "steps=500"];

    #[test]
    fn a_command_can_be_repeated_as_it_was() {
        let same = ["--algorithm", "ppo", "--set", "ppo.lr=0.01", "--steps", "500", "--seed", "1"];
        let plain = again(&BEGUN, &[]).expect("nothing is asked for");
        assert_eq!(again(&BEGUN, &same), Ok(plain.clone()));
        // The last one counts.
        assert_eq!(again(&BEGUN, &["--set", "ppo.lr=0.5", "--set", "ppo=(lr: 0.01)"]), Ok(plain));
    }

    #[test]
    fn length_and_checkpoints_may_change() {
        let longer = again(&BEGUN, &["--steps", "900", "--checkpoint-every", "3"]).expect("allowed");
        assert_eq!((longer.steps, longer.checkpoints.every), (900, 3));
        assert_eq!(again(&BEGUN, &["--set", "steps=900"]).expect("allowed").steps, 900);
    }

    #[test]
    fn a_file_says_nothing_of_a_length_that_was_changed_since() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("mine.ron");
        let text = r#"(game: "runner", train: "default:0..63", test: "default:64..127", steps: 100, algorithm: "ppo",
            demos: "demos/runner", ppo: (lr: 0.01))"#;
        std::fs::write(&file, text).expect("writable");
        let path = file.to_str().expect("plain");
        let longer = again(&BEGUN, &["--experiment", path]).expect("the same but for the steps");
        assert_eq!(longer.steps, 500);
        let other = again(&BEGUN, &["--experiment", path, "--set", "arenas=32"]).expect_err("others");
        assert!(other.contains("`--set arenas=32` asks for arenas=32, and the run has 64"), "{other}");
        let text = text.replace("0.01", "0.25");
        std::fs::write(&file, text).expect("writable");
        let other = again(&BEGUN, &["--experiment", path]).expect_err("another rate");
        assert!(other.contains("mine.ron` asks for ppo.lr=0.25, and the run has 0.01"), "{other}");
    }

    #[test]
    fn what_differs_is_named_with_both_values_and_what_to_do() {
        for (options, words) in [
            (&["--algorithm", "sac"][..], "`--algorithm sac` asks for algorithm=sac, and the run has ppo"),
            (&["--seed", "7"], "`--seed 7` asks for seed=7, and the run has 1"),
            (&["--set", "ppo.lr=0.5"], "`--set ppo.lr=0.5` asks for ppo.lr=0.5, and the run has 0.01"),
            (&["--set", "ppo=(lr: 0.5)"], "asks for ppo.lr=0.5, and the run has 0.01"),
        ] {
            let text = again(&BEGUN, options).expect_err("another value");
            assert!(text.contains(words), "{text}");
            assert!(
                text.starts_with("runs/first is resumed with other settings")
                    && text.contains("another --run")
                    && text.contains("--from runs/first to begin"),
                "{text}"
            );
        }
    }
}
