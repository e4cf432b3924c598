//! A graph that grows node by node.

use crate::messages::{
    AttributeProto, GraphProto, ModelProto, NodeProto, OperatorSetIdProto, StringStringEntryProto, TensorProto,
    ValueInfoProto, attribute_type,
};
use prost::Message;
use std::collections::BTreeSet;

/// Version of the operators.
const OPSET: i64 = 18;

/// Version of the file format, the oldest with these operators.
const IR_VERSION: i64 = 8;

/// An unfinished graph. Nodes and values are named by what they hold.
#[derive(Default)]
pub(crate) struct Graph {
    graph: GraphProto,
    constants: BTreeSet<String>,
    values: usize,
}

/// An attribute of a node.
pub(crate) enum Attribute<'a> {
    Int(&'a str, i64),
    Ints(&'a str, &'a [usize]),
}

impl Attribute<'_> {
    fn proto(&self) -> AttributeProto {
        match *self {
            Self::Int(name, i) => {
                AttributeProto { name: name.to_owned(), i, r#type: attribute_type::INT, ..Default::default() }
            }
            Self::Ints(name, ints) => AttributeProto {
                name: name.to_owned(),
                ints: ints.iter().map(|&i| i as i64).collect(),
                r#type: attribute_type::INTS,
                ..Default::default()
            },
        }
    }
}

impl Graph {
    /// Creates an empty graph.
    pub(crate) fn new(name: &str) -> Self {
        Self { graph: GraphProto { name: name.to_owned(), ..GraphProto::default() }, ..Self::default() }
    }

    /// Adds an input.
    pub(crate) fn input(&mut self, input: ValueInfoProto) -> String {
        let name = input.name.clone();
        self.graph.input.push(input);
        name
    }

    /// Adds an output, the value `of` under the name of the output.
    pub(crate) fn output(&mut self, output: ValueInfoProto, of: &str) {
        let name = output.name.clone();
        self.push("Identity", &[of], &name, &[]);
        self.graph.output.push(output);
    }

    /// Adds a constant of single precision once, under its name.
    pub(crate) fn floats(&mut self, name: &str, shape: &[usize], numbers: &[f32]) -> String {
        self.constant(TensorProto::floats(name, shape, numbers))
    }

    /// Adds a constant of double precision once, under its name.
    pub(crate) fn doubles(&mut self, name: &str, shape: &[usize], numbers: &[f64]) -> String {
        self.constant(TensorProto::doubles(name, shape, numbers))
    }

    /// Adds a vector of whole numbers once, under the name that they give it.
    pub(crate) fn whole(&mut self, numbers: &[i64]) -> String {
        let words: Vec<String> = numbers.iter().map(i64::to_string).collect();
        self.constant(TensorProto::whole(&format!("whole.{}", words.join("_")), numbers))
    }

    fn constant(&mut self, constant: TensorProto) -> String {
        let name = constant.name.clone();
        if self.constants.insert(name.clone()) {
            self.graph.initializer.push(constant);
        }
        name
    }

    /// Adds a node with one output and returns its name.
    pub(crate) fn node(&mut self, op: &str, inputs: &[&str], attributes: &[Attribute<'_>]) -> String {
        self.values += 1;
        let output = format!("{}.{}", op.to_lowercase(), self.values);
        self.push(op, inputs, &output, attributes);
        output
    }

    fn push(&mut self, op: &str, inputs: &[&str], output: &str, attributes: &[Attribute<'_>]) {
        self.push_node(op, inputs, vec![output.to_owned()], attributes);
    }

    fn push_node(&mut self, op: &str, inputs: &[&str], output: Vec<String>, attributes: &[Attribute<'_>]) {
        let name = format!("node.{}", output.last().map_or("", |output| output));
        self.graph.node.push(NodeProto {
            input: inputs.iter().map(|&input| input.to_owned()).collect(),
            output,
            name,
            op_type: op.to_owned(),
            attribute: attributes.iter().map(Attribute::proto).collect(),
            domain: String::new(),
        });
    }

    /// Adds a recurrent layer over one tick, `[1, batch, inputs]`, and returns the state after it, `[1, batch, hidden]`.
    pub(crate) fn gru(&mut self, inputs: &[&str; 6], hidden: usize) -> String {
        self.values += 1;
        let state = format!("gru.{}", self.values);
        let attributes = [Attribute::Int("hidden_size", hidden as i64), Attribute::Int("linear_before_reset", 1)];
        // An empty name leaves out the first output, the states of all ticks.
        self.push_node("GRU", inputs, vec![String::new(), state.clone()], &attributes);
        state
    }

    /// Converts numbers to a data type.
    pub(crate) fn cast(&mut self, value: &str, to: i32) -> String {
        self.node("Cast", &[value], &[Attribute::Int("to", i64::from(to))])
    }

    /// Cuts `from..to` out of an axis.
    pub(crate) fn slice(&mut self, value: &str, axis: usize, from: usize, to: usize) -> String {
        let [starts, ends, axes] = [from, to, axis].map(|number| self.whole(&[number as i64]));
        self.node("Slice", &[value, &starts, &ends, &axes], &[])
    }

    /// Joins values along an axis; a lone value stays as it is.
    pub(crate) fn concat(&mut self, values: &[String], axis: i64) -> String {
        match values {
            [one] => one.clone(),
            values => {
                let values: Vec<&str> = values.iter().map(String::as_str).collect();
                self.node("Concat", &values, &[Attribute::Int("axis", axis)])
            }
        }
    }

    /// Adds an axis of size 1, or removes it.
    pub(crate) fn reaxis(&mut self, op: &str, value: &str, axis: i64) -> String {
        let axes = self.whole(&[axis]);
        self.node(op, &[value, &axes], &[])
    }

    /// Returns the bytes of a file with this graph.
    pub(crate) fn into_bytes(mut self, doc_string: String, metadata: Vec<(String, String)>) -> Vec<u8> {
        self.graph.doc_string.clone_from(&doc_string);
        let metadata_props = metadata.into_iter().map(|(key, value)| StringStringEntryProto { key, value }).collect();
        let model = ModelProto {
            ir_version: IR_VERSION,
            producer_name: "playbot".to_owned(),
            producer_version: env!("CARGO_PKG_VERSION").to_owned(),
            doc_string,
            graph: Some(self.graph),
            opset_import: vec![OperatorSetIdProto { domain: String::new(), version: OPSET }],
            metadata_props,
        };
        model.encode_to_vec()
    }
}
