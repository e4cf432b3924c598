//! Mazes from a seed.

use crate::maze::{Cell, Maze, choose_ends, error::MazeError, spec::MazeSpec, walls::Walls};
use rand_mt::Mt64;

/// Mazes that are made and discarded before a requested difficulty is given up.
const ATTEMPTS: usize = 64;

/// Makes the maze with this seed: the same spec and seed give the same maze everywhere.
///
/// A randomised depth-first search over a grid of rooms joins all of them in exactly one way. Then a share
/// [`loops`](MazeSpec::loops) of the remaining walls between rooms is removed. Every free cell can be reached. For a
/// requested difficulty, mazes are made until one has a start and a goal that far apart.
///
/// # Errors
///
/// [`MazeError`] if the spec makes no sense, or none of 64 mazes has a path of the requested difficulty.
pub fn generate(spec: &MazeSpec, seed: u64) -> Result<Maze, MazeError> {
    spec.check()?;
    let mut draw = Draw::new(seed);
    let mut longest = 0;
    for _ in 0..ATTEMPTS {
        let walls = Rooms::of(spec).carve(spec, &mut draw)?;
        match choose_ends(&walls, spec.difficulty.as_ref(), &mut draw) {
            Ok((start, goal)) => return Maze::new(walls, start, goal),
            Err(most) => longest = longest.max(most),
        }
    }
    let (least, most) = spec.difficulty.as_ref().map_or((0, 0), |wanted| (*wanted.start(), *wanted.end()));
    Err(MazeError::Difficulty { least, most, longest })
}

/// A grid of square rooms.
pub(super) struct Rooms {
    rows: usize,
    columns: usize,
    /// Cells to the side of a room.
    width: usize,
}

/// A room, by its row and column among the rooms.
type Room = (usize, usize);

impl Rooms {
    /// Returns as many rooms as fit into the maze.
    pub(super) fn of(spec: &MazeSpec) -> Self {
        let fit = |cells: usize| (cells - 1) / (spec.corridor + 1);
        Self { rows: fit(spec.rows), columns: fit(spec.columns), width: spec.corridor }
    }

    /// Makes the walls of a maze: a spanning tree of the rooms, and a share of further openings.
    pub(super) fn carve(&self, spec: &MazeSpec, draw: &mut Draw) -> Result<Walls, MazeError> {
        let mut walls = Walls::solid(spec.rows, spec.columns)?;
        for room in (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (row, column))) {
            self.open(&mut walls, self.corner(room), (self.width, self.width));
        }
        self.grow_tree(&mut walls, draw);
        let mut standing: Vec<_> = self.doors().filter(|&(from, to)| !self.joined(&walls, from, to)).collect();
        let falling = (spec.loops * standing.len() as f64).round() as usize;
        draw.shuffle_front(&mut standing, falling);
        for &(from, to) in standing.iter().take(falling) {
            self.join(&mut walls, from, to);
        }
        Ok(walls)
    }

    /// Walks depth first from a random room: on to a random unseen room, and back where there is none.
    fn grow_tree(&self, walls: &mut Walls, draw: &mut Draw) {
        let mut seen = vec![false; self.rows * self.columns];
        let first = (draw.below(self.rows), draw.below(self.columns));
        seen[self.index(first)] = true;
        let mut trail = vec![first];
        while let Some(&room) = trail.last() {
            let mut unseen = [first; 4];
            let mut count = 0;
            for next in self.around(room).filter(|&next| !seen[self.index(next)]) {
                unseen[count] = next;
                count += 1;
            }
            let Some(next) = draw.pick(&unseen[..count]) else {
                trail.pop();
                continue;
            };
            seen[self.index(next)] = true;
            self.join(walls, room, next);
            trail.push(next);
        }
    }

    fn index(&self, (row, column): Room) -> usize {
        row * self.columns + column
    }

    fn around(&self, (row, column): Room) -> impl Iterator<Item = Room> + use<> {
        let up = row.checked_sub(1).map(|row| (row, column));
        let left = column.checked_sub(1).map(|column| (row, column));
        let down = (row + 1 < self.rows).then_some((row + 1, column));
        let right = (column + 1 < self.columns).then_some((row, column + 1));
        [up, down, left, right].into_iter().flatten()
    }

    /// Returns all pairs of rooms with one wall between them.
    fn doors(&self) -> impl Iterator<Item = (Room, Room)> + '_ {
        let rooms = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (row, column)));
        rooms.flat_map(|room| self.around(room).filter(move |&next| next > room).map(move |next| (room, next)))
    }

    /// Returns the first cell of a room.
    fn corner(&self, (row, column): Room) -> Cell {
        Cell::new(1 + row * (self.width + 1), 1 + column * (self.width + 1))
    }

    /// Returns the first cell of the wall between a room and the next one below or to the right.
    fn door(&self, from: Room, to: Room) -> Cell {
        let Cell { row, col } = self.corner(from.max(to));
        if from.0 == to.0 { Cell::new(row, col - 1) } else { Cell::new(row - 1, col) }
    }

    fn joined(&self, walls: &Walls, from: Room, to: Room) -> bool {
        walls.is_free(self.door(from, to))
    }

    fn join(&self, walls: &mut Walls, from: Room, to: Room) {
        let size = if from.0 == to.0 { (self.width, 1) } else { (1, self.width) };
        self.open(walls, self.door(from, to), size);
    }

    fn open(&self, walls: &mut Walls, corner: Cell, (rows, columns): (usize, usize)) {
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            walls.open(Cell::new(corner.row + row, corner.col + column));
        }
    }
}

/// Random numbers that are the same on every machine.
pub(super) struct Draw(Mt64);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(Mt64::new(seed))
    }

    /// Returns a uniform number in `0..high`, with a modulo bias that no maze is large enough to show. `high` is at
    /// least 1.
    pub(super) fn below(&mut self, high: usize) -> usize {
        (self.0.next_u64() % high as u64) as usize
    }

    /// Returns one of them; `None` if there is none.
    pub(super) fn pick<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        (!from.is_empty()).then(|| from[self.below(from.len())])
    }

    /// Moves a random choice of `count` items, in random order, to the front.
    pub(super) fn shuffle_front<T>(&mut self, items: &mut [T], count: usize) {
        for at in 0..count.min(items.len()) {
            let from = at + self.below(items.len() - at);
            items.swap(at, from);
        }
    }
}
