//! The moments of Adam, in host memory or on a graphics card.

use super::tensors::{host, vector};
use crate::LearnError;
use burn::tensor::{Device, Tensor};
use std::collections::BTreeMap;

/// First and second moment of one parameter, without bias correction.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    pub(crate) shape: Vec<usize>,
    pub(crate) m: Vec<f32>,
    pub(crate) v: Vec<f32>,
}

/// Moments of all parameters, one after the other in the order of the network.
#[derive(Clone, Debug)]
pub(super) struct FlatMoments {
    pub(super) m: Tensor<1>,
    pub(super) v: Tensor<1>,
    pub(super) layout: Vec<(String, Vec<usize>)>,
}

impl FlatMoments {
    /// Copies `moments` to `device`; zeros for parameters that have none.
    pub(super) fn send(
        moments: &BTreeMap<String, Moments>,
        layout: Vec<(String, Vec<usize>)>,
        device: &Device,
    ) -> Self {
        let (mut m, mut v) = (Vec::new(), Vec::new());
        for (name, shape) in &layout {
            match moments.get(name) {
                Some(moments) => {
                    m.extend_from_slice(&moments.m);
                    v.extend_from_slice(&moments.v);
                }
                None => {
                    let end = m.len() + shape.iter().product::<usize>();
                    m.resize(end, 0.0);
                    v.resize(end, 0.0);
                }
            }
        }
        Self { m: vector(m, device), v: vector(v, device), layout }
    }

    /// Returns the moments in host memory, by the names of the parameters.
    ///
    /// # Errors
    /// [`LearnError::Device`] if they cannot be read.
    pub(super) fn by_name(&self) -> Result<BTreeMap<String, Moments>, LearnError> {
        let (m, v) = (host(self.m.clone())?, host(self.v.clone())?);
        let (mut m, mut v) = (m.as_slice(), v.as_slice());
        let mut found = BTreeMap::new();
        for (name, shape) in &self.layout {
            let size = shape.iter().product();
            let ((own_m, rest_m), (own_v, rest_v)) = (m.split_at(size), v.split_at(size));
            (m, v) = (rest_m, rest_v);
            found.insert(name.clone(), Moments { shape: shape.clone(), m: own_m.to_vec(), v: own_v.to_vec() });
        }
        Ok(found)
    }
}
