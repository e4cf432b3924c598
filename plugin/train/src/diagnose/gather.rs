//! Evidence of a run, of recordings or of a game: reading, playing and probing.

use crate::{
    checkpoint::CheckpointChoice,
    diagnose::{
        evidence::Evidence,
        networks::{NetworkProbe, probe, probe_decoder},
        observation::note_constants,
        play::{PlayPlan, PlayedEpisode, Seat, force, play},
        recordings::{RecordedEpisode, RecordedSet},
    },
    error::RunError,
    experiment::Experiment,
    metrics_log::{EPISODES as EPISODES_TAG, SUCCESS_RATE},
    run_dir::{OpenedRun, RunDir},
    runs::{RunCurves, RunsError},
    trainer::TrainedLearner,
};
use bevy_playbot::{
    bot::BlindBot, demo::file::DemoFileError, fault::Fault, policy::ActionDraw, skill_prior::SkillPrior,
};
use playbot_harness::{
    doctor::{DoctorOptions, examine},
    eval::Player,
    game::{Game, idle_action},
    level_files::is_level_files,
    parallel::on_threads,
    sealed_file::file_checksum,
    split::LevelSplit,
};
use playbot_learner::{DeviceKind, FileError, HasExitCode, LearnError, Policy, SkillModel};
use playbot_report::{counted, readable};
use std::{
    fs,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Episodes of each player, and of the policy on training and on held-out levels.
const EPISODES: u64 = 8;
const POLICY_EPISODES: u64 = 16;

/// Most ticks of each blind player, all agents together, and of the demonstrator and the policy: whether the one is paid
/// decides about the game, and the other's episodes are compared to their ends.
const TICKS: usize = 6000;
const LONG_TICKS: usize = 24_000;

/// Courses of episodes from which actions are forced that have changed nothing so far.
const COURSES: usize = 6;

/// Updates and ended episodes under which a run shows little.
const FEWEST_UPDATES: usize = 10;
const FEWEST_ENDED: f64 = 20.0;

/// Ticks of each of the doctor's comparisons.
const DOCTOR_TICKS: u32 = 60;

/// Failure of a diagnosis. What is wrong with the game or the recordings is no failure but a finding.
#[derive(Debug, Error)]
pub enum DiagnoseError {
    /// The run cannot be read.
    #[error(transparent)]
    Run(Box<RunError>),
    /// Its metrics cannot be read.
    #[error(transparent)]
    Metrics(Box<RunsError>),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] DemoFileError),
    /// The policy of the run or the skill model cannot be read.
    #[error(transparent)]
    Learner(#[from] FileError),
    /// A network gives no numbers, or does not fit.
    #[error(transparent)]
    Network(#[from] LearnError),
    /// The doctor could not examine the game.
    #[error(transparent)]
    Game(#[from] Fault),
}

impl From<RunError> for DiagnoseError {
    fn from(error: RunError) -> Self {
        Self::Run(error.into())
    }
}

impl From<RunsError> for DiagnoseError {
    fn from(error: RunsError) -> Self {
        Self::Metrics(error.into())
    }
}

impl HasExitCode for DiagnoseError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Run(error) => error.exit_code(),
            Self::Metrics(error) => error.exit_code(),
            Self::Recording(error) => error.exit_code(),
            Self::Learner(error) => error.exit_code(),
            Self::Network(error) => error.exit_code(),
            Self::Game(error) => error.exit_code(),
        }
    }
}

/// How far evidence is gathered.
#[derive(Clone, Copy)]
pub struct Gathering<'a> {
    /// Play: blind bots, the demonstrator, the policy, recordings and the doctor. Else only files are read.
    pub replays: bool,
    /// Threads. They change no result.
    pub threads: usize,
    /// Device of networks.
    pub device: DeviceKind,
    /// Receives the name of each step before it.
    pub progress: &'a (dyn Fn(&str) + Sync),
    /// Returns the path of recordings from the one that an experiment names.
    pub recordings: &'a dyn Fn(&Path) -> PathBuf,
}

/// What a run has trained.
struct Trained {
    policy: Policy,
    prior: Option<SkillPrior>,
    /// The decoder that the policy began as.
    decoder: Option<Policy>,
}

/// Gathers evidence of a run, which may be in training.
///
/// # Errors
///
/// [`DiagnoseError`]: the run or its recordings cannot be read.
pub fn of_run(
    game: &dyn Game,
    path: &Path,
    skills: Option<&SkillModel>,
    gathering: &Gathering<'_>,
) -> Result<Evidence, DiagnoseError> {
    (gathering.progress)("read the run");
    let OpenedRun { run, experiment, info } = RunDir::open(path)?;
    let mut evidence = begin(game, &experiment);
    evidence.context.run = Some(path.display().to_string());
    let file = info.skills.as_ref().and_then(|checksum| find_skills(path, checksum));
    let own = match &file {
        Some(file) if skills.is_none() => Some(SkillModel::load(file, gathering.device)?),
        _ => None,
    };
    let skills = skills.or(own.as_ref());
    evidence.context.skills = file.map(|file| file.display().to_string());
    evidence.curves = Some(RunCurves::read(path)?);
    read_recordings(&mut evidence, game, gathering)?;
    if let Some(version) = Some(info.game_version).filter(|version| *version != game.version()) {
        evidence.notes.push(format!(
            "the run is of version {version} of the rules, and the game has version {}: it is played as it is now",
            game.version()
        ));
    }
    note_youth(&mut evidence);
    if !gathering.replays {
        evidence.notes.push("nothing was played: --replays looks at rewards, observations and actions, too".to_owned());
        decode(&mut evidence, skills)?;
        note_failure(&mut evidence);
        return Ok(evidence);
    }
    let policy = match run.checkpoint(CheckpointChoice::Last) {
        Ok(checkpoint) if experiment.algorithm.has_checkpoints() => {
            let learner = TrainedLearner::load(info.algorithm, &checkpoint.learner_file(), gathering.device)?;
            // A policy over skills keeps the decoder, or goes on training it: there is nothing that it began as.
            let has_decoder = experiment.algorithm.needs_skills() && !experiment.algorithm.learns_prior();
            let skills = learner.skills();
            let decoder = skills.as_ref().filter(|_| has_decoder).map(|skills| skills.decoder.clone());
            Some(Trained { policy: learner.policy(), prior: skills.as_ref().map(SkillPrior::from), decoder })
        }
        _ => {
            evidence.notes.push("the policy does not play: there is no checkpoint yet".to_owned());
            None
        }
    };
    play_all(&mut evidence, game, policy.as_ref(), gathering)?;
    decode(&mut evidence, skills)?;
    note_failure(&mut evidence);
    Ok(evidence)
}

/// Looks for the file of a run's skill model, by its checksum: in the folder of the run, beside it, and where the program
/// runs.
fn find_skills(run: &Path, checksum: &str) -> Option<PathBuf> {
    let here = Path::new(".");
    let folders = [Some(run), run.parent().filter(|folder| !folder.as_os_str().is_empty()), Some(here)];
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in folders.into_iter().flatten() {
        let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
        let models = entries.map(|entry| entry.path()).filter(|path| path.extension() == Some("safetensors".as_ref()));
        let named = models.map(|path| path.strip_prefix(here).map_or(path.clone(), Path::to_owned));
        files.extend(named);
    }
    files.sort();
    files.into_iter().find(|file| file_checksum(file).is_ok_and(|found| found == checksum))
}

/// Notes that a run which is old enough does not get to the goal: without a finding it may be taken for a sound one.
fn note_failure(evidence: &mut Evidence) {
    let Some(curves) = &evidence.curves else { return };
    let episodes = curves.last(EPISODES_TAG).unwrap_or_default();
    if episodes >= FEWEST_ENDED && curves.last(SUCCESS_RATE).is_some_and(|success| success == 0.0) {
        let of = counted(episodes as u64, "ended episode");
        evidence.notes.push(format!("the goal was not reached in the last of {of}, whatever is found or not"));
    }
}

/// Gathers evidence of recordings, for an experiment of their game.
///
/// # Errors
///
/// [`DiagnoseError`]: a recording cannot be read.
pub fn of_recordings(
    game: &dyn Game,
    experiment: &Experiment,
    paths: &[PathBuf],
    skills: Option<&SkillModel>,
    gathering: &Gathering<'_>,
) -> Result<Evidence, DiagnoseError> {
    let mut evidence = begin(game, experiment);
    let mut all: Option<RecordedSet> = None;
    for path in paths {
        let set = RecordedSet::read(path)?;
        match &mut all {
            Some(all) => all.join(set),
            None => all = Some(set),
        }
    }
    if let Some(set) = all {
        evidence.context.demos = Some(set.path.display().to_string());
        let is_held_out = |it: &&RecordedEpisode| experiment.test.contains(&it.mode, it.episode.level_seed);
        evidence.held_out_recorded = set.episodes.iter().filter(is_held_out).count();
        add_recordings(&mut evidence, game, set, gathering);
    }
    decode(&mut evidence, skills)?;
    Ok(evidence)
}

/// Gathers evidence of a game under an experiment, before anything is trained: blind bots and the demonstrator play it.
///
/// # Errors
///
/// [`DiagnoseError`]: its recordings cannot be read.
pub fn of_game(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&SkillModel>,
    gathering: &Gathering<'_>,
) -> Result<Evidence, DiagnoseError> {
    let mut evidence = begin(game, experiment);
    read_recordings(&mut evidence, game, gathering)?;
    // Settings alone are checked as at the start of a run.
    evidence.curves = Some(RunCurves::default());
    play_all(&mut evidence, game, None, gathering)?;
    decode(&mut evidence, skills)?;
    Ok(evidence)
}

/// Notes how little a run shows that has hardly begun.
fn note_youth(evidence: &mut Evidence) {
    let Some(curves) = evidence.curves.as_ref().filter(|_| evidence.experiment.algorithm.is_trained()) else { return };
    let updates = curves.curve(EPISODES_TAG).len();
    let episodes = curves.last(EPISODES_TAG).unwrap_or_default();
    if updates < FEWEST_UPDATES || episodes < FEWEST_ENDED {
        evidence.notes.push(format!(
            "the run shows little yet, so most signs cannot be seen: it has {} and {}",
            counted(updates as u64, "update"),
            counted(episodes as u64, "ended episode")
        ));
    }
}

fn begin(game: &dyn Game, experiment: &Experiment) -> Evidence {
    let mut evidence = Evidence::new(experiment, game.version());
    if !experiment.observation_config().is_image() {
        evidence.names = game.observation().names;
    }
    evidence.action_names = game.tools().input.action_names();
    evidence.action_space = game.actions();
    evidence
}

/// Reads the recordings that the experiment learns from, if it does and they are there.
fn read_recordings(evidence: &mut Evidence, game: &dyn Game, gathering: &Gathering<'_>) -> Result<(), DiagnoseError> {
    let experiment = &evidence.experiment;
    let named = experiment.demos.as_deref().filter(|_| experiment.learns_from_demos());
    let Some(path) = named.map(gathering.recordings) else { return Ok(()) };
    if path.exists() {
        add_recordings(evidence, game, RecordedSet::read(&path)?, gathering);
    } else {
        evidence.notes.push(format!("recordings are not looked at: there are none at {}", path.display()));
    }
    Ok(())
}

fn add_recordings(evidence: &mut Evidence, game: &dyn Game, mut set: RecordedSet, gathering: &Gathering<'_>) {
    if gathering.replays {
        (gathering.progress)("replay recordings");
    }
    if let Err(fault) = set.look_up(game, gathering.replays) {
        evidence.faults.push(fault);
    }
    let family = |mode: &str| game.tools().levels.family(mode);
    let trained = &evidence.experiment.train.mode;
    if !is_level_files(trained) {
        let is_other = |mode: &&str| !is_level_files(mode) && family(mode) != family(trained);
        let modes: std::collections::BTreeSet<&str> = set.episodes.iter().map(|episode| &*episode.mode).collect();
        evidence.other_modes = modes.into_iter().filter(is_other).map(str::to_owned).collect();
    }
    evidence.recordings = Some(set);
}

/// Lets all players play, forces actions, probes the policy and calls the doctor.
fn play_all(
    evidence: &mut Evidence,
    game: &dyn Game,
    trained: Option<&Trained>,
    gathering: &Gathering<'_>,
) -> Result<(), DiagnoseError> {
    (gathering.progress)("play");
    let experiment = evidence.experiment.clone();
    let mut jobs = jobs(game, &experiment, trained);
    let of_job = |(seat, player, plan): &mut (Seat, Player, PlayPlan)| play(game, *seat, player, plan);
    evidence.played = on_threads(&mut jobs, gathering.threads, of_job);
    let faults = evidence.played.iter().filter_map(|played| played.fault.clone());
    evidence.faults.extend(faults);
    note_ablations(evidence);
    evidence.notes.extend(note_constants(evidence));
    if evidence.faults.is_empty() {
        (gathering.progress)("force actions");
        force_actions(evidence, game);
        (gathering.progress)("examine the game");
        examine_game(evidence, game);
    }
    if let Some(Trained { policy, prior, .. }) = trained.filter(|_| !experiment.observation_config().is_image()) {
        let rows: Vec<&[f32]> =
            evidence.played.iter().flat_map(|played| &played.episodes).flat_map(PlayedEpisode::rows).collect();
        evidence.networks = probe(policy, prior.as_ref(), &rows)?;
        evidence.notes.extend(evidence.networks.as_ref().and_then(skills_in_words));
        let own = evidence.played(Seat::Policy).into_iter().flat_map(|played| &played.episodes);
        evidence.clipped = policy.clipped_shares(own.flat_map(PlayedEpisode::rows));
    }
    Ok(())
}

/// Says how much skills decide.
fn skills_in_words(probe: &NetworkProbe) -> Option<String> {
    let skill = readable(probe.skill_information?);
    let prior = probe.prior_spread.map_or_else(String::new, |spread| {
        format!(", and the prior's mean skill varies by {} from state to state", readable(spread))
    });
    Some(format!("a skill has {skill} nats of information on the action in a state{prior}"))
}

/// Notes what the policy earns without something that was learned, which is worth knowing where nothing is wrong.
fn note_ablations(evidence: &mut Evidence) {
    let words = |seat: Seat| {
        let played = evidence.played(seat)?;
        Some(format!("{} {}", seat.name(), readable(played.mean_return()?)))
    };
    let without = [Seat::Decoder, Seat::AnySkill].into_iter().filter_map(words).collect::<Vec<_>>();
    if let Some(policy) = words(Seat::Policy).filter(|_| !without.is_empty()) {
        evidence.notes.push(format!("mean returns on the same training levels: {policy}, {}", without.join(", ")));
    }
}

/// Returns the players with their plans.
fn jobs(game: &dyn Game, experiment: &Experiment, trained: Option<&Trained>) -> Vec<(Seat, Player, PlayPlan)> {
    let plan = |split: &LevelSplit, episodes: u64| PlayPlan {
        mode: split.mode.clone(),
        // Levels over the whole range, since the first ones may be alike.
        levels: (0..episodes.min(split.len())).map(|at| split.first + at * (split.len() / episodes).max(1)).collect(),
        observation: experiment.observation_config(),
        seed: experiment.seed,
        ticks: TICKS,
    };
    let mut jobs = vec![
        (Seat::Random, Player::Blind(BlindBot::Uniform), plan(&experiment.train, EPISODES)),
        (Seat::Chaos, Player::Blind(BlindBot::Chaos), plan(&experiment.train, EPISODES)),
        (Seat::Idle, Player::Blind(BlindBot::Constant(idle_action(game))), plan(&experiment.train, EPISODES)),
    ];
    if game.tools().bots.demonstrator().is_some() {
        let plan = PlayPlan { ticks: LONG_TICKS, ..plan(&experiment.train, EPISODES) };
        jobs.push((Seat::Demonstrator, Player::Demonstrator, plan));
    }
    if let Some(Trained { policy, prior, decoder }) = trained {
        let long_plan = |split: &LevelSplit| PlayPlan { ticks: LONG_TICKS, ..plan(split, POLICY_EPISODES) };
        let of = |policy: &Policy, prior: &Option<SkillPrior>| {
            let (policy, prior) = (policy.clone(), prior.clone());
            Player::Policy { policy, prior, draw: ActionDraw::Sample }
        };
        jobs.push((Seat::Policy, of(policy, prior), long_plan(&experiment.train)));
        jobs.push((Seat::HeldOut, of(policy, prior), long_plan(&experiment.test)));
        // What training and the prior have added: the same levels without them.
        if let Some(decoder) = decoder {
            jobs.push((Seat::Decoder, of(decoder, prior), long_plan(&experiment.train)));
        }
        if let Some(learned) = prior.as_ref().filter(|prior| prior.prior.observation().is_some()) {
            let any = SkillPrior { prior: learned.prior.whatever_the_state(), ..learned.clone() };
            jobs.push((Seat::AnySkill, of(policy, &Some(any)), long_plan(&experiment.train)));
        }
    }
    jobs
}

/// Forces actions from moments of the longest episodes of the demonstrator and of chaos. Those that change nothing are
/// forced in further episodes: some work in a few places only, such as beside a ladder.
fn force_actions(evidence: &mut Evidence, game: &dyn Game) {
    let longest_first = |seat: Seat| {
        let mut episodes: Vec<_> = evidence.played(seat).into_iter().flat_map(|played| &played.episodes).collect();
        episodes.sort_by_key(|episode| std::cmp::Reverse(episode.ticks()));
        episodes.into_iter().take(COURSES / 2)
    };
    let courses: Vec<_> = [Seat::Demonstrator, Seat::Chaos].into_iter().flat_map(longest_first).cloned().collect();
    let mut forced = Vec::new();
    for course in &courses {
        if let Err(fault) = force(game, &evidence.experiment.train.mode, course, &mut forced) {
            return evidence.faults.push(fault.to_string());
        }
    }
    evidence.forced = forced;
}

fn examine_game(evidence: &mut Evidence, game: &dyn Game) {
    let (mode, level) = (evidence.experiment.train.mode.clone(), evidence.experiment.train.first);
    let options = DoctorOptions { ticks: DOCTOR_TICKS, level, ..DoctorOptions::new(mode) };
    match examine(game, &options, |_| {}) {
        Ok(report) if report.is_healthy() => {}
        Ok(report) => {
            let different = report.comparisons.iter().filter(|comparison| comparison.same() == Some(false));
            let words = different.filter(|comparison| !comparison.is_note()).map(|comparison| {
                let value = comparison.difference().map_or_else(String::new, |found| format!(" in `{}`", found.name));
                format!("{}{value}", comparison.comparison.describe())
            });
            let words = words.collect::<Vec<_>>().join("; ");
            // It also finds observations that never change, which players show with their names.
            evidence.doctor = Some(words).filter(|words| !words.is_empty());
        }
        Err(fault) => evidence.faults.push(fault.to_string()),
    }
}

/// Compares a skill model with the recordings.
fn decode(evidence: &mut Evidence, skills: Option<&SkillModel>) -> Result<(), DiagnoseError> {
    let (Some(model), Some(set)) = (skills, &evidence.recordings) else { return Ok(()) };
    let seen = set.seen();
    let steps: Vec<_> =
        seen.iter().flat_map(|(rows, actions)| rows.iter().copied().zip(actions.iter().cloned())).collect();
    evidence.decoder = probe_decoder(model, &steps)?;
    Ok(())
}
