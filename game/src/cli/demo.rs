//! `playbot demo ls|show|verify|repair`.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bevy_playbot::demo::{
    file::{Decider, DemoEpisode, DemoReader, DemoSummary, EpisodeActions, find_demos, repair},
    verify::verify_file,
};
use serde_json::json;

use super::{
    error::{CliError, Outcome, print_line},
    experiment::resolve,
    progress,
};
use crate::registry;

/// Look at, check and repair recordings.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot demo ls
  playbot demo show demos/coinrun/easy.demo --episode 0
  playbot demo verify demos/coinrun
  playbot demo repair torn.demo --out whole.demo")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// List recordings.
    Ls {
        /// File or folder.
        #[arg(default_value = "demos")]
        path: PathBuf,
        /// One line of JSON per recording.
        #[arg(long)]
        json: bool,
    },
    /// Show the header and the episodes of a recording.
    Show {
        /// The file.
        file: PathBuf,
        /// Show every tick of this episode, counted from 0.
        #[arg(long)]
        episode: Option<usize>,
        /// One line of JSON per episode, or per tick.
        #[arg(long)]
        json: bool,
    },
    /// Replay recordings; exit code 1 if one diverges.
    Verify {
        /// File or folder.
        #[arg(default_value = "demos")]
        path: PathBuf,
        /// One line of JSON per recording.
        #[arg(long)]
        json: bool,
    },
    /// Recover the whole episodes of a damaged recording.
    Repair {
        /// The damaged file.
        file: PathBuf,
        /// File to write; the damaged file itself if none is named, which is then kept beside it as FILE.bak.
        #[arg(long)]
        out: Option<PathBuf>,
        /// Print the result as a line of JSON.
        #[arg(long)]
        json: bool,
    },
}

pub fn run(args: Args) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Ls { path, json } => ls(&resolve(&path), json),
        Verb::Show { file, episode, json } => show(&file, episode, json),
        Verb::Verify { path, json } => verify(&resolve(&path), json),
        Verb::Repair { file, out, json } => mend(&file, out.as_deref().unwrap_or(&file), json),
    }
}

fn ls(path: &Path, as_json: bool) -> Result<Outcome, CliError> {
    let mut outcome = Outcome::Pass;
    for file in find_demos(path)? {
        let summary = match DemoSummary::read(&file) {
            Ok(summary) => summary,
            Err(error) => {
                eprintln!("{error}");
                outcome = Outcome::Findings;
                continue;
            }
        };
        if as_json {
            print_line(json!(summary))?;
        } else {
            print_line(format!(
                "{}: {} {}, {} episodes, {} steps, {:.1} % success{}, {} levels, {} KiB, by {}, decided by {}",
                file.display(),
                summary.header.game,
                summary.header.mode,
                summary.episodes,
                summary.steps,
                100.0 * summary.success_share.unwrap_or(0.0),
                out_of_time(&summary),
                summary.levels,
                summary.bytes / 1024,
                summary.header.demonstrator,
                deciders(&summary.steps_by_decider),
            ))?;
        }
    }
    Ok(outcome)
}

/// Recordings do not say whether the aim was reached before time was up.
fn out_of_time(summary: &DemoSummary) -> String {
    if summary.truncated > 0 { format!(" ({} until time was up)", summary.truncated) } else { String::new() }
}

/// Who decided which share of the ticks.
pub fn deciders(steps_by_decider: &BTreeMap<Decider, usize>) -> String {
    let total: usize = steps_by_decider.values().sum();
    if total == 0 {
        return "nobody".to_owned();
    }
    let share = |(decider, &steps)| format!("{decider} {:.0} %", 100.0 * steps as f64 / total as f64);
    steps_by_decider.iter().map(share).collect::<Vec<_>>().join(", ")
}

fn show(file: &Path, wanted: Option<usize>, as_json: bool) -> Result<Outcome, CliError> {
    let reader = DemoReader::open(file)?;
    if !as_json {
        print_line(format!("{:#?}", reader.header()))?;
    }
    for (index, episode) in reader.enumerate() {
        let episode = episode?;
        match wanted {
            None => show_episode(index, &episode, as_json)?,
            Some(wanted) if wanted == index => {
                show_ticks(&episode, as_json)?;
                return Ok(Outcome::Pass);
            }
            Some(_) => {}
        }
    }
    match wanted {
        Some(wanted) => Err(CliError::Usage(format!("{} has no episode {wanted}", file.display()))),
        None => Ok(Outcome::Pass),
    }
}

fn show_episode(index: usize, episode: &DemoEpisode, as_json: bool) -> Result<(), CliError> {
    if as_json {
        return print_line(json!({
            "episode": index, "level": episode.level_seed, "steps": episode.len(),
            "return": episode.episode_return(), "end": episode.end, "steps_by_decider": episode.steps_by_decider(),
        }));
    }
    print_line(format!(
        "episode {index:>4}  level {:>6}  {:>4} steps  return {:>6.2}  {:?}  by {}",
        episode.level_seed,
        episode.len(),
        episode.episode_return(),
        episode.end,
        deciders(&episode.steps_by_decider())
    ))
}

fn show_ticks(episode: &DemoEpisode, as_json: bool) -> Result<(), CliError> {
    for tick in 0..episode.len() {
        let action = match &episode.actions {
            EpisodeActions::Discrete(list) => json!(list[tick]),
            EpisodeActions::Continuous { dim, values } => json!(values[tick * dim..(tick + 1) * dim]),
        };
        let (reward, hash, decider) = (episode.rewards[tick], episode.state_hashes[tick], episode.deciders[tick]);
        if as_json {
            print_line(json!({
                "tick": tick, "action": action, "reward": reward, "state_hash": hash, "decider": decider,
            }))?;
        } else {
            print_line(format!("{tick:>5}  action {action:<4}  reward {reward:<5}  hash {hash:08x}  {decider:?}"))?;
        }
    }
    Ok(())
}

fn verify(path: &Path, as_json: bool) -> Result<Outcome, CliError> {
    let mut outcome = Outcome::Pass;
    for file in find_demos(path)? {
        let header = DemoReader::open(&file)?.header().clone();
        let game = registry::game(&header.game)?;
        let episodes = DemoSummary::read(&file)?.episodes as u64;
        let bar = progress::bar("replay", episodes, "episodes");
        let report = verify_file(game, &file, |done| bar.set_position(done));
        bar.finish_and_clear();
        let report = report?;
        // A verdict is never vacuous: nothing replayed proves nothing.
        if !report.divergences.is_empty() || report.episodes == 0 {
            outcome = Outcome::Findings;
        }
        if as_json {
            print_line(json!({ "file": file, "report": report }))?;
            continue;
        }
        for (episode, divergence) in &report.divergences {
            print_line(format!("{}: episode {episode}: {divergence}", file.display()))?;
        }
        let verdict = match report.divergences.len() {
            0 if report.episodes == 0 => "nothing to replay".to_owned(),
            0 => "all as recorded".to_owned(),
            n => format!("{n} diverge"),
        };
        print_line(format!(
            "{}: {} episodes, {} ticks replayed, {verdict}",
            file.display(),
            report.episodes,
            report.ticks
        ))?;
    }
    Ok(outcome)
}

fn mend(file: &Path, out: &Path, as_json: bool) -> Result<Outcome, CliError> {
    let report = repair(file, out)?;
    if as_json {
        print_line(json!(report))?;
    } else {
        print_line(format!(
            "{}: kept {} episodes with {} steps, dropped {} bytes in {} places",
            out.display(),
            report.kept_episodes,
            report.kept_steps,
            report.dropped_bytes,
            report.dropped_regions.len()
        ))?;
        if let Some(backup) = &report.backup {
            print_line(format!("the damaged file is kept as {}", backup.display()))?;
        }
    }
    Ok(Outcome::Pass)
}
