//! The JSON in the header of a file: its kind, its version, and other data for its reader.

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
            return Err(self.format(format!("is of the kind `{kind}`, expected `{name}`")));
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
