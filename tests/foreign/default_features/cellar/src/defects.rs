//! Defects that the benchmark of testers plants into the game. Playing and testing it needs none of them.

use bevy::{app::RunFixedMainLoopSystems::BeforeFixedMainLoop, prelude::*};
use bevy_ecs_ldtk::prelude::GridCoords;
use playbot::harness::{
    defect::{DefectKind, place},
    foreign::ForeignGame,
};

use crate::game::{Cell, Room, Screen, WAYS, Walker};

/// Rooms have 11 × 9 cells. Their outer cells are walls.
const INNER: IRect = IRect { min: IVec2::ONE, max: IVec2::new(9, 7) };

/// The walk since the room was entered.
#[derive(Resource, Default)]
struct Walk {
    start: IVec2,
    at: IVec2,
    steps: u32,
}

/// Cells that the step of this frame takes for others, with their content.
#[derive(Resource, Default)]
struct Mistaken(Vec<(IVec2, Cell)>);

/// Adds the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    kinds().into_iter().fold(game, ForeignGame::defect)
}

/// Counts the steps in a room.
fn count_steps(app: &mut App) {
    app.init_resource::<Walk>()
        .add_systems(OnEnter(Screen::Walking), |room: Res<Room>, mut walk: ResMut<Walk>| {
            *walk = Walk { start: room.at, at: room.at, steps: 0 };
        })
        .add_systems(PostUpdate, count.run_if(in_state(Screen::Walking)));
}

fn count(room: Res<Room>, mut walk: ResMut<Walk>) {
    walk.steps += u32::from(walk.at != room.at);
    walk.at = room.at;
}

/// Makes steps take cells beside the walker for others. Agents see the room as it is: the mistake is over when they look.
fn mistake(app: &mut App, taken_for: impl Fn(&Room, &Walk, IVec2) -> Option<Cell> + Send + Sync + 'static) {
    count_steps(app);
    let begin = move |walk: Res<Walk>, mut room: ResMut<Room>, mut mistaken: ResMut<Mistaken>| {
        for to in WAYS.map(|(_, way)| room.at + way) {
            if let Some(other) = taken_for(&room, &walk, to) {
                mistaken.0.push((to, room.cell(to)));
                room.put(to, other);
            }
        }
    };
    let end = |mut room: ResMut<Room>, mut mistaken: ResMut<Mistaken>| {
        mistaken.0.drain(..).for_each(|(at, cell)| room.put(at, cell));
    };
    app.init_resource::<Mistaken>()
        .add_systems(RunFixedMainLoop, begin.in_set(BeforeFixedMainLoop).run_if(in_state(Screen::Walking)))
        .add_systems(PostUpdate, end);
}

/// Returns whether the step to this cell is one of those with the defect: all, those up and down, or those to the sides.
fn is_wrong(room: &Room, to: IVec2, variant: u32) -> bool {
    [true, to.x == room.at.x, to.y == room.at.y][place(variant)]
}

fn kinds() -> [DefectKind; 10] {
    [
        DefectKind::rules("invisible-wall", "an empty cell blocks players", 3, |app, variant| {
            let wall = [IVec2::new(5, 4), IVec2::new(4, 1), IVec2::new(8, 2)][place(variant)];
            mistake(app, move |room, _, to| (to == wall && room.cell(to) == Cell::Floor).then_some(Cell::Wall));
        }),
        DefectKind::rules("missing-collider", "walls do not block players", 3, |app, variant| {
            let is_open = move |to: IVec2| [true, (to.x + to.y) % 2 == 0, to.x > 5][place(variant)];
            mistake(app, move |room, _, to| {
                (INNER.contains(to) && room.cell(to) == Cell::Wall && is_open(to)).then_some(Cell::Floor)
            });
        }),
        DefectKind::rules("sudden-loss", "the walk is lost in an empty cell", 3, |app, variant| {
            let pit = [IVec2::new(1, 4), IVec2::new(9, 4), IVec2::new(5, 7)][place(variant)];
            mistake(app, move |room, _, to| (to == pit && room.cell(to) == Cell::Floor).then_some(Cell::Pit));
        }),
        DefectKind::rules("sticky-ground", "the walker stays where it is in one cell", 3, |app, variant| {
            let sticky = [IVec2::new(5, 4), IVec2::new(7, 1), IVec2::new(9, 6)][place(variant)];
            mistake(app, move |room, _, _| (room.at == sticky).then_some(Cell::Wall));
        }),
        DefectKind::rules("tired-legs", "the walker no longer walks after some steps", 3, |app, variant| {
            let last = [4, 8, 16][place(variant)];
            mistake(app, move |_, walk, _| (walk.steps >= last).then_some(Cell::Wall));
        }),
        DefectKind::rules("set-back", "the walker is back at the start after some steps", 3, |app, variant| {
            let last = [9, 6, 3][place(variant)];
            let change = move |mut room: ResMut<Room>,
                               mut walk: ResMut<Walk>,
                               mut walker: Single<&mut GridCoords, With<Walker>>| {
                if walk.steps >= last && room.cell(room.at) == Cell::Floor {
                    (walk.at, walk.steps) = (walk.start, 0);
                    room.at = walk.start;
                    **walker = walk.start.into();
                }
            };
            count_steps(app);
            app.add_systems(PostUpdate, change.after(count).run_if(in_state(Screen::Walking)));
        }),
        DefectKind::rules("stuck-key", "keys cannot be picked up", 3, |app, variant| {
            let is_stuck = move |to: IVec2| [true, to.y > 4, to.y < 4][place(variant)];
            mistake(app, move |room, _, to| (room.cell(to) == Cell::Key && is_stuck(to)).then_some(Cell::Floor));
        }),
        DefectKind::rules("locked-door", "keys do not open doors", 3, |app, variant| {
            mistake(app, move |room, _, to| {
                (room.cell(to) == Cell::Door && is_wrong(room, to, variant)).then_some(Cell::Wall)
            });
        }),
        DefectKind::rules("goal-does-not-end", "the exit can be reached and the walk goes on", 3, |app, variant| {
            mistake(app, move |room, _, to| {
                (room.cell(to) == Cell::Exit && is_wrong(room, to, variant)).then_some(Cell::Floor)
            });
        }),
        DefectKind::rules("goal-far-away", "the room is left before the exit", 3, |app, variant| {
            let far = [5, 7, 6][place(variant)];
            mistake(app, move |room, _, to| {
                let is_near = (room.exit - to).abs().element_sum() <= far;
                (room.cell(to) == Cell::Floor && is_near).then_some(Cell::Exit)
            });
        }),
    ]
}

#[cfg(test)]
mod tests {
    use bevy_ecs_ldtk::prelude::LevelSelection;
    use playbot::harness::foreign::{EditorLevel, MapLegend};
    use playbot::prelude::EpisodeEnd;

    use super::*;
    use crate::{ASSETS, game};

    /// Returns the game with the guide, as in `src/main.rs`, and with smaller observations.
    fn game() -> ForeignGame {
        let legend = MapLegend::default().walls(["wall"]).hazards(["pit"]).start("Walker").goal("Exit").in_cells();
        ForeignGame::new("cellar", 1, game::game)
            .default_plugins(|plugins| plugins.set(AssetPlugin { file_path: ASSETS.to_owned(), ..default() }))
            .ldtk(format!("{ASSETS}/cellar.ldtk"), legend)
            .level(
                |level: Res<EditorLevel>, mut chosen: ResMut<LevelSelection>, mut next: ResMut<NextState<Screen>>| {
                    *chosen = LevelSelection::Identifier(level.name.clone());
                    next.set(Screen::Loading);
                },
            )
            .ready(in_state(Screen::Walking))
            .keys([vec![]].into_iter().chain(WAYS.map(|(key, _)| vec![key])))
            .observe(["x", "y"], |room: Res<Room>| room.at.as_vec2().to_array())
            .end(|screen: Res<State<Screen>>| match **screen {
                Screen::Out => Some(EpisodeEnd::WON),
                Screen::Fallen => Some(EpisodeEnd::LOST),
                _ => None,
            })
            .time_limit(900)
            .demonstrator("guide", |room: Res<Room>| room.hint().map_or(0, |way| way + 1))
    }

    playbot_shell::planted_defects!(game: game(), levels: "default:0..11");
}
