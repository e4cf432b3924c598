//! Networks and optimizers in files.

use super::TensorFile;
use crate::nn::{Adam, Init, ParamSource, ParamVisitor, Parameters, host};
use crate::{FileError, LearnError};
use burn::tensor::{Device, Tensor, TensorData};

/// The parameters of a stored network, taken out of a file one by one and put on a device.
#[derive(Debug)]
pub(crate) struct StoredParams<'a> {
    file: &'a mut TensorFile,
    device: &'a Device,
}

impl ParamSource for StoredParams<'_> {
    type Error = FileError;

    fn param<const D: usize>(&mut self, name: &str, shape: [usize; D], _: Init) -> Result<Tensor<D>, FileError> {
        self.file.product(name, &shape)?;
        let values = self.file.take(name, &shape)?;
        Ok(Tensor::from_data(TensorData::new(values, shape), self.device))
    }
}

impl TensorFile {
    /// Returns the file as a source of parameters on `device`.
    pub(crate) fn params<'a>(&'a mut self, device: &'a Device) -> StoredParams<'a> {
        StoredParams { file: self, device }
    }

    /// Adds all parameters of `network`.
    pub(crate) fn put_network<M: Parameters + Clone>(&mut self, prefix: &str, network: &M) -> Result<(), FileError> {
        let mut writer = Put { file: self, error: None };
        network.clone().visit(prefix, &mut writer);
        let error = writer.error;
        error.map_or(Ok(()), |source| Err(self.learner(source)))
    }

    /// Adds an optimizer's moments, `adam.m.NAME` and `adam.v.NAME`.
    pub(crate) fn put_adam(&mut self, adam: &Adam) -> Result<(), FileError> {
        let all = adam.host_moments().map_err(|source| self.learner(source))?;
        for (name, moments) in all.iter() {
            self.put(&format!("adam.m.{name}"), &moments.shape, &moments.m);
            self.put(&format!("adam.v.{name}"), &moments.shape, &moments.v);
        }
        Ok(())
    }

    /// Takes out the moments of an optimizer after `steps` steps on all parameters of `network`, named by `prefix`.
    pub(crate) fn take_adam<M: Parameters>(
        &mut self,
        adam: &mut Adam,
        prefix: &str,
        network: &mut M,
        steps: u64,
    ) -> Result<(), FileError> {
        adam.steps = steps;
        let mut names = Names(Vec::new());
        if steps > 0 {
            network.visit(prefix, &mut names);
        }
        for (name, shape) in names.0 {
            let m = self.take(&format!("adam.m.{name}"), &shape)?;
            let v = self.take(&format!("adam.v.{name}"), &shape)?;
            adam.restore(name, shape, m, v);
        }
        Ok(())
    }
}

struct Put<'a> {
    file: &'a mut TensorFile,
    error: Option<LearnError>,
}

impl ParamVisitor for Put<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        match host(tensor.clone().inner()) {
            Ok(values) => self.file.put(name, &tensor.dims(), &values),
            Err(error) => self.error = self.error.take().or(Some(error)),
        }
    }
}

struct Names(Vec<(String, Vec<usize>)>);

impl ParamVisitor for Names {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        self.0.push((name.to_owned(), tensor.dims().to_vec()));
    }
}
