//! A small game with reflected state, healthy or with one planted fault, for tests of the doctor.
//!
//! A gardener walks along a bed of plants and waters the one it stands at. Every gardener has plants of its own.

use std::{
    collections::HashMap,
    hash::{BuildHasher, Hasher, RandomState},
    time::Duration,
};

use bevy::{prelude::*, time::Real};
use playbot::prelude::*;

/// The fault of a copy of the game.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No fault.
    None,
    /// The [`Wind`] comes from an unseeded generator.
    UnseededRandomness,
    /// The gardener's [`Smells`] depends on the order of a `HashMap`.
    HashOrder,
    /// The [`Sun`] moves at the pace of `Time<Real>`.
    WallClock,
    /// The [`Sun`] moves faster with the time of `Time<Real>`, which also goes on from episode to episode.
    WallTime,
    /// All gardeners count into one [`Score`].
    SharedScore,
    /// The [`Soil`] dries from episode to episode.
    Survivor,
    /// Level 0 floods the [`Soil`], and no other level dries it.
    Flood,
    /// The [`Wind`] comes from an unseeded generator in level 1.
    Storm,
    /// The plants of an episode stay when it is over.
    LeftOvers,
    /// An unread [`Record`] lasts for ever.
    LastingRecord,
    /// The time that [`Labour`] takes differs from run to run, and nothing depends on it.
    Measured,
    /// It differs, and so does the [`Wind`], which is an effect of it.
    MeasuredWind,
    /// The [`Favourite`] is any plant, and nothing depends on it.
    Favourite,
    /// An unseeded [`Record`] is paid out in the last tick of an episode.
    Sleeper,
    /// The [`Secret`] of the plant is drawn without a seed, and reflection cannot see it.
    Hidden,
    /// The observed height is infinite at tick 7.
    NotFinite,
    /// The game panics at tick 5.
    Panic,
    /// The observation never changes.
    Blind,
}

/// Position and earnings of a gardener.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct Gardener {
    x: f32,
    earned: u32,
}

/// Smell of a gardener's position.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct Smells {
    mixture: u64,
}

/// State that reflection cannot see.
#[derive(Component, Clone, Debug, Default)]
pub struct Secret(f32);

/// A plant of a gardener.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component)]
pub struct Plant {
    gardener: Entity,
    place: f32,
    height: f32,
}

/// Blows at all plants.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Wind {
    force: f32,
}

/// Strengths of the herbs.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Herbs {
    strengths: HashMap<u64, u32>,
}

/// Speed of the sun.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Sun {
    pace: f32,
}

/// Plants watered, by all gardeners.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Score(u32);

/// Wetness of the soil.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub struct Soil {
    wet: f32,
}

/// Ticks since the game began.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Record(u32);

/// Time that the last tick took.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Labour {
    took: Duration,
}

/// The plant that everybody likes best.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct Favourite(Option<Entity>);

/// The fault of this copy.
#[derive(Resource, Clone, Copy)]
struct Planted(Fault);

/// Ticks of an episode.
const LIMIT: u32 = 25;
const PLANTS: u8 = 4;

fn start(
    event: On<StartEpisode>,
    planted: Res<Planted>,
    mut gardeners: Query<(&mut Gardener, &mut Smells)>,
    plants: Query<(Entity, &Plant)>,
    mut score: ResMut<Score>,
    mut soil: ResMut<Soil>,
    mut commands: Commands,
) {
    let Ok((mut gardener, mut smells)) = gardeners.get_mut(event.entity) else { return };
    (*gardener, *smells) = (Gardener::default(), Smells::default());
    score.0 = 0;
    if planted.0 == Fault::Flood && event.level == 0 {
        soil.wet = 2.0;
    }
    if planted.0 != Fault::LeftOvers {
        let own = plants.iter().filter(|(_, plant)| plant.gardener == event.entity);
        own.for_each(|(plant, _)| commands.entity(plant).despawn());
    }
    for number in 0..PLANTS {
        let place = f32::from(number) + (event.level % 2) as f32;
        commands.spawn((Plant { gardener: event.entity, place, height: 1.0 }, Transform::from_xyz(place, 0.0, 0.0)));
    }
}

fn random() -> u64 {
    RandomState::new().build_hasher().finish()
}

/// Applies the weather, shared by all gardeners.
fn weather(
    planted: Res<Planted>,
    real: Res<Time<Real>>,
    episodes: Query<&Episode>,
    mut wind: ResMut<Wind>,
    mut sun: ResMut<Sun>,
    mut soil: ResMut<Soil>,
    mut record: ResMut<Record>,
    mut labour: ResMut<Labour>,
    mut tick: Local<u32>,
) {
    *tick += 1;
    match planted.0 {
        Fault::UnseededRandomness => wind.force = (random() >> 40) as f32,
        Fault::Storm => {
            let is_stormy = episodes.iter().any(|episode| episode.level == 1);
            wind.force = if is_stormy { (random() >> 40) as f32 } else { 0.0 };
        }
        Fault::WallClock => sun.pace = real.delta_secs(),
        Fault::WallTime => sun.pace = real.elapsed_secs(),
        Fault::Survivor => soil.wet *= 0.99,
        Fault::LastingRecord => record.0 += 1,
        Fault::Sleeper => record.0 = (random() >> 40) as u32,
        Fault::Measured => labour.took = Duration::from_nanos(random()),
        Fault::MeasuredWind => {
            labour.took = Duration::from_nanos(random());
            wind.force = labour.took.as_secs_f32();
        }
        Fault::Panic => assert!(*tick <= 5, "the garden burns"),
        _ => {}
    }
}

fn favour(planted: Res<Planted>, plants: Query<Entity, With<Plant>>, mut favourite: ResMut<Favourite>) {
    let all: Vec<Entity> = plants.iter().collect();
    if planted.0 == Fault::Favourite && !all.is_empty() {
        favourite.0 = Some(all[random() as usize % all.len()]);
    }
}

#[derive(bevy::ecs::system::SystemParam)]
struct Garden<'w> {
    planted: Res<'w, Planted>,
    wind: Res<'w, Wind>,
    sun: Res<'w, Sun>,
    soil: Res<'w, Soil>,
    record: Res<'w, Record>,
    herbs: Res<'w, Herbs>,
    score: ResMut<'w, Score>,
}

fn work(
    mut garden: Garden,
    mut gardeners: Query<(
        Entity,
        &Control,
        &Action,
        (&mut Gardener, &mut Smells, &mut Secret),
        &mut Reward,
        &mut Episode,
        &mut StateHash,
    )>,
    mut plants: Query<(&mut Plant, &mut Transform)>,
) {
    for (entity, control, action, (mut gardener, mut smells, mut secret), mut reward, mut episode, mut hash) in
        &mut gardeners
    {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let planted = garden.planted.0;
        gardener.x += if action.discrete() == Some(1) { 0.25 } else { -0.25 };
        gardener.x = gardener.x.clamp(0.0, 4.0);
        for (mut plant, mut transform) in plants.iter_mut().filter(|(plant, _)| plant.gardener == entity) {
            let near = (plant.place - gardener.x).abs() < 0.5;
            plant.height += garden.soil.wet + garden.sun.pace + garden.wind.force;
            transform.scale.y = plant.height;
            gardener.earned += u32::from(near);
        }
        if planted == Fault::HashOrder {
            let keys = garden.herbs.strengths.keys();
            smells.mixture = keys.fold(smells.mixture, |mixture, herb| mixture.wrapping_mul(31).wrapping_add(*herb));
        }
        if planted == Fault::Hidden {
            secret.0 = (random() >> 40) as f32;
        }
        let earned = if planted == Fault::SharedScore {
            garden.score.0 += 1;
            garden.score.0
        } else {
            gardener.earned
        };
        reward.add(earned as f32 + secret.0);
        hash.0 = u64::from(gardener.x.to_bits()) << 32 | u64::from(earned);
        if episode.tick + 1 >= LIMIT {
            if planted == Fault::Sleeper {
                reward.add(garden.record.0 as f32);
            }
            episode.truncate();
        }
    }
}

fn see(
    planted: Res<Planted>,
    mut gardeners: Query<(Entity, &Gardener, &Episode, &mut Observation)>,
    plants: Query<&Plant>,
) {
    for (entity, gardener, episode, mut observation) in &mut gardeners {
        let heights = plants.iter().filter(|plant| plant.gardener == entity).map(|plant| plant.height);
        let mut tallest = heights.fold(0.0, f32::max);
        if planted.0 == Fault::NotFinite && episode.tick == 7 {
            tallest = f32::INFINITY;
        }
        match planted.0 {
            Fault::Blind => observation.set([1.0, 2.0, 3.0]),
            _ => observation.set([gardener.x, tallest, 3.0]),
        }
    }
}

impl Game for Fault {
    fn name(&self) -> &'static str {
        "garden"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["bed"]
    }

    fn tick_hz(&self) -> f64 {
        20.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(2)
    }

    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: ["x", "tallest", "gardens"].map(String::from).into() }
    }

    fn build(&self, app: &mut App, _mode: &str) {
        app.insert_resource(Planted(*self))
            .insert_resource(Soil { wet: 0.5 })
            .insert_resource(Herbs { strengths: (0..64).map(|herb| (herb, 1)).collect() })
            .init_resource::<Wind>()
            .init_resource::<Sun>()
            .init_resource::<Score>()
            .init_resource::<Record>()
            .init_resource::<Labour>()
            .init_resource::<Favourite>()
            .add_observer(start)
            .add_systems(ObserveSchedule, see)
            .add_systems(FixedUpdate, (weather, favour, work).chain());
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let sensor = VectorSensor::new(self.observation().names);
        let gardener = (Gardener::default(), Smells::default(), Secret::default());
        world.spawn((Agent::new(index, self.actions()), sensor, gardener)).id()
    }
}
