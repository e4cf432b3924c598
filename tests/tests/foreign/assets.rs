//! Tests of games whose level is an asset that arrives after a delay, which differs from load to load.

use std::{
    future::poll_fn,
    path::Path,
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Poll, Waker},
    thread,
    time::Duration,
};

use bevy::{
    asset::{
        AssetLoader, LoadContext,
        io::{AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader, VecReader},
    },
    prelude::*,
};
use playbot::prelude::*;
use playbot_harness::{
    demo::verify_file,
    foreign::{ForeignGame, LevelSeed, Restart},
    worlds::build_world,
};
use playbot_tests::{foreign::traces, recording::record_demonstrator};

use crate::rebuild::replayed_backwards;

/// Heights of the level's tiles, from left to right.
#[derive(Asset, TypePath)]
struct Tiles(Vec<u8>);

#[derive(Default, TypePath)]
struct TilesLoader;

impl AssetLoader for TilesLoader {
    type Asset = Tiles;
    type Settings = ();
    type Error = std::io::Error;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        _context: &mut LoadContext<'_>,
    ) -> Result<Tiles, std::io::Error> {
        let mut heights = Vec::new();
        reader.read_to_end(&mut heights).await?;
        Ok(Tiles(heights))
    }

    fn extensions(&self) -> &[&str] {
        &["tiles"]
    }
}

/// Delays of one load after the other, in milliseconds.
const DELAYS: [u64; 7] = [3, 0, 17, 90, 8, 150, 29];

/// Loads of this program.
static LOADS: AtomicUsize = AtomicUsize::new(0);

/// Lets the time of a delay pass on another thread.
async fn pass_time() {
    let delay = Duration::from_millis(DELAYS[LOADS.fetch_add(1, Ordering::Relaxed) % DELAYS.len()]);
    let state: Arc<Mutex<(bool, Option<Waker>)>> = Arc::default();
    let timer = state.clone();
    thread::spawn(move || {
        #[allow(clippy::disallowed_methods, reason = "a slow disk")]
        thread::sleep(delay);
        let mut state = timer.lock().expect("no thread panics");
        state.0 = true;
        if let Some(waker) = state.1.take() {
            waker.wake();
        }
    });
    poll_fn(move |context| {
        let mut state = state.lock().expect("no thread panics");
        if state.0 {
            return Poll::Ready(());
        }
        state.1 = Some(context.waker().clone());
        Poll::Pending
    })
    .await;
}

/// A disk with one file, `level.tiles`.
struct SlowDisk;

impl AssetReader for SlowDisk {
    async fn read<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        pass_time().await;
        match path.to_str() {
            Some("level.tiles") => Ok(VecReader::new(vec![3, 1, 4, 1, 5, 9, 2, 6])),
            _ => Err(AssetReaderError::NotFound(path.to_path_buf())),
        }
    }

    async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        Err::<VecReader, _>(AssetReaderError::NotFound(path.to_path_buf()))
    }

    async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
        Err(AssetReaderError::NotFound(path.to_path_buf()))
    }

    async fn is_directory<'a>(&'a self, _path: &'a Path) -> Result<bool, AssetReaderError> {
        Ok(false)
    }
}

/// Adds the disk. Bevy wants to know it before its own assets.
struct SlowDiskPlugin;

impl Plugin for SlowDiskPlugin {
    fn build(&self, app: &mut App) {
        app.register_asset_source("slow", AssetSourceBuilder::new(|| Box::new(SlowDisk)));
    }
}

/// The level's file.
#[derive(Resource)]
struct Map(Handle<Tiles>);

/// The game's random numbers, drawn in each fixed step.
#[derive(Resource, Default)]
struct Wind(u64);

/// The time of the next drop.
#[derive(Resource)]
struct NextDrop(Timer);

#[derive(Component)]
struct Hero;

/// The game, as its author wrote it. Wind and drops do not wait for the level.
fn game(app: &mut App) {
    app.init_asset::<Tiles>()
        .init_asset_loader::<TilesLoader>()
        .init_resource::<Wind>()
        .insert_resource(NextDrop(Timer::from_seconds(0.1, TimerMode::Repeating)))
        .add_systems(Startup, |server: Res<AssetServer>, mut commands: Commands| {
            commands.insert_resource(Map(server.load("slow://level.tiles")));
        })
        .add_systems(FixedUpdate, blow)
        .add_systems(Update, (build_level, drip, walk).chain());
}

fn blow(mut wind: ResMut<Wind>, mut heroes: Query<&mut Transform, With<Hero>>) {
    wind.0 = wind.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    for mut hero in &mut heroes {
        hero.translation.x += 0.01 * (wind.0 >> 60) as f32;
    }
}

fn build_level(
    map: Res<Map>,
    tiles: Res<Assets<Tiles>>,
    mut wind: ResMut<Wind>,
    heroes: Query<&Hero>,
    mut commands: Commands,
) {
    let Some(tiles) = tiles.get(&map.0).filter(|_| heroes.is_empty()) else { return };
    for (x, height) in tiles.0.iter().enumerate() {
        commands.spawn(Transform::from_xyz(x as f32, f32::from(*height), (wind.0 >> 60) as f32));
        wind.0 = wind.0.rotate_left(7);
    }
    commands.spawn((Hero, Transform::default()));
}

fn drip(time: Res<Time>, wind: Res<Wind>, mut next: ResMut<NextDrop>, mut commands: Commands) {
    if next.0.tick(time.delta()).just_finished() {
        commands.spawn(Transform::from_xyz((wind.0 >> 58) as f32, 9.0, time.elapsed_secs()));
    }
}

fn walk(keys: Res<ButtonInput<KeyCode>>, time: Res<Time>, mut heroes: Query<&mut Transform, With<Hero>>) {
    for mut hero in &mut heroes {
        hero.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight))) * time.delta_secs();
    }
}

/// Returns the game with its adapter.
fn slow_game() -> ForeignGame {
    adapted(game)
}

/// Returns the adapter.
fn adapted(game: fn(&mut App)) -> ForeignGame {
    ForeignGame::new("slow", 1, game)
        .keys([vec![], vec![KeyCode::ArrowRight]])
        .observe(
            ["x", "elapsed", "fixed"],
            |hero: Single<&Transform, With<Hero>>, time: Res<Time>, fixed: Res<Time<Fixed>>| {
                [hero.translation.x, time.elapsed_secs(), fixed.elapsed_secs()]
            },
        )
        .reward_delta(|hero: Single<&Transform, With<Hero>>| hero.translation.x)
        .time_limit(30)
        .level(|level: Res<LevelSeed>, mut wind: ResMut<Wind>, mut next: ResMut<NextDrop>| {
            wind.0 = level.0.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            next.0.reset();
        })
        .ready(|heroes: Query<&Hero>| !heroes.is_empty())
        .demonstrator("runner", |wind: Res<Wind>| u32::from(!wind.0.is_multiple_of(3)))
        .headless(|plugins| plugins.build().add_before::<AssetPlugin>(SlowDiskPlugin))
}

#[test]
fn recordings_of_a_level_that_arrives_late_replay_in_other_worlds_and_orders() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("slow.demo");
    let game = slow_game();
    record_demonstrator(&game, "default", 0.3, &path, [0, 1, 2, 0]);
    let report = verify_file(&game, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, &report.divergences), (4, &Vec::new()));
    assert_eq!(replayed_backwards(&game, &path), vec![None; 4]);
}

/// The game with a start that takes so long that most loads end before the first frame does.
fn game_with_a_slow_start(app: &mut App) {
    game(app);
    app.add_systems(PostStartup, || {
        #[allow(clippy::disallowed_methods, reason = "a slow start")]
        thread::sleep(Duration::from_millis(50));
    });
}

#[test]
fn a_world_that_is_built_anew_begins_the_same_however_soon_its_level_arrives() {
    for game in [game as fn(&mut App), game_with_a_slow_start] {
        let played = traces(&adapted(game).restart(Restart::Rebuild), 1, &[4; 8]);
        for (episode, trace) in played.iter().enumerate() {
            assert_eq!(trace, &played[0], "episode {episode}");
        }
    }
}

#[test]
fn an_asset_that_is_asked_for_in_a_frame_is_there_in_the_next() {
    #[derive(Resource, Default)]
    struct Asked(Option<Handle<Tiles>>);
    let game = |app: &mut App| {
        app.init_asset::<Tiles>().init_asset_loader::<TilesLoader>().init_resource::<Asked>().add_systems(
            Update,
            |time: Res<Time>, server: Res<AssetServer>, mut asked: ResMut<Asked>| {
                if time.elapsed_secs() > 0.1 && asked.0.is_none() {
                    asked.0 = Some(server.load("slow://level.tiles"));
                }
            },
        );
    };
    let game = ForeignGame::new("asking", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["asked", "there"], |asked: Res<Asked>, tiles: Res<Assets<Tiles>>| {
            let is_there = asked.0.as_ref().is_some_and(|handle| tiles.contains(handle));
            [f32::from(u8::from(asked.0.is_some())), f32::from(u8::from(is_there))]
        })
        .time_limit(20)
        .headless(|plugins| plugins.build().add_before::<AssetPlugin>(SlowDiskPlugin));
    // Several Worlds, since one of the delays is none.
    for _ in 0..3 {
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1])));
        let seen: Vec<Vec<f32>> = (0..20)
            .map(|_| {
                world.tick().expect("sound");
                world.get::<Observation>(agents[0]).expect("an agent").vector.clone()
            })
            .collect();
        assert_eq!((&seen[0], &seen[19]), (&vec![0.0, 0.0], &vec![1.0, 1.0]), "it is asked for in the episode");
        assert!(seen.iter().all(|values| values[0] == values[1]), "{seen:?}");
    }
}

#[test]
fn a_level_that_is_not_ready_in_time_names_the_assets_that_failed_to_load() {
    #[derive(Resource)]
    struct Art(#[allow(dead_code)] Handle<Tiles>);
    let game = |app: &mut App| {
        app.init_asset::<Tiles>().init_asset_loader::<TilesLoader>().add_systems(
            Startup,
            |server: Res<AssetServer>, mut commands: Commands| {
                commands.insert_resource(Art(server.load("slow://misspelt.tiles")));
            },
        );
    };
    let game = ForeignGame::new("misspelt", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["x"], || [0.0])
        .ready(|tiles: Res<Assets<Tiles>>| !tiles.is_empty())
        .ready_within(10)
        .headless(|plugins| plugins.build().add_before::<AssetPlugin>(SlowDiskPlugin));
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1])));
    let text = world.tick().expect_err("there is no such file").to_string();
    assert!(text.contains("not ready after 10 frames"), "{text}");
    assert!(text.contains("; assets failed to load: `slow://misspelt.tiles`"), "{text}");
}
