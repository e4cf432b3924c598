//! Defects that can be planted into CoinRun, to measure testers: see `playbot_mutation`.
//!
//! Defects of levels change the text of a level, which makes it broken by construction. Defects of rules are systems
//! around [`CoinRunSystems`] that change the data which the rules read and write.
//!
//! The folder, in reading order:
//!
//! - `walls`: levels with an unreachable coin, and defects of the player's motion.
//! - `hazards`: defects of hazards, and levels with missing ground or a trap.

mod hazards;
mod walls;

use crate::coinrun::{
    components::{Arena, PlayerBody, Tiles},
    defects::walls::column,
    level::{Level, LevelParts, Spawn},
    level_text,
    play::CoinRunSystems,
    rules::Body,
    tile::{SIZE, Tile},
};
use bevy::prelude::*;
use playbot_harness::defect::{DefectKind, PLACES, pick, variants};
use playbot_learner::rng::{ChaCha8Rng, below};

/// Returns the defects of the game, those of levels first.
pub(super) fn defects() -> Vec<DefectKind> {
    [
        walls::defects(),
        hazards::pit_defects(),
        walls::unreachable_defects(),
        hazards::trap_defects(),
        walls::motion_defects(),
        cell_defects(),
        hazards::defects(),
    ]
    .concat()
}

// Editing of a level in its text form.

/// Breaks the parts of a level; `None` if it has no suitable position.
type Break = fn(&mut LevelParts, &mut ChaCha8Rng) -> Option<()>;

/// Returns a defect of levels.
fn of_levels(class: &'static str, about: &'static str, change: Break) -> DefectKind {
    DefectKind::level(class, about, move |text: &str, rng: &mut ChaCha8Rng| changed(text, rng, change))
}

fn changed(text: &str, rng: &mut ChaCha8Rng, change: Break) -> Option<String> {
    let level = level_text::parse(text).ok()?.level::<Level>()?;
    let mut parts = level.parts().clone();
    change(&mut parts, rng)?;
    Some(serde_json::json!(Level::new(parts).to_level_text()).to_string())
}

/// Returns one of these columns, both ends included; `None` if there are none.
fn between(rng: &mut ChaCha8Rng, first: i32, last: i32) -> Option<i32> {
    let count = u64::try_from(last - first + 1).ok().filter(|&count| count > 0)?;
    Some(first + below(rng, count) as i32)
}

/// Returns the height of the ground of a column: the row of its lowest tile without ground.
fn surface(parts: &LevelParts, x: i32) -> i32 {
    (0..SIZE).find(|&y| !parts.tiles.get(x, y).is_wall()).unwrap_or(SIZE)
}

/// Returns the highest row for standing between the start and the coin, on ground or on crates.
fn summit(parts: &LevelParts) -> i32 {
    let is_wall = |x: i32, y: i32| parts.tiles.get(x, y).is_wall();
    let cells = (1..=parts.coin[0]).flat_map(|x| (0..SIZE - 1).map(move |y| (x, y)));
    let ground = cells.filter(|&(x, y)| is_wall(x, y) && !is_wall(x, y + 1)).map(|(_, y)| y + 1);
    let crates = parts.spawns.iter().filter_map(|spawn| match *spawn {
        Spawn::Crate { cell, .. } => Some(cell[1] + 1),
        _ => None,
    });
    ground.chain(crates).max().unwrap_or(1)
}

/// Fills a block of cells, the first of which is the one at the lower left, and removes their inhabitants.
fn fill(parts: &mut LevelParts, [left, low]: [i32; 2], [width, height]: [i32; 2], tile: Tile) {
    parts.tiles.fill(left, low, width, height, tile);
    parts.spawns.retain(|spawn| {
        let [x, y] = spawn.cell();
        !((left..left + width).contains(&x) && (low..low + height).contains(&y))
    });
}

/// Removes the ground of these columns. Lava lies at the bottom of the world, so standing there is impossible.
fn dig(parts: &mut LevelParts, left: i32, width: i32) {
    fill(parts, [left, 0], [width, SIZE - 1], Tile::Empty);
    fill(parts, [left, 0], [width, 1], Tile::LavaTop);
}

// Defects of cells that the rules see differently from the pictures and observations.

/// Height of an invisible wall, rows above the ground: as high as the level, and low enough for a jump.
const HEIGHTS: [i32; 2] = [SIZE, 4];

/// Columns of ground that do not hold.
const HOLES: [i32; 2] = [2, 4];

/// Speed along the path from which on a player runs, tiles per tick.
const RUNS: f32 = 0.3;

/// A cell and its tile in the rules.
type Cell = ([i32; 2], Tile);

fn cell_defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("invisible-wall", "an empty cell blocks players", variants(HEIGHTS.len()), |app, variant| {
            let height = pick(&HEIGHTS, variant);
            while_played(app, move |level, _| invisible_wall(level, column(level, variant), height));
        }),
        DefectKind::rules("missing-collider", "ground does not hold", variants(HOLES.len()), |app, variant| {
            let width = pick(&HOLES, variant);
            while_played(app, move |level, _| missing_ground(level, column(level, variant), width));
        }),
        // Its place is always the same, the coin: variants differ in the players that do not get it.
        DefectKind::rules("goal-does-not-end", "the coin can be touched and is not taken", PLACES, |app, variant| {
            while_played(app, move |level, player| {
                let is_missed = match variant {
                    0 => true,
                    1 => player.vy != 0.0,
                    _ => player.vx.abs() > RUNS,
                };
                is_missed.then_some((level.coin, Tile::Empty)).into_iter().collect()
            });
        }),
    ]
}

/// Changes cells of each level before a tick of the rules, depending on its player, and restores the drawn cells after
/// it.
fn while_played(app: &mut App, cells: impl Fn(&Level, &Body) -> Vec<Cell> + Send + Sync + 'static) {
    app.add_systems(
        FixedUpdate,
        (
            (move |mut arenas: Query<(&Arena, &mut Tiles)>, players: Query<&PlayerBody>| {
                for (arena, mut tiles) in &mut arenas {
                    let Ok(player) = players.get(arena.player) else { continue };
                    for ([x, y], tile) in cells(&arena.level, &player.0) {
                        tiles.bypass_change_detection().0.set(x, y, tile);
                    }
                }
            })
            .before(CoinRunSystems),
            restore.after(CoinRunSystems),
        ),
    );
}

fn restore(mut arenas: Query<(&Arena, &mut Tiles)>) {
    for (arena, mut tiles) in &mut arenas {
        tiles.bypass_change_detection().0 = arena.level.tiles.clone();
    }
}

fn invisible_wall(level: &Level, x: i32, height: i32) -> Vec<Cell> {
    let low = surface(level, x);
    let free = (low..SIZE).filter(|&y| matches!(level.tiles.get(x, y), Tile::Empty | Tile::Barrier));
    free.take(height as usize).map(|y| ([x, y], Tile::Wall)).collect()
}

fn missing_ground(level: &Level, left: i32, width: i32) -> Vec<Cell> {
    // Pits hold no player anyway.
    let is_ground = |x: &i32| surface(level, *x) > 0 && !level.tiles.get(*x, surface(level, *x)).is_lava();
    let columns = (left..level.coin[0]).filter(is_ground).take(width as usize);
    columns.flat_map(|x| (0..surface(level, x)).map(move |y| ([x, y], Tile::Empty))).collect()
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, sync::Arc};

    use bevy::prelude::*;
    use bevy_playbot::test_app::PlaybotTestExt;
    use playbot_harness::{
        defect::{ChangeLevel, ChangeRules, Plant},
        prelude::*,
    };
    use playbot_learner::rng::{ChaCha8Rng, Streams};

    use super::*;
    use crate::coinrun::{
        CoinRun, Mode, Plan, PlannerConfig, Sim, generator::generate, level::Level, level_text, planner::plan,
        proof::prove, spawn_agent,
    };

    fn rng(seed: u64) -> ChaCha8Rng {
        Streams::new(seed).stream("defects of coinrun", 0)
    }

    fn text(seed: u32) -> String {
        serde_json::json!(generate(Mode::Hard, seed).to_level_text()).to_string()
    }

    fn of_levels() -> Vec<(&'static str, Arc<ChangeLevel>)> {
        let kinds = defects().into_iter();
        let levels = kinds.filter_map(|kind| match kind.plant {
            Plant::Level(change) => Some((kind.class, change)),
            Plant::Rules { .. } => None,
        });
        levels.collect()
    }

    fn of_rules() -> Vec<(&'static str, u32, Arc<ChangeRules>)> {
        let kinds = defects().into_iter();
        let rules = kinds.filter_map(|kind| match kind.plant {
            Plant::Rules { variants, plant } => Some((kind.class, variants, plant)),
            Plant::Level(_) => None,
        });
        rules.collect()
    }

    /// Returns the game in an app, with one agent that runs and hops in this level.
    fn app(level: u64, plant: Option<(&ChangeRules, u32)>) -> App {
        let mut app = bevy_playbot::test_app::test_app();
        CoinRun::default().build(&mut app, "hard");
        if let Some((plant, variant)) = plant {
            plant(&mut app, variant);
        }
        let agent = spawn_agent(app.world_mut(), 0);
        let bot = BlindBot::Constant(ActionValue::Discrete(8));
        app.world_mut().entity_mut(agent).insert((Control::Bot, bot, LevelQueue::Always(level)));
        app
    }

    #[test]
    fn classes_are_different_and_rules_have_variants() {
        let classes: BTreeSet<_> = defects().iter().map(|kind| kind.class).collect();
        assert_eq!(classes.len(), defects().len());
        assert!(classes.len() >= 15, "{classes:?}");
        assert!(of_rules().iter().all(|(_, variants, _)| *variants >= 3));
    }

    #[test]
    fn every_defect_of_levels_is_planted_into_some_and_each_reads_back() {
        for (class, change) in of_levels() {
            let mut planted = 0;
            for seed in 0..40 {
                let sound = text(seed);
                let Some(broken) = change(&sound, &mut rng(seed.into())) else { continue };
                planted += 1;
                let design =
                    level_text::parse(&broken).unwrap_or_else(|error| panic!("{class} {seed}: {}", error.what));
                assert_ne!(design.hash(), level_text::parse(&sound).expect("it was printed").hash(), "{class} {seed}");
                assert_eq!(change(&sound, &mut rng(seed.into())), Some(broken), "{class} {seed}: the same again");
            }
            assert!(planted >= 5, "{class}: {planted} of 40");
        }
    }

    #[test]
    fn walls_and_coins_in_the_sky_are_proved_to_be_out_of_reach() {
        for (class, change) in of_levels() {
            if !["walled-goal", "sealed-start", "goal-in-the-sky"].contains(&class) {
                continue;
            }
            for seed in 0..40 {
                let Some(broken) = change(&text(seed), &mut rng(seed.into())) else { continue };
                let level = level_text::parse(&broken).expect("it reads back").level::<Level>().expect("a level");
                assert!(prove(level).why_unsolvable().is_some(), "{class} {seed}");
            }
        }
    }

    #[test]
    fn no_plan_leads_across_what_is_too_wide_or_deadly() {
        for (class, change) in of_levels() {
            if !["wide-pit", "missing-floor", "hazard-wall"].contains(&class) {
                continue;
            }
            for seed in 0..12 {
                let Some(broken) = change(&text(seed), &mut rng(seed.into())) else { continue };
                let level = level_text::parse(&broken).expect("it reads back").level::<Level>().expect("a level");
                let found = plan(&Sim::new(level), &PlannerConfig::default());
                assert!(!matches!(found, Plan::Found(_)), "{class} {seed}: {found:?}");
            }
        }
    }

    #[test]
    fn without_a_defect_nothing_changes_and_every_variant_is_built_without_ambiguous_orders() {
        let sound = app(0, None).hash_trace(30).expect("sound");
        assert_eq!(sound, app(0, None).hash_trace(30).expect("sound"));
        for (class, variants, plant) in of_rules() {
            for variant in 0..variants {
                let mut app = app(0, Some((&*plant, variant)));
                app.hash_trace(30).unwrap_or_else(|error| panic!("{class} {variant}: {error}"));
                assert_eq!(app.ambiguous_orders(&["playbot_games"]), [""; 0], "{class} {variant}");
            }
        }
    }

    #[test]
    fn every_defect_of_the_rules_changes_some_episode() {
        for (class, variants, plant) in of_rules() {
            for variant in 0..variants {
                let differs = |level: u64| {
                    let sound = app(level, None).hash_trace(250).expect("sound");
                    app(level, Some((&*plant, variant))).hash_trace(250).ok() != Some(sound)
                };
                assert!((0..60).any(differs), "{class} {variant}");
            }
        }
    }

    #[test]
    fn what_is_changed_lies_between_start_and_coin_and_is_another_tile() {
        for seed in 0..50 {
            let level = generate(Mode::Hard, seed);
            for variant in 0..6 {
                let x = column(&level, variant);
                let wall = invisible_wall(&level, x, pick(&HEIGHTS, variant));
                let holes = missing_ground(&level, x, pick(&HOLES, variant));
                assert!(!wall.is_empty() && !holes.is_empty(), "{seed} {variant}");
                assert!(wall.iter().all(|([x, y], tile)| level.tiles.get(*x, *y) != *tile), "{seed} {variant}");
                assert!(holes.iter().all(|([x, y], _)| level.tiles.get(*x, *y).is_wall()), "{seed} {variant}");
                let columns = wall.iter().chain(&holes).map(|([x, _], _)| *x);
                assert!(columns.min() >= Some(4), "{seed} {variant}");
            }
        }
    }
}
