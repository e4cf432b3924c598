//! Puffs behind enemies, which are only drawn.

use bevy::prelude::*;

use super::{
    art::Art,
    puffs::{PUFFS, Row},
    scenery::{BLOCKS, Scenery},
};
use crate::coinrun::{
    components::{Arena, ArenaBody, InArena, PlayerBody},
    rules::Body,
};

/// Enemies at least this many tiles to the left or to the right of the player have no puffs. They are outside of the
/// agents' view, half of [`VIEW`](super::VIEW) and the length of a trail, and sprites cost time anywhere. Only people
/// with a wider view see it.
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
    fn row(&self, tick: u32, first: usize, count: usize) -> Row {
        let step = |age| self.place(tick, age) - self.place(tick, age + 1);
        let alike = (first..count - 1).take_while(|&age| (step(age) - step(first)).length_squared() < ALIKE * ALIKE);
        Row { first, count: 1 + alike.count() }
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
