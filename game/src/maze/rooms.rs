//! Rooms in a grid, and the removal of walls between them.

use super::{cell::Cell, draw::Draw, error::MazeError, spec::MazeSpec, walls::Walls};

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
