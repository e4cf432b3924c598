//! Mazes from a seed, and their size and shape.

use crate::maze::{
    Cell, Maze, choose_ends,
    error::MazeError,
    rows::{Walls, check_size},
};
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::mode::ModeError;
use rand_mt::Mt64;
use std::{ops::RangeInclusive, str::FromStr};
use thiserror::Error;

// The size and shape of generated mazes.

/// Default seeds of the mazes to learn from.
pub const TRAIN_SEEDS: RangeInclusive<u64> = 0..=63;

/// Default seeds of the held-out mazes of the test.
pub const HELD_OUT_SEEDS: RangeInclusive<u64> = 64..=127;

/// Size and shape of generated mazes.
///
/// Corridors join rooms of `corridor` x `corridor` cells that stand in a grid, one wall apart. Cells that a row of
/// rooms does not fill thicken the wall at the far side.
#[derive(Clone, Debug, PartialEq)]
pub struct MazeSpec {
    /// Rows of cells, the border included.
    pub rows: usize,
    /// Columns of cells, the border included.
    pub columns: usize,
    /// Share of the walls between neighbouring rooms that is removed once every room can be reached in exactly one way,
    /// 0 to 1. At 0 there is one path between any two rooms, at 1 no wall is left between them.
    pub loops: f64,
    /// Width of the corridors, cells; at least 1.
    pub corridor: usize,
    /// Range of moves of the shortest path from start to goal. `None` puts start and goal as far apart as possible.
    pub difficulty: Option<RangeInclusive<usize>>,
}

impl Default for MazeSpec {
    fn default() -> Self {
        Self { rows: 11, columns: 11, loops: 0.1, corridor: 1, difficulty: None }
    }
}

impl MazeSpec {
    /// Checks everything that does not need a maze.
    ///
    /// # Errors
    ///
    /// [`MazeError`] names the impossible value.
    pub fn check(&self) -> Result<(), MazeError> {
        let Self { rows, columns, loops, corridor, .. } = *self;
        if corridor == 0 {
            return Err(MazeError::NoCorridor);
        }
        let least = corridor.saturating_mul(2).saturating_add(3);
        if rows < least || columns < least {
            return Err(MazeError::TooSmall { rows, columns, corridor, least });
        }
        check_size(rows, columns)?;
        if !(0.0..=1.0).contains(&loops) {
            return Err(MazeError::Loops(loops.to_string()));
        }
        match &self.difficulty {
            Some(wanted) if wanted.is_empty() || *wanted.end() == 0 => {
                Err(MazeError::NoDifficulty { least: *wanted.start(), most: *wanted.end() })
            }
            _ => Ok(()),
        }
    }
}

// Generated mazes as options of a mode: `size=9x9+loops=0.2`.

/// The value of an option cannot be read.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{key}={value}`: {wanted}")]
pub struct OptionError {
    /// The option.
    pub key: String,
    /// The given value.
    pub value: String,
    /// The expected form.
    pub wanted: &'static str,
}

impl OptionError {
    /// Takes an option with the expected form.
    pub fn new(key: &str, value: &str, wanted: &'static str) -> Self {
        Self { key: key.to_owned(), value: value.to_owned(), wanted }
    }
}

impl MazeSpec {
    /// Options of a mode with generated mazes, each with a value it takes.
    pub const OPTIONS: [&'static str; 4] = ["size=9x9", "loops=0.2", "corridor=2", "difficulty=10..20"];

    /// Takes one option; false if it is none of a maze's.
    ///
    /// # Errors
    ///
    /// The value cannot be read. Its meaning is [`check`](Self::check)ed apart.
    pub fn set_option(&mut self, key: &str, value: &str) -> Result<bool, OptionError> {
        let wrong = |wanted| OptionError::new(key, value, wanted);
        match key {
            "size" => {
                (self.rows, self.columns) =
                    pair(value, "x").ok_or_else(|| wrong("write rows x columns, as in size=9x9"))?
            }
            "loops" => {
                self.loops = value.parse().map_err(|_| wrong("write a share between 0 and 1, as in loops=0.2"))?
            }
            "corridor" => self.corridor = value.parse().map_err(|_| wrong("write cells, as in corridor=2"))?,
            "difficulty" => {
                let read =
                    range(value).ok_or_else(|| wrong("write moves, as in difficulty=12 or difficulty=10..20"))?;
                self.difficulty = Some(read);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Returns the options that differ from the default, as [`set_option`](Self::set_option) takes them: `key=value`.
    pub fn options(&self) -> Vec<String> {
        let default = Self::default();
        let mut options = Vec::new();
        if (self.rows, self.columns) != (default.rows, default.columns) {
            options.push(format!("size={}x{}", self.rows, self.columns));
        }
        if self.loops != default.loops {
            options.push(format!("loops={}", self.loops));
        }
        if self.corridor != default.corridor {
            options.push(format!("corridor={}", self.corridor));
        }
        if let Some(wanted) = &self.difficulty {
            options.push(format!("difficulty={}..{}", wanted.start(), wanted.end()));
        }
        options
    }
}

fn pair<T: FromStr>(text: &str, between: &str) -> Option<(T, T)> {
    let (left, right) = text.split_once(between)?;
    Some((left.parse().ok()?, right.parse().ok()?))
}

/// Parses `10..20`, both ends included, or one number.
fn range(text: &str) -> Option<RangeInclusive<usize>> {
    if let Ok(one) = text.parse() {
        return Some(one..=one);
    }
    pair(text, "..").map(|(least, most)| least..=most)
}

// Errors of maps, and of the modes of maze games.

/// The text is no map, or no mode: a map with options, joined by `+`.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MazeModeError {
    /// An unknown map or option.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// The value of an option is impossible.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Such a maze is impossible.
    #[error(transparent)]
    Maze(#[from] MazeError),
    /// An option is given twice, or with its opposite.
    #[error("`{0}` repeats or contradicts another option of the mode: leave one of them")]
    Twice(String),
    /// Two options that exclude each other, with advice.
    #[error("{0}")]
    Together(&'static str),
}

impl MazeModeError {
    /// Checks that no two options are about the same `subject`.
    ///
    /// # Errors
    ///
    /// [`Twice`](Self::Twice) with the later one.
    pub(crate) fn check_once<'a>(options: &[&'a str], subject: impl Fn(&'a str) -> &'a str) -> Result<(), Self> {
        let repeats = |&(index, &option): &(usize, &&'a str)| {
            options[..index].iter().any(|&earlier| subject(earlier) == subject(option))
        };
        match options.iter().enumerate().find(repeats) {
            Some((_, &option)) => Err(Self::Twice(option.to_owned())),
            None => Ok(()),
        }
    }
}

/// Parses a mode of a game, with the error type of games.
///
/// # Errors
///
/// The text is no mode.
pub fn read_mode<Mode: FromStr<Err = MazeModeError>>(text: &str) -> Result<Mode, ModeError> {
    text.parse::<Mode>().map_err(|error| match error {
        MazeModeError::Name(unknown) => unknown.into(),
        other => ModeError::Option { mode: text.to_owned(), why: other.to_string() },
    })
}

// The mazes from a seed.

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
