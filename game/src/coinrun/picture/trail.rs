//! Puffs that enemies leave behind. They are there to be seen and do nothing.
//!
//! In each tick an enemy leaves one behind its feet. It rises, grows and fades, and is gone after [`LIFE`] ticks.

use bevy::prelude::*;

use super::{
    art::Art,
    dress::{BLOCKS, Scenery},
};
use crate::coinrun::{
    components::{Arena, ArenaBody, InArena, PlayerBody},
    rules::Body,
};

/// Ticks until a puff is gone.
const LIFE: u32 = 8;
/// Puffs of an enemy: with the one that has just appeared.
const PUFFS: u32 = LIFE + 1;
/// Width and height of a new puff, tiles, and the factor by which it grows in each tick.
const SIZE: Vec2 = Vec2::new(0.6, 0.4);
const GROWTH: f32 = 1.05;
/// Opacity of a new puff, and the factor by which it fades.
const ALPHA: f32 = 0.5;
const FADING: f32 = 0.8;
/// Tiles by which a puff rises in each tick.
const RISE: f32 = 0.01;
/// Enemies at least this many tiles to the left or to the right of the player have no puffs: they are far outside of
/// what agents see ([`VIEW`](super::VIEW)), and sprites cost time wherever they are. Only people see it who look farther.
const REACH: f32 = 10.0;

/// In front of saws and crates, which lie within this of [`BLOCKS`], and behind enemies and player; older puffs lie
/// farther back, and those of one age as their enemies.
const DEPTH: f32 = 0.5;
const OLDER: f32 = 1.0 / 32.0;
const NEXT: f32 = 1.0 / 16384.0;

/// Where an enemy was.
#[derive(Component)]
pub(super) struct Trail {
    /// Feet and sprite of the last puffs: that of tick t is number t % [`PUFFS`].
    places: [Vec2; PUFFS as usize],
    puffs: [Option<Entity>; PUFFS as usize],
    /// The tick in which the enemy was first seen; its first puff is the next one's.
    since: Option<u32>,
    /// Its number among those in the arena.
    number: u32,
}

impl Trail {
    /// The trail of an enemy that has not moved yet.
    pub fn new(number: u32) -> Self {
        Self { places: default(), puffs: default(), since: None, number }
    }

    /// Notes where the enemy is in a tick, and returns how many puffs there are then.
    fn note(&mut self, tick: u32, body: &Body) -> u32 {
        let since = *self.since.get_or_insert(tick);
        self.places[(tick % PUFFS) as usize] = Vec2::new(body.x, body.y - body.ry / 2.0);
        tick.saturating_sub(since).min(PUFFS)
    }
}

/// Moves the puffs of all enemies on. Done again in a tick, it changes nothing.
pub(super) fn trails(
    mut enemies: Query<(Entity, &InArena, &ArenaBody, &Transform, &mut Trail)>,
    arenas: Query<(&Arena, &Scenery)>,
    players: Query<&PlayerBody>,
    mut puffs: Query<(&mut Transform, &mut Sprite), Without<Trail>>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (enemy, in_arena, ArenaBody(body), at, mut trail) in &mut enemies {
        let Ok((arena, &Scenery { tick, .. })) = arenas.get(in_arena.0) else { continue };
        let count = trail.note(tick, body);
        if players.get(arena.player).is_ok_and(|player| (player.0.x - body.x).abs() >= REACH) {
            trail.puffs.iter_mut().filter_map(Option::take).for_each(|puff| commands.entity(puff).despawn());
            continue;
        }
        let (mut size, mut alpha, mut rise) = (SIZE, ALPHA, 0.0);
        for age in 0..count {
            let slot = ((tick - age) % PUFFS) as usize;
            let depth = BLOCKS + DEPTH - age as f32 * OLDER + trail.number as f32 * NEXT;
            let place = (trail.places[slot] + Vec2::new(0.0, rise)).extend(depth) - at.translation;
            let colour = Color::linear_rgba(1.0, 1.0, 1.0, alpha);
            match trail.puffs[slot].and_then(|puff| puffs.get_mut(puff).ok()) {
                Some((mut transform, mut sprite)) => {
                    transform.translation = place;
                    sprite.custom_size = Some(size);
                    sprite.color = colour;
                }
                None => {
                    let sprite = Sprite {
                        rect: Some(Art::puff()),
                        custom_size: Some(size),
                        color: colour,
                        ..Sprite::from_image(art.figures.clone())
                    };
                    let puff = (ChildOf(enemy), sprite, Transform::from_translation(place));
                    trail.puffs[slot] = Some(commands.spawn(puff).id());
                }
            }
            (size, alpha, rise) = (size * GROWTH, alpha * FADING, rise + RISE);
        }
    }
}
