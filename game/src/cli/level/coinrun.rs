//! `playbot level coinrun`.

use bevy::prelude::*;
use bevy_playbot::{
    game::{Game, build_seeing_world},
    prelude::*,
    raster::RasterSensor,
    vision::{ImageOptions, ObservationKind, Sight},
};
use serde_json::json;

use super::Args;
use crate::{
    cli::{
        error::{CliError, Outcome, print_line},
        output,
        view::{self, film::Film},
    },
    coinrun::{Level, Mode, components::PlaysIn, generate},
    registry,
};

const LEGEND: &str =
    "A start  C coin  # = ground  ~ ^ lava  S saw  < > enemy and where it goes  x crate  | enemies turn here";

/// Shows a level of CoinRun.
pub fn show(args: &Args) -> Result<Outcome, CliError> {
    if args.map.is_some() {
        return Err(CliError::Usage("CoinRun has no maps: name a --mode and a --seed".to_owned()));
    }
    if let Some(path) = &args.png {
        output::png(&path.to_string_lossy()).map_err(|why| CliError::Usage(format!("{}: {why}", path.display())))?;
    }
    let game = registry::game("coinrun")?;
    let mode = args.mode.as_deref().unwrap_or("hard");
    game.check_mode(mode)?;
    let mode: Mode = mode.parse().map_err(|error| CliError::Usage(format!("{error}")))?;
    let seed = u32::try_from(args.seed.unwrap_or(0))
        .map_err(|_| CliError::Usage("CoinRun's seeds have 32 bits: choose one up to 4294967295".to_owned()))?;
    let level = generate(mode, seed);
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
    Ok(Film::new(image, 1, game.tick_hz())?.still(&seen.image)?.0)
}
