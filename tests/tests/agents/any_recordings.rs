//! Tests of recordings of any kind: trainings read every recording that `demo verify` accepts.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bevy_playbot::{
    demo::file::{DemoEnd, DemoFault, DemoWriter},
    engine::{flush_unfinished, merge_demos, relabel_demo},
    vision::{ObservationConfig, ObservationKind},
};
use playbot::prelude::*;
use playbot_games::{coinrun::CoinRun, maze2d::Maze2d};
use playbot_harness::{
    demo::{
        demonstration::DemonstrationPlan,
        filter::{EpisodeFilter, filter_demos},
        verify_file,
    },
    eval::Player,
    game::idle_action,
    sensors::GameSensors,
    split::LevelSplit,
};
use playbot_tests::{
    Corridor,
    faulty::Fault,
    foreign::{catch::catch_game, pong::pong_game},
};
use playbot_train::demo::Demonstrations;
use proptest::prelude::*;

/// The games that are recorded, with their modes. In `pong` a second agent plays along. The last two have faults that some
/// recordings show.
fn games() -> Vec<(Box<dyn Game>, Vec<&'static str>)> {
    vec![
        (Box::new(Corridor), vec!["plain"]),
        (Box::new(CoinRun::default()), vec!["easy", "hard"]),
        (Box::new(Maze2d { physics: false }), vec!["umaze", "umaze+end-at-goal", "medium+sparse"]),
        (Box::new(catch_game()), vec!["default"]),
        (Box::new(pong_game()), vec!["default"]),
        (Box::new(Fault::SharedScore), vec!["bed"]),
        (Box::new(Fault::LeftOvers), vec!["bed"]),
    ]
}

/// One file: a recording, and its change afterwards.
#[derive(Clone, Debug)]
struct Take {
    /// Chooses the mode.
    mode: usize,
    levels: Vec<u64>,
    is_demonstrator: bool,
    noise: f64,
    seed: u64,
    /// The recording is cut off after this many steps.
    steps: Option<u64>,
    keep_observations: bool,
    change: Change,
}

/// A change of a file by another verb.
#[derive(Clone, Copy, Debug)]
enum Change {
    None,
    Won,
    FirstLevel,
    IdleStart,
    Label,
    /// Merged with the file before it.
    Merge,
}

fn takes() -> impl Strategy<Value = Vec<Take>> {
    let changes = [Change::None, Change::Won, Change::FirstLevel, Change::IdleStart, Change::Label, Change::Merge];
    let take = (
        0usize..6,
        prop::collection::vec(0u64..12, 1..5),
        any::<bool>(),
        prop::sample::select(vec![0.0, 0.25, 1.0]),
        0u64..1000,
        prop::option::weighted(0.8, 1u64..200),
        any::<bool>(),
        prop::sample::select(changes.to_vec()),
    );
    let take = take.prop_map(|(mode, levels, is_demonstrator, noise, seed, steps, keep_observations, change)| Take {
        mode,
        levels,
        is_demonstrator,
        noise,
        seed,
        steps,
        keep_observations,
        change,
    });
    prop::collection::vec(take, 1..4)
}

/// Records a file.
fn record(game: &dyn Game, mode: &str, take: &Take, path: &Path) {
    let Take { levels, noise, seed, steps, keep_observations, .. } = take.clone();
    let plan = DemonstrationPlan {
        mode: mode.to_owned(),
        levels,
        noise,
        seed,
        steps,
        keep_observations,
        randomise: Default::default(),
    };
    let writer = DemoWriter::create(path, plan.header(game)).expect("a fresh file");
    let player = match game.tools().bots.demonstrator() {
        Some(_) if take.is_demonstrator => Player::Demonstrator,
        _ => Player::Blind(BlindBot::Uniform),
    };
    let built = plan.build_world_of(game, &player, &ObservationConfig::default(), writer);
    let (mut world, agent) = built.expect("vectors need nothing");
    let is_full = |recorded: u64| steps.is_some_and(|steps| recorded >= steps);
    while Control::of(&world, agent).is_active() && !is_full(world.resource::<Recorder>().steps()) {
        world.tick().expect("sound");
    }
    flush_unfinished(&mut world).expect("writable");
}

/// Changes a file, or removes it if no episode is left. `before` is the file before it.
fn change(game: &dyn Game, mode: &str, take: &Take, path: &Path, before: Option<&Path>) {
    let spare = path.with_extension("spare");
    let filter = |filter: EpisodeFilter| {
        let report = filter_demos(&[path.to_owned()], &filter, &spare).expect("a recording of this mode");
        report.episodes()
    };
    let episodes = match take.change {
        Change::None => return,
        Change::Won => filter(EpisodeFilter { success: true, ..EpisodeFilter::default() }),
        Change::FirstLevel => {
            let levels = vec![LevelSplit { mode: mode.to_owned(), first: take.levels[0], last: take.levels[0] }];
            filter(EpisodeFilter { levels, ..EpisodeFilter::default() })
        }
        Change::IdleStart => filter(EpisodeFilter { idle: Some(idle_action(game)), ..EpisodeFilter::default() }),
        Change::Label => relabel_demo(path, "ada", &spare).expect("writable").episodes(),
        Change::Merge => {
            let Some(before) = before.filter(|before| before.exists()) else { return };
            match merge_demos(&[before, path], &spare) {
                Ok(report) => report.episodes(),
                // Modes, noise or kept observations differ, or one seed has recorded the same twice.
                Err(error) => {
                    let fault = error.fault;
                    let is_refused = matches!(
                        fault,
                        DemoFault::MergeDiffers { .. } | DemoFault::CopyOf(_) | DemoFault::ForeignMode { .. }
                    );
                    assert!(is_refused, "{fault}");
                    return;
                }
            }
        }
    };
    fs::remove_file(path).expect("it is there");
    if episodes > 0 {
        fs::rename(&spare, path).expect("writable");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn trainings_read_every_recording_that_demo_verify_accepts(
        game in 0usize..7, all in takes(), threads in 1usize..3, pictures: bool,
    ) {
        let (game, modes) = games().swap_remove(game);
        let game = game.as_ref();
        let folder = tempfile::tempdir().expect("a folder");
        let mut files: Vec<PathBuf> = Vec::new();
        for (number, take) in all.iter().enumerate() {
            let (mode, path) = (modes[take.mode % modes.len()], folder.path().join(format!("{number}.demo")));
            record(game, mode, take, &path);
            change(game, mode, take, &path, files.last().map(PathBuf::as_path));
            files.push(path);
        }
        files.retain(|path| path.exists());
        let reports = files.iter().map(|path| verify_file(game, path, |_| {}).expect("readable"));
        let reports: Vec<_> = reports.collect();
        let ticks: u64 = reports.iter().map(|report| report.ticks).sum();
        let is_accepted = reports.iter().all(|report| report.divergences.is_empty());
        if !is_accepted || files.is_empty() {
            return Ok(());
        }
        let raster = ObservationConfig { kind: ObservationKind::Raster, ..ObservationConfig::default() };
        let seen = if pictures && raster.check(game).is_ok() { raster } else { ObservationConfig::default() };
        let read = || Demonstrations::read(game, &seen, folder.path(), None).map_err(|error| error.to_string());
        let demos = read().expect("verified");
        let idle: usize = demos.episodes.iter().map(|demo| demo.episode.idle_start()).sum();
        // The outcome of an episode's last step is unknown unless the rules have ended it there.
        let known = |end: &DemoEnd, steps: usize| match end {
            DemoEnd::Terminated { .. } => steps,
            _ => steps.saturating_sub(1),
        };
        let known: usize = demos.episodes.iter().map(|demo| known(&demo.episode.end, demo.episode.len())).sum();
        let dataset = demos.dataset(game, threads, |_| {}).map_err(|error| error.to_string());
        prop_assert_eq!(dataset.map(|dataset| dataset.steps()), Ok(ticks as usize - idle));
        let rollouts = read().expect("verified").rollouts(game, threads, |_| {}).map_err(|error| error.to_string());
        prop_assert_eq!(rollouts.map(|all| all.iter().map(|rollout| rollout.steps).sum::<usize>()), Ok(known));
    }
}
