//! The game `ant`: get to goals on an open floor.

use crate::ant::{
    body::AntBody,
    pilot::{Pilot, PilotInput},
    skeleton::{AntState, JOINTS, senses},
};
use bevy::prelude::*;
use bevy_playbot::{agent::AgentOrder, fault::Faults};
use playbot_harness::{floor_plan::FloorPlan, prelude::*};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Distance at which a goal counts as reached, in metres.
pub const GOAL_RADIUS: f32 = 0.5;

/// Distance of the goal of [`Task::Goal`], in metres.
const GOAL_DISTANCE: f32 = 8.0;

/// Reward for each metre of progress to the goal. A control step at 1 m/s gives 1.
const PROGRESS_REWARD: f32 = 10.0;

/// Reward for each step on the feet.
const UPRIGHT_REWARD: f32 = 0.1;

/// Price of the square of each number of an action, before clipping. Requests beyond the range also cost, so the gait
/// stays within the range and can be imitated.
const EFFORT_PRICE: f32 = 0.05;

/// Most that the square of a number costs.
const MOST_EFFORT: f32 = 9.0;

/// The task of the ant.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub enum Task {
    /// One goal, 8 m away in any direction. Reaching it ends the episode with success.
    Goal,
    /// One goal after another, 2 m to 10 m from the last, until time is up. The walker trains on it.
    Chase,
}

impl Task {
    /// The names of the tasks.
    pub const NAMES: [&str; 2] = ["goal", "chase"];

    /// Returns the task with this name.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "goal" => Some(Self::Goal),
            "chase" => Some(Self::Chase),
            _ => None,
        }
    }

    /// Returns the control steps until time is up.
    fn limit(self) -> u32 {
        match self {
            Self::Goal => 200,
            Self::Chase => 300,
        }
    }

    /// Returns the level from above: the first goal, and the floor around. `None` where there are more goals to come.
    pub(super) fn floor_plan(self, level: u64) -> Option<FloorPlan> {
        let bounds = Rect::from_center_size(Vec2::ZERO, Vec2::splat(2.0 * GOAL_DISTANCE + 4.0));
        let plan = |goal| FloorPlan { bounds, start: Vec2::ZERO, goal, ..FloorPlan::default() };
        (self == Self::Goal).then(|| plan(self.begin(level).goal))
    }

    /// Returns an ant at the beginning of a level.
    fn begin(self, level: u64) -> Beginning {
        let mut draws = ChaCha8Rng::seed_from_u64(level);
        let state = AntState::reset(&mut draws);
        let goal = self.next_goal(Vec2::ZERO, &mut draws);
        Beginning { state, goal, draws }
    }

    fn next_goal(self, from: Vec2, rng: &mut ChaCha8Rng) -> Vec2 {
        let distance = match self {
            Self::Goal => GOAL_DISTANCE,
            Self::Chase => rng.random_range(2.0..=10.0f32),
        };
        from + distance * Vec2::from_angle(rng.random_range(0.0..std::f32::consts::TAU))
    }
}

/// The start of a level, and the stream of its later goals.
struct Beginning {
    state: AntState,
    goal: Vec2,
    draws: ChaCha8Rng,
}

/// An ant and its goal.
#[derive(Component, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub struct Walker {
    /// The ant.
    pub body: AntBody,
    /// The goal, in metres.
    pub goal: Vec2,
    /// Draws the goals of this level.
    #[reflect(ignore)]
    draws: ChaCha8Rng,
}

impl Default for Walker {
    fn default() -> Self {
        Self { body: AntBody::new(&[]), goal: Vec2::ZERO, draws: ChaCha8Rng::seed_from_u64(0) }
    }
}

impl Walker {
    /// Returns the position of the ant, in metres.
    pub(super) fn position(&self) -> Vec2 {
        self.body.torso().0.truncate()
    }
}

impl AntComponent for Walker {
    fn state(&self) -> AntState {
        self.body.state()
    }
}

pub(super) fn start_episode(event: On<StartEpisode>, task: Res<Task>, mut walkers: Query<&mut Walker>) {
    let Ok(mut walker) = walkers.get_mut(event.entity) else { return };
    let Beginning { state, goal, draws } = task.begin(event.level);
    walker.body.set_state(&state);
    walker.goal = goal;
    walker.draws = draws;
}

pub(super) fn walk(
    task: Res<Task>,
    mut walkers: Query<(&Agent, &Control, &Action, &mut Walker, &mut Episode, &mut Reward, &mut StateHash)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, control, action, mut walker, mut episode, mut reward, mut hash) in &mut walkers {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let asked = action.continuous().unwrap_or_default();
        let before = walker.position().distance(walker.goal);
        walker.body.step(&torques(action, &mut episode));
        let state = walker.body.state();
        if !state.is_finite() {
            faults.report(format!("{}: the ant's state is no longer finite", episode.moment(agent)));
            continue;
        }
        *hash = state.hash();
        let distance = walker.position().distance(walker.goal);
        let effort: f32 = asked.iter().map(|value| value.powi(2).min(MOST_EFFORT)).sum();
        reward.add(PROGRESS_REWARD * (before - distance) + UPRIGHT_REWARD - EFFORT_PRICE * effort);
        if distance <= GOAL_RADIUS {
            match *task {
                Task::Goal => episode.terminate(true),
                Task::Chase => {
                    let Walker { goal, draws, .. } = &mut *walker;
                    *goal = task.next_goal(*goal, draws);
                }
            }
        }
        if state.upright() < 0.0 {
            episode.terminate(false);
        }
        if episode.tick + 1 >= task.limit() {
            episode.truncate();
        }
    }
}

/// Returns the action within -1..=1, and notes it on the episode if it was not.
pub(crate) fn torques(action: &Action, episode: &mut Episode) -> [f32; JOINTS] {
    let torques = within_reach(action.continuous().unwrap_or_default());
    if action.continuous() != Some(&torques[..]) {
        episode.note_clipped();
    }
    torques
}

/// Returns the requested torques, each clipped to -1..=1.
pub(crate) fn within_reach(asked: &[f32]) -> [f32; JOINTS] {
    let mut torques = [0.0; JOINTS];
    for (torque, asked) in torques.iter_mut().zip(asked) {
        *torque = asked.clamp(-1.0, 1.0);
    }
    torques
}

pub(super) fn observe(mut walkers: Query<(&Episode, &Walker, &mut Observation), With<VectorSensor>>) {
    for (episode, walker, mut observation) in &mut walkers {
        if episode.is_running() {
            observation.set(senses(&walker.body.state(), walker.goal));
        }
    }
}

// Steering for people.

/// Keys for one direction along an axis.
type Keys = [KeyCode; 2];

const LEFT: Keys = [KeyCode::ArrowLeft, KeyCode::KeyA];

const RIGHT: Keys = [KeyCode::ArrowRight, KeyCode::KeyD];

const DOWN: Keys = [KeyCode::ArrowDown, KeyCode::KeyS];

const UP: Keys = [KeyCode::ArrowUp, KeyCode::KeyW];

/// Returns bindings without effect. No person can turn eight hinges at once, so an action cannot come from the keys
/// alone: [`steer`] writes it.
pub fn key_bindings() -> KeyBindings {
    let help = "arrow keys or W, A, S and D steer the ant's walker; without a key the ant lets go of its legs";
    KeyBindings::new(Vec::new(), |_| ActionValue::Continuous(vec![0.0; JOINTS]), help)
}

/// A component that holds an agent's ant.
pub trait AntComponent: Component {
    /// Returns the ant's positions and velocities.
    fn state(&self) -> AntState;
}

/// Walks for people in the direction of their keys. Runs after [`PlaybotSystems::Decide`], when the keyboard has
/// written an action that does nothing, in apps with a keyboard.
pub fn steer<C: AntComponent>(
    keys: Res<ButtonInput<KeyCode>>,
    order: Res<AgentOrder>,
    mut ants: Query<(&Control, &Episode, &C, &mut Action), With<KeyBindings>>,
    mut faults: ResMut<Faults>,
    mut input: Local<PilotInput>,
) {
    let way = |back, ahead| f32::from(i8::from(keys.any_pressed(ahead)) - i8::from(keys.any_pressed(back)));
    let direction = [way(LEFT, RIGHT), way(DOWN, UP)];
    if direction == [0.0, 0.0] {
        return;
    }
    for &agent in order.entities() {
        let Ok((control, episode, ant, mut action)) = ants.get_mut(agent) else { continue };
        if *control != Control::Human || !episode.is_running() {
            continue;
        }
        input.clear();
        let state = ant.state();
        input.push(&state, [state.qpos[0] + direction[0], state.qpos[1] + direction[1]]);
        match Pilot::shipped().and_then(|pilot| pilot.act(&input)) {
            Ok(torques) => action.0 = ActionValue::Continuous(torques.concat()),
            Err(error) => return faults.report(error.to_string()),
        }
    }
}
