//! Defects that the benchmark of testers plants into the game. Playing and testing it needs none of them.

use std::time::Duration;

use bevy::prelude::*;
use playbot::harness::{defect::DefectKind, foreign::ForeignGame};

use super::{Game, GameState};

/// Rows that block the player. The game is played on 14, from the middle on.
const WALL: [usize; 3] = [7, 8, 10];
/// Steps from which a cake is eaten.
const FAR: [usize; 3] = [1, 2, 4];
/// Cakes that are counted before the others are not.
const COUNTED: [u32; 3] = [0, 1, 3];
/// Milliseconds between two steps; 300 in the game.
const PAUSE: [u64; 3] = [500, 800, 2000];

/// Adds the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    kinds().into_iter().fold(game, ForeignGame::defect)
}

fn kinds() -> [DefectKind; 4] {
    [
        DefectKind::rules("invisible-wall", "an empty cell blocks players", 3, |app, variant| {
            let wall = WALL[variant as usize % WALL.len()];
            let stop = move |mut game: ResMut<Game>, mut transforms: Query<&mut Transform>| {
                if game.player.i <= wall {
                    return;
                }
                game.player.i = wall;
                let Some(player) = game.player.entity else { return };
                if let Ok(mut at) = transforms.get_mut(player) {
                    at.translation.x = wall as f32;
                }
            };
            add(app, stop);
        }),
        DefectKind::rules("goal-far-away", "cakes are eaten from afar", 3, |app, variant| {
            let far = FAR[variant as usize % FAR.len()];
            // The game's own rule eats a cake here.
            add(app, move |mut game: ResMut<Game>| {
                let away = game.player.i.abs_diff(game.bonus.i) + game.player.j.abs_diff(game.bonus.j);
                if game.bonus.entity.is_some() && (1..=far).contains(&away) {
                    (game.bonus.i, game.bonus.j) = (game.player.i, game.player.j);
                }
            });
        }),
        DefectKind::rules("uncounted-goal", "cakes are eaten and not counted", 3, |app, variant| {
            let counted = COUNTED[variant as usize % COUNTED.len()];
            add(app, move |mut game: ResMut<Game>| {
                if game.cake_eaten > counted {
                    game.score -= 2 * (game.cake_eaten - counted) as i32;
                    game.cake_eaten = counted;
                }
            });
        }),
        DefectKind::rules("slow-player", "players walk too slowly", 3, |app, variant| {
            let pause = Duration::from_millis(PAUSE[variant as usize % PAUSE.len()]);
            add(app, move |mut game: ResMut<Game>| game.player.move_cooldown.set_duration(pause));
        }),
    ]
}

/// Adds a system that runs after those of the game.
fn add<M>(app: &mut App, system: impl IntoScheduleConfigs<bevy::ecs::system::ScheduleSystem, M>) {
    app.add_systems(PostUpdate, system.run_if(in_state(GameState::Playing)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapter;

    playbot_shell::planted_defects!(game: adapter(), levels: "default:0..5");
}
