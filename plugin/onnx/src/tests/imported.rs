//! Policies out of graphs: our own ones, those of other trainers, and graphs that are refused.

use crate::{
    ImportTarget, ImportedPolicy, OnnxError, OnnxPolicy,
    messages::{EXTERNAL, ModelProto, TensorProto},
    tests::kinds::{Kind, all},
};
use playbot_learner::{ActionSpace, ImageShape, ObsKind, Observations, PolicyMetadata, PolicyOutput};
use prost::Message;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Kinds that have no counterpart without their policy file, with words of the reason.
const REFUSED: [(&str, &str); 2] = [("sets", "cannot be imported"), ("stack", "a stack of earlier observations")];

fn import_of(kind: &Kind) -> Result<ImportedPolicy, OnnxError> {
    let onnx = OnnxPolicy::of_policy_file(Path::new(kind.name), &kind.bytes).expect("it can be exported");
    let policy = &kind.file.policy;
    let target = ImportTarget {
        observation: policy.observation(),
        action_space: policy.action_space(),
        metadata: PolicyMetadata { training: String::new(), ..kind.file.metadata.clone() },
    };
    target.import(Path::new("kind.onnx"), &onnx.policy)
}

#[test]
fn our_own_graphs_come_back() {
    for kind in all() {
        let policy = &kind.file.policy;
        let refused = REFUSED.iter().find(|(name, _)| kind.name.starts_with(name));
        if policy.latent() > 0 || refused.is_some() {
            let error = import_of(&kind).expect_err("no counterpart").to_string();
            let words = refused.map_or("reads the input `skill`", |(_, words)| words);
            assert!(error.contains(words), "{}: {error}", kind.name);
            continue;
        }
        let imported = import_of(&kind).unwrap_or_else(|error| panic!("{}: {error}", kind.name));
        let n = 200;
        let (obs, memory) = (kind.observations(n), kind.numbers("memory", n, policy.memory()));
        let outputs = |policy: &playbot_learner::Policy| policy.forward_remembering(&[], &[], &memory, &obs, n);
        let (ours, theirs) = (outputs(policy).expect("finite"), outputs(&imported.file.policy).expect("finite"));
        for (name, ours, theirs) in [
            ("head", &ours.head, &theirs.head),
            ("log_std", &ours.log_std, &theirs.log_std),
            ("memory", &ours.memory, &theirs.memory),
        ] {
            assert_eq!(ours.len(), theirs.len(), "{name} of {}", kind.name);
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() <= 1e-5 * a.abs().max(1.0), "{name} of {}: {a} {b}", kind.name);
            }
        }
        assert_eq!(policy.normalises(), imported.file.policy.normalises(), "{}", kind.name);
        assert_eq!(ours.squashed, theirs.squashed);
        assert_eq!(imported.file.metadata.algorithm, "test");
        assert_eq!(imported.file.metadata.training, "random weights, imported from kind.onnx");
        eprintln!("{}: {:.1e}", kind.name, imported.difference);
    }
}

#[test]
fn an_imported_policy_is_a_policy_file() {
    let kind = all().into_iter().find(|kind| kind.name == "gru").expect("there");
    let imported = import_of(&kind).expect("supported");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bot.policy");
    imported.file.save(&path, &kind.observations(4), &[], 4).expect("writable");
    let bytes = std::fs::read(&path).expect("there");
    let again = OnnxPolicy::of_policy_file(&path, &bytes).expect("sound");
    assert!(again.prior.is_none());
    assert!(imported.compare(&kind.observations(30), 30).expect("the same") < 1e-5);
    assert!(matches!(imported.compare(&kind.observations(3), 4), Err(OnnxError::Misfit(_))));
}

#[test]
fn graphs_of_other_games_are_refused() {
    let kind = all().into_iter().next().expect("there");
    let onnx = OnnxPolicy::of_policy_file(Path::new(kind.name), &kind.bytes).expect("it can be exported");
    let metadata = &kind.file.metadata;
    let refused = |change: &dyn Fn(&mut ImportTarget), words: &str| {
        let mut target = ImportTarget {
            observation: ObsKind::Vector(6),
            action_space: ActionSpace::Discrete(5),
            metadata: metadata.clone(),
        };
        change(&mut target);
        let error = target.import(Path::new("a.onnx"), &onnx.policy).expect_err("refused").to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(&|target| target.metadata.game = "pong".to_owned(), "for the game `kinds`, not for `pong`");
    refused(&|target| target.metadata.game_version = 4, "for version 3 of the rules of `kinds`, not for 4");
    refused(
        &|target| target.metadata.observations[2] = "speed".to_owned(),
        "number 2 of the observations is `value 2` in the file and `speed` in the game",
    );
    let seven = ObsKind::Vector(7);
    refused(
        &|target| {
            (target.observation, target.metadata.observations) = (seven, Vec::new());
        },
        "the input `observation` has 6 numbers, and the game observes 7 observation values",
    );
    refused(&|target| target.action_space = ActionSpace::Discrete(4), "the game has 4 discrete actions");
    refused(&|target| target.action_space = ActionSpace::Discrete(4), "`log_probabilities` of 5");
}

// Files of other trainers.

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn bytes_of(name: &str) -> Vec<u8> {
    std::fs::read(fixture(&format!("{name}.onnx"))).expect("there")
}

fn target(observation: impl Into<ObsKind>, action_space: ActionSpace) -> ImportTarget {
    let metadata = PolicyMetadata { game: "theirs".to_owned(), ..PolicyMetadata::default() };
    ImportTarget { observation: observation.into(), action_space, metadata }
}

/// What the trainer's policy gave for some observations.
struct Theirs(serde_json::Map<String, Value>);

impl Theirs {
    fn of(name: &str) -> Self {
        let text = std::fs::read_to_string(fixture(&format!("{name}.json"))).expect("there");
        let Value::Object(all) = serde_json::from_str(&text).expect("JSON") else { panic!("an object") };
        Self(all)
    }

    /// Returns all numbers of an entry, row by row.
    fn numbers(&self, key: &str) -> Vec<f32> {
        fn flat(value: &Value, into: &mut Vec<f32>) {
            match value {
                Value::Array(all) => all.iter().for_each(|value| flat(value, into)),
                value => into.push(value.as_f64().expect("a number") as f32),
            }
        }
        let mut numbers = Vec::new();
        flat(&self.0[key], &mut numbers);
        numbers
    }
}

const ROWS: usize = 12;

/// Imports a file and plays its observations.
fn played(name: &str, target: &ImportTarget) -> (PolicyOutput, Theirs, ImportedPolicy) {
    let theirs = Theirs::of(name);
    let imported = target.import(Path::new(name), &bytes_of(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let numbers = theirs.numbers("observation");
    let obs: Observations = match target.observation {
        ObsKind::Vector(_) => numbers.into(),
        ObsKind::Image(_) => Observations::Image(numbers.iter().map(|&x| x as u8).collect()),
    };
    let memory = if imported.file.policy.memory() > 0 { theirs.numbers("state") } else { Vec::new() };
    let output = imported.file.policy.forward_remembering(&[], &[], &memory, &obs, ROWS).expect("finite");
    eprintln!("{name}: {:.1e}", imported.difference);
    (output, theirs, imported)
}

fn near(name: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{name}");
    assert!(expected.iter().any(|x| (x - expected[0]).abs() > 1e-2), "{name} is a test");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 2e-5 * expected.abs().max(1.0), "{name}: {found} is not {expected}");
    }
}

/// Returns the greedy actions: options, or numbers.
fn greedy(output: &PolicyOutput) -> Vec<f32> {
    let of_row = |row| {
        let action = output.greedy(row);
        let options = action.options().iter().map(|&option| option as f32);
        options.chain(action.numbers().iter().copied()).collect::<Vec<_>>()
    };
    (0..output.len()).flat_map(of_row).collect()
}

fn log_softmax(logits: &[f32], width: usize) -> Vec<f32> {
    let row = |row: &[f32]| {
        let sum: f32 = row.iter().map(|x| libm::expf(*x)).sum();
        row.iter().map(|x| x - libm::logf(sum)).collect::<Vec<_>>()
    };
    logits.chunks_exact(width).flat_map(row).collect()
}

#[test]
fn policies_of_sb3_play_as_they_did() {
    let spaces = [
        ("choice", ActionSpace::Discrete(3)),
        ("numbers", ActionSpace::Continuous(2)),
        ("choices", ActionSpace::mixed([3, 2], 0)),
    ];
    for (kind, space) in spaces {
        for exporter in ["script", "dynamo"] {
            let name = format!("sb3_ppo_{kind}_{exporter}");
            let (output, theirs, imported) = played(&name, &target(4, space));
            near(&name, &greedy(&output), &theirs.numbers("action"));
            if kind == "choice" {
                near(&name, &output.head, &log_softmax(&theirs.numbers("logits"), 3));
            }
            assert_eq!(imported.notes[0], "actions come from the output `action`");
            let is_assumed = imported.notes.iter().any(|note| note.contains("no output `log_std`"));
            assert_eq!(is_assumed, kind == "numbers");
            assert!(imported.file.metadata.training.contains("written by pytorch"), "{:?}", imported.file.metadata);
        }
    }
    let (output, theirs, _) = played("sb3_sac", &target(4, ActionSpace::Continuous(2)));
    assert!(output.squashed);
    near("sb3_sac", &greedy(&output), &theirs.numbers("action"));
}

#[test]
fn networks_of_torch_play_as_they_did() {
    let (output, theirs, _) = played("cleanrl_sac", &target(4, ActionSpace::Continuous(2)));
    near("action", &greedy(&output), &theirs.numbers("action"));
    near("log_std", &output.log_std, &theirs.numbers("log_std"));
    for exporter in ["script", "dynamo"] {
        let name = format!("gru_{exporter}");
        let (output, theirs, _) = played(&name, &target(4, ActionSpace::Discrete(3)));
        near(&name, &output.head, &log_softmax(&theirs.numbers("logits"), 3));
        near(&name, &output.memory, &theirs.numbers("state_after"));
    }
    let image = ImageShape { channels: 1, height: 36, width: 36 };
    let (output, theirs, _) = played("nature", &target(ObsKind::Image(image), ActionSpace::Discrete(4)));
    near("nature", &output.head, &log_softmax(&theirs.numbers("logits"), 4));
    for (name, is_clipped) in [("normalised", false), ("normalised_clipped", true)] {
        let (output, theirs, imported) = played(name, &target(4, ActionSpace::Discrete(3)));
        let probabilities: Vec<f32> = output.head.iter().map(|x| libm::expf(*x)).collect();
        near(name, &probabilities, &theirs.numbers("probabilities"));
        assert_eq!(imported.file.policy.normalises(), is_clipped, "without a clip it is part of the first layer");
    }
}

// Files that are refused.

fn refused(name: &str, target: &ImportTarget, change: impl FnOnce(&mut ModelProto)) -> String {
    let mut model = ModelProto::decode(&bytes_of(name)[..]).expect("sound");
    change(&mut model);
    target.import(Path::new("bad.onnx"), &model.encode_to_vec()).expect_err("refused").to_string()
}

fn constants(model: &mut ModelProto) -> &mut Vec<TensorProto> {
    &mut model.graph.as_mut().expect("a graph").initializer
}

#[test]
fn what_a_policy_has_not_is_refused_by_the_name_of_its_node() {
    let choice = target(4, ActionSpace::Discrete(3));
    let error = refused("sigmoid", &choice, |_| {});
    assert!(error.contains("the node Sigmoid `/Sigmoid` (output `/Sigmoid_output_0`)"), "{error}");
    assert!(error.contains("a graph may have dense layers"), "{error}");
    let rename = |from: &'static str, to: &'static str| {
        move |model: &mut ModelProto| {
            for node in &mut model.graph.as_mut().expect("a graph").node {
                if node.op_type == from {
                    to.clone_into(&mut node.op_type);
                }
            }
        }
    };
    let error = refused("normalised", &choice, rename("Tanh", "Mish"));
    assert!(error.contains("the node Mish") && error.contains("the operator Mish is unknown"), "{error}");
    let error = refused("gru_script", &choice, |model| {
        let graph = model.graph.as_mut().expect("a graph");
        let gru = graph.node.iter_mut().find(|node| node.op_type == "GRU").expect("there");
        gru.attribute.retain(|attribute| attribute.name != "linear_before_reset");
    });
    assert!(error.contains("GRU `/gru/GRU`") && error.contains("resets before the linear layer"), "{error}");
    let error = refused("normalised_clipped", &choice, |model| {
        let graph = model.graph.as_mut().expect("a graph");
        for node in &mut graph.node {
            let bound = node.output.first().is_some_and(|output| output == "/Constant_1_output_0");
            if let (true, Some(attribute)) = (bound, node.attribute.first_mut()) {
                attribute.t = Some(TensorProto::floats("", &[], &[5.0]));
            }
        }
    });
    assert!(error.contains("Clip `/Clip`") && error.contains("clipped to ±10"), "{error}");
    let error = refused("cleanrl_sac", &target(4, ActionSpace::Continuous(2)), |model| {
        let graph = model.graph.as_mut().expect("a graph");
        let relu = graph.node.iter_mut().find(|node| node.name == "node_relu_1").expect("there");
        "Tanh".clone_into(&mut relu.op_type);
    });
    assert!(error.contains("Relu `node_relu`") && error.contains("the same function"), "{error}");
}

#[test]
fn sizes_that_are_not_the_games_are_named() {
    let error = refused("sb3_ppo_choice_script", &target(5, ActionSpace::Discrete(3)), |_| {});
    assert_eq!(
        error,
        "the input `observation` has 4 numbers, and the game observes 5 observation values: they must be the same"
    );
    let error = refused("sb3_ppo_choice_script", &target(4, ActionSpace::Discrete(7)), |_| {});
    assert!(error.contains("the game has 7 discrete actions") && error.contains("`action` of 3"), "{error}");
    let error = refused("sb3_ppo_numbers_script", &target(4, ActionSpace::Continuous(3)), |_| {});
    assert!(error.contains("continuous actions of 3 numbers") && error.contains("`action` of 2"), "{error}");
    let batched = |model: &mut ModelProto| {
        let input = &mut model.graph.as_mut().expect("a graph").input[0];
        let shape = input.r#type.as_mut().and_then(|of| of.tensor_type.as_mut()).and_then(|of| of.shape.as_mut());
        let batch = &mut shape.expect("a shape").dim[0];
        (batch.dim_value, batch.dim_param) = (Some(8), None);
    };
    let error = refused("sigmoid", &target(4, ActionSpace::Discrete(3)), batched);
    assert!(error.contains("a batch of 8"), "{error}");
    let image = ObsKind::Image(ImageShape { channels: 36, height: 36, width: 1 });
    let error = refused("nature", &target(image, ActionSpace::Discrete(4)), |_| {});
    assert!(error.contains("channel, row, column"), "{error}");
}

#[test]
fn unsound_files_are_described() {
    let choice = target(4, ActionSpace::Discrete(3));
    let whole = bytes_of("sb3_ppo_choice_script");
    for cut in [0, 1, 7, 100, whole.len() / 2, whole.len() - 1] {
        let error = choice.import(Path::new("cut.onnx"), &whole[..cut]).expect_err("cut off").to_string();
        assert!(error.starts_with("cut.onnx: it is no ONNX file, or it is cut off"), "{cut}: {error}");
    }
    let error = choice.import(Path::new("a.png"), b"\x89PNG\r\n\x1a\n").expect_err("foreign").to_string();
    assert!(error.contains("it is no ONNX file"), "{error}");
    let error = refused("sigmoid", &choice, |model| {
        let weights = &mut constants(model)[0];
        weights.raw_data[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    });
    assert_eq!(error, "bad.onnx: the array `first.weight` holds the number NaN");
    let error = refused("sigmoid", &choice, |model| {
        let weights = &mut constants(model)[0];
        weights.raw_data.clear();
        weights.data_location = EXTERNAL;
        let entry = |key: &str, value: &str| crate::messages::StringStringEntryProto {
            key: key.to_owned(),
            value: value.to_owned(),
        };
        weights.external_data = vec![entry("location", "bad.onnx.data")];
    });
    assert!(error.contains("lies in the file `bad.onnx.data` (external data)"), "{error}");
    let error = refused("sigmoid", &choice, |model| constants(model)[0].dims[0] = 9);
    assert!(error.contains("which are not those of [9, 4]"), "{error}");
    let error = refused("sigmoid", &choice, |model| constants(model)[0].dims = vec![i64::MAX, i64::MAX]);
    assert!(error.contains("impossible sizes"), "{error}");
}

/// No damage makes the import panic: whatever a changed file says, the result is an error or a policy.
#[test]
fn damaged_files_are_errors() {
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for (name, target) in [
        ("sb3_ppo_choices_script", target(4, ActionSpace::mixed([3, 2], 0))),
        ("gru_dynamo", target(4, ActionSpace::Discrete(3))),
        ("cleanrl_sac", target(4, ActionSpace::Continuous(2))),
    ] {
        let whole = bytes_of(name);
        for _ in 0..400 {
            let mut bytes = whole.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                bytes[at] = random(256) as u8;
            }
            // Either is fine.
            let _ = target.import(Path::new("damaged.onnx"), &bytes);
        }
    }
}
