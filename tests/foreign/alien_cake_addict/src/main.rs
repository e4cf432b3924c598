//! Bevy's example `alien_cake_addict`, as it is in the `bevy` package, with every verb of playbot.
//!
//! A level is the sequence of the cakes' positions. An episode ends when the game is over, or after a minute.

include!(concat!(env!("OUT_DIR"), "/game.rs"));

mod defects;
mod rules;

use std::process::ExitCode;

use KeyCode::{ArrowDown, ArrowLeft, ArrowRight, ArrowUp};
use playbot::harness::foreign::{ForeignGame, LevelSeed, Restart};
use playbot::prelude::EpisodeEnd;

fn main() -> ExitCode {
    playbot::main(&[&rules::add_to(adapter())])
}

/// The game with all that its testers need.
fn adapter() -> ForeignGame {
    ForeignGame::new("alien_cake_addict", 1, game)
        .hz(20.0)
        .keys([vec![ArrowUp], vec![ArrowDown], vec![ArrowRight], vec![ArrowLeft], vec![]])
        .observe(["i", "j", "cake_i", "cake_j", "cake"], |g: Res<Game>| {
            [g.player.i, g.player.j, g.bonus.i, g.bonus.j, g.bonus.entity.iter().len()].map(|n| n as f32 / 10.0)
        })
        .position(|game: Res<Game>| Vec2::new(game.player.i as f32, game.player.j as f32))
        .reward_delta(|game: Res<Game>| game.cake_eaten as f32)
        .end(|state: Res<State<GameState>>| (*state == GameState::GameOver).then_some(EpisodeEnd::LOST))
        .time_limit(1200)
        .restart(Restart::state(GameState::Playing))
        .level(refresh)
        .demonstrator("glutton", |game: Res<Game>| {
            let (at, cake) = (&game.player, &game.bonus);
            [at.i < cake.i, at.i > cake.i, at.j < cake.j, at.j > cake.j].iter().position(|go| *go).unwrap_or(4) as u32
        })
}

/// Resets state that the game's own setup leaves: the timer, an old cake, and the camera's target.
fn refresh(level: Res<LevelSeed>, mut rng: ResMut<Random>, mut timer: ResMut<BonusSpawnTimer>, mut game: ResMut<Game>) {
    rng.0 = ChaCha8Rng::seed_from_u64(level.0);
    (game.bonus.i, game.bonus.j, game.bonus.entity, game.camera_is_focus) = (0, 0, None, RESET_FOCUS.into());
    timer.0.reset();
}
