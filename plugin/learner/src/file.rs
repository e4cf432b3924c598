//! Self-describing safetensors files: tensors by name, and a JSON description in the header.

use crate::nn::{Adam, ParamVisitor, Parameters, host};
use crate::{FileError, LearnError};
use burn::tensor::{Device, Tensor, TensorData};
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The header entry that holds the description.
const DESCRIPTION: &str = "playbot";

/// A tensor in host memory.
#[derive(Clone, Debug)]
struct Stored {
    shape: Vec<usize>,
    dtype: Dtype,
    bytes: Vec<u8>,
}

/// The part of every description that says how to read the rest.
#[derive(Deserialize)]
struct Identity {
    kind: String,
    version: u32,
}

/// The contents of one file, to be written or just read.
#[derive(Clone, Debug)]
pub(crate) struct TensorFile {
    path: PathBuf,
    description: String,
    tensors: BTreeMap<String, Stored>,
}

impl TensorFile {
    /// An empty file for `path` with `description` in its header.
    pub(crate) fn new(path: &Path, description: &impl Serialize) -> Result<Self, FileError> {
        let description = serde_json::to_string(description)
            .map_err(|e| FileError::Format { path: path.to_owned(), detail: e.to_string() })?;
        Ok(Self { path: path.to_owned(), description, tensors: BTreeMap::new() })
    }

    /// Adds single-precision numbers.
    pub(crate) fn put(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        self.tensors.insert(name.to_owned(), Stored { shape: shape.to_vec(), dtype: Dtype::F32, bytes });
    }

    /// Adds a vector of double-precision numbers.
    pub(crate) fn put_f64(&mut self, name: &str, values: &[f64]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        let shape = vec![values.len()];
        self.tensors.insert(name.to_owned(), Stored { shape, dtype: Dtype::F64, bytes });
    }

    /// Adds a vector of whole numbers.
    pub(crate) fn put_u32(&mut self, name: &str, values: &[u32]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        self.tensors.insert(name.to_owned(), Stored { shape: vec![values.len()], dtype: Dtype::U32, bytes });
    }

    /// Adds bytes.
    pub(crate) fn put_bytes(&mut self, name: &str, shape: &[usize], values: &[u8]) {
        let stored = Stored { shape: shape.to_vec(), dtype: Dtype::U8, bytes: values.to_vec() };
        self.tensors.insert(name.to_owned(), stored);
    }

    /// Adds a vector of flags, as bytes 0 and 1.
    pub(crate) fn put_flags(&mut self, name: &str, values: &[bool]) {
        let bytes: Vec<u8> = values.iter().map(|&flag| u8::from(flag)).collect();
        self.put_bytes(name, &[values.len()], &bytes);
    }

    /// Adds all parameters of `network`.
    pub(crate) fn put_network<M: Parameters + Clone>(&mut self, prefix: &str, network: &M) -> Result<(), FileError> {
        let mut writer = Put { file: self, error: None };
        network.clone().visit(prefix, &mut writer);
        let error = writer.error;
        error.map_or(Ok(()), |source| Err(FileError::Learner { path: self.path.clone(), source }))
    }

    /// Adds an optimizer's moments, `adam.m.NAME` and `adam.v.NAME`.
    pub(crate) fn put_adam(&mut self, adam: &Adam) {
        for (name, moments) in &adam.moments {
            self.put(&format!("adam.m.{name}"), &moments.shape, &moments.m);
            self.put(&format!("adam.v.{name}"), &moments.shape, &moments.v);
        }
    }

    /// Writes everything under a temporary name, flushes it to the disk and renames it into place.
    pub(crate) fn write(&self) -> Result<(), FileError> {
        let views: Result<Vec<_>, _> = self
            .tensors
            .iter()
            .map(|(name, t)| TensorView::new(t.dtype, t.shape.clone(), &t.bytes).map(|view| (name, view)))
            .collect();
        let header = HashMap::from([(DESCRIPTION.to_owned(), self.description.clone())]);
        let bytes = views
            .and_then(|views| safetensors::serialize(views, Some(header)))
            .map_err(|e| self.format(e.to_string()))?;
        write_atomically(&self.path, &bytes).map_err(|source| FileError::Io {
            action: "write",
            path: self.path.clone(),
            source,
        })
    }

    /// Reads a whole file.
    pub(crate) fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = fs::read(path).map_err(|source| FileError::Io { action: "read", path: path.to_owned(), source })?;
        Self::parse(path, &bytes)
    }

    /// Takes a whole file from memory; `path` is for messages.
    pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<Self, FileError> {
        let format = |detail: String| FileError::Format { path: path.to_owned(), detail };
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| format(format!("not safetensors: {e}")))?;
        let description = metadata
            .metadata()
            .as_ref()
            .and_then(|map| map.get(DESCRIPTION).cloned())
            .ok_or_else(|| format(format!("the header has no `{DESCRIPTION}` entry")))?;
        let views = SafeTensors::deserialize(bytes).map_err(|e| format(format!("not safetensors: {e}")))?;
        let tensors = views
            .iter()
            .map(|(name, view)| {
                let stored = Stored { shape: view.shape().to_vec(), dtype: view.dtype(), bytes: view.data().to_vec() };
                (name.to_owned(), stored)
            })
            .collect();
        Ok(Self { path: path.to_owned(), description, tensors })
    }

    /// The description, if the file calls itself a `kind` of `version`. That is looked at first, so that what a newer
    /// version added is not taken for a fault.
    pub(crate) fn description<T: DeserializeOwned>(&self, kind: &'static str, version: u32) -> Result<T, FileError> {
        let parse = |e: serde_json::Error| self.format(format!("description in the header: {e}"));
        let found: Identity = serde_json::from_str(&self.description).map_err(parse)?;
        self.check_kind((kind, version), (&found.kind, found.version))?;
        serde_json::from_str(&self.description).map_err(parse)
    }

    /// Takes out a single-precision tensor of the given shape.
    pub(crate) fn take(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, FileError> {
        let bytes = self.take_any(name, Some(shape), Dtype::F32)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// Takes out a double-precision vector, of length `len` if given.
    pub(crate) fn take_f64(&mut self, name: &str, len: Option<usize>) -> Result<Vec<f64>, FileError> {
        let shape = len.map(|len| vec![len]);
        let bytes = self.take_any(name, shape.as_deref(), Dtype::F64)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// Takes out a vector of `len` whole numbers.
    pub(crate) fn take_u32(&mut self, name: &str, len: usize) -> Result<Vec<u32>, FileError> {
        let bytes = self.take_any(name, Some(&[len]), Dtype::U32)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// Takes out bytes of the given shape.
    pub(crate) fn take_bytes(&mut self, name: &str, shape: &[usize]) -> Result<Vec<u8>, FileError> {
        self.take_any(name, Some(shape), Dtype::U8)
    }

    /// Takes out a vector of `len` flags.
    pub(crate) fn take_flags(&mut self, name: &str, len: usize) -> Result<Vec<bool>, FileError> {
        let bytes = self.take_bytes(name, &[len])?;
        Ok(bytes.into_iter().map(|byte| byte != 0).collect())
    }

    /// Takes out all parameters of `network`, which gives their shapes, and puts them on `device`.
    pub(crate) fn take_network<M: Parameters>(
        &mut self,
        prefix: &str,
        network: &mut M,
        device: &Device,
    ) -> Result<(), FileError> {
        let mut reader = Take { file: self, device, error: None };
        network.visit(prefix, &mut reader);
        reader.error.map_or(Ok(()), Err)
    }

    /// Takes out the moments of an optimizer that did `steps` steps on all parameters of `network`, called by `prefix`.
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

    fn check_kind(&self, (kind, version): (&'static str, u32), (found, other): (&str, u32)) -> Result<(), FileError> {
        if found != kind {
            return Err(self.format(format!("is of the kind `{found}`, expected `{kind}`")));
        }
        match other.cmp(&version) {
            Ordering::Equal => Ok(()),
            Ordering::Greater => {
                Err(FileError::Newer { path: self.path.clone(), kind, found: other, readable: version })
            }
            Ordering::Less => Err(self.format(format!(
                "was written by an older version of playbot ({kind} format {other}, this one reads {version}): write \
                 it again with this one"
            ))),
        }
    }

    /// Fails if any tensor was not taken out.
    pub(crate) fn finish(self) -> Result<(), FileError> {
        match self.tensors.into_keys().next() {
            None => Ok(()),
            Some(name) => Err(FileError::ExtraTensor { path: self.path, name }),
        }
    }

    /// The file's name.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// `Ok` if the tensor `name` is there and has `shape`.
    pub(crate) fn expect(&self, name: &str, shape: &[usize]) -> Result<(), FileError> {
        let Some(stored) = self.tensors.get(name) else {
            return Err(FileError::MissingTensor { path: self.path.clone(), name: name.to_owned() });
        };
        if stored.shape == shape {
            return Ok(());
        }
        Err(FileError::WrongShape {
            path: self.path.clone(),
            name: name.to_owned(),
            expected: shape.to_vec(),
            found: stored.shape.clone(),
        })
    }

    /// An error about this file's contents.
    pub(crate) fn format(&self, detail: String) -> FileError {
        FileError::Format { path: self.path.clone(), detail }
    }

    /// An error of what the contents describe.
    pub(crate) fn learner(&self, source: LearnError) -> FileError {
        FileError::Learner { path: self.path.clone(), source }
    }

    fn take_any(&mut self, name: &str, shape: Option<&[usize]>, dtype: Dtype) -> Result<Vec<u8>, FileError> {
        if let Some(shape) = shape {
            self.expect(name, shape)?;
        }
        let Some(stored) = self.tensors.remove(name) else {
            return Err(FileError::MissingTensor { path: self.path.clone(), name: name.to_owned() });
        };
        if stored.dtype != dtype {
            let detail = format!("tensor `{name}` is {:?}, expected {dtype:?}", stored.dtype);
            return Err(self.format(detail));
        }
        Ok(stored.bytes)
    }
}

/// Puts `bytes` at `path` so that a reader sees the old contents or the new, never a part: under a temporary name first,
/// flushed to the disk, then renamed.
///
/// # Errors
/// What the system says; the old contents are still there, and nothing else.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".tmp{}", std::process::id()));
    let temporary = path.with_file_name(name);
    let written = (|| {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    })();
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&temporary);
        return written;
    }
    // Makes the new name durable where directories can be opened; elsewhere the rename is all there is.
    if let Some(Ok(folder)) = path.parent().map(File::open) {
        let _ = folder.sync_all();
    }
    Ok(())
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

struct Take<'a> {
    file: &'a mut TensorFile,
    device: &'a Device,
    error: Option<FileError>,
}

impl ParamVisitor for Take<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        if self.error.is_some() {
            return;
        }
        let shape = tensor.dims();
        match self.file.take(name, &shape) {
            Ok(values) => *tensor = Tensor::from_data(TensorData::new(values, shape), self.device),
            Err(error) => self.error = Some(error),
        }
    }
}

struct Names(Vec<(String, Vec<usize>)>);

impl ParamVisitor for Names {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        self.0.push((name.to_owned(), tensor.dims().to_vec()));
    }
}
