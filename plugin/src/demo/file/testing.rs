//! Small recordings for the tests of this module.

use crate::{
    action::{ActionSpace, Actions},
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoWriter},
};
use std::path::{Path, PathBuf};

/// Returns a small header with two observation values.
pub(super) fn header() -> DemoHeader {
    DemoHeader {
        observation_names: vec!["x".into(), "y".into()],
        demonstrator: "tester".into(),
        ..DemoHeader::new("walk", 2, "easy", 60.0, ActionSpace::Discrete(4))
    }
}

/// Creates an episode of `steps` ticks that fits [`header`], different for each seed.
pub(super) fn episode(level_seed: u64, steps: usize) -> DemoEpisode {
    let value = |t: usize| (level_seed.wrapping_mul(0x9e37_79b9) as usize).wrapping_add(t * 7919);
    DemoEpisode {
        level_seed,
        level_file: None,
        randomised: Vec::new(),
        actions: Actions::Discrete((0..steps).map(|t| (value(t) % 4) as u32).collect()),
        rewards: (0..steps).map(|t| if t + 1 == steps { 10.0 } else { 0.0 }).collect(),
        state_hashes: (0..steps).map(|t| value(t) as u32).collect(),
        deciders: (0..steps).map(|t| if t < 2 { Decider::Human } else { Decider::Bot }).collect(),
        end: DemoEnd::Terminated { success: true },
        observations: (0..2 * steps).map(|t| t as f32 / 4.0).collect(),
    }
}

/// Writes the episodes to `name` in `folder`.
pub(super) fn write(folder: &Path, name: &str, episodes: &[DemoEpisode]) -> PathBuf {
    let path = folder.join(name);
    let mut writer = DemoWriter::create(&path, header()).expect("created");
    for episode in episodes {
        writer.push(episode).expect("written");
    }
    path
}
