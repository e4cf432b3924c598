//! Mazes from a seed.

use super::{draw::Draw, ends::choose_ends, error::MazeError, layout::Maze, rooms::Rooms, spec::MazeSpec};

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
