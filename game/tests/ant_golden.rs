//! Tests of the ant against MuJoCo 3.1.6 with D4RL's model: `fixtures/ant_reference.json` has the measurements.

#![allow(clippy::disallowed_methods, reason = "tests compare with the system's functions")]

#[path = "shared/golden.rs"]
mod golden;

use std::f64::consts::{PI, TAU};

use playbot_games::ant::{
    AntBody, AntState,
    body::CONTROL_STEP,
    skeleton::{ACTUATED, JOINTS, LEGS},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

const STILL: [f32; JOINTS] = [0.0; JOINTS];
const JOINT_NAMES: [&str; JOINTS] = ["hip1", "ankle1", "hip2", "ankle2", "hip3", "ankle3", "hip4", "ankle4"];
/// Sign of each leg's ankle angle.
const ANKLE_SIGNS: [f32; LEGS] = [1.0, -1.0, -1.0, 1.0];
/// Height of the torso and angle of the ankles at the start of a test without gravity. The file has it in words only.
const FLOATING: (f32, f32) = (5.0, 0.87);
/// Control steps in which the ankles of the jump are driven. The file has it in words only.
const JUMP_STEPS: usize = 3;

fn reference() -> Value {
    golden::json("ant_reference.json")
}

fn float(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn number(value: &Value) -> f32 {
    float(value) as f32
}

fn count(value: &Value) -> usize {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no whole number")) as usize
}

fn list(value: &Value) -> &[Value] {
    let list = value.as_array().unwrap_or_else(|| panic!("{value} is no list"));
    assert!(!list.is_empty(), "an empty list");
    list
}

/// A row of a table.
struct Row<'a> {
    columns: &'a [Value],
    cells: &'a [Value],
}

impl Row<'_> {
    /// Returns the number in the column of this name.
    fn at(&self, name: &str) -> f32 {
        let place = self.columns.iter().position(|column| column.as_str() == Some(name));
        number(&self.cells[place.unwrap_or_else(|| panic!("no column {name}"))])
    }
}

/// Returns the rows of a table with these columns.
fn table<'a>(columns: &'a Value, rows: &'a Value) -> Vec<Row<'a>> {
    list(rows).iter().map(|row| Row { columns: list(columns), cells: list(row) }).collect()
}

/// Returns an ant upright and at rest, with the torso at this height and the joints at these angles, by their names.
fn standing(height: f32, angle: impl Fn(&str) -> f32) -> AntState {
    let mut state = AntState::nominal();
    state.qpos[2] = height;
    for (joint, name) in JOINT_NAMES.iter().enumerate() {
        state.qpos[7 + joint] = angle(name);
    }
    state
}

/// Returns the start of pulses and of the jump.
fn resting(reference: &Value) -> AntState {
    let rest = &reference["rest_state"];
    let mut state = standing(number(&rest["z"]), |name| number(&rest["joints"][name]));
    for (axis, value) in list(&rest["quat"]).iter().enumerate() {
        state.qpos[3 + axis] = number(value);
    }
    state
}

/// Returns the start of tests without gravity.
fn floating() -> AntState {
    let mut state = standing(FLOATING.0, |_| 0.0);
    for (leg, sign) in ANKLE_SIGNS.iter().enumerate() {
        state.qpos[8 + 2 * leg] = sign * FLOATING.1;
    }
    state
}

/// Returns the number of an action that drives a joint.
fn actuator(joint: usize) -> usize {
    ACTUATED.iter().position(|&driven| driven == joint).expect("every joint is driven")
}

fn euler(q: &[f32; 15]) -> [f32; 3] {
    let [w, x, y, z] = [q[3], q[4], q[5], q[6]];
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
    let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    [roll, pitch, yaw]
}

fn close(mine: f32, theirs: f32, tolerance: f32, what: &str) {
    assert!((mine - theirs).abs() <= tolerance, "{what}: {mine}, in MuJoCo {theirs}");
}

/// Compares a mean of ours over this many runs with that of equally chaotic runs in MuJoCo: within four standard errors
/// of the difference.
fn close_mean(mine: f32, runs: usize, theirs: &Value, of: usize, what: &str) {
    let error = float(&theirs["sd"]) * (1.0 / runs as f64 + 1.0 / of as f64).sqrt();
    close(mine, number(&theirs["mean"]), 4.0 * error as f32, what);
}

#[test]
fn it_weighs_what_it_should() {
    let theirs = float(&reference()["mass"]["total"]);
    let mine = AntBody::new(&[]).mass();
    assert!((mine - theirs).abs() < 1e-5, "{mine} kg instead of {theirs}");
}

#[test]
fn it_falls_lands_and_sinks_as_in_mujoco() {
    let reference = reference();
    let settle = reference["settle"].as_object().expect("tables");
    let starts: Vec<_> = settle.iter().filter(|(name, _)| name.starts_with("zero_action_from_")).collect();
    assert!(!starts.is_empty());
    for (name, rows) in starts {
        let mut ant = AntBody::new(&[]);
        let mut steps = 0;
        for row in table(&settle["columns"], rows) {
            let due = (f64::from(row.at("t")) / CONTROL_STEP).round() as usize;
            if due == 0 {
                ant.set_state(&standing(row.at("z"), |name| row.at(name)));
            }
            while steps < due {
                ant.step(&STILL);
                steps += 1;
            }
            let state = ant.state();
            let at = format!("{name} after {} s", row.at("t"));
            close(state.qpos[2], row.at("z"), 5e-4, &format!("height {at}"));
            for (joint, joint_name) in JOINT_NAMES.iter().enumerate() {
                let tolerance = if joint % 2 == 0 { 5e-4 } else { 1e-3 };
                close(state.qpos[7 + joint], row.at(joint_name), tolerance, &format!("{joint_name} {at}"));
            }
        }
        assert!(steps > 0, "{name}: nothing moved");
    }
}

#[test]
fn pulses_move_it_as_in_mujoco() {
    let reference = reference();
    for (kind, held, weightless) in [("zero_gravity", "held_steps", true), ("pulses", "pulse_steps", false)] {
        for run in list(&reference[kind]["runs"]) {
            let mut ant = AntBody::new(&[]);
            ant.set_state(&if weightless { floating() } else { resting(&reference) });
            if weightless {
                ant = ant.weightless();
            }
            let name = run["joint"].as_str().expect("a name");
            let joint = JOINT_NAMES.iter().position(|known| *known == name).expect("a joint");
            let held = count(&run[held]);
            for (step, row) in table(&reference[kind]["columns"], &run["rows"]).iter().enumerate() {
                let mut action = STILL;
                action[actuator(joint)] = if step < held { number(&run["action"]) } else { 0.0 };
                ant.step(&action);
                let state = ant.state();
                let at = |column: &str| format!("{kind} {name} step {step} {column}");
                close(state.qpos[7 + joint], row.at("joint_angle"), 1e-3, &at("angle"));
                close(state.qvel[6 + joint], row.at("joint_velocity"), 5e-3, &at("velocity"));
                let [roll, pitch, yaw] = euler(&state.qpos);
                let [x, y, z] = [state.qpos[0], state.qpos[1], state.qpos[2]];
                for (column, mine) in [("x", x), ("y", y), ("z", z), ("roll", roll), ("pitch", pitch), ("yaw", yaw)] {
                    close(mine, row.at(column), 1e-3, &at(column));
                }
            }
        }
    }
}

#[test]
fn it_jumps_as_in_mujoco() {
    let reference = reference();
    let jump = &reference["jump"];
    let mut ant = AntBody::new(&[]);
    ant.set_state(&resting(&reference));
    for (step, row) in table(&jump["columns"], &jump["rows"]).iter().enumerate() {
        let mut action = STILL;
        for (leg, sign) in ANKLE_SIGNS.iter().enumerate().filter(|_| step < JUMP_STEPS) {
            action[actuator(2 * leg + 1)] = *sign;
        }
        ant.step(&action);
        let state = ant.state();
        close(state.qpos[8], row.at("ankle1"), 1e-3, &format!("ankle at step {step}"));
        close(state.qpos[2], row.at("z"), 1e-3, &format!("height at step {step}"));
    }
}

/// Chaotic, hence compared by its statistics.
#[test]
fn random_torques_shake_it_as_in_mujoco() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for theirs in list(&reference()["random_torque"]["runs"]) {
        let (trials, steps) = (count(&theirs["trials"]), count(&theirs["control_steps"]));
        let (mut net, mut path, mut height, mut upside_down) = (0.0, 0.0, 0.0, 0);
        for _ in 0..trials {
            let mut ant = AntBody::new(&[]);
            ant.set_state(&AntState::reset(&mut rng));
            let start = ant.torso().0.truncate();
            let mut fell = false;
            for _ in 0..steps {
                let before = ant.torso().0.truncate();
                ant.step(&std::array::from_fn(|_| rng.random_range(-1.0..=1.0)));
                path += ant.torso().0.truncate().distance(before);
                height += ant.torso().0.z;
                fell |= ant.state().upright() < 0.0;
            }
            net += ant.torso().0.truncate().distance(start);
            upside_down += usize::from(fell);
        }
        let mean = |sum: f32, of: usize, name: &str| {
            close_mean(
                sum / of as f32,
                trials,
                &theirs[name],
                trials,
                &format!("{name}, {trials} times {steps} steps"),
            );
        };
        mean(net, trials, "net_displacement");
        mean(path, trials * steps, "displacement_per_control_step");
        mean(height, trials * steps, "mean_z");
        // A fall is rare: as many as there, and one more in 4000 steps.
        let most = count(&theirs["trials_ever_upside_down"]) + trials * steps / 4000;
        assert!(upside_down <= most, "{upside_down} of {trials} trials upside down");
    }
}

#[test]
fn a_trot_carries_it_as_in_mujoco() {
    let reference = reference();
    let (gait, theirs) = (&reference["gait"], &list(&reference["gait"]["variants"])[0]);
    let parameter = |name: &str| float(&gait["parameters"][name]);
    let (period, swing, middle) = (parameter("period"), parameter("A"), parameter("B"));
    let (lift, delta) = (parameter("C"), parameter("delta"));
    let phase = |leg: usize| match &gait["parameters"]["phase"][leg] {
        text if text == "pi" => PI,
        phase => float(phase),
    };
    let (trials, seconds) = (count(&theirs["trials"]), float(&theirs["seconds"]));
    let steps = (seconds / CONTROL_STEP).round() as u32;
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut sum = 0.0;
    for _ in 0..trials {
        let mut ant = AntBody::new(&[]);
        ant.set_state(&AntState::reset(&mut rng));
        let start = ant.torso().0.x;
        for step in 0..steps {
            let mut action = STILL;
            for leg in 0..LEGS {
                let at = TAU * f64::from(step) / period + phase(leg);
                let hip = float(&gait["sh"][leg]) * swing * at.sin();
                let ankle = float(&gait["sa"][leg]) * (middle + lift * (at + delta).sin());
                action[actuator(2 * leg)] = hip.clamp(-1.0, 1.0) as f32;
                action[actuator(2 * leg + 1)] = ankle.clamp(-1.0, 1.0) as f32;
            }
            ant.step(&action);
        }
        sum += (ant.torso().0.x - start) / seconds as f32;
    }
    close_mean(sum / trials as f32, trials, &theirs["mean_vx"], trials, "mean speed");
}
