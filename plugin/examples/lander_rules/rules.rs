//! The rules: land a capsule softly.

use bevy::prelude::*;
use bevy_playbot::prelude::*;

/// Ticks per second of game time.
pub const TICK_HZ: f64 = 5.0;
/// Names of the values of an observation.
pub const OBSERVATION: [&str; 3] = ["height", "speed", "fuel"];

/// The falling capsule.
#[derive(Component, Default)]
pub struct Capsule {
    /// Height above ground, metres.
    pub height: f32,
    /// Speed, metres per second upwards.
    pub speed: f32,
    /// Ticks for which the fuel lasts.
    pub fuel: f32,
}

/// Returns a capsule and its agent.
pub fn capsule(index: u32) -> impl Bundle {
    (Agent::new(index, ActionSpace::Discrete(2)), VectorSensor::new(OBSERVATION), Capsule::default())
}

/// Adds the rules to an app.
pub fn add_rules(app: &mut App) {
    app.add_observer(start).add_systems(ObserveSchedule, see).add_systems(FixedUpdate, fly);
}

/// Starts an episode. The level's number sets the initial height and speed, out of 217
/// combinations.
fn start(event: On<StartEpisode>, mut capsules: Query<&mut Capsule>) {
    if let Ok(mut capsule) = capsules.get_mut(event.entity) {
        let (height, speed) = ((event.level * 11 % 31) as f32, (event.level % 7) as f32);
        *capsule = Capsule { height: 20.0 + height, speed: -0.3 * speed, fuel: 60.0 };
    }
}

fn see(mut agents: Query<(&Capsule, &mut Observation)>) {
    for (capsule, mut observation) in &mut agents {
        observation.set([capsule.height / 50.0, capsule.speed / 10.0, capsule.fuel / 60.0]);
    }
}

/// Action 1 burns: 3 m/s² against a gravity of 1.6 m/s². Touching down at 2 m/s or less wins.
fn fly(
    time: Res<Time>,
    mut agents: Query<(&Control, &Action, &mut Capsule, &mut Reward, &mut Episode, &mut StateHash)>,
) {
    for (control, action, mut capsule, mut reward, mut episode, mut hash) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let burns = action.discrete() == Some(1) && capsule.fuel > 0.0;
        let thrust = if burns { 3.0 } else { 0.0 };
        capsule.fuel -= f32::from(u8::from(burns));
        capsule.speed += (thrust - 1.6) * time.delta_secs();
        capsule.height += capsule.speed * time.delta_secs();
        hash.0 = u64::from(capsule.height.to_bits()) << 32 | u64::from(capsule.speed.to_bits());
        if capsule.height <= 0.0 {
            let soft = capsule.speed >= -2.0;
            reward.add(if soft { 1.0 } else { 0.0 });
            episode.terminate(soft);
        } else if episode.tick >= 400 {
            episode.truncate();
        }
    }
}
