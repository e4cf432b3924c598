//! `playbot policy export|import|show`.

use crate::{
    arguments::{
        Device, code,
        experiment::{ExperimentArgs, quoted},
        open, own_code,
        player::{check_run_of, check_skills, seen_by_run},
    },
    error::{CliError, Outcome},
    output,
    output::{prepare, prepare_new, print_line, program},
};
use bevy_playbot::{engine::policy_observation, policy_file::check_policy, vision::ObservationKind};
use clap::{ArgGroup, ValueEnum};
use playbot_harness::{
    game::Game,
    games::{Artifact, Games},
    held_out::HeldOut,
    sensors::GameSensors,
    split::LevelSplit,
};
use playbot_learner::{DeviceKind, EntitySet, PolicyFile, disk};
use playbot_onnx::{ImportTarget, OnnxError, OnnxPolicy};
use playbot_report::{counted, whole};
use playbot_train::{
    Experiment,
    checkpoint::CheckpointChoice,
    learn_skills::behaviour_cloning_skills,
    policy_export::{ExampleStates, Provenance, example_states, export_policy, policy_file, policy_metadata},
    run_dir::{OpenedRun, RunDir},
};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Make and show policy files, which a game ships with.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot policy export --run runs/first --checkpoint best --out GAME.policy
  playbot policy export --skills skills.safetensors --out clone.policy
  playbot policy export --run runs/first --format onnx --out GAME.onnx
  playbot policy import theirs.onnx --game GAME --out theirs.policy
  playbot policy show GAME.policy
  playbot eval --policy GAME.policy")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Write the policy of a run, or behaviour cloning, into one self-describing file, or as ONNX.
    Export(Export),
    /// Turn an ONNX file of another trainer into a policy file, after a comparison of both.
    Import(Import),
    /// Check a policy file and print its metadata.
    Show {
        /// The file.
        file: PathBuf,
        #[command(flatten)]
        device: Device,
        /// Print it as a line of JSON.
        #[arg(long)]
        json: bool,
    },
}

#[derive(clap::Args)]
#[command(group(ArgGroup::new("source").args(["run", "skills", "policy"]).required(true)))]
struct Export {
    /// Folder of a run.
    #[arg(long, conflicts_with_all = ["experiment", "set"])]
    run: Option<PathBuf>,
    /// Checkpoint of the run: last, best (highest return in training, or rating against
    /// rivals), or its number of environment steps.
    #[arg(long, default_value = "last", conflicts_with = "skills")]
    checkpoint: CheckpointChoice,
    /// Skill model: exports behaviour cloning, the decoder under the prior.
    #[arg(long)]
    skills: Option<PathBuf>,
    /// Policy file to write again, such as in another format.
    #[arg(long, conflicts_with_all = ["checkpoint", "experiment", "set"])]
    policy: Option<PathBuf>,
    #[command(flatten)]
    from: ExperimentArgs,
    /// Format of the file.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Observations in a policy file by which its readers check themselves (default: a few).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    examples: Option<u32>,
    /// File to write. As ONNX the prior of a policy that reads skills is written beside it, NAME.prior.onnx.
    #[arg(long)]
    out: PathBuf,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Format {
    /// A policy file, which games and all verbs read.
    #[default]
    Policy,
    /// ONNX graphs, for other engines.
    Onnx,
}

#[derive(clap::Args)]
struct Import {
    /// The ONNX file.
    file: PathBuf,
    /// Name of the game.
    #[arg(long)]
    game: String,
    /// Kind of observations that the policy reads: vector, raster or camera.
    #[arg(long, default_value = "vector")]
    observation: ObservationKind,
    /// Change a setting of the observation, such as image.stack=4 (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Policy file to write.
    #[arg(long)]
    out: PathBuf,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Export(args) => export(&args, games),
        Verb::Import(args) => import(&args, games),
        Verb::Show { file, device, json } => show(&file, device.device, json, games),
    }
}

fn export(args: &Export, games: &Games) -> Result<Outcome, CliError> {
    let is_onnx = args.format == Format::Onnx;
    if is_onnx && args.examples.is_some() {
        let text = "--examples is for policy files: an ONNX file has none, so leave it out";
        return Err(CliError::Usage(text.to_owned()));
    }
    let prior = is_onnx.then(|| OnnxPolicy::prior_path(&args.out));
    for path in [Some(&args.out), prior.as_ref()].into_iter().flatten() {
        if path.exists() && !path.is_dir() && !args.force {
            return Err(CliError::Usage(format!("{} exists already; overwrite it with --force", path.display())));
        }
    }
    prepare(&args.out)?;
    if let (true, Some(policy)) = (is_onnx, &args.policy) {
        // Its game may be one that this program lacks.
        let file = open::policy(policy, DeviceKind::default())?;
        check_game(policy, &file, args.from.game.as_deref(), games)?;
        return export_onnx(policy, &file, &args.out);
    }
    let PolicySource { game, experiment, file } = match (&args.run, &args.skills, &args.policy) {
        (Some(run), ..) => from_run(run, args.checkpoint, args.from.game.as_deref(), games)?,
        (None, Some(skills), _) => from_skills(skills, &args.from, games)?,
        (None, None, Some(policy)) => from_policy(policy, args.from.game.as_deref(), games)?,
        (None, None, None) => {
            let text = "nothing to export: name a --run, a --skills file or a --policy file";
            return Err(CliError::Usage(text.to_owned()));
        }
    };
    check_policy(&game.metadata(), &file)?;
    if is_onnx {
        // The graphs are those of a policy file, which is checked before it is translated.
        let policy = disk::temporary_name(&args.out);
        let written = export_policy(game, &file, &experiment.train, experiment.seed, &policy).map_err(CliError::from);
        let outcome = written.and_then(|()| export_onnx(&policy, &file, &args.out));
        // It may not be there.
        let _ = disk::remove_file(&policy);
        return outcome;
    }
    let wanted = args.examples.map(|examples| examples as usize);
    let ExampleStates { obs, skills, count } = example_states(game, &file, &experiment.train, experiment.seed, wanted)?;
    file.save(&args.out, &obs, &skills, count)?;
    report!(
        "policy written to {}: measure it with {}",
        args.out.display(),
        measuring(&args.out, game, &experiment.test, &file)
    );
    Ok(Outcome::Pass)
}

/// Writes the graphs of the policy file at `policy`, whose contents are `file`.
fn export_onnx(policy: &Path, file: &PolicyFile, out: &Path) -> Result<Outcome, CliError> {
    let bytes =
        std::fs::read(policy).map_err(|error| CliError::Io(format!("cannot read {}: {error}", policy.display())))?;
    let prior = OnnxPolicy::of_policy_file(policy, &bytes)?.save(out)?;
    report!("policy written to {}, as ONNX", out.display());
    if let (Some(prior), Some(skills)) = (prior, &file.skills) {
        let ticks = counted(skills.skill_interval as u64, "tick");
        report!("its prior written to {}: run it for a new skill every {ticks}", prior.display());
    }
    if file.policy.memory() > 0 {
        report!("the policy remembers: its output `memory_after` is its input `memory` of the next tick");
    }
    Ok(Outcome::Pass)
}

/// Checks that a policy file is of the named game, if one is named.
fn check_game(path: &Path, file: &PolicyFile, named: Option<&str>, games: &Games) -> Result<(), CliError> {
    let own = file.metadata.game.as_str();
    let is_other = |named: &&str| games.get(named).map_or(*named != own, |game| game.name() != own);
    match named.filter(is_other) {
        None => Ok(()),
        Some(named) => {
            Err(CliError::Usage(format!("{} is a policy for the game `{own}`, not for `{named}`", path.display())))
        }
    }
}

/// Reads a policy file that is written again.
fn from_policy<'a>(path: &Path, named: Option<&str>, games: &'a Games) -> Result<PolicySource<'a>, CliError> {
    let file = open::policy(path, DeviceKind::default())?;
    check_game(path, &file, named, games)?;
    let game = games.of_file(Artifact::Policy, path, &file.metadata.game)?;
    let experiment = ExperimentArgs::of_game(game.name()).load(games, [])?;
    Ok(PolicySource { game, experiment, file })
}

fn import(args: &Import, games: &Games) -> Result<Outcome, CliError> {
    prepare_new(&args.out, args.force)?;
    let sets = args.set.iter().cloned().chain([format!("observation={:?}", args.observation)]);
    let from = ExperimentArgs { set: sets.collect(), ..ExperimentArgs::of_game(&args.game) };
    let (experiment, game) = from.open(games, [])?;
    let config = experiment.observation_config();
    config.check(game)?;
    experiment.check_train(game)?;
    let about = Provenance { code: own_code(), ..Provenance::default() };
    let target = ImportTarget {
        observation: config.obs_kind(game),
        action_space: game.actions(),
        metadata: policy_metadata(game, &config, about),
    };
    let bytes = std::fs::read(&args.file)
        .map_err(|error| CliError::Usage(format!("cannot read {}: {error}", args.file.display())))?;
    let imported = target.import(&args.file, &bytes).map_err(|error| match error {
        OnnxError::Misfit(_) | OnnxError::Unsupported { .. } | OnnxError::Compute { .. } => {
            CliError::Usage(format!("{}: {error}", args.file.display()))
        }
        error => error.into(),
    })?;
    check_policy(&game.metadata(), &imported.file)?;
    let ExampleStates { obs, count, .. } =
        example_states(game, &imported.file, &experiment.train, experiment.seed, None)?;
    let largest = imported.compare(&obs, count)?.max(imported.difference);
    imported.file.save(&args.out, &obs, &[], count)?;
    imported.notes.iter().for_each(|note| report!("{note}"));
    report!(
        "policy written to {}: its outputs are those of the graph within {largest:.0e}; measure it with {}",
        args.out.display(),
        measuring(&args.out, game, &experiment.test, &imported.file)
    );
    Ok(Outcome::Pass)
}

/// Returns the command that measures a policy file. It uses the held-out levels of the policy's training, if the game
/// has them and the policy has seen none of them, but for those whose layouts it has seen.
fn measuring(path: &Path, game: &dyn Game, test: &LevelSplit, file: &PolicyFile) -> String {
    let command = format!("{} eval --policy {}", program::name(), quoted(&path.to_string_lossy()));
    if test.check(game).is_err() {
        return format!("`{command}`");
    }
    let (held_out, seen) = (HeldOut::new(game, test), file.metadata.seen.as_ref());
    match held_out.shown_by(seen) {
        None => {
            // Without layouts levels would have to be played.
            let knows = |seen| !held_out.layouts().is_empty() && !held_out.seen_in(seen, &|_, _| {}).is_empty();
            let but = if seen.is_some_and(knows) { " --new-layouts" } else { "" };
            format!("`{command} --levels {}{but}`", quoted(&test.to_string()))
        }
        Some(seen) => {
            format!(
                "`{command} --levels MODE:FIRST..LAST`, on levels that it has not learned from, as it has from {seen}"
            )
        }
    }
}

/// A policy to export, and its origin.
struct PolicySource<'a> {
    game: &'a dyn Game,
    experiment: Experiment,
    file: PolicyFile,
}

fn from_run<'a>(
    path: &Path,
    choice: CheckpointChoice,
    named: Option<&str>,
    games: &'a Games,
) -> Result<PolicySource<'a>, CliError> {
    let OpenedRun { run, experiment, info } = RunDir::open(path)?;
    if let Some(named) = named {
        check_run_of(path, &experiment.game, named)?;
    }
    let game = games.of_file(Artifact::Run, path, &experiment.game)?;
    let checkpoint = open::checkpoint(&run, info.algorithm, choice)?;
    let learner = open::learner(&run, info.algorithm, &checkpoint, DeviceKind::default())?;
    let training = format!(
        "{} of {} steps on {}, seed {}",
        whole(checkpoint.summary.step as f64),
        whole(experiment.whole_steps() as f64),
        experiment.train,
        info.seed
    );
    let algorithm = info.algorithm.name().to_owned();
    let seen = Some(seen_by_run(game, &experiment, &info));
    let about = Provenance { algorithm, training, seen, code: code(&info.version, &info.revision) };
    let mut file = policy_file(game, &experiment.observation_config(), learner.policy(), learner.skills(), about);
    // The rules of its training, which may differ from the present ones.
    file.metadata.game_version = info.game_version;
    Ok(PolicySource { game, experiment, file })
}

fn from_skills<'a>(path: &Path, from: &ExperimentArgs, games: &'a Games) -> Result<PolicySource<'a>, CliError> {
    let experiment = from.load(games, [])?;
    let game = from.find_game(games, &experiment)?;
    let model = open::skills(path, DeviceKind::default(), from)?;
    let code = own_code();
    let training = match (model.demos(), &experiment.demos) {
        (Some(seen), _) => format!("demonstrations of {seen}"),
        (None, Some(demos)) => format!("demonstrations in {}", demos.display()),
        (None, None) => "demonstrations".to_owned(),
    };
    let about = Provenance { algorithm: "bc".to_owned(), training, seen: model.demos().cloned(), code };
    let observation_config = check_skills(path, &model, game, from, games)?;
    experiment.check_train(game)?;
    let file = policy_file(
        game,
        &observation_config,
        model.policy(),
        Some(behaviour_cloning_skills(&model, &experiment)),
        about,
    );
    Ok(PolicySource { game, experiment, file })
}

fn show(path: &Path, device: DeviceKind, as_json: bool, games: &Games) -> Result<Outcome, CliError> {
    let file = open::policy(path, device)?;
    let (metadata, policy) = (&file.metadata, &file.policy);
    let skills = file.skills.as_ref();
    let game = games.get(&metadata.game);
    if as_json {
        let mut all = json!({
            "card": metadata, "in_this_program": game.is_ok(), "action_space": policy.action_space(),
            "latent": policy.latent(), "memory": policy.memory(),
            "horizon": skills.map(|skills| skills.skill_interval), "normalised": policy.normalises(),
        });
        let sets = EntitySet::all_in(&metadata.observations);
        if !sets.is_empty() {
            let of_set = |set: &EntitySet| {
                let read_as_set = policy.entities().contains(&set.block);
                json!({ "name": set.name, "slots": set.block.slots, "fields": set.fields, "read_as_set": read_as_set })
            };
            all["sets"] = sets.iter().map(of_set).collect();
        }
        print_line(all)?;
        return Ok(Outcome::Pass);
    }
    let where_else = match game {
        Ok(_) => String::new(),
        Err(unknown) => format!("; this program does not have that game (it has {})", unknown.valid.join(", ")),
    };
    print_line(format!("{}, version {} of its rules{where_else}", metadata.game, metadata.game_version))?;
    print_line(format!("algorithm     {}", metadata.algorithm))?;
    print_line(format!("trained on    {}", metadata.training))?;
    if let Some(seen) = &metadata.seen {
        print_line(format!("has seen      {seen}"))?;
    }
    print_line(format!("code          {}", metadata.code))?;
    print_line(match policy_observation(&file)? {
        observation_config if observation_config.is_image() => format!("observation   {observation_config}"),
        _ => {
            let normalised = if policy.normalises() { ", normalised" } else { "" };
            let values = format!("{}{normalised}", counted(policy.obs_dim() as u64, "value"));
            format!("observation   {}", output::with_names(&values, &metadata.observations))
        }
    })?;
    if policy.memory() > 0 {
        print_line(format!("memory        {}", counted(policy.memory() as u64, "number")))?;
    }
    for set in EntitySet::all_in(&metadata.observations) {
        let alike = if policy.entities().contains(&set.block) { "" } else { ", read value by value" };
        print_line(format!("set           {set}{alike}"))?;
    }
    let actions = policy.action_space().to_string();
    print_line(format!("actions       {}", output::with_names(&actions, &metadata.actions)))?;
    print_line(match skills {
        Some(skills) => {
            let (numbers, ticks) = (policy.latent() as u64, skills.skill_interval as u64);
            format!("skills        {}, held for {}", counted(numbers, "number"), counted(ticks, "tick"))
        }
        None => "skills        none".to_owned(),
    })?;
    Ok(Outcome::Pass)
}
