//! Updates of sprites: positions, poses, directions. Only moving entities are changed.

use bevy::prelude::*;
use bevy_playbot::vision::PaintedVelocity;
use playbot_lab::prelude::*;

use super::{
    art::{Art, Pose},
    scenery::{PLAYER_HEIGHT, Scenery},
};
use crate::coinrun::{
    components::{Arena, ArenaBody, Crate, Enemy, InArena, PlayerBody, PlayerMemory, PlaysIn, Saw},
    play::NOTHING,
    rules::{Body, JUMP_SPEED, PlayerState, WALK_SPEED, directions},
};

/// Ticks for which a step of a walk is shown.
const STEP_TICKS: u32 = 5;
/// A player slower than this stands, tiles per tick.
const STANDING: f32 = 0.01;

/// Updates players, and the clocks of their arenas.
pub(super) fn players(
    mut players: Query<(
        &Episode,
        &Action,
        &PlaysIn,
        &PlayerBody,
        &PlayerMemory,
        &mut Transform,
        &mut Sprite,
        &mut PaintedVelocity,
    )>,
    mut arenas: Query<(&Arena, &mut Scenery)>,
) {
    for (episode, action, plays_in, body, memory, mut transform, mut sprite, mut velocity) in &mut players {
        let Ok((arena, mut scenery)) = arenas.get_mut(plays_in.0) else { continue };
        scenery.tick = episode.tick;
        let (body, memory) = (&body.0, &memory.0);
        // At the start of an episode, the action is still that of the last one.
        let ax = if episode.tick == 0 { 0 } else { horizontal(action) };
        let height = 2.0 * body.ry * PLAYER_HEIGHT;
        transform.translation.x = body.x;
        transform.translation.y = body.y;
        sprite.custom_size = Some(Vec2::new(2.0 * body.rx, height));
        sprite.rect = Some(Art::player(arena.level.agent_theme, pose(body, memory, ax, episode.tick)));
        sprite.flip_x = memory.faces_left;
        velocity.0 = Vec2::new(body.vx / WALK_SPEED, body.vy / JUMP_SPEED);
    }
}

fn horizontal(action: &Action) -> i8 {
    let action = action.discrete().and_then(|index| u8::try_from(index).ok()).unwrap_or(NOTHING);
    directions(action).0
}

fn pose(body: &Body, memory: &PlayerState, ax: i8, tick: u32) -> Pose {
    if memory.supported && ax == 0 && body.vx.abs() < STANDING {
        Pose::Stand
    } else if !memory.supported || (tick / STEP_TICKS).is_multiple_of(2) {
        Pose::Walk1
    } else {
        Pose::Walk2
    }
}

/// Enemies walk and look where they go.
pub(super) fn enemies(
    mut enemies: Query<(&InArena, &Enemy, &ArenaBody, &mut Transform, &mut Sprite)>,
    arenas: Query<&Scenery>,
) {
    for (in_arena, enemy, body, mut transform, mut sprite) in &mut enemies {
        let Ok(scenery) = arenas.get(in_arena.0) else { continue };
        let step = (scenery.tick / STEP_TICKS % 2) as usize;
        transform.translation.x = body.0.x;
        transform.translation.y = body.0.y;
        sprite.rect = Some(Art::enemy(enemy.sprite, step));
        sprite.flip_x = body.0.vx < 0.0;
    }
}

/// Saws turn with every tick.
pub(super) fn saws(mut saws: Query<(&InArena, &mut Sprite), With<Saw>>, arenas: Query<&Scenery>) {
    for (in_arena, mut sprite) in &mut saws {
        let Ok(scenery) = arenas.get(in_arena.0) else { continue };
        sprite.rect = Some(Art::saw((scenery.tick % 2) as usize));
    }
}

/// Saws and crates stand still in CoinRun; in a game built on it they need not.
pub(super) fn moved_blocks(
    mut blocks: Query<(&ArenaBody, &mut Transform), (Or<(With<Saw>, With<Crate>)>, Without<Enemy>, Changed<ArenaBody>)>,
) {
    for (body, mut transform) in &mut blocks {
        transform.translation.x = body.0.x;
        transform.translation.y = body.0.y;
    }
}
