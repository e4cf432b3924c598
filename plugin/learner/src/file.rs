//! Self-describing safetensors files: tensors by name, and a JSON description in the header.
//!
//! - `seal`: checksums inside files, which reveal damage before the contents are used.

mod seal;

use crate::{
    FileError, LearnError,
    device::send,
    disk::write_atomically,
    file::seal::{Form, digits_of},
    nn::{Adam, Init, ParamSource, ParamVisitor, Parameters, host},
};
use burn::tensor::{Device, Tensor, TensorData};
use safetensors::{Dtype, SafeTensorError, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::{
    cmp::Ordering,
    collections::{BTreeMap, HashMap},
    fs,
    path::{Path, PathBuf},
};

pub use crate::file::seal::{BrokenSeal, Unsealed, seal_json, seal_text, unseal_json, unseal_text};

/// The header entry that holds the description.
const DESCRIPTION: &str = "playbot";

/// The entry of the description that holds the checksum of the whole file, computed with zeros in place of its
/// digits.
const SEAL: &str = "crc32";

/// Start of a file with a checksum, behind the eight bytes with the length of the header.
const FORM: Form = Form { prefix: br#"{"__metadata__":{"playbot":"{\"crc32\":\""#, suffix: br#"\","# };

/// Placeholder of a checksum that is not known yet.
const NO_SUM: &[u8; 8] = b"00000000";

/// Bytes that hold the length of the header.
const LENGTH: usize = 8;

/// The contents of one file, to be written or just read.
#[derive(Clone, Debug)]
pub(crate) struct TensorFile {
    path: PathBuf,
    description: String,
    tensors: BTreeMap<String, StoredTensor>,
}

impl TensorFile {
    /// Creates an empty file for `path` with `description`, which is JSON, in its header.
    fn empty(path: &Path, description: String) -> Self {
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

/// A tensor in host memory.
#[derive(Clone, Debug)]
struct StoredTensor {
    shape: Vec<usize>,
    dtype: Dtype,
    bytes: Vec<u8>,
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

// The JSON in the header of a file: its kind, its version, and other data for its reader.

/// A kind of file, and the version of it that this program writes and reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileKind {
    pub(crate) name: &'static str,
    pub(crate) version: u32,
}

/// The part of every header that identifies the format of the rest.
#[derive(Serialize, Deserialize)]
struct Identity<'a> {
    kind: &'a str,
    version: u32,
}

/// The message about a description that is not JSON.
const NO_JSON: &str = "the description in its header is damaged, or another program wrote it: restore the file \
                       from a copy, or create it again";

/// Most characters of an error that quotes the file.
const QUOTED: usize = 200;

/// Returns the message about a description with missing or unknown entries.
fn misfit(error: &str) -> String {
    let more = if error.chars().nth(QUOTED).is_some() { "…" } else { "" };
    let error: String = error.chars().take(QUOTED).collect();
    format!(
        "the description in its header does not match this version of playbot ({error}{more}): create the file again \
         with this version"
    )
}

impl TensorFile {
    /// Creates an empty file for `path`, whose header holds the entries `kind` and `version`, then those of `header`.
    pub(crate) fn new(path: &Path, kind: FileKind, header: &impl Serialize) -> Result<Self, FileError> {
        let json = |value: Result<String, serde_json::Error>| {
            value.map_err(|e| FileError::Format { path: path.to_owned(), detail: e.to_string() })
        };
        let identity = json(serde_json::to_string(&Identity { kind: kind.name, version: kind.version }))?;
        let header = json(serde_json::to_string(header))?;
        // Merges two JSON objects into one.
        let description = format!("{},{}", identity.trim_end_matches('}'), header.trim_start_matches('{'));
        Ok(Self::empty(path, description))
    }

    /// Returns the header without `kind` and `version`, if the file is of this kind. The version is checked first, so
    /// that additions of a newer version are not reported as errors.
    pub(crate) fn header<T: DeserializeOwned>(&self, kind: FileKind) -> Result<T, FileError> {
        // The position of a syntax error is omitted: people do not write this JSON.
        let mut header: serde_json::Map<String, Value> =
            serde_json::from_str(&self.description).map_err(|_| self.format(NO_JSON.to_owned()))?;
        let parse = |error: serde_json::Error| self.format(misfit(&error.to_string()));
        // It was checked when the file was read.
        header.remove(SEAL);
        let identity =
            Value::Object(["kind", "version"].into_iter().filter_map(|key| header.remove_entry(key)).collect());
        self.check_kind(kind, &Identity::deserialize(&identity).map_err(parse)?)?;
        serde_json::from_value(Value::Object(header)).map_err(parse)
    }

    fn check_kind(&self, kind: FileKind, found: &Identity<'_>) -> Result<(), FileError> {
        let FileKind { name, version } = kind;
        if found.kind != name {
            let kind: String = found.kind.chars().take(QUOTED).collect();
            return Err(self.format(format!("is of the kind `{kind}`, and one of the kind `{name}` is needed here")));
        }
        match found.version.cmp(&version) {
            Ordering::Equal => Ok(()),
            Ordering::Greater => {
                let path = self.path().to_owned();
                Err(FileError::Newer { path, kind: name, found: found.version, readable: version })
            }
            Ordering::Less => Err(self.format(format!(
                "was written by an older version of playbot ({name} format {}, this one reads {version}): write it again \
                 with this one",
                found.version
            ))),
        }
    }
}

// Networks and optimizers in files.

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
        Ok(send(TensorData::new(values, shape), self.device))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Kept {
        #[serde(rename = "a")]
        _a: u32,
    }

    #[test]
    fn a_description_that_cannot_be_used_is_said_in_few_plain_words() {
        let said = |description: &str| {
            let file = TensorFile::empty(Path::new("skills"), description.to_owned());
            let header = file.header::<Kept>(FileKind { name: "thing", version: 1 });
            header.map(drop).expect_err("unusable").to_string()
        };
        let damaged = said(r#"{kind:"thing","version":1,"a":1}"#);
        assert_eq!(damaged, format!("skills: {NO_JSON}"));
        let lacking = said(r#"{"kind":"thing","version":1}"#);
        assert!(lacking.contains("(missing field `a`): create the file again with this version"), "{lacking}");
        let long = "k".repeat(10_000_000);
        for description in [
            format!(r#"{{"kind":"thing","version":1,"a":1,"{long}":2}}"#),
            format!(r#"{{"kind":"{long}","version":1}}"#),
            format!(r#"{{"{long}":2"#),
        ] {
            let words = said(&description);
            assert!(words.len() < 1024 && words.starts_with("skills: "), "{} bytes", words.len());
        }
    }
}
