//! Soak test of ants: shakes them in a narrow room and in mazes, by turns, with random torques, and stops at the first
//! impossible state.
//!
//! `cargo run --release --example ant_soak -- 10000000` takes about six minutes on two cores.

use std::{
    process::ExitCode,
    thread::{available_parallelism, scope},
};

use playbot_games::{
    ant::{AntBody, AntState, WallBox},
    antmaze::{geometry::centre_of, wall_boxes},
    maze::{MazeSpec, generate},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Half the width of the square room, in metres: an ant has little more than its own size.
const ROOM: f32 = 2.0;
/// Control steps between two starts.
const EPISODE: u64 = 1000;
/// Limits of height, in metres, and of speed, in m/s and rad/s, of a shaken ant.
const CEILING: f32 = 4.0;
const FASTEST: f32 = 60.0;

fn main() -> ExitCode {
    let asked = std::env::args().nth(1).map_or(Ok(100_000), |text| text.parse::<u64>());
    let Ok(steps) = asked else {
        eprintln!("give a number of control steps, such as 10000000");
        return ExitCode::from(3);
    };
    let threads = available_parallelism().map_or(1, |threads| threads.get() as u64);
    let results: Vec<Result<Extremes, String>> = scope(|scope| {
        let shake = |seed| scope.spawn(move || shake(seed, steps.div_ceil(threads)));
        let running: Vec<_> = (0..threads).map(shake).collect();
        running.into_iter().map(|thread| thread.join().expect("the check reports and does not panic")).collect()
    });
    let mut code = ExitCode::SUCCESS;
    for (seed, result) in results.into_iter().enumerate() {
        match result {
            Ok(seen) => eprintln!(
                "seed {seed}: highest {:.2} m, fastest {:.1}, nearest to a wall {:.3} m",
                seen.height, seen.speed, seen.gap
            ),
            Err(why) => {
                eprintln!("seed {seed}: {why}");
                code = ExitCode::FAILURE;
            }
        }
    }
    code
}

struct Extremes {
    height: f32,
    speed: f32,
    gap: f32,
}

/// Surroundings and start of a shaken ant.
struct Place {
    walls: Vec<WallBox>,
    start: [f32; 2],
}

fn shake(seed: u64, steps: u64) -> Result<Extremes, String> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut seen = Extremes { height: 0.0, speed: 0.0, gap: ROOM };
    let mut place = narrow_room(&mut rng);
    let mut ant = AntBody::new(&place.walls);
    for step in 0..steps {
        if step % EPISODE == 0 {
            place = if (step / EPISODE).is_multiple_of(2) { narrow_room(&mut rng) } else { maze(&mut rng)? };
            ant = AntBody::new(&place.walls);
            let mut state = AntState::reset(&mut rng);
            state.qpos[..2].copy_from_slice(&place.start);
            ant.set_state(&state);
        }
        ant.step(&std::array::from_fn(|_| rng.random_range(-1.0..=1.0)));
        let state = ant.state();
        let [x, y, z] = [state.qpos[0], state.qpos[1], state.qpos[2]];
        seen.height = seen.height.max(z);
        seen.speed = state.qvel.iter().fold(seen.speed, |fastest, speed| fastest.max(speed.abs()));
        seen.gap = place.walls.iter().fold(seen.gap, |gap, wall| gap.min(distance(wall, [x, y])));
        let sound = state.is_finite() && z > 0.0 && z < CEILING && seen.speed < FASTEST && seen.gap > 0.0;
        if !sound {
            return Err(format!("step {step}: {state:?}"));
        }
    }
    Ok(seen)
}

/// Returns the distance from the outside of a wall to a position, in metres, seen from above; 0 within.
fn distance(wall: &WallBox, place: [f32; 2]) -> f32 {
    let beyond = [0, 1].map(|axis| ((place[axis] - wall.centre[axis]).abs() - wall.half[axis]).max(0.0));
    (beyond[0] * beyond[0] + beyond[1] * beyond[1]).sqrt()
}

/// Returns four walls of AntMaze's height, so near that legs and walls meet often.
fn narrow_room(rng: &mut ChaCha8Rng) -> Place {
    let walls = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]].map(|[x, y]| WallBox {
        centre: [x * (ROOM + 2.0), y * (ROOM + 2.0), 1.0],
        half: [2.0 + f32::abs(y) * ROOM, 2.0 + f32::abs(x) * ROOM, 1.0],
    });
    Place { walls: walls.to_vec(), start: [(); 2].map(|()| rng.random_range(-1.0..1.0)) }
}

/// Returns a generated maze, with corners that stand out and seams between boxes, from anywhere in it.
fn maze(rng: &mut ChaCha8Rng) -> Result<Place, String> {
    let spec = MazeSpec { rows: 9, columns: 9, loops: rng.random_range(0.0..=1.0), ..MazeSpec::default() };
    let maze = generate(&spec, rng.random()).map_err(|error| error.to_string())?;
    let cells: Vec<_> = maze.free_cells().collect();
    let middle = centre_of(&maze, cells[rng.random_range(0..cells.len())]);
    let start = middle.map(|along| along + rng.random_range(-1.0..1.0));
    Ok(Place { walls: wall_boxes(&maze), start })
}
