//! Slide, a sliding puzzle without any code for playbot, with every verb of it.

mod defects;
mod game;
mod rules;

use std::process::ExitCode;

use bevy::prelude::*;
use game::{Board, CELLS, Puzzle, SIDE, Screen};
use playbot::harness::foreign::{ForeignGame, LevelSeed};
use playbot::prelude::{EpisodeEnd, PointerPosition};

/// The action that clicks on Start: behind no click, and a click on each cell.
const START: u32 = 1 + CELLS as u32;

fn main() -> ExitCode {
    let middle = |at: usize| (at as f32 + 0.5) / SIDE as f32;
    let cells = (0..CELLS).map(|cell| Some(PointerPosition::fraction(middle(cell % SIDE), middle(cell / SIDE))));
    playbot::main(&[&rules::add_to(ForeignGame::new("slide", 1, game::game))
        .cursor([None].into_iter().chain(cells))
        .mouse_buttons([vec![]].into_iter().chain((0..CELLS).map(|_| vec![MouseButton::Left])))
        .clicks(["Start"])
        .observe((0..CELLS).map(|cell| format!("cell {cell}")), |board: Res<Board>| board.0.map(f32::from))
        .state_hash(|board: Res<Board>| board.0.iter().fold(0, |hash, tile| hash * 9 + u64::from(*tile)))
        .legal(|board: Res<Board>, screen: Res<State<Screen>>| {
            let is_menu = **screen == Screen::Menu;
            let moves = (0..CELLS).map(|cell| !is_menu && board.can_move(cell));
            [!is_menu].into_iter().chain(moves).chain([is_menu]).collect::<Vec<_>>()
        })
        .reward(|screen: Res<State<Screen>>| f32::from(u8::from(**screen == Screen::Solved)))
        .end(|screen: Res<State<Screen>>| (**screen == Screen::Solved).then_some(EpisodeEnd::WON))
        .time_limit(120)
        .level(|seed: Res<LevelSeed>, mut commands: Commands, mut next: ResMut<NextState<Screen>>| {
            commands.insert_resource(Puzzle(seed.0));
            commands.insert_resource(Board::default());
            next.set(Screen::Menu);
        })
        .demonstrator("solver", |board: Res<Board>, screen: Res<State<Screen>>| match **screen {
            Screen::Menu => START,
            _ => board.hint(8).map_or(0, |cell| 1 + cell as u32),
        })])
}
