//! A program whose game panics in a step of its start, or while it is played. The step is in the variable `BREAK`: `build`,
//! `finish`, `start`, or `edge` for the tick in which the paddle is at the right edge. Without it, the game is sound.

use std::process::ExitCode;

use bevy::prelude::*;
use playbot_tests::foreign::catch::{Paddle, adapted, game};

/// A plugin that panics in one of its steps.
struct Fragile(String);

impl Plugin for Fragile {
    fn build(&self, app: &mut App) {
        assert!(self.0 != "build", "no saved game");
        if self.0 == "start" {
            app.add_systems(Startup, open_door);
        }
        if self.0 == "edge" {
            app.add_systems(Update, watch_edge);
        }
    }

    fn finish(&self, _: &mut App) {
        assert!(self.0 != "finish", "no saved game");
    }
}

#[inline(never)]
fn open_door() {
    panic!("no saved game");
}

fn watch_edge(paddle: Single<&Transform, With<Paddle>>) {
    assert!(paddle.translation.x < 8.0, "the paddle falls off the table");
}

fn main() -> ExitCode {
    let step = std::env::var("BREAK").unwrap_or_default();
    let broken = adapted(move |app: &mut App| {
        game(app);
        app.add_plugins(Fragile(step.clone()));
    });
    playbot::main(&[&broken])
}
