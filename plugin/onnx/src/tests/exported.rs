//! Graphs of exported policies beside the policies themselves.

use crate::{
    OnnxPolicy,
    evaluator::{Evaluator, Value},
    tests::kinds::{Kind, all, singles},
};
use playbot_learner::{ActionSpace, ActionValue, PolicyOutput, SkillDraw, disk, write_atomically};
use safetensors::{Dtype, tensor::TensorView};
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// Observations of each kind.
const ROWS: usize = 1000;

/// Ticks of an episode of an agent with memory.
const TICKS: usize = 20;

/// The largest difference of each kind, relative to numbers above 1.
const TOLERANCE: f64 = 1e-5;

/// Inputs and outputs of a graph, by name and sizes of a row.
#[derive(Default)]
struct Case {
    inputs: BTreeMap<String, Value>,
    outputs: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Case {
    fn output(&mut self, name: &str, sizes: &[usize], numbers: Vec<f32>) {
        self.outputs.insert(name.to_owned(), (sizes.to_vec(), numbers));
    }

    /// Compares a graph with what the policy gives, and returns the largest difference.
    fn check(&self, name: &str, graph: &Evaluator) -> f64 {
        let names: Vec<&str> = graph.outputs().collect();
        let expected: BTreeSet<&str> = self.outputs.keys().map(String::as_str).collect();
        assert_eq!(names.iter().copied().collect::<BTreeSet<_>>(), expected, "outputs of {name}");
        let outputs = graph.run(self.inputs.clone(), &names).expect("it runs");
        let mut largest: f64 = 0.0;
        for (output, (sizes, expected)) in &self.outputs {
            let found = &outputs[output];
            assert_eq!(found.shape()[1..], sizes[..], "sizes of {output} of {name}");
            assert_eq!(found.numbers().len(), expected.len());
            let spread = expected.iter().any(|x| (x - expected[0]).abs() > 0.05);
            let is_choice = ["action", "choices"].contains(&output.as_str());
            assert!(spread || is_choice || output == "log_std", "{output} of {name} is the same for all observations");
            for (row, (found, expected)) in found.numbers().iter().zip(expected).enumerate() {
                let expected = f64::from(*expected);
                if is_choice && expected.fract() == 0.0 && found.fract() == 0.0 {
                    assert_eq!(*found, expected, "{output} of {name}, number {row}");
                    continue;
                }
                let difference = (found - expected).abs() / expected.abs().max(1.0);
                assert!(difference <= TOLERANCE, "{output} of {name}, number {row}: {found} is not {expected}");
                largest = largest.max(difference);
            }
        }
        largest
    }

    /// Writes a case for other engines: the graph, and a safetensors file of `in.NAME` and `out.NAME`.
    fn write(&self, folder: &Path, name: &str, graph: &[u8]) {
        let inputs = self.inputs.iter().map(|(name, value)| {
            let numbers: Vec<f32> = value.numbers().iter().map(|&x| x as f32).collect();
            (format!("in.{name}"), value.shape().to_vec(), numbers)
        });
        let outputs = self.outputs.iter().map(|(name, (sizes, numbers))| {
            let rows = numbers.len() / sizes.iter().product::<usize>().max(1);
            (format!("out.{name}"), [&[rows][..], sizes].concat(), numbers.clone())
        });
        let arrays: Vec<_> = inputs.chain(outputs).collect();
        let views = arrays.iter().map(|(name, shape, numbers)| {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytemuck::cast_slice(numbers));
            (name.as_str(), view.expect("it fills it"))
        });
        let bytes = safetensors::serialize(views, None).expect("sound");
        disk::create_dir_all(folder).expect("a folder");
        write_atomically(&folder.join(format!("{name}.onnx")), graph).expect("writable");
        write_atomically(&folder.join(format!("{name}.safetensors")), &bytes).expect("writable");
    }
}

/// Adds what a policy gives, as the outputs of its graph.
fn add_outputs(case: &mut Case, kind: &Kind, output: &PolicyOutput) {
    let space = kind.file.policy.action_space();
    let (options, numbers, dim) = (space.options(), space.numbers(), space.dim());
    let columns =
        |from: usize, to: usize| output.head.chunks_exact(dim).flat_map(|row| row[from..to].to_vec()).collect();
    let (mut taken, mut vector) = (Vec::new(), Vec::new());
    for row in 0..output.len() {
        match output.greedy(row) {
            ActionValue::Discrete(index) => taken.push(index as f32),
            ActionValue::Continuous(values) => vector.extend(values),
            ActionValue::Mixed { choices, numbers } => {
                taken.extend(choices.iter().map(|&index| index as f32));
                vector.extend(numbers);
            }
        }
    }
    let is_both = options > 0 && numbers > 0;
    if options > 0 {
        let sizes =
            if matches!(space, ActionSpace::Discrete(_)) { vec![] } else { vec![space.choices().sizes().len()] };
        case.output(if is_both { "choices" } else { "action" }, &sizes, taken);
        case.output("log_probabilities", &[options], columns(0, options));
    }
    if numbers > 0 {
        case.output(if is_both { "numbers" } else { "action" }, &[numbers], vector);
        case.output("mean", &[numbers], columns(options, dim));
        case.output("log_std", &[numbers], output.log_std.clone());
    }
    if kind.file.policy.memory() > 0 {
        case.output("memory_after", &[kind.file.policy.memory()], output.memory.clone());
    }
}

fn policy_case(kind: &Kind) -> Case {
    let policy = &kind.file.policy;
    let (latent, width) = (policy.latent(), policy.memory());
    let (obs, z) = (kind.observations(ROWS), kind.numbers("skill", ROWS, latent));
    let mut case = Case::default();
    let mut memory = Vec::new();
    // Agents beside one another for some ticks: what each remembers is an input of the next tick.
    let agents = ROWS / TICKS;
    let mut state = vec![0.0; agents * width];
    for tick in 0..TICKS {
        let rows: Vec<usize> = (0..agents).map(|agent| tick * agents + agent).collect();
        memory.extend_from_slice(&state);
        let mut own = playbot_learner::Observations::empty(&policy.observation());
        for &row in &rows {
            own.push(obs.row(row, policy.obs_dim())).expect("of its kind");
        }
        let z = &z[rows[0] * latent..][..agents * latent];
        state = policy.forward_remembering(z, &[], &state, &own, agents).expect("finite").memory;
    }
    let output = policy.forward_remembering(&z, &[], &memory, &obs, ROWS).expect("finite");
    case.inputs.insert("observation".to_owned(), kind.input(obs.as_slice(), ROWS));
    if latent > 0 {
        case.inputs.insert("skill".to_owned(), singles(&[ROWS, latent], &z));
    }
    if width > 0 {
        case.inputs.insert("memory".to_owned(), singles(&[ROWS, width], &memory));
    }
    add_outputs(&mut case, kind, &output);
    let has_critic = output.values.iter().any(|value| *value != 0.0);
    if has_critic {
        case.output("value", &[], output.values);
    }
    case
}

fn prior_case(kind: &Kind) -> Option<Case> {
    let (skills, latent) = (kind.file.skills.as_ref()?, kind.file.policy.latent());
    let prior = &skills.prior;
    let obs = kind.observations(ROWS);
    let (noise, memory) = (kind.numbers("noise", ROWS, latent), kind.numbers("memory", ROWS, prior.memory()));
    let mut next = noise.iter().copied();
    let mut normal = |_| next.next().expect("as many as skills have numbers");
    let drawn = prior.sample_remembering(&obs, &memory, ROWS, SkillDraw::Sample, &mut normal).expect("finite");
    let mut case = Case::default();
    case.inputs.insert("observation".to_owned(), kind.input(obs.as_slice(), ROWS));
    case.inputs.insert("noise".to_owned(), singles(&[ROWS, latent], &noise));
    case.output("skill", &[latent], drawn.0);
    if prior.memory() > 0 {
        case.inputs.insert("memory".to_owned(), singles(&[ROWS, prior.memory()], &memory));
        case.output("memory_after", &[prior.memory()], drawn.1);
    }
    Some(case)
}

#[test]
fn graphs_give_what_policies_of_every_kind_give() {
    let folder = std::env::var_os("PLAYBOT_ONNX_CASES");
    for kind in all() {
        let onnx = OnnxPolicy::of_policy_file(Path::new(kind.name), &kind.bytes).expect("it can be exported");
        let cases =
            [(policy_case(&kind), Some(&onnx.policy)), (prior_case(&kind).unwrap_or_default(), onnx.prior.as_ref())];
        for (part, (case, bytes)) in ["policy", "prior"].into_iter().zip(cases) {
            let Some(bytes) = bytes else { continue };
            let graph = Evaluator::parse(Path::new(kind.name), bytes).expect("sound");
            let largest = case.check(kind.name, &graph);
            eprintln!("{} {part}: {largest:.1e}", kind.name);
            if let Some(folder) = &folder {
                case.write(Path::new(folder), &format!("{} {part}", kind.name).replace(' ', "-"), bytes);
            }
        }
    }
}

/// The states of a graph's own memory stay near those of the policy over a whole episode.
#[test]
fn memories_stay_together_over_an_episode() {
    for kind in all().into_iter().filter(|kind| kind.file.policy.memory() > 0) {
        let onnx = OnnxPolicy::of_policy_file(Path::new(kind.name), &kind.bytes).expect("it can be exported");
        let graph = Evaluator::parse(Path::new(kind.name), &onnx.policy).expect("sound");
        let policy = &kind.file.policy;
        let (width, latent, agents) = (policy.memory(), policy.latent(), 4);
        let (mut own, mut native) = (singles(&[agents, width], &vec![0.0; agents * width]), Vec::new());
        let obs = kind.observations(agents);
        let z = kind.numbers("skill", agents, latent);
        for tick in 0..TICKS {
            native = policy.forward_remembering(&z, &[], &native, &obs, agents).expect("finite").memory;
            let mut inputs = BTreeMap::from([
                ("observation".to_owned(), kind.input(obs.as_slice(), agents)),
                ("memory".to_owned(), own.clone()),
            ]);
            if latent > 0 {
                inputs.insert("skill".to_owned(), singles(&[agents, latent], &z));
            }
            own = graph.run(inputs, &["memory_after"]).expect("it runs")["memory_after"].clone();
            for (own, native) in own.numbers().iter().zip(&native) {
                let difference = (own - f64::from(*native)).abs();
                assert!(difference <= TOLERANCE * own.abs().max(1.0), "{} at tick {tick}: {own} {native}", kind.name);
            }
        }
    }
}

#[test]
fn the_same_policy_gives_the_same_bytes_and_its_metadata() {
    for kind in all() {
        let export = || OnnxPolicy::of_policy_file(Path::new(kind.name), &kind.bytes).expect("it can be exported");
        let onnx = export();
        assert_eq!(onnx, export(), "{}", kind.name);
        let graph = Evaluator::parse(Path::new(kind.name), &onnx.policy).expect("sound");
        assert_eq!((graph.metadata("game"), graph.metadata("game_version")), (Some("kinds"), Some("3")));
        assert_eq!(graph.metadata("skill_interval").is_some(), kind.file.skills.is_some());
        let names: Vec<String> = serde_json::from_str(graph.metadata("observations").expect("there")).expect("JSON");
        assert_eq!(names, kind.file.metadata.observations);
        let inputs: serde_json::Value = serde_json::from_str(graph.metadata("inputs").expect("there")).expect("JSON");
        assert_eq!(inputs[0]["shape"][0], "batch");
    }
}

#[test]
fn files_are_written_side_by_side() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bot.onnx");
    for (prior, found) in [(None, None), (Some(vec![2]), Some(folder.path().join("bot.prior.onnx")))] {
        let onnx = OnnxPolicy { policy: vec![1], prior };
        assert_eq!(onnx.save(&path).expect("writable"), found);
        assert_eq!(std::fs::read(&path).expect("there"), [1]);
    }
    let onnx = OnnxPolicy { policy: vec![1], prior: None };
    let error = onnx.save(&folder.path().join("none/bot.onnx")).expect_err("no folder").to_string();
    assert!(error.contains("cannot write"), "{error}");
}
