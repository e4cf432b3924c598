//! Drawings written to files.

use crate::{
    error::CliError,
    output, pictures,
    pictures::{Film, Screen, caption},
};
use bevy::math::Vec2;
use playbot_harness::{
    drawing::{Drawing, MarkForm, Rgb, Shape},
    eval::Trail,
    floor_plan::FloorPlan,
    game::Game,
    inspect::LevelPicture,
    split::LevelSplit,
    trails::{Floor, PlayerTrails, TrailChart},
};
use std::path::{Path, PathBuf};

/// A file for a drawing, a PNG or an SVG.
#[derive(Clone, Debug)]
pub struct PlotFile {
    path: PathBuf,
    is_svg: bool,
}

impl PlotFile {
    /// Takes a path whose ending is the kind. Its folder is made, and it is tested for writing, so that nothing is
    /// computed in vain.
    ///
    /// # Errors
    ///
    /// The ending is neither `.png` nor `.svg`, the path is that of a folder, or nothing can be written there.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        let is_svg = match ending.as_deref() {
            Some("svg") => true,
            Some("png") => false,
            _ => {
                return Err(CliError::Usage(format!(
                    "{}: a picture is written as .png or .svg; choose one of them",
                    path.display()
                )));
            }
        };
        output::prepare(path)?;
        Ok(Self { path: path.to_owned(), is_svg })
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a drawing.
    ///
    /// # Errors
    ///
    /// It is too large for a PNG, or cannot be written.
    pub fn write(&self, drawing: &Drawing) -> Result<(), CliError> {
        let bytes = if self.is_svg { drawing.to_svg().into_bytes() } else { to_png(drawing)? };
        output::write(&self.path, &bytes)
    }
}

/// Writes it.
///
/// # Errors
///
/// It is made of pixels and the file is no .png, it is too large, or it cannot be written.
pub(crate) fn write(file: &PlotFile, picture: &LevelPicture, tick_hz: f64) -> Result<(), CliError> {
    match picture {
        LevelPicture::Drawing(drawing) => file.write(drawing),
        LevelPicture::Pixels { .. } => {
            let path = file.path();
            output::png(&path.to_string_lossy())
                .map_err(|why| CliError::Usage(format!("{}: {why}", path.display())))?;
            output::write(path, &png(picture, tick_hz)?)
        }
    }
}

/// Encodes the picture of a level as a PNG.
///
/// # Errors
///
/// It is too large.
pub(crate) fn png(picture: &LevelPicture, tick_hz: f64) -> Result<Vec<u8>, CliError> {
    match picture {
        LevelPicture::Drawing(drawing) => to_png(drawing),
        LevelPicture::Pixels { image, pixels } => Ok(Film::new(*image, 1, tick_hz)?.still(pixels)?.0),
    }
}

/// Trails as they come in, by floor and player.
pub struct Footprints {
    file: PlotFile,
    grounds: Vec<TestedGround>,
}

/// A floor and its levels.
struct TestedGround {
    mode: String,
    levels: Vec<u64>,
    floor: Floor,
}

/// Returns the error of an option that draws on the floor plan of a level, for a game that has none.
pub(crate) fn without_plan(game: &dyn Game, level: &str, option: &str) -> CliError {
    CliError::Usage(format!(
        "`{}` has no floor plan of level {level}: leave {option} out, or add one to its adapter with `.plan` or \
         `.plan_of_file`",
        game.name()
    ))
}

impl Footprints {
    /// Prepares the trails of a game, to be drawn into a file.
    ///
    /// # Errors
    ///
    /// The file's ending is unknown, or the game has no floor plan for these levels.
    pub fn new(path: &Path, game: &dyn Game, splits: &[LevelSplit]) -> Result<Self, CliError> {
        let file = PlotFile::new(path)?;
        match splits.iter().find(|split| game.tools().levels.floor_plan(&split.mode, split.first).is_none()) {
            Some(LevelSplit { mode, first, .. }) => Err(without_plan(game, &format!("{mode}:{first}"), "--plot")),
            None => Ok(Self { file, grounds: Vec::new() }),
        }
    }

    /// Adds a player's trails on some levels, each from its start. The trails come sorted by level.
    pub fn add(&mut self, game: &dyn Game, split: &LevelSplit, player: &str, trails: Vec<Trail>) {
        let mut known = None;
        for mut trail in trails {
            let level = trail.result.level;
            let (at, start) = match known {
                Some((same, at, start)) if same == level => (at, start),
                _ => {
                    let Some(plan) = game.tools().levels.floor_plan(&split.mode, level) else { continue };
                    let start = plan.start;
                    (self.ground(&split.mode, level, plan), start)
                }
            };
            known = Some((level, at, start));
            // The first position is that after the first tick, which may be far from the mark of the start.
            trail.positions.insert(0, start);
            let players = &mut self.grounds[at].floor.players;
            match players.iter_mut().find(|known| known.name == player) {
                Some(known) => known.trails.push(trail),
                None => players.push(PlayerTrails { name: player.to_owned(), trails: vec![trail] }),
            }
        }
    }

    /// Returns the index of a level's floor in the list.
    fn ground(&mut self, mode: &str, level: u64, plan: FloorPlan) -> usize {
        let is_same = |ground: &TestedGround| {
            let known = &ground.floor.plan;
            let tiles = |plan: &FloorPlan| [&plan.walls, &plan.hazards, &plan.platforms].map(Vec::clone);
            ground.mode == mode && known.bounds == plan.bounds && tiles(known) == tiles(&plan)
        };
        let (start, goal) = (plan.start, plan.goal);
        let at = self.grounds.iter().position(is_same).unwrap_or_else(|| {
            let floor = Floor { name: String::new(), plan, starts: vec![], goals: vec![], players: vec![] };
            self.grounds.push(TestedGround { mode: mode.to_owned(), levels: Vec::new(), floor });
            self.grounds.len() - 1
        });
        let TestedGround { levels, floor, .. } = &mut self.grounds[at];
        for (list, place) in [(&mut floor.starts, start), (&mut floor.goals, goal)] {
            if !list.contains(&place) {
                list.push(place);
            }
        }
        levels.push(level);
        at
    }

    /// Draws them all.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn write(self, game: &dyn Game) -> Result<(), CliError> {
        let floors = self.grounds.into_iter().map(TestedGround::named).collect();
        let chart = TrailChart { title: format!("Paths of players in {}", game.name()), floors };
        self.file.write(&chart.draw())?;
        report!("plot: {}", self.file.path().display());
        Ok(())
    }
}

impl TestedGround {
    fn named(self) -> Floor {
        let first = self.levels.iter().min().copied().unwrap_or_default();
        let last = self.levels.iter().max().copied().unwrap_or_default();
        let range = if first == last { first.to_string() } else { format!("{first}..{last}") };
        Floor { name: format!("{}:{range}", self.mode), ..self.floor }
    }
}

// Rasterising of drawings.

/// Pixels of the picture per pixel of the drawing, so that it is sharp on any screen.
const ZOOM: f32 = 2.0;

/// Font size, in pixels of the picture, for each pixel of a letter's height.
const LETTER: f32 = 8.5;

/// Half of the width of an outline, in pixels of the picture.
const OUTLINE: f32 = 1.5;

/// Returns a drawing as the bytes of a PNG.
///
/// # Errors
///
/// It is too large for a PNG.
pub(crate) fn to_png(drawing: &Drawing) -> Result<Vec<u8>, CliError> {
    pictures::to_png(&paint(drawing)?)
}

fn paint(drawing: &Drawing) -> Result<Screen, CliError> {
    let size = (drawing.size * ZOOM).ceil().as_uvec2();
    let mut screen = Screen::new(size.x as usize, size.y as usize, [255; 3])?;
    for shape in &drawing.shapes {
        add(&mut screen, shape);
    }
    Ok(screen)
}

fn add(screen: &mut Screen, shape: &Shape) {
    match shape {
        Shape::Block { area, fill } => {
            let (min, max) = ((area.min * ZOOM).round().as_uvec2(), (area.max * ZOOM).round().as_uvec2());
            let size = max.saturating_sub(min);
            screen.block(min.x as usize, min.y as usize, size.x as usize, size.y as usize, *fill);
        }
        Shape::Line { points, width, colour, opacity } => {
            let points: Vec<_> = points.iter().map(|point| *point * ZOOM).collect();
            line(screen, &points, width * ZOOM / 2.0, *colour, *opacity);
        }
        Shape::Mark { form, centre, radius, fill, outline } => {
            let (centre, radius) = (*centre * ZOOM, radius * ZOOM);
            mark(screen, *form, centre, radius + OUTLINE, *outline);
            mark(screen, *form, centre, radius - OUTLINE, *fill);
        }
        Shape::Text { at, size, colour, words } => {
            let scale = (size * ZOOM / LETTER).round().max(1.0) as usize;
            let left = (at.x * ZOOM).round().max(0.0) as usize;
            let top = (at.y * ZOOM).round().max(0.0) as usize;
            caption::write(screen, words, scale, (left, top.saturating_sub(caption::HEIGHT * scale)), *colour);
        }
    }
}

/// Returns the pixels between two corners, clipped to the screen: first column and row, number of columns and rows.
fn window(screen: &Screen, min: Vec2, max: Vec2) -> [usize; 4] {
    let clamp = |at: f32, most: usize| at.clamp(0.0, most as f32) as usize;
    let (left, top) = (clamp(min.x.floor(), screen.width), clamp(min.y.floor(), screen.height));
    let (right, bottom) = (clamp(max.x.ceil(), screen.width), clamp(max.y.ceil(), screen.height));
    [left, top, right - left, bottom - top]
}

fn centre_of(column: usize, row: usize) -> Vec2 {
    Vec2::new(column as f32 + 0.5, row as f32 + 0.5)
}

/// Draws a line of a half width. Each pixel takes the coverage of the nearest piece, and is painted once.
fn line(screen: &mut Screen, points: &[Vec2], half: f32, colour: Rgb, opacity: f32) {
    let bounds = points.iter().fold(None, |bounds: Option<(Vec2, Vec2)>, point| {
        let (min, max) = bounds.unwrap_or((*point, *point));
        Some((min.min(*point), max.max(*point)))
    });
    let Some((min, max)) = bounds else { return };
    let [left, top, columns, rows] = window(screen, min - half - 1.0, max + half + 1.0);
    let mut covered = vec![0.0f32; columns * rows];
    for piece in points.windows(2) {
        let (from, to) = (piece[0], piece[1]);
        let [first, above, wide, high] = window(screen, from.min(to) - half - 1.0, from.max(to) + half + 1.0);
        for (row, column) in
            (above..above + high).flat_map(|row| (first..first + wide).map(move |column| (row, column)))
        {
            let coverage = (half + 0.5 - distance(centre_of(column, row), from, to)).clamp(0.0, 1.0);
            let pixel = &mut covered[(row - top) * columns + column - left];
            *pixel = pixel.max(coverage);
        }
    }
    for (at, coverage) in covered.into_iter().enumerate().filter(|(_, coverage)| *coverage > 0.0) {
        screen.blend(left + at % columns, top + at / columns, colour, coverage * opacity);
    }
}

/// Returns the distance from a point to a piece of a line.
fn distance(at: Vec2, from: Vec2, to: Vec2) -> f32 {
    let way = to - from;
    let along = ((at - from).dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    at.distance(from + way * along)
}

fn mark(screen: &mut Screen, form: MarkForm, centre: Vec2, radius: f32, colour: Rgb) {
    let [left, top, columns, rows] = window(screen, centre - radius - 1.0, centre + radius + 1.0);
    for (row, column) in (top..top + rows).flat_map(|row| (left..left + columns).map(move |column| (row, column))) {
        let away = centre_of(column, row) - centre;
        let inside = match form {
            MarkForm::Disc => radius - away.length(),
            MarkForm::Diamond => (radius - away.x.abs() - away.y.abs()) / std::f32::consts::SQRT_2,
        };
        screen.blend(column, row, colour, (inside + 0.5).clamp(0.0, 1.0));
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Rect;

    use super::*;

    fn pixel(screen: &Screen, x: usize, y: usize) -> [u8; 3] {
        let at = 3 * (y * screen.width + x);
        [screen.bytes()[at], screen.bytes()[at + 1], screen.bytes()[at + 2]]
    }

    #[test]
    fn shapes_are_where_the_drawing_has_them() {
        let (red, blue) = ([200, 0, 0], [0, 0, 200]);
        let shapes = vec![
            Shape::Block { area: Rect::new(1.0, 1.0, 5.0, 3.0), fill: red },
            Shape::Line {
                points: vec![Vec2::new(0.0, 10.0), Vec2::new(20.0, 10.0)],
                width: 2.0,
                colour: blue,
                opacity: 0.5,
            },
            Shape::Mark {
                form: MarkForm::Diamond,
                centre: Vec2::new(15.0, 20.0),
                radius: 4.0,
                fill: red,
                outline: blue,
            },
        ];
        let screen = paint(&Drawing { label: String::new(), size: Vec2::new(20.0, 30.0), shapes }).expect("small");
        assert_eq!((screen.width, screen.height), (40, 60));
        assert_eq!((pixel(&screen, 2, 2), pixel(&screen, 9, 5)), (red, red));
        assert_eq!((pixel(&screen, 1, 2), pixel(&screen, 10, 5)), ([255; 3], [255; 3]));
        assert_eq!(pixel(&screen, 20, 20), [128, 128, 228], "half of blue over white");
        assert_eq!(pixel(&screen, 20, 23), [255; 3]);
        assert_eq!(
            (pixel(&screen, 30, 40), pixel(&screen, 22, 33)),
            (red, [255; 3]),
            "the corners of a diamond are cut"
        );
    }

    #[test]
    fn what_lies_off_the_paper_is_cut() {
        let far = Vec2::splat(1e6);
        let shapes = vec![
            Shape::Line { points: vec![-far, far], width: 2.0, colour: [0; 3], opacity: 1.0 },
            Shape::Mark { form: MarkForm::Disc, centre: -far, radius: 5.0, fill: [0; 3], outline: [0; 3] },
            Shape::Text { at: far, size: 13.0, colour: [0; 3], words: "far".to_owned() },
        ];
        let screen = paint(&Drawing { label: String::new(), size: Vec2::splat(10.0), shapes }).expect("small");
        assert_eq!((pixel(&screen, 10, 10), pixel(&screen, 19, 0)), ([0; 3], [255; 3]));
    }
}
