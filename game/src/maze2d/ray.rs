//! Distance to the next wall.

use super::{
    ball::Vec2d,
    walls::{HALF, Walls},
};

impl Walls {
    /// Returns the distance from a position to the nearest wall in a direction of length 1, m; at most `most`. 0 inside
    /// a wall.
    ///
    /// Walks from cell to cell through the sides that the ray leaves by. Each is computed from the position itself, so
    /// no error adds up. Every maze is closed, so the walk ends.
    pub fn ray(&self, place: Vec2d, way: Vec2d, most: f64) -> f64 {
        let (row, column) = self.cell_at(place);
        let mut cell = [row, column];
        let mut gone: f64 = 0.0;
        while !self.is_solid(cell[0], cell[1]) {
            let middle = self.centre(cell[0], cell[1]);
            let until_side = [0, 1].map(|axis: usize| match way[axis] {
                0.0 => f64::INFINITY,
                along => (middle[axis] + HALF.copysign(along) - place[axis]) / along,
            });
            // Through a corner it takes the first axis, so it never passes between two walls that touch there.
            let axis = usize::from(until_side[1] < until_side[0]);
            gone = until_side[axis];
            if gone >= most {
                return most;
            }
            cell[axis] += if way[axis] > 0.0 { 1 } else { -1 };
        }
        // Rounding can put a position on a side beyond it.
        gone.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use bevy_rapier2d::rapier::prelude::{QueryFilter, Ray, Vector};
    use playbot_learner::rng::Streams;

    use super::*;
    use crate::{
        maze::Maze,
        maze2d::{
            Ball,
            draws::uniform,
            level::{any_cell, centre},
            physics::MazePhysics,
        },
        senses::sighted::WAYS,
    };

    fn walls(rows: &[&str], offset: f64) -> Walls {
        Walls::new(&Maze::parse(rows).expect("a maze"), offset)
    }

    #[test]
    fn no_ray_slips_between_walls_that_touch_at_a_corner() {
        let walls = walls(&["#####", "#SO##", "#O#O#", "#OOG#", "#####"], 0.0);
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        // Between (1, 3) and (2, 2), from the middles of (1, 2) and (2, 3), exactly to the corner where the four meet.
        for (from, way) in [([1.0, 2.0], [diagonal, diagonal]), ([2.0, 3.0], [-diagonal, -diagonal])] {
            assert!((walls.ray(from, way, 9.0) - diagonal).abs() < 1e-12, "{from:?}");
        }
    }

    #[test]
    fn rays_end_at_sight_in_walls_and_outside() {
        let walls = walls(&["######", "#SOOG#", "######"], 0.2);
        let east = [0.0, 1.0];
        assert!((walls.ray([0.8, 0.8], east, 9.0) - 3.5).abs() < 1e-12);
        assert_eq!(walls.ray([0.8, 0.8], east, 2.0), 2.0);
        assert_eq!(walls.ray([0.0, 0.8], east, 9.0), 0.0, "inside a wall");
        assert_eq!(walls.ray([-7.0, 30.0], east, 9.0), 0.0, "outside");
        assert_eq!(walls.ray([f64::NAN, 0.8], east, 9.0), 0.0);
    }

    #[test]
    fn rapier_measures_the_same() {
        let mut rng = Streams::new(1).stream("rays", 0);
        for seed in 0..8 {
            let mode: crate::maze2d::Maze2dMode = "random+loops=0.3".parse().expect("a mode");
            let maze = mode.maze(seed).expect("a maze");
            let walls = Walls::new(&maze, [0.0, 0.2][seed as usize % 2]);
            let physics = MazePhysics::following(&walls, &Ball::default());
            let filter = QueryFilter::default().exclude_rigid_body(physics.ball());
            for _ in 0..50 {
                let place =
                    centre(any_cell(&maze, &mut rng)).map(|along| along - walls.offset() + uniform(&mut rng, 0.4));
                for (name, [x, y]) in WAYS {
                    let ray = Ray::new(Vector::new(place[0] as f32, place[1] as f32), Vector::new(x as f32, y as f32));
                    let found = physics.world.cast_ray(&ray, 4.0, true, filter).map_or(4.0, |(_, distance)| distance);
                    let ours = walls.ray(place, [x, y], 4.0);
                    assert!((ours - f64::from(found)).abs() < 1e-4, "{name} of {place:?}: {ours}, not {found}");
                }
            }
        }
    }
}
