//! The paths without short cuts, step by step by the rules: the reference of the fast ones, which must equal it to the
//! bit.

use crate::coinrun::{
    Level, Mode, Sim, Tile, TileGrid,
    generator::generate,
    paths::{HELD, STEPS, Surroundings, VALUES},
    rules::{ACTIONS, Body, CoinRunEnd, PlayerState, begin_step, is_supported, motion::touch, move_player},
    tile::REACH,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// An arena at one moment.
struct Scene {
    tiles: TileGrid,
    player: Body,
    memory: PlayerState,
    crates: Vec<Body>,
    saws: Vec<Body>,
    enemies: Vec<Body>,
}

impl Scene {
    fn near(&self, bodies: &[Body]) -> Vec<Body> {
        bodies.iter().filter(|body| (body.x - self.player.x).abs() < 10.0).copied().collect()
    }

    fn plain(&self, action: u8) -> [f32; VALUES] {
        let (crates, saws, mut enemies) = (self.near(&self.crates), self.near(&self.saws), self.near(&self.enemies));
        let (start, mut player, mut memory) = (self.player, self.player, self.memory);
        let (mut end, mut steps, mut flew, mut lands) = (None, 0, false, false);
        let half_view = REACH as f32 + 0.5;
        let in_view = |player: &Body| (player.x - start.x).abs().max((player.y - start.y).abs()) < half_view;
        while steps < STEPS && end.is_none() && !lands && in_view(&player) {
            let step = begin_step(&mut player, &mut memory, &self.tiles, action);
            for enemy in &mut enemies {
                enemy.x += enemy.vx;
            }
            move_player(&mut player, &mut memory, &self.tiles, &crates, &step, true);
            steps += 1;
            end = touch(&player, &self.tiles, saws.iter(), enemies.iter(), steps);
            let supported = is_supported(&player, &memory, &self.tiles);
            lands = flew && supported;
            flew |= !supported && player.vy.abs() > 0.5;
        }
        let flag = |is: bool| f32::from(u8::from(is));
        [
            flag(end.is_some_and(|end| end != CoinRunEnd::Coin)),
            flag(end == Some(CoinRunEnd::Coin)),
            flag(lands),
            steps as f32 / STEPS as f32,
            (player.x - start.x) / half_view,
            (player.y - start.y) / half_view,
        ]
    }

    /// Compares all paths, and counts how many end with death, with the coin, on the ground and otherwise.
    fn compare(&self, surroundings: &mut Surroundings, ends: &mut [u32; 4]) {
        let mut quick = [f32::NAN; HELD.len() * VALUES];
        let Self { tiles, player, memory, crates, saws, enemies } = self;
        surroundings.follow(player, memory, tiles, crates, saws, enemies, &mut quick);
        for (quick, action) in quick.chunks_exact(VALUES).zip(HELD) {
            let plain = self.plain(action);
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(quick), bits(&plain), "{action}: {quick:?}, not {plain:?}, for {player:?}, {memory:?}");
            ends[plain[..3].iter().position(|&flag| flag == 1.0).unwrap_or(3)] += 1;
        }
    }
}

/// Returns the scene at the present state of an episode.
fn scene(sim: &Sim) -> Scene {
    let level = sim.level();
    Scene {
        tiles: level.tiles.clone(),
        player: *sim.player(),
        memory: sim.player_state(),
        crates: level.spawns.iter().filter_map(|spawn| spawn.solid_crate()).collect(),
        saws: level.spawns.iter().filter_map(|spawn| spawn.saw()).collect(),
        enemies: sim.enemies().to_vec(),
    }
}

fn level(draw: &mut ChaCha8Rng) -> Level {
    let mode = if draw.random_bool(0.2) { Mode::Easy } else { Mode::Hard };
    generate(mode, draw.random_range(0..10_000))
}

#[test]
fn paths_of_played_episodes_are_those_of_the_rules() {
    let mut draw = ChaCha8Rng::seed_from_u64(1);
    let (mut surroundings, mut ends) = (Surroundings::default(), [0; 4]);
    for _ in 0..120 {
        let mut sim = Sim::new(level(&mut draw).into());
        let mut action = 8;
        for step in 0..200 {
            scene(&sim).compare(&mut surroundings, &mut ends);
            if step % 5 == 0 {
                action = if draw.random_bool(0.6) { 8 } else { draw.random_range(0..ACTIONS) };
            }
            if sim.step(action).end.is_some() {
                break;
            }
        }
    }
    assert!(ends.iter().all(|&count| count > 100), "every end occurs: {ends:?}");
}

/// Returns a number, often one at which bodies come to rest, or next to it.
fn coordinate(draw: &mut ChaCha8Rng, range: [f32; 2], half: f32) -> f32 {
    let value: f32 = draw.random_range(range[0]..range[1]);
    match draw.random_range(0..8) {
        0 => value.floor() + half,
        1 => value.floor() - half,
        2 => (value.floor() + half).next_up(),
        3 => (value.floor() + half).next_down(),
        4 => value.floor() + 0.5,
        5 => value.floor() - half * 0.98,
        _ => value,
    }
}

fn speed(draw: &mut ChaCha8Rng, typical: f32) -> f32 {
    match draw.random_range(0..6) {
        0 => 0.0,
        1 => -0.0,
        2 => draw.random_range(-3.0..3.0) * typical,
        3 => typical * if draw.random_bool(0.5) { 1.0 } else { -1.0 },
        _ => draw.random_range(-1.0..1.0) * typical,
    }
}

/// Returns bodies around a position, some as large as tiles and some not.
fn bodies(draw: &mut ChaCha8Rng, player: &Body) -> Vec<Body> {
    let count = draw.random_range(0..6);
    let one = |_| {
        let (x, y) = (player.x + draw.random_range(-11.0..11.0), player.y + draw.random_range(-5.0..5.0));
        let typical = Body::enemy([x.floor() as i32, y.floor() as i32], draw.random_range(-1..=1));
        let odd = Body { x, y, vx: draw.random_range(-0.4..0.4), rx: draw.random_range(0.2..1.5), ..typical };
        if draw.random_bool(0.7) { typical } else { odd }
    };
    (0..count).map(one).collect()
}

/// Returns a level, some of it replaced at random, and a player anywhere in it: in walls, on edges, outside.
fn odd_scene(draw: &mut ChaCha8Rng, level: &Level) -> Scene {
    let mut tiles = level.tiles.clone();
    let is_default = draw.random_bool(0.8);
    let mut player = Body::player();
    if !is_default {
        (player.rx, player.ry) = (draw.random_range(0.1..1.6), draw.random_range(0.1..2.1));
    }
    player.x = coordinate(draw, if is_default { [0.5, 40.0] } else { [-1.0, 65.0] }, player.rx);
    player.y = coordinate(draw, if is_default { [0.5, 14.0] } else { [-1.0, 65.0] }, player.ry);
    (player.vx, player.vy) = (speed(draw, 0.5), speed(draw, 1.5));
    let kinds = [Tile::Empty, Tile::Empty, Tile::Wall, Tile::WallTop, Tile::Lava, Tile::Coin, Tile::Barrier];
    for _ in 0..draw.random_range(0..30) {
        let near = |centre: f32, draw: &mut ChaCha8Rng| centre as i32 + draw.random_range(-7..8);
        let (x, y) = (near(player.x, draw), near(player.y, draw));
        let (width, height) = (draw.random_range(1..5), draw.random_range(1..5));
        tiles.fill(x, y, width, height, kinds[draw.random_range(0..kinds.len())]);
    }
    let mut flag = || draw.random_bool(0.3);
    let memory = PlayerState { on_crate: flag(), lent_support: flag(), supported: flag(), faces_left: flag() };
    let [crates, saws, enemies] = std::array::from_fn(|_| bodies(draw, &player));
    Scene { tiles, player, memory, crates, saws, enemies }
}

#[test]
fn paths_from_anywhere_are_those_of_the_rules() {
    let mut draw = ChaCha8Rng::seed_from_u64(2);
    let (mut surroundings, mut ends) = (Surroundings::default(), [0; 4]);
    for _ in 0..1_000 {
        let level = level(&mut draw);
        for _ in 0..30 {
            odd_scene(&mut draw, &level).compare(&mut surroundings, &mut ends);
        }
    }
    assert!(ends.iter().all(|&count| count > 1_000), "every end occurs: {ends:?}");
}
