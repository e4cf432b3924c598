//! The JSON in the header of a file: what kind of file it is, its version, and what else its reader needs.

use super::TensorFile;
use super::tensor_file::SEAL;
use crate::FileError;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::cmp::Ordering;
use std::path::Path;

/// A kind of file, and the version of it that this program writes and reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileKind {
    pub(crate) name: &'static str,
    pub(crate) version: u32,
}

/// The part of every header that says how to read the rest.
#[derive(Serialize, Deserialize)]
struct Identity<'a> {
    kind: &'a str,
    version: u32,
}

impl TensorFile {
    /// An empty file for `path`, whose header holds the entries `kind` and `version`, then those of `header`.
    pub(crate) fn new(path: &Path, kind: FileKind, header: &impl Serialize) -> Result<Self, FileError> {
        let json = |value: Result<String, serde_json::Error>| {
            value.map_err(|e| FileError::Format { path: path.to_owned(), detail: e.to_string() })
        };
        let identity = json(serde_json::to_string(&Identity { kind: kind.name, version: kind.version }))?;
        let header = json(serde_json::to_string(header))?;
        // Two JSON objects become one.
        let description = format!("{},{}", identity.trim_end_matches('}'), header.trim_start_matches('{'));
        Ok(Self::empty(path, description))
    }

    /// The header without `kind` and `version`, if the file calls itself of this kind. That is looked at first, so that
    /// what a newer version added is not taken for a fault.
    pub(crate) fn header<T: DeserializeOwned>(&self, kind: FileKind) -> Result<T, FileError> {
        let parse = |e: serde_json::Error| self.format(format!("the description in its header cannot be used: {e}"));
        let mut header: serde_json::Map<String, Value> = serde_json::from_str(&self.description).map_err(parse)?;
        // It was looked at when the file was read.
        header.remove(SEAL);
        let identity =
            Value::Object(["kind", "version"].into_iter().filter_map(|key| header.remove_entry(key)).collect());
        self.check_kind(kind, &Identity::deserialize(&identity).map_err(parse)?)?;
        serde_json::from_value(Value::Object(header)).map_err(parse)
    }

    fn check_kind(&self, kind: FileKind, found: &Identity<'_>) -> Result<(), FileError> {
        let FileKind { name, version } = kind;
        if found.kind != name {
            return Err(self.format(format!("is of the kind `{}`, expected `{name}`", found.kind)));
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
