//! Tests of every kind of file that is read back, with a flipped bit, cut off anywhere, and changed by an adversary who
//! knows its structure.

mod cuts;
mod flips;
mod mutants;

use std::sync::LazyLock;

use playbot_tests::hostile::{FileKind, Reading, all_kinds};

/// All kinds.
static KINDS: LazyLock<Vec<FileKind>> = LazyLock::new(all_kinds);

/// Returns the contents of a whole file of a kind.
fn whole(kind: &FileKind, folder: &std::path::Path) -> Vec<String> {
    kind.put(folder, kind.bytes());
    match kind.read(folder) {
        Reading::Whole(parts) => parts,
        Reading::Refused(words) => panic!("{} is whole: {words}", kind.name),
    }
}
