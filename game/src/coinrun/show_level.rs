//! A level of CoinRun as text, as JSON, and as a picture of the whole of it.

use crate::coinrun::{
    Level, Spawn,
    components::{PlaysIn, level_of},
    rules::Body,
};
use bevy::{
    math::{Rect, Vec2},
    prelude::*,
};
use bevy_playbot::{
    raster::RasterSensor,
    vision::{ImageOptions, ObservationConfig, ObservationKind},
};
use playbot_harness::{
    floor_plan::{FloorPlan, joined_tiles},
    inspect::{InspectError, LevelPicture, LevelRequest, LevelView},
    level_files::{LevelDesign, LevelDesigns},
    prelude::*,
    worlds::build_observing_world,
};
use std::sync::Arc;

const LEGEND: &str =
    "A start  C coin  # = ground  ~ ^ lava  S saw  < > enemy and its direction  x crate  | enemies turn here";

/// Shows a level.
pub(crate) fn show(game: &dyn Game, request: &LevelRequest) -> Result<LevelView, InspectError> {
    if request.map.is_some() {
        return Err(InspectError::Usage("CoinRun has no maps: name a --mode and a --level".to_owned()));
    }
    let level = match request.file {
        Some(path) => {
            let designs = LevelDesigns::of_file(&path.to_string_lossy(), &|text| game.parse_level(text));
            designs.map_err(|error| InspectError::Usage(error.to_string()))?.get(0)
        }
        None => {
            let mode = request.mode.unwrap_or("hard");
            game.check_mode(mode)?;
            level_of(game, mode, request.level.unwrap_or(0))
        }
    };
    let level = level.map_err(InspectError::Usage)?;
    Ok(LevelView {
        text: format!("{}\n{LEGEND}", level.to_text()),
        json: serde_json::json!(level.to_level_text()).to_string(),
        lacks_plan: false,
        picture: request.picture.then(|| draw(game, level)).transpose()?,
    })
}

/// Pixels of a tile in the picture of a level.
const TILE: u32 = 16;

/// Draws the used part of a level, as an agent with a view of all of it would see it.
fn draw(game: &dyn Game, level: Arc<Level>) -> Result<LevelPicture, InspectError> {
    let [columns, rows] = level.used_size().map(i32::unsigned_abs);
    let image = ImageOptions { width: columns * TILE, height: rows * TILE, ..ImageOptions::default() };
    let config = ObservationConfig { kind: ObservationKind::Raster, image };
    let (mut world, agents) = build_observing_world(game, "hard", &config, 0, 0, 1)?;
    world.insert_resource(LevelDesigns::one("the level", LevelDesign::new(Arc::unwrap_or_clone(level), "")));
    let (agent, (width, height)) = (agents[0], (columns as f32, rows as f32));
    let arena = world.get::<PlaysIn>(agent).expect("every player has an arena").0;
    let centre = world.spawn((ChildOf(arena), Transform::from_xyz(width / 2.0, height / 2.0, 0.0))).id();
    world.entity_mut(agent).insert((RasterSensor { target: centre, width }, Control::Human, LevelQueue::Always(0)));
    world.tick()?;
    let seen = world.get::<Observation>(agent).expect("required by Agent");
    Ok(LevelPicture::Pixels { image, pixels: seen.image.clone() })
}

impl Level {
    /// Returns the used part of the level, from the side, in tiles: ground, lava and saws, crates. Enemies walk about,
    /// so they are left out.
    pub fn floor_plan(&self) -> FloorPlan {
        let [columns, rows] = self.used_size().map(|tiles| tiles.unsigned_abs() as usize);
        let square = |row: usize, column: usize| {
            let corner = Vec2::new(column as f32, row as f32);
            Rect::from_corners(corner, corner + 1.0)
        };
        let is_wall = |row: usize, column: usize| self.tiles.get(column as i32, row as i32).is_wall();
        let (player, [x, y]) = (Body::player(), self.coin);
        let ends = [Vec2::new(player.x, player.y), Vec2::new(x as f32 + 0.5, y as f32 + 0.5)];
        let is_lava = |row: usize, column: usize| self.tiles.get(column as i32, row as i32).is_lava();
        let at = |[x, y]: [i32; 2]| square(y as usize, x as usize);
        let mut hazards = joined_tiles([rows, columns], is_lava, square);
        let mut platforms = Vec::new();
        for spawn in self.spawns.iter().copied() {
            match spawn {
                Spawn::Saw(cell) => hazards.push(at(cell)),
                Spawn::Crate { cell, .. } => platforms.push(at(cell)),
                Spawn::Enemy { .. } => {}
            }
        }
        FloorPlan { hazards, platforms, ..FloorPlan::of_tiles([rows, columns], is_wall, square, ends) }
    }
}
