//! Recorded files: episodes, and findings with the actions to them.

use std::{fs, path::Path};

use bevy_playbot::action::{ActionSpace, Actions};
use bevy_playbot::demo::file::{
    Decider, DemoEnd, DemoEpisode, DemoHeader, DemoReader, DemoSummary, DemoWriter, repair,
};
use bevy_playbot::level::LevelFile;
use playbot::prelude::*;
use playbot_test::findings::{FindingHead, StoredFinding};

use crate::{
    Corridor,
    hostile::{
        form::Form,
        kind::{FileKind, Read, words},
    },
    recording::record_random,
};

const FILE: &str = "a.demo";
/// Ticks of a made-up episode.
const TICKS: u8 = 9;

/// Returns all kinds of recordings.
pub(super) fn recorded(folder: &Path) -> Vec<FileKind> {
    let own = |name: &str| {
        let own = folder.join(name);
        fs::create_dir_all(&own).expect("writable");
        own
    };
    let (played, walked, found) = (own("played"), own("walked"), own("found"));
    record_random(&Corridor, "plain", 5, &played.join(FILE), 0..5);
    walk(&walked.join(FILE));
    finding().write(&found.join(FILE)).expect("writable");
    let episodes = |name, folder: &Path| {
        FileKind::new(name, Form::Recording, folder, FILE, read_episodes).growing().handled(handle)
    };
    vec![
        episodes("recording", &played),
        episodes("recording of vectors", &walked),
        FileKind::new("finding", Form::Recording, &found, FILE, read_finding).handled(handle),
    ]
}

/// Writes a recording with all possible parts: vectors, observations, all deciders, and level files.
fn walk(path: &Path) {
    let header = DemoHeader {
        observation_names: vec!["x".into(), "y".into()],
        demonstrator: "tester".into(),
        note: "drawn".into(),
        ..DemoHeader::new("walk", 2, "easy", 60.0, ActionSpace::Continuous(2))
    };
    let mut writer = DemoWriter::create(path, header.with_level_files()).expect("fresh");
    for seed in 0..3 {
        writer.push(&walked_episode(seed)).expect("writable");
    }
}

fn walked_episode(seed: u8) -> DemoEpisode {
    let deciders = [Decider::Human, Decider::Bot, Decider::Policy, Decider::Replay, Decider::Idle];
    let ticks = || 0..TICKS;
    let pairs = || (0..2 * TICKS).map(|at| f32::from(at) / 8.0);
    DemoEpisode {
        level_file: (seed > 0).then(|| LevelFile { path: format!("levels/{seed}.json"), hash: u64::MAX }),
        rewards: ticks().map(|tick| f32::from(tick / 4)).collect(),
        state_hashes: ticks().map(|tick| u32::from(tick) * 1_000_003).collect(),
        deciders: ticks().map(|tick| deciders[usize::from(tick) % deciders.len()]).collect(),
        end: DemoEnd::Truncated,
        observations: pairs().collect(),
        actions: Actions::Continuous { dim: 2, values: pairs().collect() },
        ..DemoEpisode::new(seed.into(), ActionSpace::Continuous(2))
    }
}

fn finding() -> StoredFinding {
    let (header, ticks) = (Corridor.demo_header("plain"), usize::from(TICKS));
    let head = FindingHead {
        tester: Some("random".to_owned()),
        tick: Some(u32::from(TICKS) - 1),
        state_hash: Some(3),
        original_ticks: 20,
        settings: vec!["stuck.ticks=9".to_owned()],
        ..FindingHead::new("plain:7", "stuck", "it stands still")
    };
    let episode = DemoEpisode {
        actions: Actions::Discrete(vec![2; ticks]),
        rewards: vec![0.0; ticks],
        state_hashes: vec![3; ticks],
        deciders: vec![Decider::Bot; ticks],
        ..DemoEpisode::new(7, header.actions)
    };
    StoredFinding { header, head, episode }
}

fn read_episodes(folder: &Path) -> Read {
    let reader = DemoReader::open(folder.join(FILE)).map_err(words)?;
    let header = format!("{:?}", reader.header());
    let episodes = reader.map(|episode| episode.map(|episode| format!("{episode:?}")).map_err(words));
    std::iter::once(Ok(header)).chain(episodes).collect()
}

fn read_finding(folder: &Path) -> Read {
    StoredFinding::read(&folder.join(FILE)).map(|finding| vec![format!("{finding:?}")]).map_err(words)
}

/// Summarises, repairs and continues the whole parts.
fn handle(folder: &Path) {
    let (path, mended) = (folder.join(FILE), folder.join("mended.demo"));
    let _ = DemoSummary::read(&path);
    if let Ok(report) = repair(&path, &mended, None) {
        let reader = DemoReader::open(&mended).expect("what was repaired is whole");
        let header = reader.header().clone();
        assert_eq!(reader.read_all().expect("what was repaired is whole").len(), report.kept_episodes);
        DemoWriter::append(&mended, &header).expect("what was repaired can be gone on with");
    }
}
