//! Every kind of file that is read back, with a flipped bit, cut off anywhere, and changed by somebody who knows how it is built.

mod cuts;
mod flips;
mod mutants;

use std::sync::LazyLock;

use playbot_tests::hostile::{FileKind, Reading, all_kinds};

/// All kinds.
static KINDS: LazyLock<Vec<FileKind>> = LazyLock::new(all_kinds);

/// What is in a whole file of a kind.
fn whole(kind: &FileKind, folder: &std::path::Path) -> Vec<String> {
    kind.put(folder, kind.bytes());
    match kind.read(folder) {
        Reading::Whole(parts) => parts,
        Reading::Told(words) => panic!("{} is whole: {words}", kind.name),
    }
}
