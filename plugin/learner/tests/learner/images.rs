//! The skill model on images: it learns from the picture, keeps demonstrators apart, and survives its file.

use crate::image_task::{SHAPE, SIDE, WINDOW, skill_config};
use playbot_learner::nn::CnnKind;
use playbot_learner::rng::{ChaCha8Rng, Streams, below, normal};
use playbot_learner::{
    ActionInput, ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, ImageShape, LearnError, ObsKind, SacConfig,
    SacLearner, ScoreConfig, SkillConfig, SkillDraw, SkillModel, SkillTrainer, WindowRule,
};
use std::ops::ControlFlow;
use std::path::Path;

const SPACE: ActionSpace = ActionSpace::Discrete(4);
const EPOCHS: usize = 12;

/// Returns a dark image with a bright spot of 3×3 pixels in the left or the right half.
fn image(right: bool, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut pixels: Vec<u8> = (0..SHAPE.numbers()).map(|_| below(rng, 40) as u8).collect();
    let column = below(rng, SIDE as u64 / 2 - 2) as usize + if right { SIDE / 2 } else { 0 };
    let row = below(rng, SIDE as u64 - 2) as usize;
    for y in row..row + 3 {
        pixels[y * SIDE + column..][..3].fill(255);
    }
    pixels
}

/// Returns episodes of two kinds of demonstrators, who press a key for the half with the spot. Only the image tells
/// the half, and only the skill tells the kind.
fn episodes(count: u64, act: impl Fn(bool, &[bool]) -> Actions) -> Vec<DatasetEpisode> {
    let streams = Streams::new(4);
    let episode = |i: u64| {
        let mut rng = streams.stream("episode", i);
        let rights: Vec<bool> = (0..3 * WINDOW).map(|_| below(&mut rng, 2) == 1).collect();
        let pixels: Vec<u8> = rights.iter().flat_map(|&right| image(right, &mut rng)).collect();
        DatasetEpisode { observations: pixels.into(), actions: act(i % 2 == 1, &rights) }
    };
    (0..count).map(episode).collect()
}

/// Returns the keys: the first kind presses 0 for left and 1 for right, the second 2 and 3.
fn press(second: bool, rights: &[bool]) -> Actions {
    Actions::Discrete(rights.iter().map(|&right| 2 * u32::from(second) + u32::from(right)).collect())
}

fn demos(count: u64) -> Dataset {
    Dataset::new(SHAPE, SPACE, episodes(count, press)).expect("consistent")
}

fn train(trainer: &mut SkillTrainer, epochs: usize) -> Vec<f32> {
    let epoch = |_| trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    (0..epochs).filter_map(epoch).map(|metrics| metrics.nll).collect()
}

#[test]
fn the_model_sees_where_the_spot_is_and_which_demonstrator_plays() {
    for action_input in [ActionInput::OneHot, ActionInput::ScaledIndex] {
        let config = SkillConfig { action_input, ..skill_config() };
        let mut trainer = SkillTrainer::new(config, demos(96), 1, DeviceKind::Flex).expect("windows fit");
        let nll = train(&mut trainer, EPOCHS);
        // Chance costs 4 ln 4 = 5.5 per window. A decoder that does not see the spot, or an encoder that does not tell
        // who plays, cannot be better than half of that.
        assert!(nll[0] > 4.0 && nll[EPOCHS - 1] < 0.8, "{} to {}", nll[0], nll[EPOCHS - 1]);
        players(&trainer.into_model());
    }
}

/// Each skill drawn from the prior is one of the two kinds of players, and both occur.
fn players(model: &SkillModel) {
    let mut rng = Streams::new(8).stream("play", 0);
    let n = 40;
    let (prior, policy) = (model.prior(), model.policy());
    let start: Vec<u8> = (0..n).flat_map(|i| image(i % 2 == 0, &mut rng)).collect();
    let z = prior.sample(&start, n, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite");
    let mut found = [0, 0];
    for z in z.chunks_exact(2) {
        let rights = [false, true, false, true, true, false];
        let pixels: Vec<u8> = rights.iter().flat_map(|&right| image(right, &mut rng)).collect();
        let output = policy.forward(&z.repeat(rights.len()), &pixels, rights.len()).expect("finite");
        for (found, second) in found.iter_mut().zip([false, true]) {
            let played = |row: usize| press(second, &rights).get(row) == Some(output.greedy(row));
            *found += usize::from((0..rights.len()).all(played));
        }
    }
    assert!(found[0] + found[1] > 3 * n / 4, "{found:?} of {n} skills are a player");
    assert!(found[0] > n / 10 && found[1] > n / 10, "{found:?}: both kinds occur");
}

#[test]
fn continuous_actions_of_images() {
    let sign = |x: bool| if x { 0.6 } else { -0.6 };
    let turn = |second: bool, rights: &[bool]| Actions::Continuous {
        dim: 2,
        values: rights.iter().flat_map(|&right| [sign(right), sign(second)]).collect(),
    };
    let data = Dataset::new(SHAPE, ActionSpace::Continuous(2), episodes(96, turn)).expect("consistent");
    let mut trainer = SkillTrainer::new(skill_config(), data, 1, DeviceKind::Flex).expect("windows fit");
    let nll = train(&mut trainer, EPOCHS);
    // One normal distribution for all has a σ of 0.6 in either dimension and costs 7.3 per window. With only one of the
    // dimensions told apart, the other still costs 3.6, and the first cannot have won as much yet.
    assert!(nll[EPOCHS - 1] < -1.0, "{} to {}", nll[0], nll[EPOCHS - 1]);
}

#[test]
fn both_backends_and_both_architectures_learn_the_same() {
    let nature = CnnKind::Nature { feature: 16 };
    let shape = ImageShape { channels: 1, height: 36, width: 40 };
    let episodes = (0..4).map(|i| DatasetEpisode {
        observations: (0..4 * shape.numbers()).map(|p| (p * (i + 3) % 256) as u8).collect::<Vec<_>>().into(),
        actions: Actions::Discrete(vec![i as u32 % 2; 4]),
    });
    let data = Dataset::new(shape, ActionSpace::Discrete(2), episodes.collect()).expect("consistent");
    let run = |cnn: &CnnKind, device| {
        let config = SkillConfig { cnn: cnn.clone(), batch: 4, ..skill_config() };
        train(&mut SkillTrainer::new(config, data.clone(), 1, device).expect("windows fit"), 2)
    };
    for cnn in [skill_config().cnn, nature] {
        let (flex, ndarray) = (run(&cnn, DeviceKind::Flex), run(&cnn, DeviceKind::Ndarray));
        assert!(flex.iter().zip(&ndarray).all(|(a, b)| (a - b).abs() < 1e-3), "{cnn:?}: {flex:?} and {ndarray:?}");
    }
}

#[test]
fn a_loaded_trainer_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trainer.safetensors");
    let config = SkillConfig { windows: WindowRule::Legacy, ..skill_config() };
    let mut trainer = SkillTrainer::new(config, demos(12), 7, DeviceKind::Flex).expect("windows fit");
    train(&mut trainer, 1);
    trainer.train_batch().expect("finite");
    trainer.save(&path).expect("written");
    let mut loaded = SkillTrainer::load(&path, demos(12), DeviceKind::Flex).expect("read");
    assert_eq!(train(&mut loaded, 2), train(&mut trainer, 2));
    let bytes = |trainer: &SkillTrainer, name: &str| {
        let path = folder.path().join(name);
        trainer.save(&path).expect("written");
        std::fs::read(path).expect("readable")
    };
    assert!(bytes(&trainer, "a") == bytes(&loaded, "b"), "whole states are equal, byte for byte");

    let vectors = |episode: &DatasetEpisode| DatasetEpisode {
        observations: vec![0.0; SHAPE.numbers() * episode.actions.len()].into(),
        actions: episode.actions.clone(),
    };
    let other = episodes(12, press).iter().map(vectors).collect();
    let other = Dataset::new(SHAPE.numbers(), SPACE, other).expect("consistent");
    let error = SkillTrainer::load(&path, other, DeviceKind::Flex).expect_err("vectors").to_string();
    assert!(error.contains("reads images of 1 channels") && error.contains("vectors of 144"), "{error}");
}

fn model() -> SkillModel {
    let mut trainer = SkillTrainer::new(skill_config(), demos(12), 7, DeviceKind::Flex).expect("windows fit");
    train(&mut trainer, 1);
    trainer.into_model()
}

#[test]
fn a_model_comes_back_from_its_file_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skill.safetensors");
    let model = model();
    model.save(&path).expect("written");
    let back = SkillModel::load(&path, DeviceKind::Flex).expect("read");
    assert_eq!((back.observation(), back.obs_dim()), (ObsKind::Image(SHAPE), 144));
    assert_eq!(back.config(), model.config());
    assert!(names(&path).contains(&"decoder.cnn.s0.conv.weight".to_owned()));
    let pixels = image(true, &mut Streams::new(1).stream("image", 0));
    let act = |model: &SkillModel| {
        let z = model.prior().sample(&pixels, 1, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
        model.policy().forward(&z, &pixels, 1).expect("finite")
    };
    assert_eq!(act(&back), act(&model));
}

fn names(path: &Path) -> Vec<String> {
    let bytes = std::fs::read(path).expect("readable");
    let file = safetensors::SafeTensors::deserialize(&bytes).expect("safetensors");
    file.names().into_iter().map(str::to_owned).collect()
}

#[test]
fn a_row_does_not_depend_on_the_other_rows() {
    let nature = CnnKind::Nature { feature: 32 };
    let shape = ImageShape { channels: 3, height: 64, width: 64 };
    let n = 33;
    let mut rng = Streams::new(1).stream("pixels", 0);
    let pixels: Vec<u8> = (0..n * shape.numbers()).map(|_| below(&mut rng, 256) as u8).collect();
    let z: Vec<f32> = (0..n * 2).map(|_| normal(&mut rng)).collect();
    for (cnn, device) in
        [(skill_config().cnn, DeviceKind::Flex), (nature, DeviceKind::Flex), (skill_config().cnn, DeviceKind::Ndarray)]
    {
        let episode = DatasetEpisode {
            observations: pixels[..4 * shape.numbers()].to_vec().into(),
            actions: Actions::Discrete(vec![0; 4]),
        };
        let data = Dataset::new(shape, ActionSpace::Discrete(5), vec![episode]).expect("consistent");
        let config = SkillConfig { cnn, ..skill_config() };
        let policy = SkillTrainer::new(config, data, 1, device).expect("a window fits").into_model().policy();
        let whole = policy.forward(&z, &pixels, n).expect("finite");
        for size in [1, 2, 3, 16] {
            let rows = 5..5 + size;
            let pixels = &pixels[rows.start * shape.numbers()..rows.end * shape.numbers()];
            let part = policy.forward(&z[rows.start * 2..rows.end * 2], pixels, size).expect("finite");
            assert_eq!(part.head, whole.head[rows.start * 5..rows.end * 5], "{size} rows on {device}");
        }
    }
}

#[test]
fn what_cannot_read_images_says_so() {
    let model = model();
    let config_error = |error: LearnError, text: &str| {
        assert!(matches!(error, LearnError::Config(_)), "{error}");
        assert!(error.to_string().contains(text), "{error}");
    };
    let score = ScoreConfig::default();
    let sac = SacLearner::with_skill(SacConfig::default(), score, &model, 1, DeviceKind::Flex);
    config_error(sac.expect_err("images"), "SAC reads vectors, not images of 1 channels");
    let (z, vector) = ([0.0; 2], vec![0.0; SHAPE.numbers()]);
    config_error(model.policy().forward(&z, &vector, 1).expect_err("a vector"), "observations are vectors, not images");
    let drawn = model.prior().sample(&vector, 1, SkillDraw::Mean, &mut |_| 0.0);
    config_error(drawn.expect_err("a vector"), "prior are vectors, not images");
    let short = model.policy().forward(&z, &vec![0u8; 143], 1).expect_err("a pixel is missing");
    assert!(matches!(short, LearnError::Shape { expected: 144, found: 143, .. }), "{short}");
    let small = SkillConfig { cnn: CnnKind::Nature { feature: 8 }, ..skill_config() };
    let error = SkillTrainer::new(small, demos(2), 1, DeviceKind::Flex).expect_err("too small for it");
    config_error(error, "at least 36 rows");
}
