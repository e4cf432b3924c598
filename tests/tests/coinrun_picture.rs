//! CoinRun's picture: sprites and tiles follow the game, and nothing else changes.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
    sprite::Anchor,
};
use bevy_playbot::{
    headless::into_world,
    test_app::PlaybotTestExt,
    vision::{PaintedVelocity, Stage, TileLayer},
};
use playbot_games::coinrun::{
    Body, CoinRun, Mode, Tile,
    components::{ArenaBody, Coin, Crate, Enemy, InArena, PlayerBody, PlaysIn, Saw},
    generate,
    picture::{Art, Pose},
};
use playbot_lab::prelude::*;
use playbot_lab::worlds::build_world;

const RIGHT: u32 = 7;
const NOTHING: u32 = 4;
const JUMP: u32 = 5;
const LEFT: u32 = 1;

/// Drawn arenas, whose observing systems must not be in an ambiguous order.
fn drawn(mode: &str, agents: u32) -> (App, Vec<Entity>) {
    let mut app = headless_app();
    app.edit_schedule(ObserveSchedule, |schedule| {
        schedule.set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    });
    let game = CoinRun::default();
    game.build(&mut app, mode);
    game.build_picture(&mut app);
    let agents = (0..agents).map(|index| game.spawn_agent(app.world_mut(), index)).collect();
    (app, agents)
}

fn play(world: &mut World, agent: Entity, level: u64) {
    world.entity_mut(agent).insert((Control::Human, LevelQueue::Always(level)));
}

fn press(world: &mut World, agent: Entity, action: u32, ticks: u32) {
    for _ in 0..ticks {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(action)));
        world.tick().expect("sound");
    }
}

/// Brings the picture up to date with the state after the last tick.
fn look(world: &mut World) {
    world.run_schedule(ObserveSchedule);
}

fn sprite(world: &World, entity: Entity) -> &Sprite {
    world.get(entity).expect("dressed")
}

#[test]
fn what_is_drawn_is_where_the_game_says() {
    for (mode, levels) in [(Mode::Easy, 0..12), (Mode::Hard, 0..40)] {
        let (mut app, agents) = drawn(mode.name(), 1);
        let (world, agent) = (app.world_mut(), agents[0]);
        for level in levels {
            play(world, agent, level.into());
            world.get_mut::<Episode>(agent).expect("an agent").abandon();
            press(world, agent, RIGHT, 7);
            look(world);
            check_arena(world, agent, mode, level);
        }
    }
}

fn check_arena(world: &mut World, agent: Entity, mode: Mode, seed: u32) {
    let level = generate(mode, seed);
    let arena = world.get::<PlaysIn>(agent).expect("a player").0;
    assert!(world.get::<Stage>(arena).is_some());
    let mut depths = Vec::new();
    let mut bodies = world.query::<(Entity, &ArenaBody, Has<Coin>, Option<&Enemy>, &InArena)>();
    for (entity, body, is_coin, enemy, in_arena) in bodies.iter(world) {
        assert_eq!(in_arena.0, arena);
        assert_eq!(world.get::<Sprite>(entity).is_none(), is_coin, "the coin is a tile");
        let Some(at) = world.get::<Transform>(entity) else { continue };
        assert_eq!((at.translation.x, at.translation.y), (body.0.x, body.0.y), "{mode} {seed}");
        assert_eq!(world.get::<ChildOf>(entity).map(ChildOf::parent), Some(arena));
        assert_eq!(at.translation.z >= 1.0, enemy.is_some(), "enemies stand in front");
        if enemy.is_some() {
            assert_eq!(sprite(world, entity).flip_x, body.0.vx < 0.0);
        }
        depths.push(at.translation.z);
    }
    let sprites = depths.len();
    assert_eq!(sprites, level.spawns.len());
    let mut layers = world.query::<(&TileLayer, &Transform, &ChildOf)>();
    let (tiles, at, _) = layers.iter(world).find(|(.., of)| of.parent() == arena).expect("tiles");
    depths.push(at.translation.z);
    assert_eq!((tiles.columns, tiles.rows), (64, 64));
    for (x, y) in (-1..65).flat_map(|x| (-1..65).map(move |y| (x, y))) {
        let expected = Art::tile(level.tiles.get(x, y)).unwrap_or(TileLayer::EMPTY);
        assert_eq!(tiles.tile(x, y), expected, "{mode} {seed} ({x}, {y})");
    }
    assert_eq!(tiles.tile(-5, 3), Art::tile(Tile::Wall).expect("drawn"));
    depths.push(world.get::<Transform>(agent).expect("dressed").translation.z);
    depths.sort_by(f32::total_cmp);
    assert!(depths.windows(2).all(|pair| pair[0] < pair[1]), "nothing is as deep as something else");
}

#[test]
fn a_player_stands_walks_jumps_and_turns() {
    let (mut app, agents) = drawn("easy", 1);
    let (world, agent) = (app.world_mut(), agents[0]);
    // The first ground of easy level 0 begins at column 5: there is room to walk.
    play(world, agent, 0);
    let seen = |world: &mut World| {
        look(world);
        let sprite = sprite(world, agent);
        let poses = [Pose::Stand, Pose::Walk1, Pose::Walk2];
        let pose = poses.into_iter().find(|pose| sprite.rect == Some(Art::player(0, *pose)));
        (pose.expect("a player of the easy colour"), sprite.flip_x)
    };
    press(world, agent, NOTHING, 4);
    assert_eq!(seen(world), (Pose::Stand, false));
    let feet = |world: &World| {
        let (body, at) =
            (world.get::<PlayerBody>(agent).expect("a player").0, world.get::<Transform>(agent).expect("dressed"));
        let size = sprite(world, agent).custom_size.expect("set");
        assert_eq!((size.x, at.translation.x), (1.0, body.x));
        assert!((size.y - 1.7415 * 1.1574).abs() < 1e-4, "taller than the body");
        let anchor = world.get::<Anchor>(agent).expect("dressed").0;
        let feet = at.translation.y - (anchor.y + 0.5) * size.y;
        assert_eq!(at.translation.y, body.y, "the eye is on the middle of the body");
        assert!((feet - (body.y - body.ry)).abs() < 1e-5, "the feet are on the ground");
    };
    feet(world);
    press(world, agent, RIGHT, 2);
    assert_eq!(seen(world), (Pose::Walk2, false), "tick 6");
    let velocity = world.get::<PaintedVelocity>(agent).expect("dressed").0;
    assert!((velocity.x - 0.18 / 0.5).abs() < 1e-6 && velocity.y == 0.0, "{velocity}");
    press(world, agent, LEFT, 5);
    assert_eq!(seen(world), (Pose::Walk1, true), "tick 11 is in the first step again");
    press(world, agent, JUMP, 6);
    assert_eq!(seen(world), (Pose::Walk1, true), "tick 17 would be the second step, but in the air it is the first");
    feet(world);
}

#[test]
fn saws_turn_each_tick_and_enemies_step_every_five() {
    let (mut app, agents) = drawn("hard", 1);
    let (world, agent) = (app.world_mut(), agents[0]);
    // Hard level 5 has a saw and an enemy.
    play(world, agent, 5);
    let spawned = generate(Mode::Hard, 5);
    let mut saws = world.query_filtered::<&Sprite, With<Saw>>();
    let mut enemies = world.query::<(&Enemy, &Sprite)>();
    for tick in 0..12 {
        press(world, agent, NOTHING, 1);
        // Within the tick the picture was made before anything moved.
        for sprite in saws.iter(world) {
            assert_eq!(sprite.rect, Some(Art::saw(tick % 2)), "tick {tick}");
        }
        for (enemy, sprite) in enemies.iter(world) {
            assert_eq!(sprite.rect, Some(Art::enemy(enemy.sprite, tick / 5 % 2)), "tick {tick}");
        }
    }
    assert_eq!(saws.iter(world).len() + enemies.iter(world).len() + 4, spawned.spawns.len(), "and four crates");
}

/// The sprites behind the only enemy, each with depth, left and right end, lower and upper end; and the enemy.
fn puffs(world: &mut World) -> (Vec<[f32; 5]>, Body) {
    let mut enemies = world.query_filtered::<(&ArenaBody, &Transform, Option<&Children>), With<Enemy>>();
    let (body, at, children) = enemies.single(world).expect("one enemy");
    let mut seen = Vec::new();
    for &puff in children.into_iter().flatten() {
        let place = at.translation + world.get::<Transform>(puff).expect("a sprite").translation;
        let half = sprite(world, puff).custom_size.expect("set") / 2.0;
        seen.push([place.z, place.x - half.x, place.x + half.x, place.y - half.y, place.y + half.y]);
    }
    seen.sort_by(|one, other| other[0].total_cmp(&one[0]));
    (seen, body.0)
}

/// Puts the player high up, and this far to the right of the only enemy.
fn hover(world: &mut World, agent: Entity, away: f32) {
    let x = puffs(world).1.x + away;
    world.get_mut::<PlayerBody>(agent).expect("a player").0 = Body { x, y: 50.0, ..Body::player() };
}

/// Ends of what is seen of puffs that were left at these places, the newest first.
fn ends(path: &[f32]) -> [f32; 2] {
    let half = |age: usize| 0.3 * (0..age).fold(1.0f32, |growth, _| growth * 1.05);
    let puffs = || path.iter().take(8).enumerate();
    let left = puffs().map(|(age, x)| x - half(age)).fold(f32::INFINITY, f32::min);
    [left, puffs().map(|(age, x)| x + half(age)).fold(f32::NEG_INFINITY, f32::max)]
}

#[test]
fn enemies_leave_puffs_where_they_were() {
    let (mut app, agents) = drawn("hard", 1);
    let (world, agent) = (app.world_mut(), agents[0]);
    play(world, agent, 5);
    let (mut path, mut rows) = (Vec::new(), Vec::new());
    for tick in 0..60 {
        press(world, agent, NOTHING, 1);
        // Now those that the next tick begins with, however often they are looked at.
        hover(world, agent, -5.0);
        look(world);
        let (seen, enemy) = puffs(world);
        look(world);
        assert_eq!(puffs(world).0, seen);
        path.insert(0, enemy.x);
        let [left, right] = [1, 2].map(|end| seen.iter().map(move |puff| puff[end]));
        let reach = [left.fold(f32::INFINITY, f32::min), right.fold(f32::NEG_INFINITY, f32::max)];
        let expected = ends(&path);
        assert!((0..2).all(|end| (reach[end] - expected[end]).abs() < 1e-3), "{tick}: {reach:?}, not {expected:?}");
        for &[depth, _, _, low, high] in &seen {
            assert!(depth > 0.1 && depth < 1.0, "between saws and crates, and enemies");
            assert!(
                low > enemy.y - 0.5 && low < enemy.y - 0.4 && high > enemy.y && high < enemy.y + 0.2,
                "at its feet"
            );
        }
        rows.push(seen.len());
    }
    let turns = path.windows(3).filter(|last| (last[0] - last[1]) * (last[1] - last[2]) < 0.0).count();
    assert!(turns >= 2, "it walks to and fro: {turns}");
    assert!(rows.iter().filter(|&&rows| rows == 1).count() > 20 && rows.iter().all(|&rows| (1..=4).contains(&rows)));
    // Far away there are none, and all at once when one comes near again.
    for (away, near) in [(30.0, false), (-8.0, true)] {
        hover(world, agent, away);
        look(world);
        assert_eq!(!puffs(world).0.is_empty(), near);
    }
    // A new level begins without.
    world.get_mut::<Episode>(agent).expect("an agent").abandon();
    press(world, agent, NOTHING, 1);
    hover(world, agent, -5.0);
    press(world, agent, NOTHING, 1);
    let (seen, enemy) = puffs(world);
    assert!(seen.len() == 1 && (seen[0][2] - seen[0][1] - 0.6).abs() < 1e-4, "left in the first tick: {seen:?}");
    assert!((seen[0][1] + 0.3 - enemy.x).abs() < 0.2);
}

#[test]
fn levels_come_and_go_without_a_trace() {
    let (mut app, agents) = drawn("hard", 3);
    for &agent in &agents {
        let queue = LevelQueue::list((0..6).collect::<Vec<_>>());
        let run = BlindBot::Constant(ActionValue::Discrete(8));
        app.world_mut().entity_mut(agent).insert((Control::Bot, run, queue));
    }
    app.play_episodes(6, 20_000).expect("sound");
    let world = app.world_mut();
    let expected: usize = 3 * (generate(Mode::Hard, 5).spawns.len() + 2);
    let drawn = world.query_filtered::<(), (Or<(With<Sprite>, With<TileLayer>)>, Without<Agent>)>().iter(world).len();
    let puffs: usize = world.query_filtered::<&Children, With<Enemy>>().iter(world).map(|puffs| puffs.len()).sum();
    let drawn = drawn - puffs;
    assert_eq!(drawn, expected, "the bodies of the last level, a backdrop and tiles for each arena");
    let children: usize = world.query::<(&Stage, &Children)>().iter(world).map(|(_, children)| children.len()).sum();
    assert_eq!(children, expected + 3, "and the players");
    let mut stages = world.query_filtered::<&Transform, With<Stage>>();
    let places: Vec<_> = stages.iter(world).map(|at| at.translation).collect();
    let apart = |a: Vec3, b: Vec3| (a - b).abs().max_element() >= 64.0 + 14.0;
    assert!((0..3).all(|i| (0..i).all(|j| apart(places[i], places[j]))), "{places:?}");
    let arenas: Vec<_> = agents.iter().map(|&agent| world.get::<PlaysIn>(agent).expect("a player").0).collect();
    arenas.into_iter().for_each(|arena| assert!(world.despawn(arena)));
    let left = world.query_filtered::<(), With<Anchor>>().iter(world).len();
    assert_eq!(left, 0, "an arena takes everything with it");
}

#[test]
fn a_game_may_add_a_saw_and_move_a_crate() {
    let (mut app, agents) = drawn("easy", 1);
    let (world, agent) = (app.world_mut(), agents[0]);
    play(world, agent, 0);
    press(world, agent, NOTHING, 2);
    let arena = world.get::<PlaysIn>(agent).expect("a player").0;
    let saw = world.spawn((Saw, ArenaBody(Body::block([3, 1])), InArena(arena))).id();
    let moved = world.query_filtered::<Entity, With<Crate>>().iter(world).next().expect("easy level 0 has crates");
    world.entity_mut(moved).insert(ArenaBody(Body::block([4, 7])));
    press(world, agent, NOTHING, 1);
    assert_eq!(world.get::<Transform>(saw).expect("dressed").translation.truncate(), Vec2::new(3.5, 1.5));
    assert_eq!(world.get::<Transform>(moved).expect("dressed").translation.truncate(), Vec2::new(4.5, 7.5));
}

#[test]
fn a_game_plays_the_same_with_a_picture_and_without() {
    let run = |mut world: World, agent: Entity| -> Vec<u64> {
        world.insert_resource(bevy_playbot::policy::PlaybotSeed(3));
        let queue = LevelQueue::list((0..4).collect::<Vec<_>>());
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, queue));
        let mut hash = |_| {
            world.tick().expect("sound");
            world.get::<StateHash>(agent).expect("an agent").0
        };
        (0..300).map(&mut hash).collect()
    };
    let (app, agents) = drawn("hard", 1);
    let (plain, plain_agents) = build_world(&CoinRun::default(), "hard", 0, 0, 1);
    assert_eq!(run(into_world(app), agents[0]), run(plain, plain_agents[0]));
}
