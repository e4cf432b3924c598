//! Tests of the memory check: small experiments pass, large ones are refused before allocation.

use crate::experiment::{checks::*, file::parse_experiment};
use bevy::prelude::*;
use bevy_playbot::{action::ActionSpace, observation::ObservationSpace};
use playbot_harness::game::{GameTools, HostTools};
use std::path::Path;

/// A game with observations of ten numbers.
struct Ten {
    arenas_per_world: Option<u32>,
}

const TEN: Ten = Ten { arenas_per_world: None };

/// The game with one arena per World.
const ALONE: Ten = Ten { arenas_per_world: Some(1) };

impl Game for Ten {
    fn name(&self) -> &'static str {
        "ten"
    }
    fn version(&self) -> u32 {
        1
    }
    fn modes(&self) -> &'static [&'static str] {
        &["a"]
    }
    fn tick_hz(&self) -> f64 {
        15.0
    }
    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(2)
    }
    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: (0..10).map(|i| i.to_string()).collect() }
    }
    fn build(&self, _app: &mut App, _mode: &str) {}
    fn spawn_agent(&self, world: &mut World, _index: u32) -> Entity {
        world.spawn_empty().id()
    }
    fn tools(&self) -> GameTools<'_> {
        GameTools { host: self, ..GameTools::default() }
    }
}

impl HostTools for Ten {
    fn arenas_per_world(&self) -> Option<u32> {
        self.arenas_per_world
    }
}

/// Makes a machine with this memory, and enough threads.
fn machine(memory: u64) -> Room {
    Room { memory, threads: ThreadLimit { most: u64::MAX, whose: "no limit" } }
}

fn check(algorithm: &str, changes: &str, free: u64) -> Result<(), String> {
    check_on(&TEN, algorithm, changes, &machine(free))
}

fn check_on(game: &dyn Game, algorithm: &str, changes: &str, room: &Room) -> Result<(), String> {
    let arenas = if changes.contains("arenas") { "" } else { "arenas: 64," };
    let text = format!(
        r#"(game: "ten", train: "a:0..3", test: "a:4..7", steps: 90000, {arenas} algorithm: "{algorithm}", {changes})"#
    );
    let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
    experiment.check_memory_within(game, room).map_err(|error| error.to_string())
}

#[test]
fn rollouts_must_fit() {
    // 64 arenas × 4096 steps × 40 bytes = 10 MiB, which all Worlds share, and less than that of everything else.
    let long = "worlds: 2, ppo: (num_steps: 4096, minibatches: 4096)";
    assert_eq!(check("ppo", long, 20 << 20), Ok(()));
    let text = check("ppo", long, 9 << 20).expect_err("too large");
    assert!(text.contains("64 arenas × 4096 steps × 40 bytes need"), "{text}");
    let text = check("ppo", long, 10 << 20).expect_err("too large with the rest");
    assert!(text.contains("40 bytes, and what else is kept, need"), "{text}");
    let pictures = "observation: Raster, image: (width: 512, height: 512, stack: 8)";
    let text = check("ppo", pictures, 16 << 30).expect_err("96 GiB");
    for words in ["64 arenas × 256 steps × 6291456 bytes", "96.0 GiB", "16.0 GiB", "`image.stack`"] {
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn the_replay_buffer_must_fit_as_far_as_it_is_filled() {
    // 90,000 transitions × 80 bytes = 6.9 MiB, a World of 1 MiB, and a rollout of one tick.
    let sac = "worlds: 1, sac: (num_steps: 1, buffer: 1000000, hidden: [8], batch: 8)";
    assert_eq!(check("sac", sac, 9 << 20), Ok(()));
    let text = check("sac", sac, 6 << 20).expect_err("too large");
    assert!(text.contains("90000 transitions × 2 × 40 bytes") && text.contains("`sac.buffer`"), "{text}");
}

#[test]
fn worlds_must_fit_with_their_threads() {
    // Each World takes 1 MiB, and each arena 1 KiB.
    let many = "arenas: 1000, worlds: 1000, ppo: (num_steps: 1, minibatches: 1, hidden: [8])";
    assert_eq!(check("ppo", many, 1010 << 20), Ok(()));
    let text = check("ppo", many, 990 << 20).expect_err("too large");
    assert!(text.contains("1000 Worlds with 1000 arenas need 1001.0 MiB, and 990.0 MiB") && text.contains("`worlds`"));
    // Each World needs a thread, and the machine limits threads.
    let limited = |most| Room { threads: ThreadLimit { most, whose: "the kernel" }, ..machine(u64::MAX) };
    assert_eq!(check_on(&TEN, "ppo", many, &limited(1000)), Ok(()));
    let text = check_on(&TEN, "ppo", many, &limited(999)).expect_err("too many");
    assert!(
        text.starts_with("`worlds` is 1000: ") && text.contains("the kernel leaves room for 999 threads"),
        "{text}"
    );
    let one = "arenas: 1000, worlds: 1, ppo: (num_steps: 1, minibatches: 1, hidden: [8])";
    assert_eq!(check_on(&TEN, "ppo", one, &limited(0)), Ok(()), "it plays on the thread that is there");
    let text = check_on(&ALONE, "ppo", one, &limited(999)).expect_err("a World for each arena");
    assert!(text.starts_with("`arenas` is 1000: 1000 Worlds play on a thread each"), "{text}");
}

#[test]
fn no_size_is_too_large_to_be_added_up() {
    let most = u64::MAX;
    for (algorithm, changes, key) in [
        ("ppo", format!("ppo: (hidden: [{most}])"), "`ppo.hidden`"),
        ("ppo", format!("ppo: (hidden: [{most}, {most}])"), "`ppo.hidden`"),
        ("sac", format!("sac: (batch: {most})"), "`sac.batch`"),
        ("sac", format!("sac: (critics: {most})"), "`sac.critics`"),
        ("rlpd", format!("rlpd: (critics: {most}), demos: \"d\""), "`rlpd.critics`"),
        ("score-ppo", "skills: (latent: 4294967295), demos: \"d\"".to_owned(), "`skills.latent`"),
        ("score-ppo", "skills: (gru_hidden: 4294967295), demos: \"d\"".to_owned(), "`skills.gru_hidden`"),
        ("score-ppo", "skills: (gru_layers: 4294967295), demos: \"d\"".to_owned(), "`skills.gru_layers`"),
        ("score-ppo", "skills: (hidden: [4294967295]), demos: \"d\"".to_owned(), "`skills.hidden`"),
        ("bc", format!("skills: (batch: {most}, window: {most}), demos: \"d\""), "`skills.batch`"),
        ("ppo", format!("observation: Raster, ppo: (cnn: Impala(channels: [{most}]))"), "`ppo.cnn`"),
        ("ppo", format!("observation: Raster, ppo: (cnn: Nature(feature: {most}))"), "`ppo.cnn`"),
        ("bc", format!("observation: Raster, skills: (cnn: Nature(feature: {most})), demos: \"d\""), "`skills.cnn`"),
        ("ppo", "arenas: 400000, worlds: 400000, ppo: (num_steps: 1, minibatches: 1)".to_owned(), "`worlds`"),
    ] {
        let text = check(algorithm, &changes, 16 << 30).expect_err(&changes);
        assert!(text.contains(key), "{changes}: {text}");
    }
}

#[test]
fn numbers_of_convolutions_are_those_of_the_networks_without_their_offsets() {
    let image = ImageShape { channels: 3, height: 64, width: 64 };
    // 3 → 16 → 32 → 32 channels, and 32 × 8 × 8 numbers to 256 features.
    let stages = [3 * 16 + 4 * 16 * 16, 16 * 32 + 4 * 32 * 32, 32 * 32 + 4 * 32 * 32].map(|weights| 9 * weights);
    let expected = stages.iter().sum::<u64>() + 32 * 8 * 8 * 256;
    assert_eq!(convolution_numbers(&CnnKind::default(), image), expected);
}
