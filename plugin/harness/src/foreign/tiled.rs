//! Levels that are drawn with Tiled.

use crate::foreign::{
    ForeignGame,
    levels::{EditorLevel, MapLegend, asset_folder},
};
use bevy::math::Vec2;
use bevy_playbot::state_hash::StateHash;
use std::{
    collections::BTreeSet,
    fmt::Write,
    path::{Path, PathBuf},
};
use tiled::{Layer, LayerType, Loader, Map, Object, ObjectShape, Orientation, TileLayer};

impl ForeignGame {
    /// Takes the maps of a pattern that are drawn with Tiled, in the order of their paths, for a game that loads them with
    /// `bevy_ecs_tiled` or by itself. The game finds the level that is played as the resource [`EditorLevel`]. A
    /// [`level`](Self::level) system passes it on: `assets.load(&level.file)`.
    ///
    /// The pattern is that of [`level_files`](Self::level_files), such as `maps/*.tmx`, in the folder `assets`. Otherwise
    /// it is looked for below the current folder. The legend names the layers or the classes of tiles that are walls in
    /// plans, and the objects at the start and at the goal. Plans have (0, 0) in the lower left corner of their map.
    ///
    /// Maps that cannot be read are a [`problem`](crate::game::Game::problem) of the game: no map at all, missing files
    /// of tiles, a map without the start, and two maps of the same name. Infinite and slanted maps have no plan, so that
    /// they are refused.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, MapLegend}, prelude::*};
    ///
    /// let legend = MapLegend::default().walls(["Walls"]).start("player").goal("exit");
    /// let game = ForeignGame::new("cellar", 1, |_: &mut App| {}).tiled("no/such/*.tmx", legend);
    /// let problem = game.keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]).problem();
    /// assert!(problem.is_some_and(|problem| problem.contains("no/such/*.tmx")));
    /// ```
    pub fn tiled(self, pattern: impl AsRef<str>, legend: MapLegend) -> Self {
        self.editor_levels(read(pattern.as_ref(), &legend))
    }
}

/// Reads all maps of a pattern.
fn read(pattern: &str, legend: &MapLegend) -> Result<Vec<EditorLevel>, String> {
    let assets = asset_folder();
    let mut files = find(&Path::new(&glob::Pattern::escape(&assets.to_string_lossy())).join(pattern), pattern)?;
    if files.is_empty() {
        files = find(Path::new(pattern), pattern)?;
    }
    if files.is_empty() {
        return Err(format!(
            "no file matches {pattern}: name maps of Tiled below `assets`, or below the current folder"
        ));
    }
    let (mut names, mut levels) = (BTreeSet::new(), Vec::with_capacity(files.len()));
    let mut loader = Loader::new();
    for file in files {
        let shown = file.strip_prefix(&assets).unwrap_or(&file).to_string_lossy().replace('\\', "/");
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let map = loader.load_tmx_map(&file).map_err(|error| {
            format!("{shown} is no map that can be read: {error}; save it with Tiled as .tmx, its tiles as CSV or zlib")
        })?;
        if !names.insert(name.clone()) {
            return Err(format!("{shown}: another map has the name `{name}`: rename one of the files"));
        }
        check(&map).map_err(|why| format!("{shown}: {why}"))?;
        let drawn = draw(&map, &name, legend).map_err(|why| format!("{shown}: {why}"))?;
        levels.push(EditorLevel { file: shown, ..drawn });
    }
    Ok(levels)
}

/// Returns the files that match a pattern, in the order of their paths.
fn find(pattern: &Path, shown: &str) -> Result<Vec<PathBuf>, String> {
    let paths = glob::glob(&pattern.to_string_lossy())
        .map_err(|error| format!("the pattern {shown} is invalid: {}; write one such as maps/*.tmx", error.msg))?;
    let mut files: Vec<PathBuf> = paths.filter_map(Result::ok).filter(|path| path.is_file()).collect();
    // The order of file systems differs.
    files.sort_unstable();
    Ok(files)
}

/// Checks that a map has a plan, and that the pictures of its tiles exist.
fn check(map: &Map) -> Result<(), String> {
    if map.infinite() {
        return Err("an infinite map has no bounds: clear `Infinite` in the properties of the map".to_owned());
    }
    if map.orientation != Orientation::Orthogonal {
        return Err(format!("its orientation is {}, and plans are of orthogonal maps", map.orientation));
    }
    if [map.width, map.height, map.tile_width, map.tile_height].contains(&0) {
        return Err("it has no cells: give it a width and a height in Tiled".to_owned());
    }
    for tiles in map.tilesets() {
        let own = tiles.image.iter();
        let others = tiles.tiles().filter_map(|(_, tile)| tile.image.clone());
        let mut pictures = own.cloned().chain(others).map(|image| image.source);
        if let Some(missing) = pictures.find(|source| !source.is_file()) {
            let picture = missing.file_name().unwrap_or_default().to_string_lossy();
            return Err(format!(
                "the tileset `{}` is in {picture}, which does not exist in its folder: add the file, or choose another \
                 in Tiled",
                tiles.name
            ));
        }
    }
    Ok(())
}

/// Draws a level from its layers.
fn draw(map: &Map, name: &str, legend: &MapLegend) -> Result<EditorLevel, String> {
    let layers = layers_of(map);
    check_legend(map, &layers, legend)?;
    let cell = Vec2::new(map.tile_width as f32, map.tile_height as f32);
    let grids = || layers.iter().filter_map(|layer| Some((layer, layer.as_tile_layer()?)));
    let letter = |row: u32, column: u32| {
        let letters = grids().map(|(layer, tiles)| letter(layer, &tiles, [column, row], legend));
        let rank = |letter: &char| ["#", "^"].iter().position(|first| first.starts_with(*letter)).unwrap_or(2);
        letters.min_by_key(rank).unwrap_or('.')
    };
    let rows = (0..map.height).map(|row| (0..map.width).map(|column| letter(row, column)).collect()).collect();
    let mut content = format!("{} {} {cell}", map.width, map.height);
    // Writing into a string cannot fail.
    for (layer, tiles) in grids() {
        let _ = write!(content, "\n{}", layer.name);
        for at in (0..map.height as i32).flat_map(|row| (0..map.width as i32).map(move |column| [column, row])) {
            if let Some(tile) = tiles.get_tile(at[0], at[1]) {
                let _ = write!(content, " {},{}:{}:{}", at[0], at[1], tile.tileset_index(), tile.id());
            }
        }
    }
    let objects: Vec<Object> =
        layers.iter().filter_map(|layer| layer.as_object_layer()).flat_map(|layer| layer.objects()).collect();
    for object in &objects {
        let _ = write!(content, "\n{} {} {} {}", object.name, object.user_type, object.x, object.y);
        let mut properties: Vec<String> =
            object.properties.iter().map(|(name, value)| format!("{name}={value:?}")).collect();
        // Their order is that of a hash map.
        properties.sort_unstable();
        content.extend(properties);
    }
    let things: Vec<(Vec<&str>, Vec2)> = objects.iter().map(thing).collect();
    let drawn = legend.level(name, rows, cell, &things)?;
    Ok(EditorLevel { layout: StateHash::of(content.bytes().map(u64::from)).0, ..drawn })
}

/// Returns all layers of a map, with those of groups.
fn layers_of(map: &Map) -> Vec<Layer<'_>> {
    let (mut found, mut open) = (Vec::new(), map.layers().collect::<Vec<_>>());
    open.reverse();
    while let Some(layer) = open.pop() {
        if let LayerType::Group(group) = layer.layer_type() {
            let inner: Vec<_> = group.layers().collect();
            open.extend(inner.into_iter().rev());
        } else {
            found.push(layer);
        }
    }
    found
}

/// Checks that the map has all that the legend names as walls or hazards. A map may do without a class of tiles.
fn check_legend(map: &Map, layers: &[Layer], legend: &MapLegend) -> Result<(), String> {
    let tile_layers = layers.iter().filter(|layer| layer.as_tile_layer().is_some());
    let mut names: BTreeSet<String> = tile_layers.map(|layer| layer.name.clone()).collect();
    for tiles in map.tilesets() {
        names.extend(tiles.tiles().map(|(_, tile)| tile.user_type.clone()));
    }
    names.remove("");
    match legend.walls.iter().chain(&legend.hazards).find(|name| !names.contains(*name)) {
        None => Ok(()),
        Some(missing) => {
            let names: Vec<String> = names.into_iter().collect();
            Err(format!(
                "it has no layer of tiles, and no class of tiles, with the name `{missing}`: there are {}",
                if names.is_empty() { "none".to_owned() } else { names.join(", ") }
            ))
        }
    }
}

/// Returns the letter of a cell in a layer of tiles: `.` for none, and for tiles without a meaning.
fn letter(layer: &Layer, tiles: &TileLayer, [column, row]: [u32; 2], legend: &MapLegend) -> char {
    let Some(tile) = tiles.get_tile(column as i32, row as i32) else { return '.' };
    let class = tile.get_tile().map(|tile| tile.user_type.clone()).unwrap_or_default();
    let is_one =
        |names: &[String]| names.iter().any(|name| *name == layer.name || (*name == class && !class.is_empty()));
    match (is_one(&legend.walls), is_one(&legend.hazards)) {
        (true, _) => '#',
        (false, true) => '^',
        (false, false) => '.',
    }
}

/// Returns the names of an object, and its middle.
fn thing<'a>(object: &'a Object) -> (Vec<&'a str>, Vec2) {
    let names = [object.name.as_str(), object.user_type.as_str()].into_iter().filter(|name| !name.is_empty());
    let size = match object.shape {
        ObjectShape::Rect { width, height } | ObjectShape::Ellipse { width, height } => Vec2::new(width, height),
        _ => Vec2::ZERO,
    };
    // An object with a tile stands on its position; others hang from it.
    let up = if object.tile_data().is_some() { -1.0 } else { 1.0 };
    (names.collect(), Vec2::new(object.x + size.x / 2.0, object.y + up * size.y / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use bevy::prelude::*;
    use std::fs;
    use tempfile::TempDir;

    /// A map of 3 × 2 cells: a wall above a pit, the player at the left end of the lower row, and an exit at its right.
    const MAP: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<map version="1.10" orientation="orthogonal" width="3" height="2" tilewidth="16" tileheight="16" infinite="0">
 <tileset firstgid="1" name="stones" tilewidth="16" tileheight="16" tilecount="2" columns="2">
  <image source="stones.png" width="32" height="16"/>
  <tile id="1" type="pit"/>
 </tileset>
 <layer id="1" name="Ground" width="3" height="2"><data encoding="csv">0,1,0,0,2,0</data></layer>
 <group id="2" name="Deep">
  <layer id="3" name="Walls" width="3" height="2"><data encoding="csv">0,1,0,0,0,0</data></layer>
 </group>
 <objectgroup id="4" name="Things">
  <object id="1" name="player" x="8" y="24"><point/></object>
  <object id="2" type="exit" x="32" y="16" width="16" height="16"/>
 </objectgroup>
</map>
"#;

    fn legend() -> MapLegend {
        MapLegend::default().walls(["Walls"]).hazards(["pit"]).start("player").goal("exit")
    }

    /// Returns a folder with these maps and the picture of their tiles.
    fn saved(maps: &[(&str, &str)]) -> (TempDir, String) {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("stones.png"), "a picture").expect("writable");
        for (name, map) in maps {
            fs::write(folder.path().join(name), map).expect("writable");
        }
        let pattern = format!("{}/*.tmx", glob::Pattern::escape(&folder.path().to_string_lossy()));
        (folder, pattern)
    }

    #[track_caller]
    fn assert_error(map: &str, parts: &[&str]) {
        let (_folder, pattern) = saved(&[("hall.tmx", map)]);
        let error = read(&pattern, &legend()).expect_err("an invalid map");
        for part in parts {
            assert!(error.contains(part), "`{part}` is missing in: {error}");
        }
    }

    #[test]
    fn a_map_has_walls_by_layer_hazards_by_class_and_things_by_name() {
        let (_folder, pattern) = saved(&[("hall.tmx", MAP)]);
        let levels = read(&pattern, &legend()).expect("a map");
        assert_eq!((levels.len(), levels[0].name.as_str()), (1, "hall"));
        assert!(levels[0].file.ends_with("/hall.tmx"), "{}", levels[0].file);
        assert_eq!(levels[0].rows, [".#.", "S^G"]);
        let plan = &levels[0].plan;
        assert_eq!(plan.bounds, Rect::new(0.0, 0.0, 48.0, 32.0));
        assert_eq!(plan.walls, [Rect::new(16.0, 16.0, 32.0, 32.0)]);
        assert_eq!((plan.start, plan.goal), (Vec2::new(8.0, 8.0), Vec2::new(40.0, 8.0)));
    }

    #[test]
    fn maps_are_levels_in_the_order_of_their_names() {
        let other = MAP.replace("0,1,0,0,0,0", "1,1,0,0,0,0");
        let (_folder, pattern) = saved(&[("b.tmx", MAP), ("a.tmx", MAP), ("c.tmx", &other)]);
        let game = ForeignGame::new("cellar", 1, |_: &mut App| {}).tiled(&pattern, legend());
        let levels = game.tools().levels;
        assert_eq!(game.level_count(), Some(3));
        let name = |level| levels.level_name("default", level);
        assert_eq!([name(0), name(1)].map(Option::unwrap_or_default), ["a", "b"]);
        assert_eq!(Game::layout(&game, "default", 0), Game::layout(&game, "default", 1), "they are copies");
        assert_ne!(Game::layout(&game, "default", 0), Game::layout(&game, "default", 2));
    }

    #[test]
    fn an_error_names_the_map_and_the_remedy() {
        assert_error("no map", &["hall.tmx is no map that can be read: ", "save it with Tiled"]);
        let missing = MAP.replace("stones.png", "bricks.png");
        assert_error(&missing, &["hall.tmx: the tileset `stones` is in bricks.png, which does not exist"]);
        let no_start = MAP.replace("\"player\"", "\"hero\"");
        assert_error(&no_start, &["hall.tmx: it has no `player`, which `.start` names: place one in the level"]);
        let infinite = MAP
            .replace("infinite=\"0\"", "infinite=\"1\"")
            .replace("<data encoding=\"csv\">0,1,0,0,2,0</data>", "<data encoding=\"csv\"></data>");
        let infinite = infinite.replace("<data encoding=\"csv\">0,1,0,0,0,0</data>", "<data encoding=\"csv\"></data>");
        assert_error(&infinite, &["hall.tmx: an infinite map has no bounds: clear `Infinite`"]);
        let slanted = MAP.replace("orthogonal", "isometric");
        assert_error(&slanted, &["its orientation is isometric, and plans are of orthogonal maps"]);
        let unnamed = MAP.replace("\"Walls\"", "\"Bricks\"");
        assert_error(&unnamed, &["no class of tiles, with the name `Walls`: there are Bricks, Ground, pit"]);
    }

    #[test]
    fn two_maps_of_the_same_name_are_an_error() {
        let (folder, _) = saved(&[("hall.tmx", MAP)]);
        let below = folder.path().join("more");
        fs::create_dir(&below).expect("writable");
        fs::write(below.join("stones.png"), "a picture").expect("writable");
        fs::write(below.join("hall.tmx"), MAP).expect("writable");
        let pattern = format!("{}/**/*.tmx", glob::Pattern::escape(&folder.path().to_string_lossy()));
        let error = read(&pattern, &legend()).expect_err("two of them");
        assert!(error.ends_with("more/hall.tmx: another map has the name `hall`: rename one of the files"), "{error}");
    }

    #[test]
    fn a_pattern_without_maps_is_an_error() {
        let error = read("no/such/*.tmx", &legend()).expect_err("no maps");
        assert!(error.starts_with("no file matches no/such/*.tmx: name maps of Tiled below `assets`"), "{error}");
        let error = read("maps/[.tmx", &legend()).expect_err("no pattern");
        assert!(error.starts_with("the pattern maps/[.tmx is invalid: "), "{error}");
    }
}
