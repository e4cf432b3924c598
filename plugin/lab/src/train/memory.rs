//! How much memory a training needs, so that nobody finds out when the machine stands still.

use std::fs;

use super::config::{Experiment, ExperimentError, LearnerKind};
use crate::game::Game;
use crate::sensors::GameSensors;

/// What a training may take where the system does not say how much is free.
const USUAL: u64 = 16 << 30;

impl Experiment {
    /// Checks that what a training keeps fits into the memory that is free: rollouts, and the replay buffer of SAC. What
    /// the networks compute with is not counted.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Memory`] with the sum and the keys to lower.
    pub fn check_memory(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        if self.algorithm.is_trained() { self.check_memory_within(game, free()) } else { Ok(()) }
    }

    fn check_memory_within(&self, game: &dyn Game, free: u64) -> Result<(), ExperimentError> {
        let kind = self.observation_config().obs_kind(game);
        let is_image = self.observation_config().is_image();
        let observation = kind.numbers() as u64 * if is_image { 1 } else { 4 };
        let (arenas, steps) = (u64::from(self.arenas), self.rollout_steps() as u64);
        let rollouts = product(&[arenas, steps, observation]);
        if rollouts > free {
            let learner = self.algorithm.learner().key();
            let image = if is_image { ", `image.width`, `image.height` or `image.stack`" } else { "" };
            return Err(ExperimentError::Memory {
                what: format!("rollouts of {arenas} arenas × {steps} steps × {observation} bytes"),
                needed: rollouts,
                free,
                keys: format!("`arenas`, `{learner}.num_steps`{image}"),
            });
        }
        match self.algorithm.learner() {
            LearnerKind::Ppo => Ok(()),
            LearnerKind::Sac => self.check_replay_buffer(observation, rollouts, free),
        }
    }

    /// Checks that the replay buffer fits beside the rollouts, in bytes of `observation`s.
    fn check_replay_buffer(&self, observation: u64, rollouts: u64, free: u64) -> Result<(), ExperimentError> {
        let transitions = (self.sac.buffer as u64).min(self.steps);
        let replay = product(&[transitions, 2, observation]);
        if replay.saturating_add(rollouts) > free {
            return Err(ExperimentError::Memory {
                what: format!("the slots of a replay buffer of {transitions} transitions × 2 × {observation} bytes"),
                needed: replay,
                free,
                keys: "`sac.buffer`".to_owned(),
            });
        }
        Ok(())
    }
}

fn product(factors: &[u64]) -> u64 {
    factors.iter().fold(1, |product, factor| product.saturating_mul(*factor))
}

/// Free memory in bytes: on Linux what the kernel calls available, and no more than the limit of a container. A number
/// of our own would refuse what a large machine can do, or let a small one thrash.
fn free() -> u64 {
    let available = fs::read_to_string("/proc/meminfo").ok().and_then(|text| available_in(&text)).unwrap_or(USUAL);
    let limit = fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    available.min(limit.unwrap_or(u64::MAX))
}

/// The line `MemAvailable:   123456 kB`.
fn available_in(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bevy::prelude::*;

    use super::*;
    use crate::train::config_file::parse_experiment;
    use bevy_playbot::{action::ActionSpace, observation::ObservationSpace};

    /// A game of ten numbers.
    struct Ten;

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
    }

    fn check(algorithm: &str, changes: &str, free: u64) -> Result<(), String> {
        let text = format!(
            r#"(game: "ten", train: "a:0..3", test: "a:4..7", steps: 9000, arenas: 64, algorithm: "{algorithm}", {changes})"#
        );
        let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
        experiment.check_memory_within(&Ten, free).map_err(|error| error.to_string())
    }

    #[test]
    fn rollouts_must_fit() {
        // 64 arenas × 256 steps × 40 bytes = 640 KiB, which all Worlds share.
        assert_eq!(check("ppo", "worlds: 2", 640 << 10), Ok(()));
        let text = check("ppo", "worlds: 2", 639 << 10).expect_err("too large");
        assert!(text.contains("64 arenas × 256 steps × 40 bytes"), "{text}");
        let pictures = "observation: Raster, image: (width: 512, height: 512, stack: 8)";
        let text = check("ppo", pictures, 16 << 30).expect_err("96 GiB");
        for words in ["64 arenas × 256 steps × 6291456 bytes", "96.0 GiB", "16.0 GiB", "`image.stack`"] {
            assert!(text.contains(words), "{text}");
        }
    }

    #[test]
    fn the_replay_buffer_must_fit_as_far_as_it_is_filled() {
        // 9000 transitions × 80 bytes = 703 KiB, and a rollout of one tick.
        let sac = "worlds: 1, sac: (num_steps: 1, buffer: 1000000)";
        assert_eq!(check("sac", sac, 720 << 10), Ok(()));
        let text = check("sac", sac, 700 << 10).expect_err("too large");
        assert!(text.contains("9000 transitions × 2 × 40 bytes") && text.contains("`sac.buffer`"), "{text}");
    }

    #[test]
    fn the_kernel_says_what_is_available() {
        let text = "MemTotal:       16384000 kB\nMemFree:          100 kB\nMemAvailable:    2048 kB\n";
        assert_eq!((available_in(text), available_in("MemFree: 3 kB")), (Some(2 << 20), None));
    }
}
