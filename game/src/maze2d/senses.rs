//! Maze2D with more observations: goal and rays, a map, or positional encoding.

use crate::{
    maze2d::{
        Maze2d, arena,
        arena::{MazeArena, MazeBall, PlaysIn},
        ball::sub,
    },
    senses::{
        Senses, WithMap, WithObservations, WithPositionalEncoding, WithRays, push_map, push_positional_encoding,
        push_rays,
    },
};
use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_harness::prelude::*;

/// Length of a ray from the centre of a ball, in metres: four cells.
pub const RAY_LENGTH: f64 = 4.0;

/// Maze2D with rays, under its name `maze2d-sighted`. As in the picture, east is along the columns, y, and north is up
/// the rows, against x.
pub type Maze2dWithRays = WithObservations<Maze2d, WithRays>;

/// Maze2D with rays and a map, under its names `maze2d-mapped` and `maze2d-with-map`.
pub type Maze2dWithMap = WithObservations<Maze2d, WithMap>;

/// Maze2D with positional encoding, under its name `maze2d-placed`.
pub type Maze2dWithPositionalEncoding = WithObservations<Maze2d, WithPositionalEncoding>;

impl Senses<Maze2d> for WithRays {
    const NAME: &'static str = "maze2d-sighted";
    const ALIASES: &'static [&'static str] = &["maze2d-with-rays"];

    fn build(self, app: &mut App) {
        app.add_systems(ObserveSchedule, sense_rays.after(arena::observe).before(VisionSystems::Sync));
    }
}

impl Senses<Maze2d> for WithMap {
    const NAME: &'static str = "maze2d-mapped";
    const ALIASES: &'static [&'static str] = &["maze2d-with-map"];

    fn build(self, app: &mut App) {
        let systems = (sense_rays, sense_map).chain();
        app.add_systems(ObserveSchedule, systems.after(arena::observe).before(VisionSystems::Sync));
    }
}

impl Senses<Maze2d> for WithPositionalEncoding {
    const NAME: &'static str = "maze2d-placed";
    const ALIASES: &'static [&'static str] = &["maze2d-with-positional-encoding"];

    fn build(self, app: &mut App) {
        app.add_systems(ObserveSchedule, sense_positional_encoding.after(arena::observe).before(VisionSystems::Sync));
    }
}

/// Adds goal and rays to observations. The walls are squares on a grid, and arenas have no rapier context in training.
/// So rays walk the grid, which is exact and takes no more than a few steps.
fn sense_rays(
    mut balls: Query<(&Episode, &MazeBall, &PlaysIn, &mut Observation), With<VectorSensor>>,
    arenas: Query<&MazeArena>,
) {
    for (episode, ball, plays_in, mut observation) in &mut balls {
        let Ok(arena) = arenas.get(plays_in.0) else { continue };
        if episode.is_running() {
            let (position, level) = (ball.0.position, &arena.level);
            let to_goal = sub(level.goal(), position).map(|along| along as f32);
            let wall = |[east, north]: [f64; 2]| level.walls.ray(position, [-north, east], RAY_LENGTH) as f32;
            push_rays(&mut observation, to_goal, wall);
        }
    }
}

fn sense_map(
    mut balls: Query<(&Episode, &MazeBall, &PlaysIn, &mut Observation), With<VectorSensor>>,
    arenas: Query<&MazeArena>,
) {
    for (episode, ball, plays_in, mut observation) in &mut balls {
        let Ok(arena) = arenas.get(plays_in.0) else { continue };
        if episode.is_running() {
            let walls = &arena.level.walls;
            let (row, column) = walls.cell_at(ball.0.position);
            push_map(&mut observation, |[east, north]| walls.is_solid(row - north, column + east));
        }
    }
}

/// Cells are 1 m wide.
fn sense_positional_encoding(mut balls: Query<(&Episode, &MazeBall, &mut Observation), With<VectorSensor>>) {
    for (episode, ball, mut observation) in &mut balls {
        if episode.is_running() {
            push_positional_encoding(&mut observation, ball.0.position);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::SQRT_2;

    use playbot_harness::worlds::build_world;

    use super::*;
    use crate::maze2d::Ball;

    /// Returns the observation of a ball at rest at this position.
    fn seen(game: &dyn Game, mode: &str, position: [f64; 2]) -> Vec<f32> {
        let (mut world, agents) = build_world(game, mode, 0, 0, 1);
        let still = Action(ActionValue::Continuous(vec![0.0; 2]));
        world.entity_mut(agents[0]).insert((Control::Human, still, LevelQueue::Always(0)));
        world.tick().expect("sound");
        world.entity_mut(agents[0]).insert(MazeBall(Ball::at(position)));
        world.tick().expect("sound");
        let seen = world.get::<Observation>(agents[0]).expect("an agent").vector.clone();
        assert_eq!(seen.len(), game.observation().len());
        seen
    }

    fn assert_near(seen: &[f32], wanted: &[f32]) {
        assert_eq!(seen.len(), wanted.len());
        assert!(seen.iter().zip(wanted).all(|(seen, wanted)| (seen - wanted).abs() < 1e-5), "{seen:?}, not {wanted:?}");
    }

    #[test]
    fn a_ball_in_medium_sees_the_walls_where_they_stand_and_the_way_to_the_goal() {
        // Cell (2, 2) of medium; by hand, from its map:
        //     01234567
        //   0 ########
        //   1 #SO##OO#
        //   2 #OO#OOO#
        //   3 ##OOO###
        //   4 #OO#OOO#
        //   5 #O#OO#O#
        // East is wall (2, 3), north-east the same, north (0, 2), north-west (1, 0), west (2, 0), south-west (3, 1),
        // south (5, 2), south-east (4, 3). The goal is in (6, 6).
        let position = [2.1, 2.05];
        let walls = |[e, ne, n, nw, w, sw, s, se]: [f32; 8]| {
            [2.1, 2.05, 0.0, 0.0, 3.9, 3.95, e, SQRT_2 * ne, n, SQRT_2 * nw, w, SQRT_2 * sw, s, SQRT_2 * se]
        };
        assert_near(
            &seen(&Maze2dWithRays::default(), "medium+no-offset", position),
            &walls([0.45, 0.45, 1.6, 1.55, 1.55, 0.55, 2.4, 1.4]),
        );
        // With D4RL's offset they stand 0.2 nearer in the east and south, and farther in the west and north; the goal
        // stays.
        assert_near(
            &seen(&Maze2dWithRays::default(), "medium", position),
            &walls([0.25, 0.25, 1.8, 1.75, 1.75, 0.75, 2.2, 1.2]),
        );
    }

    #[test]
    fn no_ray_reaches_farther_than_four_cells() {
        // Six free cells to the east of (3, 1), a wall right behind it.
        let seen = seen(&Maze2dWithRays::default(), "large+no-offset", [3.0, 1.0]);
        assert_near(&[seen[6], seen[10]], &[4.0, 0.5]);
    }

    #[test]
    fn the_map_has_the_cells_around_and_walls_outside() {
        let rows = |mode, position| -> Vec<String> {
            let seen = seen(&Maze2dWithMap::default(), mode, position);
            let row = |row: &[f32]| row.iter().map(|&cell| if cell > 0.5 { '#' } else { 'O' }).collect();
            seen[14..].chunks(11).map(row).collect()
        };
        // Medium from row -3 to row 7, and from column -3 to column 7.
        let wanted = [
            "###########",
            "###########",
            "###########",
            "###########",
            "####OO##OO#",
            "####OO#OOO#",
            "#####OOO###",
            "####OO#OOO#",
            "####O#OO#O#",
            "####OOO#OO#",
            "###########",
        ];
        assert_eq!(rows("medium+no-offset", [2.1, 2.05]), wanted);
        // With D4RL's offset the same position is in cell (2, 2), and 0.3 further down in (3, 2): the map moves by a
        // row.
        assert_eq!(rows("medium", [2.1, 2.05]), wanted);
        assert_eq!(rows("medium", [2.35, 2.05])[..10], wanted[1..]);
        assert_eq!(rows("medium+no-offset", [2.35, 2.05]), wanted);
    }

    #[test]
    fn the_encoding_is_of_the_position_in_cells() {
        // A whole wavelength of a cell along x and a quarter of one along y.
        let seen = seen(&Maze2dWithPositionalEncoding::default(), "medium+no-offset", [2.0, 2.25]);
        assert_near(&seen[..4], &[2.0, 2.25, 0.0, 0.0]);
        assert_near(&[seen[10], seen[11], seen[18], seen[19]], &[0.0, 1.0, 1.0, 0.0]);
        // A quarter of eight cells along x.
        assert_near(&seen[4..6], &[1.0, 0.0]);
    }
}
