//! The look of Maze2D: the whole maze from above, first row at the top, the ball in it and the goal.
//!
//! A maze of any size fills the picture. The ball is drawn larger than it is, to be visible on 64 pixels.

use crate::{
    maze::{Cell, Maze},
    maze2d::{
        arena::{MazeArena, MazeBall, PlaysIn},
        ball::{MAX_SPEED, Vec2d},
        level::{Maze2dLevel, centre},
    },
    pictures::{ArenaGrid, decode},
};
use bevy::{
    math::{Rect, Vec2},
    prelude::*,
};
use bevy_playbot::vision::{PaintedVelocity, Stage, TileLayer, VisionSystems};
use playbot_assets::maze2d;
use playbot_harness::{floor_plan::FloorPlan, prelude::*};
use std::sync::LazyLock;

/// Adds sprites and tiles to [`Maze2dPlugin`](crate::maze2d::Maze2dPlugin). Add it after the plugins that bring images,
/// such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct Maze2dPicturePlugin;

impl Plugin for Maze2dPicturePlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art)
            .init_resource::<ArenaGrid>()
            .add_systems(ObserveSchedule, (players, levels, balls).chain().in_set(VisionSystems::Sync));
    }
}

/// Width of an agent's view, in world units, and the least height. It is the longer side of the maze, so that all of it
/// is visible in any shape of the picture.
pub const VIEW: f32 = 12.0;

impl Maze2dLevel {
    /// Returns the maze with its walls as the ball meets them: x, to the right, is the row.
    pub fn floor_plan(&self) -> FloorPlan {
        let square = |cell| Rect::from_center_size(point(centre(cell)) - self.walls.offset() as f32, Vec2::ONE);
        let plan = self.maze.floor_plan(square, |cell| point(centre(cell)));
        FloorPlan { start: point(centre(self.start_cell)), goal: point(self.goal()), ..plan }
    }
}

/// Returns a position on the plan.
pub(super) fn point([x, y]: Vec2d) -> Vec2 {
    Vec2::new(x as f32, y as f32)
}

// The drawings, which come with the program.

/// Numbers of the tiles on their strip.
const WALL: u16 = 0;

const FLOOR: u16 = 1;

/// Decoded once for all Worlds: tiles, ball, goal.
static IMAGES: LazyLock<[Image; 3]> =
    LazyLock::new(|| [decode(maze2d::TILES), decode(maze2d::BALL), decode(maze2d::GOAL)]);

/// Handles of all drawings.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
struct Art {
    pub tiles: Handle<Image>,
    pub ball: Handle<Image>,
    pub goal: Handle<Image>,
}

impl Art {
    /// Adds the drawings to an app.
    pub fn add_to(images: &mut Assets<Image>) -> Self {
        let [tiles, ball, goal] = IMAGES.each_ref().map(|image| images.add(image.clone()));
        Self { tiles, ball, goal }
    }
}

// Drawings of arenas, and their motion.

/// Layers above the tiles.
const GOAL: f32 = 1.0;

const BALL: f32 = 2.0;

/// Diameters of goal and ball in small mazes and in large ones, cells, and the target diameter in between, world units.
const GOAL_SIZES: ([f32; 2], f32) = ([0.8, 1.2], 1.1);

const BALL_SIZES: ([f32; 2], f32) = ([0.55, 0.9], 0.75);

/// From one arena to the next: further than an agent sees.
const SPACING: f32 = 4.0 * VIEW;

/// The picture of an arena: the tiles, below the figures.
#[derive(Component, Reflect)]
#[reflect(Component)]
struct Board {
    tiles: Entity,
    goal: Entity,
    ball: Entity,
}

/// Makes the arenas of new agents into stages. The agent itself, which sensors follow, stands in the middle of the
/// picture.
fn players(
    new: Query<(Entity, &PlaysIn), (With<MazeBall>, Without<PaintedVelocity>)>,
    art: Res<Art>,
    mut grid: ResMut<ArenaGrid>,
    mut commands: Commands,
) {
    for (player, plays_in) in &new {
        let tiles = commands.spawn((ChildOf(plays_in.0), Transform::default(), Visibility::default())).id();
        let mut figure = |image: &Handle<Image>| {
            let sprite = Sprite { custom_size: Some(Vec2::ONE), ..Sprite::from_image(image.clone()) };
            commands.spawn((ChildOf(tiles), sprite, Transform::default())).id()
        };
        let (goal, ball) = (figure(&art.goal), figure(&art.ball));
        commands.entity(plays_in.0).insert((Stage, grid.next(SPACING), Board { tiles, goal, ball }));
        let middle = Transform::from_xyz(VIEW / 2.0, VIEW / 2.0, 0.0);
        commands.entity(player).insert((
            ChildOf(plays_in.0),
            middle,
            Visibility::default(),
            PaintedVelocity::default(),
        ));
    }
}

/// Lays out the tiles and the goal of new levels.
fn levels(
    changed: Query<(&MazeArena, &Board), Or<(Changed<MazeArena>, Added<Board>)>>,
    mut places: Query<&mut Transform>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (arena, board) in &changed {
        let maze = &arena.level.maze;
        let (rows, columns) = (maze.rows() as f32, maze.columns() as f32);
        let scale = VIEW / rows.max(columns);
        let corner = Vec2::new(VIEW - scale * columns, VIEW - scale * rows) / 2.0;
        let place = Transform::from_translation(corner.extend(0.0)).with_scale(Vec3::new(scale, scale, 1.0));
        let (tileset, cells) = (art.tiles.clone(), cells(maze));
        let (columns, rows) = (maze.columns() as u32, maze.rows() as u32);
        commands.entity(board.tiles).insert((TileLayer { tileset, columns, rows, cells, outside: WALL }, place));
        if let Ok(mut goal) = places.get_mut(board.goal) {
            *goal = figure_at(on_board(&arena.level, arena.level.goal()).extend(GOAL), GOAL_SIZES, scale);
        }
        if let Ok(mut ball) = places.get_mut(board.ball) {
            *ball = figure_at(on_board(&arena.level, arena.level.start.position).extend(BALL), BALL_SIZES, scale);
        }
    }
}

/// Places a figure that stays visible at any scale of the tiles.
fn figure_at(place: Vec3, ([least, most], wanted): ([f32; 2], f32), scale: f32) -> Transform {
    let size = (wanted / scale).clamp(least, most);
    Transform::from_translation(place).with_scale(Vec3::new(size, size, 1.0))
}

/// Returns the tile numbers of all cells, bottom row first: the last row of the maze.
fn cells(maze: &Maze) -> Vec<u16> {
    let rows = (0..maze.rows()).rev();
    let all = rows.flat_map(|row| (0..maze.columns()).map(move |column| Cell::new(row, column)));
    all.map(|cell| if maze.is_free(cell) { FLOOR } else { WALL }).collect()
}

/// Returns a position on the tiles: columns go to the right and rows down, and the walls are at their actual positions.
fn on_board(level: &Maze2dLevel, place: Vec2d) -> Vec2 {
    let [down, right] = place.map(|along| (along + level.walls.offset() + 0.5) as f32);
    Vec2::new(right, level.maze.rows() as f32 - down)
}

/// Moves the balls.
fn balls(
    mut players: Query<(&MazeBall, &PlaysIn, &mut PaintedVelocity)>,
    arenas: Query<(&MazeArena, &Board)>,
    mut places: Query<&mut Transform>,
) {
    for (ball, plays_in, mut velocity) in &mut players {
        let Ok((arena, board)) = arenas.get(plays_in.0) else { continue };
        if let Ok(mut place) = places.get_mut(board.ball) {
            place.translation = on_board(&arena.level, ball.0.position).extend(BALL);
        }
        let [down, right] = ball.0.velocity.map(|speed| (speed / MAX_SPEED) as f32);
        velocity.0 = Vec2::new(right, -down);
    }
}
