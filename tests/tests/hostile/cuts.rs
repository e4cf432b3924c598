//! Tests of files that end too early.

use std::collections::BTreeSet;

use playbot_tests::hostile::{FileKind, Form, Reading};

use crate::{KINDS, whole};

/// Lengths at which a file is cut off, beside the ends of its lines: of a file that is read into a World, and of others.
const SLOW_CUTS: usize = 100;
const CUTS: usize = 1000;

/// Cuts the files of some kinds at many bytes, and short ones at every byte.
fn cut_all(wanted: impl Fn(&&FileKind) -> bool) {
    let folder = tempfile::tempdir().expect("a folder");
    let place = folder.path().join("kind");
    for kind in KINDS.iter().filter(wanted) {
        let parts = whole(kind, &place);
        let mut grown = BTreeSet::new();
        for length in lengths(kind) {
            kind.put(&place, &kind.bytes()[..length]);
            let Reading::Whole(found) = kind.read(&place) else { continue };
            if found == parts {
                // The missing part has no meaning, such as the last line feed.
                continue;
            }
            let is_start = kind.grows && parts.starts_with(&found);
            assert!(is_start, "{}: {length} of {} bytes are taken for a whole file", kind.name, kind.bytes().len());
            grown.insert((found.len(), length));
        }
        // Once for each number of parts, and before the first one.
        assert!(grown.len() <= parts.len() + 1, "{}: {grown:?} of {} parts", kind.name, parts.len());
        assert!(!kind.grows || grown.len() + 2 > parts.len(), "{}: parts that were whole are lost", kind.name);
    }
}

/// Returns the lengths at which a file is cut off.
fn lengths(kind: &FileKind) -> Vec<usize> {
    let bytes = kind.bytes();
    let step = match kind.is_slow {
        true => bytes.len().div_ceil(SLOW_CUTS),
        // Each of its parts has to be seen to be kept.
        false if kind.grows => 1,
        false => bytes.len().div_ceil(CUTS),
    };
    let is_wanted = |&length: &usize| {
        let ends_line = |at: usize| bytes.get(at) == Some(&b'\n');
        length.is_multiple_of(step) || ends_line(length) || (length > 0 && ends_line(length - 1))
    };
    (0..bytes.len()).filter(is_wanted).collect()
}

#[test]
fn what_was_learned_is_never_whole_when_something_is_missing() {
    cut_all(|kind| kind.form == Form::Tensors);
}

#[test]
fn no_other_file_is_whole_when_something_is_missing() {
    cut_all(|kind| kind.form != Form::Tensors);
}
