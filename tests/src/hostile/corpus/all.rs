//! All kinds of files.

use std::path::Path;

use super::{drawn::drawn, learned::learned, recorded::recorded, scored::scored, tested::tested, trained::trained};
use crate::hostile::kind::FileKind;

/// Makes some kinds of files in a folder.
type Maker = fn(&Path) -> Vec<FileKind>;

const MAKERS: [(&str, Maker); 6] = [
    ("learned", learned),
    ("recorded", recorded),
    ("trained", trained),
    ("tested", tested),
    ("scored", scored),
    ("drawn", drawn),
];

/// Returns all kinds of files that the program reads back, each with a whole one. They are made here, quickly, and are
/// always the same but for times.
pub fn all_kinds() -> Vec<FileKind> {
    let folder = tempfile::tempdir().expect("a folder");
    let made = MAKERS.iter().flat_map(|(name, make)| {
        let own = folder.path().join(name);
        std::fs::create_dir(&own).expect("writable");
        make(&own)
    });
    made.collect()
}
