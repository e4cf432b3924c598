//! `playbot level`.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_playbot::{
    game::{Game, build_seeing_world},
    prelude::*,
    raster::RasterSensor,
    vision::{ImageOptions, ObservationKind, Sight},
};
use serde_json::json;

use super::{
    error::{CliError, Outcome, print_line},
    view::{self, film::Film},
};
use crate::{
    coinrun::{Level, Mode, components::PlaysIn, generate},
    registry,
};

/// Shows the layout of a level.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  playbot level coinrun --mode hard --seed 7\n  playbot level coinrun --mode easy --seed 0 --json\n  playbot level coinrun --seed 7 --png level.png"
)]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game.
    #[arg(long, default_value = "hard")]
    mode: String,
    /// Seed of the level.
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Print one line of JSON instead of a picture.
    #[arg(long)]
    json: bool,
    /// Also draw the whole level, 16 pixels to the tile, into this file.
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
}

const LEGEND: &str =
    "A start  C coin  # = ground  ~ ^ lava  S saw  < > enemy and where it goes  x crate  | enemies turn here";

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let game = registry::game(&args.game)?;
    game.check_mode(&args.mode)?;
    let mode: Mode = args.mode.parse().map_err(|error| CliError::Usage(format!("{error}")))?;
    let level = generate(mode, args.seed);
    if let Some(path) = &args.png {
        view::write(path, &draw(game, &level)?)?;
    }
    if args.json {
        print_line(json!(level.to_golden_json()))?;
    } else {
        print_line(level.to_text())?;
        print_line(LEGEND)?;
    }
    Ok(Outcome::Pass)
}

/// Pixels of a tile in the picture of a level.
const TILE: u32 = 16;

/// The used part of a level as a PNG: what an agent would see that sees all of it.
fn draw(game: &dyn Game, level: &Level) -> Result<Vec<u8>, CliError> {
    let [columns, rows] = level.used_size().map(i32::unsigned_abs);
    let image = ImageOptions { width: columns * TILE, height: rows * TILE, ..ImageOptions::default() };
    let sight = Sight { kind: ObservationKind::Raster, image };
    let (mut world, agents) = build_seeing_world(game, level.mode.name(), &sight, 0, 0, 1)?;
    let (agent, (width, height)) = (agents[0], (columns as f32, rows as f32));
    let arena = world.get::<PlaysIn>(agent).expect("every player has an arena").0;
    let centre = world.spawn((ChildOf(arena), Transform::from_xyz(width / 2.0, height / 2.0, 0.0))).id();
    let seed = LevelQueue::Always(level.seed.into());
    world.entity_mut(agent).insert((RasterSensor { target: centre, width }, Control::Human, seed));
    world.tick()?;
    let seen = world.get::<Observation>(agent).expect("required by Agent");
    Ok(Film::new(image, 1, game.tick_hz()).still(&seen.image)?.0)
}
