//! The outputs of a graph that describe an action: logits, means and standard deviations.

use crate::{
    error::OnnxError,
    evaluator::{Evaluator, Value},
    import::trace::{Layer, Link, Trace},
};
use playbot_learner::{ActionSpace, brief_number};
use std::{collections::BTreeMap, ops::Range, rc::Rc};

/// Columns of a dense layer, the logits of one choice or the means.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) dense: Rc<Link>,
    pub(super) columns: Range<usize>,
}

/// The source of ln σ in a graph.
#[derive(Clone, Debug)]
pub(super) enum Spread {
    /// The graph says nothing of it.
    None,
    /// The same for all observations.
    Constant(Vec<f64>),
    /// ln σ of each observation.
    Layer(Rc<Link>),
}

/// The heads of a policy in a graph.
#[derive(Clone, Debug)]
pub(super) struct Heads {
    /// The logits of each choice, and then the means, if there are numbers.
    pub(super) parts: Vec<Part>,
    /// True if actions are the tanh of the mean.
    pub(super) is_squashed: bool,
    pub(super) spread: Spread,
    pub(super) numbers: usize,
    /// The outputs that were taken.
    pub(super) taken: Vec<String>,
}

/// Words in the names of outputs that are actions.
const ACTIONS: [&str; 9] = ["logit", "prob", "action", "choice", "policy", "mean", "mu", "numbers", "q_"];

/// Words in the names of outputs that are something else.
const OTHERS: [&str; 6] = ["value", "critic", "std", "sigma", "scale", "state"];

impl Heads {
    /// Finds the heads of actions of `space` among the outputs of a graph.
    pub(super) fn of(graph: &Evaluator, trace: &Trace, space: ActionSpace) -> Result<Self, OnnxError> {
        let mut outputs: Vec<(&str, Rc<Link>)> = graph
            .outputs
            .iter()
            .filter_map(|port| Some((port.name.as_str(), trace.links.get(&port.name)?.clone())))
            .collect();
        // The most telling names first, otherwise in their own order.
        outputs.sort_by_key(|(name, _)| std::cmp::Reverse(weight(name)));
        let mut heads = Self {
            parts: Vec::new(),
            is_squashed: false,
            spread: Spread::None,
            numbers: space.numbers(),
            taken: Vec::new(),
        };
        if space.options() > 0 {
            let sizes: Vec<usize> = space.choices().ranges().map(|range| range.len()).collect();
            let found = outputs.iter().find_map(|(name, link)| Some((*name, choices(link, &sizes)?)));
            let (name, parts) = found.ok_or_else(|| missing(&outputs, space, "logits or choices"))?;
            heads.parts.extend(parts);
            heads.taken.push(name.to_owned());
        }
        if space.numbers() > 0 {
            let found: Vec<_> =
                outputs.iter().filter_map(|(name, link)| Some((*name, means(link, space.numbers())?))).collect();
            let (name, (part, _)) = found.first().ok_or_else(|| missing(&outputs, space, "means"))?;
            // An output `mean` may have its tanh beside it.
            let same = |other: &Part| (&other.dense.value, &other.columns) == (&part.dense.value, &part.columns);
            heads.is_squashed = found.iter().any(|(_, (other, is_squashed))| *is_squashed && same(other));
            heads.parts.push(part.clone());
            heads.taken.push((*name).to_owned());
            heads.spread = heads.spread_of(graph, trace)?;
        }
        Ok(heads)
    }

    /// Finds ln σ among the outputs of a graph.
    fn spread_of(&mut self, graph: &Evaluator, trace: &Trace) -> Result<Spread, OnnxError> {
        let is_spread = |name: &str| ["std", "sigma"].iter().any(|word| name.to_lowercase().contains(word));
        let Some(port) = graph.outputs.iter().find(|port| is_spread(&port.name)) else { return Ok(Spread::None) };
        let is_log = port.name.to_lowercase().contains("log");
        self.taken.push(port.name.clone());
        if let Some(link) = trace.links.get(&port.name) {
            return match (&link.layer, is_log) {
                (Layer::Exp, false) => Ok(Spread::Layer(link.from[0].clone())),
                (_, true) => Ok(Spread::Layer(link.clone())),
                _ => Err(link.refused("a standard deviation is exp of its logarithm")),
            };
        }
        let misfit = |detail: &str| OnnxError::Misfit(format!("the output `{}` {detail}", port.name));
        let value = trace.values.get(&port.name).ok_or_else(|| misfit("has no value"))?;
        let numbers: Vec<f64> = match (value.numbers(), is_log) {
            (numbers, true) => numbers.to_vec(),
            (numbers, false) => numbers.iter().map(|&x| libm::log(x)).collect(),
        };
        let numbers = if numbers.len() == 1 { numbers.repeat(self.numbers) } else { numbers };
        if numbers.len() != self.numbers || numbers.iter().any(|x| !x.is_finite()) {
            return Err(misfit(&format!("must be {} numbers, one for each of the action", self.numbers)));
        }
        Ok(Spread::Constant(numbers))
    }

    /// Returns the names of the values that the heads compute, for a comparison.
    pub(super) fn values(&self) -> Vec<&str> {
        let spread = match &self.spread {
            Spread::Layer(link) => Some(link.value.as_str()),
            _ => None,
        };
        self.parts.iter().map(|part| part.dense.value.as_str()).chain(spread).collect()
    }

    /// Returns logarithms of probabilities and means, and ln σ if it is known, from these values.
    pub(super) fn distribution(&self, values: &BTreeMap<String, Value>) -> (Vec<f64>, Option<Vec<f64>>) {
        let mut head = Vec::new();
        for (at, part) in self.parts.iter().enumerate() {
            let numbers = values.get(&part.dense.value).map(|value| value.numbers()).unwrap_or_default();
            let part_of = numbers.get(part.columns.clone()).unwrap_or_default();
            if self.numbers > 0 && at + 1 == self.parts.len() {
                head.extend_from_slice(part_of);
                continue;
            }
            let largest = part_of.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = part_of.iter().map(|x| libm::exp(x - largest)).sum();
            head.extend(part_of.iter().map(|x| x - largest - libm::log(sum)));
        }
        let spread = match &self.spread {
            Spread::None => None,
            Spread::Constant(numbers) => Some(numbers.clone()),
            Spread::Layer(link) => values.get(&link.value).map(|value| value.numbers().to_vec()),
        };
        (head, spread)
    }
}

/// Returns how telling the name of an output is.
fn weight(name: &str) -> u8 {
    let name = name.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    match (has(&ACTIONS), has(&OTHERS)) {
        (true, _) => 2,
        (false, false) => 1,
        (false, true) => 0,
    }
}

/// Returns columns of a dense layer.
fn columns(link: &Rc<Link>) -> Option<Part> {
    match &link.layer {
        Layer::Dense(layer) => Some(Part { dense: link.clone(), columns: 0..layer.outputs() }),
        Layer::Columns(range) => {
            let part = columns(&link.from[0])?;
            let start = part.columns.start;
            Some(Part { columns: start + range.start..start + range.end, ..part })
        }
        _ => None,
    }
}

/// Returns the logits of choices of these sizes behind a value: logits, their (logarithms of) probabilities, or the
/// options taken.
fn choices(link: &Rc<Link>, sizes: &[usize]) -> Option<Vec<Part>> {
    if let (Layer::Join, [_, _, ..]) = (&link.layer, sizes) {
        let parts = link.from.iter().zip(sizes).map(|(part, &size)| choices(part, &[size]));
        let parts: Vec<Part> = parts.collect::<Option<Vec<_>>>()?.concat();
        return (link.from.len() == sizes.len()).then_some(parts);
    }
    let mut link = link.clone();
    while let (Layer::Softmax | Layer::LogSoftmax | Layer::ArgMax, [_]) = (&link.layer, sizes) {
        link = link.from[0].clone();
    }
    let part = columns(&link)?;
    if part.columns.len() != sizes.iter().sum::<usize>() {
        return None;
    }
    let mut start = part.columns.start;
    let of_size = |&size: &usize| {
        start += size;
        Part { columns: start - size..start, ..part.clone() }
    };
    Some(sizes.iter().map(of_size).collect())
}

/// Returns the means behind a value of `count` numbers, and whether the value is their tanh.
fn means(link: &Rc<Link>, count: usize) -> Option<(Part, bool)> {
    let (link, is_squashed) = match &link.layer {
        Layer::Tanh => (&link.from[0], true),
        _ => (link, false),
    };
    columns(link).filter(|part| part.columns.len() == count).map(|part| (part, is_squashed))
}

/// Returns the error of a graph without a head: because of a node, or with the sizes that are there.
fn missing(outputs: &[(&str, Rc<Link>)], space: ActionSpace, what: &str) -> OnnxError {
    // The reason of the most telling output, if a node on its way is no layer.
    if let Some((_, odd)) = outputs.first().filter(|(_, link)| matches!(link.layer, Layer::Other(_))) {
        return odd.refused("it is no layer of a policy");
    }
    let size = |(name, link): &(&str, Rc<Link>)| {
        let mut inner = link;
        while let (Layer::ArgMax | Layer::Softmax | Layer::LogSoftmax, Some(below)) = (&inner.layer, inner.from.first())
        {
            inner = below;
        }
        format!("`{name}` of {}", brief_number(inner.width() as f64))
    };
    let sizes: Vec<String> = outputs.iter().map(size).collect();
    let there = if sizes.is_empty() { "none that depends on the observation".to_owned() } else { sizes.join(", ") };
    OnnxError::Misfit(format!(
        "the game has {space}, and no output of the graph has {what} of that size behind a dense layer: its outputs are {there}"
    ))
}
