//! The encoder of sets of things, between a vector observation and the layers of actor and critic.
//!
//! Every thing goes through the same two layers. Their outputs are pooled over the things of a set: the mean and the
//! maximum of each feature, with ln(1 + n) for n things (Zaheer et al. 2017, "Deep sets"; Qi et al. 2017, "PointNet").
//! Attention would compare each pair of things, at a cost that grows with the square of their number, and its sums have
//! no order that is the same for every permutation. Absent things cost nothing here, and the result does not depend on
//! the order of slots to the bit.

use crate::{
    FileError, LearnError, ObsKind,
    entities::EntityBlock,
    file::TensorFile,
    nn::{Linear, ParamSource, ParamVisitor, Parameters, host, matrix, path},
    settings::{Number, Numbers},
};
use burn::tensor::{Bool, Device, Tensor};
use playbot_kernels::{elementwise::Activation, host_numbers::is_host, pool::pool};
use serde::{Deserialize, Serialize};
use std::f64::consts::SQRT_2;

/// Name of the encoder, behind the name of its actor.
pub(crate) const ENTITIES: &str = "entities";

/// The way in which networks read sets of things.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub enum EntityKind {
    /// Slot by slot, as other values.
    Flat,
    /// Through layers that all things of a set share, so that their order is without effect.
    Set {
        /// Width of both layers.
        hidden: usize,
        /// The sets of the observation. An experiment sets them to those of its game.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        blocks: Vec<EntityBlock>,
    },
}

impl Default for EntityKind {
    fn default() -> Self {
        Self::Set { hidden: 64, blocks: Vec::new() }
    }
}

impl EntityKind {
    /// Returns the same for an observation with these sets.
    #[must_use]
    pub fn with_blocks(&self, blocks: Vec<EntityBlock>) -> Self {
        match *self {
            Self::Flat => Self::Flat,
            Self::Set { hidden, .. } => Self::Set { hidden, blocks },
        }
    }

    /// Returns the sets that are read as sets.
    pub fn blocks(&self) -> &[EntityBlock] {
        match self {
            Self::Flat => &[],
            Self::Set { blocks, .. } => blocks,
        }
    }

    /// Returns the form of the encoder for observations of `obs_dim` numbers; `None` without sets.
    pub(crate) fn shape(&self, obs_dim: usize) -> Option<EntityShape> {
        match self {
            Self::Set { hidden, blocks } if !blocks.is_empty() => {
                Some(EntityShape { obs_dim, hidden: *hidden, blocks: blocks.clone() })
            }
            _ => None,
        }
    }
}

/// The width, which must not be 0.
impl Numbers for EntityKind {
    fn numbers(&self) -> Vec<Number> {
        match self {
            Self::Flat => Vec::new(),
            Self::Set { hidden, .. } => vec![Number::Whole(*hidden as u64)],
        }
    }
}

/// The form of an encoder, as files describe it.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct EntityShape {
    /// Numbers of an observation.
    pub(crate) obs_dim: usize,
    /// Width of both layers.
    pub(crate) hidden: usize,
    pub(crate) blocks: Vec<EntityBlock>,
}

impl EntityShape {
    /// Returns the numbers that the encoder gives to the layers behind it.
    pub(crate) fn features(&self) -> usize {
        let of_sets: usize = self.blocks.iter().map(EntityBlock::numbers).fold(0, usize::saturating_add);
        let pooled = self.hidden.saturating_mul(2).saturating_add(1).saturating_mul(self.blocks.len());
        self.obs_dim.saturating_sub(of_sets).saturating_add(pooled)
    }

    /// Checks a shape out of a file.
    pub(crate) fn check(&self, observation: &ObsKind) -> Result<(), LearnError> {
        if *observation != ObsKind::Vector(self.obs_dim) || self.hidden == 0 {
            let text = format!("sets of vectors of {} are not those of {observation}", self.obs_dim);
            return Err(LearnError::Config(text));
        }
        EntityBlock::check_all(&self.blocks, observation)
    }

    /// Returns, for each number behind the encoder of this shape, its place behind one of the shape `old`, whose
    /// observation has the place `source(i)` for value `i` of this one; `None` if its value is new.
    ///
    /// # Errors
    /// [`LearnError::Config`] if a set of `old` has other numbers now, or a set is new.
    pub(crate) fn sources(
        &self,
        old: &Self,
        source: impl Fn(usize) -> Option<usize>,
    ) -> Result<Vec<Option<usize>>, LearnError> {
        let differ = || {
            let text = "its sets of things are others: a policy can get more slots and more values beside them, and no other \
                        sets";
            LearnError::Config(text.to_owned())
        };
        if (self.hidden, self.blocks.len()) != (old.hidden, old.blocks.len()) {
            return Err(differ());
        }
        for (own, theirs) in self.blocks.iter().zip(&old.blocks) {
            let slots = own.slots.min(theirs.slots) * (own.width + 1);
            let is_kept = (0..slots).all(|i| source(own.start + i) == Some(theirs.start + i));
            if own.width != theirs.width || own.slots < theirs.slots || !is_kept {
                return Err(differ());
            }
        }
        let beside = |shape: &Self| -> Vec<usize> {
            (0..shape.obs_dim).filter(|value| !shape.blocks.iter().any(|block| block.range().contains(value))).collect()
        };
        let theirs = beside(old);
        let place = |value: usize| theirs.iter().position(|&theirs| source(value) == Some(theirs));
        let plain = beside(self);
        let pooled = self.blocks.len() * (2 * self.hidden + 1);
        Ok(plain.iter().map(|&value| place(value)).chain((0..pooled).map(|i| Some(theirs.len() + i))).collect())
    }
}

/// The encoder of all sets of an observation: `[…, s]` becomes `[…, b, p]`, where b are the values beside the sets, and p
/// are the pooled features of each set.
#[derive(Clone, Debug)]
pub struct EntityEncoder {
    obs_dim: usize,
    /// The layers of each set, `s0`, `s1`, … in names.
    pub sets: Vec<SetNet>,
}

/// The layers through which each thing of a set goes, each with ReLU behind it.
#[derive(Clone, Debug)]
pub struct SetNet {
    /// Its place in the observation.
    pub block: EntityBlock,
    /// `l0`, `[width, hidden]`, and `l1`, `[hidden, hidden]`.
    pub layers: [Linear; 2],
}

impl EntityEncoder {
    /// Creates an encoder with parameters out of `source`. The starting weights are orthogonal, with gain √2.
    pub(crate) fn build<S: ParamSource>(source: &mut S, prefix: &str, shape: &EntityShape) -> Result<Self, S::Error> {
        let mut sets = Vec::with_capacity(shape.blocks.len());
        for (number, &block) in shape.blocks.iter().enumerate() {
            let prefix = path(prefix, &format!("s{number}"));
            let mut layer = |name, inputs| Linear::build(source, &path(&prefix, name), inputs, shape.hidden, SQRT_2);
            sets.push(SetNet { block, layers: [layer("l0", block.width)?, layer("l1", shape.hidden)?] });
        }
        Ok(Self { obs_dim: shape.obs_dim, sets })
    }

    /// Reads the encoder called `name` out of a file.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(crate) fn stored(
        shape: &EntityShape,
        observation: &ObsKind,
        file: &mut TensorFile,
        name: &str,
        device: &Device,
    ) -> Result<Self, FileError> {
        shape.check(observation).map_err(|error| file.learner(error))?;
        Self::build(&mut file.params(device), name, shape)
    }

    /// Returns its form.
    pub(crate) fn shape(&self) -> EntityShape {
        let hidden = self.sets.first().map_or(0, |set| set.layers[0].weight.dims()[1]);
        EntityShape { obs_dim: self.obs_dim, hidden, blocks: self.sets.iter().map(|set| set.block).collect() }
    }

    /// Encodes rows that end with an observation, `[n, lead + obs_dim]`: `[n, lead + features]`. No gradient goes through
    /// the sets to the rows. The result does not depend on the order of a set's slots, on CPUs to the bit.
    ///
    /// # Errors
    /// [`LearnError::Device`] if the rows cannot be read.
    pub fn forward(&self, x: Tensor<2>) -> Result<Tensor<2>, LearnError> {
        let lead = x.dims()[1].saturating_sub(self.obs_dim);
        let (mut parts, mut from) = (Vec::new(), 0);
        for range in self.sets.iter().map(|set| set.block.range()) {
            let beside = from..lead + range.start;
            if !beside.is_empty() {
                parts.push(x.clone().narrow(1, beside.start, beside.len()));
            }
            from = lead + range.end;
        }
        if from < x.dims()[1] {
            parts.push(x.clone().narrow(1, from, x.dims()[1] - from));
        }
        match is_host(&x.device()) {
            true => self.on_host(x, lead, &mut parts)?,
            false => self.by_tensors(x, lead, &mut parts),
        }
        Ok(Tensor::cat(parts, 1))
    }

    /// Adds the pooled features of each set, for the things that are there alone.
    fn on_host(&self, x: Tensor<2>, lead: usize, parts: &mut Vec<Tensor<2>>) -> Result<(), LearnError> {
        let [n, width] = x.dims();
        let x = x.inner();
        let device = x.device();
        let (rows, mut things) = (host(x)?, Vec::new());
        for SetNet { block, layers: [first, second] } in &self.sets {
            let (mut numbers, mut counts) = (Vec::new(), Vec::with_capacity(n));
            for row in rows.chunks_exact(width.max(1)) {
                block.things(&row[lead..], &mut things);
                things.iter().for_each(|thing| numbers.extend_from_slice(thing));
                counts.push(things.len());
            }
            // Matrix libraries sum a single row in another order than the rows of a matrix.
            let total = counts.iter().sum::<usize>().max(2);
            numbers.resize(total * block.width, 0.0);
            let logs = counts.iter().map(|&count| libm::log1pf(count as f32)).collect();
            let numbers = matrix(numbers, total, block.width, &device);
            let features = Linear::chain(numbers, &[(first, Some(Activation::Relu)), (second, Some(Activation::Relu))]);
            parts.extend([pool(features, counts), matrix(logs, n, 1, &device)]);
        }
        Ok(())
    }

    /// Does [`Self::on_host`] by tensor operations over all slots, for other devices and as a reference. Sums over slots
    /// depend on their order in the last bits.
    fn by_tensors(&self, x: Tensor<2>, lead: usize, parts: &mut Vec<Tensor<2>>) {
        let n = x.dims()[0];
        let x = x.detach();
        for SetNet { block: EntityBlock { start, slots, width }, layers: [first, second] } in &self.sets {
            let slot = width + 1;
            let set: Tensor<2> = x.clone().narrow(1, lead + start, slots * slot).reshape([n * slots, slot]);
            let present: Tensor<2, Bool> = set.clone().narrow(1, 0, 1).greater_elem(0.5);
            let present = present.float();
            let hidden = first.activated(set.narrow(1, 1, *width), Activation::Relu);
            let features = second.activated(hidden, Activation::Relu) * present.clone();
            let hidden = features.dims()[1];
            let features: Tensor<3> = features.reshape([n, *slots, hidden]);
            let count: Tensor<2> = present.reshape([n, *slots]).sum_dim(1);
            let mean: Tensor<2> = features.clone().sum_dim(1).reshape([n, hidden]) / count.clone().clamp_min(1.0);
            // Features are not negative, so absent things are never the only maximum.
            let most: Tensor<2> = features.max_dim(1).reshape([n, hidden]);
            parts.extend([mean, most, count.log1p()]);
        }
    }
}

impl Parameters for EntityEncoder {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        for (number, set) in self.sets.iter_mut().enumerate() {
            let prefix = path(prefix, &format!("s{number}"));
            for (layer, name) in set.layers.iter_mut().zip(["l0", "l1"]) {
                layer.visit(&path(&prefix, name), visitor);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        DeviceKind,
        nn::{NamedGrads, RandomInit, tracked},
        rng::{Streams, normal},
    };

    const BLOCKS: [EntityBlock; 2] =
        [EntityBlock { start: 1, slots: 4, width: 3 }, EntityBlock { start: 18, slots: 2, width: 1 }];
    const OBS: usize = 22;
    const LEAD: usize = 2;

    fn shape(blocks: &[EntityBlock], obs_dim: usize) -> EntityShape {
        EntityShape { obs_dim, hidden: 8, blocks: blocks.to_vec() }
    }

    fn encoder(kind: DeviceKind) -> EntityEncoder {
        let (mut rng, device) = (Streams::new(1).stream("encoder", 0), kind.plain());
        let mut source = RandomInit { rng: &mut rng, device: &device };
        let Ok(encoder) = EntityEncoder::build(&mut source, "", &shape(&BLOCKS, OBS));
        encoder
    }

    /// Returns rows with nothing, something, and everything.
    fn rows(n: usize) -> Vec<f32> {
        let mut rng = Streams::new(2).stream("rows", 0);
        let mut rows: Vec<f32> = (0..n * (LEAD + OBS)).map(|_| normal(&mut rng)).collect();
        for (i, row) in rows.chunks_exact_mut(LEAD + OBS).enumerate() {
            for block in BLOCKS {
                for (slot, numbers) in row[LEAD..][block.range()].chunks_exact_mut(block.width + 1).enumerate() {
                    match (i >> slot) % 2 {
                        0 => numbers.fill(0.0),
                        _ => numbers[0] = 1.0,
                    }
                }
            }
        }
        rows
    }

    /// Returns the outputs, and the gradients of all parameters.
    fn run(kind: DeviceKind, by_tensors: bool) -> (Vec<f32>, NamedGrads) {
        let mut encoder = tracked(&encoder(kind));
        let x = matrix(rows(20), 20, LEAD + OBS, &kind.plain());
        let mut parts = Vec::new();
        match by_tensors {
            true => encoder.by_tensors(x, LEAD, &mut parts),
            false => encoder.on_host(x, LEAD, &mut parts).expect("readable"),
        }
        let y = Tensor::cat(parts, 1);
        let width = y.dims()[1];
        let probe = matrix((0..20 * width).map(|i| (i % 7) as f32 - 3.0).collect(), 20, width, &kind.plain());
        let grads = (y.clone() * probe).sum().backward();
        let named = NamedGrads::read(&mut encoder, "", &grads).expect("readable");
        (host(y.inner()).expect("readable"), named)
    }

    #[test]
    fn present_things_alone_give_what_all_slots_give() {
        for kind in DeviceKind::CPU {
            let ((got, of_got), (want, of_want)) = (run(kind, false), run(kind, true));
            let near = |got: &[f32], want: &[f32], what: &str| {
                assert!(want.iter().any(|x| x.abs() > 0.1), "{what} is a test");
                for (got, want) in got.iter().zip(want) {
                    assert!((got - want).abs() <= 1e-5 * (1.0 + want.abs()), "{what} on {kind}: {got} is not {want}");
                }
            };
            near(&got, &want, "output");
            for set in ["s0", "s1"] {
                for name in ["l0.weight", "l0.bias", "l1.weight", "l1.bias"] {
                    let name = format!("{set}.{name}");
                    near(of_got.get(&name).expect("tracked"), of_want.get(&name).expect("tracked"), &name);
                }
            }
        }
    }

    #[test]
    fn values_beside_the_sets_stay_in_front() {
        let encoder = encoder(DeviceKind::Flex);
        let rows = rows(3);
        let x = matrix(rows.clone(), 3, LEAD + OBS, &DeviceKind::Flex.plain());
        let y = host(encoder.forward(x).expect("readable")).expect("readable");
        let width = LEAD + encoder.shape().features();
        assert_eq!(y.len(), 3 * width);
        for (y, x) in y.chunks_exact(width).zip(rows.chunks_exact(LEAD + OBS)) {
            assert_eq!(y[..4], [x[0], x[1], x[2], x[LEAD + 17]]);
        }
        // The first row has nothing at all.
        assert!(y[4..width].iter().all(|x| *x == 0.0), "{:?}", &y[..width]);
    }

    #[test]
    fn places_of_values_beside_sets_are_found() {
        let block = |start, slots| EntityBlock { start, slots, width: 2 };
        let old = shape(&[block(1, 2)], 8);
        // A value more in front, and a slot more.
        let new = shape(&[block(2, 3)], 12);
        let source = |value: usize| match value {
            0 => Some(0),
            1 => None,
            2..8 => Some(value - 1),
            8..11 => None,
            _ => Some(7),
        };
        let pooled = (2..19).map(Some);
        let want: Vec<Option<usize>> = [Some(0), None, Some(1)].into_iter().chain(pooled).collect();
        assert_eq!(new.sources(&old, source).expect("they fit"), want);
        assert!(old.sources(&new, |value| Some(value + 1)).is_err(), "fewer slots");
        assert!(new.sources(&EntityShape { hidden: 4, ..old.clone() }, source).is_err(), "another width");
        assert!(new.sources(&old, |value| Some(7 - value.min(7))).is_err(), "other places");
    }
}
