//! Run of `playbot replay`.

use std::path::{Path, PathBuf};

use playbot_lab::{
    findings::{Checks, FindingStatus, Minimised, Recheck, StoredFinding, list_findings, recheck},
    game::Game,
    games::{Artifact, Games},
};

#[cfg(not(feature = "window"))]
use super::no_window::show;
#[cfg(feature = "window")]
use super::window::show;
use super::{picture::Pictures, shorter::write_shorter, told::Told};
use crate::{
    error::{CliError, Outcome},
    number::counted,
    output, program, progress,
};

/// Findings of a folder to list in the error about the folder.
const MOST_NAMED: usize = 3;

/// Play a finding again: check that it still happens, and show it.
///
/// Findings are files that `playbot test` writes. Each holds a level, the actions that lead to the finding, and what
/// was found, with its tick and the state of the game. Detectors have the settings with which they found it. A level
/// file that is missing as seen from the current folder is looked for in each folder above the finding. Exit code 0 if
/// the same happens again, 1 if not.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot replay runs/test/findings/NAME.finding
  playbot replay runs/test/findings/NAME.finding --apng failure.png
  playbot replay runs/test/findings/NAME.finding --png failure.png --scale 4 --json
  playbot replay runs/test/findings/NAME.finding --minimise --out short.finding
  playbot replay short.finding --window

Animated PNGs play in browsers and in most viewers of pictures.")]
pub struct Args {
    /// File of the finding.
    finding: PathBuf,
    /// Write a picture of the last tick, a .png.
    #[arg(long, value_name = "FILE", value_parser = output::png)]
    png: Option<PathBuf>,
    /// Write an animation of all ticks, a .png (at most the last 3600 ticks).
    #[arg(long, value_name = "FILE", value_parser = output::png)]
    apng: Option<PathBuf>,
    /// Enlargement of the bots' picture.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=32))]
    scale: u32,
    /// Show it in a window, where you play on after the last tick.
    #[arg(long)]
    window: bool,
    /// Leave out actions that it does not need, and write the shorter finding to --out. Pictures then show that one.
    #[arg(long, requires = "out")]
    minimise: bool,
    /// File for the shorter finding.
    #[arg(long, value_name = "FILE", requires = "minimise")]
    out: Option<PathBuf>,
    /// Most replays for shortening.
    #[arg(long, default_value_t = 500, requires = "minimise", value_parser = clap::value_parser!(u32).range(1..))]
    replays: u32,
    /// Overwrite an existing finding.
    #[arg(long, requires = "out")]
    force: bool,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    if args.finding.is_dir() {
        return Err(instead_of(&args.finding));
    }
    let stored = StoredFinding::read(&args.finding)?;
    let game = games.of_file(Artifact::Finding, &args.finding, &stored.header.game)?;
    let finding = stored.clone().seen_from(game, &args.finding);
    let pictures = Pictures { still: args.png.as_deref(), animated: args.apng.as_deref(), scale: args.scale };
    pictures.prepare()?;
    check_out(args)?;
    let again = play_again(game, &finding)?;
    let status = again.status(&finding);
    let shorter = match &args.out {
        Some(out) if status != FindingStatus::Gone => {
            Some((write_shorter(game, &finding, &stored, args.replays, out)?, out.as_path()))
        }
        _ => None,
    };
    let told = Told {
        path: &args.finding,
        finding: &stored,
        again: &again,
        shorter: shorter.as_ref().map(|(shorter, path)| (shorter, *path)),
    };
    told.tell(args.json)?;
    let shown = shorter.as_ref().map_or(&finding, |(Minimised { finding, .. }, _)| finding);
    pictures.write(game, shown)?;
    if args.window {
        show(game, shown)?;
    }
    Ok(if status == FindingStatus::StillThere { Outcome::Pass } else { Outcome::Findings })
}

/// Returns the error of a folder, with findings in it.
fn instead_of(folder: &Path) -> CliError {
    let found = match list_findings(folder) {
        Ok(found) => found,
        Err(error) => return error.into(),
    };
    let names: Vec<String> = found.iter().take(MOST_NAMED).map(|(_, path)| path.display().to_string()).collect();
    let folder = folder.display();
    CliError::Usage(format!(
        "{folder} is a folder with {}: name one, such as {}, or play all of them with `{} test --regress {folder}`",
        counted(found.len() as u64, "finding"),
        names.join(", "),
        program::name()
    ))
}

fn check_out(args: &Args) -> Result<(), CliError> {
    let Some(out) = &args.out else { return Ok(()) };
    if out.is_file() && !args.force {
        return Err(CliError::Usage(format!(
            "{} exists: name another file, or overwrite it with --force",
            out.display()
        )));
    }
    output::prepare(out)
}

fn play_again(game: &dyn Game, finding: &StoredFinding) -> Result<Recheck, CliError> {
    let bar = progress::bar("replay", finding.episode.len() as u64, "ticks");
    let again = recheck(game, finding, &Checks::of_game(game));
    bar.finish_and_clear();
    Ok(again?)
}
