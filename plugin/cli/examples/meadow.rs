//! A meadow with berries and wasps, as many as the level has, with every verb of playbot.
//!
//! The agent sees them by an [`EntitySensor`]. In the mode `few` there are two or three berries and one or two wasps, in
//! `many` six to eight and three or four:
//! `cargo run --release -p playbot --example meadow -- train --algorithm ppo --run runs/meadow`.

use playbot::{
    harness::game::BotTools,
    learner::{
        Streams,
        rng::{ChaCha8Rng, below, unit},
    },
    prelude::*,
};
use std::{process::ExitCode, sync::Arc};

use bevy::prelude::*;

/// Half of the meadow's side, in metres.
const SIDE: f32 = 5.0;
/// Metres that the agent walks in a tick, and wasps fly.
const STEP: f32 = 0.4;
const FLIGHT: f32 = 0.2;
/// Distance at which a berry is taken, or a wasp stings.
const TOUCH: f32 = 0.5;
const LIMIT: u32 = 200;
/// Stay, and a step in each direction.
const STEPS: [Vec2; 5] = [Vec2::ZERO, Vec2::NEG_X, Vec2::X, Vec2::NEG_Y, Vec2::Y];

/// The game.
pub struct Meadow;

#[derive(Component, Default)]
struct Place(Vec2);

/// A thing on the meadow of this agent.
#[derive(Component)]
struct Of(Entity);

#[derive(Component)]
struct Berry;

/// A wasp and its motion in a tick.
#[derive(Component)]
struct Wasp(Vec2);

#[derive(Resource)]
struct IsFull(bool);

/// Sees the things on the agent's own meadow, the nearest first.
pub fn sensor() -> EntitySensor {
    /// Returns the way from the agent to a thing.
    fn way(agent: EntityRef<'_>, thing: EntityRef<'_>) -> Option<Vec2> {
        let is_own = thing.get::<Of>()?.0 == agent.id();
        is_own.then_some(thing.get::<Place>()?.0 - agent.get::<Place>()?.0)
    }
    EntitySensor::new::<Berry, 2>("berry", 8, ["dx", "dy"], |agent, berry| {
        let way = way(agent, berry)?;
        Some((way.length(), (way / SIDE).to_array()))
    })
    .and::<Wasp, 4>("wasp", 4, ["dx", "dy", "vx", "vy"], |agent, wasp| {
        let (way, speed) = (way(agent, wasp)?, wasp.get::<Wasp>()?.0 / FLIGHT);
        Some((way.length(), [way.x / SIDE, way.y / SIDE, speed.x, speed.y]))
    })
}

impl Game for Meadow {
    fn name(&self) -> &'static str {
        "meadow"
    }
    fn version(&self) -> u32 {
        1
    }
    fn modes(&self) -> &'static [&'static str] {
        &["few", "many"]
    }
    fn tick_hz(&self) -> f64 {
        10.0
    }
    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(STEPS.len())
    }
    fn observation(&self) -> ObservationSpace {
        sensor().space(["x", "y"])
    }
    fn build(&self, app: &mut App, mode: &str) {
        app.insert_resource(IsFull(mode == "many"))
            .add_observer(grow)
            .add_systems(ObserveSchedule, |mut agents: Query<(&Place, &mut Observation)>| {
                agents.iter_mut().for_each(|(at, mut seen)| seen.set((at.0 / SIDE).to_array()));
            })
            .add_systems(FixedPreUpdate, forage.in_set(PlaybotSystems::Decide))
            .add_systems(FixedUpdate, (walk, fly, touch).chain());
    }
    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let values = VectorSensor::from_space(Arc::new(self.observation()));
        world.spawn((Agent::new(index, self.actions()), values, sensor(), Place::default())).id()
    }
    fn tools(&self) -> GameTools<'_> {
        GameTools { bots: self, ..GameTools::default() }
    }
}

impl BotTools for Meadow {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("forager")
    }
}

/// Plants the level: berries anywhere, and wasps not too near.
fn grow(
    event: On<StartEpisode>,
    mut commands: Commands,
    is_full: Res<IsFull>,
    old: Query<(Entity, &Of)>,
    mut agents: Query<(&mut Place, &Episode)>,
) {
    let Ok((mut at, episode)) = agents.get_mut(event.entity) else { return };
    at.0 = Vec2::ZERO;
    old.iter().filter(|(_, of)| of.0 == event.entity).for_each(|(thing, _)| commands.entity(thing).despawn());
    let mut rng = Streams::new(episode.level).stream("meadow", u64::from(is_full.0));
    let anywhere = |rng: &mut ChaCha8Rng| SIDE * (2.0 * Vec2::new(unit(rng) as f32, unit(rng) as f32) - 1.0);
    let (berries, wasps) = if is_full.0 { (6, 3) } else { (2, 1) };
    for _ in 0..berries + below(&mut rng, 2 + u64::from(is_full.0)) {
        commands.spawn((Berry, Place(anywhere(&mut rng)), Of(event.entity)));
    }
    for _ in 0..wasps + below(&mut rng, 2) {
        let place = anywhere(&mut rng);
        let place = if place.length() < 2.0 { place.normalize_or(Vec2::X) * 2.0 } else { place };
        let speed = FLIGHT * anywhere(&mut rng).normalize_or(Vec2::X);
        commands.spawn((Wasp(speed), Place(place), Of(event.entity)));
    }
}

fn walk(mut agents: Query<(&Action, &Control, &mut Place, &Episode)>) {
    for (action, control, mut at, episode) in &mut agents {
        if control.is_active() && episode.is_running() {
            let step = STEPS[action.discrete().unwrap_or_default() as usize % STEPS.len()];
            at.0 = (at.0 + STEP * step).clamp(Vec2::splat(-SIDE), Vec2::splat(SIDE));
        }
    }
}

/// Moves the wasps of agents that play. They turn at the edge.
fn fly(mut wasps: Query<(&mut Wasp, &mut Place, &Of)>, agents: Query<(&Control, &Episode)>) {
    for (mut wasp, mut at, of) in &mut wasps {
        if !agents.get(of.0).is_ok_and(|(control, episode)| control.is_active() && episode.is_running()) {
            continue;
        }
        let next = at.0 + wasp.0;
        let turned = Vec2::select(next.abs().cmpgt(Vec2::splat(SIDE)), -wasp.0, wasp.0);
        (wasp.0, at.0) = (turned, at.0 + turned);
    }
}

fn touch(
    mut commands: Commands,
    mut agents: Query<(Entity, &Control, &Place, &mut Reward, &mut Episode, &mut StateHash)>,
    things: Query<(Entity, &Place, &Of, Has<Berry>), Without<Agent>>,
) {
    for (agent, control, at, mut reward, mut episode, mut hash) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let (mut left, mut is_stung, mut state) =
            (0, false, StateHash::of(at.0.to_array().map(f32::to_bits).map(u64::from)).0);
        for (thing, place, _, is_berry) in things.iter().filter(|(_, _, of, _)| of.0 == agent) {
            let touches = place.0.distance(at.0) < TOUCH;
            is_stung |= touches && !is_berry;
            if touches && is_berry {
                reward.add(1.0);
                commands.entity(thing).despawn();
            } else {
                left += u32::from(is_berry);
                // Things have no order, so their hashes are added.
                state = state.wrapping_add(StateHash::of(place.0.to_array().map(f32::to_bits).map(u64::from)).0);
            }
        }
        hash.0 = state;
        if is_stung {
            reward.add(-1.0);
            episode.terminate(false);
        } else if left == 0 {
            episode.terminate(true);
        } else if episode.tick + 1 >= LIMIT {
            episode.truncate();
        }
    }
}

/// Takes the step that brings it nearest to the nearest berry, and not near a wasp.
fn forage(
    mut agents: Query<(Entity, &Control, &Place, &mut Action), Without<BlindBot>>,
    things: Query<(&Place, &Of, Has<Berry>), Without<Agent>>,
) {
    for (agent, control, at, mut action) in &mut agents {
        if *control != Control::Bot {
            continue;
        }
        let cost = |step: Vec2| {
            let (mut nearest, mut danger) = (f32::INFINITY, 0.0);
            for (place, _, is_berry) in things.iter().filter(|(_, of, _)| of.0 == agent) {
                let far = place.0.distance(at.0 + STEP * step);
                match is_berry {
                    true => nearest = nearest.min(far),
                    false => danger += 4.0 * (1.6 - far).max(0.0),
                }
            }
            nearest + danger
        };
        let best = (0..STEPS.len()).min_by(|a, b| cost(STEPS[*a]).total_cmp(&cost(STEPS[*b]))).unwrap_or_default();
        action.0 = ActionValue::Discrete(best as u32);
    }
}

fn main() -> ExitCode {
    playbot::main(&[&Meadow])
}
