//! Tests of sensors that fit and of sensors that do not.

use bevy_playbot::vision::{ImageOptions, ObservationConfig, ObservationKind, VisionError};
use playbot::prelude::*;
use playbot_harness::worlds::build_observing_world;
use playbot_learner::{DeviceKind, Observations};
use playbot_tests::{Corridor, PaintedCorridor, training::untrained};
use playbot_train::{Experiment, TrainError, Trainer, collect::Collector};

use super::corridor::{experiment, record, skills};

#[test]
fn an_observation_does_not_depend_on_the_agents_beside_it() {
    let (observation_config, levels) = (experiment().observation_config(), experiment().train);
    let policy = untrained(&PaintedCorridor, &observation_config, experiment().ppo);
    let play = |first, count| {
        let mut collector =
            Collector::new(&PaintedCorridor, &levels, &observation_config, 1, first, count, None).expect("fits");
        // The state after the first rollout is observed twice.
        let parts = [19, 45].map(|steps| collector.collect(&policy, 0, steps).expect("sound").0);
        let rows = parts.map(|part| {
            let width = part.obs_kind.numbers();
            move |agent: usize| {
                let row = |t: usize| part.obs.row(t * part.envs + agent, width);
                let mut rows = Observations::empty(&part.obs_kind);
                (0..part.steps).for_each(|t| rows.push(row(t)).expect("one kind"));
                (rows, part.truncated.iter().any(|cut| *cut))
            }
        });
        move |agent: usize| rows.each_ref().map(|of| of(agent))
    };
    let together = play(0, 4);
    for agent in 0..4 {
        let (alone, beside) = (play(agent, 1)(0), together(agent as usize));
        for (alone, beside) in alone.iter().zip(&beside) {
            assert!(alone.0 == beside.0, "agent {agent} sees something else alone");
        }
        assert!(beside.iter().any(|(_, cut)| *cut), "time has to run out for somebody, or nothing is tested");
    }
}

#[test]
fn sensors_that_do_not_fit_are_refused_with_advice() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let skills = skills(folder.path());
    let refuse = |change: fn(&mut Experiment), game: &dyn Game| {
        let mut experiment = experiment();
        change(&mut experiment);
        let made = Trainer::new(game, &experiment, Some(&skills), DeviceKind::Flex, 1);
        made.err().expect("must be refused")
    };
    for (change, words) in [
        ((|e| e.observation = ObservationKind::Vector) as fn(&mut Experiment), "say vectors"),
        (|e| e.observation = ObservationKind::Camera, "pictures of the camera"),
        (|e| (e.image.stack, e.image.grayscale) = (2, false), "16×16 colour pictures of the raster, 2 in a stack"),
        (|e| e.image.paint_velocity = true, "with painted velocity"),
    ] {
        let error = refuse(change, &PaintedCorridor);
        assert!(matches!(error, TrainError::SkillObservation { .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains(words) && text.contains("playbot learn-skills"), "{text}");
    }
    let error = refuse(|_| {}, &Corridor);
    assert!(matches!(error, TrainError::Vision(VisionError::NoPicture { game: "corridor" })), "{error}");
    let error = refuse(|e| e.image.width = 0, &PaintedCorridor).to_string();
    assert!(error.contains("width is 0"), "{error}");
}

#[test]
fn a_policy_says_which_sensor_it_needs() {
    let observation_config = experiment().observation_config();
    let untrained =
        |observation_config: &ObservationConfig| untrained(&PaintedCorridor, observation_config, experiment().ppo);
    let colour = ObservationConfig {
        image: ImageOptions { grayscale: false, ..observation_config.image },
        ..observation_config
    };
    for (policy, observation_config, words) in [
        (
            untrained(&observation_config),
            ObservationConfig::default(),
            ["images of 4 channels", "gives 2 observation values", "a sensor that makes"],
        ),
        (
            untrained(&ObservationConfig::default()),
            observation_config,
            ["made for 2 observation values", "gives images of 4 channels", "`VectorSensor`"],
        ),
        (
            untrained(&colour),
            observation_config,
            ["images of 12 channels", "gives images of 4 channels", "`ImageOptions`"],
        ),
    ] {
        let (mut world, agents) =
            build_observing_world(&PaintedCorridor, "plain", &observation_config, 0, 0, 1).expect("drawable");
        world.insert_resource(ActivePolicy { policy, draw: ActionDraw::Sample });
        world.entity_mut(agents[0]).insert(Control::Policy);
        let fault = world.tick().expect_err("does not fit").to_string();
        assert!(words.iter().all(|words| fault.contains(words)), "{fault}");
    }
}
