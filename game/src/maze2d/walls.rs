//! The walls of the ball: squares of side 1, one for each wall cell.

use crate::{
    maze::{Cell, Maze},
    maze2d::ball::{Ball, DAMPING, MASS, RADIUS, Vec2d, add, dot, length, scale, sub},
};

/// Offset of D4RL's walls from their coordinates, along both axes: a cell (i, j) is centred at (i - 0.2, j - 0.2).
/// Starts, goals and rewards use (i, j).
pub const D4RL_OFFSET: f64 = 0.2;

/// Half the side of a wall.
pub const HALF: f64 = 0.5;

/// The walls of a maze in the coordinates of the observation.
#[derive(Clone, Debug)]
pub struct Walls {
    rows: usize,
    columns: usize,
    solid: Vec<bool>,
    offset: f64,
}

/// A wall within reach of the ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Unit vector from the wall to the centre of the ball.
    pub normal: Vec2d,
    /// Distance between the surfaces, m; negative if they overlap.
    pub gap: f64,
}

/// Most walls that a ball can be near: the cells around its own, without the one it is in.
const MOST: usize = 9;

/// The walls near a ball.
#[derive(Clone, Copy, Debug)]
pub struct Touches {
    list: [Touch; MOST],
    len: usize,
}

impl Touches {
    /// Returns the walls, in the order of their rows and columns.
    pub fn as_slice(&self) -> &[Touch] {
        &self.list[..self.len]
    }
}

impl Walls {
    /// Returns the walls of a maze, moved by `-offset` along both axes.
    pub fn new(maze: &Maze, offset: f64) -> Self {
        let (rows, columns) = (maze.rows(), maze.columns());
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |col| Cell::new(row, col)));
        let solid = cells.map(|cell| !maze.is_free(cell)).collect();
        Self { rows, columns, solid, offset }
    }

    /// Returns true if a cell is a wall; everything outside the maze is.
    pub(super) fn is_solid(&self, row: i32, column: i32) -> bool {
        match (usize::try_from(row), usize::try_from(column)) {
            (Ok(row), Ok(column)) if row < self.rows && column < self.columns => {
                self.solid[row * self.columns + column]
            }
            _ => true,
        }
    }

    /// Returns the offset of the walls, along both axes.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Returns the centre of a cell.
    pub fn centre(&self, row: i32, column: i32) -> Vec2d {
        [f64::from(row) - self.offset, f64::from(column) - self.offset]
    }

    /// Returns the cell around a position, as row and column; it may lie outside the maze.
    pub fn cell_at(&self, position: Vec2d) -> (i32, i32) {
        let [row, column] = position.map(|along| (along + self.offset).round() as i32);
        (row, column)
    }

    /// Returns true if a position lies in a free cell.
    pub fn is_free(&self, position: Vec2d) -> bool {
        let (row, column) = self.cell_at(position);
        !self.is_solid(row, column)
    }

    /// Returns row and column of every wall, in this order.
    pub fn cells(&self) -> impl Iterator<Item = (i32, i32)> {
        let cells = (0..self.rows as i32).flat_map(|row| (0..self.columns as i32).map(move |column| (row, column)));
        cells.filter(|&(row, column)| self.is_solid(row, column))
    }

    /// Returns the walls whose surface is closer than `margin` to that of a ball.
    pub fn touches(&self, position: Vec2d, margin: f64) -> Touches {
        let mut found = Touches { list: [Touch { normal: [0.0; 2], gap: 0.0 }; MOST], len: 0 };
        let (row, column) = self.cell_at(position);
        if self.is_clear(position, row, column, margin) {
            return found;
        }
        for row in row - 1..=row + 1 {
            for column in column - 1..=column + 1 {
                if !self.is_solid(row, column) {
                    continue;
                }
                let touch = touch(self.centre(row, column), position);
                if touch.gap < margin {
                    found.list[found.len] = touch;
                    found.len += 1;
                }
            }
        }
        found
    }

    /// Returns true if a position is so far within its free cell that no wall can be near: most are.
    fn is_clear(&self, position: Vec2d, row: i32, column: i32, margin: f64) -> bool {
        let [x, y] = sub(position, self.centre(row, column));
        x.abs().max(y.abs()) <= HALF - RADIUS - margin && !self.is_solid(row, column)
    }
}

/// Returns the contact of a ball and a wall.
fn touch(centre: Vec2d, position: Vec2d) -> Touch {
    let from = sub(position, centre);
    let nearest = add(centre, from.map(|along| along.clamp(-HALF, HALF)));
    let out = sub(position, nearest);
    let distance = length(out);
    if distance > 0.0 {
        return Touch { normal: out.map(|along| along / distance), gap: distance - RADIUS };
    }
    // The centre is inside the wall, where no legal play leads: the direction is out through the nearest side.
    let axis = usize::from(from[1].abs() > from[0].abs());
    let mut normal = [0.0; 2];
    normal[axis] = if from[axis] < 0.0 { -1.0 } else { 1.0 };
    Touch { normal, gap: from[axis].abs() - HALF - RADIUS }
}

impl Walls {
    /// Returns the distance from a position to the nearest wall in a direction of length 1, m; at most `most`. 0 inside
    /// a wall.
    ///
    /// Walks from cell to cell through the sides that the ray leaves by. Each is computed from the position itself, so
    /// no error adds up. Every maze is closed, so the walk ends.
    pub fn ray(&self, position: Vec2d, direction: Vec2d, most: f64) -> f64 {
        let (row, column) = self.cell_at(position);
        let mut cell = [row, column];
        let mut gone: f64 = 0.0;
        while !self.is_solid(cell[0], cell[1]) {
            let middle = self.centre(cell[0], cell[1]);
            let until_side = [0, 1].map(|axis: usize| match direction[axis] {
                0.0 => f64::INFINITY,
                along => (middle[axis] + HALF.copysign(along) - position[axis]) / along,
            });
            // Through a corner it takes the first axis, so it never passes between two walls that touch there.
            let axis = usize::from(until_side[1] < until_side[0]);
            gone = until_side[axis];
            if gone >= most {
                return most;
            }
            cell[axis] += if direction[axis] > 0.0 { 1 } else { -1 };
        }
        // Rounding can put a position on a side beyond it.
        gone.max(0.0)
    }
}

// Contact as MuJoCo 3.1.6 solves it for D4RL's ball and walls, in closed form.
//
// MuJoCo's contacts are soft constraints: each has a reference acceleration that brings the surfaces apart like a
// damped spring, and a weight. The acceleration is the one with the least cost: the smallest deviation from the free
// acceleration and from the references that it falls short of. With MuJoCo's defaults (`solref` 0.02 1, `solimp` 0.9
// 0.95 0.001, margin 0.002) and two dimensions there is little left to solve.

/// Contacts act when the surfaces are closer than this, m.
pub const MARGIN: f64 = 0.002;

/// Least and most impedance, and the depth at which it is most, m.
const IMPEDANCE: [f64; 2] = [0.9, 0.95];

const DEPTH: f64 = 0.001;

/// Time constant of the reference, s; its damping ratio is 1.
const TIME: f64 = 0.02;

/// One contact of the step.
#[derive(Clone, Copy, Default)]
struct Contact {
    normal: Vec2d,
    /// Requested acceleration along the normal.
    target: f64,
    /// Cost of falling short of it.
    weight: f64,
}

/// Most contacts at once: more walls than these cannot be within the margin of a ball that is outside of all.
const SOFT_CONTACT_MOST: usize = 4;

/// Returns the force of the walls on a ball that is driven by `drive`, N.
pub fn contact_force(ball: &Ball, drive: Vec2d, walls: &Walls) -> Vec2d {
    let touches = walls.touches(ball.position, MARGIN);
    if touches.as_slice().is_empty() {
        return [0.0; 2];
    }
    let (contacts, count) = contacts(ball, &touches);
    let contacts = &contacts[..count];
    let free = sub(scale(drive, 1.0 / MASS), scale(ball.velocity, DAMPING / MASS));
    let acceleration = least_cost(free, contacts);
    let force_of = |contact: &Contact| {
        let short = (contact.target - dot(contact.normal, acceleration)).max(0.0);
        scale(contact.normal, contact.weight * short)
    };
    contacts.iter().map(force_of).fold([0.0; 2], add)
}

fn contacts(ball: &Ball, touches: &Touches) -> ([Contact; SOFT_CONTACT_MOST], usize) {
    let mut contacts = [Contact::default(); SOFT_CONTACT_MOST];
    let mut count = 0;
    for (contact, touch) in contacts.iter_mut().zip(touches.as_slice()) {
        let depth = touch.gap - MARGIN;
        let impedance = impedance(depth.abs() / DEPTH);
        let (damping, stiffness) = (2.0 / (IMPEDANCE[1] * TIME), 1.0 / (IMPEDANCE[1] * TIME).powi(2));
        *contact = Contact {
            normal: touch.normal,
            target: -damping * dot(touch.normal, ball.velocity) - stiffness * impedance * depth,
            weight: MASS * impedance / (1.0 - impedance),
        };
        count += 1;
    }
    (contacts, count)
}

/// Returns the impedance at a depth in units of [`DEPTH`]: from least to most along two parabolas.
fn impedance(depth: f64) -> f64 {
    let rise = match depth {
        ..=0.5 => 2.0 * depth * depth,
        0.5..1.0 => 1.0 - 2.0 * (1.0 - depth) * (1.0 - depth),
        _ => 1.0,
    };
    IMPEDANCE[0] + (IMPEDANCE[1] - IMPEDANCE[0]) * rise
}

/// Returns the acceleration with the least cost.
///
/// The cost is convex and, for each choice of contacts that push, quadratic. The choice that is consistent with its own
/// minimum is the right one.
fn least_cost(free: Vec2d, contacts: &[Contact]) -> Vec2d {
    let mut best = free;
    for pushing in 0..1_u32 << contacts.len() {
        let pushes = |index: usize| pushing & 1 << index != 0;
        let acceleration = minimum(free, contacts, pushes);
        let is_consistent =
            |(index, contact): (usize, &Contact)| (dot(contact.normal, acceleration) < contact.target) == pushes(index);
        if contacts.iter().enumerate().all(is_consistent) {
            return acceleration;
        }
        best = acceleration;
    }
    // Rounding has left no choice consistent: all push.
    best
}

/// Returns the minimum of the cost if exactly these contacts push: two linear equations.
fn minimum(free: Vec2d, contacts: &[Contact], pushes: impl Fn(usize) -> bool) -> Vec2d {
    let (mut xx, mut xy, mut yy) = (MASS, 0.0, MASS);
    let mut right = scale(free, MASS);
    for (_, contact) in contacts.iter().enumerate().filter(|&(index, _)| pushes(index)) {
        let Contact { normal: [x, y], target, weight } = *contact;
        xx += weight * x * x;
        xy += weight * x * y;
        yy += weight * y * y;
        right = add(right, scale(contact.normal, weight * target));
    }
    let determinant = xx * yy - xy * xy;
    [(yy * right[0] - xy * right[1]) / determinant, (xx * right[1] - xy * right[0]) / determinant]
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
            level::{any_cell, centre, uniform},
            physics::MazePhysics,
        },
        senses::DIRECTIONS,
    };

    fn walls(rows: &[&str], offset: f64) -> Walls {
        Walls::new(&Maze::parse(rows).expect("a maze"), offset)
    }

    #[test]
    fn no_ray_slips_between_walls_that_touch_at_a_corner() {
        let walls = walls(&["#####", "#SO##", "#O#O#", "#OOG#", "#####"], 0.0);
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        // Between (1, 3) and (2, 2), from the middles of (1, 2) and (2, 3), exactly to the corner where the four meet.
        for (from, direction) in [([1.0, 2.0], [diagonal, diagonal]), ([2.0, 3.0], [-diagonal, -diagonal])] {
            assert!((walls.ray(from, direction, 9.0) - diagonal).abs() < 1e-12, "{from:?}");
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
                let position =
                    centre(any_cell(&maze, &mut rng)).map(|along| along - walls.offset() + uniform(&mut rng, 0.4));
                for (name, [x, y]) in DIRECTIONS {
                    let ray =
                        Ray::new(Vector::new(position[0] as f32, position[1] as f32), Vector::new(x as f32, y as f32));
                    let found = physics.world.cast_ray(&ray, 4.0, true, filter).map_or(4.0, |(_, distance)| distance);
                    let ours = walls.ray(position, [x, y], 4.0);
                    assert!((ours - f64::from(found)).abs() < 1e-4, "{name} of {position:?}: {ours}, not {found}");
                }
            }
        }
    }
}
