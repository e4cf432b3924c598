//! Detection of one flipped bit, and of a cut at any position, in every kind of file of a learner.

use crate::files::{Contents, Load, files};
use crate::toy::OBS;
use playbot_learner::{
    ActionSpace, DeviceKind, FileError, Learner, PolicyFile, PolicyMetadata, PolicySpec, SacConfig, SacLearner,
};
use std::fs;
use std::path::{Path, PathBuf};

/// Returns all kinds: those of [`files`], a policy to ship, and SAC's learner with its replay buffer.
fn all_kinds(folder: &Path) -> Vec<(PathBuf, Load)> {
    let mut kinds: Vec<(PathBuf, Load)> = files(folder).into_iter().map(|(path, load, _)| (path, load)).collect();
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: ActionSpace::Discrete(2) };
    let config = SacConfig { hidden: vec![8], buffer: 32, ..SacConfig::default() };
    let sac = SacLearner::new(config, spec, 1, DeviceKind::Flex).expect("good settings");
    let path = folder.join("sac");
    sac.save(&path).expect("written");
    kinds.push((path, |path| SacLearner::load(path, DeviceKind::Flex).map(drop)));
    let policy = PolicyFile { metadata: PolicyMetadata::default(), policy: sac.policy().clone(), skills: None };
    let path = folder.join("policy");
    policy.save(&path, &vec![0.5; OBS * 2][..], &[], 2).expect("written");
    kinds.push((path, |path| PolicyFile::load(path, DeviceKind::Flex).map(drop)));
    kinds
}

/// Returns pseudo-random numbers of a fixed seed: a linear congruential generator (Knuth's MMIX).
fn dice() -> impl FnMut(usize) -> usize {
    let mut state = 7u64;
    move |sides| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % sides
    }
}

#[test]
fn a_flipped_bit_is_never_accepted() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut dice = dice();
    for (path, load) in all_kinds(folder.path()) {
        load(&path).expect("whole");
        let whole = fs::read(&path).expect("written");
        let changed = path.with_extension("changed");
        // All bits of the header, and as many others.
        let header = 8 + u64::from_le_bytes(whole[..8].try_into().expect("eight bytes")) as usize;
        let tries = (0..header.min(400) * 8).chain((0..2000).map(|_| dice(whole.len() * 8)));
        for at in tries {
            let mut bytes = whole.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            fs::write(&changed, bytes).expect("written");
            let error = load(&changed).expect_err("damaged");
            let is_named = matches!(error, FileError::Damaged { .. } | FileError::CutOff { .. });
            assert!(is_named, "{}, bit {at}: {error}", path.display());
        }
    }
}

#[test]
fn a_file_that_was_cut_anywhere_is_never_accepted() {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, load) in all_kinds(folder.path()) {
        let whole = fs::read(&path).expect("written");
        let changed = path.with_extension("changed");
        for length in 0..whole.len().min(4000) {
            // The start byte by byte, the rest evenly.
            let length = if length < 2000 { length } else { length * whole.len() / 4000 };
            fs::write(&changed, &whole[..length]).expect("written");
            let error = load(&changed).expect_err("cut off");
            assert!(matches!(error, FileError::CutOff { .. }), "{}, {length} bytes: {error}", path.display());
        }
    }
}

#[test]
fn files_of_older_versions_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, load) in all_kinds(folder.path()) {
        let older = path.with_extension("older");
        Contents::read(&path).write(&older);
        assert!(!String::from_utf8_lossy(&fs::read(&older).expect("written")).contains("crc32"));
        load(&older).expect("whole");
    }
}
