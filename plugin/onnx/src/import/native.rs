//! Layers of a policy in the chain of layers of a graph.

use crate::{
    error::OnnxError,
    evaluator::Window,
    export::{CLIP, LOG_STD_RANGE, NATURE_STRIDES},
    import::{
        heads::{Heads, Part, Spread},
        trace::{ConvLayer, DenseLayer, GruWeights, Layer, Link, POSSIBLE},
    },
    policy_form::{ActorShape, Description, MemoryShape, PolicyForm, PolicyShape, StdShape},
};
use playbot_learner::{ActionSpace, ObsKind, PolicyMetadata, nn::CnnKind, policy::NetShape};
use std::{collections::BTreeMap, rc::Rc};

/// Windows of the Impala network.
const CONV: Window = Window { side: 3, stride: 1, pad: 1 };
const POOL: Window = Window { side: 3, stride: 2, pad: 1 };

/// Channels and sides of the convolutions of the Nature network.
const NATURE: [(usize, usize); 3] = [(32, 8), (64, 4), (64, 3)];

/// ln σ of numbers whose file has none: small, so that a policy that draws its actions plays nearly its means.
pub(super) const SMALL_LOG_STD: f64 = -5.0;

/// The parts of a policy.
#[derive(Debug)]
pub(super) struct Native {
    /// Mean and scale of each value of a normalised observation.
    stats: Option<(Vec<f64>, Vec<f64>)>,
    trunk: Option<Trunk>,
    gru: Option<GruWeights>,
    hidden: Vec<DenseLayer>,
    is_tanh: bool,
    head: DenseLayer,
    std: Std,
    /// Numbers that memory and layers read: values of a vector or features of an image.
    seen: usize,
    /// Name of the input that holds the state before a tick, and of the value that is the state after it.
    pub(super) state: Option<(String, String)>,
}

#[derive(Debug)]
enum Std {
    Vector(Vec<f64>),
    State(DenseLayer),
    Squashed(DenseLayer, f64, f64),
}

/// The convolutions over an image, by the names that policy files give them, and the dense layer behind them.
#[derive(Debug)]
struct Trunk {
    kind: CnnKind,
    convs: Vec<(String, ConvLayer)>,
    fc: DenseLayer,
}

impl Native {
    /// Finds the parts of a policy behind these heads.
    pub(super) fn of(heads: &Heads, observed: ObsKind) -> Result<Self, OnnxError> {
        let first = heads.parts.first().map(|part| part.dense.clone());
        let first = first.ok_or_else(|| OnnxError::Misfit("the graph has no output of actions".to_owned()))?;
        let features = first.from[0].clone();
        let mut head: Option<DenseLayer> = None;
        for part in &heads.parts {
            let layer = part.layer(&features)?;
            head = Some(match head {
                None => layer,
                Some(before) => side_by_side(&before, &layer),
            });
        }
        let head = head.ok_or_else(|| first.refused("it is no head"))?;
        let (mut hidden, mut link, mut is_tanh) = (Vec::new(), features.clone(), None);
        let mut trunk = None;
        while let Layer::Relu | Layer::Tanh = link.layer {
            let Layer::Dense(layer) = &link.from[0].layer else {
                return Err(link.refused(&format!("it follows no dense layer; {POSSIBLE}")));
            };
            let behind = link.from[0].from[0].clone();
            let tanh = matches!(link.layer, Layer::Tanh);
            if let (ObsKind::Image(_), false, true) = (observed, tanh, is_image(&behind)) {
                trunk = Some(trunk_of(&behind, layer.clone())?);
                break;
            }
            if is_tanh.replace(tanh).is_some_and(|before| before != tanh) {
                return Err(link.refused("all hidden layers must have the same function, Relu or Tanh"));
            }
            hidden.push(layer.clone());
            link = behind;
        }
        hidden.reverse();
        let mut native = Self {
            stats: None,
            trunk,
            gru: None,
            hidden,
            is_tanh: is_tanh.unwrap_or(false),
            head,
            std: std(heads, &features)?,
            seen: observed.numbers(),
            state: None,
        };
        if native.trunk.is_none() {
            native.base(&link, observed)?;
        }
        if let Some(trunk) = &native.trunk {
            native.seen = trunk.fc.outputs();
        }
        native.check(&features, observed)?;
        Ok(native)
    }

    /// Reads what lies below the hidden layers: an observation or the memory over one.
    fn base(&mut self, link: &Rc<Link>, observed: ObsKind) -> Result<(), OnnxError> {
        let (gru, places) = match &link.layer {
            Layer::Gru(_) => (link.clone(), vec![link.clone()]),
            Layer::Join => {
                let gru = link.from.iter().find(|part| matches!(part.layer, Layer::Gru(_)));
                let gru = gru.ok_or_else(|| {
                    link.refused(
                    "it joins an observation with something that is no state of a GRU, such as a stack of earlier observations",
                    )
                })?;
                (gru.clone(), link.from.clone())
            }
            _ => return self.observation(link, observed),
        };
        let Layer::Gru(layer) = &gru.layer else { return Err(gru.refused("it is no recurrent layer")) };
        let [x, before] = &gru.from[..] else { return Err(gru.refused("it reads something else than a tick")) };
        let Layer::Input(before) = &before.layer else {
            return Err(gru.refused("its state before the tick must be an input of the graph"));
        };
        self.state = Some((before.clone(), gru.value.clone()));
        self.gru = Some(layer.clone());
        self.observation(x, observed)?;
        let seen = x.width();
        // Policies read the observation and then the state.
        let mut rows = Vec::new();
        for part in &places {
            let start = match part.value == x.value {
                true => 0,
                false if part.value == gru.value => seen,
                false => return Err(part.refused("layers behind a recurrent layer read its input, its state, or both")),
            };
            rows.extend(start..start + part.width());
        }
        let reader = self.hidden.first_mut().unwrap_or(&mut self.head);
        let mut placed =
            DenseLayer { weight: vec![0.0; (seen + layer.hidden) * reader.outputs()], bias: reader.bias.clone() };
        let width = reader.outputs().max(1);
        for (row, weights) in rows.iter().zip(reader.weight.chunks_exact(width)) {
            placed.weight[row * width..(row + 1) * width].copy_from_slice(weights);
        }
        *reader = placed;
        if self.hidden.is_empty() && !matches!(self.std, Std::Vector(_)) {
            return Err(gru.refused("a head of log_std needs a hidden layer between it and the recurrent layer"));
        }
        Ok(())
    }

    /// Reads an observation: raw, normalised, or turned into features.
    fn observation(&mut self, link: &Rc<Link>, observed: ObsKind) -> Result<(), OnnxError> {
        match (&link.layer, observed) {
            (Layer::Input(_), ObsKind::Vector(_)) => Ok(()),
            (Layer::Clip(low, high), ObsKind::Vector(width)) => {
                if (*low, *high) != (-CLIP, CLIP) {
                    return Err(link.refused("normalised observations are clipped to ±10 and to nothing else"));
                }
                let (scale, shift) = match &link.from[0].layer {
                    Layer::Input(_) => (vec![1.0; width], vec![0.0; width]),
                    Layer::Affine(scale, shift) if matches!(link.from[0].from[0].layer, Layer::Input(_)) => {
                        (scale.clone(), shift.clone())
                    }
                    _ => return Err(link.refused("it clips something else than the observation")),
                };
                if scale.iter().any(|x| !(x.is_finite() && *x > 0.0)) {
                    return Err(link.refused("the scales before it must be above 0"));
                }
                let mean = shift.iter().zip(&scale).map(|(shift, scale)| -shift / scale).collect();
                self.stats = Some((mean, scale));
                Ok(())
            }
            (Layer::Relu, ObsKind::Image(_)) => match &link.from[0].layer {
                Layer::Dense(fc) if is_image(&link.from[0].from[0]) => {
                    self.trunk = Some(trunk_of(&link.from[0].from[0], fc.clone())?);
                    Ok(())
                }
                _ => Err(link.refused("an image is read by convolutions, a dense layer and Relu")),
            },
            (Layer::Relu | Layer::Tanh | Layer::Dense(_), _) => Err(link.refused(
                "a policy has no dense layers between the observation and its recurrent layer: put them behind it",
            )),
            _ => Err(link.refused(POSSIBLE)),
        }
    }

    /// Checks that each layer reads what the one before it gives.
    fn check(&self, features: &Link, observed: ObsKind) -> Result<(), OnnxError> {
        let memory = self.gru.as_ref().map_or(0, |gru| gru.hidden);
        let mut width = self.seen + memory;
        for layer in self.hidden.iter().chain([&self.head]) {
            if layer.inputs() != width {
                let why = format!("a layer behind it reads {} numbers, and {width} are there", layer.inputs());
                return Err(features.refused(&why));
            }
            width = layer.outputs();
        }
        match (&self.trunk, observed) {
            (None, ObsKind::Image(_)) => {
                Err(features.refused("an image is read by the Nature or Impala network alone"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the contents of a policy file, without examples.
    pub(super) fn into_form(self, space: ActionSpace, observed: ObsKind, metadata: PolicyMetadata) -> PolicyForm {
        let (cnn, image) = match (&self.trunk, observed) {
            (Some(trunk), ObsKind::Image(image)) => (Some(trunk.kind.clone()), Some(image)),
            _ => (None, None),
        };
        let memory = self.gru.as_ref().map(|gru| MemoryShape::Gru { hidden: gru.hidden });
        let activation =
            if self.is_tanh { playbot_learner::nn::Activation::Tanh } else { playbot_learner::nn::Activation::Relu };
        let net = NetShape {
            obs_dim: self.seen + self.gru.as_ref().map_or(0, |gru| gru.hidden),
            latent: 0,
            hidden: self.hidden.iter().map(DenseLayer::outputs).collect(),
            activation,
        };
        let std = match self.std {
            Std::Vector(_) => StdShape::Vector,
            Std::State(_) => StdShape::State,
            Std::Squashed(_, low, high) => StdShape::Squashed(low, high),
        };
        let actor = ActorShape { net, std, cnn, entities: None, memory };
        let normalised = self.stats.is_some();
        let policy = PolicyShape { action_space: space, image, actor, critic: None, normalised };
        let description =
            Description { kind: "policy".to_owned(), version: 1, metadata, policy, skills: None, examples: 0 };
        let mut form = PolicyForm { description, arrays: BTreeMap::new() };
        self.put_arrays(&mut form);
        form
    }

    fn put_arrays(self, form: &mut PolicyForm) {
        if let Some((mean, scale)) = self.stats {
            form.put_double("obs_norm.mean", mean);
            form.put_double("obs_norm.inv_std", scale);
        }
        if let Some(trunk) = self.trunk {
            for (name, conv) in trunk.convs {
                form.put(&format!("actor.cnn.{name}.weight"), &conv.shape, singles(&conv.weight));
                form.put(&format!("actor.cnn.{name}.bias"), &[conv.bias.len()], singles(&conv.bias));
            }
            put_dense(form, "actor.cnn.fc", &trunk.fc);
        }
        if let Some(gru) = &self.gru {
            let hidden = gru.hidden;
            let inputs = gru.input.len() / (3 * hidden);
            form.put("actor.memory.l0.weight_ih", &[1, inputs, 3 * hidden], gates_last(&gru.input, inputs, hidden));
            form.put("actor.memory.l0.weight_hh", &[1, hidden, 3 * hidden], gates_last(&gru.recurrent, hidden, hidden));
            let (of_input, of_state) = gru.bias.split_at(3 * hidden);
            form.put("actor.memory.l0.bias_ih", &[1, 3 * hidden], gates_last(of_input, 1, hidden));
            form.put("actor.memory.l0.bias_hh", &[1, 3 * hidden], gates_last(of_state, 1, hidden));
        }
        for (number, layer) in self.hidden.iter().enumerate() {
            put_dense(form, &format!("actor.l{number}"), layer);
        }
        put_dense(form, "actor.head", &self.head);
        match &self.std {
            Std::Vector(values) if values.is_empty() => {}
            Std::Vector(values) => form.put("actor.log_std", &[values.len()], singles(values)),
            Std::State(layer) | Std::Squashed(layer, ..) => put_dense(form, "actor.log_std", layer),
        }
    }
}

fn singles(numbers: &[f64]) -> Vec<f32> {
    numbers.iter().map(|&x| x as f32).collect()
}

fn put_dense(form: &mut PolicyForm, name: &str, layer: &DenseLayer) {
    form.put(&format!("{name}.weight"), &[layer.inputs(), layer.outputs()], singles(&layer.weight));
    form.put(&format!("{name}.bias"), &[layer.outputs()], singles(&layer.bias));
}

/// Returns the weights of a recurrent layer as policy files have them: `[update | reset | new, inputs]` becomes `[inputs,
/// reset | update | new]`.
fn gates_last(numbers: &[f64], inputs: usize, hidden: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(numbers.len());
    for input in 0..inputs {
        for gate in [1, 0, 2] {
            out.extend((gate * hidden..(gate + 1) * hidden).map(|unit| numbers[unit * inputs + input] as f32));
        }
    }
    out
}

/// Puts the outputs of two layers over the same inputs beside one another.
fn side_by_side(first: &DenseLayer, second: &DenseLayer) -> DenseLayer {
    let rows =
        first.weight.chunks_exact(first.outputs().max(1)).zip(second.weight.chunks_exact(second.outputs().max(1)));
    DenseLayer {
        weight: rows.flat_map(|(first, second)| [first, second].concat()).collect(),
        bias: [&first.bias[..], &second.bias].concat(),
    }
}

impl Part {
    /// Returns its columns of its layer, which must read `features` as the other parts do.
    fn layer(&self, features: &Link) -> Result<DenseLayer, OnnxError> {
        let Layer::Dense(layer) = &self.dense.layer else { return Err(self.dense.refused("it is no dense layer")) };
        if self.dense.from[0].value != features.value {
            return Err(self.dense.refused("all heads of actions must read the same hidden layer"));
        }
        let columns = |row: &[f64]| row[self.columns.clone()].to_vec();
        let weight = layer.weight.chunks_exact(layer.outputs().max(1)).flat_map(columns).collect();
        Ok(DenseLayer { weight, bias: columns(&layer.bias) })
    }
}

/// Returns the standard deviation of these heads.
fn std(heads: &Heads, features: &Rc<Link>) -> Result<Std, OnnxError> {
    let numbers = heads.numbers;
    let constant =
        |value: f64| DenseLayer { weight: vec![0.0; features.width() * numbers], bias: vec![value; numbers] };
    let head = |link: &Rc<Link>| match &link.layer {
        Layer::Dense(layer) if link.from[0].value == features.value && layer.outputs() == numbers => Ok(layer.clone()),
        _ => Err(link.refused("log_std is a constant, or a dense layer on the hidden layer of the mean")),
    };
    match (&heads.spread, heads.is_squashed) {
        (Spread::None, false) => Ok(Std::Vector(vec![SMALL_LOG_STD; numbers])),
        // tanh(0) is in the middle of the range.
        (Spread::None, true) => Ok(Std::Squashed(constant(0.0), SMALL_LOG_STD - 1.0, SMALL_LOG_STD + 1.0)),
        (Spread::Constant(values), false) => Ok(Std::Vector(values.clone())),
        (Spread::Constant(values), true) => {
            let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
            let (low, high) = (low - 1.0, high + 1.0);
            let raw = |x: &f64| libm::atanh((x - low) / (0.5 * (high - low)) - 1.0);
            let layer = DenseLayer { bias: values.iter().map(raw).collect(), ..constant(0.0) };
            Ok(Std::Squashed(layer, low, high))
        }
        (Spread::Layer(link), false) => match &link.layer {
            Layer::Clip(low, high) if (*low as f32, *high as f32) == LOG_STD_RANGE => {
                head(&link.from[0]).map(Std::State)
            }
            Layer::Clip(..) => Err(link.refused("log_std of a state is clipped to -10 and 2")),
            _ => head(link).map(Std::State),
        },
        (Spread::Layer(link), true) => {
            let why = "log_std of a squashed action must be low + 0.5 (high - low) (tanh(x) + 1) of a dense layer: leave \
                       this output out, and the policy plays nearly its means";
            let (Layer::Affine(scale, shift), [tanh]) = (&link.layer, &link.from[..]) else {
                return Err(link.refused(why));
            };
            let is_even = |numbers: &[f64]| numbers.iter().all(|x| (x - numbers[0]).abs() < 1e-9);
            if !matches!(tanh.layer, Layer::Tanh) || !is_even(scale) || !is_even(shift) || scale[0] <= 0.0 {
                return Err(link.refused(why));
            }
            Ok(Std::Squashed(head(&tanh.from[0])?, shift[0] - scale[0], shift[0] + scale[0]))
        }
    }
}

/// Returns whether a value comes from convolutions.
fn is_image(link: &Link) -> bool {
    let below = |link: &Link| matches!(link.layer, Layer::Conv(_) | Layer::Sum | Layer::MaxPool(_));
    below(link) || (matches!(link.layer, Layer::Relu) && below(&link.from[0]))
}

/// Reads the Nature or Impala network whose last activation is `link`.
fn trunk_of(link: &Rc<Link>, fc: DenseLayer) -> Result<Trunk, OnnxError> {
    let feature = fc.outputs();
    let Layer::Relu = link.layer else { return Err(link.refused("the last convolution is followed by Relu")) };
    let mut convs = Vec::new();
    let kind = if matches!(link.from[0].layer, Layer::Sum) {
        let channels = impala(&link.from[0], &mut convs)?;
        CnnKind::Impala { channels, feature }
    } else {
        nature(link, &mut convs)?;
        CnnKind::Nature { feature }
    };
    convs.reverse();
    // The graph reads pixels from 0 to 255, a policy the same divided by 255.
    if let Some((_, first)) = convs.first_mut() {
        first.weight.iter_mut().for_each(|w| *w *= 255.0);
    }
    Ok(Trunk { kind, convs, fc })
}

/// Adds the convolutions of the Nature network, the last first.
fn nature(link: &Rc<Link>, convs: &mut Vec<(String, ConvLayer)>) -> Result<(), OnnxError> {
    let why = "the Nature network has 32 channels of 8x8 at every 4th pixel, 64 of 4x4 at every 2nd and 64 of 3x3, with Relu \
               after each and no padding";
    let mut link = link.clone();
    for layer in (0..NATURE.len()).rev() {
        let (Layer::Relu, [conv]) = (&link.layer, &link.from[..]) else { return Err(link.refused(why)) };
        let Layer::Conv(found) = &conv.layer else { return Err(conv.refused(why)) };
        let (channels, side) = NATURE[layer];
        let window = Window { side, stride: NATURE_STRIDES[layer], pad: 0 };
        if found.window != window || found.shape[0] != channels {
            return Err(conv.refused(why));
        }
        convs.push((format!("conv{layer}"), found.clone()));
        link = conv.from[0].clone();
    }
    ends_in_pixels(&link)
}

/// Adds the convolutions of the Impala network, the last first, and returns the channels of its stages.
fn impala(link: &Rc<Link>, convs: &mut Vec<(String, ConvLayer)>) -> Result<Vec<usize>, OnnxError> {
    let why = "a stage of the Impala network has a 3x3 convolution, max-pooling of 3x3 at every 2nd pixel, and two blocks x + \
               conv(relu(conv(relu(x))))";
    let mut link = link.clone();
    let (mut channels, mut stages) = (Vec::new(), Vec::new());
    while matches!(link.layer, Layer::Sum) {
        let mut of_stage = Vec::new();
        for block in [1, 0] {
            let [a, b] = &link.from[..] else { return Err(link.refused(why)) };
            let (x, mut inner) = match (&link.layer, &a.layer) {
                (Layer::Sum, Layer::Conv(_)) if leads_to(a, b) => (b, a),
                (Layer::Sum, _) => (a, b),
                _ => return Err(link.refused(why)),
            };
            for conv in [1, 0] {
                let layer = conv_of(inner, why)?;
                of_stage.push((format!("res{block}.conv{conv}"), layer));
                let (Layer::Relu, [below]) = (&inner.from[0].layer, &inner.from[0].from[..]) else {
                    return Err(inner.refused(why));
                };
                inner = below;
            }
            if inner.value != x.value {
                return Err(link.refused(why));
            }
            link = x.clone();
        }
        let (Layer::MaxPool(POOL), [conv]) = (&link.layer, &link.from[..]) else { return Err(link.refused(why)) };
        let layer = conv_of(conv, why)?;
        channels.push(layer.shape[0]);
        of_stage.push(("conv".to_owned(), layer));
        stages.push(of_stage);
        link = conv.from[0].clone();
    }
    ends_in_pixels(&link)?;
    let count = stages.len();
    for (at, of_stage) in stages.into_iter().enumerate() {
        let stage = count - 1 - at;
        convs.extend(of_stage.into_iter().map(|(name, layer)| (format!("s{stage}.{name}"), layer)));
    }
    channels.reverse();
    Ok(channels)
}

/// Returns whether two convolutions behind `conv` read `x`.
fn leads_to(conv: &Link, x: &Link) -> bool {
    let below = |link: &Rc<Link>| link.from.first().and_then(|relu| relu.from.first()).cloned();
    let first = conv.from.first().and_then(|relu| relu.from.first()).cloned();
    first.and_then(|first| below(&first)).is_some_and(|end| end.value == x.value)
}

fn conv_of(link: &Link, why: &str) -> Result<ConvLayer, OnnxError> {
    match &link.layer {
        Layer::Conv(layer) if layer.window == CONV => Ok(layer.clone()),
        _ => Err(link.refused(why)),
    }
}

fn ends_in_pixels(link: &Link) -> Result<(), OnnxError> {
    match link.layer {
        Layer::Input(_) => Ok(()),
        _ => Err(link.refused("the first convolution reads the pixels themselves, which may be divided by 255")),
    }
}
