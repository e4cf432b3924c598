//! Tests of sprites, which follow the game's positions.

use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::vision::{PaintedVelocity, Stage, TileLayer};
use playbot::prelude::*;
use playbot_games::coinrun::{
    Mode, Tile,
    components::{ArenaBody, Coin, Enemy, InArena, PlayerBody, PlaysIn, Saw},
    generator::generate,
    picture::{Art, Pose},
};

use super::arena::{JUMP, LEFT, NOTHING, RIGHT, drawn, play, press, sprite, update_picture};

#[test]
fn what_is_drawn_is_where_the_game_says() {
    for (mode, levels) in [(Mode::Easy, 0..12), (Mode::Hard, 0..40)] {
        let (mut app, agents) = drawn(mode.name(), 1);
        let (world, agent) = (app.world_mut(), agents[0]);
        for level in levels {
            play(world, agent, level.into());
            world.get_mut::<Episode>(agent).expect("an agent").abandon();
            press(world, agent, RIGHT, 7);
            update_picture(world);
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
    depths.push(world.get::<Transform>(agent).expect("drawn").translation.z);
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
        update_picture(world);
        let sprite = sprite(world, agent);
        let poses = [Pose::Stand, Pose::Walk1, Pose::Walk2];
        let pose = poses.into_iter().find(|pose| sprite.rect == Some(Art::player(0, *pose)));
        (pose.expect("a player of the easy colour"), sprite.flip_x)
    };
    press(world, agent, NOTHING, 4);
    assert_eq!(seen(world), (Pose::Stand, false));
    let feet = |world: &World| {
        let (body, at) =
            (world.get::<PlayerBody>(agent).expect("a player").0, world.get::<Transform>(agent).expect("drawn"));
        let size = sprite(world, agent).custom_size.expect("set");
        assert_eq!((size.x, at.translation.x), (1.0, body.x));
        assert!((size.y - 1.7415 * 1.1574).abs() < 1e-4, "taller than the body");
        let anchor = world.get::<Anchor>(agent).expect("drawn").0;
        let feet = at.translation.y - (anchor.y + 0.5) * size.y;
        assert_eq!(at.translation.y, body.y, "the view is on the middle of the body");
        assert!((feet - (body.y - body.ry)).abs() < 1e-5, "the feet are on the ground");
    };
    feet(world);
    press(world, agent, RIGHT, 2);
    assert_eq!(seen(world), (Pose::Walk2, false), "tick 6");
    let velocity = world.get::<PaintedVelocity>(agent).expect("drawn").0;
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
