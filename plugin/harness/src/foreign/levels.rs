//! Levels of a foreign game: its modes, level files, levels of an editor, plans and proofs.

use crate::{
    detector::LevelProof,
    floor_plan::{FloorPlan, joined_tiles},
    foreign::{ForeignGame, runtime::LevelSeed},
    game::{Game, LevelTools, design_of_file, level_designs},
    inspect::{InspectError, LevelPicture, LevelRequest, LevelView, read_text},
    level_files::{LevelDesign, LevelDesigns, LevelTextError, is_level_files, level_files_mode, read::shown_path},
    mode::ModeError,
    split::check_level,
};
use bevy::prelude::*;
use bevy_playbot::{engine::GameCall, state_hash::StateHash};
use std::{
    any::{Any, TypeId, type_name},
    fmt::Display,
    path::Path,
    sync::Arc,
};

/// The mode that is played: see [`ForeignGame::modes`]. Inserted before the game is added to the app.
///
/// While levels from files are played, it is their pattern, such as `files:levels/*.txt`.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct PlayedMode(pub String);

/// The level that is played, if it is from a file: see [`ForeignGame::level_files`]. Inserted before every restart.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct LevelFromFile(Option<(String, LevelDesign)>);

impl LevelFromFile {
    /// Returns the level as [`level_files`](ForeignGame::level_files) has read it. Returns `None` if the level is not
    /// from a file, or if it is of another type.
    pub fn get<T: Any + Send + Sync>(&self) -> Option<Arc<T>> {
        self.0.as_ref().and_then(|(_, design)| design.level())
    }

    /// Returns the path of the file, if the level is from one.
    pub fn path(&self) -> Option<&str> {
        self.0.as_ref().map(|(path, _)| path.as_str())
    }
}

/// A level that a level editor has drawn: see [`ForeignGame::editor_levels`]. A game with such levels finds the one that
/// is played as this resource. Inserted before the game is added to the app, and before every restart.
#[derive(Resource, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, Default, PartialEq)]
pub struct EditorLevel {
    /// Its name: the identifier in LDtk, or the name of the file without its ending for Tiled.
    pub name: String,
    /// The unique identifier that LDtk gives it; empty for other editors.
    pub iid: String,
    /// Path of its file or project, as an `AssetServer` takes it.
    pub file: String,
    /// A letter for each cell, row by row from the top: see [`of_rows`](Self::of_rows).
    pub rows: Vec<String>,
    /// Its plan.
    pub plan: FloorPlan,
    /// A hash of its layout: see [`ForeignGame::layout`].
    pub layout: u64,
}

impl EditorLevel {
    /// Creates a level of cells with this width and height, row by row from the top: `#` is a wall, `^` kills, `S` is the
    /// start, and `G` the goal. Other letters are free. The lower left corner is (0, 0). The layout is that of the rows.
    ///
    /// ```
    /// use bevy::math::Vec2;
    /// use playbot_harness::foreign::EditorLevel;
    ///
    /// let level = EditorLevel::of_rows("pantry", ["###", "S.G"].map(str::to_owned).into(), Vec2::splat(16.0));
    /// assert_eq!((level.plan.start, level.plan.goal), (Vec2::new(8.0, 8.0), Vec2::new(40.0, 8.0)));
    /// assert_eq!(level.plan.walls.len(), 1);
    /// ```
    pub fn of_rows(name: impl Into<String>, rows: Vec<String>, cell: Vec2) -> Self {
        let cells: Vec<Vec<char>> = rows.iter().map(|row| row.chars().collect()).collect();
        let size = [cells.len(), cells.iter().map(Vec::len).max().unwrap_or(0)];
        let is_one = |letter: char| {
            let cells = &cells;
            move |row: usize, column: usize| cells[row].get(column) == Some(&letter)
        };
        let square = |row: usize, column: usize| {
            let corner = Vec2::new(column as f32, (size[0] - 1 - row) as f32) * cell;
            Rect::from_corners(corner, corner + cell)
        };
        let middle = |letter: char| joined_tiles(size, is_one(letter), square).first().map_or(Vec2::ZERO, Rect::center);
        let plan = FloorPlan {
            bounds: Rect::from_corners(Vec2::ZERO, Vec2::new(size[1] as f32, size[0] as f32) * cell),
            walls: joined_tiles(size, is_one('#'), square),
            hazards: joined_tiles(size, is_one('^'), square),
            start: middle('S'),
            goal: middle('G'),
            ..FloorPlan::default()
        };
        let layout = StateHash::of(rows.join("\n").bytes().map(u64::from)).0;
        Self { name: name.into(), rows, plan, layout, ..Self::default() }
    }
}

/// The meaning of the parts of a level editor's map, for the plan of the level: see [`ForeignGame`]'s methods `ldtk` and
/// `tiled`.
#[cfg(any(feature = "ldtk", feature = "tiled"))]
#[derive(Clone, Debug, Default)]
pub struct MapLegend {
    pub(super) walls: Vec<String>,
    pub(super) hazards: Vec<String>,
    start: Option<String>,
    goal: Option<String>,
    in_cells: bool,
}

#[cfg(any(feature = "ldtk", feature = "tiled"))]
impl MapLegend {
    /// Names the walls. In LDtk they are values of an integer grid, by number or by identifier. In Tiled they are layers
    /// of tiles, by name, or tiles, by class.
    pub fn walls(mut self, names: impl IntoIterator<Item = impl ToString>) -> Self {
        self.walls = names.into_iter().map(|name| name.to_string()).collect();
        self
    }

    /// Names all that kills, as [`walls`](Self::walls) names walls.
    pub fn hazards(mut self, names: impl IntoIterator<Item = impl ToString>) -> Self {
        self.hazards = names.into_iter().map(|name| name.to_string()).collect();
        self
    }

    /// Names the entity at the start of a level, or the object by name or class. Each level must have one.
    pub fn start(mut self, name: impl Into<String>) -> Self {
        self.start = Some(name.into());
        self
    }

    /// Names the entity at the goal of a level, as [`start`](Self::start) does. Each level must have one.
    pub fn goal(mut self, name: impl Into<String>) -> Self {
        self.goal = Some(name.into());
        self
    }

    /// Counts the lengths of plans in cells instead of pixels.
    pub fn in_cells(mut self) -> Self {
        self.in_cells = true;
        self
    }

    /// Returns the level of a map, from a letter for each cell and the things in it, with their names and positions in
    /// pixels from the upper left corner.
    ///
    /// # Errors
    ///
    /// The start or the goal is missing.
    pub(super) fn level(
        &self,
        name: &str,
        mut letters: Vec<Vec<char>>,
        cell: Vec2,
        things: &[(Vec<&str>, Vec2)],
    ) -> Result<EditorLevel, String> {
        let find = |wanted: &Option<String>, method: &str| -> Result<Option<Vec2>, String> {
            let Some(wanted) = wanted else { return Ok(None) };
            let thing = things.iter().find(|(names, _)| names.contains(&wanted.as_str()));
            thing.map(|(_, at)| Some(*at)).ok_or_else(|| {
                format!("it has no `{wanted}`, which `.{method}` names: place one in the level, or name another")
            })
        };
        let (start, goal) = (find(&self.start, "start")?, find(&self.goal, "goal")?);
        let others = things.iter().map(|(names, at)| (names.first().and_then(|name| name.chars().next()), *at));
        let marks = [(Some('S'), start), (Some('G'), goal)].into_iter();
        let marks = marks.filter_map(|(letter, at)| Some((letter, at?)));
        for (letter, at) in
            marks.chain(others.map(|(letter, at)| (letter.map(|letter| letter.to_ascii_lowercase()), at)))
        {
            let [column, row] = (at / cell).to_array().map(|at| at.floor().max(0.0) as usize);
            if let Some(free) = letters.get_mut(row).and_then(|row| row.get_mut(column)).filter(|cell| **cell == '.') {
                *free = letter.filter(char::is_ascii_alphanumeric).unwrap_or('*');
            }
        }
        let unit = if self.in_cells { Vec2::ONE } else { cell };
        let height = letters.len() as f32;
        let rows = letters.into_iter().map(String::from_iter).collect();
        let mut level = EditorLevel::of_rows(name, rows, unit);
        // Things may stand anywhere in their cells.
        let exact = |at: Vec2| Vec2::new(at.x / cell.x, height - at.y / cell.y) * unit;
        level.plan.start = start.map_or(level.plan.start, exact);
        level.plan.goal = goal.map_or(level.plan.goal, exact);
        Ok(level)
    }
}

/// Returns the folder of the game's assets, if Bevy's settings are its defaults.
#[cfg(any(feature = "ldtk", feature = "tiled"))]
pub(super) fn asset_folder() -> std::path::PathBuf {
    bevy::asset::io::file::FileAssetReader::get_base_path().join("assets")
}

/// Returns the number of a level for the systems of a game, and the level if it is from a file.
pub(super) fn level_ahead(
    game: &ForeignGame,
    designs: Option<&LevelDesigns>,
    level: u64,
) -> Result<(LevelSeed, LevelFromFile), String> {
    let Some(designs) = designs else { return Ok((LevelSeed(game.level_of(level)), LevelFromFile::default())) };
    let design = designs.design(level)?.clone();
    let path = designs.path(level).unwrap_or_default().to_owned();
    Ok((LevelSeed(level), LevelFromFile(Some((path, design)))))
}

/// Returns the level of an editor that is played for a number, if the levels are not from files.
pub(super) fn editor_level_ahead(
    game: &ForeignGame,
    designs: Option<&LevelDesigns>,
    level: u64,
) -> Option<EditorLevel> {
    if designs.is_some() { None } else { game.editor_level("", level).cloned() }
}

/// The error of a text that is not a level: any error that can be displayed, or a [`LevelTextError`] with its line.
pub trait IntoLevelTextError {
    /// Returns the error as the plugin reports it.
    fn into_level_text_error(self) -> LevelTextError;
}

impl IntoLevelTextError for LevelTextError {
    fn into_level_text_error(self) -> LevelTextError {
        self
    }
}

impl<E: Display> IntoLevelTextError for E {
    fn into_level_text_error(self) -> LevelTextError {
        LevelTextError::whole(self.to_string())
    }
}

/// A function of a level by its mode and number.
type OfNumber<Out> = Arc<dyn Fn(&str, u64) -> Out + Send + Sync>;

/// The parser of level files.
#[derive(Clone)]
struct FileParser {
    /// Name of the method that has declared it.
    method: &'static str,
    level: LevelType,
    parse: ParseFile,
}

/// The function that reads a level file.
#[derive(Clone)]
enum ParseFile {
    Text(Arc<dyn Fn(&str) -> Result<LevelDesign, LevelTextError> + Send + Sync>),
    Bytes(Arc<dyn Fn(&[u8]) -> Result<LevelDesign, LevelTextError> + Send + Sync>),
}

/// A function of the level in a file.
#[derive(Clone)]
struct OfFile<Out> {
    level: LevelType,
    /// Returns `None` for a level of another type.
    read: Arc<dyn Fn(&LevelDesign) -> Option<Out> + Send + Sync>,
}

impl<Out> OfFile<Out> {
    fn new<T: Any + Send + Sync>(read: impl Fn(&T) -> Out + Send + Sync + 'static) -> Self {
        let read = move |design: &LevelDesign| design.level::<T>().map(|level| read(&level));
        Self { level: LevelType::of::<T>(), read: Arc::new(read) }
    }
}

/// The game's own type of levels.
#[derive(Clone, Copy)]
struct LevelType {
    id: TypeId,
    name: &'static str,
}

impl LevelType {
    fn of<T: Any>() -> Self {
        Self { id: TypeId::of::<T>(), name: type_name::<T>() }
    }
}

/// The part of a game's description that needs no World.
#[derive(Clone, Default)]
pub(super) struct LevelParts {
    parser: Option<FileParser>,
    plan: Option<OfNumber<FloorPlan>>,
    plan_of_file: Option<OfFile<FloorPlan>>,
    proof: Option<OfNumber<LevelProof>>,
    proof_of_file: Option<OfFile<LevelProof>>,
    layout: Option<OfNumber<u64>>,
    /// Levels of an editor, or the reason that there are none.
    editor: Option<Result<Arc<[EditorLevel]>, String>>,
}

impl LevelParts {
    /// Returns the reason why the parts do not fit together, if there is one.
    pub(super) fn problem(&self, game: &str) -> Option<String> {
        if let Some(Err(why)) = &self.editor {
            return Some(format!("the levels of the game `{game}`: {why}"));
        }
        let plan = self.plan_of_file.as_ref().map(|plan| (".plan_of_file", plan.level));
        let proof = self.proof_of_file.as_ref().map(|proof| (".prove_file", proof.level));
        plan.into_iter().chain(proof).find_map(|(method, level)| {
            let Some(parser) = &self.parser else {
                return Some(format!("`{method}` of the game `{game}` has no files: add `.level_files`"));
            };
            (level.id != parser.level.id).then(|| {
                format!(
                    "`{method}` of the game `{game}` takes a `{}`, and `{}` reads a `{}`: use the same type",
                    level.name, parser.method, parser.level.name
                )
            })
        })
    }
}

impl ForeignGame {
    /// Sets the names of the modes, such as difficulties; the first one is the default. The game finds the mode that is
    /// played in [`PlayedMode`], in its systems and already when it is added to the app. Default: one mode, `default`.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, PlayedMode}, prelude::*};
    ///
    /// /// The game's own resource.
    /// #[derive(Resource, Default)]
    /// struct Enemies(u32);
    ///
    /// fn game(app: &mut App) {
    ///     app.init_resource::<Enemies>();
    /// }
    ///
    /// let game = ForeignGame::new("invaders", 1, game).modes(&["easy", "hard"]).level(
    ///     |mode: Res<PlayedMode>, mut enemies: ResMut<Enemies>| {
    ///         enemies.0 = if mode.0 == "hard" { 40 } else { 10 };
    ///     },
    /// );
    /// assert!(game.check_mode("hard").is_ok() && game.check_mode("default").is_err());
    /// ```
    pub fn modes(self, modes: &'static [&'static str]) -> Self {
        self.with(|description| description.modes = modes)
    }

    /// Reads levels that somebody drew, in the game's own text format. All verbs that take levels then take files, as
    /// `files:levels/*.txt`. The game finds the level of an episode in [`LevelFromFile`].
    ///
    /// An error is any that can be displayed, or a [`LevelTextError`] with the line. Levels are the same if their texts
    /// are, apart from the kind of line ends. [`levels`](Self::levels) does not apply to files: each of them is a level.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::{ForeignGame, LevelFromFile}, prelude::*};
    ///
    /// /// The game's own level: the height of each column.
    /// #[derive(Resource, Clone, Debug, Default, PartialEq)]
    /// struct Ground(Vec<u32>);
    ///
    /// fn read(text: &str) -> Result<Ground, std::num::ParseIntError> {
    ///     text.split_whitespace().map(str::parse).collect::<Result<_, _>>().map(Ground)
    /// }
    ///
    /// let game = ForeignGame::new("hills", 1, |app: &mut App| {
    ///     app.init_resource::<Ground>();
    /// })
    /// .level_files(read)
    /// .level(|file: Res<LevelFromFile>, mut ground: ResMut<Ground>| {
    ///     *ground = file.get::<Ground>().map_or_else(Ground::default, |level| (*level).clone());
    /// });
    /// let level = game.parse_level("1 2 2").expect("a level").level::<Ground>();
    /// assert_eq!(level.as_deref(), Some(&Ground(vec![1, 2, 2])));
    /// assert_eq!(game.parse_level("1 x").expect_err("no height").what, "invalid digit found in string");
    /// ```
    pub fn level_files<T: Any + Send + Sync, E: IntoLevelTextError>(
        self,
        parse: impl Fn(&str) -> Result<T, E> + Send + Sync + 'static,
    ) -> Self {
        let parse = move |text: &str| -> Result<LevelDesign, LevelTextError> {
            let level = parse(text).map_err(IntoLevelTextError::into_level_text_error)?;
            Ok(LevelDesign::new(level, &text.lines().collect::<Vec<_>>().join("\n")))
        };
        let parse = ParseFile::Text(Arc::new(parse));
        let parser = FileParser { method: ".level_files", level: LevelType::of::<T>(), parse };
        self.with(|description| description.level_parts.parser = Some(parser))
    }

    /// Reads levels that somebody drew, in a format of the game's own that is not text. It replaces
    /// [`level_files`](Self::level_files), and all that is said there holds. Levels are the same if their bytes are.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{foreign::ForeignGame, game::GameTools, prelude::*};
    ///
    /// /// The game's own level: the height of each column.
    /// #[derive(Debug, PartialEq)]
    /// struct Ground(Vec<u8>);
    ///
    /// fn read(bytes: &[u8]) -> Result<Ground, String> {
    ///     let heights = bytes.strip_prefix(b"HILL").ok_or("it does not begin with `HILL`")?;
    ///     Ok(Ground(heights.to_vec()))
    /// }
    ///
    /// let game = ForeignGame::new("hills", 1, |_: &mut App| {}).level_files_of_bytes(read);
    /// let GameTools { levels, .. } = game.tools();
    /// let level = levels.parse_bytes(b"HILL\x00\xff\x02").expect("it has files").expect("a level");
    /// assert_eq!(level.level::<Ground>().as_deref(), Some(&Ground(vec![0, 255, 2])));
    /// let error = levels.parse_bytes(b"\x89PNG").expect("it has files").expect_err("no level");
    /// assert_eq!(error.what, "it does not begin with `HILL`");
    /// ```
    pub fn level_files_of_bytes<T: Any + Send + Sync, E: IntoLevelTextError>(
        self,
        parse: impl Fn(&[u8]) -> Result<T, E> + Send + Sync + 'static,
    ) -> Self {
        let parse = move |bytes: &[u8]| -> Result<LevelDesign, LevelTextError> {
            let level = parse(bytes).map_err(IntoLevelTextError::into_level_text_error)?;
            Ok(LevelDesign::of_bytes(level, bytes))
        };
        let parse = ParseFile::Bytes(Arc::new(parse));
        let parser = FileParser { method: ".level_files_of_bytes", level: LevelType::of::<T>(), parse };
        self.with(|description| description.level_parts.parser = Some(parser))
    }

    /// Declares the plan of a level by its number, in the units of [`position`](Self::position). It is for pictures of
    /// paths, and for detectors that need walls, bounds or the goal.
    pub fn plan(self, plan: impl Fn(u64) -> FloorPlan + Send + Sync + 'static) -> Self {
        self.plan_by_mode(move |_, level| plan(level))
    }

    /// Declares the plan of a level by its mode and number, as [`plan`](Self::plan) does for all modes at once.
    pub fn plan_by_mode(self, plan: impl Fn(&str, u64) -> FloorPlan + Send + Sync + 'static) -> Self {
        self.with(|description| description.level_parts.plan = Some(Arc::new(plan)))
    }

    /// Declares the plan of a level from a file, in the type that [`level_files`](Self::level_files) reads.
    pub fn plan_of_file<T: Any + Send + Sync>(self, plan: impl Fn(&T) -> FloorPlan + Send + Sync + 'static) -> Self {
        self.with(|description| description.level_parts.plan_of_file = Some(OfFile::new(plan)))
    }

    /// Declares a proof about a level by its mode and number: whether its goal can be reached at all. It is called for
    /// levels that no tester has solved. Only a search to its end is a proof: see [`LevelProof`].
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{detector::LevelProof, foreign::ForeignGame, prelude::*};
    ///
    /// /// The widths of the pits, by level. No jump is wider than 4.
    /// const PITS: [u32; 3] = [2, 3, 5];
    ///
    /// let game = ForeignGame::new("pits", 1, |_: &mut App| {}).levels(3).prove(|_, level| {
    ///     let pit = PITS[level as usize];
    ///     let why = format!("the pit is {pit} wide, and a jump 4 at most");
    ///     if pit > 4 { LevelProof::Unsolvable { why } } else { LevelProof::Unknown }
    /// });
    /// let proof = game.tools().levels.prove("default", 2);
    /// assert_eq!(proof.why_unsolvable(), Some("the pit is 5 wide, and a jump 4 at most"));
    /// ```
    pub fn prove(self, prove: impl Fn(&str, u64) -> LevelProof + Send + Sync + 'static) -> Self {
        self.with(|description| description.level_parts.proof = Some(Arc::new(prove)))
    }

    /// Declares a proof about a level from a file, in the type that [`level_files`](Self::level_files) reads, as
    /// [`prove`](Self::prove) does for levels of numbers.
    pub fn prove_file<T: Any + Send + Sync>(self, prove: impl Fn(&T) -> LevelProof + Send + Sync + 'static) -> Self {
        self.with(|description| description.level_parts.proof_of_file = Some(OfFile::new(prove)))
    }

    /// Declares a hash of the layout of a level by its mode and number: of all that play meets, without pictures. By it
    /// equal levels under different numbers are found, and results leave out held-out levels that a training has seen.
    /// Levels from files are compared by their text.
    pub fn layout(self, layout: impl Fn(&str, u64) -> u64 + Send + Sync + 'static) -> Self {
        self.with(|description| description.level_parts.layout = Some(Arc::new(layout)))
    }

    /// Declares the levels that a level editor has drawn, or the reason that they cannot be read. They are numbered from 0.
    /// Their names are in `playbot level`, their plans in pictures, and levels with the same layout are found by
    /// `playbot levels`. The game finds the level that is played as the resource [`EditorLevel`].
    ///
    /// The methods `ldtk` and `tiled`, features of the same names, read the files of these editors. For any other format
    /// this takes what a reader of the game's own returns. [`plan`](Self::plan) and [`layout`](Self::layout) replace
    /// those of the levels.
    ///
    /// ```
    /// use bevy::{math::Vec2, prelude::*};
    /// use playbot_harness::{foreign::{EditorLevel, ForeignGame}, prelude::*};
    ///
    /// let rows = |text: &str| text.lines().map(str::to_owned).collect();
    /// let levels = vec![
    ///     EditorLevel::of_rows("pantry", rows("####\nS..G"), Vec2::ONE),
    ///     EditorLevel::of_rows("stairs", rows("S..^G"), Vec2::ONE),
    /// ];
    /// let game = ForeignGame::new("walk", 1, |_: &mut App| {}).editor_levels(Ok(levels)).level(
    ///     |level: Res<EditorLevel>| info!("the game loads {}", level.name),
    /// );
    /// assert_eq!(game.level_count(), Some(2));
    /// assert_eq!(game.tools().levels.level_name("default", 1).as_deref(), Some("stairs"));
    /// assert_eq!(game.tools().levels.level_names("default"), ["pantry", "stairs"]);
    /// ```
    pub fn editor_levels(self, levels: Result<Vec<EditorLevel>, String>) -> Self {
        let levels = levels.and_then(|levels| {
            let none = || "there is none: draw one in the level editor".to_owned();
            if levels.is_empty() { Err(none()) } else { Ok(Arc::<[EditorLevel]>::from(levels)) }
        });
        self.with(|description| {
            if let Ok(levels) = &levels {
                description.levels = Some(levels.len() as u64);
            }
            description.level_parts.editor = Some(levels);
        })
    }

    /// Returns the level of an editor for a mode and number, if the game has such levels.
    pub(super) fn editor_level(&self, mode: &str, level: u64) -> Option<&EditorLevel> {
        let levels = self.description.level_parts.editor.as_ref()?.as_ref().ok()?;
        let index = self.level_of(level) % levels.len() as u64;
        levels.get(usize::try_from(index).ok()?).filter(|_| !is_level_files(mode))
    }

    /// Returns a function's output for a level: of the file for levels from files, or of its mode and number.
    fn of_level<Out>(
        &self,
        (mode, level): (&str, u64),
        of_number: Option<&OfNumber<Out>>,
        of_file: Option<&OfFile<Out>>,
    ) -> Option<Out> {
        if !is_level_files(mode) {
            return of_number.map(|of| of(mode, self.level_of(level)));
        }
        let designs = level_designs(self, mode).ok()?;
        (of_file?.read)(designs.design(level).ok()?)
    }
}

impl ForeignGame {
    /// Shows what is known of a level without playing it: its name, its cells or its plan, and the content of its file.
    fn show_known(&self, request: &LevelRequest) -> Result<LevelView, InspectError> {
        let name = self.name();
        // Levels are shown before the rest of the game is described.
        if let Some(why) = self.description.level_parts.problem(name) {
            return Err(InspectError::Usage(why));
        }
        if request.map.is_some() {
            let why = format!("the levels of `{name}` are no maps: name one with --level, or a level file with --file");
            return Err(InspectError::Usage(why));
        }
        let (plan, known) = match request.file {
            Some(path) => {
                let designs = design_of_file(self, &path.to_string_lossy()).map_err(ModeError::from)?;
                let plan = self.plan_of(&designs, 0);
                // Standard input is no mode that could be played.
                let mode = (path != Path::new("-")).then(|| level_files_mode(&path.to_string_lossy()));
                let known = self.of_file((mode.as_deref(), 0), path, plan.as_ref())?;
                (plan, known)
            }
            None => {
                let first = Game::modes(self).first().copied().unwrap_or_default();
                let (mode, level) = (request.mode.unwrap_or(first), request.level.unwrap_or(0));
                self.check_mode(mode)?;
                check_level(self, mode, level)?;
                let plan = self.floor_plan(mode, level);
                let known = match self.editor_level(mode, level) {
                    Some(drawn) => of_editor((mode, level), drawn),
                    None if is_level_files(mode) => {
                        let designs = level_designs(self, mode).map_err(ModeError::from)?;
                        let path = Path::new(designs.path(level).unwrap_or_default());
                        self.of_file((Some(mode), level), path, plan.as_ref())?
                    }
                    None => self.of_number((mode, level), plan.as_ref()),
                };
                (plan, known)
            }
        };
        let picture = match (&plan, request.picture) {
            (_, false) => None,
            (Some(plan), true) => Some(LevelPicture::Drawing(plan.picture(&known.title))),
            (None, true) => {
                let why =
                    format!("`{name}` has no plan of this level to draw: give one with `.plan` or `.plan_of_file`");
                return Err(InspectError::Usage(why));
            }
        };
        let KnownLevel { text, json, .. } = known;
        Ok(LevelView { text, lacks_plan: json["rows"].is_null(), json: json.to_string(), picture })
    }

    /// Describes a level by its number and its plan.
    fn of_number(&self, (mode, level): (&str, u64), plan: Option<&FloorPlan>) -> KnownLevel {
        let title = format!("{mode}:{level}");
        let mut head = format!("{title} of `{}`", self.name());
        if let Some(count) = self.level_count() {
            head += &if count == 1 { ", its only one".to_owned() } else { format!(", which has {count} levels") };
        }
        let text = format!("{head}\n{}", in_words(plan));
        let json = serde_json::json!({ "mode": mode, "level": level, "rows": plan.map(FloorPlan::rows) });
        KnownLevel { title, text, json }
    }

    /// Returns the plan of a level file.
    fn plan_of(&self, designs: &LevelDesigns, level: u64) -> Option<FloorPlan> {
        let _call = GameCall::begin("drawing the floor plan of", [level]);
        (self.description.level_parts.plan_of_file.as_ref()?.read)(designs.design(level).ok()?)
    }

    /// Describes a level file, or standard input, by its plan and its content.
    fn of_file(
        &self,
        (mode, level): (Option<&str>, u64),
        path: &Path,
        plan: Option<&FloorPlan>,
    ) -> Result<KnownLevel, InspectError> {
        // Level files of bytes have no text to show.
        let content = if self.parse_bytes(&[]).is_some() { None } else { Some(read_text(path)?) };
        let path = shown_path(path);
        let shown = content.as_ref().map_or("its content is no text", |text| text.trim_end());
        let text = format!("{path}, a level of `{}`\n{}\n{shown}", self.name(), in_words(plan));
        let rows = plan.map(FloorPlan::rows);
        let json = serde_json::json!({ "mode": mode, "level": level, "file": path, "rows": rows, "content": content });
        Ok(KnownLevel { title: path, text, json })
    }
}

/// A level as far as it is known without playing it.
struct KnownLevel {
    title: String,
    text: String,
    json: serde_json::Value,
}

/// Describes a level of an editor: its name and its cells.
fn of_editor((mode, level): (&str, u64), drawn: &EditorLevel) -> KnownLevel {
    let EditorLevel { name, file, rows, .. } = drawn;
    KnownLevel {
        title: format!("the level {name}"),
        text: format!("{mode}:{level} is `{name}` of {file}\n{}", rows.join("\n")),
        json: serde_json::json!({ "mode": mode, "level": level, "name": name, "file": file, "rows": rows }),
    }
}

/// The words for a level without a plan.
const NO_PLAN: &str =
    "the game declares no plan of it: add one to its adapter with `.plan`, or with `.plan_of_file` for level files";

/// Returns a plan as letters, with their meanings.
fn in_words(plan: Option<&FloorPlan>) -> String {
    match plan {
        Some(plan) => format!("{}\nS start  G goal  # wall  ^ kills  = platform", plan.rows().join("\n")),
        None => NO_PLAN.to_owned(),
    }
}

impl LevelTools for ForeignGame {
    fn last_level(&self) -> Option<u64> {
        self.description.levels.map(|levels| levels.saturating_sub(1))
    }

    fn parse(&self, text: &str) -> Option<Result<LevelDesign, LevelTextError>> {
        self.description.level_parts.parser.as_ref().map(|parser| match &parser.parse {
            ParseFile::Text(parse) => parse(text),
            ParseFile::Bytes(parse) => parse(text.as_bytes()),
        })
    }

    fn parse_bytes(&self, bytes: &[u8]) -> Option<Result<LevelDesign, LevelTextError>> {
        match &self.description.level_parts.parser.as_ref()?.parse {
            ParseFile::Text(_) => None,
            ParseFile::Bytes(parse) => Some(parse(bytes)),
        }
    }

    fn layout_hash(&self, mode: &str, level: u64) -> Option<u64> {
        let _call = GameCall::begin("hashing the layout of", [level]);
        let declared = self.of_level((mode, level), self.description.level_parts.layout.as_ref(), None);
        declared.or_else(|| self.editor_level(mode, level).map(|drawn| drawn.layout))
    }

    fn level_name(&self, mode: &str, level: u64) -> Option<String> {
        self.editor_level(mode, level).map(|drawn| drawn.name.clone())
    }

    fn level_names(&self, mode: &str) -> Vec<String> {
        let levels = self.description.level_parts.editor.as_ref().filter(|_| !is_level_files(mode));
        let levels = levels.and_then(|levels| levels.as_ref().ok()).map_or(&[][..], |levels| levels);
        levels.iter().map(|level| level.name.clone()).collect()
    }

    fn show(&self, request: &LevelRequest) -> Option<Result<LevelView, InspectError>> {
        Some(self.show_known(request))
    }

    fn floor_plan(&self, mode: &str, level: u64) -> Option<FloorPlan> {
        let _call = GameCall::begin("drawing the floor plan of", [level]);
        let LevelParts { plan, plan_of_file, .. } = &self.description.level_parts;
        let declared = self.of_level((mode, level), plan.as_ref(), plan_of_file.as_ref());
        declared.or_else(|| self.editor_level(mode, level).map(|drawn| drawn.plan.clone()))
    }

    fn prove(&self, mode: &str, level: u64) -> LevelProof {
        let LevelParts { proof, proof_of_file, .. } = &self.description.level_parts;
        self.of_level((mode, level), proof.as_ref(), proof_of_file.as_ref()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{foreign::Restart, level_files::level_file_pattern, prelude::*, worlds::build_world};
    use std::fs;

    /// The level of the game: the cell of its goal.
    #[derive(Debug, PartialEq)]
    struct Goal(u32);

    /// The game's own resource: the goal that it has found, and the mode in which it was added.
    #[derive(Resource, Clone, Debug, Default, PartialEq)]
    struct Found {
        goal: u32,
        path: Option<String>,
        mode: String,
        seed: u64,
    }

    /// Reads a goal, from the second line of a text.
    fn read(text: &str) -> Result<Goal, LevelTextError> {
        let line = text.lines().nth(1).unwrap_or_default();
        let what = format!("`{line}` is not a cell: write a number");
        line.parse().map(Goal).map_err(|_| LevelTextError { line: Some(2), what })
    }

    /// A game that keeps what it finds.
    fn game() -> ForeignGame {
        let add = |app: &mut App| {
            let mode = app.world().resource::<PlayedMode>().0.clone();
            app.insert_resource(Found { mode, ..Found::default() });
        };
        ForeignGame::new("finder", 1, add)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .time_limit(2)
            .modes(&["easy", "hard"])
            .levels(3)
            .level_files(read)
            .level(|file: Res<LevelFromFile>, seed: Res<LevelSeed>, mut found: ResMut<Found>| {
                found.goal = file.get::<Goal>().map_or(99, |goal| goal.0);
                found.path = file.path().map(str::to_owned);
                found.seed = seed.0;
            })
    }

    /// Returns the mode of a folder with these level files.
    fn drawn(folder: &tempfile::TempDir, texts: &[&str]) -> String {
        for (number, text) in texts.iter().enumerate() {
            fs::write(folder.path().join(format!("{number}.txt")), text).expect("writable");
        }
        format!("{}/*.txt", level_files_mode(&folder.path().to_string_lossy()))
    }

    /// Returns the finds of the game in each episode on these levels.
    fn finds(game: &ForeignGame, mode: &str, levels: &[u64]) -> Vec<Found> {
        let (mut world, agents) = build_world(game, mode, 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list(levels)));
        let mut found: Vec<Found> = Vec::new();
        while Control::of(&world, agents[0]).is_active() {
            world.tick().expect("sound");
            let now = world.resource::<Found>();
            if found.last() != Some(now) {
                found.push(now.clone());
            }
        }
        found.retain(|found| found.goal > 0);
        found
    }

    #[test]
    fn a_game_finds_the_level_of_each_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = drawn(&folder, &["goal\n4", "goal\n5", "goal\n6", "goal\n7"]);
        let found = finds(&game(), &mode, &[1, 3]);
        let goals: Vec<_> = found.iter().map(|found| (found.goal, found.seed)).collect();
        assert_eq!(goals, [(5, 1), (7, 3)], "`.levels` does not apply to files");
        let path = found[1].path.as_deref().expect("a file");
        assert!(path.ends_with("3.txt"), "{path}");
        assert_eq!(found[0].mode, mode);
    }

    #[test]
    fn a_level_of_a_number_is_from_no_file() {
        let found = finds(&game(), "hard", &[4]);
        assert_eq!(found, [Found { goal: 99, path: None, mode: "hard".to_owned(), seed: 1 }]);
    }

    #[test]
    fn a_rebuilt_world_has_the_level_of_its_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = drawn(&folder, &["goal\n4", "goal\n5"]);
        let found = finds(&game().restart(Restart::Rebuild), &mode, &[1, 0]);
        assert_eq!(found.iter().map(|found| found.goal).collect::<Vec<_>>(), [5, 4]);
    }

    #[test]
    fn an_error_in_a_level_file_names_file_and_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = drawn(&folder, &["goal\n4", "goal\nfar"]);
        let error = game().check_mode(&mode).expect_err("no cell").to_string();
        assert!(error.ends_with("1.txt, line 2: `far` is not a cell: write a number"), "{error}");
    }

    #[test]
    fn any_error_that_can_be_displayed_explains_a_text() {
        let game = ForeignGame::new("plain", 1, |_: &mut App| {}).level_files(|text: &str| text.parse::<u8>());
        let error = game.parse_level("300").expect_err("too large");
        assert_eq!(error, LevelTextError::whole("number too large to fit in target type"));
    }

    /// The game with files of two bytes: a mark that is not UTF-8, and the goal.
    fn game_of_bytes() -> ForeignGame {
        game().level_files_of_bytes(|bytes| match bytes {
            [0xfe, goal] => Ok(Goal(u32::from(*goal))),
            _ => Err("it does not have a mark and a goal"),
        })
    }

    /// Writes files of bytes, and returns their mode.
    fn binary(folder: &tempfile::TempDir, files: &[&[u8]]) -> String {
        for (number, bytes) in files.iter().enumerate() {
            fs::write(folder.path().join(format!("{number}.bin")), bytes).expect("writable");
        }
        format!("{}/*.bin", level_files_mode(&folder.path().to_string_lossy()))
    }

    #[test]
    fn a_game_finds_the_level_of_each_binary_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = binary(&folder, &[b"\xfe\x04", b"\xfe\x00", b"\xfe\xff"]);
        game_of_bytes().check_mode(&mode).expect("they are levels");
        let found = finds(&game_of_bytes(), &mode, &[0, 2]);
        assert_eq!(found.iter().map(|found| found.goal).collect::<Vec<_>>(), [4, 255]);
        let designs = level_designs(&game_of_bytes(), &mode).expect("they are levels");
        assert_eq!(designs.hash(0), Some(LevelDesign::of_bytes((), b"\xfe\x04").hash()));
        assert_ne!(designs.hash(0), designs.hash(1));
    }

    #[test]
    fn an_error_in_a_binary_level_file_names_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = binary(&folder, &[b"\xfe\x04", b"\x89PNG"]);
        let error = game_of_bytes().check_mode(&mode).expect_err("no level").to_string();
        assert!(error.ends_with("1.bin: it does not have a mark and a goal"), "{error}");
        let error = game().check_mode(&mode).expect_err("no text").to_string();
        assert!(error.contains("0.bin, line 1: byte 1 of the line is not UTF-8"), "{error}");
    }

    #[test]
    fn the_hash_of_a_level_file_is_the_same_for_all_line_ends() {
        let hash = |text: &str| game().parse_level(text).expect("a level").hash();
        assert_eq!(hash("goal\r\n4\r\n"), hash("goal\n4"));
        assert_ne!(hash("goal\n4"), hash("goal\n5"));
    }

    #[test]
    fn a_game_without_a_parser_has_no_level_files() {
        let bare = ForeignGame::new("bare", 1, |_: &mut App| {});
        let error = bare.parse_level("").expect_err("no files");
        assert_eq!(error.what, "`bare` has no level files: name one of its modes");
    }

    #[test]
    fn plans_and_proofs_are_those_of_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = drawn(&folder, &["goal\n4", "goal\n5"]);
        let at = |x: u32| FloorPlan { goal: Vec2::new(x as f32, 0.0), ..FloorPlan::default() };
        let game = game()
            .plan(|_| FloorPlan::default())
            .plan_of_file(move |goal: &Goal| at(goal.0))
            .prove(|_, _| LevelProof::Solvable)
            .prove_file(|goal: &Goal| LevelProof::Unsolvable { why: format!("{} is far", goal.0) });
        let GameTools { levels, .. } = game.tools();
        assert_eq!((levels.floor_plan(&mode, 1), levels.floor_plan(&mode, 2)), (Some(at(5)), None));
        assert_eq!(levels.prove(&mode, 0).why_unsolvable(), Some("4 is far"));
        assert_eq!(levels.prove("easy", 0), LevelProof::Solvable);
        assert_eq!(game.problem(), None);
    }

    /// Returns a level of a game as it is shown.
    fn shown(game: &ForeignGame, request: LevelRequest) -> Result<LevelView, String> {
        game.show_level(&request).map_err(|error| error.to_string())
    }

    #[test]
    fn a_level_of_a_number_is_shown_as_its_plan() {
        let plan = |level: u64| FloorPlan {
            bounds: Rect::new(0.0, 0.0, 4.0, 2.0),
            walls: vec![Rect::new(0.0, 0.0, 4.0, 1.0)],
            start: Vec2::new(0.5, 1.5),
            goal: Vec2::new(1.5 + level as f32, 1.5),
            ..FloorPlan::default()
        };
        let request = LevelRequest { mode: Some("hard"), level: Some(1), ..LevelRequest::default() };
        let bare = shown(&game(), request).expect("a level");
        let head = "hard:1 of `finder`, which has 3 levels\n";
        assert_eq!(bare.text, format!("{head}{NO_PLAN}"));
        let json: serde_json::Value = serde_json::from_str(&bare.json).expect("JSON");
        assert_eq!(json, serde_json::json!({ "mode": "hard", "level": 1, "rows": null }));
        let error = shown(&game(), LevelRequest { picture: true, ..request }).expect_err("nothing to draw");
        assert!(error.contains("`finder` has no plan of this level to draw: give one with `.plan`"), "{error}");
        let view = shown(&game().plan(plan), LevelRequest { picture: true, ..request }).expect("a level");
        assert_eq!(view.text, format!("{head}S.G.\n####\nS start  G goal  # wall  ^ kills  = platform"));
        assert!(view.picture.is_some());
        let error = shown(&game(), LevelRequest { level: Some(3), ..request }).expect_err("no such level");
        assert_eq!(error, "level 3 of `hard` does not exist: `finder` has levels 0 to 2");
        let error = shown(&game(), LevelRequest { map: Some("big"), ..LevelRequest::default() }).expect_err("no map");
        assert!(error.starts_with("the levels of `finder` are no maps: name one with --level"), "{error}");
    }

    #[test]
    fn a_level_file_is_shown_with_its_content_and_its_plan() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = drawn(&folder, &["goal\n4", "goal\n5\n"]);
        let path = folder.path().join("1.txt");
        let view = shown(&game(), LevelRequest { file: Some(&path), ..LevelRequest::default() }).expect("a level");
        assert!(view.text.ends_with(&format!("1.txt, a level of `finder`\n{NO_PLAN}\ngoal\n5")), "{}", view.text);
        let json: serde_json::Value = serde_json::from_str(&view.json).expect("JSON");
        assert_eq!((&json["content"], &json["level"]), (&"goal\n5\n".into(), &0.into()));
        let planned = game().plan_of_file(|goal: &Goal| FloorPlan {
            bounds: Rect::new(0.0, 0.0, 6.0, 1.0),
            goal: Vec2::new(goal.0 as f32 + 0.5, 0.5),
            start: Vec2::splat(0.5),
            ..FloorPlan::default()
        });
        let second = LevelRequest { mode: Some(&mode), level: Some(1), ..LevelRequest::default() };
        let text = shown(&planned, second).expect("a level").text;
        assert!(text.contains("\nS....G\n") && text.ends_with("\ngoal\n5"), "{text}");
        let error = shown(&planned, LevelRequest { level: Some(2), ..second }).expect_err("no such file");
        assert!(error.contains("there is no level 2 in "), "{error}");
        fs::write(&path, "goal\nfar").expect("writable");
        let error =
            shown(&game(), LevelRequest { file: Some(&path), ..LevelRequest::default() }).expect_err("no level");
        assert!(error.ends_with("1.txt, line 2: `far` is not a cell: write a number"), "{error}");
        let bare =
            ForeignGame::new("bare", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]);
        let error = shown(&bare, LevelRequest { file: Some(&path), ..LevelRequest::default() }).expect_err("no files");
        assert!(error.contains("`bare` has no level files: name one of its modes"), "{error}");
    }

    #[test]
    fn standard_input_is_shown_as_a_level_file_is() {
        use std::{
            io::Write,
            process::{Command, Stdio},
        };

        /// Set in the process whose standard input is the level.
        const PIPED: &str = "PLAYBOT_LEVEL_IS_PIPED";
        if std::env::var_os(PIPED).is_some() {
            let planned = game().plan_of_file(|goal: &Goal| FloorPlan {
                bounds: Rect::new(0.0, 0.0, 6.0, 1.0),
                goal: Vec2::new(goal.0 as f32 + 0.5, 0.5),
                start: Vec2::splat(0.5),
                ..FloorPlan::default()
            });
            let request = LevelRequest { file: Some(Path::new("-")), ..LevelRequest::default() };
            let view = shown(&planned, request).expect("a level");
            assert!(view.text.starts_with("standard input, a level of `finder`\nS....G\n"), "{}", view.text);
            let json: serde_json::Value = serde_json::from_str(&view.json).expect("JSON");
            assert_eq!((&json["content"], &json["mode"]), (&"goal\n5\n".into(), &serde_json::Value::Null));
            return;
        }
        let mut test = Command::new(std::env::current_exe().expect("a program"));
        test.args(["--exact", "foreign::levels::tests::standard_input_is_shown_as_a_level_file_is"]).env(PIPED, "1");
        let mut test = test.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
        test.stdin.take().expect("a pipe").write_all(b"goal\n5\n").expect("writable");
        let done = test.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&done.stdout);
        assert!(done.status.success() && said.contains("1 passed"), "{said}");
    }

    #[test]
    fn a_binary_level_file_is_shown_by_its_plan_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        binary(&folder, &[b"\xfe\x04"]);
        let path = folder.path().join("0.bin");
        let view = shown(&game_of_bytes(), LevelRequest { file: Some(&path), ..LevelRequest::default() });
        let text = view.expect("a level").text;
        assert!(text.ends_with("\nits content is no text"), "{text}");
    }

    #[test]
    fn numbered_plans_and_proofs_say_nothing_about_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = drawn(&folder, &["goal\n4"]);
        let game = game().plan(|_| FloorPlan::default()).prove(|_, _| LevelProof::Solvable);
        let GameTools { levels, .. } = game.tools();
        assert_eq!((levels.floor_plan(&mode, 0), levels.prove(&mode, 0)), (None, LevelProof::Unknown));
        assert!(level_file_pattern(&mode).is_some());
    }

    #[test]
    fn layouts_are_those_that_the_game_declares_and_numbers_repeat() {
        let game = game().layout(|mode, level| if mode == "hard" { 7 } else { level });
        let layouts = |game: &dyn Game| ["easy", "hard"].map(|mode| game.layout(mode, 4));
        assert_eq!(layouts(&game), [Some(1), Some(7)], "there are three levels");
        assert_eq!(layouts(&self::game()), [None, None], "nothing is declared");
    }

    #[test]
    fn plans_and_proofs_depend_on_mode_and_level() {
        let plan = |mode: &str, level: u64| FloorPlan {
            goal: Vec2::new(level as f32, f32::from(u8::from(mode == "hard"))),
            ..FloorPlan::default()
        };
        let game = game()
            .plan_by_mode(plan)
            .prove(|mode, level| if (mode, level) == ("hard", 2) { LevelProof::Solvable } else { LevelProof::Unknown });
        let GameTools { levels, .. } = game.tools();
        let goal = |mode: &str, level| levels.floor_plan(mode, level).map(|plan| plan.goal.to_array());
        // There are three levels, so level 5 is level 2.
        assert_eq!([goal("easy", 5), goal("hard", 1)], [Some([2.0, 0.0]), Some([1.0, 1.0])]);
        assert_eq!([levels.prove("hard", 5), levels.prove("easy", 5)], [LevelProof::Solvable, LevelProof::Unknown]);
    }

    #[test]
    fn modes_are_those_that_the_game_names() {
        assert_eq!(Game::modes(&game()), ["easy", "hard"]);
        assert!(game().check_mode("hard").is_ok());
        let error = game().check_mode("default").expect_err("no such mode").to_string();
        assert!(error.contains("`default`") && error.contains("easy"), "{error}");
        let problem = game().modes(&[]).problem().expect("no mode");
        assert_eq!(problem, "`.modes` of the game `finder` names no mode: name one, or leave it out");
    }

    #[test]
    fn a_plan_of_another_type_is_a_problem() {
        let problem = game().plan_of_file(|_: &String| FloorPlan::default()).problem().expect("another type");
        for part in ["`.plan_of_file` of the game `finder` takes a `", "String`", "Goal`: use the same type"] {
            assert!(problem.contains(part), "`{part}` is missing in: {problem}");
        }
        let bare = ForeignGame::new("bare", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .prove_file(|_: &Goal| LevelProof::Unknown);
        let problem = bare.problem().expect("no files");
        assert_eq!(problem, "`.prove_file` of the game `bare` has no files: add `.level_files`");
    }
}
