//! Cellar: a walk through rooms that are drawn in LDtk, from the start to the exit. Walls and locked doors are in the way,
//! pits are deadly, and each key opens one door.

use std::collections::{HashMap, VecDeque, hash_map::Entry};

use bevy::prelude::*;
use bevy_ecs_ldtk::{prelude::*, utils::grid_coords_to_translation};

/// Side of a cell, pixels.
const SIDE: i32 = 16;

/// Seconds between two steps.
const REST: f32 = 0.1;

/// The directions of a step, by the keys for them.
pub const WAYS: [(KeyCode, IVec2); 4] = [
    (KeyCode::ArrowUp, IVec2::Y),
    (KeyCode::ArrowDown, IVec2::NEG_Y),
    (KeyCode::ArrowLeft, IVec2::NEG_X),
    (KeyCode::ArrowRight, IVec2::X),
];

#[derive(States, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Screen {
    #[default]
    Loading,
    Walking,
    Out,
    Fallen,
}

/// The content of a cell.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Cell {
    #[default]
    Floor,
    Wall,
    Pit,
    Key,
    Door,
    Exit,
}

/// The room, as far as it is left, with the walker in it.
#[derive(Resource, Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Room {
    cells: Vec<Vec<Cell>>,
    pub at: IVec2,
    pub exit: IVec2,
    pub keys: u32,
}

impl Room {
    /// Returns the content of a cell. All is wall around the room.
    pub fn cell(&self, at: IVec2) -> Cell {
        let row = usize::try_from(at.y).ok().and_then(|row| self.cells.get(row));
        let cell = row.and_then(|row| row.get(usize::try_from(at.x).ok()?));
        cell.copied().unwrap_or(Cell::Wall)
    }

    /// Returns the kinds of the cells around the walker, row by row from the lower left.
    pub fn around(&self) -> [u8; 25] {
        std::array::from_fn(|cell| self.cell(self.at + IVec2::new(cell as i32 % 5 - 2, cell as i32 / 5 - 2)) as u8)
    }

    /// Changes the content of a cell.
    pub fn put(&mut self, at: IVec2, cell: Cell) {
        let [column, row] = [at.x, at.y].map(|at| at.max(0) as usize);
        self.cells.resize(self.cells.len().max(row + 1), Vec::new());
        let cells = &mut self.cells[row];
        cells.resize(cells.len().max(column + 1), Cell::Floor);
        cells[column] = cell;
    }

    /// Takes a step, if nothing is in the way. Returns the content of the cell.
    pub fn step(&mut self, way: IVec2) -> Option<Cell> {
        let to = self.at + way;
        let cell = self.cell(to);
        match cell {
            Cell::Wall => return None,
            Cell::Door if self.keys == 0 => return None,
            Cell::Door => self.keys -= 1,
            Cell::Key => self.keys += 1,
            Cell::Floor | Cell::Pit | Cell::Exit => {}
        }
        if matches!(cell, Cell::Door | Cell::Key) {
            self.put(to, Cell::Floor);
        }
        self.at = to;
        Some(cell)
    }

    /// Returns the first direction of a shortest path to the exit, as an index of [`WAYS`].
    pub fn hint(&self) -> Option<usize> {
        let mut known = HashMap::from([(self.clone(), None)]);
        let mut open = VecDeque::from([self.clone()]);
        while let Some(room) = open.pop_front() {
            let first = known[&room];
            for (index, (_, way)) in WAYS.iter().enumerate() {
                let mut next = room.clone();
                match next.step(*way) {
                    None | Some(Cell::Pit) => continue,
                    Some(Cell::Exit) => return Some(first.unwrap_or(index)),
                    Some(_) => {}
                }
                if let Entry::Vacant(free) = known.entry(next.clone()) {
                    free.insert(Some(first.unwrap_or(index)));
                    open.push_back(next);
                }
            }
        }
        None
    }
}

/// The walker, with the seconds until the next step.
#[derive(Component, Default)]
pub struct Walker(f32);

/// A thing that can be taken, opened or reached.
#[derive(Component, Clone, Copy, Default)]
struct Thing(Cell);

impl From<&EntityInstance> for Thing {
    fn from(drawn: &EntityInstance) -> Self {
        Self(match drawn.identifier.as_str() {
            "Key" => Cell::Key,
            "Door" => Cell::Door,
            _ => Cell::Exit,
        })
    }
}

#[derive(Bundle, Default, LdtkEntity)]
struct WalkerBundle {
    walker: Walker,
    #[sprite_sheet]
    sprite: Sprite,
    #[grid_coords]
    at: GridCoords,
}

#[derive(Bundle, Default, LdtkEntity)]
struct ThingBundle {
    #[from_entity_instance]
    thing: Thing,
    #[sprite_sheet]
    sprite: Sprite,
    #[grid_coords]
    at: GridCoords,
}

pub fn game(app: &mut App) {
    app.add_plugins(LdtkPlugin)
        .insert_resource(LevelSelection::index(0))
        .init_state::<Screen>()
        .init_resource::<Room>()
        .register_ldtk_entity::<WalkerBundle>("Walker")
        .register_ldtk_entity::<ThingBundle>("Key")
        .register_ldtk_entity::<ThingBundle>("Door")
        .register_ldtk_entity::<ThingBundle>("Exit")
        .add_systems(Startup, open)
        .add_systems(Update, furnish.run_if(in_state(Screen::Loading)))
        .add_systems(Update, (walk, show).chain().run_if(in_state(Screen::Walking)));
}

fn open(mut commands: Commands, assets: Res<AssetServer>) {
    let projection = OrthographicProjection { scale: 0.25, ..OrthographicProjection::default_2d() };
    commands.spawn((Camera2d, Projection::Orthographic(projection), Transform::from_xyz(88.0, 72.0, 0.0)));
    commands.spawn(LdtkWorldBundle { ldtk_handle: assets.load("cellar.ldtk").into(), ..default() });
}

/// Notes the content of a room once it is there.
fn furnish(
    mut events: MessageReader<LevelEvent>,
    grid: Query<(&GridCoords, &IntGridCell)>,
    things: Query<(&GridCoords, &Thing)>,
    walker: Option<Single<&GridCoords, With<Walker>>>,
    mut room: ResMut<Room>,
    mut next: ResMut<NextState<Screen>>,
) {
    let is_there = events.read().filter(|event| matches!(event, LevelEvent::Transformed(_))).count() > 0;
    let Some(walker) = walker.filter(|_| is_there) else { return };
    *room = Room { at: (**walker).into(), ..default() };
    for (at, cell) in &grid {
        room.put((*at).into(), if cell.value == 1 { Cell::Wall } else { Cell::Pit });
    }
    for (at, thing) in &things {
        room.put((*at).into(), thing.0);
        if thing.0 == Cell::Exit {
            room.exit = (*at).into();
        }
    }
    next.set(Screen::Walking);
}

/// Keys and doors, without the walker.
type Things = (With<Thing>, Without<Walker>);

fn walk(
    (time, keys): (Res<Time>, Res<ButtonInput<KeyCode>>),
    walker: Single<(&mut GridCoords, &mut Walker)>,
    things: Query<(Entity, &GridCoords), Things>,
    mut room: ResMut<Room>,
    mut next: ResMut<NextState<Screen>>,
    mut commands: Commands,
) {
    let (mut at, mut walker) = walker.into_inner();
    walker.0 -= time.delta_secs();
    let Some((_, way)) = WAYS.iter().find(|(key, _)| keys.pressed(*key)).filter(|_| walker.0 <= 0.0) else { return };
    let Some(cell) = room.step(*way) else { return };
    walker.0 = REST;
    *at = room.at.into();
    match cell {
        Cell::Exit => next.set(Screen::Out),
        Cell::Pit => next.set(Screen::Fallen),
        Cell::Key | Cell::Door => {
            let found = things.iter().filter(|(_, there)| IVec2::from(**there) == room.at);
            found.for_each(|(thing, _)| commands.entity(thing).despawn());
        }
        Cell::Floor | Cell::Wall => {}
    }
}

/// The walker after a step.
type HasStepped = (With<Walker>, Changed<GridCoords>);

fn show(mut walkers: Query<(&mut Transform, &GridCoords), HasStepped>) {
    for (mut transform, at) in &mut walkers {
        transform.translation = grid_coords_to_translation(*at, IVec2::splat(SIDE)).extend(transform.translation.z);
    }
}
