//! Curved rays: where the player would go if a button were held.
//!
//! A person sees in which arc the figure will fly. A straight ray does not tell, so these sensors follow the player's
//! own motion through what is in view: tiles, crates and saws as they stand, enemies at their present speed. A path ends
//! at the edge of the view.

use super::{
    rules::{Body, Outcome, PlayerState, begin_step, is_supported, move_player, touch},
    tile::TileGrid,
    view_size::REACH,
};

/// Buttons that are tried: right and jump, right, jump, nothing, left, left and jump.
pub const HELD: [u8; 6] = [8, 7, 5, 4, 1, 2];
/// A path is followed for at most this many steps: a jump on flat ground takes 16.
pub const STEPS: u32 = 20;
/// Values per path.
pub const VALUES: usize = 6;
/// Names of the values of one path.
pub const NAMES: [&str; VALUES] = ["dies", "coin", "lands", "steps", "dx", "dy"];

/// Bodies farther away than this (tiles, along x) cannot be met on a path: half a view, and what an enemy can walk.
const FAR: f32 = 10.0;

/// What the paths lead through.
pub struct Surroundings<'a> {
    tiles: &'a TileGrid,
    crates: Vec<Body>,
    saws: Vec<Body>,
    enemies: Vec<Body>,
}

impl<'a> Surroundings<'a> {
    /// The part of an arena that a path from `player` can reach.
    pub fn new(player: &Body, tiles: &'a TileGrid, crates: &[Body], saws: &[Body], enemies: &[Body]) -> Self {
        let near = |bodies: &[Body]| -> Vec<Body> {
            bodies.iter().filter(|body| (body.x - player.x).abs() < FAR).copied().collect()
        };
        Self { tiles, crates: near(crates), saws: near(saws), enemies: near(enemies) }
    }

    /// Follows the path of a held action and writes `[dies, coin, lands, steps, dx, dy]`: three flags, the share of
    /// [`STEPS`] that was made, and the displacement in half views.
    ///
    /// The path ends with death, with the coin, where a flight ends on firm ground, and at the edge of the view.
    pub fn follow(&self, start: &Body, memory: &PlayerState, action: u8, out: &mut [f32]) {
        let (mut player, mut memory, mut enemies) = (*start, *memory, self.enemies.clone());
        let (mut end, mut steps, mut flew, mut lands) = (None, 0, false, false);
        let half_view = REACH as f32 + 0.5;
        let in_view = |player: &Body| (player.x - start.x).abs().max((player.y - start.y).abs()) < half_view;
        while steps < STEPS && end.is_none() && !lands && in_view(&player) {
            let step = begin_step(&mut player, &mut memory, self.tiles, action);
            for enemy in &mut enemies {
                enemy.x += enemy.vx;
            }
            move_player(&mut player, &mut memory, self.tiles, &self.crates, &step, true);
            steps += 1;
            end = touch(&player, self.tiles, self.saws.iter(), enemies.iter(), steps);
            let supported = is_supported(&player, &memory, self.tiles);
            lands = flew && supported;
            flew |= !supported && player.vy.abs() > 0.5;
        }
        let flag = |is: bool| f32::from(u8::from(is));
        out.copy_from_slice(&[
            flag(end.is_some_and(|end| end != Outcome::Coin)),
            flag(end == Some(Outcome::Coin)),
            flag(lands),
            steps as f32 / STEPS as f32,
            (player.x - start.x) / half_view,
            (player.y - start.y) / half_view,
        ]);
    }
}
