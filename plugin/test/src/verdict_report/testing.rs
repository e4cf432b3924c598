//! Levels, results and a game for unit tests.

use crate::{
    findings::{FINDINGS, FindingHead, Pin, Pins, StoredFinding},
    verdict::{
        Earlier, EpisodeScore, Finding, FinishTime, LevelOutcome, LevelVerdict, MapScope, TestFolder, TestRecord,
        TesterRecord, TesterVerdict, wilson,
    },
};
use bevy::prelude::*;
use bevy_playbot::{
    action::{ActionSpace, Actions},
    demo::file::{Decider, DemoEpisode, DemoHeader},
    observation::ObservationSpace,
};
use playbot_harness::{
    detector::LevelProof,
    floor_plan::FloorPlan,
    game::{Game, GameTools, LevelTools},
};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// A game whose levels all look like [`garden`].
pub struct Garden;

impl Game for Garden {
    fn name(&self) -> &'static str {
        "garden"
    }
    fn version(&self) -> u32 {
        1
    }
    fn modes(&self) -> &'static [&'static str] {
        &["hard"]
    }
    fn tick_hz(&self) -> f64 {
        15.0
    }
    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(2)
    }
    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: vec!["x".to_owned()] }
    }
    fn build(&self, _app: &mut App, _mode: &str) {}
    fn spawn_agent(&self, world: &mut World, _index: u32) -> Entity {
        world.spawn_empty().id()
    }
    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, ..GameTools::default() }
    }
}

impl LevelTools for Garden {
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        Some(garden())
    }
}

/// Makes a floor with a pit of thorns and many bushes.
pub(crate) fn garden() -> FloorPlan {
    let bush = |number: usize| {
        let corner = Vec2::new((number % 60) as f32 + 0.25, (number / 60) as f32 + 6.25);
        Rect::from_corners(corner, corner + 0.5)
    };
    FloorPlan {
        bounds: Rect::new(0.0, 0.0, 64.0, 16.0),
        walls: (0..200).map(bush).chain([Rect::new(0.0, 0.0, 64.0, 1.0)]).collect(),
        hazards: vec![Rect::new(20.0, 1.0, 22.0, 2.0)],
        start: Vec2::new(1.5, 1.5),
        goal: Vec2::new(62.5, 1.5),
        ..FloorPlan::default()
    }
}

/// Makes the record of a test of these levels of the garden.
pub(crate) fn record(range: &str, shard: Option<&str>) -> TestRecord {
    TestRecord {
        game: "garden".to_owned(),
        game_version: 1,
        range: range.parse().expect("a split"),
        files: None,
        seed: 3,
        testers: vec![TesterRecord::bot("random")],
        episodes: 9,
        detectors: Vec::new(),
        options: Vec::new(),
        maps: MapScope::default(),
        shard: shard.map(|shard| shard.parse().expect("a shard")),
    }
}

/// Makes a level of `hard:0..` with so many solved episodes of so many ticks; the others are lost.
pub(crate) fn level(index: u64, solved: u64, episodes: u64, ticks: u32) -> LevelVerdict {
    let score = EpisodeScore {
        solved,
        episodes,
        interval: wilson(solved, episodes),
        ticks: FinishTime::of(vec![ticks; solved as usize]),
        lost: episodes - solved,
        timed_out: 0,
        broken: 0,
    };
    LevelVerdict {
        level: format!("hard:{index}"),
        name: None,
        index,
        outcome: if solved > 0 { LevelOutcome::Solved } else { LevelOutcome::BotFailed },
        proof: if solved > 0 { LevelProof::Solvable } else { LevelProof::Unknown },
        score: score.clone(),
        seconds: None,
        ends: Vec::new(),
        causes: BTreeMap::new(),
        stop: None,
        solved_at_start: false,
        places: None,
        maps: None,
        reached: None,
        testers: vec![TesterVerdict { tester: "random".to_owned(), score, exact: false, places: None, events: None }],
        findings: Vec::new(),
        not_kept: None,
        too_short: Vec::new(),
        recorded: None,
    }
}

/// Makes a finding of `random` in its first episode.
pub(crate) fn finding(detector: &str, message: &str) -> Finding {
    Finding {
        detector: detector.to_owned(),
        tester: Some("random".to_owned()),
        episode: Some(0),
        tick: Some(7),
        message: message.to_owned(),
        file: None,
        settings: Vec::new(),
    }
}

/// Writes an episode of two ticks with this head into `findings`, in the folder of a test.
pub(crate) fn keep(folder: &Path, name: &str, head: FindingHead) {
    let header = DemoHeader::new("garden", 1, "hard", 15.0, ActionSpace::Discrete(2));
    let mut episode = DemoEpisode::new(0, header.actions);
    episode.actions = Actions::Discrete(vec![1, 0]);
    (episode.rewards, episode.state_hashes) = (vec![0.0; 2], vec![1, 2]);
    episode.deciders = vec![Decider::Bot; 2];
    let folder = folder.join(FINDINGS);
    fs::create_dir_all(&folder).expect("writable");
    StoredFinding { header, head, episode }.write(&folder.join(format!("{name}.finding"))).expect("writable");
}

/// Makes a finding with a file.
pub(crate) fn in_file(name: &str) -> Finding {
    Finding { file: Some(format!("{FINDINGS}/{name}.finding")), ..finding("panic", name) }
}

/// Pins findings of these names in the folder of a test, whose files are no findings.
pub(crate) fn pin(folder: &Path, names: &[&str], until: &str) {
    fs::create_dir_all(folder.join(FINDINGS)).expect("writable");
    for name in names {
        fs::write(folder.join(FINDINGS).join(format!("{name}.finding")), "").expect("writable");
        let reason = "drawn anew in spring".to_owned();
        let pin = Pin { finding: (*name).to_owned(), reason, until: until.parse().expect("a day") };
        Pins::add(folder, &pin).expect("writable");
    }
}

/// Makes the results of a test, in the folder of this name.
pub(crate) fn tested(parent: &Path, name: &str, record: &TestRecord, levels: &[LevelVerdict]) -> PathBuf {
    let path = parent.join(name);
    let (mut folder, _) = TestFolder::open(&path, record, Earlier::Keep).expect("new");
    for level in levels {
        folder.keep(level).expect("writable");
    }
    folder.finish().expect("writable");
    path
}
