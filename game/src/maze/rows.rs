//! Mazes as rows: walls and free cells, and their text, one character to the cell.

use crate::maze::{
    Cell, Maze,
    error::{MAX_CELLS, MAX_SIDE, MazeError},
};
use playbot_harness::level_files::{
    JsonStep::{Index, Key},
    LevelTextError,
};

// The walls and free cells.

/// The walls alone, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Walls {
    pub(super) rows: usize,
    pub(super) columns: usize,
    free: Vec<bool>,
}

impl Walls {
    /// Returns walls only.
    pub(super) fn solid(rows: usize, columns: usize) -> Result<Self, MazeError> {
        check_size(rows, columns)?;
        Ok(Self { rows, columns, free: vec![false; rows * columns] })
    }

    /// Returns the index of a cell in row-major lists.
    pub(super) fn index(&self, cell: Cell) -> usize {
        cell.row * self.columns + cell.col
    }

    pub(super) fn is_free(&self, cell: Cell) -> bool {
        cell.row < self.rows && cell.col < self.columns && self.free[self.index(cell)]
    }

    pub(super) fn open(&mut self, cell: Cell) {
        let index = self.index(cell);
        self.free[index] = true;
    }

    pub(super) fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let (rows, columns) = (self.rows, self.columns);
        (0..rows).flat_map(move |row| (0..columns).map(move |col| Cell { row, col }))
    }

    pub(super) fn free_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.cells().filter(|&cell| self.is_free(cell))
    }

    pub(super) fn neighbours(&self, cell: Cell) -> impl Iterator<Item = Cell> + '_ {
        let Cell { row, col } = cell;
        let up = row.checked_sub(1).map(|row| Cell { row, col });
        let left = col.checked_sub(1).map(|col| Cell { row, col });
        let around = [up, Some(Cell { row: row + 1, col }), left, Some(Cell { row, col: col + 1 })];
        around.into_iter().flatten().filter(|&cell| self.is_free(cell))
    }
}

/// Refuses sizes of zero, and sizes that are too large.
pub(super) fn check_size(rows: usize, columns: usize) -> Result<(), MazeError> {
    if rows == 0 || columns == 0 {
        return Err(MazeError::Empty);
    }
    let fits = rows <= MAX_SIDE && columns <= MAX_SIDE && rows * columns <= MAX_CELLS;
    if fits { Ok(()) } else { Err(MazeError::TooLarge { rows, columns }) }
}

/// Describes a reward that differs from the rules by more than `slack`; `None` if it does not.
pub(crate) fn reward_mismatch(paid: f32, by_rules: f32, slack: f32) -> Option<String> {
    // NaN is not near to anything.
    let is_same = (paid - by_rules).abs() <= slack;
    (!is_same).then(|| format!("the tick paid {paid}; by the rules it pays {by_rules}"))
}

// The text of a maze.

impl Maze {
    /// Reads a maze from its rows: `#` or `1` is a wall, `O`, `0`, a blank or `.` a free cell, `S` or `r` the start and
    /// `G` or `g` the goal.
    ///
    /// # Errors
    ///
    /// [`MazeError`] with the mistake, its row and its column.
    pub fn parse<Row: AsRef<str>>(rows: &[Row]) -> Result<Self, MazeError> {
        let (walls, start, goal) = read(rows)?;
        Self::new(walls, start.ok_or(MazeError::NoStart)?, goal.ok_or(MazeError::NoGoal)?)
    }

    /// Reads a maze of a level file: like [`parse`](Self::parse), but start and goal may also be given as cells. There
    /// need not be a path between them.
    ///
    /// # Errors
    ///
    /// [`MazeError`] with the mistake, its row and its column.
    pub fn parse_drawn<Row: AsRef<str>>(
        rows: &[Row],
        start: Option<Cell>,
        goal: Option<Cell>,
    ) -> Result<Self, MazeError> {
        let (walls, drawn_start, drawn_goal) = read(rows)?;
        let start = only(drawn_start, start, "start")?.ok_or(MazeError::NoStart)?;
        let goal = only(drawn_goal, goal, "goal")?.ok_or(MazeError::NoGoal)?;
        Self::drawn(walls, start, goal)
    }

    /// Returns the rows for [`parse`](Self::parse), with the letters `#`, `O`, `S` and `G`.
    ///
    /// A maze whose start is its goal is written with `G` alone.
    pub fn to_rows(&self) -> Vec<String> {
        let letter = |cell| match cell {
            cell if cell == self.goal() => 'G',
            cell if cell == self.start() => 'S',
            cell if self.is_free(cell) => 'O',
            _ => '#',
        };
        (0..self.rows()).map(|row| (0..self.columns()).map(|col| letter(Cell { row, col })).collect()).collect()
    }
}

/// Reads walls, start and goal as they are drawn.
fn read<Row: AsRef<str>>(rows: &[Row]) -> Result<(Walls, Option<Cell>, Option<Cell>), MazeError> {
    let expected = rows.first().map_or(0, |row| row.as_ref().chars().count());
    let mut walls = Walls::solid(rows.len(), expected)?;
    let (mut start, mut goal) = (None, None);
    for (row, text) in rows.iter().enumerate() {
        let columns = text.as_ref().chars().count();
        if columns != expected {
            return Err(MazeError::Ragged { row, columns, expected });
        }
        for (col, character) in text.as_ref().chars().enumerate() {
            let cell = Cell { row, col };
            match character {
                '#' | '1' => continue,
                'O' | '0' | ' ' | '.' => {}
                'S' | 'r' => mark(&mut start, cell, "start")?,
                'G' | 'g' => mark(&mut goal, cell, "goal")?,
                _ => return Err(MazeError::UnknownCharacter { row, column: col, character }),
            }
            walls.open(cell);
        }
    }
    Ok((walls, start, goal))
}

/// Returns a cell that is drawn, or named, or both.
fn only(drawn: Option<Cell>, named: Option<Cell>, what: &'static str) -> Result<Option<Cell>, MazeError> {
    match (drawn, named) {
        (Some(first), Some(second)) if first != second => Err(MazeError::Twice { what, first, second }),
        _ => Ok(named.or(drawn)),
    }
}

fn mark(place: &mut Option<Cell>, cell: Cell, what: &'static str) -> Result<(), MazeError> {
    match place.replace(cell) {
        Some(first) => Err(MazeError::Twice { what, first, second: cell }),
        None => Ok(()),
    }
}

/// Reads the maze of a level file: rows, the first one at the top. Start and goal are letters in them, cells, or both.
///
/// # Errors
///
/// The mistake, with its line.
pub fn read_maze(text: &str, rows: &[String], start: Option<Cell>, goal: Option<Cell>) -> Result<Maze, LevelTextError> {
    Maze::parse_drawn(rows, start, goal).map_err(|error| at_maze(text, &error))
}

/// Returns a mistake in a maze, on the line where it is.
fn at_maze(text: &str, error: &MazeError) -> LevelTextError {
    let row = match *error {
        MazeError::Ragged { row, .. } | MazeError::UnknownCharacter { row, .. } => Some(row),
        MazeError::Twice { second: cell, .. } | MazeError::Open(cell) | MazeError::NotFree(cell) => Some(cell.row),
        _ => None,
    };
    let what = error.to_string();
    match row {
        Some(row) => LevelTextError::at(text, &[Key("rows"), Index(row)], what),
        None => LevelTextError::at(text, &[Key("rows")], what),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(rows: &[&str]) -> MazeError {
        Maze::parse(rows).expect_err("the maze is wrong")
    }

    #[test]
    fn all_alphabets_read_the_same() {
        let letters = Maze::parse(&["#####", "#SOG#", "#####"]).expect("a maze");
        let digits = Maze::parse(&["11111", "1r0g1", "11111"]).expect("a maze");
        assert_eq!(letters, digits);
        let seen = ["#####", "# S #", "# .G#", "#####"];
        assert_eq!(Maze::parse(&seen), Maze::parse(&["#####", "#OSO#", "#OOG#", "#####"]));
        assert_eq!((letters.start(), letters.goal(), letters.difficulty()), (Cell::new(1, 1), Cell::new(1, 3), 2));
        assert_eq!(letters.to_rows(), ["#####", "#SOG#", "#####"]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        assert_eq!(error(&[]), MazeError::Empty);
        assert_eq!(error(&[""]), MazeError::Empty);
        assert_eq!(error(&["####", "#OG#", "####"]), MazeError::NoStart);
        assert_eq!(error(&["####", "#SO#", "####"]), MazeError::NoGoal);
        assert_eq!(error(&["####", "#SG#", "###"]), MazeError::Ragged { row: 2, columns: 3, expected: 4 });
        let unknown = MazeError::UnknownCharacter { row: 1, column: 2, character: '?' };
        assert_eq!(error(&["####", "#S?#", "####"]), unknown);
        assert_eq!(error(&["####", "#SGO", "####"]), MazeError::Open(Cell::new(1, 3)));
        let twice = MazeError::Twice { what: "goal", first: Cell::new(1, 2), second: Cell::new(1, 3) };
        assert_eq!(error(&["#####", "#SGG#", "#####"]), twice);
    }

    #[test]
    fn an_unreachable_goal_is_named_with_its_start() {
        let cut = error(&["#####", "#S#G#", "#####"]);
        assert_eq!(cut, MazeError::Unreachable { start: Cell::new(1, 1), goal: Cell::new(1, 3) });
        assert!(cut.to_string().contains("(1, 1)") && cut.to_string().contains("(1, 3)"), "{cut}");
    }

    #[test]
    fn ends_of_a_drawn_maze_are_letters_or_named_and_may_be_cut_off() {
        let drawn = |rows: &[&str], start: Option<[usize; 2]>, goal: Option<[usize; 2]>| {
            Maze::parse_drawn(rows, start.map(Cell::from), goal.map(Cell::from))
        };
        let sealed = drawn(&["#####", "#S#G#", "#####"], None, Some([1, 3])).expect("a maze");
        assert_eq!(
            (sealed.start(), sealed.goal(), sealed.shortest_path().len()),
            (Cell::new(1, 1), Cell::new(1, 3), 0)
        );
        let plain = drawn(&["####", "#OO#", "####"], Some([1, 1]), Some([1, 2])).expect("a maze");
        assert_eq!(plain, Maze::parse(&["####", "#SG#", "####"]).expect("a maze"));
        let stands = drawn(&["###", "#G#", "###"], Some([1, 1]), None).expect("a maze");
        assert_eq!((stands.start(), stands.difficulty()), (stands.goal(), 0));
        let error = |rows: &[&str], start, goal| drawn(rows, start, goal).expect_err("wrong");
        assert_eq!(error(&["####", "#OG#", "####"], None, None), MazeError::NoStart);
        assert_eq!(error(&["####", "#SO#", "####"], None, None), MazeError::NoGoal);
        let twice = MazeError::Twice { what: "start", first: Cell::new(1, 1), second: Cell::new(1, 2) };
        assert_eq!(error(&["#####", "#SOG#", "#####"], Some([1, 2]), None), twice);
        assert_eq!(error(&["####", "#SG#", "####"], None, Some([0, 2])), {
            MazeError::Twice { what: "goal", first: Cell::new(1, 2), second: Cell::new(0, 2) }
        });
        assert_eq!(error(&["####", "#SO#", "####"], None, Some([0, 2])), MazeError::NotFree(Cell::new(0, 2)));
        assert_eq!(error(&["####", "#SGO", "####"], None, None), MazeError::Open(Cell::new(1, 3)));
    }

    #[test]
    fn a_maze_larger_than_memory_is_refused_before_it_is_made() {
        let long = "#".repeat(4097);
        assert_eq!(error(&[&long]), MazeError::TooLarge { rows: 1, columns: 4097 });
        let wide = "#".repeat(4096);
        assert_eq!(error(&[wide.as_str(); 1025]), MazeError::TooLarge { rows: 1025, columns: 4096 });
    }
}
