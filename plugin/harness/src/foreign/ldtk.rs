//! Levels of a project that is drawn with LDtk.

use crate::{
    foreign::{
        ForeignGame,
        levels::{EditorLevel, MapLegend, asset_folder},
    },
    level_files::read::read_text_file,
};
use bevy::math::Vec2;
use bevy_playbot::state_hash::StateHash;
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Largest size of a project or of an external level, bytes.
const MOST_BYTES: u64 = 256 << 20;

/// The major version of the format that is read.
const MAJOR: &str = "1";

/// A project: the parts of it that a level or its plan depends on.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Project {
    #[serde(default)]
    external_levels: bool,
    defs: Definitions,
    #[serde(default)]
    levels: Vec<Level>,
    #[serde(default)]
    worlds: Vec<LdtkWorld>,
}

#[derive(Deserialize)]
struct Definitions {
    #[serde(default)]
    layers: Vec<LayerDefinition>,
    #[serde(default)]
    tilesets: Vec<Tileset>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct LayerDefinition {
    #[serde(default)]
    int_grid_values: Vec<GridValue>,
}

/// A value of an integer grid, and its name.
#[derive(Deserialize)]
struct GridValue {
    value: i64,
    identifier: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Tileset {
    identifier: String,
    rel_path: Option<String>,
}

/// One of several worlds of a project.
#[derive(Deserialize)]
struct LdtkWorld {
    identifier: String,
    levels: Vec<Level>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Level {
    identifier: String,
    iid: String,
    px_wid: f32,
    px_hei: f32,
    external_rel_path: Option<String>,
    bg_rel_path: Option<String>,
    /// Missing if the level is in a file of its own.
    layer_instances: Option<Vec<Layer>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Layer {
    #[serde(rename = "__identifier")]
    identifier: String,
    #[serde(rename = "__cWid")]
    columns: usize,
    #[serde(rename = "__gridSize")]
    cell: f32,
    #[serde(rename = "__pxTotalOffsetX")]
    offset_x: f32,
    #[serde(rename = "__pxTotalOffsetY")]
    offset_y: f32,
    iid: String,
    #[serde(default)]
    int_grid_csv: Vec<i64>,
    #[serde(default)]
    entity_instances: Vec<LdtkEntity>,
    #[serde(default)]
    grid_tiles: Vec<Tile>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct LdtkEntity {
    #[serde(rename = "__identifier")]
    identifier: String,
    #[serde(rename = "__pivot")]
    pivot: [f32; 2],
    iid: String,
    px: [f32; 2],
    width: f32,
    height: f32,
    #[serde(default)]
    field_instances: Vec<Field>,
}

/// A field of an entity, with its value.
#[derive(Deserialize)]
struct Field {
    #[serde(rename = "__identifier")]
    identifier: String,
    #[serde(rename = "__value", default)]
    value: Value,
}

#[derive(Deserialize)]
struct Tile {
    px: [i64; 2],
    t: i64,
}

impl ForeignGame {
    /// Takes the levels of a project that is drawn with LDtk, in the order of its worlds and levels, for a game that loads
    /// them with `bevy_ecs_ldtk` or by itself. The game finds the level that is played as the resource [`EditorLevel`]. A
    /// [`level`](Self::level) system passes it on, such as `LevelSelection::iid(&level.iid)`.
    ///
    /// The path is that of an `AssetServer`, in the folder `assets`. Otherwise it is looked for below the
    /// current folder. The legend names the values of integer grids that are walls in plans, and the entities at the start and at
    /// the goal. Plans have (0, 0) in the lower left corner of their level, as `bevy_ecs_ldtk` places it by default.
    ///
    /// A project that cannot be read is a [`problem`](crate::game::Game::problem) of the game: files of another format,
    /// missing files of tiles or levels, a level without the start, and two levels of the same name.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, MapLegend}, prelude::*};
    ///
    /// let legend = MapLegend::default().walls(["wall"]).start("Player").goal("Exit");
    /// let game = ForeignGame::new("cellar", 1, |_: &mut App| {}).ldtk("no/such.ldtk", legend);
    /// let problem = game.keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]).problem();
    /// assert!(problem.is_some_and(|problem| problem.contains("no/such.ldtk")));
    /// ```
    pub fn ldtk(self, path: impl AsRef<str>, legend: MapLegend) -> Self {
        self.editor_levels(read(path.as_ref(), &legend))
    }
}

/// Reads all levels of a project.
fn read(path: &str, legend: &MapLegend) -> Result<Vec<EditorLevel>, String> {
    let below_assets = asset_folder().join(path);
    let found = if below_assets.is_file() { below_assets } else { PathBuf::from(path) };
    let folder = found.parent().unwrap_or(Path::new("")).to_owned();
    let project: Project = parse(&text_of(&found, path)?, path)?;
    check_tilesets(&project, &folder, path)?;
    let letters = Letters::new(&project, legend, path)?;
    let alone = project.levels.into_iter().map(|level| (None, level));
    let worlds = project.worlds.into_iter();
    let others =
        worlds.flat_map(|world| world.levels.into_iter().map(move |level| (Some(world.identifier.clone()), level)));
    let levels: Vec<(Option<String>, Level)> = alone.chain(others).collect();
    if levels.is_empty() {
        return Err(format!("{path} has no level: draw one in LDtk, and save the project"));
    }
    let (mut names, mut drawn) = (BTreeSet::new(), Vec::with_capacity(levels.len()));
    for (world, mut level) in levels {
        let name = level.identifier.clone();
        let of_level = |why: String| match &world {
            Some(world) => format!("{path}, world `{world}`, level `{name}`: {why}"),
            None => format!("{path}, level `{name}`: {why}"),
        };
        if !names.insert(name.clone()) {
            return Err(of_level("another level has the same identifier: rename one of them in LDtk".to_owned()));
        }
        if level.layer_instances.is_none() {
            level.layer_instances = external_layers(&level, project.external_levels, &folder).map_err(of_level)?;
        }
        if let Some(missing) = level.bg_rel_path.as_ref().filter(|picture| !folder.join(picture).is_file()) {
            return Err(of_level(format!(
                "its background {missing} does not exist beside the project: add the file, or choose another in LDtk"
            )));
        }
        let drawn_level = draw(&level, &letters, legend).map_err(of_level)?;
        drawn.push(EditorLevel { iid: level.iid, file: path.to_owned(), ..drawn_level });
    }
    Ok(drawn)
}

/// Returns the text of a file.
fn text_of(file: &Path, shown: &str) -> Result<String, String> {
    read_text_file(file, MOST_BYTES).map_err(|error| {
        format!("cannot read {shown}: {error}; name a project of LDtk below `assets`, or below the current folder")
    })
}

/// Parses a project, after its version.
fn parse(text: &str, shown: &str) -> Result<Project, String> {
    /// The first thing that a reader looks at.
    #[derive(Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Version {
        json_version: Option<String>,
    }
    let version: Version = json(text, shown)?;
    match version.json_version {
        None => Err(format!(
            "{shown} is no project of LDtk, since it has no `jsonVersion`: name a file with the ending .ldtk"
        )),
        Some(version) if version.split('.').next() == Some(MAJOR) => json(text, shown),
        Some(version) => Err(format!(
            "{shown} has the `jsonVersion` {version}, and {MAJOR}.x is read: save it with a version {MAJOR}.x of LDtk"
        )),
    }
}

/// Parses a file of LDtk.
fn json<T: DeserializeOwned>(text: &str, shown: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| format!("{shown} is damaged: {error}; save it with LDtk again"))
}

/// Checks that the pictures of all tiles exist.
fn check_tilesets(project: &Project, folder: &Path, shown: &str) -> Result<(), String> {
    let mut pictures = project.defs.tilesets.iter().filter_map(|tiles| Some((tiles, tiles.rel_path.as_ref()?)));
    match pictures.find(|(_, picture)| !folder.join(picture).is_file()) {
        None => Ok(()),
        Some((Tileset { identifier, .. }, picture)) => Err(format!(
            "{shown}: the tileset `{identifier}` is in {picture}, which does not exist beside the project: add the file, or \
             choose another in LDtk"
        )),
    }
}

/// Reads the layers of a level that is in a file of its own.
fn external_layers(level: &Level, is_external: bool, folder: &Path) -> Result<Option<Vec<Layer>>, String> {
    let Some(file) = level.external_rel_path.as_ref().filter(|_| is_external) else {
        return Err("it has no layers: save the project with LDtk again".to_owned());
    };
    let text = read_text_file(&folder.join(file), MOST_BYTES).map_err(|error| {
        format!(
            "cannot read its file {file}: {error}; save the project with LDtk again, or leave out `Save levels separately`"
        )
    })?;
    let level: Level = json(&text, file)?;
    Ok(Some(level.layer_instances.unwrap_or_default()))
}

/// The values of integer grids that are walls or hazards.
struct Letters {
    walls: BTreeSet<i64>,
    hazards: BTreeSet<i64>,
}

impl Letters {
    /// Looks the values of a legend up in a project.
    fn new(project: &Project, legend: &MapLegend, shown: &str) -> Result<Self, String> {
        let known: Vec<&GridValue> = project.defs.layers.iter().flat_map(|layer| &layer.int_grid_values).collect();
        let is_named = |value: &GridValue, name: &str| {
            value.identifier.as_deref() == Some(name) || name.parse().is_ok_and(|number: i64| number == value.value)
        };
        let values = |names: &[String]| -> Result<BTreeSet<i64>, String> {
            let mut values = BTreeSet::new();
            for name in names {
                let before = values.len();
                values.extend(known.iter().filter(|value| is_named(value, name)).map(|value| value.value));
                if values.len() == before && !known.iter().any(|value| is_named(value, name)) {
                    return Err(unknown_value(shown, name, &known));
                }
            }
            Ok(values)
        };
        Ok(Self { walls: values(&legend.walls)?, hazards: values(&legend.hazards)? })
    }

    fn of(&self, value: i64) -> char {
        match value {
            0 => '.',
            value if self.walls.contains(&value) => '#',
            value if self.hazards.contains(&value) => '^',
            value => char::from_digit(value.rem_euclid(10) as u32, 10).unwrap_or('*'),
        }
    }
}

/// Returns the error of a value that no integer grid has.
fn unknown_value(shown: &str, name: &str, known: &[&GridValue]) -> String {
    let all = known.iter().map(|value| match &value.identifier {
        Some(identifier) => format!("{} `{identifier}`", value.value),
        None => value.value.to_string(),
    });
    let all: Vec<String> = all.collect();
    if all.is_empty() {
        return format!(
            "{shown} has no integer grid, so that `{name}` is none of its values: leave it out of the legend"
        );
    }
    format!("{shown} has no value `{name}` in an integer grid: its values are {}", all.join(", "))
}

/// Draws a level from its integer grids and entities.
fn draw(level: &Level, letters: &Letters, legend: &MapLegend) -> Result<EditorLevel, String> {
    let layers = level.layer_instances.as_deref().unwrap_or_default();
    let grids = layers.iter().filter(|layer| !layer.int_grid_csv.is_empty() && layer.cell > 0.0 && layer.columns > 0);
    let cell = grids.clone().map(|layer| layer.cell).fold(f32::INFINITY, f32::min);
    // A level without a grid is one cell.
    let cell = if cell.is_finite() { cell } else { level.px_wid.max(level.px_hei).max(1.0) };
    let [columns, rows] =
        [level.px_wid, level.px_hei].map(|length| (length / cell).ceil().clamp(1.0, 65536.0) as usize);
    let letter = |row: usize, column: usize| {
        let middle = (Vec2::new(column as f32, row as f32) + 0.5) * cell;
        let found = grids.clone().map(|layer| letters.of(value_at(layer, middle)));
        // A wall of any layer is one; otherwise the topmost layer counts.
        let rank = |letter: &char| ["#", "^"].iter().position(|first| first.starts_with(*letter)).unwrap_or(2);
        found.filter(|letter| *letter != '.').min_by_key(rank).unwrap_or('.')
    };
    let letters = (0..rows).map(|row| (0..columns).map(|column| letter(row, column)).collect()).collect();
    let things: Vec<(Vec<&str>, Vec2)> = layers.iter().flat_map(|layer| &layer.entity_instances).map(thing).collect();
    let drawn = legend.level(&level.identifier, letters, Vec2::splat(cell), &things)?;
    Ok(EditorLevel { layout: layout(level, layers), ..drawn })
}

/// Returns the value of an integer grid at a point of its level, in pixels.
fn value_at(layer: &Layer, point: Vec2) -> i64 {
    let [column, row] = ((point - Vec2::new(layer.offset_x, layer.offset_y)) / layer.cell).floor().to_array();
    if column < 0.0 || row < 0.0 || column as usize >= layer.columns {
        return 0;
    }
    layer.int_grid_csv.get(row as usize * layer.columns + column as usize).copied().unwrap_or(0)
}

/// Returns the name of an entity, and its middle.
fn thing(entity: &LdtkEntity) -> (Vec<&str>, Vec2) {
    let size = Vec2::new(entity.width, entity.height);
    (vec![entity.identifier.as_str()], Vec2::from(entity.px) + (0.5 - Vec2::from(entity.pivot)) * size)
}

/// Returns the hash of all that play meets in a level: grids, tiles, and entities with their fields. Identifiers of
/// copies differ, so that those within the level count by their order.
fn layout(level: &Level, layers: &[Layer]) -> u64 {
    use std::fmt::Write;
    let mut content = format!("{} {}", level.px_wid, level.px_hei);
    let entities = || layers.iter().flat_map(|layer| &layer.entity_instances);
    let known = || {
        let iids = entities().map(|entity| &entity.iid).chain(layers.iter().map(|layer| &layer.iid));
        iids.chain([&level.iid]).filter(|iid| !iid.is_empty()).enumerate()
    };
    for layer in layers {
        let Layer { identifier, columns, cell, offset_x, offset_y, int_grid_csv, .. } = layer;
        // Writing into a string cannot fail.
        let _ = write!(content, "\n{identifier} {columns} {cell} {offset_x} {offset_y} {int_grid_csv:?}");
        for Tile { px: [x, y], t } in &layer.grid_tiles {
            let _ = write!(content, " {x},{y}:{t}");
        }
        for LdtkEntity { identifier, px, width, height, field_instances, .. } in &layer.entity_instances {
            let _ = write!(content, "\n{identifier} {px:?} {width} {height}");
            for Field { identifier, value } in field_instances {
                let value = known().fold(value.to_string(), |text, (at, iid)| text.replace(iid, &format!("#{at}")));
                let _ = write!(content, " {identifier}={value}");
            }
        }
    }
    StateHash::of(content.bytes().map(u64::from)).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use bevy::prelude::*;
    use serde_json::json;
    use std::fs;
    use tempfile::TempDir;

    fn entity(identifier: &str, iid: &str, px: [i32; 2], field: Value) -> Value {
        json!({
            "__identifier": identifier, "__pivot": [0.5, 0.5], "iid": iid, "px": px, "width": 16, "height": 16,
            "fieldInstances": [{ "__identifier": "leads_to", "__value": field }],
        })
    }

    /// A level of 3 × 2 cells: a wall above a pit, the player at the left end of the lower row, and an exit at its right.
    fn level(identifier: &str) -> Value {
        let iid = |of: &str| format!("{of} of {identifier}");
        json!({
            "identifier": identifier, "iid": iid("level"), "pxWid": 48, "pxHei": 32,
            "externalRelPath": null, "bgRelPath": null,
            "layerInstances": [
                {
                    "__identifier": "Things", "__cWid": 3, "__gridSize": 16, "__pxTotalOffsetX": 0,
                    "__pxTotalOffsetY": 0, "iid": iid("things"), "intGridCsv": [], "gridTiles": [],
                    "entityInstances": [
                        entity("Player", &iid("player"), [8, 24], json!(null)),
                        entity("Exit", &iid("exit"), [40, 24], json!({ "entityIid": iid("player") })),
                        entity("Key", &iid("key"), [8, 8], json!(3)),
                    ],
                },
                {
                    "__identifier": "Walls", "__cWid": 3, "__gridSize": 16, "__pxTotalOffsetX": 0,
                    "__pxTotalOffsetY": 0, "iid": iid("walls"), "intGridCsv": [0, 1, 5, 0, 2, 0], "gridTiles": [],
                    "entityInstances": [],
                },
            ],
        })
    }

    fn project(levels: &[Value]) -> Value {
        json!({
            "jsonVersion": "1.5.3", "externalLevels": false, "worlds": [], "levels": levels,
            "defs": {
                "tilesets": [],
                "layers": [
                    { "intGridValues": [] },
                    { "intGridValues": [
                        { "value": 1, "identifier": "wall" },
                        { "value": 2, "identifier": "pit" },
                        { "value": 5, "identifier": null },
                    ] },
                ],
            },
        })
    }

    fn legend() -> MapLegend {
        MapLegend::default().walls(["wall"]).hazards([2]).start("Player").goal("Exit")
    }

    /// Returns a folder with this project.
    fn saved(project: &Value) -> (TempDir, String) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("game.ldtk");
        fs::write(&path, project.to_string()).expect("writable");
        let path = path.to_string_lossy().into_owned();
        (folder, path)
    }

    fn levels_of(project: &Value) -> Result<Vec<EditorLevel>, String> {
        let (_folder, path) = saved(project);
        read(&path, &legend())
    }

    #[track_caller]
    fn assert_error(project: &Value, parts: &[&str]) {
        let error = levels_of(project).expect_err("an invalid project");
        for part in parts {
            assert!(error.contains(part), "`{part}` is missing in: {error}");
        }
    }

    #[test]
    fn a_plan_has_walls_hazards_start_and_goal_in_pixels() {
        let levels = levels_of(&project(&[level("Cellar")])).expect("a project");
        assert_eq!(levels.len(), 1);
        assert_eq!((levels[0].name.as_str(), levels[0].iid.as_str()), ("Cellar", "level of Cellar"));
        assert_eq!(levels[0].rows, ["k#5", "S^G"]);
        let plan = &levels[0].plan;
        assert_eq!(plan.bounds, Rect::new(0.0, 0.0, 48.0, 32.0));
        assert_eq!(plan.walls, [Rect::new(16.0, 16.0, 32.0, 32.0)]);
        assert_eq!(plan.hazards, [Rect::new(16.0, 0.0, 32.0, 16.0)]);
        assert_eq!((plan.start, plan.goal), (Vec2::new(8.0, 8.0), Vec2::new(40.0, 8.0)));
    }

    #[test]
    fn a_plan_in_cells_is_a_grid_of_squares_of_one() {
        let (_folder, path) = saved(&project(&[level("Cellar")]));
        let levels = read(&path, &legend().in_cells()).expect("a project");
        let plan = &levels[0].plan;
        assert_eq!(plan.bounds, Rect::new(0.0, 0.0, 3.0, 2.0));
        assert_eq!((plan.start, plan.goal), (Vec2::new(0.5, 0.5), Vec2::new(2.5, 0.5)));
    }

    #[test]
    fn copies_of_a_level_have_the_same_layout() {
        let mut moved = level("Moved");
        moved["layerInstances"][0]["entityInstances"][2]["px"] = json!([24, 8]);
        let levels = levels_of(&project(&[level("One"), level("Two"), moved])).expect("a project");
        assert_eq!(levels[0].layout, levels[1].layout);
        assert_ne!(levels[0].layout, levels[2].layout);
    }

    #[test]
    fn the_game_finds_the_level_that_is_played() {
        /// The names of the levels that the game has loaded.
        #[derive(Resource, Default)]
        struct Loaded(Vec<String>);

        let (_folder, path) = saved(&project(&[level("One"), level("Two")]));
        let game = ForeignGame::new("cellar", 1, |app: &mut App| {
            assert!(app.world().contains_resource::<EditorLevel>());
            app.init_resource::<Loaded>();
        })
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["x"], || [0.0])
        .time_limit(2)
        .ldtk(&path, legend())
        .level(|level: Res<EditorLevel>, mut loaded: ResMut<Loaded>| loaded.0.push(level.name.clone()));
        assert_eq!((game.problem(), game.level_count()), (None, Some(2)));
        let (mut world, agents) = crate::worlds::build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1, 2])));
        while Control::of(&world, agents[0]).is_active() {
            world.tick().expect("sound");
        }
        assert_eq!(world.resource::<Loaded>().0, ["Two", "One"], "there are two levels");
    }

    #[test]
    fn levels_are_shown_with_names_and_plans() {
        let (_folder, path) = saved(&project(&[level("One"), level("Two")]));
        let game = ForeignGame::new("cellar", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .ldtk(&path, legend());
        let request = crate::inspect::LevelRequest { level: Some(1), picture: true, ..default() };
        let view = game.show_level(&request).expect("a level");
        assert_eq!(view.text, format!("default:1 is `Two` of {path}\nk#5\nS^G"));
        let json: Value = serde_json::from_str(&view.json).expect("JSON");
        assert_eq!((&json["name"], &json["rows"][1]), (&json!("Two"), &json!("S^G")));
        assert!(view.picture.is_some());
        let levels = game.tools().levels;
        assert_eq!(levels.level_name("default", 1).as_deref(), Some("Two"));
        assert_eq!(levels.last_level(), Some(1));
        let beyond = game.show_level(&crate::inspect::LevelRequest { level: Some(2), ..request });
        let words = beyond.map(drop).expect_err("there are two levels").to_string();
        assert_eq!(words, "level 2 of `default` does not exist: `cellar` has levels 0 to 1");
        assert!(levels.floor_plan("default", 1).is_some_and(|plan| plan.goal.x == 40.0));
        assert_eq!(Game::layout(&game, "default", 0), Game::layout(&game, "default", 1), "they are copies");
    }

    #[test]
    fn levels_of_all_worlds_are_numbered_through() {
        let mut project = project(&[]);
        let world = |name: &str, level: Value| json!({ "identifier": name, "levels": [level] });
        project["worlds"] = json!([world("Above", level("Hall")), world("Below", level("Cellar"))]);
        let names: Vec<String> = levels_of(&project).expect("a project").into_iter().map(|level| level.name).collect();
        assert_eq!(names, ["Hall", "Cellar"]);
        project["worlds"][1]["levels"][0]["identifier"] = json!("Hall");
        assert_error(&project, &["world `Below`, level `Hall`: another level has the same identifier: rename"]);
    }

    #[test]
    fn levels_in_files_of_their_own_are_read() {
        let mut project = project(&[level("Cellar")]);
        let whole = project["levels"][0].clone();
        project["externalLevels"] = json!(true);
        project["levels"][0]["layerInstances"] = json!(null);
        project["levels"][0]["externalRelPath"] = json!("game/Cellar.ldtkl");
        assert_error(&project, &["level `Cellar`: cannot read its file game/Cellar.ldtkl: ", "Save levels separately"]);
        let (folder, path) = saved(&project);
        fs::create_dir(folder.path().join("game")).expect("writable");
        fs::write(folder.path().join("game/Cellar.ldtkl"), whole.to_string()).expect("writable");
        assert_eq!(read(&path, &legend()).expect("a project")[0].rows, ["k#5", "S^G"]);
    }

    #[test]
    fn an_error_names_file_and_level_and_the_remedy() {
        let one = project(&[level("Cellar")]);
        let with = |path: &str, value: Value| {
            let mut changed = one.clone();
            *changed.pointer_mut(path).expect("it is there") = value;
            changed
        };
        assert_error(
            &with("/jsonVersion", json!("2.0.1")),
            &["game.ldtk has the `jsonVersion` 2.0.1, and 1.x is read"],
        );
        assert_error(&with("/jsonVersion", json!(null)), &["game.ldtk is no project of LDtk", "name a file"]);
        assert_error(&with("/defs", json!(7)), &["game.ldtk is damaged: ", "line 1", "save it with LDtk again"]);
        assert_error(&with("/levels", json!([])), &["game.ldtk has no level: draw one in LDtk"]);
        let tiles = json!([{ "identifier": "Stones", "relPath": "stones.png" }]);
        assert_error(&with("/defs/tilesets", tiles), &["the tileset `Stones` is in stones.png, which does not exist"]);
        let background = with("/levels/0/bgRelPath", json!("sky.png"));
        assert_error(&background, &["level `Cellar`: its background sky.png does not exist"]);
        let twice = project(&[level("Cellar"), level("Cellar")]);
        assert_error(&twice, &["game.ldtk, level `Cellar`: another level has the same identifier"]);
        let no_start = with("/levels/0/layerInstances/0/entityInstances/0/__identifier", json!("Hero"));
        assert_error(&no_start, &["level `Cellar`: it has no `Player`, which `.start` names: place one"]);
        assert_error(&with("/levels/0/layerInstances", json!(null)), &["level `Cellar`: it has no layers"]);
    }

    #[test]
    fn a_value_that_no_grid_has_is_an_error_with_all_values() {
        let (_folder, path) = saved(&project(&[level("Cellar")]));
        let error = read(&path, &MapLegend::default().walls(["wal"])).expect_err("no such value");
        assert!(error.ends_with("no value `wal` in an integer grid: its values are 1 `wall`, 2 `pit`, 5"), "{error}");
    }

    #[test]
    fn a_project_that_does_not_exist_is_a_problem_of_the_game() {
        let game = ForeignGame::new("cellar", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .ldtk("no/such.ldtk", legend());
        let problem = game.problem().expect("no project");
        assert!(problem.starts_with("the levels of the game `cellar`: cannot read no/such.ldtk: "), "{problem}");
        let shown = game.show_level(&crate::inspect::LevelRequest::default()).expect_err("no level");
        assert_eq!(shown.to_string(), problem);
    }
}
