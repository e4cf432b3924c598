//! Defects that the benchmark of testers plants into the game. Playing and testing it needs none of them.

use bevy::prelude::*;
use playbot::harness::{defect::DefectKind, foreign::ForeignGame};

use crate::game::{Hero, Run, Screen};

/// Addition to the vertical speed in the air in each tick, units per second, and its first column. Gravity makes -0.7.
const LIFT: [(f32, f32); 3] = [(0.25, 0.0), (0.45, 20.0), (-0.6, 40.0)];
/// Factor on the speed of a hop, and its first column.
const HOP: [(f32, f32); 3] = [(0.5, 0.0), (0.7, 20.0), (1.4, 40.0)];
/// A speed that only a hop has in its first tick.
const HOPS: f32 = 13.9;
/// Columns that block the player.
const WALL: [f32; 3] = [12.5, 30.5, 50.5];

/// Adds the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    kinds().into_iter().fold(game, ForeignGame::defect)
}

fn kinds() -> [DefectKind; 4] {
    [
        DefectKind::rules("wrong-gravity", "gravity is too weak or too strong", 3, |app, variant| {
            let (lift, from) = LIFT[variant as usize % LIFT.len()];
            let change = move |hero: Single<(&Transform, &mut Hero)>| {
                let (at, mut hero) = hero.into_inner();
                if at.translation.x >= from && hero.coyote <= 0.0 {
                    hero.velocity.y += lift;
                }
            };
            app.add_systems(FixedPostUpdate, change.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("wrong-jump", "hops are too low or too high", 3, |app, variant| {
            let (factor, from) = HOP[variant as usize % HOP.len()];
            let change = move |hero: Single<(&Transform, &mut Hero)>| {
                let (at, mut hero) = hero.into_inner();
                if at.translation.x >= from && hero.velocity.y > HOPS {
                    hero.velocity.y *= factor;
                }
            };
            app.add_systems(FixedPostUpdate, change.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("invisible-wall", "an empty cell blocks players", 3, |app, variant| {
            let wall = WALL[variant as usize % WALL.len()];
            let stop = move |mut at: Single<&mut Transform, With<Hero>>| {
                if at.translation.x > wall {
                    at.translation.x = wall;
                }
            };
            app.add_systems(PreUpdate, stop.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("goal-does-not-end", "the flag can be touched and the run goes on", 3, |app, variant| {
            let go_on = move |mut next: ResMut<NextState<Screen>>, run: Res<Run>| {
                let is_missed = match variant {
                    0 => true,
                    1 => run.gems > 0,
                    _ => run.gems >= 3,
                };
                if is_missed && matches!(*next, NextState::Pending(Screen::Won)) {
                    next.reset();
                }
            };
            app.add_systems(PostUpdate, go_on);
        }),
    ]
}

#[cfg(test)]
mod tests {
    use playbot::harness::foreign::{LevelSeed, Restart};
    use playbot::prelude::EpisodeEnd;

    use super::*;
    use crate::game::{self, Level, Map};

    /// Returns the game with a bot that runs and hops where the ground ahead is another.
    fn game() -> ForeignGame {
        ForeignGame::new("gem_hop", 1, game::game)
            .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::ArrowRight, KeyCode::Space]])
            .observe(["x"], |at: Single<&Transform, With<Hero>>| [at.translation.x])
            .end(|on: Res<State<Screen>>| matches!(**on, Screen::Won | Screen::Lost).then_some(EpisodeEnd::LOST))
            .time_limit(900)
            .level(|seed: Res<LevelSeed>, mut level: ResMut<Level>, mut next: ResMut<NextState<Screen>>| {
                level.0 = seed.0;
                next.set(Screen::Loading);
            })
            .restart(Restart::Startup)
            .ready(in_state(Screen::Playing))
            .demonstrator("runner", |hero: Single<(&Transform, &Hero)>, map: Res<Map>| {
                let at = hero.0.translation;
                // A player that no goal stops runs past the end.
                let next = map.columns[((at.x + 0.8) as usize).min(map.columns.len() - 1)];
                1 + u32::from(next.spikes || f32::from(next.ground) != at.y.floor() || hero.1.velocity.y > 0.0)
            })
    }

    playbot_shell::planted_defects!(game: game(), levels: "default:0..3");
}
