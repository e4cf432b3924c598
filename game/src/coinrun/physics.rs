//! rapier2d colliders for all bodies, for ray sensors and physics of a game's own.
//!
//! The rules of CoinRun move the bodies; rapier follows them. Each arena has a physics context of its own, since arenas
//! lie on top of each other and must not meet.

use crate::coinrun::{
    SIZE, Tile,
    components::{ArenaBody, Crate, Enemy, InArena, PlayerBody, PlaysIn, Saw, Tiles},
    play::CoinRunSystems,
    rules::Body,
};
use bevy::{prelude::*, transform::TransformPlugin};
use bevy_rapier2d::prelude::*;

/// Adds rapier to CoinRun.
///
/// Left out of headless training, which does not need it: see the benchmark for its cost.
#[derive(Default, Debug, Clone, Copy)]
pub struct CoinRunPhysicsPlugin;

/// The ground of an arena, as a collider.
#[derive(Component, Debug, Clone, Copy, Reflect)]
#[reflect(Component)]
pub struct GroundCollider;

impl Plugin for CoinRunPhysicsPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<TransformPlugin>() {
            app.add_plugins(TransformPlugin);
        }
        let step = app.world().resource::<Time<Fixed>>().timestep().as_secs_f32();
        app.insert_resource(TimestepMode::Fixed { dt: step, substeps: 1 })
            .add_plugins(
                RapierPhysicsPlugin::<NoUserData>::default()
                    .with_custom_initialization(RapierContextInitialization::NoAutomaticRapierContext)
                    .in_fixed_schedule(),
            )
            .add_systems(
                FixedUpdate,
                (add_contexts, add_ground, add_bodies, follow_players, follow_bodies)
                    .chain()
                    .after(CoinRunSystems)
                    .before(PhysicsSet::SyncBackend),
            );
    }
}

/// Adds a context without gravity to the arena of each new player: only the rules move bodies. A player has a collider
/// before its first level.
fn add_contexts(
    players: Query<&PlaysIn, Added<PlaysIn>>,
    known: Query<(), With<RapierContextSimulation>>,
    mut commands: Commands,
) {
    for &PlaysIn(arena) in &players {
        if !known.contains(arena) {
            let configuration = RapierConfiguration { gravity: Vec2::ZERO, ..RapierConfiguration::new(1.0) };
            commands.entity(arena).insert((RapierContextSimulation::default(), configuration));
        }
    }
}

/// Adds one collider for all ground of a new level.
fn add_ground(arenas: Query<(Entity, &Tiles), Changed<Tiles>>, mut commands: Commands) {
    for (arena, tiles) in &arenas {
        let cells: Vec<IVec2> = (0..SIZE * SIZE)
            .map(|cell| IVec2::new(cell % SIZE, cell / SIZE))
            .filter(|cell| matches!(tiles.0.get(cell.x, cell.y), Tile::Wall | Tile::WallTop))
            .collect();
        commands.spawn((
            GroundCollider,
            InArena(arena),
            RapierContextEntityLink(arena),
            RigidBody::Fixed,
            Collider::voxels(Vec2::ONE, &cells),
            Transform::default(),
        ));
    }
}

fn add_bodies(
    players: Query<(Entity, &PlayerBody, &PlaysIn), Without<Collider>>,
    bodies: Query<(Entity, &ArenaBody, &InArena, Has<Enemy>, Has<Saw>, Has<Crate>), Added<ArenaBody>>,
    mut commands: Commands,
) {
    for (entity, body, plays_in) in &players {
        commands.entity(entity).insert(collider(&body.0, plays_in.0, RigidBody::KinematicPositionBased));
    }
    for (entity, body, in_arena, is_enemy, is_saw, is_crate) in &bodies {
        let kind = if is_enemy { RigidBody::KinematicPositionBased } else { RigidBody::Fixed };
        commands.entity(entity).insert(collider(&body.0, in_arena.0, kind));
        // Bodies that do not stop the player are sensors.
        if !is_saw && !is_crate {
            commands.entity(entity).insert(Sensor);
        }
    }
}

fn collider(body: &Body, arena: Entity, kind: RigidBody) -> impl Bundle {
    (RapierContextEntityLink(arena), kind, Collider::cuboid(body.rx, body.ry), place(body))
}

fn place(body: &Body) -> Transform {
    Transform::from_xyz(body.x, body.y, 0.0)
}

fn follow_players(mut players: Query<(&PlayerBody, &mut Transform), Changed<PlayerBody>>) {
    for (body, mut transform) in &mut players {
        *transform = place(&body.0);
    }
}

fn follow_bodies(mut bodies: Query<(&ArenaBody, &mut Transform), Changed<ArenaBody>>) {
    for (body, mut transform) in &mut bodies {
        *transform = place(&body.0);
    }
}
