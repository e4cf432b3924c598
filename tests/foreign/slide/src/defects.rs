//! Defects that the benchmark of testers plants into the game. Playing and testing it needs none of them.

use bevy::{
    app::RunFixedMainLoopSystems::BeforeFixedMainLoop,
    ecs::{schedule::ScheduleConfigs, system::ScheduleSystem},
    prelude::*,
};
use playbot::harness::{
    defect::{DefectKind, place},
    foreign::ForeignGame,
};

use crate::game::{Board, CELLS, Puzzle, SIDE, Screen};

/// A cell, or a tile, for each variant.
const CELL: [usize; 3] = [4, 1, 6];
const TILE: [u8; 3] = [5, 3, 8];
/// Moves until the defect shows.
const MOVES: [u32; 3] = [1, 2, 4];

/// The board before the clicks of this frame, and the moves of this puzzle.
#[derive(Resource, Default)]
struct Before {
    board: Board,
    moves: u32,
    is_fresh: bool,
}

impl Before {
    /// Returns the cell whose tile has moved.
    fn moved(&self, board: &Board) -> Option<usize> {
        (self.board != *board).then(|| board.0.iter().position(|&tile| tile == 0).unwrap_or_default())
    }
}

/// Adds the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    kinds().into_iter().fold(game, ForeignGame::defect)
}

/// Adds a system that runs after the clicks of each frame of a puzzle.
fn after_clicks(app: &mut App, change: ScheduleConfigs<ScheduleSystem>) {
    app.init_resource::<Before>()
        .add_systems(OnEnter(Screen::Playing), |mut before: ResMut<Before>| {
            (before.moves, before.is_fresh) = (0, true);
        })
        .add_systems(
            RunFixedMainLoop,
            (|board: Res<Board>, mut before: ResMut<Before>| before.board = board.clone()).in_set(BeforeFixedMainLoop),
        )
        .add_systems(
            PostUpdate,
            (
                |board: Res<Board>, mut before: ResMut<Before>| {
                    before.moves += u32::from(before.moved(&board).is_some())
                },
                change,
                |mut before: ResMut<Before>| before.is_fresh = false,
            )
                .chain()
                .run_if(in_state(Screen::Playing)),
        );
}

/// Takes the move of this frame back.
fn take_back(before: &Before, board: &mut Board, next: &mut NextState<Screen>) {
    board.0 = before.board.0;
    next.reset();
}

fn kinds() -> [DefectKind; 10] {
    [
        DefectKind::rules("dead-cell", "clicks on one cell do nothing", 3, |app, variant| {
            let dead = CELL[place(variant)];
            let change = move |before: Res<Before>, mut board: ResMut<Board>, mut next: ResMut<NextState<Screen>>| {
                if before.moved(&board) == Some(dead) {
                    take_back(&before, &mut board, &mut next);
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("stuck-tile", "one tile never moves", 3, |app, variant| {
            let stuck = TILE[place(variant)];
            let change = move |before: Res<Before>, mut board: ResMut<Board>, mut next: ResMut<NextState<Screen>>| {
                if before.moved(&board).is_some_and(|cell| before.board.0[cell] == stuck) {
                    take_back(&before, &mut board, &mut next);
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("tired-mouse", "clicks do nothing after some moves", 3, |app, variant| {
            let last = MOVES[place(variant)];
            let change = move |before: Res<Before>, mut board: ResMut<Board>, mut next: ResMut<NextState<Screen>>| {
                if before.moves > last && before.moved(&board).is_some() {
                    take_back(&before, &mut board, &mut next);
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("mirrored-clicks", "a click moves the tile on the other side", 3, |app, variant| {
            let mirror = move |cell: usize| {
                let [column, row] = [cell % SIDE, cell / SIDE];
                let other = |at: usize, flips: bool| if flips { SIDE - 1 - at } else { at };
                other(row, variant != 0) * SIDE + other(column, variant != 1)
            };
            let change = move |before: Res<Before>, mut board: ResMut<Board>, mut next: ResMut<NextState<Screen>>| {
                let Some(cell) = before.moved(&board).filter(|cell| mirror(*cell) != *cell) else { return };
                take_back(&before, &mut board, &mut next);
                board.slide(mirror(cell));
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("jumping-gap", "the gap changes places with the tile in a corner", 3, |app, variant| {
            let at = MOVES[place(variant)];
            let change = move |before: Res<Before>, mut board: ResMut<Board>, mut next: ResMut<NextState<Screen>>| {
                if let Some(cell) = before.moved(&board).filter(|_| before.moves == at) {
                    board.0.swap(cell, if cell == 0 { CELLS - 1 } else { 0 });
                    next.reset();
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("twin-tile", "a tile turns into a copy of another", 3, |app, variant| {
            let at = MOVES[place(variant)];
            let change = move |before: Res<Before>, mut board: ResMut<Board>, mut next: ResMut<NextState<Screen>>| {
                if before.moves == at && before.moved(&board).is_some() {
                    board.0.iter_mut().filter(|tile| **tile == 2).for_each(|tile| *tile = 7);
                    next.reset();
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("wrong-mix", "some puzzles are mixed so that no moves solve them", 3, |app, variant| {
            let change = move |before: Res<Before>, puzzle: Res<Puzzle>, mut board: ResMut<Board>| {
                if before.is_fresh && puzzle.0 % 3 == u64::from(variant) {
                    let [one, two] = [1, 2].map(|tile| board.0.iter().position(|&at| at == tile).unwrap_or_default());
                    board.0.swap(one, two);
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("goal-does-not-end", "tiles can be in order and the puzzle goes on", 3, |app, variant| {
            let change = move |before: Res<Before>, board: Res<Board>, mut next: ResMut<NextState<Screen>>| {
                let is_missed = match variant {
                    0 => true,
                    1 => before.moves > 3,
                    _ => before.moved(&board) == Some(CELLS - 1) && before.board.0[CELLS - 1] == 8,
                };
                if is_missed && matches!(*next, NextState::Pending(Screen::Solved)) {
                    next.reset();
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("early-end", "the puzzle is solved before all tiles are in order", 3, |app, variant| {
            let order = [3, 6, 2][place(variant)];
            let change = move |before: Res<Before>, board: Res<Board>, mut next: ResMut<NextState<Screen>>| {
                if before.moves > 0 && board.0[..order] == Board::default().0[..order] {
                    next.set(Screen::Solved);
                }
            };
            after_clicks(app, change.into_configs());
        }),
        DefectKind::rules("dead-menu", "the menu's button does nothing", 3, |app, variant| {
            let change = move |puzzle: Res<Puzzle>, mut next: ResMut<NextState<Screen>>| {
                let is_dead = [true, puzzle.0 % 2 == 1, puzzle.0 % 3 == 2][place(variant)];
                if is_dead && matches!(*next, NextState::Pending(Screen::Playing)) {
                    next.reset();
                }
            };
            app.add_systems(PostUpdate, change.run_if(in_state(Screen::Menu)));
        }),
    ]
}

#[cfg(test)]
mod tests {
    use playbot::harness::foreign::{LevelSeed, Restart};
    use playbot::prelude::{EpisodeEnd, PointerPosition};

    use super::*;
    use crate::game;

    /// Returns the game with clicks on Start and on cells, and a bot that solves it.
    fn game() -> ForeignGame {
        let middle = |at: usize| (at as f32 + 0.5) / SIDE as f32;
        let cells = (0..CELLS).map(|cell| Some(PointerPosition::fraction(middle(cell % SIDE), middle(cell / SIDE))));
        ForeignGame::new("slide", 1, game::game)
            .cursor([None].into_iter().chain(cells))
            .mouse_buttons([vec![]].into_iter().chain((0..CELLS).map(|_| vec![MouseButton::Left])))
            .clicks(["Start"])
            .observe(["cell 0"], |board: Res<Board>| [f32::from(board.0[0])])
            .state_hash(|board: Res<Board>| board.0.iter().fold(0, |hash, tile| hash * 9 + u64::from(*tile)))
            .end(|screen: Res<State<Screen>>| (**screen == Screen::Solved).then_some(EpisodeEnd::WON))
            .time_limit(120)
            .restart(Restart::Startup)
            .level(|seed: Res<LevelSeed>, mut commands: Commands, mut next: ResMut<NextState<Screen>>| {
                commands.insert_resource(Puzzle(seed.0));
                commands.insert_resource(Board::default());
                next.set(Screen::Menu);
            })
            .demonstrator("solver", |board: Res<Board>, screen: Res<State<Screen>>| match **screen {
                Screen::Menu => 1 + CELLS as u32,
                _ => board.hint(8).map_or(0, |cell| 1 + cell as u32),
            })
    }

    playbot_shell::planted_defects!(game: game(), levels: "default:0..11");
    playbot_shell::defects_by_recording!(game: add_to(game()), levels: "default:0..5", quiet: []);
}
