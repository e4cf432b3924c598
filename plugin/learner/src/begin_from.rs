//! The start of a learner from the checkpoint of another run: which layers it takes over, and where new inputs go.
//!
//! Layers are taken from the input on, up to the first that does not fit: a layer behind another one would read
//! features that it has never seen. An observation may have grown. The rows of its new values in the first layers are 0,
//! so outputs stay the same to the bit: products with 0 change no sum.

use crate::{
    EntityBlock, EntitySet, LearnError, ObsKind,
    device::send,
    nn::{Adam, ParamVisitor, Parameters, host},
    norm::{ObsNormalizer, ObsStats, RunningStats},
    policy::{ENTITIES, EntityShape},
};
use burn::tensor::{Tensor, TensorData};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::Path,
};

/// The checkpoint that a learner starts from, and what it takes out of it.
#[derive(Clone, Copy, Debug)]
pub struct StartFrom<'a> {
    /// The other learner's file.
    pub path: &'a Path,
    /// The values of the new observation among the old ones. Without it, a longer observation has its new values at the
    /// end.
    pub inputs: Option<&'a InputMap>,
    /// True if Adam goes on with the moments of the layers that were taken, instead of beginning anew.
    pub moments: bool,
    /// False if the critic begins anew, because the other run has not trained it.
    pub critic: bool,
}

impl<'a> StartFrom<'a> {
    /// Returns a start with actor and critic, new values at the end, and a fresh optimiser.
    pub fn new(path: &'a Path) -> Self {
        Self { path, inputs: None, moments: false, critic: true }
    }
}

/// The place of each value of an observation in a shorter one; new values have none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputMap {
    old: usize,
    sources: Vec<Option<usize>>,
    /// Sets of the new observation; `None` if they are where they were.
    sets: Option<Vec<EntityBlock>>,
}

impl InputMap {
    /// Creates the map of an observation whose first `old` of `new` values are the old ones.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the new one is shorter.
    pub fn appended(old: usize, new: usize) -> Result<Self, LearnError> {
        if new < old {
            return Err(LearnError::Config(format!(
                "its policy reads {old} observed values, and there are only {new} now: a policy can get more inputs, not \
                 fewer"
            )));
        }
        Ok(Self { old, sources: (0..new).map(|value| (value < old).then_some(value)).collect(), sets: None })
    }

    /// Creates the map of an observation whose values are called `new`, from one whose values were called `old`. Values
    /// in another order are found, too; sums then have another order, so outputs are equal up to rounding only.
    ///
    /// ```
    /// use playbot_learner::InputMap;
    ///
    /// let names = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    /// let map = InputMap::by_name(&names("x speed"), &names("x fuel speed"))?;
    /// assert_eq!((map.fresh().collect::<Vec<_>>(), map.keeps_order()), (vec![1], true));
    /// let gone = InputMap::by_name(&names("x speed"), &names("x fuel")).expect_err("no speed").to_string();
    /// assert!(gone.contains("`speed`"), "{gone}");
    /// # Ok::<(), playbot_learner::LearnError>(())
    /// ```
    ///
    /// # Errors
    /// [`LearnError::Config`] names the old values that are gone, or a name that two values have.
    pub fn by_name(old: &[String], new: &[String]) -> Result<Self, LearnError> {
        let mut places = BTreeMap::new();
        for (place, name) in old.iter().enumerate() {
            if places.insert(name.as_str(), place).is_some() {
                let text = format!("two observed values are called `{name}`, so new ones cannot be told from old ones");
                return Err(LearnError::Config(text));
            }
        }
        let sources: Vec<_> = new.iter().map(|name| places.remove(name.as_str())).collect();
        if places.is_empty() {
            let sets = EntitySet::all_in(new).into_iter().map(|set| set.block).collect();
            return Ok(Self { old: old.len(), sources, sets: Some(sets) });
        }
        let gone: Vec<_> = places.keys().map(|name| format!("`{name}`")).collect();
        Err(LearnError::Config(format!(
            "its policy reads {}, which the game does not observe any more: a policy can get more inputs, not fewer",
            gone.join(", ")
        )))
    }

    /// Returns the number of values of the new observation.
    pub fn width(&self) -> usize {
        self.sources.len()
    }

    /// Returns the numbers of the new values.
    pub fn fresh(&self) -> impl Iterator<Item = usize> {
        self.sources.iter().enumerate().filter(|(_, source)| source.is_none()).map(|(value, _)| value)
    }

    /// Returns whether the old values are in their old order, so that outputs stay the same to the bit.
    pub fn keeps_order(&self) -> bool {
        self.sources.iter().flatten().is_sorted()
    }

    /// Returns the sets of the new observation, if `old` are those of the shorter one.
    pub(crate) fn sets(&self, old: &[EntityBlock]) -> Vec<EntityBlock> {
        match &self.sets {
            Some(sets) if !old.is_empty() => sets.clone(),
            _ => old.to_vec(),
        }
    }

    /// Returns the map of the numbers behind the encoders of sets, of which `own` belongs to the new observation, and
    /// whether the things of each set are no more than they were.
    ///
    /// # Errors
    /// [`LearnError::Config`] if one of the networks has no encoder, or the sets are others.
    pub(crate) fn behind(
        &self,
        own: Option<&EntityShape>,
        theirs: Option<&EntityShape>,
    ) -> Result<(Self, bool), LearnError> {
        let (own, theirs) = match (own, theirs) {
            (None, None) => return Ok((self.clone(), true)),
            (Some(own), Some(theirs)) => (own, theirs),
            (own, _) => {
                let (new, old) =
                    if own.is_some() { ("as sets", "value by value") } else { ("value by value", "as sets") };
                return Err(LearnError::Config(format!(
                    "it reads sets of things {old}, and the new run {new}: give both the same `ppo.entities` and \
                     `skills.entities`"
                )));
            }
        };
        let sources = own.sources(theirs, |value| self.sources.get(value).copied().flatten())?;
        let is_as_large = own.blocks.iter().zip(&theirs.blocks).all(|(own, theirs)| own.slots == theirs.slots);
        Ok((Self { old: theirs.features(), sources, sets: None }, is_as_large))
    }

    /// Returns whether nothing is new and nothing has moved.
    pub(crate) fn is_same(&self) -> bool {
        self.sources.iter().enumerate().all(|(value, source)| *source == Some(value))
    }

    /// Returns `old` in the new order, with `fresh` for new values.
    fn of<T: Clone>(&self, old: &[T], fresh: &T) -> Vec<T> {
        self.sources.iter().map(|source| source.and_then(|at| old.get(at)).unwrap_or(fresh).clone()).collect()
    }

    /// Returns a matrix of `columns`, whose first `latent` rows belong to a skill and the others to the observation, with
    /// rows of zeros for new values.
    fn rows(&self, old: &[f32], latent: usize, columns: usize) -> Vec<f32> {
        let (skill, observed) = old.split_at(latent * columns);
        let rows: Vec<&[f32]> = observed.chunks_exact(columns.max(1)).collect();
        let zeros = vec![0.0; columns];
        let rows = self.of(&rows, &zeros.as_slice());
        skill.iter().copied().chain(rows.into_iter().flatten().copied()).collect()
    }

    /// Returns the map for networks of this observation, from one of `old`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of two kinds, or the given map is of others.
    pub(crate) fn between(given: Option<&Self>, old: ObsKind, new: ObsKind) -> Result<Self, LearnError> {
        match (old, new) {
            (ObsKind::Vector(old), ObsKind::Vector(new)) => match given {
                Some(map) if (map.old, map.width()) == (old, new) => Ok(map.clone()),
                Some(map) => {
                    LearnError::check("observed values of the other run", map.old, old)?;
                    LearnError::check("observed values of the new run", map.width(), new)?;
                    Ok(map.clone())
                }
                None => Self::appended(old, new),
            },
            // Only the features of the trunk join the skill.
            _ if old == new => Self::appended(0, 0),
            _ => Err(LearnError::Config(format!(
                "its policy reads {}, and the new one {}: give both the same `observation`",
                old.describe(),
                new.describe()
            ))),
        }
    }

    /// Returns frozen statistics of the new observation, whose networks read these sets. New values stay as they are.
    pub(crate) fn frozen_stats(&self, old: &ObsStats, sets: &[EntityBlock]) -> ObsStats {
        ObsStats { mean: self.of(&old.mean, &0.0), inv_std: self.of(&old.inv_std, &1.0) }.shared(sets)
    }

    /// Returns running statistics of the new observation. Those of new values begin anew.
    pub(crate) fn running_stats(&self, old: ObsNormalizer) -> ObsNormalizer {
        if self.is_same() {
            return old;
        }
        let (fresh, sets) = (RunningStats::new(1), self.sets(old.sets()));
        let counts = match old.counts.is_empty() {
            true => vec![old.stats.count; old.stats.dim()],
            false => old.counts,
        };
        let RunningStats { mean, var, count } = old.stats;
        let stats = RunningStats { mean: self.of(&mean, &fresh.mean[0]), var: self.of(&var, &fresh.var[0]), count };
        ObsNormalizer::of_parts(stats, self.of(&counts, &fresh.count), sets)
    }
}

/// What a learner took over from another run, and what begins anew.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TakenOver {
    /// Names of the layers that were taken, such as `actor.l0`.
    pub taken: Vec<String>,
    /// Names of the layers that begin anew, each with the reason.
    pub anew: Vec<(String, String)>,
    /// Observed values that the other run had not.
    pub new_inputs: usize,
    /// True if the new policy gives the same outputs as the other one, to the bit, whatever the new values are.
    pub is_same_policy: bool,
}

impl TakenOver {
    /// Adds the layers of another network.
    pub(crate) fn join(&mut self, other: Self) {
        self.taken.extend(other.taken);
        self.anew.extend(other.anew);
    }
}

impl fmt::Display for TakenOver {
    /// Writes `taken: actor.l0, actor.head; anew: critic.head (another shape)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "taken: {}", self.taken.join(", "))?;
        if self.new_inputs > 0 {
            write!(f, "; new inputs at weight 0: {}", self.new_inputs)?;
        }
        if !self.anew.is_empty() {
            let anew: Vec<String> = self.anew.iter().map(|(layer, why)| format!("{layer} ({why})")).collect();
            write!(f, "; anew: {}", anew.join(", "))?;
        }
        Ok(())
    }
}

/// How two networks of one purpose fit each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit<'a> {
    /// The place of each observed value.
    pub(crate) inputs: &'a InputMap,
    /// Width of the skill before the observation.
    pub(crate) latent: usize,
    /// Numbers that only the new network remembers, behind the observation.
    pub(crate) memory: usize,
    /// True if no layer may be taken.
    pub(crate) is_refused: Option<&'static str>,
}

/// Numbers of parameters by name, with their shapes.
type Numbers = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

#[derive(Default)]
struct ReadAll {
    numbers: Numbers,
    /// Names in the order of the network.
    order: Vec<String>,
    error: Option<LearnError>,
}

impl ReadAll {
    fn of<M: Parameters + Clone>(network: &M, prefix: &str) -> Result<Self, LearnError> {
        let mut all = Self::default();
        network.clone().visit(prefix, &mut all);
        match all.error.take() {
            Some(error) => Err(error),
            None => Ok(all),
        }
    }
}

impl ParamVisitor for ReadAll {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let shape = tensor.dims().to_vec();
        match host(tensor.clone().inner()) {
            Ok(numbers) => {
                self.numbers.insert(name.to_owned(), (shape, numbers));
                self.order.push(name.to_owned());
            }
            Err(error) => self.error = self.error.take().or(Some(error)),
        }
    }
}

struct WriteAll<'a>(&'a Numbers);

impl ParamVisitor for WriteAll<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let Some((shape, numbers)) = self.0.get(name) else { return };
        if shape.as_slice() == tensor.dims() {
            *tensor = send(TensorData::new(numbers.clone(), tensor.dims()), &tensor.clone().inner().device());
        }
    }
}

/// Returns the layer of a parameter: all of a trunk is one.
fn layer_of<'a>(name: &'a str, prefix: &str) -> &'a str {
    let own = name.strip_prefix(prefix).unwrap_or(name).trim_start_matches('.');
    let end = match own.split_once('.') {
        Some((first, _)) => name.len() - own.len() + first.len(),
        None => name.len(),
    };
    &name[..end]
}

/// Returns whether a layer reads the features behind the hidden layers.
fn is_output(layer: &str) -> bool {
    let is_hidden = |last: &str| last == "cnn" || last == ENTITIES || last.strip_prefix('l').is_some_and(is_number);
    !is_memory(layer) && !layer.rsplit('.').next().is_some_and(is_hidden)
}

/// Returns whether a layer remembers.
fn is_memory(layer: &str) -> bool {
    layer.rsplit('.').next() == Some("memory")
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Puts the layers of `from` that fit into `to`, both called `prefix`, which must not be tracked.
///
/// # Errors
/// [`LearnError::Device`] if numbers cannot be read.
pub(crate) fn transplant<M: Parameters + Clone>(
    to: &mut M,
    from: &M,
    prefix: &str,
    fit: Fit<'_>,
) -> Result<TakenOver, LearnError> {
    let (own, theirs) = (ReadAll::of(to, prefix)?, ReadAll::of(from, prefix)?);
    let mut layers: Vec<&str> = own.order.iter().map(|name| layer_of(name, prefix)).collect();
    layers.dedup();
    let hidden = |all: &ReadAll| {
        let hidden =
            all.order.iter().map(|name| layer_of(name, prefix)).filter(|layer| !is_output(layer) && !is_memory(layer));
        hidden.map(str::to_owned).collect::<BTreeSet<_>>()
    };
    let (own_hidden, their_hidden) = (hidden(&own), hidden(&theirs));
    // The first layer behind a trunk reads its features, of which none is new; behind an encoder of sets also other values.
    let input = layers
        .iter()
        .find(|layer| !layer.ends_with(".cnn") && !layer.ends_with(ENTITIES) && !is_memory(layer))
        .copied()
        .unwrap_or_default()
        .to_owned();
    let reads_input = |layer: &str| layer == input || (own_hidden.is_empty() && is_output(layer));
    let (mut taken, mut report, mut stopped) = (Numbers::new(), TakenOver::default(), fit.is_refused);
    for layer in layers {
        if is_output(layer) && own_hidden != their_hidden && stopped.is_none() {
            stopped = Some("another number of hidden layers");
        }
        let names = own.order.iter().filter(|name| layer_of(name, prefix) == layer);
        let fitting: Option<Vec<_>> = names
            .map(|name| {
                let (shape, _) = own.numbers.get(name)?;
                let (old_shape, numbers) = theirs.numbers.get(name)?;
                let numbers = match (shape.as_slice(), old_shape.as_slice()) {
                    ([rows, columns], [old_rows, old_columns])
                        if reads_input(layer)
                            && fit.inputs.width() > 0
                            && columns == old_columns
                            && *rows == fit.latent + fit.inputs.width() + fit.memory
                            && *old_rows == fit.latent + fit.inputs.old =>
                    {
                        let mut numbers = fit.inputs.rows(numbers, fit.latent, *columns);
                        // What is remembered has no effect yet.
                        numbers.resize(rows * columns, 0.0);
                        numbers
                    }
                    (shape, old) if shape == old => numbers.clone(),
                    _ => return None,
                };
                Some((name.clone(), (shape.clone(), numbers)))
            })
            .collect();
        match fitting.filter(|_| stopped.is_none()) {
            Some(numbers) => {
                taken.extend(numbers);
                report.taken.push(layer.to_owned());
            }
            None => {
                let is_missing = !theirs.order.iter().any(|name| layer_of(name, prefix) == layer);
                let why = stopped.unwrap_or(if is_missing { "the other run has none" } else { "another shape" });
                report.anew.push((layer.to_owned(), why.to_owned()));
                // Outputs stand beside each other, and need one another in nothing. A new memory has no effect yet.
                let is_new_memory = is_memory(layer) && fit.memory > 0;
                if !is_output(layer) && !is_new_memory {
                    stopped = stopped.or(Some("it is behind a layer that begins anew"));
                }
            }
        }
    }
    to.visit(prefix, &mut WriteAll(&taken));
    Ok(report)
}

/// Gives `to` the moments of `from` for the taken layers of `network`, and zeros for its other parameters.
///
/// # Errors
/// [`LearnError::Device`] if numbers cannot be read.
pub(crate) fn take_moments<M: Parameters + Clone>(
    to: &mut Adam,
    from: &Adam,
    network: &M,
    taken: &[String],
    fits: &[(&str, Fit<'_>)],
) -> Result<(), LearnError> {
    let (own, theirs) = (ReadAll::of(network, "")?, from.host_moments()?);
    for name in &own.order {
        let Some((shape, _)) = own.numbers.get(name) else { continue };
        let size: usize = shape.iter().product();
        let fit = fits.iter().find(|(prefix, _)| name.starts_with(prefix));
        let is_taken = fit.is_some_and(|(prefix, _)| taken.iter().any(|layer| layer == layer_of(name, prefix)));
        let (mut m, mut v) = (vec![0.0; size], vec![0.0; size]);
        if let (true, Some(moments), Some((_, fit))) = (is_taken, theirs.get(name), fit) {
            if moments.m.len() == size {
                (m, v) = (moments.m.clone(), moments.v.clone());
            } else if let [_, columns] = shape.as_slice() {
                m = fit.inputs.rows(&moments.m, fit.latent, *columns);
                v = fit.inputs.rows(&moments.v, fit.latent, *columns);
                m.resize(size, 0.0);
                v.resize(size, 0.0);
            }
        }
        to.restore(name.clone(), shape.clone(), m, v);
    }
    to.steps = from.steps;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        DeviceKind,
        nn::{Activation, Mlp, host, matrix},
        rng::Streams,
    };

    fn mlp(inputs: usize, hidden: &[usize], seed: u64) -> Mlp {
        let mut rng = Streams::new(seed).stream("mlp", 0);
        Mlp::new(inputs, hidden, 2, Activation::Tanh, 1.0, &mut rng, &DeviceKind::Flex.plain())
    }

    fn outputs(net: &Mlp, row: &[f32]) -> Vec<f32> {
        let device = DeviceKind::Flex.plain();
        host(net.forward(matrix(row.to_vec(), 1, row.len(), &device)).reshape([-1])).expect("readable")
    }

    fn names(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn values_in_the_middle_change_no_output_to_the_bit() {
        let map = InputMap::by_name(&names("a b c"), &names("new a more b c last")).expect("all are there");
        for hidden in [&[40, 24][..], &[]] {
            let old = mlp(2 + 3, hidden, 1);
            let mut wide = mlp(2 + 6, hidden, 2);
            let fit = Fit { inputs: &map, latent: 2, memory: 0, is_refused: None };
            let report = transplant(&mut wide, &old, "", fit).expect("readable");
            assert!(report.anew.is_empty(), "{report}");
            let mut rng = Streams::new(3).stream("rows", 0);
            for _ in 0..50 {
                let x: Vec<f32> = (0..8).map(|_| crate::rng::normal(&mut rng)).collect();
                let short = [x[0], x[1], x[3], x[5], x[6]];
                assert_eq!(outputs(&wide, &x), outputs(&old, &short));
            }
        }
    }

    #[test]
    fn layers_are_taken_up_to_the_first_that_does_not_fit() {
        let map = InputMap::appended(3, 3).expect("as long");
        let fit = Fit { inputs: &map, latent: 0, memory: 0, is_refused: None };
        let report = |old: &[usize], new: &[usize]| {
            let mut to = mlp(3, new, 2);
            let report = transplant(&mut to, &mlp(3, old, 1), "actor", fit).expect("readable");
            let anew: Vec<String> = report.anew.into_iter().map(|(layer, _)| layer).collect();
            (report.taken.join(" "), anew.join(" "))
        };
        let all = |taken: &str, anew: &str| (taken.to_owned(), anew.to_owned());
        assert_eq!(report(&[8, 8], &[8, 8]), all("actor.l0 actor.l1 actor.head", ""));
        assert_eq!(report(&[8, 8], &[8, 4]), all("actor.l0", "actor.l1 actor.head"));
        assert_eq!(report(&[8, 8], &[4, 8]), all("", "actor.l0 actor.l1 actor.head"));
        assert_eq!(report(&[8, 8], &[8]), all("actor.l0", "actor.head"), "the head read other features");
        assert_eq!(report(&[8], &[8, 8]), all("actor.l0", "actor.l1 actor.head"));
    }

    #[test]
    fn statistics_of_new_values_begin_anew() {
        let mut old = ObsNormalizer::new(1);
        old.update(&[2.0, 4.0]);
        let map = InputMap::by_name(&names("x"), &names("new x")).expect("it is there");
        let mut wide = map.running_stats(old.clone());
        // x is 6 in one more row; the new value is 5 in its first one, and 9 in the next.
        wide.update(&[5.0, 6.0]);
        wide.update(&[9.0, 6.0]);
        old.update(&[6.0]);
        old.update(&[6.0]);
        assert_eq!((wide.stats.mean[1], wide.stats.var[1]), (old.stats.mean[0], old.stats.var[0]));
        assert!((wide.stats.mean[0] - 7.0).abs() < 1e-3, "{}", wide.stats.mean[0]);
        assert!((wide.stats.var[0] - 4.0).abs() < 1e-2, "{}", wide.stats.var[0]);
        let same = InputMap::appended(1, 1).expect("as long").running_stats(old.clone());
        assert_eq!(same, old);
    }

    #[test]
    fn a_shorter_observation_is_refused() {
        let error = InputMap::appended(4, 3).expect_err("one is gone").to_string();
        assert!(error.contains("its policy reads 4 observed values, and there are only 3 now"), "{error}");
        let error = InputMap::by_name(&names("a a"), &names("a a b")).expect_err("not unique").to_string();
        assert!(error.contains("two observed values are called `a`"), "{error}");
        let moved = InputMap::by_name(&names("a b"), &names("b a")).expect("all are there");
        assert!(!moved.keeps_order());
    }
}
