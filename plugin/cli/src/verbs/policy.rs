//! `playbot policy export|show`.

use crate::{
    arguments::{
        Device,
        experiment::{ExperimentArgs, quoted},
        open,
        player::{check_run_of, check_skills, seen_by_run},
    },
    error::{CliError, Outcome},
    output,
    output::{prepare, print_line, program},
};
use bevy_playbot::{engine::policy_observation, policy_file::check_policy};
use clap::ArgGroup;
use playbot_harness::{
    game::Game,
    games::{Artifact, Games},
    held_out::HeldOut,
    split::LevelSplit,
};
use playbot_learner::{DeviceKind, EntitySet, PolicyFile};
use playbot_report::{counted, whole};
use playbot_train::{
    Experiment,
    checkpoint::CheckpointChoice,
    learn_skills::behaviour_cloning_skills,
    policy_export::{Provenance, export_policy, policy_file},
    run_dir::{OpenedRun, RunDir},
};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Make and show policy files, which a game ships with.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot policy export --run runs/first --checkpoint best --out GAME.policy
  playbot policy export --skills skills.safetensors --out clone.policy
  playbot policy show GAME.policy
  playbot eval --policy GAME.policy")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Write the policy of a run, or behaviour cloning, into one self-describing file.
    Export(Export),
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
#[command(group(ArgGroup::new("source").args(["run", "skills"]).required(true)))]
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
    #[command(flatten)]
    from: ExperimentArgs,
    /// File to write.
    #[arg(long)]
    out: PathBuf,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Export(args) => export(&args, games),
        Verb::Show { file, device, json } => show(&file, device.device, json, games),
    }
}

fn export(args: &Export, games: &Games) -> Result<Outcome, CliError> {
    if args.out.exists() && !args.out.is_dir() && !args.force {
        return Err(CliError::Usage(format!("{} exists already; overwrite it with --force", args.out.display())));
    }
    prepare(&args.out)?;
    let PolicySource { game, experiment, file } = match (&args.run, &args.skills) {
        (Some(run), _) => from_run(run, args.checkpoint, args.from.game.as_deref(), games)?,
        (None, Some(skills)) => from_skills(skills, &args.from, games)?,
        (None, None) => return Err(CliError::Usage("nothing to export: name a --run or a --skills file".to_owned())),
    };
    check_policy(&game.metadata(), &file)?;
    export_policy(game, &file, &experiment.train, experiment.seed, &args.out)?;
    report!(
        "policy written to {}: measure it with {}",
        args.out.display(),
        measuring(&args.out, game, &experiment.test, &file)
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
    let code = code(env!("CARGO_PKG_VERSION"), env!("PLAYBOT_REVISION"));
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

/// Returns the version of playbot that trained a policy. The game's own version stands elsewhere in the metadata.
fn code(version: &str, revision: &str) -> String {
    format!("playbot {version} ({revision})")
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
