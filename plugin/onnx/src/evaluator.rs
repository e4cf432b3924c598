//! Reference evaluation of ONNX graphs, node by node, in double precision.
//!
//! Single-precision values are rounded after each node. Speed is no goal: the evaluator folds constants and checks
//! translations.
//!
//! - `operators`: the operators.

mod operators;

use crate::{
    error::OnnxError,
    messages::{EXTERNAL, ModelProto, NodeProto, TensorProto, ValueInfoProto, data_type},
};
use prost::Message;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

pub(crate) use crate::evaluator::operators::{Window, transposed};

/// Most numbers of a value: any more are a damaged file.
pub(crate) const MOST_NUMBERS: usize = 1 << 28;

/// The type of a value's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elem {
    /// `float32`.
    Single,
    /// `float64`.
    Double,
    /// `uint8`.
    Byte,
    /// Any other whole numbers.
    Whole,
    /// True or false.
    Flag,
}

impl Elem {
    /// Returns the type with this number in ONNX files.
    pub(crate) fn of(data_type: i32) -> Option<Self> {
        Some(match data_type {
            data_type::FLOAT => Self::Single,
            data_type::DOUBLE => Self::Double,
            data_type::UINT8 => Self::Byte,
            data_type::INT8 | data_type::INT32 | data_type::INT64 => Self::Whole,
            data_type::BOOL => Self::Flag,
            _ => return None,
        })
    }

    /// Returns a number as this type has it.
    pub(crate) fn round(self, number: f64) -> f64 {
        match self {
            Self::Single => f64::from(number as f32),
            Self::Double => number,
            Self::Byte => f64::from(number as u8),
            Self::Whole => number.trunc(),
            Self::Flag => f64::from(u8::from(number != 0.0)),
        }
    }
}

/// A value of a graph: numbers of any type as double precision, row-major.
///
/// ```
/// use playbot_onnx::{Elem, Value};
///
/// let value = Value::new(Elem::Single, vec![1, 2], vec![0.5, 0.25]).expect("two numbers");
/// assert_eq!((value.shape(), value.numbers()), (&[1, 2][..], &[0.5, 0.25][..]));
/// assert!(Value::new(Elem::Single, vec![3], vec![0.5]).is_none());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    pub(crate) elem: Elem,
    pub(crate) shape: Vec<usize>,
    pub(crate) numbers: Vec<f64>,
}

impl Value {
    /// Creates a value; `None` if the numbers do not fill the shape.
    pub fn new(elem: Elem, shape: Vec<usize>, numbers: Vec<f64>) -> Option<Self> {
        let size = shape.iter().try_fold(1_usize, |size, &side| size.checked_mul(side))?;
        (size == numbers.len()).then_some(Self { elem, shape, numbers })
    }

    /// Returns its sizes.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Returns its numbers.
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Reads an array out of a file.
    fn of_proto(proto: &TensorProto) -> Result<Self, String> {
        if proto.data_location == EXTERNAL || !proto.external_data.is_empty() {
            let entry = proto.external_data.iter().find(|entry| entry.key == "location");
            let file = entry.map_or_else(|| "another file".to_owned(), |entry| format!("the file `{}`", entry.value));
            return Err(format!(
                "the array `{}` lies in {file} (external data): save the model in one file, in torch with \
                 external_data=False",
                proto.name
            ));
        }
        let name = &proto.name;
        let elem = Elem::of(proto.data_type);
        let elem = elem.ok_or_else(|| format!("the array `{name}` has numbers of type {}", proto.data_type))?;
        let shape: Option<Vec<usize>> = proto.dims.iter().map(|&size| usize::try_from(size).ok()).collect();
        let shape = shape.filter(|shape| {
            let size = shape.iter().try_fold(1_usize, |size, &side| size.checked_mul(side));
            size.is_some_and(|size| size <= MOST_NUMBERS)
        });
        let shape = shape.ok_or_else(|| format!("the array `{name}` has impossible sizes: {:?}", proto.dims))?;
        let raw = &proto.raw_data;
        let numbers: Vec<f64> = match proto.data_type {
            _ if raw.is_empty() && proto.data_type == data_type::FLOAT => {
                proto.float_data.iter().map(|&x| f64::from(x)).collect()
            }
            _ if raw.is_empty() && proto.data_type == data_type::DOUBLE => proto.double_data.clone(),
            _ if raw.is_empty() && proto.data_type == data_type::INT64 => {
                proto.int64_data.iter().map(|&x| x as f64).collect()
            }
            _ if raw.is_empty() => proto.int32_data.iter().map(|&x| f64::from(x)).collect(),
            data_type::FLOAT => {
                bytemuck::pod_collect_to_vec::<u8, f32>(whole(raw, 4, name)?).iter().map(|&x| f64::from(x)).collect()
            }
            data_type::DOUBLE => bytemuck::pod_collect_to_vec(whole(raw, 8, name)?),
            data_type::INT64 => {
                bytemuck::pod_collect_to_vec::<u8, i64>(whole(raw, 8, name)?).iter().map(|&x| x as f64).collect()
            }
            data_type::INT32 => {
                bytemuck::pod_collect_to_vec::<u8, i32>(whole(raw, 4, name)?).iter().map(|&x| f64::from(x)).collect()
            }
            data_type::INT8 => raw.iter().map(|&x| f64::from(x.cast_signed())).collect(),
            _ => raw.iter().map(|&x| f64::from(x)).collect(),
        };
        let count = numbers.len();
        Self::new(elem, shape, numbers)
            .ok_or_else(|| format!("the array `{name}` has {count} numbers, which are not those of {:?}", proto.dims))
    }

    /// Returns the first number that is NaN or infinite, if any.
    fn not_finite(&self) -> Option<f64> {
        self.numbers.iter().copied().find(|x| !x.is_finite())
    }

    /// Returns its numbers as whole ones.
    pub(crate) fn wholes(&self) -> Vec<i64> {
        self.numbers.iter().map(|&x| x as i64).collect()
    }
}

/// Checks that bytes are whole numbers of `size` bytes.
fn whole<'a>(raw: &'a [u8], size: usize, name: &str) -> Result<&'a [u8], String> {
    if raw.len().is_multiple_of(size) { Ok(raw) } else { Err(format!("the array `{name}` is cut off")) }
}

/// An input or output of a graph.
#[derive(Clone, Debug)]
pub(crate) struct Port {
    pub(crate) name: String,
    /// Its type; `None` if unknown.
    pub(crate) elem: Option<Elem>,
    /// Its sizes, `None` for free ones; `None` if it has no shape.
    pub(crate) sizes: Option<Vec<Option<usize>>>,
}

impl Port {
    fn of(proto: &ValueInfoProto) -> Self {
        Self { name: proto.name.clone(), elem: Elem::of(proto.elem_type()), sizes: proto.sizes() }
    }
}

/// A graph that can be computed.
///
/// It knows the operators that policies of common trainers consist of, and names any other one.
///
/// ```no_run
/// use playbot_onnx::{Elem, Evaluator, Value};
/// use std::{collections::BTreeMap, path::Path};
///
/// let path = Path::new("bot.onnx");
/// let graph = Evaluator::parse(path, &std::fs::read(path)?)?;
/// let observation = Value::new(Elem::Single, vec![1, 2], vec![0.1, 0.2]).expect("two numbers");
/// let inputs = BTreeMap::from([("observation".to_owned(), observation)]);
/// let outputs = graph.run(inputs, &["action"])?;
/// println!("{:?}", outputs["action"].numbers());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Evaluator {
    pub(crate) nodes: Vec<NodeProto>,
    pub(crate) constants: BTreeMap<String, Value>,
    pub(crate) inputs: Vec<Port>,
    pub(crate) outputs: Vec<Port>,
    pub(crate) opset: i64,
    metadata: BTreeMap<String, String>,
    producer: String,
}

impl Evaluator {
    /// Reads an ONNX file in memory; `path` is for messages.
    ///
    /// # Errors
    /// [`OnnxError::Foreign`] if it is no ONNX file, is cut off, keeps arrays in another file, or has weights that are
    /// NaN or infinite.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, OnnxError> {
        let foreign = |detail: String| OnnxError::Foreign { path: path.to_owned(), detail };
        let advice = "it is no ONNX file, or it is cut off: export it again";
        let model = ModelProto::decode(bytes).map_err(|error| foreign(format!("{advice} ({error})")))?;
        let (Some(graph), [_, ..]) = (model.graph, &model.opset_import[..]) else {
            return Err(foreign(advice.to_owned()));
        };
        let opset = model.opset_import.iter().find(|set| set.domain.is_empty() || set.domain == "ai.onnx");
        let mut constants = BTreeMap::new();
        for proto in &graph.initializer {
            let value = Value::of_proto(proto).map_err(&foreign)?;
            if let (Some(number), Elem::Single | Elem::Double) = (value.not_finite(), value.elem) {
                return Err(foreign(format!("the array `{}` holds the number {number}", proto.name)));
            }
            constants.insert(proto.name.clone(), value);
        }
        let inputs = graph.input.iter().filter(|input| !constants.contains_key(&input.name)).map(Port::of).collect();
        Ok(Self {
            inputs,
            outputs: graph.output.iter().map(Port::of).collect(),
            nodes: graph.node,
            constants,
            opset: opset.map_or(0, |set| set.version),
            metadata: model.metadata_props.into_iter().map(|entry| (entry.key, entry.value)).collect(),
            producer: format!("{} {}", model.producer_name, model.producer_version).trim().to_owned(),
        })
    }

    /// Returns the names of its inputs.
    pub fn inputs(&self) -> impl Iterator<Item = &str> {
        self.inputs.iter().map(|port| port.name.as_str())
    }

    /// Returns the names of its outputs.
    pub fn outputs(&self) -> impl Iterator<Item = &str> {
        self.outputs.iter().map(|port| port.name.as_str())
    }

    /// Returns an entry of its metadata.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.get(key).map(String::as_str)
    }

    /// Returns name and version of the program that wrote it; empty if it does not say.
    pub fn producer(&self) -> &str {
        &self.producer
    }

    /// Computes values by their names. Nodes that these do not need are skipped.
    ///
    /// # Errors
    /// [`OnnxError::Compute`] names the first node that cannot be computed; [`OnnxError::Misfit`] names a value that no
    /// node and no input gives.
    pub fn run(&self, inputs: BTreeMap<String, Value>, wanted: &[&str]) -> Result<BTreeMap<String, Value>, OnnxError> {
        let mut needed: BTreeSet<&str> = wanted.iter().copied().collect();
        let mut is_needed = vec![false; self.nodes.len()];
        for (node, is_needed) in self.nodes.iter().zip(&mut is_needed).rev() {
            *is_needed = node.output.iter().any(|output| needed.contains(output.as_str()));
            if *is_needed {
                needed.extend(node.input.iter().map(String::as_str));
            }
        }
        let mut values = inputs;
        for (node, _) in self.nodes.iter().zip(is_needed).filter(|(_, is_needed)| *is_needed) {
            let outputs = self.compute(node, |name| values.get(name).or_else(|| self.constants.get(name)))?;
            values.extend(node.output.iter().cloned().zip(outputs));
        }
        let found = |name: &&str| {
            let value = values.get(*name).or_else(|| self.constants.get(*name));
            let value = value.ok_or_else(|| OnnxError::Misfit(format!("the graph has no value `{name}`")))?;
            Ok(((*name).to_owned(), value.clone()))
        };
        wanted.iter().map(found).collect()
    }

    /// Computes one node from values that are known.
    pub(crate) fn compute<'a>(
        &self,
        node: &NodeProto,
        known: impl Fn(&str) -> Option<&'a Value>,
    ) -> Result<Vec<Value>, OnnxError> {
        let failed = |why: String| OnnxError::Compute { node: node.words(), why };
        let mut inputs = Vec::with_capacity(node.input.len());
        for name in &node.input {
            match (name.is_empty(), known(name)) {
                (true, _) => inputs.push(None),
                (false, Some(value)) => inputs.push(Some(value)),
                (false, None) => return Err(failed(format!("no node and no input gives `{name}`"))),
            }
        }
        if !node.domain.is_empty() && node.domain != "ai.onnx" {
            return Err(failed(format!("its domain `{}` is unknown", node.domain)));
        }
        let mut outputs = match node.op_type.as_str() {
            "Constant" => vec![constant(node).map_err(failed)?],
            _ => operators::apply(node, &inputs, self.opset).map_err(failed)?,
        };
        for value in &mut outputs {
            let size = value.shape.iter().try_fold(1_usize, |size, &side| size.checked_mul(side));
            if size != Some(value.numbers.len()) {
                return Err(failed(format!("its sizes {:?} are impossible", value.shape)));
            }
            let elem = value.elem;
            value.numbers.iter_mut().for_each(|number| *number = elem.round(*number));
        }
        Ok(outputs)
    }
}

/// Applies an operator with one output, without rounding.
pub(crate) fn apply(node: &NodeProto, inputs: &[Option<&Value>]) -> Result<Value, String> {
    let outputs = operators::apply(node, inputs, i64::MAX)?;
    outputs.into_iter().next().ok_or_else(|| "it has no output".to_owned())
}

/// Returns the value of a node without inputs.
fn constant(node: &NodeProto) -> Result<Value, String> {
    let vector = |elem, numbers: Vec<f64>| Value { elem, shape: vec![numbers.len()], numbers };
    let scalar = |elem, number| Value { elem, shape: Vec::new(), numbers: vec![number] };
    match node.attribute.first() {
        Some(attribute) => match (attribute.name.as_str(), &attribute.t) {
            ("value", Some(tensor)) => Value::of_proto(tensor),
            ("value_int", _) => Ok(scalar(Elem::Whole, attribute.i as f64)),
            ("value_float", _) => Ok(scalar(Elem::Single, f64::from(attribute.f))),
            ("value_ints", _) => Ok(vector(Elem::Whole, attribute.ints.iter().map(|&i| i as f64).collect())),
            ("value_floats", _) => Ok(vector(Elem::Single, attribute.floats.iter().map(|&x| f64::from(x)).collect())),
            (other, _) => Err(format!("its attribute `{other}` is unknown")),
        },
        None => Err("it has no value".to_owned()),
    }
}

/// Reads the value that a `ConstantOfShape` repeats; zero without.
pub(crate) fn repeated(node: &NodeProto) -> Result<Value, String> {
    match node.attribute("value").and_then(|attribute| attribute.t.as_ref()) {
        Some(tensor) => Value::of_proto(tensor),
        None => Ok(Value { elem: Elem::Single, shape: vec![1], numbers: vec![0.0] }),
    }
}
