//! A game of one's own, and all steps from recordings to a shipped policy as functions, without the command line.
//!
//! `cargo run --release -p playbot --example lander -- plugin/examples/lander.policy` writes the policy with which
//! `bevy_playbot`'s example `lander_window` ships; without a path it is thrown away.

#![allow(clippy::print_stdout, reason = "an example shows its results")]

#[path = "../../examples/lander_rules/rules.rs"]
pub mod lander_rules;

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use playbot::harness::{
    demo::verify_file,
    eval::{EvalSummary, Player},
    game::BotTools,
    parallel::default_threads,
};
use playbot::learner::DeviceKind;
use playbot::prelude::*;
use playbot::train::{
    Experiment, UpdateReport,
    experiment::file::parse_experiment,
    pipeline,
    policy_export::export_policy,
    run_observer::{AfterUpdate, Unobserved},
    train_run::TrainingSetup,
};

use lander_rules::{Capsule, OBSERVATION, TICK_HZ, add_rules, capsule};

/// The experiment: the game that is learned, its levels, the method, and the duration.
pub const EXPERIMENT: &str = r#"(
    game: "lander", train: "moon:0..63", test: "moon:64..127", steps: 400000, arenas: 16, worlds: 2,
    skills: (window: 5, latent: 4, epochs: 20, hidden: [32, 32], encoder_hidden: 32, gru_hidden: 32),
    ppo: (num_steps: 64, minibatches: 4, hidden: [32, 32]),
    score: (horizon: 5),
)"#;

/// The game, as the harness knows it.
#[derive(Clone, Copy)]
pub struct Lander;

impl Game for Lander {
    fn name(&self) -> &'static str {
        "lander"
    }
    fn version(&self) -> u32 {
        1
    }
    fn modes(&self) -> &'static [&'static str] {
        &["moon"]
    }
    fn tick_hz(&self) -> f64 {
        TICK_HZ
    }
    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(2)
    }
    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: OBSERVATION.map(String::from).into() }
    }
    fn build(&self, app: &mut App, _mode: &str) {
        add_rules(app);
        app.add_systems(FixedPreUpdate, pilot.in_set(PlaybotSystems::Decide));
    }
    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        world.spawn(capsule(index)).id()
    }
    fn tools(&self) -> GameTools<'_> {
        GameTools { bots: self, ..GameTools::default() }
    }
}

impl BotTools for Lander {
    fn demonstrator(&self) -> Option<&'static str> {
        Some("pilot")
    }
}

/// A careful pilot: burns whenever the capsule falls faster than its height allows.
fn pilot(mut agents: Query<(&Control, &Capsule, &mut Action), Without<BlindBot>>) {
    for (control, capsule, mut action) in &mut agents {
        if *control == Control::Bot {
            let allowed = -1.0 - 0.2 * capsule.height;
            action.0 = ActionValue::Discrete(u32::from(capsule.speed < allowed));
        }
    }
}

/// Records the pilot on these levels, learns from that as the experiment says, and writes the policy. Returns the
/// results of the policy and of a bot that does not look, on levels that the policy has not seen.
///
/// # Errors
///
/// One of the steps failed.
pub fn all_steps(experiment: &str, demos: &str, policy: &Path) -> Result<[EvalSummary; 2], Box<dyn std::error::Error>> {
    let (device, threads) = (DeviceKind::default(), default_threads());
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("pilot.demo");
    let experiment =
        Experiment { demos: Some(recording.clone()), ..parse_experiment(experiment, "lander.ron".as_ref())? };
    experiment.check()?;

    let episodes = pipeline::record(&Lander, &demos.parse()?, 0.0, &recording)?;
    let differing = verify_file(&Lander, &recording, |_| {})?.divergences.len();
    println!("{episodes} episodes recorded, {differing} of them replay differently");

    let setup = TrainingSetup::new(device, threads);
    let (file, run) = (folder.path().join("skills.safetensors"), folder.path().join("run"));
    let skills = pipeline::learn_skills(&Lander, &experiment, &file, &setup, &mut Unobserved)?;
    let mut observer = AfterUpdate(|report: &UpdateReport| {
        if let Some(success) = report.success_rate.filter(|_| report.update.is_multiple_of(10)) {
            println!("{} steps: {:.0} % of the last episodes landed softly", report.step, 100.0 * success);
        }
    });
    let trainer = pipeline::train(&Lander, &experiment, Some((&file, &skills)), &run, &setup, &mut observer)?;

    let file = pipeline::policy(&Lander, &trainer);
    export_policy(&Lander, &file, &experiment.train, experiment.seed, policy)?;
    let player = Player::of_file(&file, ActionDraw::Sample);
    let measure = |name, player| pipeline::evaluate(&Lander, &experiment, name, player, trainer.seen(), threads);
    Ok([measure("SCORE-PPO", &player)?, measure("random", &Player::Blind(BlindBot::Uniform))?])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let policy = std::env::args_os().nth(1).map_or_else(|| folder.path().join("lander.policy"), PathBuf::from);
    for summary in all_steps(EXPERIMENT, "moon:128..200", &policy)? {
        println!("{}: {:.0} % landed softly on {}", summary.method, 100.0 * summary.success, summary.split);
    }
    Ok(())
}
