//! Updates of sprites: positions, poses, directions. Only moving entities are changed.

use crate::coinrun::{
    components::{Arena, ArenaBody, Crate, Enemy, InArena, PlayerBody, PlayerMemory, PlaysIn, Saw},
    picture::{
        BLOCKS, PLAYER_HEIGHT, Scenery,
        art::{Art, PUFFS, Pose, PuffRow},
    },
    play::NOTHING,
    rules::{Body, JUMP_SPEED, PlayerState, WALK_SPEED, directions},
};
use bevy::prelude::*;
use bevy_playbot::vision::PaintedVelocity;
use playbot_harness::prelude::*;

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

// Puffs behind enemies, which are only drawn.

/// Enemies at least this many tiles to the left or to the right of the player have no puffs. They are outside of the
/// agents' view, half of [`VIEW`](crate::coinrun::picture::VIEW) and the length of a trail, and sprites cost time
/// anywhere. Only people with a wider view see it.
const REACH: f32 = 9.0;

/// In front of saws and crates, which lie within this of [`BLOCKS`], and behind enemies and player. Older puffs lie
/// farther back, and those of one age in the order of their enemies.
const DEPTH: f32 = 0.5;

const OLDER: f32 = 1.0 / 32.0;

const NEXT: f32 = 1.0 / 16384.0;

/// Steps that differ by less, in tiles, are of one speed.
const ALIKE: f32 = 1e-3;

/// Positions of an enemy, and its sprites.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub(super) struct Trail {
    /// Positions of new puffs: that of tick t is number t % [`PUFFS`].
    places: [Vec2; PUFFS],
    /// A sprite for each row of puffs, the newest first.
    sprites: Vec<Entity>,
    /// The tick in which the enemy was first seen; its first puff is the next one's.
    since: Option<u32>,
    /// Its number among those in the arena.
    number: u32,
}

impl Trail {
    /// Returns the trail of an enemy that has not moved yet.
    pub fn new(number: u32) -> Self {
        Self { places: default(), sprites: Vec::new(), since: None, number }
    }

    /// Notes the position of the enemy in a tick, and returns the number of its puffs.
    fn note(&mut self, tick: u32, body: &Body) -> usize {
        let since = *self.since.get_or_insert(tick);
        self.places[tick as usize % PUFFS] = Vec2::new(body.x, body.y - body.ry / 2.0);
        tick.saturating_sub(since).min(PUFFS as u32) as usize
    }

    /// Returns the start of the puff of this age.
    fn place(&self, tick: u32, age: usize) -> Vec2 {
        self.places[(tick as usize - age) % PUFFS]
    }

    /// Returns the longest row at one speed whose newest puff is `first` ticks old, of `count` puffs in all.
    fn row(&self, tick: u32, first: usize, count: usize) -> PuffRow {
        let step = |age| self.place(tick, age) - self.place(tick, age + 1);
        let alike = (first..count - 1).take_while(|&age| (step(age) - step(first)).length_squared() < ALIKE * ALIKE);
        PuffRow { first, count: 1 + alike.count() }
    }
}

/// Moves the puffs of all enemies. Repeated in a tick, it changes nothing.
pub(super) fn trails(
    mut enemies: Query<(Entity, &InArena, &ArenaBody, &Transform, &mut Trail)>,
    arenas: Query<(&Arena, &Scenery)>,
    players: Query<&PlayerBody>,
    mut sprites: Query<(&mut Transform, &mut Sprite), Without<Trail>>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (enemy, in_arena, ArenaBody(body), at, mut trail) in &mut enemies {
        let Ok((arena, &Scenery { tick, .. })) = arenas.get(in_arena.0) else { continue };
        let count = trail.note(tick, body);
        let far = players.get(arena.player).is_ok_and(|player| (player.0.x - body.x).abs() >= REACH);
        let (mut first, mut rows) = (0, 0);
        while !far && first < count {
            let row = trail.row(tick, first, count);
            let (newest, oldest) = (trail.place(tick, first), trail.place(tick, first + row.count - 1));
            let (size, middle) = row.lay_out(newest, oldest);
            let depth = BLOCKS + DEPTH - rows as f32 * OLDER + trail.number as f32 * NEXT;
            let place = middle.extend(depth) - at.translation;
            let (rect, custom_size, flip_x) = (Some(row.rect()), Some(size), newest.x < oldest.x);
            match trail.sprites.get(rows).and_then(|&sprite| sprites.get_mut(sprite).ok()) {
                Some((mut transform, mut sprite)) => {
                    transform.translation = place;
                    (sprite.rect, sprite.custom_size, sprite.flip_x) = (rect, custom_size, flip_x);
                }
                None => {
                    let drawn = Sprite { rect, custom_size, flip_x, ..Sprite::from_image(art.puffs.clone()) };
                    let made = commands.spawn((ChildOf(enemy), drawn, Transform::from_translation(place))).id();
                    trail.sprites.truncate(rows);
                    trail.sprites.push(made);
                }
            }
            (first, rows) = (first + row.count, rows + 1);
        }
        if rows < trail.sprites.len() {
            trail.sprites.drain(rows..).for_each(|sprite| commands.entity(sprite).despawn());
        }
    }
}
