//! Policy files as `docs/reference/policy-files.md` describes them: arrays by name, and a description.

use crate::error::OnnxError;
use playbot_learner::{
    ActionSpace, EntityBlock, ImageShape, ObsKind, PolicyMetadata, SkillDraw, nn::CnnKind, policy::NetShape,
};
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize};
use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
};

/// The entry of the header that holds the description.
const DESCRIPTION: &str = "playbot";

/// Bytes before the header: its length.
const LENGTH: usize = 8;

/// Text before the digits of the checksum, behind the length of the header.
const BEFORE_SUM: &[u8] = br#"{"__metadata__":{"playbot":"{\"crc32\":\""#;

/// Digits of a checksum.
const DIGITS: usize = 8;

/// The description of a policy file.
#[derive(Serialize, Deserialize, Clone, Debug)]
pub(crate) struct Description {
    pub(crate) kind: String,
    pub(crate) version: u32,
    #[serde(rename = "card")]
    pub(crate) metadata: PolicyMetadata,
    pub(crate) policy: PolicyShape,
    pub(crate) skills: Option<SkillsShape>,
    pub(crate) examples: usize,
}

/// Inputs, outputs and layers of a policy.
#[derive(Serialize, Deserialize, Clone, Debug)]
pub(crate) struct PolicyShape {
    pub(crate) action_space: ActionSpace,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) image: Option<ImageShape>,
    pub(crate) actor: ActorShape,
    pub(crate) critic: Option<NetShape>,
    pub(crate) normalised: bool,
}

/// Layers of an actor.
#[derive(Serialize, Deserialize, Clone, Debug)]
pub(crate) struct ActorShape {
    pub(crate) net: NetShape,
    pub(crate) std: StdShape,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) cnn: Option<CnnKind>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) entities: Option<EntityShape>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) memory: Option<MemoryShape>,
}

/// The source of ln σ.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub(crate) enum StdShape {
    Vector,
    State,
    Squashed(f64, f64),
}

/// The encoder of sets of things.
#[derive(Serialize, Deserialize, Clone, Debug)]
pub(crate) struct EntityShape {
    pub(crate) obs_dim: usize,
    pub(crate) hidden: usize,
    pub(crate) blocks: Vec<EntityBlock>,
}

/// The memory of an actor.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(crate) enum MemoryShape {
    Gru { hidden: usize },
    Stack { ticks: usize },
}

/// Decoder and prior of a policy with skills.
#[derive(Serialize, Deserialize, Clone, Debug)]
pub(crate) struct SkillsShape {
    pub(crate) latent: usize,
    pub(crate) tanh: bool,
    pub(crate) prior: Option<ActorShape>,
    pub(crate) decoder: ActorShape,
    #[serde(rename = "horizon")]
    pub(crate) skill_interval: usize,
    pub(crate) draw: SkillDraw,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) normalised: bool,
}

impl PolicyShape {
    /// Returns the kind of its observations.
    pub(crate) fn observation(&self) -> ObsKind {
        match (self.image, &self.actor.entities) {
            (Some(image), _) => ObsKind::Image(image),
            (None, Some(entities)) => ObsKind::Vector(entities.obs_dim),
            (None, None) => ObsKind::Vector(self.actor.seen()),
        }
    }
}

impl ActorShape {
    /// Returns the width of what its memory and its layers read beside skills: values, features of sets or of images.
    pub(crate) fn seen(&self) -> usize {
        match self.memory {
            None => self.net.obs_dim,
            Some(MemoryShape::Gru { hidden }) => self.net.obs_dim.saturating_sub(hidden),
            Some(MemoryShape::Stack { ticks }) => self.net.obs_dim / ticks.max(1),
        }
    }

    /// Returns the numbers that it remembers; 0 without memory.
    pub(crate) fn remembers(&self) -> usize {
        match self.memory {
            None => 0,
            Some(MemoryShape::Gru { hidden }) => hidden,
            Some(MemoryShape::Stack { ticks }) => ticks.saturating_sub(1).saturating_mul(self.seen()),
        }
    }
}

/// An array of a policy file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Stored {
    Single(Vec<usize>, Vec<f32>),
    Double(Vec<f64>),
    Bytes(Vec<usize>, Vec<u8>),
}

/// The contents of a policy file.
#[derive(Clone, Debug)]
pub(crate) struct PolicyForm {
    pub(crate) description: Description,
    pub(crate) arrays: BTreeMap<String, Stored>,
}

impl PolicyForm {
    /// Reads a policy file that `PolicyFile` has found sound; `name` is for messages.
    pub(crate) fn parse(name: &Path, bytes: &[u8]) -> Result<Self, OnnxError> {
        let unreadable = |error: &dyn std::fmt::Display| OnnxError::policy(name, error.to_string());
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| unreadable(&e))?;
        let text = header.metadata().as_ref().and_then(|map| map.get(DESCRIPTION));
        let text = text.ok_or_else(|| unreadable(&"it has no description"))?;
        let description: Description = serde_json::from_str(text).map_err(|e| unreadable(&e))?;
        let views = SafeTensors::deserialize(bytes).map_err(|e| unreadable(&e))?;
        let mut arrays = BTreeMap::new();
        for (name, view) in views.iter() {
            let (shape, data) = (view.shape().to_vec(), view.data());
            let array = match view.dtype() {
                Dtype::F32 => Stored::Single(shape, bytemuck::pod_collect_to_vec(data)),
                Dtype::F64 => Stored::Double(bytemuck::pod_collect_to_vec(data)),
                Dtype::U8 => Stored::Bytes(shape, data.to_vec()),
                other => return Err(unreadable(&format!("`{name}` is {other:?}"))),
            };
            arrays.insert(name.to_owned(), array);
        }
        Ok(Self { description, arrays })
    }

    /// Returns the bytes of the file, with its checksum.
    pub(crate) fn to_bytes(&self, name: &Path) -> Result<Vec<u8>, OnnxError> {
        let failed = |error: &dyn std::fmt::Display| OnnxError::policy(name, error.to_string());
        let description = serde_json::to_string(&self.description).map_err(|e| failed(&e))?;
        let sealed = format!(r#"{{"crc32":"00000000",{}"#, description.trim_start_matches('{'));
        let data: BTreeMap<&str, (Dtype, Vec<usize>, Vec<u8>)> = self
            .arrays
            .iter()
            .map(|(name, array)| {
                let array = match array {
                    Stored::Single(shape, numbers) => {
                        (Dtype::F32, shape.clone(), bytemuck::cast_slice(numbers).to_vec())
                    }
                    Stored::Double(numbers) => {
                        (Dtype::F64, vec![numbers.len()], bytemuck::cast_slice(numbers).to_vec())
                    }
                    Stored::Bytes(shape, bytes) => (Dtype::U8, shape.clone(), bytes.clone()),
                };
                (name.as_str(), array)
            })
            .collect();
        let views: Result<Vec<_>, _> = data
            .iter()
            .map(|(name, (dtype, shape, bytes))| {
                TensorView::new(*dtype, shape.clone(), bytes).map(|view| (*name, view))
            })
            .collect();
        let header = HashMap::from([(DESCRIPTION.to_owned(), sealed)]);
        let bytes = views.and_then(|views| safetensors::serialize(views, Some(header)));
        let mut bytes = bytes.map_err(|e| failed(&e))?;
        // Over the whole file, with zeros in place of the digits.
        let sum = format!("{:08x}", crc32fast::hash(&bytes));
        let place = LENGTH + BEFORE_SUM.len()..LENGTH + BEFORE_SUM.len() + DIGITS;
        if bytes.get(LENGTH..place.start) != Some(BEFORE_SUM) {
            return Err(failed(&"its header begins in an unexpected way"));
        }
        bytes[place].copy_from_slice(sum.as_bytes());
        Ok(bytes)
    }

    /// Returns single-precision numbers by their name, with their shape.
    pub(crate) fn single(&self, name: &str) -> Result<(&[usize], &[f32]), OnnxError> {
        match self.arrays.get(name) {
            Some(Stored::Single(shape, numbers)) => Ok((shape, numbers)),
            _ => Err(OnnxError::Form(format!("the policy file has no array `{name}` of single precision"))),
        }
    }

    /// Returns double-precision numbers by their name.
    pub(crate) fn double(&self, name: &str) -> Result<&[f64], OnnxError> {
        match self.arrays.get(name) {
            Some(Stored::Double(numbers)) => Ok(numbers),
            _ => Err(OnnxError::Form(format!("the policy file has no vector `{name}` of double precision"))),
        }
    }

    /// Adds single-precision numbers.
    pub(crate) fn put(&mut self, name: &str, shape: &[usize], numbers: Vec<f32>) {
        self.arrays.insert(name.to_owned(), Stored::Single(shape.to_vec(), numbers));
    }

    /// Adds double-precision numbers.
    pub(crate) fn put_double(&mut self, name: &str, numbers: Vec<f64>) {
        self.arrays.insert(name.to_owned(), Stored::Double(numbers));
    }
}
