//! Pictures within the page, or in files beside it.

use crate::verdict::TestError;
use bevy_playbot::state_hash::StateHash;
use playbot_learner::disk;
use playbot_report::{base64, escape::uri_path};
use std::{
    cell::RefCell,
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

/// Text after the name of a page, without its ending, in the name of the folder of its pictures.
const FOLDER: &str = "-files";

/// Digits of a picture's name.
const DIGITS: usize = 16;

/// The PNG pictures of a page.
#[derive(Default)]
pub(crate) struct PictureFiles {
    /// Name of the folder beside the page; `None` if the page contains its pictures.
    folder: Option<String>,
    /// Pictures by the names of their files, which come from their bytes: equal ones are one file.
    files: RefCell<BTreeMap<String, Vec<u8>>>,
}

impl PictureFiles {
    /// Makes the pictures of a page that has them in a folder beside it.
    pub fn beside(page: &Path) -> Self {
        Self { folder: Some(folder_name(page)), files: RefCell::default() }
    }

    /// Returns whether the pictures are files.
    pub fn is_split(&self) -> bool {
        self.folder.is_some()
    }

    /// Adds a picture, and returns its address: for the page alone, or relative to it.
    pub fn source(&self, png: &[u8]) -> String {
        let Some(folder) = &self.folder else { return format!("data:image/png;base64,{}", base64(png)) };
        let mut files = self.files.borrow_mut();
        let mut hash = StateHash::of(png.iter().copied().map(u64::from)).0;
        loop {
            let name = format!("{hash:0DIGITS$x}.png");
            let known = files.entry(name.clone()).or_insert_with(|| png.to_vec());
            if known == png {
                return format!("{}/{name}", uri_path(folder));
            }
            // Another picture has the same hash.
            hash = hash.wrapping_add(1);
        }
    }

    /// Writes the files of a page.
    ///
    /// # Errors
    ///
    /// The folder or a file cannot be written.
    pub fn write(&self, page: &Path) -> Result<(), TestError> {
        let files = self.files.borrow();
        if files.is_empty() {
            return Ok(());
        }
        let folder = folder_of(page);
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| TestError::Io { action: "write", path, source }
        };
        disk::create_dir_all(&folder).map_err(failed(&folder))?;
        for (name, bytes) in files.iter() {
            let file = folder.join(name);
            // Its name says its bytes, so one of this length is there already.
            if fs::metadata(&file).is_ok_and(|known| known.len() == bytes.len() as u64) {
                continue;
            }
            disk::write_atomically(&file, bytes).map_err(failed(&file))?;
        }
        Ok(())
    }

    /// Removes the pictures that an earlier page of this name had and this one does not, and the folder if it is empty
    /// then. Other files in it stay.
    ///
    /// # Errors
    ///
    /// A picture cannot be removed.
    pub fn remove_others(&self, page: &Path) -> Result<(), TestError> {
        let folder = folder_of(page);
        let failed = |source| TestError::Io { action: "remove", path: folder.clone(), source };
        let entries = match fs::read_dir(&folder) {
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                return Ok(());
            }
            entries => entries.map_err(failed)?,
        };
        let (files, mut is_empty) = (self.files.borrow(), true);
        for entry in entries {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if is_picture(&name) && !files.contains_key(&name) {
                disk::remove_file(&entry.path()).map_err(failed)?;
            } else {
                is_empty = false;
            }
        }
        if is_empty { disk::remove_dir(&folder).map_err(failed) } else { Ok(()) }
    }
}

/// Returns the name of the folder with the pictures of a page: `report-files` for `report.html`.
fn folder_name(page: &Path) -> String {
    format!("{}{FOLDER}", page.file_stem().unwrap_or_default().to_string_lossy())
}

/// Returns the folder with the pictures of a page.
pub fn folder_of(page: &Path) -> PathBuf {
    page.with_file_name(folder_name(page))
}

/// Returns whether a file has the name of a picture of a page.
fn is_picture(name: &str) -> bool {
    let digit = |letter: u8| letter.is_ascii_digit() || (b'a'..=b'f').contains(&letter);
    name.strip_suffix(".png").is_some_and(|hash| hash.len() == DIGITS && hash.bytes().all(digit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_a_whole_page_are_within_it() {
        let files = PictureFiles::default();
        assert_eq!(files.source(b"foo"), "data:image/png;base64,Zm9v");
        files.write(Path::new("no-such-folder/report.html")).expect("nothing is to be written");
    }

    #[test]
    fn equal_pictures_are_one_file_and_those_of_earlier_pages_go() {
        let parent = tempfile::tempdir().expect("a folder");
        let page = parent.path().join("my report #2.html");
        let folder = parent.path().join("my report #2-files");
        let names = |files: &PictureFiles| {
            files.write(&page).expect("writable");
            files.remove_others(&page).expect("writable");
            let mut names: Vec<String> = fs::read_dir(&folder)
                .map(|entries| {
                    entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
                })
                .unwrap_or_default();
            names.sort();
            names
        };
        let first = PictureFiles::beside(&page);
        let sources = [b"one", b"two", b"one"].map(|png| first.source(png));
        assert_eq!(sources[0], sources[2]);
        assert!(sources[0].starts_with("my%20report%20%232-files/") && sources[0].ends_with(".png"), "{sources:?}");
        let written = names(&first);
        assert_eq!(written.len(), 2);
        let own = sources[1].rsplit('/').next().expect("a name");
        assert_eq!(fs::read(folder.join(own)).expect("written"), b"two");

        fs::write(folder.join("notes.png"), "mine").expect("writable");
        let second = PictureFiles::beside(&page);
        second.source(b"two");
        assert_eq!(names(&second), [own, "notes.png"]);
        // A page that contains its pictures has no files.
        assert_eq!(names(&PictureFiles::default()), ["notes.png"]);
        fs::remove_file(folder.join("notes.png")).expect("there");
        assert!(names(&PictureFiles::default()).is_empty() && !folder.exists());
    }

    #[test]
    fn folders_that_cannot_be_written_are_errors() {
        let parent = tempfile::tempdir().expect("a folder");
        let page = parent.path().join("report.html");
        fs::write(parent.path().join("report-files"), "a file").expect("writable");
        let files = PictureFiles::beside(&page);
        files.write(&page).expect("nothing is to be written");
        files.source(b"one");
        let error = files.write(&page).expect_err("the folder is a file").to_string();
        assert!(error.contains("report-files") && error.contains("write"), "{error}");
        files.remove_others(&page).expect("a file has no pictures");
        assert!(parent.path().join("report-files").is_file());
    }

    #[test]
    fn pictures_with_one_hash_stay_two() {
        let files = PictureFiles::beside(Path::new("report.html"));
        let one = files.source(b"one");
        let name = one.rsplit('/').next().expect("a name").to_owned();
        files.files.borrow_mut().insert(name, b"two".to_vec());
        assert_ne!(files.source(b"one"), one);
    }
}
