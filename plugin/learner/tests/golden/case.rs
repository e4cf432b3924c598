//! One case: its file of numbers and its tolerances.

use crate::generated::generate;
use crate::names::their_name;
use burn::tensor::{Device, Tensor, TensorData};
use playbot_learner::nn::{Activation, ParamVisitor, Parameters};
use playbot_learner::{Actions, DeviceKind};
use safetensors::{Dtype, SafeTensors};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A case, with a record of what was compared.
pub struct Case {
    pub name: String,
    json: Value,
    tensors: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
    checked: RefCell<BTreeSet<String>>,
}

impl Case {
    pub fn load(name: &str) -> Self {
        let folder = std::env::var_os("PLAYBOT_GOLDEN").map_or_else(|| fixtures("numerics"), PathBuf::from);
        Self::read(&folder, name)
    }

    /// Creates a case of the script `tests/fixtures/sac_variants/generate.py`, which no other folder has.
    pub fn of_sac_variants(name: &str) -> Self {
        Self::read(&fixtures("sac_variants"), name)
    }

    /// Creates the case of the script `tests/fixtures/memory/generate.py`, which no other folder has.
    pub fn of_memory(name: &str) -> Self {
        Self::read(&fixtures("memory"), name)
    }

    /// Creates a case of the script `tests/fixtures/action_spaces/generate.py`, which no other folder has.
    pub fn of_action_spaces(name: &str) -> Self {
        Self::read(&fixtures("action_spaces"), name)
    }

    /// Creates the case of the script `tests/fixtures/entities/generate.py`, which no other folder has.
    pub fn of_entities(name: &str) -> Self {
        Self::read(&fixtures("entities"), name)
    }

    /// Creates a case of the script `tests/fixtures/curiosity/generate.py`, which no other folder has.
    pub fn of_curiosity(name: &str) -> Self {
        Self::read(&fixtures("curiosity"), name)
    }

    fn read(folder: &Path, name: &str) -> Self {
        let read = |ending: &str| {
            let path = folder.join(format!("{name}.{ending}"));
            std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
        };
        let json: Value = serde_json::from_slice(&read("json")).expect("the case is JSON");
        let bytes = read("safetensors");
        let file = SafeTensors::deserialize(&bytes).expect("the tensors are safetensors");
        let generated = json["procedural"].as_array().into_iter().flatten().map(generate);
        let tensors = file
            .iter()
            .map(|(name, view)| {
                let data = view.data();
                let values = match view.dtype() {
                    Dtype::F32 => bytemuck::pod_collect_to_vec::<u8, f32>(data).into_iter().map(f64::from).collect(),
                    Dtype::I64 => bytemuck::pod_collect_to_vec::<u8, i64>(data).into_iter().map(|x| x as f64).collect(),
                    Dtype::U8 => data.iter().map(|&x| f64::from(x)).collect(),
                    other => panic!("{name} is {other:?}"),
                };
                (name.to_owned(), (view.shape().to_vec(), values))
            })
            .chain(generated)
            .collect();
        Self { name: name.to_owned(), json, tensors, checked: RefCell::default() }
    }

    pub fn hyper(&self, name: &str) -> &Value {
        &self.json["hyper"][name]
    }

    pub fn number(&self, name: &str) -> f64 {
        self.hyper(name).as_f64().unwrap_or_else(|| panic!("{}: no number {name}", self.name))
    }

    pub fn dim(&self, name: &str) -> usize {
        self.json["dims"][name].as_u64().unwrap_or_else(|| panic!("{}: no size {name}", self.name)) as usize
    }

    pub fn expected(&self, name: &str) -> &Value {
        self.checked.borrow_mut().insert(name.to_owned());
        &self.json["expected"][name]
    }

    /// Returns whether there is an expected number `name`.
    pub fn expects(&self, name: &str) -> bool {
        self.json["expected"].get(name).is_some()
    }

    /// Returns the widths of the hidden layers of the network whose weights are `prefix.l0.weight`,
    /// `prefix.l1.weight`, ...
    pub fn hidden_layers(&self, prefix: &str) -> Vec<usize> {
        let layers = (0..).map_while(|i| self.tensors.get(&format!("{prefix}.l{i}.weight")));
        layers.map(|(shape, _)| shape[0]).collect()
    }

    pub fn activation(&self) -> Activation {
        match self.hyper("activation").as_str() {
            Some("relu") => Activation::Relu,
            Some("tanh") => Activation::Tanh,
            other => panic!("{}: unknown activation {other:?}", self.name),
        }
    }

    pub fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    pub fn shape(&self, name: &str) -> &[usize] {
        &self.get(name).0
    }

    pub fn f64s(&self, name: &str) -> &[f64] {
        &self.get(name).1
    }

    pub fn f32s(&self, name: &str) -> Vec<f32> {
        self.f64s(name).iter().map(|&x| x as f32).collect()
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        self.f64s(name).iter().map(|&x| x as u8).collect()
    }

    pub fn sizes(&self, name: &str) -> Vec<usize> {
        let sizes = self.json["dims"][name].as_array().unwrap_or_else(|| panic!("{}: no sizes {name}", self.name));
        sizes.iter().map(|n| n.as_u64().expect("a size") as usize).collect()
    }

    pub fn bools(&self, name: &str) -> Vec<bool> {
        self.f64s(name).iter().map(|&x| x != 0.0).collect()
    }

    pub fn indices(&self, name: &str) -> Vec<usize> {
        self.f64s(name).iter().map(|&x| x as usize).collect()
    }

    /// Returns actions: discrete if stored as whole numbers, else continuous.
    pub fn actions(&self, name: &str) -> Actions {
        let values = self.f64s(name);
        match self.shape(name) {
            [_] => Actions::Discrete(values.iter().map(|&x| x as u32).collect()),
            [_, dim] => Actions::Continuous { dim: *dim, values: self.f32s(name) },
            shape => panic!("{name} has shape {shape:?}"),
        }
    }

    pub fn tensor<const D: usize>(&self, name: &str, device: &Device) -> Tensor<D> {
        Tensor::from_data(TensorData::new(self.f32s(name), self.shape(name).to_vec()), device)
    }

    fn get(&self, name: &str) -> &(Vec<usize>, Vec<f64>) {
        self.tensors.get(name).unwrap_or_else(|| panic!("{}: no tensor {name}", self.name))
    }

    /// Compares with the expected tensor `name`.
    pub fn check(&self, name: &str, got: &[f32]) {
        self.checked.borrow_mut().insert(name.to_owned());
        self.compare(name, self.f64s(name), got.iter().map(|&x| f64::from(x)));
    }

    /// Compares with the expected number `name`.
    pub fn check_number(&self, name: &str, got: f64) {
        let want = self.expected(name).as_f64().unwrap_or_else(|| panic!("{}: no number {name}", self.name));
        self.compare(name, &[want], [got].into_iter());
    }

    /// Compares with entry `index` of the expected list `name`.
    pub fn check_entry(&self, name: &str, index: usize, got: f64) {
        let want = self.expected(name)[index].as_f64().unwrap_or_else(|| panic!("{}: no {name}", self.name));
        self.compare(name, &[want], [got].into_iter());
    }

    /// Compares with given numbers by the tolerance of `name`.
    pub fn compare(&self, name: &str, want: &[f64], got: impl ExactSizeIterator<Item = f64>) {
        let tolerance = &self.json["tolerance"];
        let rule = tolerance["overrides"]
            .as_array()
            .and_then(|all| all.iter().find(|o| name.starts_with(o["prefix"].as_str().unwrap_or("?"))))
            .unwrap_or(tolerance);
        let (abs, rel) = (rule["abs"].as_f64().expect("abs"), rule["rel"].as_f64().expect("rel"));
        assert_eq!(want.len(), got.len(), "{}: length of {name}", self.name);
        for (i, (want, got)) in want.iter().zip(got).enumerate() {
            let bound = abs + rel * want.abs();
            assert!((got - want).abs() <= bound, "{}: {name}[{i}] is {got}, expected {want} ± {bound}", self.name);
        }
    }

    /// Asserts that every expected tensor and number was compared, except for those that start with one of `skipped`.
    pub fn finish(&self, skipped: &[&str]) {
        let checked = self.checked.borrow();
        let tensors = self.tensors.keys().filter(|name| {
            ["out.", "grad.", "grad_", "after.", "adam_", "step1_grad."].iter().any(|p| name.starts_with(p))
        });
        let numbers = self.json["expected"].as_object().into_iter().flat_map(|map| map.keys());
        for name in tensors.chain(numbers) {
            let skip = skipped.iter().any(|prefix| name.starts_with(prefix));
            assert!(skip || checked.contains(name), "{}: {name} was not compared", self.name);
        }
    }

    /// Returns the names of the parts of our parameter `name`: both directions of a recurrent layer, or one tensor.
    fn names(&self, group: &str, name: &str) -> Vec<String> {
        let head = if self.has("param.dec.logits.weight") { "dec.logits" } else { "dec.mean" };
        let theirs = format!("{group}{}", their_name(name, head));
        let (stem, last) = theirs.rsplit_once('.').unwrap_or(("", &theirs));
        match stem.rsplit_once(".l").filter(|_| name.contains("gru")) {
            None => vec![theirs],
            Some((stem, layer)) => {
                let forward = format!("{stem}.{last}_l{layer}");
                let both = vec![forward.clone(), format!("{forward}_reverse")];
                if name.contains("uni") { vec![forward] } else { both }
            }
        }
    }

    /// Returns [`Self::names`] with their numbers in our layout, `None` where the case does not hold them.
    fn parts(&self, group: &str, name: &str) -> Vec<(String, Option<Vec<f64>>)> {
        let numbers = |name: String| {
            let values = self.has(&name).then(|| self.transposed(&name));
            (name, values)
        };
        self.names(group, name).into_iter().map(numbers).collect()
    }

    /// Transposes `[out, in]` to `[in, out]`; returns anything else unchanged.
    fn transposed(&self, name: &str) -> Vec<f64> {
        let (shape, values) = self.get(name);
        let [rows, columns] = shape[..] else { return values.clone() };
        (0..rows * columns).map(|i| values[(i % rows) * columns + i / rows]).collect()
    }

    /// Fills `network`'s parameters from the tensors of `group` (`"param."`, `"in."`).
    pub fn fill<M: Parameters>(&self, network: &mut M, group: &str, prefix: &str, device: DeviceKind) {
        network.visit(prefix, &mut Fill { case: self, group, device: device.plain() });
    }

    /// Compares a parameter-like tensor of ours (a gradient, a weight, a moment) with its parts in the case.
    pub fn check_parameter(&self, group: &str, name: &str, got: &[f32]) {
        let parts = self.parts(group, name);
        let length = got.len() / parts.len();
        for ((theirs, want), got) in parts.into_iter().zip(got.chunks_exact(length)) {
            if let Some(want) = want {
                self.compare(&theirs, &want, got.iter().map(|&x| f64::from(x)));
                self.checked.borrow_mut().insert(theirs);
            }
        }
    }

    /// Compares the Euclidean norm of a parameter-like tensor of ours with the number `group` + its name, if there is
    /// one.
    pub fn check_norm(&self, group: &str, name: &str, got: &[f32]) {
        let names = self.names(group, name);
        let length = got.len() / names.len();
        for (theirs, got) in names.into_iter().zip(got.chunks_exact(length)) {
            if self.json["expected"].get(&theirs).is_some() {
                self.check_number(&theirs, norm(got));
            }
        }
    }
}

fn fixtures(folder: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(folder)
}

struct Fill<'a> {
    case: &'a Case,
    group: &'a str,
    device: Device,
}

impl ParamVisitor for Fill<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let mut values = Vec::new();
        for (theirs, part) in self.case.parts(self.group, name) {
            let part = part.unwrap_or_else(|| panic!("{}: no {theirs}", self.case.name));
            values.extend(part.into_iter().map(|x| x as f32));
        }
        assert_eq!(values.len(), tensor.dims().iter().product::<usize>(), "size of {name}");
        *tensor = Tensor::from_data(TensorData::new(values, tensor.dims()), &self.device);
    }
}

/// Returns all numbers of a tensor.
pub fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as::<f32>().expect("readable")
}

/// Returns the Euclidean norm.
pub fn norm(values: &[f32]) -> f64 {
    values.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt()
}

/// Returns the number of a tensor of one element.
pub fn number(tensor: Tensor<1>) -> f64 {
    f64::from(host(tensor)[0])
}
