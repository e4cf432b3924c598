//! `playbot eyes`: the camera's and the raster's pictures, compared side by side.

use crate::{
    arguments::{check_start, finite_number, first_levels, player::LoadedPlayer},
    error::{CliError, Outcome},
    output,
    output::{print_line, program},
    pictures::{Screen, to_png},
    progress,
};
use bevy::prelude::*;
use bevy_playbot::{
    engine::{CLOSE, PictureDifference, tick_world},
    vision::{Frame, ImageOptions, ObservationConfig, ObservationKind},
};
use playbot_harness::{game::Game, games::Games, prelude::*, worlds::build_observing_world};
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Compare the pictures of the camera and of the raster.
///
/// Both show the same ticks. A policy that is trained on one should not notice that it plays with the other.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot eyes GAME
  playbot eyes GAME --levels MODE:0..49 --frames 10 --out eyes --json

Exit code 1 if the pictures are further apart than --most-mean and --least-close allow. Needs the feature `camera`, and a
game that the raster can draw.")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included (default: levels 0 to 49 of the mode that `train` trains in). The
    /// game's demonstrator, or else the first of its bots, plays each once.
    #[arg(long, visible_alias = "level")]
    levels: Option<LevelSplit>,
    /// Frames to compare on each level, spread over the episode.
    #[arg(long, default_value_t = 10)]
    frames: usize,
    /// Width and height of the pictures, pixels.
    #[arg(long, default_value_t = 64)]
    size: u32,
    /// Largest allowed mean absolute difference over all frames, of 255.
    #[arg(long, default_value_t = 4.0, value_parser = finite_number)]
    most_mean: f64,
    /// Smallest allowed share of pixels whose colours are all within 8 of 255.
    #[arg(long, default_value_t = 0.97, value_parser = finite_number)]
    least_close: f64,
    /// Folder for table.md, results.json and worst.png (raster, camera, and their difference four times as strong).
    #[arg(long)]
    out: Option<PathBuf>,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
}

/// The last of the default levels, which begin with 0.
const LAST_LEVEL: u64 = 49;

/// Factor by which the worst frame is enlarged.
const ENLARGE: usize = 5;

/// Pixels between two pictures.
const GAP: usize = 8;

/// A compared frame.
#[derive(Clone, Serialize)]
struct Compared {
    level: u64,
    /// Tick of the episode, from 0.
    tick: u32,
    #[serde(flatten)]
    difference: PictureDifference,
    #[serde(skip)]
    pictures: [Vec<[u8; 4]>; 2],
}

/// The comparison of both sensors.
#[derive(Serialize)]
struct Summary {
    game: &'static str,
    levels: String,
    frames: usize,
    /// Mean absolute difference of 255.
    mean: f64,
    /// Share of pixels within [`CLOSE`].
    close: f64,
    worst: Compared,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    check_picture(game)?;
    let levels = args.levels.clone().unwrap_or_else(|| first_levels(game, LAST_LEVEL));
    levels.check(game)?;
    if args.frames == 0 {
        return Err(CliError::Usage("--frames is 0: compare at least one frame a level".to_owned()));
    }
    check_start(game, &levels.mode, levels.first)?;
    let compared = compare(game, &levels, &args)?;
    let summary = sum_up(game, &levels, &compared)?;
    if let Some(folder) = &args.out {
        write_report(folder, &summary, &args)?;
    }
    if args.json {
        print_line(json!(summary))?;
    } else {
        print_line(table(&summary))?;
    }
    let alike = summary.mean <= args.most_mean && summary.close >= args.least_close;
    Ok(if alike { Outcome::Pass } else { Outcome::Findings })
}

/// Checks that the game has a picture for the raster; a camera of its own is not enough.
fn check_picture(game: &dyn Game) -> Result<(), CliError> {
    if game.tools().pictures.picture().is_some() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "`{0}` cannot be drawn by the raster, so there is nothing to compare; `playbot view {0}` shows its observation",
        game.name()
    )))
}

/// Plays one World for each sensor alike; every frame of both is kept until its level is over.
fn compare(game: &dyn Game, levels: &LevelSplit, args: &Args) -> Result<Vec<Compared>, CliError> {
    let mut raster = SensorWorld::new(game, levels, args.size, ObservationKind::Raster)?;
    let mut camera = SensorWorld::new(game, levels, args.size, ObservationKind::Camera)?;
    let bar = progress::bar("comparing", levels.len(), "levels");
    let (mut compared, mut level): (Vec<Compared>, Vec<Compared>) = (Vec::new(), Vec::new());
    while let (Some(by_raster), Some(by_camera)) = (raster.tick()?, camera.tick()?) {
        if (by_raster.level, by_raster.tick) != (by_camera.level, by_camera.tick) {
            return Err(CliError::Io(format!(
                "the two games went apart on level {}, tick {}: play them by a bot that draws no random numbers of its own",
                by_raster.level, by_raster.tick
            )));
        }
        if level.last().is_some_and(|last| last.level != by_raster.level) {
            bar.inc(1);
            spread(&mut compared, &mut level, args.frames);
        }
        let difference = PictureDifference::between(&by_raster.pixels, &by_camera.pixels)
            .ok_or_else(|| CliError::Io("the pictures of the two sensors differ in size".to_owned()))?;
        let pictures = [by_raster.pixels, by_camera.pixels];
        level.push(Compared { level: by_raster.level, tick: by_raster.tick, difference, pictures });
    }
    spread(&mut compared, &mut level, args.frames);
    bar.finish_and_clear();
    Ok(compared)
}

/// Moves `count` of a level's frames over, evenly spread from its first to its last, or all if there are fewer.
fn spread(to: &mut Vec<Compared>, level: &mut Vec<Compared>, count: usize) {
    let all = level.len();
    let wanted: Vec<_> = (0..count.min(all)).map(|i| i * all / count.min(all)).collect();
    to.extend(level.drain(..).enumerate().filter(|(at, _)| wanted.contains(at)).map(|(_, frame)| frame));
}

/// A picture with its tick.
struct Seen {
    level: u64,
    /// Tick of the episode, from 0, that began with it, counted as by `playbot view --tick`.
    tick: u32,
    pixels: Vec<[u8; 4]>,
}

/// A World with one agent that plays the levels in turn.
struct SensorWorld {
    world: World,
    agent: Entity,
}

impl SensorWorld {
    fn new(game: &dyn Game, levels: &LevelSplit, size: u32, kind: ObservationKind) -> Result<Self, CliError> {
        let observation_config =
            ObservationConfig { kind, image: ImageOptions { width: size, height: size, ..default() } };
        let (mut world, agents) = build_observing_world(game, &levels.mode, &observation_config, 1, 0, 1)?;
        let agent = agents[0];
        let control = LoadedPlayer::default_of(game)?.player.seat(game, &mut world, agent);
        world.entity_mut(agent).insert((control, LevelQueue::list(levels.levels().collect::<Vec<_>>())));
        Ok(Self { world, agent })
    }

    /// Plays a tick and returns the picture that it began with; `None` when all levels have been played.
    fn tick(&mut self) -> Result<Option<Seen>, CliError> {
        tick_world(&mut self.world)?;
        if !Control::of(&self.world, self.agent).is_active() {
            return Ok(None);
        }
        let episode = self.world.get::<Episode>(self.agent).expect("required by Agent");
        let frame = self.world.get::<Frame>(self.agent).expect("required by sensors");
        // The tick has been counted since.
        let tick = episode.tick.saturating_sub(1);
        Ok(Some(Seen { level: episode.level, tick, pixels: frame.pixels.clone() }))
    }
}

fn sum_up(game: &dyn Game, levels: &LevelSplit, compared: &[Compared]) -> Result<Summary, CliError> {
    let worst = compared.iter().max_by(|a, b| a.difference.mean.total_cmp(&b.difference.mean));
    let Some(worst) = worst else {
        return Err(CliError::Usage("no frame was seen on these levels".to_owned()));
    };
    let mean = |value: fn(&PictureDifference) -> f64| {
        compared.iter().map(|frame| value(&frame.difference)).sum::<f64>() / compared.len() as f64
    };
    Ok(Summary {
        game: game.name(),
        levels: levels.to_string(),
        frames: compared.len(),
        mean: mean(|difference| difference.mean),
        close: mean(|difference| difference.close),
        worst: worst.clone(),
    })
}

fn table(summary: &Summary) -> String {
    let (worst, close) = (&summary.worst, 100.0 * summary.close);
    format!(
        "| | all {} frames of {} | worst: level {}, tick {} |\n|---|---|---|\n\
         | mean absolute difference, of 255 | {:.3} | {:.3} |\n| pixels within {CLOSE} | {close:.2} % | {:.2} % |",
        summary.frames,
        summary.levels,
        worst.level,
        worst.tick,
        summary.mean,
        worst.difference.mean,
        100.0 * worst.difference.close,
    )
}

fn write_report(folder: &Path, summary: &Summary, args: &Args) -> Result<(), CliError> {
    let side = args.size as usize;
    let [raster, camera] = &summary.worst.pictures;
    let apart: Vec<[u8; 4]> = raster
        .iter()
        .zip(camera)
        .map(|(a, b)| {
            let [r, g, b] = [0, 1, 2].map(|colour| a[colour].abs_diff(b[colour]).saturating_mul(4));
            [r, g, b, 255]
        })
        .collect();
    let step = side * ENLARGE + GAP;
    let mut screen = Screen::new(3 * step - GAP, side * ENLARGE, [255; 3])?;
    for (place, picture) in [raster, camera, &apart].into_iter().enumerate() {
        screen.frame(picture, side, ENLARGE, (place * step, 0));
    }
    let text = format!(
        "# Camera and raster, {}\n\n{}\n\nThe worst frame, by the raster, by the camera, and their difference times \
         four:\n\n![the worst frame](worst.png)\n\n```sh\n{} eyes {} --levels {} --frames {} --out {}\n```\n",
        summary.game,
        table(summary),
        program::name(),
        summary.game,
        summary.levels,
        args.frames,
        folder.display(),
    );
    let json = format!("{}\n", json!(summary));
    for (name, bytes) in
        [("worst.png", to_png(&screen)?), ("table.md", text.into_bytes()), ("results.json", json.into_bytes())]
    {
        output::write(&folder.join(name), &bytes)?;
    }
    Ok(())
}
