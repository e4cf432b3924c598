//! `playbot demo ls|show|verify|repair|merge`.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bevy_playbot::demo::file::{Decider, DemoEpisode, DemoReader, DemoSummary, EpisodeActions, find_demos, repair};
use playbot_lab::demo::verify::{VerifyError, VerifyReport, verify_file};
use playbot_lab::games::Games;
use serde_json::json;

use super::{
    demo_merge::merge,
    error::{CliError, Outcome, print_line},
    experiment::resolve,
    number::counted,
    program, progress,
};

/// Look at, check, repair and join recordings.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot demo ls
  playbot demo show my.demo --episode 0
  playbot demo verify demos/GAME
  playbot demo verify a.demo b.demo --json
  playbot demo repair torn.demo --out whole.demo
  playbot demo merge --out all.demo alice.demo bob.demo")]
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
    /// Replay recordings; exit code 1 if one diverges, is damaged or cannot be replayed.
    Verify {
        /// Files or folders.
        #[arg(default_value = "demos")]
        paths: Vec<PathBuf>,
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
    /// Join recordings of one game, one version of its rules and one mode into a new one.
    Merge {
        /// The recordings, in the order in which their episodes are to stand.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// File to write; it must not exist.
        #[arg(long)]
        out: PathBuf,
        /// Print the result as a line of JSON.
        #[arg(long)]
        json: bool,
    },
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Ls { path, json } => ls(&resolve(&path), json),
        Verb::Show { file, episode, json } => show(&file, episode, json),
        Verb::Verify { paths, json } => verify(&paths, json, games),
        Verb::Repair { file, out, json } => mend(&file, out.as_deref().unwrap_or(&file), json),
        Verb::Merge { files, out, json } => merge(&files, &out, json),
    }
}

fn ls(path: &Path, as_json: bool) -> Result<Outcome, CliError> {
    let mut outcome = Outcome::Pass;
    for file in find_demos(path)? {
        let summary = match DemoSummary::read(&file) {
            Ok(summary) => summary,
            Err(error) => {
                tell!("{}", program::named(&error.to_string()));
                outcome = Outcome::Findings;
                continue;
            }
        };
        if as_json {
            print_line(json!(summary))?;
        } else {
            print_line(format!(
                "{}: {} {}, {} episodes, {} steps, {}, {} levels, {} KiB, by {}, decided by {}",
                file.display(),
                summary.header.game,
                summary.header.mode,
                summary.episodes,
                summary.steps,
                success(&summary),
                summary.levels,
                summary.bytes / 1024,
                summary.header.demonstrator,
                deciders(&summary.steps_by_decider),
            ))?;
        }
    }
    Ok(outcome)
}

/// The share of successes. Recordings do not say whether the aim was reached before time was up, and an episode that was
/// cut off when the recording ended is none of those that the share is of.
fn success(summary: &DemoSummary) -> String {
    let share =
        summary.success_share.map_or("no episode ended".to_owned(), |share| format!("{:.1} % success", 100.0 * share));
    let notes: Vec<String> = [(summary.truncated, "until time was up"), (summary.aborted, "cut off")]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, how)| format!("{count} {how}"))
        .collect();
    if notes.is_empty() { share } else { format!("{share} ({})", notes.join(", ")) }
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

fn verify(paths: &[PathBuf], as_json: bool, games: &Games) -> Result<Outcome, CliError> {
    let mut files = Vec::new();
    for path in paths {
        files.extend(find_demos(resolve(path))?);
    }
    let mut outcome = Outcome::Pass;
    for file in &files {
        let checked = match replay(file, games) {
            // The game is wrong, not what was recorded.
            Err(error @ CliError::Verify(VerifyError::Fault(_))) => return Err(error),
            checked => checked,
        };
        // A verdict is never vacuous: nothing replayed proves nothing.
        if !checked.as_ref().is_ok_and(|report| report.divergences.is_empty() && report.episodes > 0) {
            outcome = Outcome::Findings;
        }
        if as_json {
            let error = checked.as_ref().err().map(|error| program::named(&error.to_string()));
            print_line(json!({ "file": file, "report": checked.ok(), "error": error }))?;
        } else {
            print_report(file, checked)?;
        }
    }
    Ok(outcome)
}

/// Replays a file with a progress bar.
fn replay(file: &Path, games: &Games) -> Result<VerifyReport, CliError> {
    // The whole file is read before any of it is played: damage shows at once.
    let summary = DemoSummary::read(file)?;
    let game = games.get(&summary.header.game).map_err(|error| in_file(file, &error))?;
    let bar = progress::bar("replay", summary.episodes as u64, "episodes");
    let report = verify_file(game, file, |done| bar.set_position(done));
    bar.finish_and_clear();
    Ok(report?)
}

fn in_file(file: &Path, error: &impl std::fmt::Display) -> CliError {
    CliError::Usage(format!("{}: {error}", file.display()))
}

fn print_report(file: &Path, checked: Result<VerifyReport, CliError>) -> Result<(), CliError> {
    let report = match checked {
        Ok(report) => report,
        Err(error) => return print_line(program::named(&error.to_string())),
    };
    for (episode, divergence) in &report.divergences {
        print_line(format!("{}: episode {episode}: {divergence}", file.display()))?;
    }
    let verdict = match report.divergences.len() {
        0 if report.episodes == 0 => "nothing to replay".to_owned(),
        0 => "all as recorded".to_owned(),
        n => format!("{n} diverge"),
    };
    let (episodes, ticks) = (report.episodes, report.ticks);
    print_line(format!("{}: {episodes} episodes, {ticks} ticks replayed, {verdict}", file.display()))
}

/// Repairs a file. One in which no episode is whole is a finding.
fn mend(file: &Path, out: &Path, as_json: bool) -> Result<Outcome, CliError> {
    let report = repair(file, out)?;
    if as_json {
        print_line(json!(report))?;
    } else {
        let kept = match report.kept_episodes {
            0 => "no episode is whole, so nothing is kept and there is nothing to replay or to learn from".to_owned(),
            episodes => format!("kept {} with {} steps", counted(episodes as u64, "episode"), report.kept_steps),
        };
        let places = counted(report.dropped_regions.len() as u64, "place");
        print_line(format!("{}: {kept}; dropped {} bytes in {places}", out.display(), report.dropped_bytes))?;
        if let Some(backup) = &report.backup {
            print_line(format!("the damaged file is kept as {}", backup.display()))?;
        }
    }
    Ok(if report.kept_episodes == 0 { Outcome::Findings } else { Outcome::Pass })
}
