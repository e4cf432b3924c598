//! Tests of whole files: round trips, cuts, flips of bits, hostile lengths, summaries, search and merging.

use crate::{
    action::{ActionSpace, Actions},
    demo::file::{
        testing::{episode, header, write},
        *,
    },
};
use proptest::prelude::*;
use std::{
    fs,
    path::{Path, PathBuf},
};

fn three(folder: &Path) -> (PathBuf, Vec<u8>, Vec<DemoEpisode>, Vec<u64>) {
    let episodes = vec![episode(1, 6), episode(2, 1), episode(3, 9)];
    let path = write(folder, "three.demo", &episodes);
    let mut reader = DemoReader::open(&path).expect("sound");
    let mut boundaries = vec![reader.offset()];
    while reader.next().is_some_and(|e| e.is_ok()) {
        boundaries.push(reader.offset());
    }
    let bytes = fs::read(&path).expect("read");
    assert_eq!(boundaries.last(), Some(&(bytes.len() as u64)));
    (path, bytes, episodes, boundaries)
}

/// Writes a file anew: some file systems wait for the disk when a file is overwritten.
fn put(path: &Path, bytes: &[u8]) {
    let _ = fs::remove_file(path);
    fs::write(path, bytes).expect("written");
}

/// Returns the output and report of `repair`, without waiting for the disk.
fn repair_in_memory(bytes: &[u8]) -> (Vec<u8>, RepairReport) {
    let (header, start) = crate::demo::file::preamble::decode(bytes).expect("the header is sound");
    let mut output = bytes[..start as usize].to_vec();
    let report = crate::demo::file::repair::salvage(bytes, start as usize, &header, &mut output);
    (output, report)
}

/// Returns all whole episodes and, if there is one, the error behind them.
fn read_lenient(path: &Path) -> Result<(Vec<DemoEpisode>, Option<DemoFileError>), DemoFileError> {
    let (mut episodes, mut error) = (Vec::new(), None);
    for item in DemoReader::open(path)? {
        match item {
            Ok(episode) => episodes.push(episode),
            Err(e) => error = Some(e),
        }
    }
    Ok((episodes, error))
}

#[test]
fn a_cut_at_any_byte_costs_at_most_the_last_episode() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (_, bytes, episodes, boundaries) = three(folder.path());
    let path = folder.path().join("cut.demo");
    for cut in 0..bytes.len() {
        put(&path, &bytes[..cut]);
        let whole = boundaries.iter().filter(|&&b| b <= cut as u64).count();
        let out = folder.path().join("repaired.demo");
        if whole == 0 {
            let error = read_lenient(&path).expect_err("no header");
            assert!(matches!(error.fault, DemoFault::TruncatedHeader { length } if length == cut as u64), "{error}");
            assert!(repair(&path, &out, None).is_err());
            continue;
        }
        let (read, error) = read_lenient(&path).expect("the header is whole");
        assert_eq!(read, episodes[..whole - 1], "cut at {cut}");
        let torn = cut as u64 - boundaries[whole - 1];
        match error.map(|e| e.fault) {
            None => assert_eq!(torn, 0),
            Some(DemoFault::TruncatedFrame { offset, episode, missing }) => {
                assert_eq!((offset, episode), (boundaries[whole - 1], whole - 1));
                // Until the length is written, the file implies only the smallest frame.
                let expected = if torn < 8 { 12 - torn } else { boundaries[whole] - cut as u64 };
                assert_eq!(missing, expected);
            }
            Some(other) => panic!("cut at {cut}: {other}"),
        }
        let (output, report) = repair_in_memory(&bytes[..cut]);
        assert_eq!((report.kept_episodes, report.dropped_bytes), (whole - 1, torn));
        assert_eq!(output, bytes[..boundaries[whole - 1] as usize]);
        if cut % 50 == 0 {
            assert_eq!(repair(&path, &out, None).expect("repaired"), report);
            assert_eq!(fs::read(&out).expect("read"), output);
            fs::remove_file(&out).expect("removed");
        }
    }
}

#[test]
fn a_flipped_bit_is_never_believed() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (_, bytes, episodes, boundaries) = three(folder.path());
    let path = folder.path().join("flipped.demo");
    let masks = [1u8, 2, 4, 8, 16, 32, 64, 128, 0xff];
    for at in 0..bytes.len() {
        let hit = boundaries.iter().filter(|&&b| b <= at as u64).count();
        for mask in masks {
            let mut flipped = bytes.clone();
            flipped[at] ^= mask;
            put(&path, &flipped);
            match read_lenient(&path) {
                Err(error) => assert!(hit == 0 && !error.is_repairable(), "byte {at}: {error}"),
                Ok((read, error)) => {
                    let error = error.expect("damage is reported");
                    assert!(hit > 0 && error.is_repairable(), "byte {at}: {error}");
                    assert_eq!(read, episodes[..hit - 1], "byte {at}");
                }
            }
            if hit > 0 && mask == 0xff {
                let (output, report) = repair_in_memory(&flipped);
                assert_eq!(report.kept_episodes, 2, "byte {at}");
                put(&path, &output);
                let (read, error) = read_lenient(&path).expect("sound");
                assert!(error.is_none() && read.iter().all(|e| episodes.contains(e)), "byte {at}");
            }
        }
    }
}

/// Returns a frame with a valid checksum around any payload.
fn sealed(payload: &[u8]) -> Vec<u8> {
    let mut bytes = crate::demo::file::bytes::FRAME_MAGIC.to_vec();
    bytes.extend_from_slice(&(payload.len() as u32).to_le_bytes());
    bytes.extend_from_slice(payload);
    let crc = crc32fast::hash(&bytes[4..]);
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes
}

#[test]
fn hostile_lengths_and_values_are_errors() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (_, bytes, _, boundaries) = three(folder.path());
    let preamble = &bytes[..boundaries[0] as usize];
    let sound = &bytes[boundaries[0] as usize + 8..boundaries[1] as usize - 4];
    let with = |at: usize, patch: &[u8]| {
        let mut payload = sound.to_vec();
        payload[at..at + patch.len()].copy_from_slice(patch);
        sealed(&payload)
    };
    let path = folder.path().join("hostile.demo");
    let end = 4 + 6 * 4 + 8;
    let nan = f32::NAN.to_le_bytes();
    let last = sound.len() - 4;
    for (frame, words) in [
        ([&crate::demo::file::bytes::FRAME_MAGIC[..], &[0xff; 4], &[0; 64]].concat(), "is cut off"),
        (sealed(&[0xff; 4]), "it ends inside state hashes"),
        (sealed(&[]), "it ends inside the number of steps"),
        (with(0, &u32::MAX.to_le_bytes()), "it ends inside state hashes"),
        (with(end, &[9]), "unknown end reason 9"),
        (with(end + 1, &[5]), "unknown kind of actions 5"),
        (with(end + 1, &[3, 17, 0, 0, 0]), "17 choices at once: at most 16 are possible"),
        (with(end + 1, &[3, 2, 0, 0, 0]), "options"),
        (with(end + 1, &[0, 0xff, 0xff, 0xff, 0xff]), "it ends inside action values"),
        (with(end + 2, &[7]), "unknown coding 7 of actions"),
        (with(end + 3, &[4]), "action 4 at step 0 is out of range"),
        (with(last, &nan), "an observation value at step 5 is NaN"),
        (with(last - 4 * 12, &[0xff; 4]), "it ends inside observation values"),
        (with(last - 4 * 12, &[1, 0, 0, 0]), "24 bytes after the last field"),
        (sealed(&[sound, &[0]].concat()), "1 bytes after the last field"),
    ] {
        fs::write(&path, [preamble, &frame].concat()).expect("written");
        let (read, error) = read_lenient(&path).expect("the header is sound");
        let error = error.expect(words).to_string();
        assert!(read.is_empty() && error.contains(words), "{error} should say: {words}");
        assert!(error.contains("episode 0"), "{error}");
        let out = folder.path().join("repaired.demo");
        assert_eq!(repair(&path, &out, None).expect("repaired").kept_episodes, 0);
        fs::remove_file(out).expect("removed");
    }
}

#[test]
fn appending_goes_on_where_the_file_ended() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = write(folder.path(), "a.demo", &[episode(1, 3)]);
    let exists = DemoWriter::create(&path, header()).expect_err("exists");
    assert!(matches!(exists.fault, DemoFault::Exists), "{exists}");
    {
        let mut writer = DemoWriter::append(&path, &header()).expect("opened");
        assert_eq!(writer.episodes(), 1);
        let busy = DemoWriter::append(&path, &header()).expect_err("locked");
        assert!(matches!(busy.fault, DemoFault::Locked), "{busy}");
        assert!(matches!(DemoWriter::replace(&path, header()).expect_err("locked").fault, DemoFault::Locked));
        writer.push(&episode(2, 3)).expect("written");
        assert_eq!(writer.bytes(), fs::metadata(&path).expect("exists").len());
    }
    let other = DemoHeader { game_version: 9, ..header() };
    let error = DemoWriter::append(&path, &other).expect_err("another version");
    assert!(error.to_string().contains("`game_version` is 2 in the file, but 9 is being recorded"), "{error}");
    assert_eq!(read_lenient(&path).expect("sound").0, [episode(1, 3), episode(2, 3)]);
    drop(DemoWriter::replace(&path, header()).expect("replaced"));
    assert!(read_lenient(&path).expect("sound").0.is_empty());
    let foreign = DemoReader::open_for_game(&path, "coinrun", 2, None).expect_err("another game");
    assert!(foreign.to_string().contains("a.demo: a recording of the game `walk`, not of `coinrun`"), "{foreign}");
    assert!(DemoReader::open_for_game(&path, "walk", 2, Some("easy")).is_ok());
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let missing = folder.path().join("missing").join("a.demo");
    let error = DemoWriter::create(&missing, header()).expect_err("no folder");
    assert!(error.to_string().contains("a.demo: cannot create the file: "), "{error}");
    let error = DemoWriter::append(&missing, &header()).expect_err("no file");
    assert!(matches!(error.fault, DemoFault::Io { action: "open the file", .. }), "{error}");
    assert!(DemoReader::open(folder.path()).is_err(), "a folder is not a file");
    let file = write(folder.path(), "a.demo", &[]);
    assert!(DemoWriter::create(file.join("b.demo"), header()).is_err());
    assert!(repair(&file, missing, None).is_err());
}

#[test]
fn a_tick_takes_about_five_bytes() {
    let steps = 1000;
    let header = DemoHeader::new("coinrun", 1, "easy", 60.0, ActionSpace::Discrete(15));
    let mut bytes = 0;
    for seed in 0..100 {
        let mut one = episode(seed, steps);
        one.actions = Actions::Discrete((0..steps as u32).map(|t| t.wrapping_mul(2_654_435_761) >> 7 & 7).collect());
        one.observations.clear();
        bytes += crate::demo::file::bytes::encode(&one, &header).expect("valid").len();
    }
    assert!(bytes <= 510_000, "100,000 steps take {bytes} bytes");
}

prop_compose! {
    fn any_episode(actions: ActionSpace, width: usize)(steps in 0usize..40)(
        level_seed in any::<u64>(),
        // The smallest choice of `any_recording` has two options.
        discrete in prop::collection::vec(0..match actions {
            ActionSpace::Mixed(_) => 2,
            _ => actions.dim().min(u32::MAX as usize) as u32,
        }, steps * actions.choices().sizes().len().max(1)),
        values in prop::collection::vec(-1e6f32..1e6, steps * actions.numbers()),
        rewards in prop::collection::vec(prop_oneof![4 => Just(0.0f32), 1 => any::<f32>().prop_filter("finite", |v| v.is_finite())], steps),
        state_hashes in prop::collection::vec(any::<u32>(), steps),
        deciders in prop::collection::vec(prop_oneof![
            Just(Decider::Human), Just(Decider::Bot), Just(Decider::Policy), Just(Decider::Replay), Just(Decider::Idle)
        ], steps),
        end in prop_oneof![
            any::<bool>().prop_map(|success| DemoEnd::Terminated { success }), Just(DemoEnd::Truncated), Just(DemoEnd::Aborted)
        ],
        observations in prop::collection::vec(-1e6f32..1e6, steps * width),
    ) -> DemoEpisode {
        let actions = match actions {
            ActionSpace::Discrete(_) => Actions::Discrete(discrete),
            ActionSpace::Continuous(dim) => Actions::Continuous { dim, values },
            ActionSpace::Mixed(space) => {
                Actions::Mixed { choices: space.choices.sizes().len(), options: discrete, dim: space.numbers, values }
            }
        };
        let randomised = Vec::new();
        DemoEpisode { level_seed, level_file: None, randomised, actions, rewards, state_hashes, deciders, end, observations }
    }
}

fn any_recording() -> impl Strategy<Value = (DemoHeader, Vec<DemoEpisode>)> {
    let kinds = prop_oneof![
        (1usize..300).prop_map(ActionSpace::Discrete),
        (65_000usize..66_000).prop_map(ActionSpace::Discrete),
        (1usize..4).prop_map(ActionSpace::Continuous),
        (2usize..5, 0usize..3).prop_map(|(size, numbers)| ActionSpace::mixed([size, 2, 3], numbers)),
    ];
    (kinds, 0usize..3, ".{1,12}", any::<u32>(), 1e-3f64..1e4, ".{0,20}").prop_flat_map(
        |(actions, width, game, game_version, tick_hz, note)| {
            let header = DemoHeader {
                observation_names: (0..width).map(|i| format!("{note} {i}")).collect(),
                note,
                ..DemoHeader::new(&game, game_version, "any \"mode\"", tick_hz, actions)
            };
            (Just(header), prop::collection::vec(any_episode(actions, width), 0..4))
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_is_written_reads_back((header, episodes) in any_recording()) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("any.demo");
        let mut writer = DemoWriter::create(&path, header.clone()).expect("created");
        for episode in &episodes {
            writer.push(episode).expect("written");
        }
        let reader = DemoReader::open(&path).expect("sound");
        prop_assert_eq!(reader.header(), &header);
        prop_assert_eq!(reader.read_all().expect("sound"), episodes);
    }

    #[test]
    fn arbitrary_payloads_never_panic(payload in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = crate::demo::file::bytes::decode(&payload, &header());
    }

    #[test]
    fn arbitrary_files_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = crate::demo::file::preamble::decode(bytes.as_slice());
        let _ = crate::demo::file::preamble::decode([DEMO_MAGIC.as_bytes(), &bytes].concat().as_slice());
    }
}

#[test]
fn numbers_by_hand() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let lost = |seed, steps, end| crate::demo::file::episode::DemoEpisode {
        end,
        rewards: vec![0.0; steps],
        ..episode(seed, steps)
    };
    let episodes = [
        episode(7, 4),
        lost(7, 6, DemoEnd::Terminated { success: false }),
        lost(9, 10, DemoEnd::Truncated),
        lost(9, 0, DemoEnd::Truncated),
        lost(2, 0, DemoEnd::Aborted),
    ];
    let summary = DemoSummary::read(write(folder.path(), "a.demo", &episodes)).expect("sound");
    assert_eq!((summary.episodes, summary.steps, summary.levels), (5, 20, 3));
    assert_eq!((summary.successes, summary.failures, summary.truncated, summary.aborted), (1, 1, 2, 1));
    assert_eq!((summary.success_share, summary.return_mean, summary.length_mean), (Some(0.25), Some(2.0), Some(4.0)));
    assert_eq!((summary.level_seed_min, summary.level_seed_max), (Some(2), Some(9)));
    let deciders: Vec<_> = summary.steps_by_decider.clone().into_iter().collect();
    assert_eq!(deciders, [(Decider::Human, 6), (Decider::Bot, 14)]);
    let json = serde_json::to_string(&summary).expect("serialises");
    assert_eq!(serde_json::from_str::<DemoSummary>(&json).expect("reads back"), summary);
    assert!(json.contains("\"success_share\":0.25"), "{json}");
}

#[test]
fn an_empty_recording_has_no_means() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let summary = DemoSummary::read(write(folder.path(), "a.demo", &[])).expect("sound");
    assert_eq!((summary.episodes, summary.success_share, summary.level_seed_min), (0, None, None));
}

#[test]
fn folders_are_searched_in_order() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let root = folder.path();
    fs::create_dir_all(root.join("b/deep")).expect("created");
    fs::create_dir_all(root.join("folder.demo")).expect("created");
    for name in ["z.demo", "b/deep/1.demo", "a.demo", "a.demo.bak", "notes.txt"] {
        fs::write(root.join(name), "").expect("written");
    }
    let found = find_demos(root).expect("found");
    assert_eq!(found, ["a.demo", "b/deep/1.demo", "z.demo"].map(|n| root.join(n)));
    assert_eq!(find_demos(root.join("z.demo")).expect("a file"), [root.join("z.demo")]);
}

#[test]
fn nothing_is_an_error() {
    let folder = tempfile::tempdir().expect("temporary folder");
    assert!(matches!(find_demos(folder.path()).expect_err("empty").fault, DemoFault::NoDemos));
    let missing = find_demos(folder.path().join("missing")).expect_err("missing");
    assert!(matches!(missing.fault, DemoFault::Io { .. }), "{missing}");
}

fn write_as(folder: &Path, name: &str, header: DemoHeader, episodes: &[DemoEpisode]) -> PathBuf {
    let path = folder.join(name);
    let mut writer = DemoWriter::create(&path, header).expect("created");
    episodes.iter().for_each(|episode| writer.push(episode).expect("written"));
    path
}

#[test]
fn all_episodes_of_all_testers_are_in_the_merged_file() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (a, b, c) = (episode(1, 5), episode(2, 3), episode(3, 4));
    let one = write(folder.path(), "one.demo", &[a.clone(), b.clone()]);
    let zoe = DemoHeader { demonstrator: "zoë".into(), note: "on the train".into(), ..header() };
    let two = write_as(folder.path(), "two.demo", zoe, std::slice::from_ref(&c));
    let out = folder.path().join("all.demo");
    let report = merge_demos(&[&one, &two], &out).expect("merges");
    assert_eq!((report.episodes(), report.steps), (3, 12));
    assert_eq!(report.files, [(one, 2), (two, 1)]);
    let reader = DemoReader::open(&out).expect("readable");
    assert_eq!(reader.header().demonstrator, "tester, zoë");
    assert_eq!(reader.header(), &report.header);
    assert_eq!(reader.read_all().expect("whole"), [a, b, c]);
}

#[test]
fn episodes_that_another_file_has_too_are_counted() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (a, b) = (episode(1, 5), episode(2, 3));
    // The same episode again in one file is what its player did.
    let one = write(folder.path(), "one.demo", &[a.clone(), b.clone(), b]);
    let named = DemoHeader { demonstrator: "zoë".into(), ..header() };
    let other = DemoEpisode { level_seed: 3, ..a.clone() };
    let two = write_as(folder.path(), "two.demo", named, &[a.clone(), other]);
    let report = merge_demos(&[&one, &two], folder.path().join("all.demo")).expect("merges");
    assert_eq!((report.episodes(), report.equal_episodes), (5, 1));
    let alone = merge_demos(&[&one], folder.path().join("alone.demo")).expect("merges");
    assert_eq!(alone.equal_episodes, 0);
    let mut turned = a;
    let Actions::Discrete(list) = &mut turned.actions else { panic!("they are numbers") };
    list[0] ^= 1;
    let three = write(folder.path(), "three.demo", &[turned]);
    assert_eq!(merge_demos(&[&one, &three], folder.path().join("more.demo")).expect("merges").equal_episodes, 0);
}

#[test]
fn added_episodes_that_were_there_before_are_counted() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (a, b, c) = (episode(1, 5), episode(2, 3), episode(3, 4));
    let file = write(folder.path(), "one.demo", &[a.clone(), b.clone(), c.clone(), c, b, a]);
    // Equal ones among the added count only if they were there before.
    assert_eq!([0, 1, 2, 3, 4, 6].map(|added| repeated_episodes(&file, added).expect("whole")), [0, 1, 2, 3, 2, 0]);
    repeated_episodes(folder.path().join("none.demo"), 1).expect_err("no such file");
}

#[test]
fn files_that_do_not_belong_together_are_refused_by_name_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let one = write(folder.path(), "one.demo", &[episode(1, 5)]);
    let out = folder.path().join("all.demo");
    for (name, other, words) in [
        ("game", DemoHeader { game: "maze".into(), ..header() }, "`maze`, not of `walk`"),
        ("version", DemoHeader { game_version: 3, ..header() }, "version 3 of `walk`, but this is version 2"),
        ("mode", DemoHeader { mode: "hard".into(), ..header() }, "mode `hard`"),
        ("rate", DemoHeader { tick_hz: 30.0, ..header() }, "`tick_hz` is 30.0, but 60.0 in"),
        ("actions", DemoHeader { actions: ActionSpace::Discrete(5), ..header() }, "`actions` is Discrete(5)"),
        (
            "noise",
            DemoHeader { action_noise: 0.5, ..header() },
            "one.demo: put both into one folder, from which `learn-skills` and `train` learn without a merge \
             (--set demos=FOLDER)",
        ),
    ] {
        let path = write_as(folder.path(), name, other, &[]);
        let error = merge_demos(&[&one, &path], &out).expect_err(name);
        assert_eq!(error.path, path);
        assert!(error.to_string().contains(words), "{error}");
        assert!(!out.exists(), "{name}");
    }
}

#[test]
fn a_damaged_file_leaves_no_half_merge_behind() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let one = write(folder.path(), "one.demo", &[episode(1, 5)]);
    let two = write(folder.path(), "two.demo", &[episode(2, 5)]);
    let bytes = std::fs::read(&two).expect("readable");
    std::fs::write(&two, &bytes[..bytes.len() - 3]).expect("writable");
    let out = folder.path().join("all.demo");
    let error = merge_demos(&[&one, &two], &out).expect_err("torn");
    assert!(error.is_repairable() && error.path == two, "{error}");
    assert!(!out.exists());
}

#[test]
fn the_same_file_twice_no_file_and_an_existing_one_are_errors() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let one = write(folder.path(), "one.demo", &[episode(1, 5)]);
    let out = folder.path().join("all.demo");
    let twice = merge_demos(&[&one, &folder.path().join("./one.demo")], &out).expect_err("twice");
    assert!(matches!(twice.fault, DemoFault::NamedTwice), "{twice}");
    let copy = folder.path().join("copy.demo");
    fs::copy(&one, &copy).expect("writable");
    let copied = merge_demos(&[&one, &copy], &out).expect_err("a copy");
    assert!(matches!(&copied.fault, DemoFault::CopyOf(of) if *of == one) && copied.path == copy, "{copied}");
    assert!(!out.exists());
    let nothing = merge_demos(&[] as &[&Path], &out).expect_err("nothing");
    assert!(matches!(nothing.fault, DemoFault::NothingToMerge), "{nothing}");
    let exists = merge_demos(&[&one], &one).expect_err("exists");
    assert!(matches!(exists.fault, DemoFault::Exists), "{exists}");
    assert_eq!(DemoReader::open(&one).and_then(DemoReader::read_all).expect("left alone").len(), 1);
}
