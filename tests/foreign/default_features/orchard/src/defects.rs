//! Defects that the benchmark of testers plants into the game. Playing and testing it needs none of them.

use avian2d::prelude::*;
use bevy::prelude::*;
use foreign_orchard::{Hero, JUMP_SPEED, Level, Run, Screen};
use playbot::harness::{
    defect::{DefectKind, place},
    foreign::ForeignGame,
};

/// Columns at which a defect begins: at the start, further on and late.
const COLUMNS: [f32; 3] = [10.5, 20.5, 32.5];

/// Adds the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    kinds().into_iter().fold(game, ForeignGame::defect)
}

/// Returns whether a defect of levels is in this one: in all, in every second or in every third.
fn has(level: &Level, variant: u32) -> bool {
    level.number.is_multiple_of(u64::from(variant) + 1)
}

/// Takes a change to this screen back before it happens.
fn forbid(app: &mut App, screen: Screen, variant: u32) {
    app.add_systems(PostUpdate, move |level: Res<Level>, mut next: ResMut<NextState<Screen>>| {
        if has(&level, variant) && matches!(&*next, NextState::Pending(pending) if *pending == screen) {
            next.reset();
        }
    });
}

fn kinds() -> [DefectKind; 10] {
    [
        DefectKind::rules("invisible-wall", "an empty column blocks players", 3, |app, variant| {
            let column = COLUMNS[place(variant)];
            app.add_systems(OnEnter(Screen::Playing), move |mut commands: Commands| {
                let wall = (RigidBody::Static, Collider::rectangle(0.4, 60.0), Transform::from_xyz(column, 0.0, 0.0));
                commands.spawn((DespawnOnExit(Screen::Playing), wall));
            });
        }),
        DefectKind::rules("wrong-gravity", "the hero is too light or too heavy", 3, |app, variant| {
            let scale = [0.5, 1.6, 0.25][place(variant)];
            app.add_systems(PreUpdate, move |mut commands: Commands, heroes: Query<Entity, Added<Hero>>| {
                heroes.iter().for_each(|hero| _ = commands.entity(hero).insert(GravityScale(scale)));
            });
        }),
        DefectKind::rules("tired-legs", "the hero no longer jumps after some jumps", 3, |app, variant| {
            let last = [1, 3, 6][place(variant)];
            let tire = move |hero: Single<(Ref<Hero>, &mut LinearVelocity)>, mut jumps: Local<(u32, bool)>| {
                let (hero, mut velocity) = hero.into_inner();
                if hero.is_added() {
                    *jumps = (0, false);
                }
                let jumps_now = velocity.y > 0.8 * JUMP_SPEED;
                jumps.0 += u32::from(jumps_now && !jumps.1);
                jumps.1 = jumps_now;
                if jumps_now && jumps.0 > last {
                    velocity.y = 0.0;
                }
            };
            app.add_systems(FixedPreUpdate, tire.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("lost-fruit", "fruit that is picked is not counted", 3, |app, variant| {
            let most = [0, 2, 4][place(variant)];
            app.add_systems(PostUpdate, move |mut run: ResMut<Run>| run.fruit = run.fruit.min(most));
        }),
        DefectKind::rules("dead-gate", "the gate can be touched and the run goes on", 3, |app, variant| {
            forbid(app, Screen::Won, variant);
        }),
        DefectKind::rules("sudden-loss", "the run is lost in an empty column", 3, |app, variant| {
            let column = COLUMNS[place(variant)];
            let lose = move |at: Single<&Transform, With<Hero>>, mut next: ResMut<NextState<Screen>>| {
                if (column..column + 1.0).contains(&at.translation.x) {
                    next.set(Screen::Lost);
                }
            };
            app.add_systems(PostUpdate, lose.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("hole-in-the-ground", "the hero falls through the earth", 3, |app, variant| {
            let column = COLUMNS[place(variant)];
            let drop = move |mut commands: Commands, hero: Single<(Entity, &Transform), With<Hero>>| {
                if hero.1.translation.x > column {
                    commands.entity(hero.0).try_insert(CollisionLayers::NONE);
                }
            };
            app.add_systems(PreUpdate, drop.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("sticky-ground", "the hero stays where it is in one column", 3, |app, variant| {
            let column = COLUMNS[place(variant)];
            let stick = move |mut commands: Commands, hero: Single<(Entity, &Transform), With<Hero>>| {
                if (column..column + 1.0).contains(&hero.1.translation.x) {
                    commands.entity(hero.0).try_insert(LinearDamping(5000.0));
                }
            };
            app.add_systems(PreUpdate, stick.run_if(in_state(Screen::Playing)));
        }),
        DefectKind::rules("dead-menu", "the menu's button does nothing", 3, |app, variant| {
            forbid(app, Screen::Loading, variant);
        }),
        DefectKind::rules("endless-loading", "a level is loaded and never begins", 3, |app, variant| {
            forbid(app, Screen::Playing, variant);
            // The game builds the level in each frame then, and would fill the memory.
            let clear = |mut commands: Commands, built: Query<Entity, Or<(With<Sprite>, With<Collider>)>>| {
                built.iter().for_each(|entity| commands.entity(entity).despawn());
            };
            app.add_systems(First, clear.run_if(in_state(Screen::Loading)));
        }),
    ]
}

#[cfg(test)]
mod tests {
    use foreign_orchard::{ASSETS, Body, FEET, Map, game};
    use playbot::{harness::foreign::LevelSeed, prelude::EpisodeEnd};

    use super::*;

    /// Returns the game with the actions of its bot, which reaches the gate.
    fn orchard() -> ForeignGame {
        ForeignGame::new("orchard", 1, game)
            .hz(64.0)
            .default_plugins(|plugins| plugins.set(AssetPlugin { file_path: ASSETS.into(), ..default() }))
            .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::ArrowRight, KeyCode::Space]])
            .clicks(["Play"])
            .observe(["column"], |hero: Option<Single<Body>>| [hero.map_or(0.0, |hero| hero.0.translation.x)])
            .position(|at: Single<&Transform, With<Hero>>| at.translation.truncate())
            .reward_delta(|run: Res<Run>| run.fruit as f32)
            .end(|on: Res<State<Screen>>| {
                matches!(**on, Screen::Won | Screen::Lost)
                    .then(|| EpisodeEnd::Terminated { success: **on == Screen::Won })
            })
            .time_limit(1500)
            .level(|seed: Res<LevelSeed>, mut level: ResMut<Level>, mut next: ResMut<NextState<Screen>>| {
                level.number = seed.0;
                next.set(Screen::Menu);
            })
            .demonstrator("picker", |hero: Option<Single<Body>>, map: Res<Map>| {
                let Some((at, speed, hero)) = hero.map(Single::into_inner) else { return 3 };
                let (right, jump) = map.hint(at.translation.truncate() - Vec2::Y * FEET, speed.0, hero.coyote > 0.0);
                u32::from(right) + u32::from(jump)
            })
    }

    playbot_shell::defects_by_recording!(game: add_to(orchard()), levels: "default:0..2", quiet: ["lost-fruit"]);
}
