//! Tests of puffs behind enemies.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_games::coinrun::{
    Body,
    components::{ArenaBody, Enemy, PlayerBody},
};

use super::arena::{NOTHING, drawn, play, press, sprite, update_picture};

/// Returns the sprites behind the only enemy, each with depth, left and right end, lower and upper end; and the enemy.
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

/// Returns the ends of the visible puffs that were left at these positions, the newest first.
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
        update_picture(world);
        let (seen, enemy) = puffs(world);
        update_picture(world);
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
    // Far away there are none, and all at once when an enemy comes near again.
    for (away, near) in [(30.0, false), (-8.0, true)] {
        hover(world, agent, away);
        update_picture(world);
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
