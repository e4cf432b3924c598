//! A level: the maze, the ant's start, and its goal.

use crate::{
    ant::AntState,
    antmaze::{
        geometry::centre_of,
        mode::{AntMazeMode, GoalNoise, Goals, Pay},
    },
    maze::{Cell, Maze, MazeError},
};
use playbot_learner::rng::{ChaCha8Rng, Streams, below, unit};

/// A level, from a mode and seed or from a file, with its rules.
#[derive(Clone, Debug)]
pub struct AntMazeLevel {
    /// The walls. Its start cell is the origin of all coordinates, wherever the ant starts.
    pub maze: Maze,
    /// The cell in which the ant starts.
    pub start: Cell,
    /// The cell of the goal.
    pub goal: Cell,
    /// The goal, `[x, y]` in metres.
    pub goal_at: [f32; 2],
    /// The ant at the start.
    pub reset: AntState,
    /// The reward rule.
    pub pay: Pay,
    /// Ticks after which an episode is truncated.
    pub limit: u32,
}

/// Makes a level. All random choices come from the seed, each from a stream of its own: an option changes its own
/// choice and nothing else.
///
/// # Errors
///
/// There is no such maze: see [`MazeError`].
pub fn generate(mode: &AntMazeMode, seed: u64) -> Result<AntMazeLevel, MazeError> {
    let streams = Streams::new(seed);
    let stream = |name| streams.stream(name, 0);
    let maze = mode.map.antmaze(seed)?;
    let goal = goal_cell(mode, &maze, &mut stream("antmaze goal"));
    let start = if mode.random_start {
        other_cell(&maze, &[goal], &mut stream("antmaze start")).unwrap_or(maze.start())
    } else {
        maze.start()
    };
    let goal_at = goal_place(mode.goal_noise, centre_of(&maze, goal), &mut stream("antmaze goal noise"));
    let mut reset = AntState::reset(&mut stream("antmaze reset"));
    let mut at = centre_of(&maze, start);
    if mode.random_start {
        let mut place = stream("antmaze start place");
        at = at.map(|x| x + unit(&mut place) as f32);
    }
    reset.qpos[0] += at[0];
    reset.qpos[1] += at[1];
    Ok(AntMazeLevel { maze, start, goal, goal_at, reset, pay: mode.pay, limit: mode.limit })
}

fn goal_cell(mode: &AntMazeMode, maze: &Maze, rng: &mut ChaCha8Rng) -> Cell {
    match mode.goals {
        Goals::Fixed => maze.goal(),
        Goals::Demo => one_of(mode.demo_goals(), rng).unwrap_or(maze.goal()),
        Goals::Random => other_cell(maze, &[maze.start()], rng).unwrap_or(maze.goal()),
    }
}

/// Returns a random free cell outside this list; `None` if there is none.
fn other_cell(maze: &Maze, not: &[Cell], rng: &mut ChaCha8Rng) -> Option<Cell> {
    let cells: Vec<_> = maze.free_cells().filter(|cell| !not.contains(cell)).collect();
    one_of(&cells, rng)
}

fn one_of(cells: &[Cell], rng: &mut ChaCha8Rng) -> Option<Cell> {
    cells.get(below(rng, cells.len() as u64) as usize).copied()
}

/// Returns the centre of the cell, or D4RL's position near it: U(0, 1) + U(0, 0.5) metres further along each axis.
fn goal_place(noise: GoalNoise, centre: [f32; 2], rng: &mut ChaCha8Rng) -> [f32; 2] {
    match noise {
        GoalNoise::None => centre,
        GoalNoise::D4rl => centre.map(|x| x + (unit(rng) + 0.5 * unit(rng)) as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::antmaze::geometry::cell_at;

    fn level(mode: &str, seed: u64) -> AntMazeLevel {
        generate(&mode.parse().expect("a mode"), seed).expect("a level")
    }

    #[test]
    fn an_ant_starts_near_the_nominal_pose_at_the_start() {
        for seed in 0..200 {
            let AntState { qpos, qvel } = level("medium", seed).reset;
            let [x, y, z, ..] = qpos;
            assert!(x.abs() <= 0.1 && y.abs() <= 0.1 && (z - 0.75).abs() <= 0.1, "{qpos:?}");
            let norm: f32 = qpos[3..7].iter().map(|q| q * q).sum();
            assert!((norm - 1.0).abs() < 1e-5 && qpos[3] > 0.9, "{qpos:?}");
            assert!(qpos[7..].iter().all(|angle| angle.abs() <= 0.1), "{qpos:?}");
            assert!(qvel.iter().all(|speed| speed.abs() < 0.6), "{qvel:?}");
        }
    }

    #[test]
    fn reset_noise_has_the_spread_of_the_original() {
        let resets: Vec<_> = (0..2000).map(|seed| level("medium", seed).reset).collect();
        let rms = |value: &dyn Fn(&AntState) -> f32| {
            let sum: f64 = resets.iter().map(|reset| f64::from(value(reset)).powi(2)).sum();
            (sum / resets.len() as f64).sqrt()
        };
        // Uniform within 0.1, and normal with standard deviation 0.1.
        for joint in [0, 1, 7, 14] {
            assert!((rms(&|reset| reset.qpos[joint]) - 0.1 / 3_f64.sqrt()).abs() < 0.004, "qpos {joint}");
        }
        for joint in [0, 5, 13] {
            assert!((rms(&|reset| reset.qvel[joint]) - 0.1).abs() < 0.007, "qvel {joint}");
        }
    }

    #[test]
    fn goal_noise_is_that_of_d4rl_and_only_where_it_is_asked_for() {
        assert_eq!(level("large", 5).goal_at, [32.0, 24.0]);
        let offsets: Vec<[f32; 2]> = (0..4000)
            .map(|seed| level("large+goal-noise=d4rl", seed).goal_at)
            .map(|[x, y]| [x - 32.0, y - 24.0])
            .collect();
        assert!(offsets.as_flattened().iter().all(|offset| (0.0..1.5).contains(offset)));
        for axis in [0, 1] {
            let mean = |power| offsets.iter().map(|at| f64::from(at[axis]).powi(power)).sum::<f64>() / 4000.0;
            // U(0, 1) + U(0, 0.5): mean 3/4, variance 1/12 + 1/48.
            assert!((mean(1) - 0.75).abs() < 0.02, "{}", mean(1));
            assert!((mean(2) - mean(1).powi(2) - 5.0 / 48.0).abs() < 0.01, "{}", mean(2));
        }
    }

    #[test]
    fn an_option_changes_what_it_says_and_nothing_else() {
        let (plain, noisy) = (level("medium", 9), level("medium+goal-noise=d4rl+sparse+goals=random", 9));
        assert_eq!(plain.reset, noisy.reset);
        assert_ne!(plain.goal_at, noisy.goal_at);
        let again = level("medium+goal-noise=d4rl+sparse+goals=random", 9);
        assert_eq!((again.goal_at, again.reset), (noisy.goal_at, noisy.reset));
    }

    #[test]
    fn goals_and_starts_are_drawn_from_the_cells_that_the_mode_names() {
        let mode: AntMazeMode = "xl+goals=demo".parse().expect("a mode");
        let (mut goals, mut starts, mut ends) = (Vec::new(), Vec::new(), Vec::new());
        for seed in 0..600 {
            goals.push(level("xl+goals=demo", seed).goal);
            let AntMazeLevel { maze, start, goal, reset, .. } = level("umaze+random-start", seed);
            assert_eq!((goal, goal == start), (maze.goal(), false));
            let here = [reset.qpos[0], reset.qpos[1]];
            let [x, y] = centre_of(&maze, start);
            assert!((-0.1..1.1).contains(&(here[0] - x)) && (-0.1..1.1).contains(&(here[1] - y)), "{here:?}");
            assert_eq!(cell_at(&maze, here), Some(start));
            starts.push(start);
            let random = level("umaze+goals=random", seed);
            assert_ne!(random.goal, random.start);
            ends.push(random.goal);
        }
        let count = |mut cells: Vec<Cell>| {
            cells.sort();
            cells.dedup();
            cells.len()
        };
        assert!(goals.iter().all(|goal| mode.demo_goals().contains(goal)));
        // A U of 7 cells, one of which is the other end.
        assert_eq!((count(goals), count(starts), count(ends)), (22, 6, 6));
    }

    #[test]
    fn generated_mazes_follow_the_seed() {
        let maze = |seed| level("random+size=9x9", seed).maze;
        assert_eq!(maze(3), maze(3));
        assert_ne!(maze(3), maze(4));
        assert_eq!((maze(3).rows(), maze(3).columns()), (9, 9));
    }
}
