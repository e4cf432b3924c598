//! The ant beside MuJoCo 3.1.6 with D4RL's model: `fixtures/ant_reference.json` has what was measured there.

use std::f64::consts::{PI, TAU};

use playbot_games::ant::{
    AntBody, AntState,
    skeleton::{ACTUATED, JOINTS, LEGS},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

const STILL: [f32; JOINTS] = [0.0; JOINTS];
const JOINT_NAMES: [&str; JOINTS] = ["hip1", "ankle1", "hip2", "ankle2", "hip3", "ankle3", "hip4", "ankle4"];
/// Sign of each leg's ankle angle.
const ANKLE_SIGNS: [f32; LEGS] = [1.0, -1.0, -1.0, 1.0];

fn reference() -> Value {
    serde_json::from_str(include_str!("fixtures/ant_reference.json")).expect("the fixture is valid")
}

fn number(value: &Value) -> f32 {
    value.as_f64().expect("a number") as f32
}

fn rows(value: &Value) -> Vec<Vec<f32>> {
    let rows = value.as_array().expect("rows");
    rows.iter().map(|row| row.as_array().expect("a row").iter().map(number).collect()).collect()
}

fn standing(height: f32, ankle: f32) -> AntState {
    let mut state = AntState::nominal();
    state.qpos[2] = height;
    for (leg, sign) in ANKLE_SIGNS.iter().enumerate() {
        state.qpos[8 + 2 * leg] = sign * ankle;
    }
    state
}

/// The number of an action that drives a joint.
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

#[test]
fn it_weighs_what_it_should() {
    assert!((AntBody::new(&[]).mass() - 0.91088).abs() < 1e-5);
}

#[test]
fn it_falls_lands_and_sinks_as_in_mujoco() {
    let reference = reference();
    let mut ant = AntBody::new(&[]);
    let mut steps = 0;
    for row in rows(&reference["settle"]["zero_action_from_z075_joints_0"]) {
        while steps < (row[0] * 10.0).round() as usize {
            ant.step(&STILL);
            steps += 1;
        }
        let state = ant.state();
        let at = format!("after {} s", row[0]);
        close(state.qpos[2], row[1], 5e-4, &format!("height {at}"));
        for leg in 0..LEGS {
            close(state.qpos[7 + 2 * leg], row[2 + leg], 5e-4, &format!("hip {leg} {at}"));
            close(state.qpos[8 + 2 * leg], row[6 + leg], 1e-3, &format!("ankle {leg} {at}"));
        }
    }
    assert_eq!(steps, 300);
}

#[test]
fn pulses_move_it_as_in_mujoco() {
    let reference = reference();
    for (kind, held, weightless) in [("zero_gravity", "held_steps", true), ("pulses", "pulse_steps", false)] {
        for run in reference[kind]["runs"].as_array().expect("runs") {
            let mut ant = AntBody::new(&[]);
            ant.set_state(&if weightless { standing(5.0, 0.87) } else { standing(0.369916, 0.52344) });
            if weightless {
                ant = ant.weightless();
            }
            let name = run["joint"].as_str().expect("a name");
            let joint = JOINT_NAMES.iter().position(|known| *known == name).expect("a joint");
            let held = run[held].as_u64().expect("a number") as usize;
            for (step, row) in rows(&run["rows"]).iter().enumerate() {
                let mut action = STILL;
                action[actuator(joint)] = if step < held { number(&run["action"]) } else { 0.0 };
                ant.step(&action);
                let state = ant.state();
                let [roll, pitch, yaw] = euler(&state.qpos);
                let [x, y, z] = [state.qpos[0], state.qpos[1], state.qpos[2]];
                let mine = [state.qpos[7 + joint], state.qvel[6 + joint], x, y, z, roll, pitch, yaw];
                for (column, (mine, theirs)) in mine.iter().zip(&row[1..]).enumerate() {
                    let tolerance = if column == 1 { 5e-3 } else { 1e-3 };
                    close(*mine, *theirs, tolerance, &format!("{kind} {name} step {step} column {column}"));
                }
            }
        }
    }
}

#[test]
fn it_jumps_as_in_mujoco() {
    let mut ant = AntBody::new(&[]);
    ant.set_state(&standing(0.369916, 0.52344));
    for (step, row) in rows(&reference()["jump"]["rows"]).iter().enumerate() {
        let mut action = STILL;
        for (leg, sign) in ANKLE_SIGNS.iter().enumerate().filter(|_| step < 3) {
            action[actuator(2 * leg + 1)] = *sign;
        }
        ant.step(&action);
        let state = ant.state();
        close(state.qpos[8], row[1], 1e-3, &format!("ankle at step {step}"));
        close(state.qpos[2], row[5], 1e-3, &format!("height at step {step}"));
    }
}

/// Chaotic, hence compared by its statistics: the bounds are those of MuJoCo under other settings.
#[test]
fn random_torques_shake_it_as_in_mujoco() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut net, mut path, mut height, mut upside_down) = (0.0, 0.0, 0.0, 0);
    const TRIALS: usize = 40;
    const STEPS: usize = 200;
    for _ in 0..TRIALS {
        let mut ant = AntBody::new(&[]);
        ant.set_state(&AntState::reset(&mut rng));
        let start = ant.torso().0.truncate();
        let mut fell = false;
        for _ in 0..STEPS {
            let before = ant.torso().0.truncate();
            ant.step(&std::array::from_fn(|_| rng.random_range(-1.0..=1.0)));
            path += ant.torso().0.truncate().distance(before);
            height += ant.torso().0.z;
            fell |= ant.state().upright() < 0.0;
        }
        net += ant.torso().0.truncate().distance(start);
        upside_down += usize::from(fell);
    }
    let steps = (TRIALS * STEPS) as f32;
    let (net, path, height) = (net / TRIALS as f32, path / steps, height / steps);
    assert!((0.8..=1.6).contains(&net), "net displacement {net}");
    assert!((0.040..=0.055).contains(&path), "displacement in a step {path}");
    assert!((0.53..=0.57).contains(&height), "mean height {height}");
    assert!(upside_down <= 2, "{upside_down} trials upside down");
}

#[test]
fn a_trot_carries_it_as_in_mujoco() {
    let phases = [0.0, PI, 0.0, PI];
    let sides = [1.0, 1.0, -1.0, -1.0];
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let speeds: Vec<f32> = (0..20)
        .map(|_| {
            let mut ant = AntBody::new(&[]);
            ant.set_state(&AntState::reset(&mut rng));
            let start = ant.torso().0.x;
            for step in 0..100 {
                let mut action = STILL;
                for leg in 0..LEGS {
                    let phase = TAU * f64::from(step) / 8.0 + phases[leg];
                    action[actuator(2 * leg)] = (sides[leg] * phase.sin()) as f32;
                    action[actuator(2 * leg + 1)] = ANKLE_SIGNS[leg] * (0.3 + 0.9 * (phase + 0.4).sin()) as f32;
                }
                ant.step(&action);
            }
            (ant.torso().0.x - start) / 10.0
        })
        .collect();
    let mean = speeds.iter().sum::<f32>() / 20.0;
    assert!((0.95..=1.3).contains(&mean), "mean speed {mean}, in MuJoCo 1.12");
}
