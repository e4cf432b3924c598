//! `playbot view`.

use crate::{
    arguments::{
        LevelsArg, check_start, default_mode, open,
        player::{LoadedPlayer, PlayerArgs},
    },
    error::{CliError, Outcome},
    output::{self, print_line},
    pictures::{
        Film,
        caption::{NumberBars, Reach},
        episode_world::{EpisodeStep, EpisodeWorld},
    },
    progress::{self, interrupt},
    verbs::skills::SkillNames,
};
use bevy_playbot::{
    demo::{
        file::{DemoEpisode, DemoFileError, DemoReader},
        replay::Divergence,
    },
    episode::{EpisodeEnd, EpisodeEnded},
    unknown_name::UnknownName,
    vision::{ImageOptions, ObservationConfig, ObservationKind},
};
use playbot_harness::{
    eval::Player,
    game::Game,
    games::{Artifact, Games},
    sensors::GameSensors,
};
use playbot_report::counted;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Most memory for the observations of an episode.
const MOST_BYTES: usize = 1 << 30;

/// Write a bot's observation as a picture, or an episode as an animation.
///
/// The file is a PNG of one observation. With --episode it is an animated one of a whole episode, with tick, action,
/// value and skill under each picture. A bot that reads vectors plays on them, and the picture is drawn beside it. A
/// game with a camera of its own is drawn through that camera. A game that cannot be drawn is shown as numbers with
/// bars. The number behind each bar, with ±, is its scale. It is the largest value of the episode, or of its ticks up
/// to the shown one, rounded up.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot view GAME --level 5
  playbot view GAME --level 5 --tick 40 --bot BOT --image stack=4
  playbot view GAME --level 64 --run runs/first --episode --out episode.png
  playbot view GAME --levels files:my-level.json --episode
  playbot view GAME --demo my.demo --episode-number 3 --episode --scale 4
  playbot view GAME --image width=84 --image height=84 --image grayscale --image paint_velocity

Animated PNGs play in browsers and in most viewers of pictures.")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game (default: the one that it is trained in, or that of the recording).
    #[arg(long, conflicts_with = "demo")]
    mode: Option<String>,
    #[command(flatten)]
    levels: LevelsArg,
    /// Random seed of the player's draws (default: 0).
    #[arg(long, conflicts_with = "demo")]
    seed: Option<u64>,
    /// Tick of the episode, from 0, whose observation is written.
    #[arg(long, default_value_t = 0, conflicts_with = "episode")]
    tick: u32,
    /// Write the whole episode.
    #[arg(long)]
    episode: bool,
    #[command(flatten)]
    player: PlayerArgs,
    /// Recording to show. Without it and without a player, the game's demonstrator plays.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["player", "level"])]
    demo: Option<PathBuf>,
    /// Episode of the recording, counted from 0.
    #[arg(long, default_value_t = 0, requires = "demo", conflicts_with_all = ["player", "mode", "level", "seed"])]
    episode_number: usize,
    /// File to write, a .png.
    #[arg(long, default_value = "view.png", value_parser = output::png)]
    out: PathBuf,
    /// Enlargement of the bot's picture.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=32))]
    scale: u32,
    /// Form of the pictures, instead of the policy's own: width=84, height=84, stack=4, grayscale, paint_velocity
    /// (repeatable).
    #[arg(long = "image", value_name = "KEY=VALUE")]
    image: Vec<String>,
    /// Use a Bevy camera instead of the raster.
    #[arg(long)]
    camera: bool,
    /// Print the written file as a line of JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    output::prepare(&args.out)?;
    let Opened { mut episode_world, observation_config, mode, player } = open_episode(game, &args, games)?;
    let pictures = observation_config
        .is_image()
        .then(|| Film::new(observation_config.image, args.scale, game.tick_hz()))
        .transpose()?;
    let Some((steps, reach)) = play(&mut episode_world, &args)? else {
        report!("stopped before tick {}; nothing is written: call it again", args.tick);
        return Ok(Outcome::Stopped);
    };
    let numbers = || NumberBars::new(game.observation().names, args.scale, &reach);
    let film = pictures.unwrap_or_else(|| Film::of_numbers(numbers(), game.tick_hz()));
    let (bytes, size) = if args.episode {
        let bar = progress::bar("draw", steps.len() as u64, "frames");
        let drawn = film.animated(&steps, || bar.inc(1));
        bar.finish_and_clear();
        drawn?
    } else if observation_config.is_image() {
        film.still(&steps[0].image)?
    } else {
        film.captioned(&steps[0])?
    };
    output::write(&args.out, &bytes)?;
    let written = WrittenPicture {
        path: &args.out,
        game,
        mode: &mode,
        is_mode_named: args.mode.is_some() || args.levels.is_named() || args.demo.is_some(),
        level: episode_world.level(),
        player: &player,
        demo: args.demo.as_deref(),
        tick: (!args.episode).then_some(args.tick),
        frames: steps.len(),
        bytes: bytes.len(),
        size,
        ticks: episode_world.ticks(),
        end: episode_world.end(),
        divergence: episode_world.divergence(),
    };
    written.print(args.json)?;
    match episode_world.divergence() {
        None if interrupt::asked() => Ok(Outcome::Stopped),
        None => Ok(Outcome::Pass),
        Some(divergence) => {
            report!("from there on the game differs from the recording: {divergence}");
            Ok(Outcome::Findings)
        }
    }
}

/// A World with the player, or with the recording.
struct Opened {
    episode_world: EpisodeWorld,
    observation_config: ObservationConfig,
    /// Mode that is played.
    mode: String,
    /// Name of the player.
    player: String,
}

fn open_episode(game: &dyn Game, args: &Args, games: &Games) -> Result<Opened, CliError> {
    if let Some(path) = &args.demo {
        if args.levels.is_named() {
            return Err(CliError::Usage("--demo sets the level: leave out --levels".to_owned()));
        }
        let reader = open_recording(game, path, games)?;
        let mode = reader.header().mode.clone();
        game.check_mode(&mode).map_err(|error| CliError::Usage(format!("{}: {error}", path.display())))?;
        let observation_config = observation_config(game, args, None)?;
        let episode = episode(reader, path, args.episode_number)?;
        check_start(game, &mode, episode.level_seed)?;
        let episode_world = EpisodeWorld::replaying(game, &mode, &observation_config, episode)?;
        return Ok(Opened { episode_world, observation_config, mode, player: "recording".to_owned() });
    }
    let (mode, level) = args.levels.choose(game, args.mode.as_deref(), args.seed)?;
    let mode = mode.unwrap_or_else(|| default_mode(game));
    game.check_mode(mode)?;
    let chosen = match args.player.load(game)? {
        Some(chosen) => chosen,
        None => LoadedPlayer::default_of(game)?,
    };
    let observation_config = observation_config(game, args, Some(&chosen))?;
    check_start(game, mode, level)?;
    let seed = args.levels.random_seed(args.seed);
    let mut episode_world = EpisodeWorld::playing(game, mode, &observation_config, level, &chosen.player, seed)?;
    episode_world.name_skills(SkillNames::of_player(&args.player)?.regions);
    Ok(Opened { episode_world, observation_config, mode: mode.to_owned(), player: chosen.name })
}

/// Opens a recording of this game and these rules.
fn open_recording(game: &dyn Game, path: &Path, games: &Games) -> Result<DemoReader, CliError> {
    let reader = DemoReader::open(path).map_err(open::missing_recording)?;
    let (header, name) = (reader.header(), game.name());
    let recorded = games.of_file(Artifact::Recording, path, &header.game)?.name();
    if recorded != name {
        return Err(CliError::Usage(format!(
            "{0}: a recording of the game `{recorded}`, not of `{name}`: look at it with \
             `playbot view {recorded} --demo {0}`",
            path.display()
        )));
    }
    match header.check_game(name, game.version(), None) {
        Ok(()) => Ok(reader),
        Err(fault) => Err(DemoFileError { path: path.into(), fault }.into()),
    }
}

/// Returns true if this build has the sensor for the camera of a game.
fn can_look_through_camera(game: &dyn Game) -> bool {
    ObservationConfig { kind: ObservationKind::Camera, ..ObservationConfig::default() }.check(game).is_ok()
}

/// Returns the form of the pictures: the policy's, or the requested one, or else the game's. Numbers for a game without
/// pictures.
fn observation_config(
    game: &dyn Game,
    args: &Args,
    chosen: Option<&LoadedPlayer>,
) -> Result<ObservationConfig, CliError> {
    let own = chosen.map(|chosen| chosen.observation_config).filter(ObservationConfig::is_image);
    let is_asked_for = !args.image.is_empty();
    let kind = if game.tools().pictures.picture().is_some() || is_asked_for && !game.tools().pictures.has_camera() {
        ObservationKind::Raster
    } else if game.tools().pictures.has_camera() && (is_asked_for || can_look_through_camera(game)) {
        ObservationKind::Camera
    } else {
        ObservationKind::Vector
    };
    let mut observation_config = own.unwrap_or(ObservationConfig { kind, ..ObservationConfig::default() });
    if args.camera {
        observation_config.kind = ObservationKind::Camera;
    }
    set(&mut observation_config.image, &args.image)?;
    observation_config.check(game)?;
    if let (Some(own), Some(Player::Policy { policy, .. })) = (own, chosen.map(|chosen| &chosen.player))
        && observation_config.image != own.image
    {
        return Err(CliError::Usage(format!(
            "the policy reads {own} ({}); it cannot play with {observation_config}: leave out --image",
            policy.observation().describe()
        )));
    }
    Ok(observation_config)
}

fn episode(reader: DemoReader, path: &Path, number: usize) -> Result<DemoEpisode, CliError> {
    for (index, episode) in reader.enumerate() {
        let episode = episode?;
        if index == number {
            return Ok(episode);
        }
    }
    Err(CliError::Usage(format!(
        "{} has no episode {number}; `playbot demo show {0}` lists those it has",
        path.display()
    )))
}

/// Plays until the requested tick, or to the end; `None` after Ctrl-C before that tick.
fn play(episode_world: &mut EpisodeWorld, args: &Args) -> Result<Option<(Vec<EpisodeStep>, Reach)>, CliError> {
    interrupt::listen();
    let bar = progress::bar("play", 0, "ticks");
    let (mut steps, mut reach, mut kept) = (Vec::new(), Reach::default(), 0);
    while let Some(step) = episode_world.next()? {
        bar.set_length(u64::from(step.tick) + 1);
        bar.set_position(u64::from(step.tick) + 1);
        reach.include(&step.vector);
        if args.episode {
            kept += step.image.len() + size_of_val(step.vector.as_slice());
            if kept > MOST_BYTES {
                return Err(CliError::Usage(format!(
                    "the pictures of {} ticks take more than {} MiB of memory: try smaller pictures, or a shorter stack",
                    step.tick,
                    MOST_BYTES >> 20
                )));
            }
            steps.push(step);
        } else if step.tick == args.tick {
            steps.push(step);
            break;
        }
        if interrupt::asked() {
            break;
        }
    }
    bar.finish_and_clear();
    if steps.is_empty() && interrupt::asked() {
        return Ok(None);
    }
    if steps.is_empty() {
        let ticks = episode_world.ticks();
        return Err(CliError::Usage(format!("there is no tick {}: the episode has {ticks} ticks, from 0", args.tick)));
    }
    Ok(Some((steps, reach)))
}

// The form of the pictures, from the command line.

const KEYS: [&str; 5] = ["width", "height", "stack", "grayscale", "paint_velocity"];

/// Applies a `key=value`; a switch without a value is on.
///
/// # Errors
///
/// An unknown key, or a value that does not fit.
pub(crate) fn set(options: &mut ImageOptions, changes: &[String]) -> Result<(), CliError> {
    for change in changes {
        let (key, value) = change.split_once('=').unwrap_or((change, "true"));
        match key {
            "width" => options.width = number(key, value)?,
            "height" => options.height = number(key, value)?,
            "stack" => options.stack = number(key, value)?,
            "grayscale" => options.grayscale = switch(key, value)?,
            "paint_velocity" => options.paint_velocity = switch(key, value)?,
            _ => return Err(UnknownName::new("image option", key, &KEYS).into()),
        }
    }
    Ok(())
}

fn number(key: &str, value: &str) -> Result<u32, CliError> {
    value.parse().map_err(|_| CliError::Usage(format!("--image {key} must be a whole number, not {value}")))
}

fn switch(key: &str, value: &str) -> Result<bool, CliError> {
    value.parse().map_err(|_| CliError::Usage(format!("--image {key} must be true or false, not {value}")))
}

// The picture of a view, as a file.

/// A written picture and its contents.
pub struct WrittenPicture<'a> {
    /// The file.
    pub path: &'a Path,
    /// The game.
    pub game: &'a dyn Game,
    /// Mode that was played.
    pub mode: &'a str,
    /// The mode was named on the command line.
    pub is_mode_named: bool,
    /// Level that was played.
    pub level: u64,
    /// Name of the player.
    pub player: &'a str,
    /// The recording, if one was shown.
    pub demo: Option<&'a Path>,
    /// The shown tick; `None` for a whole episode.
    pub tick: Option<u32>,
    /// Number of pictures.
    pub frames: usize,
    /// Length of the file.
    pub bytes: usize,
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Ticks that were played.
    pub ticks: u32,
    /// The end of the episode, if it ended.
    pub end: Option<EpisodeEnded>,
    /// The first difference of a recording from the game.
    pub divergence: Option<&'a Divergence>,
}

impl WrittenPicture<'_> {
    /// Prints it: as a line of JSON on standard output, or as text.
    ///
    /// # Errors
    ///
    /// Standard output is closed.
    pub fn print(&self, as_json: bool) -> Result<(), CliError> {
        if !as_json {
            report!("{}", self.sentence());
            return Ok(());
        }
        let [width, height] = self.size;
        print_line(json!({
            "path": self.path.display().to_string(), "bytes": self.bytes, "width": width, "height": height,
            "frames": self.frames, "ticks": self.ticks, "end": self.end.map(|ended| ended.end), "player": self.player,
            "game": self.game.name(), "mode": self.mode, "level": self.level,
            "divergence": self.divergence.map(ToString::to_string),
        }))
    }

    fn sentence(&self) -> String {
        let what = match self.tick {
            Some(tick) => format!("tick {tick}"),
            None => counted(self.frames as u64, "frame"),
        };
        let who = match self.demo {
            Some(demo) => format!("as recorded in {}", demo.display()),
            None => format!("played by {}", self.player),
        };
        let modes = self.game.modes();
        let choice = if self.is_mode_named || modes.len() < 2 {
            String::new()
        } else {
            format!(" (no --mode was named; the game has {})", modes.join(", "))
        };
        let [width, height] = self.size;
        format!(
            "{} shows {what} of level {} of {} in mode {}{choice}, {who}, on {width} × {height} pixels; after {} the \
             episode {}",
            self.path.display(),
            self.level,
            self.game.name(),
            self.mode,
            counted(self.ticks.into(), "tick"),
            self.end.map_or("was still running", describe_end),
        )
    }
}

/// Describes the end of an episode, after "the episode".
fn describe_end(ended: EpisodeEnded) -> &'static str {
    match ended.end {
        EpisodeEnd::Terminated { success: true } => "was won",
        EpisodeEnd::Terminated { success: false } => "was lost",
        EpisodeEnd::Truncated if ended.success => "ran out of time, with the goal reached",
        EpisodeEnd::Truncated => "ran out of time",
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;
    use playbot_harness::foreign::ForeignGame;

    use super::*;

    #[test]
    fn a_sentence_says_what_is_seen_of_whom_and_how_it_went() {
        let game = ForeignGame::new("runner", 1, |_: &mut App| {});
        let still = WrittenPicture {
            path: Path::new("view.png"),
            game: &game,
            mode: "default",
            is_mode_named: false,
            level: 5,
            player: "walker",
            demo: None,
            tick: Some(0),
            frames: 1,
            bytes: 100,
            size: [64, 48],
            ticks: 1,
            end: None,
            divergence: None,
        };
        let words = "view.png shows tick 0 of level 5 of runner in mode default, played by walker, on 64 × 48 pixels; \
                     after 1 tick the episode was still running";
        assert_eq!(still.sentence(), words);
        let film = WrittenPicture { demo: Some(Path::new("a.demo")), tick: None, frames: 2, ticks: 2, ..still };
        let words = "view.png shows 2 frames of level 5 of runner in mode default, as recorded in a.demo, on 64 × 48 \
                     pixels; after 2 ticks the episode was still running";
        assert_eq!(film.sentence(), words);
    }
}
