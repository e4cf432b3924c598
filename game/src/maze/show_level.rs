//! A maze as text, as JSON, and as a drawing.

use crate::maze::{Cell, MAX_CELLS, Map, Maze, MazeError, MazeModeError};
use bevy::math::{Rect, Vec2};
use playbot::report::counted;
use playbot_harness::{
    drawing::{Drawing, MarkForm, Rgb, Shape},
    floor_plan::FloorPlan,
    game::Game,
    inspect::{InspectError, LevelPicture, LevelRequest, LevelView},
    level_files::{
        LevelDesigns, is_level_files,
        read::{TextFileError, read_text_file, shown_path},
    },
};
use serde_json::{Value, json};
use std::{io, path::Path};

/// Most bytes that a file of rows may have: two line ends for each cell of the largest maze.
const MAX_BYTES: u64 = 3 * MAX_CELLS as u64;

/// The sources of a game's mazes.
pub struct MazeSource {
    /// A map and a seed, with the start and the goal of the map.
    pub map: fn(&Map, u64) -> Result<Maze, MazeError>,
    /// A whole mode and a seed: the maze of that level.
    pub level: fn(&dyn Game, &str, u64) -> Result<ShownMaze, InspectError>,
    /// The first of these level files, as it is played.
    pub drawn: fn(&LevelDesigns) -> Result<ShownMaze, InspectError>,
    /// Directions of x and y in the rows, and in plots.
    pub axes: &'static str,
}

/// A maze and its metadata.
pub struct ShownMaze {
    /// The maze, with start and goal.
    pub maze: Maze,
    /// JSON that can be read back as a level file.
    pub json: Value,
}

impl ShownMaze {
    /// Takes a maze without further metadata.
    fn plain(maze: Maze) -> Self {
        let mut json = json!({ "rows": maze.to_rows(), "start": maze.start(), "goal": maze.goal() });
        if let Some(moves) = moves(&maze) {
            json["shortest_path_length"] = moves.into();
        }
        Self { maze, json }
    }
}

/// Moves on a shortest path, if there is any.
fn moves(maze: &Maze) -> Option<usize> {
    maze.shortest_path().len().checked_sub(1)
}

/// Turns an impossible maze into the error of a request.
pub fn unfit(error: MazeError) -> InspectError {
    InspectError::Usage(error.to_string())
}

/// Shows a maze.
pub fn show(game: &dyn Game, request: &LevelRequest, source: &MazeSource) -> Result<LevelView, InspectError> {
    let ShownMaze { maze, json } = shown(game, request, source)?;
    let way = match moves(&maze) {
        Some(moves) => format!(". shortest path: {}", counted(moves as u64, "move")),
        None => "there is no path from the start to the goal".to_owned(),
    };
    // The empty line ends the rows, so that the output can be read as a file.
    let legend = format!("S start  G goal  # wall  {way}\n{}", source.axes);
    Ok(LevelView {
        text: format!("{}\n\n{legend}", picture(&maze).join("\n")),
        json: json.to_string(),
        lacks_plan: false,
        picture: request.picture.then(|| draw(&maze).map(LevelPicture::Drawing)).transpose()?,
    })
}

fn shown(game: &dyn Game, request: &LevelRequest, source: &MazeSource) -> Result<ShownMaze, InspectError> {
    let level = request.level.unwrap_or(0);
    if let Some(path) = request.file {
        let designs = LevelDesigns::of_file(&path.to_string_lossy(), &|text| game.parse_level(text));
        return (source.drawn)(&designs.map_err(|error| InspectError::Usage(error.to_string()))?);
    }
    if let Some(mode) = request.mode {
        return (source.level)(game, mode, level);
    }
    let text = request.map.unwrap_or("random");
    if is_level_files(text) {
        return (source.level)(game, text, level);
    }
    let map: Map = match text.parse() {
        Ok(map) => map,
        Err(MazeModeError::Name(error)) if error.what == "map" => {
            return from_file(Path::new(text), request, &error.to_string()).map(ShownMaze::plain);
        }
        // An option of the game, not of the map.
        Err(_) => return (source.level)(game, text, level),
    };
    if request.level.is_some() && !matches!(map, Map::Random(_)) {
        return Err(no_levels(&map.to_string()));
    }
    (source.map)(&map, level).map(ShownMaze::plain).map_err(unfit)
}

fn no_levels(map: &str) -> InspectError {
    InspectError::Usage(format!(
        "`{map}` is a single map: leave --level out for the map itself, or take --mode {map} for a level as it is played"
    ))
}

/// Explains that the name is no file either.
fn no_file(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "and there is no file of that name".to_owned(),
        _ => format!("and no file of that name can be read: {error}"),
    }
}

/// Reads the maze in a file of rows; `unknown` explains that the text names no map.
fn from_file(path: &Path, request: &LevelRequest, unknown: &str) -> Result<Maze, InspectError> {
    let shown = shown_path(path);
    let text = read_text_file(path, MAX_BYTES).map_err(|error| {
        InspectError::Usage(match error {
            TextFileError::Unreadable(error) => format!("{unknown}; {}", no_file(&error)),
            TextFileError::TooLarge { .. } => {
                format!("{shown}: more than {MAX_CELLS} cells are no maze that fits into memory")
            }
            error => format!("cannot read {shown}: {error}"),
        })
    })?;
    if request.level.is_some() {
        return Err(no_levels(&shown));
    }
    let rows: Vec<&str> =
        text.lines().map(str::trim_end).skip_while(|row| row.is_empty()).take_while(|row| !row.is_empty()).collect();
    Maze::parse(&rows).map_err(|error| InspectError::Usage(format!("{shown}: {error}")))
}

/// Returns the rows as text, with the shortest path.
fn picture(maze: &Maze) -> Vec<String> {
    let mut rows: Vec<Vec<char>> = maze.to_rows().iter().map(|row| row.replace('O', " ").chars().collect()).collect();
    let path = maze.shortest_path();
    let inner = path.iter().skip(1).take(path.len().saturating_sub(2));
    for &Cell { row, col } in inner {
        rows[row][col] = '.';
    }
    rows.into_iter().map(String::from_iter).collect()
}

/// Side of a cell in a drawing, pixels.
const SIDE: f32 = 16.0;

/// Most cells to a side of a drawing.
const MOST_DRAWN: usize = 256;

const WALL: Rgb = [190, 195, 201];

const PATH: Rgb = [0, 114, 178];

const INK: Rgb = [31, 35, 40];

/// Returns the maze with its shortest path, the first row at the top.
fn draw(maze: &Maze) -> Result<Drawing, InspectError> {
    if maze.rows().max(maze.columns()) > MOST_DRAWN {
        return Err(InspectError::Usage(format!(
            "no more than {MOST_DRAWN} cells to a side are drawn: leave --png out"
        )));
    }
    let place = |cell: Cell| Vec2::new(cell.col as f32 + 0.5, cell.row as f32 + 0.5) * SIDE;
    let square = |cell| Rect::from_center_size(place(cell), Vec2::splat(SIDE));
    let mut shapes: Vec<_> = maze.wall_cells().map(|cell| Shape::Block { area: square(cell), fill: WALL }).collect();
    let points = maze.shortest_path().into_iter().map(place).collect();
    shapes.push(Shape::Line { points, width: 3.0, colour: PATH, opacity: 1.0 });
    for (form, cell, fill) in [(MarkForm::Disc, maze.start(), [255; 3]), (MarkForm::Diamond, maze.goal(), INK)] {
        shapes.push(Shape::Mark { form, centre: place(cell), radius: SIDE / 3.0, fill, outline: INK });
    }
    let size = Vec2::new(maze.columns() as f32, maze.rows() as f32) * SIDE;
    Ok(Drawing { label: "A maze with its shortest path".to_owned(), size, shapes })
}

impl Maze {
    /// Returns the maze from above. `square` gives the area of a cell and `place` the position of agents in it, both in
    /// the game's coordinates. They differ where walls are shifted against positions, as in the original Maze2D.
    pub fn floor_plan(&self, square: impl Fn(Cell) -> Rect, place: impl Fn(Cell) -> Vec2) -> FloorPlan {
        FloorPlan::of_tiles(
            [self.rows(), self.columns()],
            |row, col| !self.is_free(Cell { row, col }),
            |row, col| square(Cell { row, col }),
            [place(self.start()), place(self.goal())],
        )
    }
}
