//! Tests of Maze2D's ball against numbers measured on MuJoCo 3.1.6 and D4RL's model.

#[path = "shared/golden.rs"]
mod golden;

use playbot_games::maze2d::{
    Ball, ContactModel, Maze2dLevel, Maze2dMode,
    ball::{RADIUS, clip_action},
    sim::BallSim,
    walls::HALF,
};
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    traces: Vec<Trace>,
    impacts: Vec<Impact>,
}

#[derive(Deserialize)]
struct Trace {
    map: String,
    start: State,
    segments: Vec<(usize, f64, f64)>,
    states: Vec<State>,
    contacts: String,
    /// Counted from 1; `None` if it touches nothing.
    first_contact_step: Option<usize>,
}

#[derive(Deserialize)]
struct Impact {
    map: String,
    start: State,
    action: [f64; 2],
    states: Vec<State>,
    contacts: String,
}

/// x, y, vx, vy.
type State = [f64; 4];

/// A recorded run, of any list.
struct Run {
    map: String,
    pushes: Vec<[f64; 2]>,
    /// The start, then the state after each step.
    states: Vec<State>,
    contacts: Vec<u8>,
}

impl Run {
    fn new(map: String, start: State, pushes: Vec<[f64; 2]>, states: Vec<State>, contacts: String) -> Self {
        let states: Vec<_> = std::iter::once(start).chain(states).collect();
        assert_eq!((pushes.len() + 1, contacts.len() + 1), (states.len(), states.len()));
        Self { map, pushes, states, contacts: contacts.into_bytes() }
    }

    fn len(&self) -> usize {
        self.pushes.len()
    }

    /// Returns a ball in the recorded state after `step` steps.
    fn sim(&self, contact: ContactModel, step: usize) -> BallSim {
        let mode = Maze2dMode { contact, ..self.map.parse().expect("a map") };
        let [x, y, vx, vy] = self.states[step];
        let level = Maze2dLevel::new(&mode, 0).expect("a fixed map");
        BallSim::new(&mode, &Maze2dLevel { start: Ball { position: [x, y], velocity: [vx, vy] }, ..level })
    }

    /// Returns the largest difference to the recording, of positions and of velocities, over `steps` steps from the
    /// state after `from`.
    fn deviation(&self, contact: ContactModel, from: usize, steps: usize) -> (f64, f64) {
        let mut sim = self.sim(contact, from);
        let mut worst = (0.0_f64, 0.0_f64);
        for step in from..from + steps {
            sim.step(self.push(step));
            let [x, y, vx, vy] = self.states[step + 1];
            let Ball { position: p, velocity: v } = sim.ball;
            worst.0 = worst.0.max((p[0] - x).abs()).max((p[1] - y).abs());
            worst.1 = worst.1.max((v[0] - vx).abs()).max((v[1] - vy).abs());
        }
        worst
    }

    /// Returns the push of a step in the game's form: an action of 32-bit numbers, clipped.
    fn push(&self, step: usize) -> [f64; 2] {
        clip_action(self.pushes[step].map(|axis| axis as f32)).0
    }
}

fn recorded() -> Golden {
    golden::json("maze2d/maze2d_traces.json")
}

/// Returns the long runs, each with the number of steps before its first contact.
fn long_runs() -> Vec<(Run, usize)> {
    let run = |trace: Trace| {
        let free = trace.first_contact_step.map_or(usize::MAX, |step| step - 1).min(trace.states.len());
        let pushes = trace.segments.iter().flat_map(|&(steps, x, y)| std::iter::repeat_n([x, y], steps)).collect();
        (Run::new(trace.map, trace.start, pushes, trace.states, trace.contacts), free)
    };
    let runs: Vec<_> = recorded().traces.into_iter().map(run).collect();
    assert!(!runs.is_empty() && runs.iter().all(|(run, _)| run.len() > 0));
    runs
}

fn impacts() -> Vec<Run> {
    let run = |impact: Impact| {
        let pushes = vec![impact.action; impact.states.len()];
        Run::new(impact.map, impact.start, pushes, impact.states, impact.contacts)
    };
    let runs: Vec<_> = recorded().impacts.into_iter().map(run).collect();
    assert!(!runs.is_empty() && runs.iter().all(|run| run.len() > 0));
    runs
}

fn all_runs() -> Vec<Run> {
    long_runs().into_iter().map(|(run, _)| run).chain(impacts()).collect()
}

const BOTH: [ContactModel; 2] = [ContactModel::Soft, ContactModel::Rapier];

#[test]
fn free_flight_is_the_original_s_under_both_contacts() {
    for contact in BOTH {
        let mut steps = 0;
        for run in all_runs() {
            for step in (0..run.len()).filter(|&step| run.contacts[step] == b'0') {
                let (place, speed) = run.deviation(contact, step, 1);
                // A hard contact begins when the surfaces meet within the step, a soft one 2 mm before.
                if contact == ContactModel::Rapier && run.contacts.get(step + 1).is_some_and(|&after| after != b'0') {
                    continue;
                }
                assert!(place <= 1e-5 && speed <= 1e-4, "{contact:?}, step {step}: {place} m, {speed} m/s");
                steps += 1;
            }
        }
        assert!(steps > 0, "{contact:?}: no step of free flight");
        for (run, free) in long_runs() {
            // Under rapier the step before the first recorded contact may already be stopped by the wall.
            let steps = free.saturating_sub(usize::from(contact == ContactModel::Rapier));
            let (place, _) = run.deviation(contact, 0, steps);
            assert!(place <= 1e-4, "{contact:?}: {place} m before the first contact");
        }
    }
}

#[test]
fn soft_contact_is_the_original_s() {
    for run in all_runs() {
        for step in 0..run.len() {
            let (place, speed) = run.deviation(ContactModel::Soft, step, 1);
            assert!(place <= 1e-5 && speed <= 1e-3, "step {step}: {place} m, {speed} m/s");
        }
        for from in 0..run.len().saturating_sub(20) {
            let (place, _) = run.deviation(ContactModel::Soft, from, 20);
            assert!(place <= 1e-4, "from step {from}: {place} m");
        }
        let (place, _) = run.deviation(ContactModel::Soft, 0, run.len());
        assert!(place <= 0.02, "open loop: {place} m");
    }
}

#[test]
fn rapier_s_contact_stays_near_the_original() {
    let mut errors = Vec::new();
    for run in all_runs() {
        for from in (0..run.len()).step_by(10) {
            let steps = (run.len() - from).min(10);
            errors.push(run.deviation(ContactModel::Rapier, from, steps).0);
        }
    }
    errors.sort_by(f64::total_cmp);
    let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
    assert!(median <= 0.01 && worst <= 0.35, "median {median} m, worst {worst} m");
}

/// Returns the depth of the ball in a wall, m; 0 or less if it is in none.
fn depth(level: &Maze2dLevel, ball: &Ball) -> f64 {
    let touches = level.walls.touches(ball.position, 0.01);
    touches.as_slice().iter().map(|touch| -touch.gap).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn the_ball_never_leaves_the_free_cells_nor_sinks_into_walls() {
    for contact in BOTH {
        let mode = Maze2dMode { contact, .."medium".parse().expect("a mode") };
        let level = Maze2dLevel::new(&mode, 5).expect("a level");
        let mut sim = BallSim::new(&mode, &level);
        // Pushes that change every 37 steps reach every corner of the map at full speed.
        let mut deepest = f64::NEG_INFINITY;
        let mut cells = std::collections::BTreeSet::new();
        let mut draw = 1_u64;
        for step in 0..50_000 {
            if step % 37 == 0 {
                draw = draw.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            }
            sim.step([[-1.0, 0.0, 1.0][(draw >> 33) as usize % 3], [-1.0, 0.0, 1.0][(draw >> 40) as usize % 3]]);
            assert!(level.walls.is_free(sim.ball.position), "{contact:?}: in a wall after step {step}: {:?}", sim.ball);
            cells.insert(level.walls.cell_at(sim.ball.position));
            deepest = deepest.max(depth(&level, &sim.ball));
        }
        assert!(deepest <= 0.06, "{contact:?}: {deepest} m deep");
        assert!(cells.len() > 20, "{contact:?}: only {} cells were seen", cells.len());
    }
}

/// Gap between the surfaces of wall and ball at which the original's contact holds a full push, m.
const REST_GAP: f64 = 0.00137;

/// Returns the end of a full push along an axis at the wall of cell `cell` of that axis.
fn rest(mode: &Maze2dMode, cell: f64, push: f64) -> f64 {
    cell - mode.wall_offset() - push * (HALF + RADIUS + REST_GAP)
}

#[test]
fn a_full_push_rests_where_the_original_rests() {
    for (contact, tolerance) in [(ContactModel::Soft, 1e-5), (ContactModel::Rapier, 0.01)] {
        // Around cell (1, 1) of this map the walls are those of the cells 0 and 3 along both axes.
        for (axis, push, cell) in [(0, -1.0, 0.0), (0, 1.0, 3.0), (1, -1.0, 0.0), (1, 1.0, 3.0)] {
            let mode = Maze2dMode { contact, .."medium".parse().expect("a mode") };
            let level = Maze2dLevel::new(&mode, 0).expect("a level");
            let mut sim = BallSim::new(&mode, &Maze2dLevel { start: Ball::at([1.0, 1.0]), ..level });
            let pushes = if axis == 0 { [push, 0.0] } else { [0.0, push] };
            (0..500).for_each(|_| sim.step(pushes));
            let (along, rest) = (sim.ball.position[axis], rest(&mode, cell, push));
            assert!((along - rest).abs() <= tolerance, "{contact:?}, {pushes:?}: {along} instead of {rest}");
        }
    }
}

#[test]
fn without_the_offset_walls_stand_where_coordinates_say() {
    let mode: Maze2dMode = "medium+no-offset".parse().expect("a mode");
    let level = Maze2dLevel::new(&mode, 0).expect("a level");
    let mut sim = BallSim::new(&mode, &Maze2dLevel { start: Ball::at([1.0, 1.0]), ..level });
    (0..500).for_each(|_| sim.step([-1.0, 1.0]));
    let [x, y] = sim.ball.position;
    let wanted = [rest(&mode, 0.0, -1.0), rest(&mode, 3.0, 1.0)];
    assert!((x - wanted[0]).abs() < 1e-5 && (y - wanted[1]).abs() < 1e-5, "{x}, {y} instead of {wanted:?}");
}
