//! `playbot demo filter` and `playbot demo label`: new recordings of chosen episodes, or with another player's name.

use crate::{
    arguments::{finite_number, open},
    error::{CliError, Outcome},
    output,
    output::{prepare, print_line},
};
use bevy_playbot::{
    demo::file::{DemoHeader, DemoReader},
    engine::relabel_demo,
};
use playbot_harness::{
    demo::filter::{EpisodeFilter, FilterError, FilterReport, filter_demos},
    game::idle_action,
    games::{Artifact, Games},
    split::LevelSplit,
};
use playbot_report::counted;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Options of `demo filter`.
#[derive(clap::Args)]
pub(super) struct FilterArgs {
    /// The recordings, in the order of their episodes in the new one.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Recording to write, a .demo that does not exist.
    #[arg(long, value_parser = output::demo)]
    out: PathBuf,
    /// Keep episodes with at least this return.
    #[arg(long, value_parser = finite_number)]
    min_return: Option<f64>,
    /// Keep episodes with at most this return.
    #[arg(long, value_parser = finite_number)]
    max_return: Option<f64>,
    /// Keep episodes that ended at the goal.
    #[arg(long)]
    success: bool,
    /// Keep the recordings of this player, by the name in their header.
    #[arg(long, value_name = "NAME")]
    player: Option<String>,
    /// Keep episodes on these levels, as mode:first..last or mode:number, or by their names in a level editor (repeatable).
    #[arg(long, visible_alias = "level")]
    levels: Vec<LevelSplit>,
    /// Mark the leading ticks with the game's idle action. Replays play them, and `learn-skills` leaves them out.
    #[arg(long)]
    without_idle_start: bool,
    /// Print the result as a line of JSON.
    #[arg(long)]
    json: bool,
}

/// Writes the episodes that meet all conditions into a new file. It is a finding if no episode does.
///
/// # Errors
///
/// The recordings are of different games or rules, one is damaged, or there is a file at `--out` already.
pub(super) fn filter(args: FilterArgs, games: &Games) -> Result<Outcome, CliError> {
    if let (Some(least), Some(most)) = (args.min_return, args.max_return)
        && least > most
    {
        return Err(CliError::Usage(format!(
            "--min-return {least} is above --max-return {most}, so no episode can be kept: exchange the two numbers"
        )));
    }
    let idle = args.without_idle_start.then(|| idle_action_of(&args.files, games)).transpose()?;
    let FilterArgs { files, out, min_return, max_return, success, player, levels, json, .. } = args;
    prepare(&out)?;
    let filter = EpisodeFilter { min_return, max_return, success, player, levels, idle: idle.flatten() };
    let report = filter_demos(&files, &filter, &out).map_err(|error| match error {
        FilterError::File(error) => open::missing_or_taken(error),
        other => other.into(),
    })?;
    print_filtered(&report, &out, json)?;
    Ok(if report.episodes() == 0 { Outcome::Findings } else { Outcome::Pass })
}

/// Returns the idle action of the game that was recorded.
fn idle_action_of(files: &[PathBuf], games: &Games) -> Result<Option<bevy_playbot::action::ActionValue>, CliError> {
    let Some(first) = files.first() else { return Ok(None) };
    let reader = DemoReader::open(first).map_err(open::missing_recording)?;
    let game = games.of_file(Artifact::Recording, first, &reader.header().game)?;
    Ok(Some(idle_action(game)))
}

fn print_filtered(report: &FilterReport, out: &Path, as_json: bool) -> Result<(), CliError> {
    let episodes = report.episodes();
    if as_json {
        return print_line(json!({
            "file": (episodes > 0).then_some(out), "header": report.header, "episodes": episodes, "steps": report.steps,
            "idle_steps": report.idle_steps, "files": report.files, "left_out": report.left_out,
        }));
    }
    for file in &report.files {
        let all = counted(file.episodes as u64, "episode");
        print_line(format!("{}: kept {} of {all}", file.file.display(), file.kept))?;
    }
    for file in &report.left_out {
        print_line(format!("{}: by another player, left out", file.display()))?;
    }
    if episodes == 0 {
        return print_line("no episode meets all conditions, so nothing was written");
    }
    print_line(summary(&report.header, episodes, report.steps, out))?;
    if report.idle_steps > 0 {
        let idle = counted(report.idle_steps as u64, "step");
        print_line(format!("{idle} of idle starts are marked: replays play them, and learn-skills leaves them out"))?;
    }
    Ok(())
}

/// Describes a new recording.
fn summary(header: &DemoHeader, episodes: usize, steps: usize, out: &Path) -> String {
    format!(
        "{}: {} {}, {} with {}, by {}",
        out.display(),
        header.game,
        header.mode,
        counted(episodes as u64, "episode"),
        counted(steps as u64, "step"),
        header.demonstrator,
    )
}

/// Writes a recording anew with another name of its player.
///
/// # Errors
///
/// The name is empty, the recording is damaged, or there is a file at `out` already.
pub(super) fn label(file: &Path, player: &str, out: &Path, as_json: bool) -> Result<Outcome, CliError> {
    let player = player.trim();
    if player.is_empty() {
        return Err(CliError::Usage("--player is empty: name the player, as in --player ada".to_owned()));
    }
    prepare(out)?;
    let report = relabel_demo(file, player, out).map_err(open::missing_or_taken)?;
    if as_json {
        print_line(json!({
            "file": out, "header": report.header, "episodes": report.episodes(), "steps": report.steps,
        }))?;
    } else {
        print_line(summary(&report.header, report.episodes(), report.steps, out))?;
    }
    Ok(Outcome::Pass)
}
