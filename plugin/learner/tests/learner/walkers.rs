//! Skills of walking straight ahead, without knowledge of a goal.

use crate::field::{OBS, Point, SPACE, WALK};
use playbot_learner::rng::{Streams, normal, unit};
use playbot_learner::{Actions, Dataset, DatasetEpisode, DeviceKind, SkillConfig, SkillModel, SkillTrainer};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Returns a skill model of walks in directions that change every ten ticks and are independent of the goal.
pub fn skills_of_directions() -> SkillModel {
    let mut rng = Streams::new(5).stream("walks", 0);
    let episodes = (0..60).map(|_| {
        let mut walker = Point::new(&mut rng);
        let (mut obs, mut actions) = (Vec::new(), Vec::new());
        for tick in 0..30 {
            let angle = if tick % 10 == 0 { TAU * unit(&mut rng) } else { f64::NAN };
            if angle.is_finite() {
                walker.goal = [angle.cos() as f32, angle.sin() as f32];
            }
            let mut noisy = |x: f32| 0.8 * x + 0.1 * normal(&mut rng);
            let action = [noisy(walker.goal[0]), noisy(walker.goal[1])];
            // Its direction is not part of its observation.
            let [x, y, ..] = walker.observe();
            obs.extend([x, y, 2.0 * unit(&mut rng) as f32 - 1.0, 2.0 * unit(&mut rng) as f32 - 1.0]);
            walker.step(&WALK, &action);
            actions.extend(action);
        }
        DatasetEpisode { observations: obs.into(), actions: Actions::Continuous { dim: 2, values: actions } }
    });
    let dataset = Dataset::new(OBS, SPACE, episodes.collect()).expect("consistent");
    let config = SkillConfig {
        latent: 2,
        window: 5,
        beta: 0.02,
        hidden: vec![32],
        encoder_hidden: 32,
        gru_hidden: 32,
        gru_layers: 1,
        lr: 5e-3,
        batch: 32,
        ..SkillConfig::default()
    };
    let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("windows fit");
    for _ in 0..40 {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}
