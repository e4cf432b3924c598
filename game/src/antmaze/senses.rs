//! AntMaze with more observations: goal and rays, a map, or positional encoding.

use crate::{
    ant::contact::Walls,
    antmaze::{
        AntMaze, arena,
        arena::{InMaze, MazeAnt},
        geometry::{CELL, cell_at},
    },
    senses::{
        Senses, WithMap, WithObservations, WithPositionalEncoding, WithRays, push_map, push_positional_encoding,
        push_rays,
    },
};
use bevy::{math::Vec3, prelude::*};
use bevy_playbot::vision::VisionSystems;
use bevy_rapier3d::rapier::prelude::{QueryFilter, Ray};
use playbot_harness::prelude::*;

/// Length of a ray, in metres: two cells.
pub const RAY_LENGTH: f32 = 8.0;

/// Heights of rays, in metres, between the floor and the top of the walls.
const RAY_HEIGHTS: std::ops::RangeInclusive<f32> = 0.1..=1.9;

/// AntMaze with rays, under its name `antmaze-sighted`. East is x and north is y.
pub type AntMazeWithRays = WithObservations<AntMaze, WithRays>;

/// AntMaze with rays and a map, under its names `antmaze-mapped` and `antmaze-with-map`.
pub type AntMazeWithMap = WithObservations<AntMaze, WithMap>;

/// AntMaze with positional encoding, under its name `antmaze-placed`.
pub type AntMazeWithPositionalEncoding = WithObservations<AntMaze, WithPositionalEncoding>;

impl Senses<AntMaze> for WithRays {
    const NAME: &'static str = "antmaze-sighted";
    const ALIASES: &'static [&'static str] = &["antmaze-with-rays"];

    fn build(self, app: &mut App) {
        app.add_systems(ObserveSchedule, sense_rays.after(arena::observe).before(VisionSystems::Sync));
    }
}

impl Senses<AntMaze> for WithMap {
    const NAME: &'static str = "antmaze-mapped";
    const ALIASES: &'static [&'static str] = &["antmaze-with-map"];

    fn build(self, app: &mut App) {
        let systems = (sense_rays, sense_map).chain();
        app.add_systems(ObserveSchedule, systems.after(arena::observe).before(VisionSystems::Sync));
    }
}

impl Senses<AntMaze> for WithPositionalEncoding {
    const NAME: &'static str = "antmaze-placed";
    const ALIASES: &'static [&'static str] = &["antmaze-with-positional-encoding"];

    fn build(self, app: &mut App) {
        app.add_systems(ObserveSchedule, sense_positional_encoding.after(arena::observe).before(VisionSystems::Sync));
    }
}

fn sense_rays(mut ants: Query<(&Episode, &MazeAnt, &InMaze, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, level, mut observation) in &mut ants {
        if episode.is_running() {
            let at = ant.0.torso().0;
            let from = Vec3::new(at.x, at.y, at.z.clamp(*RAY_HEIGHTS.start(), *RAY_HEIGHTS.end()));
            let to_goal = Vec2::from(level.0.goal_at) - at.truncate();
            push_rays(&mut observation, to_goal.to_array(), |direction| distance(ant.0.walls(), from, direction));
        }
    }
}

fn sense_map(mut ants: Query<(&Episode, &MazeAnt, &InMaze, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, level, mut observation) in &mut ants {
        if episode.is_running() {
            let maze = &level.0.maze;
            let here = cell_at(maze, ant.0.torso().0.truncate().to_array());
            // Outside the maze, where no legal play leads, all is wall.
            push_map(&mut observation, |[east, north]| {
                here.and_then(|cell| cell.moved(north, east)).is_none_or(|cell| !maze.is_free(cell))
            });
        }
    }
}

fn sense_positional_encoding(mut ants: Query<(&Episode, &MazeAnt, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, mut observation) in &mut ants {
        if episode.is_running() {
            let position = ant.0.torso().0.truncate().as_dvec2() / f64::from(CELL);
            push_positional_encoding(&mut observation, position.to_array());
        }
    }
}

fn distance(walls: &Walls, from: Vec3, [east, north]: [f64; 2]) -> f32 {
    let ray = Ray::new(from, Vec3::new(east as f32, north as f32, 0.0));
    walls
        .physics()
        .cast_ray(&ray, RAY_LENGTH, true, QueryFilter::default())
        .map_or(RAY_LENGTH, |(_, distance)| distance)
}

#[cfg(test)]
mod tests {
    use playbot_harness::worlds::build_world;

    use super::*;
    use crate::maze::Cell;

    #[test]
    fn an_ant_at_the_start_of_medium_sees_its_room_and_the_way_to_the_goal() {
        let game = AntMazeWithRays::default();
        let (mut world, agents) = build_world(&game, "medium", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform));
        world.tick().expect("sound");
        let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
        assert_eq!(seen.len(), game.observation().len());
        let position = Vec2::new(seen[0], seen[1]);
        let near = |value: f32, wanted: f32| assert!((value - wanted).abs() < 1e-3, "{value} instead of {wanted}");
        near(seen[29], 20.0 - position.x);
        near(seen[30], 20.0 - position.y);
        // The room is two cells wide and high, from 2 m before the start: its walls are at -2 and 6.
        near(seen[31], 6.0 - position.x);
        near(seen[33], 6.0 - position.y);
        near(seen[35], 2.0 + position.x);
        near(seen[37], 2.0 + position.y);
        let slant = std::f32::consts::SQRT_2 * (2.0 + position.min_element());
        near(seen[36], slant);
    }

    #[test]
    fn the_map_has_the_north_first_which_is_the_end_of_the_rows() {
        let game = AntMazeWithMap::default();
        let (mut world, agents) = build_world(&game, "medium", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform));
        world.tick().expect("sound");
        let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
        let rows: Vec<String> = seen[39..]
            .chunks(11)
            .map(|row| row.iter().map(|&cell| if cell > 0.5 { '#' } else { 'O' }).collect())
            .collect();
        // It starts in (1, 1): from row 6 down to row -4, and from column -4 to column 6.
        let wanted =
            ["#####OOO#OO", "#####O#OO#O", "#####OO#OOO", "######OOO##", "#####OO#OOO", "#####OO##OO", "###########"];
        assert_eq!(rows[..7], wanted[..]);
        assert!(rows[7..].iter().all(|row| row == "###########"));
    }

    #[test]
    fn the_encoding_is_of_the_observed_position_in_metres() {
        let game = AntMazeWithPositionalEncoding::default();
        for level in 0..4 {
            let (mut world, agents) = build_world(&game, "xl+random-start", 0, 0, 1);
            world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(level)));
            for _ in 0..5 {
                world.tick().expect("sound");
            }
            let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
            // The shortest wavelength of x and y is a cell, the longest of x eight cells.
            let turn = |metres: f32, length: f32| (metres / length * std::f32::consts::TAU).sin_cos();
            let encoded = [(seen[35], seen[36]), (seen[43], seen[44]), (seen[29], seen[30])];
            let wanted = [turn(seen[0], 4.0), turn(seen[1], 4.0), turn(seen[0], 32.0)];
            for ((sine, cosine), (by, beside)) in encoded.into_iter().zip(wanted) {
                assert!(
                    (sine - by).abs() < 1e-4 && (cosine - beside).abs() < 1e-4,
                    "level {level}: {encoded:?}, {wanted:?}"
                );
            }
        }
    }

    #[test]
    fn the_map_goes_with_the_ant() {
        let game = AntMazeWithMap::default();
        for level in 0..8 {
            let (mut world, agents) = build_world(&game, "medium+random-start", 0, 0, 1);
            world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(level)));
            world.tick().expect("sound");
            let InMaze(played) = world.get::<InMaze>(agents[0]).expect("a level");
            let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector[39..];
            for (at, &value) in seen.iter().enumerate() {
                let (north, east) = (5 - (at / 11) as i32, (at % 11) as i32 - 5);
                let [row, col] = [played.start.row as i32 + north, played.start.col as i32 + east];
                let inside = (0..8).contains(&row) && (0..8).contains(&col);
                let free = inside && played.maze.is_free(Cell::new(row as usize, col as usize));
                assert_eq!(value > 0.5, !free, "level {level}, from {} to ({row}, {col})", played.start);
            }
        }
    }
}
