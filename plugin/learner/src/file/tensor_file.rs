//! Self-describing safetensors files: tensors by name, and a JSON description in the header.

use super::seal::{Form, digits_of};
use crate::disk::write_atomically;
use crate::{FileError, LearnError};
use safetensors::{Dtype, SafeTensorError, SafeTensors, tensor::TensorView};
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

/// The header entry that holds the description.
const DESCRIPTION: &str = "playbot";

/// The entry of the description that holds the checksum of the whole file, computed with zeros in place of its
/// digits.
pub(super) const SEAL: &str = "crc32";

/// Start of a file with a checksum, behind the eight bytes with the length of the header.
const FORM: Form = Form { prefix: br#"{"__metadata__":{"playbot":"{\"crc32\":\""#, suffix: br#"\","# };

/// Placeholder of a checksum that is not known yet.
const NO_SUM: &[u8; 8] = b"00000000";

/// Bytes that hold the length of the header.
const LENGTH: usize = 8;

/// A tensor in host memory.
#[derive(Clone, Debug)]
struct StoredTensor {
    shape: Vec<usize>,
    dtype: Dtype,
    bytes: Vec<u8>,
}

/// The contents of one file, to be written or just read.
#[derive(Clone, Debug)]
pub(crate) struct TensorFile {
    path: PathBuf,
    pub(super) description: String,
    tensors: BTreeMap<String, StoredTensor>,
}

impl TensorFile {
    /// Creates an empty file for `path` with `description`, which is JSON, in its header.
    pub(super) fn empty(path: &Path, description: String) -> Self {
        Self { path: path.to_owned(), description, tensors: BTreeMap::new() }
    }

    /// Adds single-precision numbers.
    pub(crate) fn put(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        self.tensors.insert(name.to_owned(), StoredTensor { shape: shape.to_vec(), dtype: Dtype::F32, bytes });
    }

    /// Adds a vector of double-precision numbers.
    pub(crate) fn put_f64(&mut self, name: &str, values: &[f64]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        let shape = vec![values.len()];
        self.tensors.insert(name.to_owned(), StoredTensor { shape, dtype: Dtype::F64, bytes });
    }

    /// Adds a vector of whole numbers.
    pub(crate) fn put_u32(&mut self, name: &str, values: &[u32]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        self.tensors.insert(name.to_owned(), StoredTensor { shape: vec![values.len()], dtype: Dtype::U32, bytes });
    }

    /// Adds bytes.
    pub(crate) fn put_bytes(&mut self, name: &str, shape: &[usize], values: &[u8]) {
        let stored = StoredTensor { shape: shape.to_vec(), dtype: Dtype::U8, bytes: values.to_vec() };
        self.tensors.insert(name.to_owned(), stored);
    }

    /// Adds a vector of flags, as bytes 0 and 1.
    pub(crate) fn put_flags(&mut self, name: &str, values: &[bool]) {
        let bytes: Vec<u8> = values.iter().map(|&flag| u8::from(flag)).collect();
        self.put_bytes(name, &[values.len()], &bytes);
    }

    /// Writes everything under a temporary name, flushes it to the disk and renames it into place.
    pub(crate) fn write(&self) -> Result<(), FileError> {
        let bytes = self.to_bytes()?;
        write_atomically(&self.path, &bytes).map_err(|source| FileError::Io {
            action: "write",
            path: self.path.clone(),
            source,
        })
    }

    /// Returns the bytes of the file.
    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>, FileError> {
        let views: Result<Vec<_>, _> = self
            .tensors
            .iter()
            .map(|(name, t)| TensorView::new(t.dtype, t.shape.clone(), &t.bytes).map(|view| (name, view)))
            .collect();
        let entries = self.description.trim_start_matches('{');
        let header = HashMap::from([(DESCRIPTION.to_owned(), format!(r#"{{"{SEAL}":"00000000",{entries}"#))]);
        let bytes = views.and_then(|views| safetensors::serialize(views, Some(header)));
        let mut bytes = bytes.map_err(|e| self.format(e.to_string()))?;
        let sum = digits_of(&bytes);
        bytes[LENGTH..][FORM.place()].copy_from_slice(sum.as_bytes());
        Ok(bytes)
    }

    /// Reads a whole file.
    pub(crate) fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = fs::read(path).map_err(|source| FileError::Io { action: "read", path: path.to_owned(), source })?;
        Self::parse(path, &bytes)
    }

    /// Parses a whole file from memory; `path` is for messages. Its checksum, if it has one, is verified first: older
    /// versions wrote none.
    pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<Self, FileError> {
        let is_whole = is_whole(bytes);
        let other = |detail: String| FileError::Foreign { path: path.to_owned(), detail };
        let foreign = |error: SafeTensorError| match error {
            SafeTensorError::HeaderTooSmall
            | SafeTensorError::InvalidHeaderLength
            | SafeTensorError::MetadataIncompleteBuffer => FileError::CutOff { path: path.to_owned(), advice: "" },
            // These bytes are no header length: the file is of another kind.
            SafeTensorError::HeaderTooLarge
            | SafeTensorError::InvalidHeader(_)
            | SafeTensorError::InvalidHeaderDeserialization(_) => {
                other("not safetensors, the form of policies and skill models".to_owned())
            }
            error => other(format!("not safetensors ({error})")),
        };
        let damaged = || FileError::Damaged { path: path.to_owned(), advice: "" };
        let metadata = match SafeTensors::read_metadata(bytes).map_err(foreign) {
            Err(FileError::CutOff { path, advice }) => return Err(FileError::CutOff { path, advice }),
            _ if is_whole == Some(false) => return Err(damaged()),
            metadata => metadata?.1,
        };
        let description = metadata
            .metadata()
            .as_ref()
            .and_then(|map| map.get(DESCRIPTION).cloned())
            .ok_or_else(|| other(format!("the header has no `{DESCRIPTION}` entry")))?;
        if is_whole.is_none() {
            if description.starts_with(r#"{"crc32"#) {
                return Err(damaged());
            }
            tracing::warn!(
                "{} was written by an older version and has no checksum: damage to it would not be seen",
                path.display()
            );
        }
        let views = SafeTensors::deserialize(bytes).map_err(foreign)?;
        let tensors = views
            .iter()
            .map(|(name, view)| {
                let stored =
                    StoredTensor { shape: view.shape().to_vec(), dtype: view.dtype(), bytes: view.data().to_vec() };
                (name.to_owned(), stored)
            })
            .collect();
        Ok(Self { path: path.to_owned(), description, tensors })
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

    /// Fails if any tensor was not taken out.
    pub(crate) fn finish(self) -> Result<(), FileError> {
        match self.tensors.into_keys().next() {
            None => Ok(()),
            Some(name) => Err(FileError::ExtraTensor { path: self.path, name }),
        }
    }

    /// Returns whether this tensor has not been taken out yet.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Returns the file's name.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the product of `sizes`, each at least 1, or an error that names `what` if the product exceeds any
    /// file.
    pub(crate) fn product(&self, what: &str, sizes: &[usize]) -> Result<usize, FileError> {
        if sizes.contains(&0) {
            return Err(self.format(format!("`{what}` has a size of 0")));
        }
        let product = sizes.iter().try_fold(1usize, |product, &size| product.checked_mul(size));
        let product = product.filter(|product| *product <= isize::MAX as usize / 8);
        product.ok_or_else(|| self.format(format!("`{what}` cannot be as large as its description says: {sizes:?}")))
    }

    /// Checks that the tensor `name` is there and has `shape`.
    fn expect(&self, name: &str, shape: &[usize]) -> Result<(), FileError> {
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

    /// Returns an error about this file's contents.
    pub(crate) fn format(&self, detail: String) -> FileError {
        FileError::Format { path: self.path.clone(), detail }
    }

    /// Returns an error about the described learner.
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

/// Returns whether the checksum of a file matches its bytes; `None` without one.
fn is_whole(bytes: &[u8]) -> Option<bool> {
    let header = bytes.get(LENGTH..).unwrap_or_default();
    match FORM.digits(header) {
        Ok(None) => None,
        Err(_) => Some(false),
        Ok(Some(sum)) => {
            let place = FORM.place();
            let mut hasher = crc32fast::Hasher::new();
            for part in [&bytes[..LENGTH + place.start], NO_SUM, &header[place.end..]] {
                hasher.update(part);
            }
            Some(hasher.finalize() == sum)
        }
    }
}
