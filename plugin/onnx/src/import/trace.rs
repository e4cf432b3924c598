//! The chain of layers in a graph, found by computing the graph once and noting which layer each value comes from.
//!
//! All sizes are known while the graph is computed, and what does not depend on an input is a constant. A node that only
//! moves numbers is recognised by what it does to their positions.

use crate::{
    error::OnnxError,
    evaluator::{Elem, Evaluator, Value, Window, transposed},
    messages::NodeProto,
};
use std::{collections::BTreeMap, ops::Range, rc::Rc};

/// A dense layer, y = x W + b.
#[derive(Clone, Debug)]
pub(super) struct DenseLayer {
    /// `[inputs, outputs]`.
    pub(super) weight: Vec<f64>,
    pub(super) bias: Vec<f64>,
}

impl DenseLayer {
    pub(super) fn outputs(&self) -> usize {
        self.bias.len()
    }

    pub(super) fn inputs(&self) -> usize {
        self.weight.len().checked_div(self.outputs()).unwrap_or(0)
    }

    /// Returns the layer behind y = x · scale + shift of its inputs.
    fn behind(&self, scale: &[f64], shift: &[f64]) -> Self {
        let (mut weight, mut bias) = (self.weight.clone(), self.bias.clone());
        let width = self.outputs().max(1);
        for ((row, scale), shift) in weight.chunks_exact_mut(width).zip(scale).zip(shift) {
            bias.iter_mut().zip(&*row).for_each(|(bias, weight)| *bias += shift * weight);
            row.iter_mut().for_each(|weight| *weight *= scale);
        }
        Self { weight, bias }
    }
}

/// A convolution.
#[derive(Clone, Debug)]
pub(super) struct ConvLayer {
    /// `[outputs, inputs, side, side]`.
    pub(super) weight: Vec<f64>,
    pub(super) shape: [usize; 4],
    pub(super) bias: Vec<f64>,
    pub(super) window: Window,
}

/// A recurrent layer, with the weights as ONNX has them.
#[derive(Clone, Debug)]
pub(super) struct GruWeights {
    pub(super) hidden: usize,
    /// `[3 * hidden, inputs]`.
    pub(super) input: Vec<f64>,
    /// `[3 * hidden, hidden]`.
    pub(super) recurrent: Vec<f64>,
    /// `[6 * hidden]`.
    pub(super) bias: Vec<f64>,
}

/// The layer that a value comes from. Its inputs are links.
#[derive(Clone, Debug)]
pub(super) enum Layer {
    /// An input of the graph, by its name.
    Input(String),
    /// x · scale + shift, number by number.
    Affine(Vec<f64>, Vec<f64>),
    Clip(f64, f64),
    Dense(DenseLayer),
    Conv(ConvLayer),
    MaxPool(Window),
    Relu,
    Tanh,
    Exp,
    /// The sum of two values.
    Sum,
    /// The state after a tick: its inputs are what it reads and the state before.
    Gru(GruWeights),
    Join,
    Columns(Range<usize>),
    Softmax,
    LogSoftmax,
    LogSumExp,
    ArgMax,
    /// Something that no policy has; the reason.
    Other(String),
}

/// A value, and the layer that it comes from.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) layer: Layer,
    pub(super) from: Vec<Rc<Link>>,
    /// Sizes of the value for one observation.
    pub(super) shape: Vec<usize>,
    /// Name of the value in the graph.
    pub(super) value: String,
    /// The node in words.
    pub(super) node: String,
}

impl Link {
    /// Numbers of the value.
    pub(super) fn width(&self) -> usize {
        self.shape.iter().product()
    }

    /// Returns an error about its node.
    pub(super) fn refused(&self, why: &str) -> OnnxError {
        let why = match &self.layer {
            Layer::Other(reason) => reason.clone(),
            _ => why.to_owned(),
        };
        OnnxError::Unsupported { node: self.node.clone(), why }
    }
}

/// The graph with the links of all values that depend on an input.
pub(super) struct Trace {
    pub(super) links: BTreeMap<String, Rc<Link>>,
    pub(super) values: BTreeMap<String, Value>,
}

/// Operators that only move numbers, or leave them as they are.
const MOVERS: [&str; 12] = [
    "Identity",
    "Dropout",
    "Cast",
    "Reshape",
    "Flatten",
    "Squeeze",
    "Unsqueeze",
    "Transpose",
    "Slice",
    "Split",
    "Gather",
    "Expand",
];

/// What graphs may consist of, for messages.
pub(super) const POSSIBLE: &str = "a graph may have dense layers, convolutions of the Nature or Impala network, Relu or Tanh, one \
                        GRU with linear_before_reset=1, normalisation, Softmax, LogSoftmax and ArgMax";

impl Trace {
    /// Computes the graph for one observation and notes the layers.
    pub(super) fn of(graph: &Evaluator, inputs: BTreeMap<String, Value>) -> Self {
        let mut trace = Self { links: BTreeMap::new(), values: graph.constants.clone() };
        for (name, value) in inputs {
            let node = format!("the input `{name}`");
            let (layer, shape, from) = (Layer::Input(name.clone()), value.shape.clone(), Vec::new());
            trace.links.insert(name.clone(), Rc::new(Link { layer, from, shape, value: name.clone(), node }));
            trace.values.insert(name, value);
        }
        for node in &graph.nodes {
            trace.add(graph, node);
        }
        trace
    }

    /// Computes a node and adds the links of its outputs.
    fn add(&mut self, graph: &Evaluator, node: &NodeProto) {
        let from: Vec<Rc<Link>> = node.input.iter().filter_map(|name| self.links.get(name).cloned()).collect();
        let computed = graph.compute(node, |name| self.values.get(name));
        let outputs = match computed {
            Ok(outputs) => outputs,
            Err(error) => {
                let reason = match error {
                    OnnxError::Compute { why, .. } => format!("{why}; {POSSIBLE}"),
                    error => error.to_string(),
                };
                for name in &node.output {
                    // What it is made of may be at fault already.
                    let first = from.iter().find(|link| matches!(link.layer, Layer::Other(_)));
                    let link = first
                        .cloned()
                        .unwrap_or_else(|| self.link(node, name, Layer::Other(reason.clone()), &[], vec![]));
                    self.links.insert(name.clone(), link);
                }
                return;
            }
        };
        // Sizes are the same for all observations.
        if !from.is_empty() && node.op_type != "Shape" {
            let links: Vec<_> = node
                .output
                .iter()
                .zip(&outputs)
                .enumerate()
                .map(|(at, (name, value))| (name.clone(), self.output(graph, node, &from, at, name, value)))
                .collect();
            self.links.extend(links);
        }
        self.values.extend(node.output.iter().cloned().zip(outputs));
    }

    fn link(&self, node: &NodeProto, value: &str, layer: Layer, from: &[Rc<Link>], shape: Vec<usize>) -> Rc<Link> {
        Rc::new(Link { layer, from: from.to_vec(), shape, value: value.to_owned(), node: node.words() })
    }

    /// Returns the constant behind an input of a node.
    fn constant(&self, node: &NodeProto, at: usize) -> Option<&Value> {
        let name = node.input.get(at).filter(|name| !self.links.contains_key(*name))?;
        self.values.get(name)
    }

    /// Returns the link of an output of a node.
    fn output(
        &self,
        graph: &Evaluator,
        node: &NodeProto,
        from: &[Rc<Link>],
        at: usize,
        name: &str,
        value: &Value,
    ) -> Rc<Link> {
        let shape = value.shape.clone();
        if let Some(other) = from.iter().find(|link| matches!(link.layer, Layer::Other(_))) {
            return other.clone();
        }
        let found = match self.layer(graph, node, from, at, value) {
            Ok(Found::Same(link)) => {
                // Another shape of the same numbers, under the name of the first.
                let Link { layer, from, value, node, .. } = &*link;
                let (layer, from, value, node) = (layer.clone(), from.clone(), value.clone(), node.clone());
                return if link.shape == shape { link } else { Rc::new(Link { layer, from, shape, value, node }) };
            }
            Ok(Found::New(layer, from)) => (layer, from),
            Err(reason) => (Layer::Other(reason), Vec::new()),
        };
        self.link(node, name, found.0, &found.1, shape)
    }

    /// Recognises the layer of an output of a node.
    fn layer(
        &self,
        graph: &Evaluator,
        node: &NodeProto,
        from: &[Rc<Link>],
        at: usize,
        value: &Value,
    ) -> Result<Found, String> {
        let first = &from[0];
        let alone = |layer| Ok(Found::New(layer, vec![first.clone()]));
        let odd = |what: &str| Err(format!("{what}; {POSSIBLE}"));
        match node.op_type.as_str() {
            op if MOVERS.contains(&op) && from.len() == 1 && self.constant(node, 0).is_none() => {
                let positions = self.positions(graph, node, at, first)?;
                match positions {
                    Some(range) if range == (0..first.width()) => Ok(Found::Same(first.clone())),
                    Some(range) => alone(Layer::Columns(range)),
                    None => odd("it changes the order of numbers"),
                }
            }
            "Relu" => alone(Layer::Relu),
            "Tanh" => alone(Layer::Tanh),
            "Exp" => alone(Layer::Exp),
            "Clip" if from.len() == 1 => {
                let bound = |at: usize, name: &str, otherwise: f64| match self.constant(node, at) {
                    Some(bound) => bound.numbers.first().copied().unwrap_or(otherwise),
                    None => node.attribute(name).map_or(otherwise, |attribute| f64::from(attribute.f)),
                };
                alone(Layer::Clip(bound(1, "min", f64::NEG_INFINITY), bound(2, "max", f64::INFINITY)))
            }
            "Softmax" => alone(Layer::Softmax),
            "LogSoftmax" => alone(Layer::LogSoftmax),
            "ReduceLogSumExp" if value.numbers.len() == 1 => alone(Layer::LogSumExp),
            "ArgMax" if value.numbers.len() == 1 => alone(Layer::ArgMax),
            "MaxPool" => alone(Layer::MaxPool(Window::of(node, None)?)),
            "Add" | "Sub" if from.len() == 2 => match (node.op_type.as_str(), &from[1].layer) {
                ("Sub", Layer::LogSumExp) if from[1].from[0].value == first.value => alone(Layer::LogSoftmax),
                ("Add", _) if first.shape == from[1].shape => Ok(Found::New(Layer::Sum, from.to_vec())),
                _ => odd("it combines two values"),
            },
            "Add" | "Sub" | "Mul" | "Div" => self.affine(node, first, value),
            "MatMul" => match self.constant(node, 1) {
                Some(Value { shape, numbers, .. }) if shape.len() == 2 && shape[0] == first.width() => {
                    Ok(dense(first, numbers.clone(), vec![0.0; shape[1]]))
                }
                _ => odd("it multiplies by something else than the weights of a layer for one observation"),
            },
            "Gemm" => self.gemm(node, first),
            "Conv" => self.conv(node, first),
            "GRU" => self.gru(node, from, at),
            "Concat" if from.len() == node.input.len() && value.numbers.len() == *value.shape.last().unwrap_or(&0) => {
                Ok(Found::New(Layer::Join, from.to_vec()))
            }
            other => odd(&format!("a policy has no {other} here")),
        }
    }

    /// Returns which numbers of its input a node takes, if these follow one another: it is computed for positions.
    fn positions(
        &self,
        graph: &Evaluator,
        node: &NodeProto,
        at: usize,
        link: &Link,
    ) -> Result<Option<Range<usize>>, String> {
        let shape = node.input.first().and_then(|name| self.values.get(name)).map(|value| value.shape.clone());
        let shape = shape.unwrap_or_default();
        let places = (0..link.width()).map(|place| place as f64).collect();
        let places = Value::new(Elem::Double, shape, places).ok_or("its input has an unknown shape")?;
        // Not rounded: the type of the input does not matter.
        let mut node = node.clone();
        if node.op_type == "Cast" {
            "Identity".clone_into(&mut node.op_type);
        }
        let input = node.input.first().cloned().unwrap_or_default();
        let known = |name: &str| if name == input { Some(&places) } else { self.values.get(name) };
        let moved = graph.compute(&node, known).map_err(|error| error.to_string())?;
        let moved = moved.get(at).map(|value| &value.numbers[..]).unwrap_or_default();
        let Some(start) = moved.first().map(|first| *first as usize) else { return Ok(None) };
        let follows = moved.iter().enumerate().all(|(i, place)| *place as usize == start + i);
        Ok(follows.then(|| start..start + moved.len()))
    }

    /// Recognises arithmetic with a constant: part of a normalisation or of the layer before.
    fn affine(&self, node: &NodeProto, link: &Rc<Link>, value: &Value) -> Result<Found, String> {
        let count = link.width();
        let is_first = self.constant(node, 0).is_none();
        let constant = self.constant(node, usize::from(is_first)).ok_or("it combines two values")?;
        if value.numbers.len() != count {
            return Err("it makes more numbers of its input".to_owned());
        }
        // The constant as it meets each number.
        let zeros = Value { elem: Elem::Double, shape: value.shape.clone(), numbers: vec![0.0; count] };
        let wide = Value { elem: Elem::Double, ..constant.clone() };
        let sum = NodeProto { op_type: "Add".to_owned(), ..NodeProto::default() };
        let constants = crate::evaluator::apply(&sum, &[Some(&zeros), Some(&wide)])?.numbers;
        let (scale, shift): (Vec<f64>, Vec<f64>) = match (node.op_type.as_str(), is_first) {
            ("Add", _) => constants.iter().map(|c| (1.0, *c)).unzip(),
            ("Sub", true) => constants.iter().map(|c| (1.0, -c)).unzip(),
            ("Sub", false) => constants.iter().map(|c| (-1.0, *c)).unzip(),
            ("Mul", _) => constants.iter().map(|c| (*c, 0.0)).unzip(),
            ("Div", true) if constants.iter().all(|c| *c != 0.0) => constants.iter().map(|c| (1.0 / c, 0.0)).unzip(),
            _ => return Err(format!("it divides by its input or by zero; {POSSIBLE}")),
        };
        if scale.iter().all(|x| *x == 1.0) && shift.iter().all(|x| *x == 0.0) {
            return Ok(Found::Same(link.clone()));
        }
        let after = |before: &[f64], shift_before: &[f64]| -> (Vec<f64>, Vec<f64>) {
            let pairs = before.iter().zip(shift_before).zip(scale.iter().zip(&shift));
            pairs.map(|((a, b), (scale, shift))| (a * scale, b * scale + shift)).unzip()
        };
        Ok(match &link.layer {
            Layer::Affine(before, shift_before) => {
                let (scale, shift) = after(before, shift_before);
                Found::New(Layer::Affine(scale, shift), link.from.clone())
            }
            Layer::Dense(layer) => {
                let weight = layer.weight.iter().enumerate().map(|(i, w)| w * scale[i % count]).collect();
                let (_, bias) = after(&layer.bias, &layer.bias);
                Found::New(Layer::Dense(DenseLayer { weight, bias }), link.from.clone())
            }
            Layer::Conv(conv) => {
                let area = count / conv.bias.len().max(1);
                let is_even = |numbers: &[f64]| numbers.chunks(area.max(1)).all(|c| c.iter().all(|x| *x == c[0]));
                if !is_even(&scale) || !is_even(&shift) {
                    return Err("it treats the pixels of a channel in different ways".to_owned());
                }
                let size = conv.weight.len() / conv.bias.len().max(1);
                let weight = conv.weight.iter().enumerate().map(|(i, w)| w * scale[i / size * area]).collect();
                let bias = conv.bias.iter().enumerate().map(|(c, b)| b * scale[c * area] + shift[c * area]).collect();
                Found::New(Layer::Conv(ConvLayer { weight, bias, ..conv.clone() }), link.from.clone())
            }
            _ => Found::New(Layer::Affine(scale, shift), vec![link.clone()]),
        })
    }

    fn gemm(&self, node: &NodeProto, link: &Rc<Link>) -> Result<Found, String> {
        let Some(Value { shape, numbers, .. }) = self.constant(node, 1) else {
            return Err(format!("its weights are no constants; {POSSIBLE}"));
        };
        let [rows, columns] = shape[..] else { return Err("its weights are no matrix".to_owned()) };
        let (alpha, beta) = (f64::from(node.float("alpha", 1.0)), f64::from(node.float("beta", 1.0)));
        let (mut weight, inputs, outputs) = match node.int("transB", 0) {
            0 => (numbers.clone(), rows, columns),
            _ => (transposed(numbers, rows, columns), columns, rows),
        };
        if inputs != link.width() {
            return Err("it multiplies something else than one observation at a time".to_owned());
        }
        weight.iter_mut().for_each(|w| *w *= alpha);
        let bias = match node.input.get(2).filter(|name| !name.is_empty()) {
            None => vec![0.0; outputs],
            Some(_) => {
                let bias = self.constant(node, 2).ok_or("its bias is no constant")?;
                match bias.numbers[..] {
                    [one] => vec![beta * one; outputs],
                    ref all if all.len() == outputs => all.iter().map(|b| beta * b).collect(),
                    _ => return Err("its bias has another size than its outputs".to_owned()),
                }
            }
        };
        Ok(dense(link, weight, bias))
    }

    fn conv(&self, node: &NodeProto, link: &Rc<Link>) -> Result<Found, String> {
        let weights = self.constant(node, 1).ok_or("its weights are no constants")?;
        let shape: [usize; 4] = weights.shape[..].try_into().map_err(|_| "its weights are not those of images")?;
        let bias = match node.input.get(2).filter(|name| !name.is_empty()) {
            None => vec![0.0; shape[0]],
            Some(_) => self.constant(node, 2).ok_or("its bias is no constant")?.numbers.clone(),
        };
        let window = Window::of(node, Some(shape[2]))?;
        let mut layer = ConvLayer { weight: weights.numbers.clone(), shape, bias, window };
        let Layer::Affine(scale, shift) = &link.layer else {
            return Ok(Found::New(Layer::Conv(layer), vec![link.clone()]));
        };
        let is_even = |numbers: &[f64]| numbers.iter().all(|x| *x == numbers[0]);
        if !is_even(scale) || !is_even(shift) || (shift[0] != 0.0 && window.pad > 0) {
            return Err("pixels must all be scaled alike before it, and not shifted if it pads".to_owned());
        }
        let size = layer.weight.len() / layer.bias.len().max(1);
        for (bias, weights) in layer.bias.iter_mut().zip(layer.weight.chunks_exact_mut(size.max(1))) {
            *bias += shift[0] * weights.iter().sum::<f64>();
            weights.iter_mut().for_each(|w| *w *= scale[0]);
        }
        Ok(Found::New(Layer::Conv(layer), link.from.clone()))
    }

    fn gru(&self, node: &NodeProto, from: &[Rc<Link>], at: usize) -> Result<Found, String> {
        let weights = |at: usize| {
            let weights = self.constant(node, at).map(|value| value.numbers.clone());
            weights.ok_or_else(|| format!("its input {at} is no constant"))
        };
        let hidden = usize::try_from(node.int("hidden_size", 0)).unwrap_or(0);
        let [x, state] = from else {
            return Err(
                "it begins anew with each tick: make its state before the tick an input of the graph, and the one \
                        after it an output"
                    .to_owned(),
            );
        };
        let is_state = node.input.get(5).is_some_and(|name| self.links.contains_key(name));
        if !is_state || at > 1 || hidden == 0 || state.width() != hidden {
            return Err("it must read one observation and the state of one agent".to_owned());
        }
        let bias =
            if node.input.get(3).is_some_and(|name| !name.is_empty()) { weights(3)? } else { vec![0.0; 6 * hidden] };
        let mut layer = GruWeights { hidden, input: weights(1)?, recurrent: weights(2)?, bias };
        let (x, scale, shift) = match &x.layer {
            Layer::Affine(scale, shift) => (x.from[0].clone(), scale.clone(), shift.clone()),
            _ => (x.clone(), vec![1.0; x.width()], vec![0.0; x.width()]),
        };
        for (unit, weights) in layer.input.chunks_exact_mut(scale.len().max(1)).enumerate() {
            layer.bias[unit] += weights.iter().zip(&shift).map(|(w, s)| w * s).sum::<f64>();
            weights.iter_mut().zip(&scale).for_each(|(w, s)| *w *= s);
        }
        Ok(Found::New(Layer::Gru(layer), vec![x, state.clone()]))
    }
}

/// What an output of a node is.
enum Found {
    /// The same numbers as another value.
    Same(Rc<Link>),
    /// The output of a layer.
    New(Layer, Vec<Rc<Link>>),
}

/// Returns a dense layer behind a value. Arithmetic and another dense layer right before it become part of it.
fn dense(link: &Rc<Link>, weight: Vec<f64>, bias: Vec<f64>) -> Found {
    let layer = DenseLayer { weight, bias };
    match &link.layer {
        Layer::Affine(scale, shift) => Found::New(Layer::Dense(layer.behind(scale, shift)), link.from.clone()),
        Layer::Dense(first) => {
            let outputs = layer.outputs().max(1);
            let product = |row: &[f64]| {
                let mut sums = vec![0.0; outputs];
                for (x, weights) in row.iter().zip(layer.weight.chunks_exact(outputs)) {
                    sums.iter_mut().zip(weights).for_each(|(sum, w)| *sum += x * w);
                }
                sums
            };
            let weight = first.weight.chunks_exact(first.outputs().max(1)).flat_map(product).collect();
            let bias = product(&first.bias).iter().zip(&layer.bias).map(|(a, b)| a + b).collect();
            Found::New(Layer::Dense(DenseLayer { weight, bias }), link.from.clone())
        }
        Layer::Join => {
            // Arithmetic on single parts.
            let (mut scale, mut shift, mut from) = (Vec::new(), Vec::new(), Vec::new());
            for part in &link.from {
                match &part.layer {
                    Layer::Affine(of_part, by) => {
                        scale.extend_from_slice(of_part);
                        shift.extend_from_slice(by);
                        from.push(part.from[0].clone());
                    }
                    _ => {
                        scale.extend(vec![1.0; part.width()]);
                        shift.extend(vec![0.0; part.width()]);
                        from.push(part.clone());
                    }
                }
            }
            let Link { shape, value, node, .. } = &**link;
            let (layer, value, node) = (layer.behind(&scale, &shift), value.clone(), node.clone());
            let join = Link { layer: Layer::Join, from, shape: shape.clone(), value, node };
            Found::New(Layer::Dense(layer), vec![Rc::new(join)])
        }
        _ => Found::New(Layer::Dense(layer), vec![link.clone()]),
    }
}
