//! The program of a foreign game.

use std::fs;

use crate::shell::Shell;

/// A program with one foreign game, and the facts that tests of its verbs need. Each of its other functions is a test,
/// and fails by panicking.
#[derive(Clone, Copy, Debug)]
pub struct GameProgram {
    /// The program: `env!("CARGO_BIN_EXE_…")`.
    pub program: &'static str,
    /// The folder of its `experiment.ron`: `env!("CARGO_MANIFEST_DIR")`.
    pub folder: &'static str,
    /// Name of the game.
    pub game: &'static str,
    /// Name of its demonstrator.
    pub demonstrator: &'static str,
    /// A key of the game, by its name in xdotool.
    pub key: &'static str,
    /// The first of three levels to record.
    pub recorded: u64,
    /// Levels that policies are measured on.
    pub held_out: &'static str,
    /// Ticks that are recorded of each level, where whole episodes take too long for most tests.
    pub recorded_ticks: Option<&'static str>,
}

/// Updates of a training.
pub(crate) const UPDATES: usize = 40;

/// Settings that shorten an experiment to seconds.
const SMALL: [&str; 11] = [
    "demos=few.demo",
    "arenas=2",
    "worlds=2",
    "skills.epochs=2",
    "skills.hidden=[16]",
    "skills.encoder_hidden=8",
    "skills.gru_hidden=8",
    "skills.latent=4",
    "ppo.num_steps=64",
    "ppo.minibatches=2",
    "checkpoints.every=2",
];

/// Settings that shorten an experiment to a second. Nothing is learned.
const TINY: [&str; 14] = [
    "demos=few.demo",
    "demo_steps=200",
    "arenas=2",
    "worlds=2",
    "steps=64",
    "skills.epochs=1",
    // Short recordings are learned from, too.
    "skills.window=2",
    "skills.hidden=[8]",
    "skills.encoder_hidden=4",
    "skills.gru_hidden=4",
    "skills.latent=2",
    "ppo.num_steps=16",
    "ppo.epochs=1",
    "ppo.minibatches=1",
];

impl GameProgram {
    /// Returns a shell in whose folder lies `few.demo`, of whole episodes on three levels.
    pub(crate) fn with_whole_recording(&self) -> Shell {
        let shell = Shell::new(self.program);
        let levels = format!("default:{}..{}", self.recorded, self.recorded + 2);
        shell.done(&["record", self.game, "--levels", &levels, "--noise", "0.1", "--out", "few.demo"]);
        shell
    }

    /// Returns the same, with no more of each level than the game's `recorded_ticks`.
    pub(crate) fn with_recording(&self) -> Shell {
        let Some(ticks) = self.recorded_ticks else { return self.with_whole_recording() };
        let shell = Shell::new(self.program);
        let parts = [0, 1, 2].map(|place| format!("part-{place}.demo"));
        for (level, part) in (self.recorded..).zip(&parts) {
            let levels = format!("default:{level}..{level}");
            let record = ["record", self.game, "--levels", &levels, "--noise", "0.1", "--steps", ticks, "--out", part];
            shell.done(&record);
        }
        let [first, second, third] = &parts;
        shell.done(&["demo", "merge", first, second, third, "--out", "few.demo"]);
        shell
    }

    /// Returns a shell with `few.demo`, `small.ron`, the game's own experiment made small, and the model learned from
    /// both, `skills.safetensors`, in its folder.
    pub(crate) fn with_skills(&self) -> Shell {
        let shell = self.with_recording();
        let (steps, test) = (format!("steps={}", UPDATES * 2 * 64), format!("test={}", self.held_out));
        self.write_experiment(&shell, "small.ron", &[&SMALL[..], &[&steps, &test]].concat());
        let learn = ["learn-skills", "--experiment", "small.ron", "--out", "skills.safetensors", "--json"];
        let epochs = shell.answers(&learn);
        assert_eq!(epochs.len(), 2, "one line for each epoch: {epochs:?}");
        assert!(epochs.iter().all(|epoch| epoch["loss"].as_f64().is_some_and(f64::is_finite)), "{epochs:?}");
        shell
    }

    /// Returns a shell with `few.demo` and `tiny.ron`, the game's own experiment made tiny, in its folder.
    pub(crate) fn with_tiny_experiment(&self) -> Shell {
        let shell = self.with_recording();
        let first = self.held_out.split("..").next().unwrap_or(self.held_out);
        self.write_experiment(&shell, "tiny.ron", &[&TINY[..], &[&format!("test={first}")]].concat());
        shell
    }

    /// Writes the game's own experiment, with other settings.
    fn write_experiment(&self, shell: &Shell, name: &str, sets: &[&str]) {
        let own = format!("{}/experiment.ron", self.folder);
        let sets = sets.iter().flat_map(|set| ["--set", *set]);
        let show: Vec<&str> = ["config", "show", "--experiment", &own].into_iter().chain(sets).collect();
        fs::write(shell.path(name), shell.done(&show)).expect("writable");
    }
}
