//! Kinds of files that are read back.

use std::{
    collections::BTreeMap,
    fmt::Display,
    fs,
    path::{Path, PathBuf},
};

use super::{dice::Dice, form::Form, heard::heard};

/// The report of a reader on a file: its contents, part by part, or the refusal.
pub(super) type Read = Result<Vec<String>, String>;

/// The result of reading a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reading {
    /// Read as a whole one, with these contents, part by part.
    Whole(Vec<String>),
    /// Refused, or read with a warning.
    Refused(String),
}

/// A kind of file, with a whole one and the files beside it that reading needs.
#[derive(Clone)]
pub struct FileKind {
    /// Its name.
    pub name: &'static str,
    /// Its structure.
    pub form: Form,
    /// The file grows part by part, so it is whole after any of them; a resumption adds the rest.
    pub grows: bool,
    /// Reading needs a World.
    pub is_slow: bool,
    file: PathBuf,
    files: BTreeMap<PathBuf, Vec<u8>>,
    read: fn(&Path) -> Read,
    handle: fn(&Path),
}

impl FileKind {
    /// Takes the kind of `file` in a folder, whose other files are needed to read it. `read` is given a copy of the
    /// folder.
    pub(super) fn new(name: &'static str, form: Form, folder: &Path, file: &str, read: fn(&Path) -> Read) -> Self {
        let mut files = BTreeMap::new();
        gather(folder, folder, &mut files);
        let file = PathBuf::from(file);
        assert!(files.contains_key(&file), "{name}: there is no {}", file.display());
        Self { name, form, grows: false, is_slow: false, file, files, read, handle: |_| {} }
    }

    /// Returns a kind that grows part by part.
    pub(super) fn growing(self) -> Self {
        Self { grows: true, ..self }
    }

    /// Returns a kind that is read into a World.
    pub(super) fn slow(self) -> Self {
        Self { is_slow: true, ..self }
    }

    /// Adds work to do with such a file besides reading it.
    pub(super) fn handled(self, handle: fn(&Path)) -> Self {
        Self { handle, ..self }
    }

    /// Returns the whole file.
    pub fn bytes(&self) -> &[u8] {
        &self.files[&self.file]
    }

    /// Returns true if it has checksums. Files written by hand have none.
    pub fn is_sealed(&self) -> bool {
        self.form != Form::Text
    }

    /// Returns the mutant of a seed, always the same.
    pub fn mutant(&self, seed: u64) -> Vec<u8> {
        self.form.mutate(self.bytes(), &mut Dice::new(seed))
    }

    /// Empties a folder, and puts these bytes there as such a file, with the files beside it.
    pub fn put(&self, folder: &Path, bytes: &[u8]) {
        // Some file systems wait for the disk where a file is written over.
        let _ = fs::remove_dir_all(folder);
        fs::create_dir_all(folder).expect("writable");
        for (name, whole) in &self.files {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().expect("in the folder")).expect("writable");
            fs::write(path, if *name == self.file { bytes } else { whole.as_slice() }).expect("writable");
        }
    }

    /// Reads the file of [`put`](Self::put).
    pub fn read(&self, folder: &Path) -> Reading {
        let (read, warnings) = heard(|| (self.read)(folder));
        match (read, warnings.into_iter().next()) {
            (Err(words), _) | (Ok(_), Some(words)) => Reading::Refused(words),
            (Ok(parts), None) => Reading::Whole(parts),
        }
    }

    /// Does the further work with such a file.
    pub fn handle(&self, folder: &Path) {
        (self.handle)(folder);
    }
}

fn gather(root: &Path, folder: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        if path.is_dir() {
            gather(root, &path, files);
        } else {
            let name = path.strip_prefix(root).expect("in the folder").to_owned();
            files.insert(name, fs::read(&path).expect("readable"));
        }
    }
}

/// Formats an error.
pub(super) fn words(error: impl Display) -> String {
    error.to_string()
}
