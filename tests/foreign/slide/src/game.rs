//! Slide: eight tiles and a gap. A click on a tile beside the gap moves it there, until all are in their order.
//!
//! Every puzzle is mixed from its number. A menu comes first, and Start begins.

use bevy::{prelude::*, window::PrimaryWindow};
use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Cells in a row and in a column.
pub const SIDE: usize = 3;

/// Number of cells.
pub const CELLS: usize = SIDE * SIDE;

/// Width of a cell in the picture.
const WIDTH: f32 = 120.0;

#[derive(States, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Screen {
    #[default]
    Menu,
    Playing,
    Solved,
}

/// The number of the present puzzle, or of the next one.
#[derive(Resource, Default)]
pub struct Puzzle(pub u64);

/// The tile in each cell, row by row from the top left. 0 is the gap.
#[derive(Resource, Clone, PartialEq, Eq, Debug)]
pub struct Board(pub [u8; CELLS]);

impl Default for Board {
    /// All tiles are in order, and the gap is the last cell.
    fn default() -> Self {
        Self([1, 2, 3, 4, 5, 6, 7, 8, 0])
    }
}

impl Board {
    fn gap(&self) -> usize {
        self.0.iter().position(|&tile| tile == 0).unwrap_or_default()
    }

    /// Returns true if a tile is in this cell that can move into the gap.
    pub fn can_move(&self, cell: usize) -> bool {
        let (gap, at) = (self.gap(), |cell: usize| [cell % SIDE, cell / SIDE]);
        let [[x, y], [gap_x, gap_y]] = [at(cell), at(gap)];
        x.abs_diff(gap_x) + y.abs_diff(gap_y) == 1
    }

    /// Moves the tile in a cell into the gap, if it can.
    pub fn slide(&mut self, cell: usize) {
        if self.can_move(cell) {
            let gap = self.gap();
            self.0.swap(cell, gap);
        }
    }

    pub fn is_solved(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the cell to click on, on a shortest way to the order; `None` if there is none of at most `moves`.
    pub fn hint(&self, moves: usize) -> Option<usize> {
        (0..=moves).find_map(|moves| self.first_move(moves))
    }

    fn first_move(&self, moves: usize) -> Option<usize> {
        let moved = |cell| {
            let mut board = self.clone();
            board.slide(cell);
            board
        };
        let leads_there = |&cell: &usize| {
            let board = moved(cell);
            board.is_solved() || (moves > 1 && board.first_move(moves - 1).is_some())
        };
        (0..CELLS).filter(|&cell| moves > 0 && self.can_move(cell)).find(leads_there)
    }

    /// Mixes the tiles, with at least two moves.
    fn mixed(number: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let (mut board, mut last) = (Self::default(), CELLS);
        for _ in 0..rng.random_range(2..=7) {
            let gap = board.gap();
            let choices: Vec<usize> = (0..CELLS).filter(|&cell| cell != last && board.can_move(cell)).collect();
            board.slide(choices[rng.random_range(0..choices.len())]);
            last = gap;
        }
        board
    }
}

/// Shows the tile of a cell.
#[derive(Component)]
struct Cell(usize);

pub fn game(app: &mut App) {
    app.init_state::<Screen>()
        .init_resource::<Puzzle>()
        .init_resource::<Board>()
        .add_systems(Startup, |mut commands: Commands| {
            commands.spawn(Camera2d);
        })
        .add_systems(Update, (open_menu, start).chain().run_if(in_state(Screen::Menu)))
        .add_systems(OnExit(Screen::Menu), close_menu)
        .add_systems(OnEnter(Screen::Playing), lay_out)
        .add_systems(Update, (click, show).chain().run_if(in_state(Screen::Playing)));
}

fn open_menu(mut commands: Commands, buttons: Query<(), With<Button>>, cells: Query<Entity, With<Cell>>) {
    if !buttons.is_empty() {
        return;
    }
    cells.iter().for_each(|cell| commands.entity(cell).despawn());
    commands.spawn((
        Node { width: percent(100), height: percent(100), padding: UiRect::all(px(40)), ..default() },
        children![(Button, Node { width: px(240), height: px(80), ..default() }, children![Text::new("Start")])],
    ));
}

fn start(buttons: Query<&Interaction, (Changed<Interaction>, With<Button>)>, mut next: ResMut<NextState<Screen>>) {
    if buttons.iter().any(|interaction| *interaction == Interaction::Pressed) {
        next.set(Screen::Playing);
    }
}

fn close_menu(mut commands: Commands, roots: Query<Entity, (With<Node>, Without<ChildOf>)>) {
    roots.iter().for_each(|root| commands.entity(root).despawn());
}

fn lay_out(mut commands: Commands, puzzle: Res<Puzzle>, mut board: ResMut<Board>) {
    *board = Board::mixed(puzzle.0);
    for cell in 0..CELLS {
        let [column, row] = [cell % SIDE, cell / SIDE].map(|at| (at as f32 - 1.0) * WIDTH);
        commands.spawn((Cell(cell), Text2d::default(), Transform::from_xyz(column, -row, 0.0)));
    }
}

/// Slides the tile under the mouse. The board fills the window.
fn click(
    mouse: Res<ButtonInput<MouseButton>>,
    window: Single<&Window, With<PrimaryWindow>>,
    mut board: ResMut<Board>,
    mut next: ResMut<NextState<Screen>>,
) {
    let Some(at) = window.cursor_position().filter(|_| mouse.just_pressed(MouseButton::Left)) else { return };
    let [column, row] = [at.x / window.width(), at.y / window.height()].map(|share| (share * SIDE as f32) as usize);
    board.slide(row.min(SIDE - 1) * SIDE + column.min(SIDE - 1));
    if board.is_solved() {
        next.set(Screen::Solved);
    }
}

fn show(board: Res<Board>, mut cells: Query<(&Cell, &mut Text2d)>) {
    for (cell, mut text) in &mut cells {
        let tile = board.0[cell.0];
        text.0 = if tile == 0 { String::new() } else { tile.to_string() };
    }
}
