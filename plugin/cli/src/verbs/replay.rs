//! `playbot replay`.

use crate::{
    arguments::check_start,
    error::{CliError, Outcome},
    output::{self, print_line, program},
    pictures::{
        Film,
        caption::{NumberBars, Reach},
        episode_world::{EpisodeStep, EpisodeWorld},
        plot::{self, PlotFile},
    },
    progress::{self, interrupt},
};
use bevy_playbot::{
    fault::Fault,
    vision::{ObservationConfig, ObservationKind},
};
use playbot_harness::{
    brief::shell_word,
    game::Game,
    games::{Artifact, Games},
    inspect::{LevelPicture, LevelRequest},
    sensors::GameSensors,
};
use playbot_report::counted;
use playbot_test::findings::{
    Budget, Checks, FindingStatus, Minimised, Recheck, StoredFinding, keep::recheck, list_findings, minimise,
};
use serde_json::{Value, json};
use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
};

#[cfg(not(feature = "window"))]
use crate::verbs::play::no_window;
#[cfg(feature = "window")]
use {
    crate::window::{GameWindow, Playlist, WindowError, WindowSetup},
    playbot_harness::split::LevelSplit,
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
    /// File for the shorter finding, a .finding.
    #[arg(long, value_name = "FILE", requires = "minimise", value_parser = output::finding)]
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
    check_start(game, &finding.header.mode, finding.episode.level_seed)?;
    let again = play_again(game, &finding)?;
    let status = again.status(&finding);
    let edited = finding.edited_level(game);
    // The level as it is now is the one to show, and to name in a shorter finding.
    let mut finding = finding;
    if let (Some(_), Some(now)) = (&edited, &again.replayed.level_file) {
        finding.episode.level_file = Some(now.clone());
    }
    let shorter = match &args.out {
        Some(out) if status != FindingStatus::Gone => {
            Some((write_shorter(game, &finding, &stored, args.replays, out)?, out.as_path()))
        }
        _ => None,
    };
    let is_stopped = shorter.as_ref().is_some_and(|(shorter, _)| !shorter.is_minimal) && interrupt::asked();
    let report = ReplayReport {
        path: &args.finding,
        finding: &stored,
        again: &again,
        edited: edited.as_deref(),
        shorter: shorter.as_ref().map(|(shorter, path)| (shorter, *path)),
        is_stopped,
    };
    report.print(args.json)?;
    if is_stopped {
        return Ok(Outcome::Stopped);
    }
    let shown = shorter.as_ref().map_or(&finding, |(Minimised { finding, .. }, _)| finding);
    pictures.write(game, shown)?;
    if !pictures.are_wanted() && !args.window && !args.json {
        report!("to see it, add --png FILE for its last tick, --apng FILE for all ticks, or --window");
    }
    if args.window {
        show(game, shown)?;
        if interrupt::asked() {
            return Ok(Outcome::Stopped);
        }
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
    args.out.as_deref().map_or(Ok(()), |out| output::prepare_new(out, args.force))
}

/// Plays a finding again, with a progress bar.
///
/// # Errors
///
/// It cannot be played.
pub(crate) fn play_again(game: &dyn Game, finding: &StoredFinding) -> Result<Recheck, CliError> {
    let bar = progress::bar("replay", finding.episode.len() as u64, "ticks");
    let again = recheck(game, finding, &Checks::of_game(game));
    bar.finish_and_clear();
    Ok(again?)
}

/// A finding and the result of its replay.
pub struct ReplayReport<'a> {
    /// Its file.
    pub path: &'a Path,
    /// The finding as stored.
    pub finding: &'a StoredFinding,
    /// The result of playing it again.
    pub again: &'a Recheck,
    /// Path of the level's file, if it has changed since the test.
    pub edited: Option<&'a str>,
    /// The shorter one, and its file.
    pub shorter: Option<(&'a Minimised, &'a Path)>,
    /// Whether Ctrl-C ended the search for the shorter one.
    pub is_stopped: bool,
}

impl ReplayReport<'_> {
    /// Prints it: as a line of JSON, or as text.
    ///
    /// # Errors
    ///
    /// Standard output is closed.
    pub fn print(&self, as_json: bool) -> Result<(), CliError> {
        if as_json {
            return print_line(self.json());
        }
        print_line(self.sentence())?;
        self.shorter_sentence().map_or(Ok(()), print_line)
    }

    fn json(&self) -> Value {
        let StoredFinding { header, head, episode } = self.finding;
        let shorter = self.shorter.map(|(shorter, path)| {
            json!({
                "path": path.display().to_string(), "ticks": shorter.finding.episode.len(), "replays": shorter.replays,
                "is_minimal": shorter.is_minimal, "stopped": self.is_stopped,
            })
        });
        json!({
            "finding": self.path.display().to_string(), "game": header.game, "mode": header.mode, "level": head.level,
            "detector": head.detector, "tester": head.tester, "message": head.message, "tick": head.tick,
            "state_hash": head.state_hash, "ticks": episode.len(), "original_ticks": head.original_ticks,
            "status": self.again.status(self.finding), "seen": self.again.sighting, "minimised": shorter,
            "level_file_changed": self.edited.is_some(),
        })
    }

    /// Describes the finding in a line, and whether it happens again in another one.
    pub fn sentence(&self) -> String {
        let StoredFinding { head, .. } = self.finding;
        let at = |tick: Option<u32>| tick.map_or_else(String::new, |tick| format!(" at tick {tick}"));
        let now = match self.again.status(self.finding) {
            FindingStatus::StillThere => format!("it happens again{}, with the same state", at(head.tick)),
            FindingStatus::Changed => {
                let seen = self.again.sighting.and_then(|seen| seen.tick);
                format!(
                    "it happens again, but not as stored:{} instead of{}, or in another state",
                    at(seen),
                    at(head.tick)
                )
            }
            FindingStatus::Gone | FindingStatus::Unplayable => "it does not happen any more".to_owned(),
        };
        let edited =
            self.edited.map_or_else(String::new, |path| format!("; the level file {path} has changed since the test"));
        format!("{}\n{now}{edited}", described(self.finding))
    }

    fn shorter_sentence(&self) -> Option<String> {
        let (shorter, path) = self.shorter?;
        let (now, original) = (shorter.finding.episode.len(), self.finding.head.original_ticks);
        let [before, after] = shorter.efforts;
        let percent = 100.0 * now as f64 / f64::from(original.max(1));
        let end = if self.is_stopped {
            let (program, path) = (program::name(), shell_word(&path.display().to_string()));
            format!(
                "; stopped before nothing more could be left out: `{program} replay {path} --minimise --out FILE.finding` goes on"
            )
        } else if shorter.is_minimal {
            String::new()
        } else {
            "; the budget was used up before nothing more could be left out".to_owned()
        };
        Some(format!(
            "{}: {} of {original} that the tester played ({percent:.0} %), {} of {before} that do something, after {}{end}",
            path.display(),
            counted(now as u64, "tick"),
            counted(after.into(), "action"),
            counted(shorter.replays.into(), "replay")
        ))
    }
}

/// Describes a finding in a line.
pub(crate) fn described(finding: &StoredFinding) -> String {
    let StoredFinding { header, head, episode } = finding;
    let by = head.tester.as_ref().map_or_else(String::new, |tester| format!(", played by {tester}"));
    let ticks =
        if episode.is_empty() { String::new() } else { format!(" ({})", counted(episode.len() as u64, "tick")) };
    format!("{} {}{by}{ticks}: {}: {}", header.game, head.level, head.detector, head.message)
}

/// Leaves out needless actions, with a progress bar, and writes the rest. Its level is named as in `stored`: it may
/// have been found in another folder. Ctrl-C ends it with the best so far.
///
/// # Errors
///
/// The finding does not happen any more, or the file cannot be written.
pub(crate) fn write_shorter(
    game: &dyn Game,
    finding: &StoredFinding,
    stored: &StoredFinding,
    replays: u32,
    out: &Path,
) -> Result<Minimised, CliError> {
    interrupt::leave(format!("{} is not written", out.display()));
    interrupt::listen();
    let bar = progress::bar("minimise", replays.into(), "replays");
    let budget = Budget { replays, ..Budget::default() };
    let hear = |replays: u32| bar.set_position(replays.into());
    let shorter = minimise(game, finding, &Checks::of_game(game), budget, &hear, &interrupt::asked_to_sum_up);
    bar.finish_and_clear();
    let shorter = shorter?;
    output::make_folder_of(out)?;
    shorter.finding.clone().with_level_of(stored).write(out)?;
    Ok(shorter)
}

/// Returns the error of a program without a window, with the command that builds one, and options that need none.
#[cfg(not(feature = "window"))]
fn show(_: &dyn Game, _: &StoredFinding) -> Result<(), CliError> {
    Err(CliError::Usage(format!("{}; --png FILE and --apng FILE draw the finding without one", no_window())))
}

/// Plays the actions in a window; after them a person plays on.
///
/// # Errors
///
/// There is no display, the game cannot be shown in a window, or the finding is that the game breaks.
#[cfg(feature = "window")]
fn show(game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
    let level = finding.episode.level_seed;
    let levels = LevelSplit { mode: finding.header.mode.clone(), first: level, last: level };
    let mut window = GameWindow::open(WindowSetup {
        game,
        playlist: Playlist::new(levels, level),
        autopilot: None,
        observation_config: ObservationConfig::default(),
        seed: 0,
        stop: interrupt::asked,
    })
    .map_err(or_a_picture)?;
    window.replay(finding.episode.clone());
    interrupt::listen();
    report!("the finding is played first, then you play on; P pause, R again, Escape ends");
    Ok(window.run()?)
}

/// Adds the advice to draw pictures where no window opens.
#[cfg(feature = "window")]
fn or_a_picture(error: WindowError) -> CliError {
    match error {
        WindowError::NoDisplay(_) | WindowError::NoLibrary(_) | WindowError::NoAdapter(_) => {
            let words = error.to_string();
            CliError::Usage(words.replace("there is `playbot eval`", "--png FILE and --apng FILE draw the finding"))
        }
        error => error.into(),
    }
}

// The picture of a replay.

/// Most ticks to draw, counted from the end.
const MOST_TICKS: usize = 3600;

/// The requested pictures.
pub struct Pictures<'a> {
    /// File for a picture of the last tick.
    pub still: Option<&'a Path>,
    /// File for an animated picture.
    pub animated: Option<&'a Path>,
    /// Enlargement of the bots' picture.
    pub scale: u32,
}

impl Pictures<'_> {
    /// Tests whether the files can be written.
    ///
    /// # Errors
    ///
    /// One of them cannot.
    pub fn prepare(&self) -> Result<(), CliError> {
        self.still.into_iter().chain(self.animated).try_for_each(output::prepare)
    }

    /// Returns whether there are any.
    pub fn are_wanted(&self) -> bool {
        self.still.is_some() || self.animated.is_some()
    }

    /// Draws and writes them.
    ///
    /// # Errors
    ///
    /// The game cannot be drawn, the pictures are too large, or the disk fails.
    pub fn write(&self, game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
        if !self.are_wanted() {
            return Ok(());
        }
        let seen_as = seen_as(game);
        let bar = progress::bar("play", finding.episode.len() as u64, "ticks");
        let played = play(game, finding, &seen_as, MOST_TICKS, &mut |_, _| bar.inc(1));
        bar.finish_and_clear();
        let (steps, reach) = played?;
        let Some(last) = steps.last() else { return self.write_level(game, finding) };
        let film = film(game, &seen_as, self.scale, &reach)?;
        if let Some(path) = self.still {
            output::write(path, &film.captioned(last)?.0)?;
            report!("picture: {} shows tick {}", path.display(), last.tick);
        }
        if let Some(path) = self.animated {
            let bar = progress::bar("draw", steps.len() as u64, "frames");
            let drawn = film.animated(&steps, || bar.inc(1));
            bar.finish_and_clear();
            output::write(path, &drawn?.0)?;
            report!("animation: {} shows ticks {} to {}", path.display(), steps[0].tick, last.tick);
        }
        Ok(())
    }

    /// Writes the level, for a finding before the end of the first tick, such as an unsolvable level.
    fn write_level(&self, game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
        let why = "it was found before the first tick was over";
        let Some(level) = picture_of(game, &finding.header.mode, finding.episode.level_seed) else {
            report!("nothing is drawn: {why}");
            return Ok(());
        };
        for path in self.still.into_iter().chain(self.animated) {
            plot::write(&PlotFile::new(path)?, &level, game.tick_hz())?;
            report!("picture: {} shows the level: {why}", path.display());
        }
        Ok(())
    }
}

/// Returns a picture of the last tick of a finding as a PNG whose longer side has about `length` pixels.
/// Of a finding before the end of the first tick it is the level; `None` if the game draws none.
///
/// # Errors
///
/// The game cannot be drawn, or the picture is too large.
pub(crate) fn last_tick(game: &dyn Game, finding: &StoredFinding, length: u32) -> Result<Option<Vec<u8>>, CliError> {
    const NUMBERS: u32 = 3;
    let seen_as = seen_as(game);
    let (steps, reach) = play(game, finding, &seen_as, 1, &mut |_, _| {})?;
    let Some(last) = steps.last() else {
        let level = picture_of(game, &finding.header.mode, finding.episode.level_seed);
        return level.map(|level| plot::png(&level, game.tick_hz())).transpose();
    };
    let side = seen_as.image.width.max(seen_as.image.height).max(1);
    let scale = if seen_as.is_image() { (length / side).clamp(1, 32) } else { NUMBERS };
    Ok(Some(film(game, &seen_as, scale, &reach)?.captioned(last)?.0))
}

/// Returns a level as the game draws it; `None` if it draws none.
fn picture_of(game: &dyn Game, mode: &str, level: u64) -> Option<LevelPicture> {
    let request = LevelRequest { mode: Some(mode), level: Some(level), picture: true, ..LevelRequest::default() };
    game.show_level(&request).ok()?.picture
}

/// Returns the pictures that a game has, or else its numbers.
pub(crate) fn seen_as(game: &dyn Game) -> ObservationConfig {
    let of = |kind| ObservationConfig { kind, ..ObservationConfig::default() };
    if game.tools().pictures.picture().is_some() {
        return of(ObservationKind::Raster);
    }
    let camera = of(ObservationKind::Camera);
    if game.tools().pictures.has_camera() && camera.check(game).is_ok() { camera } else { of(ObservationKind::Vector) }
}

/// Returns the film of a game in these pictures, or of its numbers, enlarged.
///
/// # Errors
///
/// The pictures are too large.
pub(crate) fn film(game: &dyn Game, seen_as: &ObservationConfig, scale: u32, reach: &Reach) -> Result<Film, CliError> {
    if seen_as.is_image() {
        return Film::new(seen_as.image, scale, game.tick_hz());
    }
    Ok(Film::of_numbers(NumberBars::new(game.observation().names, scale, reach), game.tick_hz()))
}

/// Plays the last ticks up to the finding, `most` at most, and calls `each` after each tick that is played. A game that
/// breaks ends it.
///
/// # Errors
///
/// The pictures cannot be made.
pub(crate) fn play(
    game: &dyn Game,
    finding: &StoredFinding,
    seen_as: &ObservationConfig,
    most: usize,
    each: &mut dyn FnMut(&EpisodeWorld, &EpisodeStep),
) -> Result<(Vec<EpisodeStep>, Reach), CliError> {
    let mut world = EpisodeWorld::replaying(game, &finding.header.mode, seen_as, finding.episode.clone())?;
    world.keep_no_panic_files();
    let (mut steps, mut reach) = (VecDeque::new(), Reach::default());
    loop {
        match world.next() {
            Ok(Some(step)) => {
                reach.include(&step.vector);
                each(&world, &step);
                steps.push_back(step);
                if steps.len() > most {
                    steps.pop_front();
                }
            }
            Ok(None) => break,
            Err(error) if error.is::<Fault>() => break,
            Err(error) => return Err(error),
        }
    }
    Ok((steps.into(), reach))
}

#[cfg(test)]
mod tests {
    use bevy_playbot::demo::file::DemoEpisode;
    use playbot_harness::foreign::ForeignGame;
    use playbot_test::findings::{FindingHead, Replayed};

    use super::*;

    #[test]
    fn a_search_that_was_stopped_is_distinguished_from_one_with_too_few_replays() {
        let game = ForeignGame::new("walk", 1, |_: &mut bevy::prelude::App| {});
        let header = game.demo_header("default");
        let episode = DemoEpisode::new(0, header.actions);
        let head = FindingHead { original_ticks: 9, ..FindingHead::new("default:0", "lost", "after 9 ticks") };
        let finding = StoredFinding { header, head, episode };
        let again = Recheck { sighting: None, replayed: Replayed::default() };
        let minimised = |is_minimal| Minimised { finding: finding.clone(), replays: 3, efforts: [2, 1], is_minimal };
        let said = |is_minimal, is_stopped| {
            let shorter = minimised(is_minimal);
            let path = Path::new("short one.finding");
            let shorter = Some((&shorter, path));
            let report = ReplayReport { path, finding: &finding, again: &again, edited: None, shorter, is_stopped };
            (report.shorter_sentence().expect("there is a shorter one"), report.json())
        };
        assert!(said(true, false).0.ends_with(" after 3 replays"));
        assert!(said(false, false).0.ends_with("; the budget was used up before nothing more could be left out"));
        let (words, json) = said(false, true);
        let advice = format!("`{} replay 'short one.finding' --minimise --out FILE.finding` goes on", program::name());
        assert!(words.contains("; stopped before") && words.ends_with(&advice), "{words}");
        assert_eq!(json["minimised"]["stopped"], true);
    }

    #[cfg(feature = "window")]
    #[test]
    fn without_a_display_pictures_are_named() {
        let missing = || "DISPLAY is not set".to_owned();
        let all = [WindowError::NoDisplay, WindowError::NoLibrary, WindowError::NoAdapter];
        for error in all.map(|of| of(missing())) {
            let words = or_a_picture(error).to_string();
            assert!(words.contains("--png FILE and --apng FILE") && !words.contains("eval"), "{words}");
        }
        assert!(!or_a_picture(WindowError::Lost(missing())).to_string().contains("--png"));
    }
}
