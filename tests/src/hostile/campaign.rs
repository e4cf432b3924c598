//! Reading of mutants, which must not panic, take long, or ask for much memory.

use std::{
    ops::Range,
    path::{Path, PathBuf},
    sync::mpsc::{Sender, channel},
    thread,
    time::Duration,
};

use bevy_playbot::engine::panics::hear;

use super::kind::{FileKind, Reading};

/// Longest allowed time of reading one file.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// Most bytes in use while reading one file. Files here have some thousand.
pub const MOST_BYTES: u64 = 256 << 20;

/// Does some work, and returns the most bytes that it had at once.
pub type Measure = fn(&mut dyn FnMut()) -> u64;

/// A mutant on which a reader failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HostileFault {
    /// Kind of the file.
    pub kind: &'static str,
    /// Seed of the mutant.
    pub seed: u64,
    /// The failure.
    pub what: String,
    /// The file.
    pub bytes: Vec<u8>,
}

/// Counts of some mutants.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Mutants that were read as whole files.
    pub whole: u64,
    /// Mutants that were refused, or read with a warning.
    pub refused: u64,
    /// Mutants on which a reader failed.
    pub faults: Vec<HostileFault>,
    /// The last one took too long, so the ones behind it were not read.
    pub is_stuck: bool,
}

/// Reads the mutants of these seeds in a folder of their own, which is emptied for each. The present one stays there if
/// the process dies of it. After one that takes too long no other is read.
pub fn read_mutants(kind: &FileKind, seeds: Range<u64>, folder: &Path, measure: Measure) -> Tally {
    let (sender, receiver) = channel();
    let reader = Reader { kind: kind.clone(), folder: folder.to_owned(), measure };
    let (mut tally, of_reader) = (Tally::default(), seeds.clone());
    // It is not waited for: a reader that hangs would be waited for endlessly.
    thread::spawn(move || reader.read_all(of_reader, &sender));
    for seed in seeds {
        let became = receiver.recv_timeout(PATIENCE);
        let what = match became {
            Ok(Ok(Reading::Whole(_))) => {
                tally.whole += 1;
                continue;
            }
            Ok(Ok(Reading::Refused(_))) => {
                tally.refused += 1;
                continue;
            }
            Ok(Err(ref what)) => what.clone(),
            Err(_) => format!("reading it takes more than {} seconds", PATIENCE.as_secs()),
        };
        tally.faults.push(HostileFault { kind: kind.name, seed, what, bytes: kind.mutant(seed) });
        if became.is_err() {
            tally.is_stuck = true;
            break;
        }
    }
    tally
}

/// Reads one mutant after the other.
struct Reader {
    kind: FileKind,
    folder: PathBuf,
    measure: Measure,
}

impl Reader {
    fn read_all(&self, seeds: Range<u64>, sender: &Sender<Result<Reading, String>>) {
        for seed in seeds {
            // The others are not needed if this one took too long.
            if sender.send(self.read(seed)).is_err() {
                return;
            }
        }
    }

    /// Returns the result of a mutant, or the failure.
    fn read(&self, seed: u64) -> Result<Reading, String> {
        self.kind.put(&self.folder, &self.kind.mutant(seed));
        let mut became = Err(String::new());
        let most = (self.measure)(&mut || {
            became = hear(|| {
                self.kind.handle(&self.folder);
                self.kind.read(&self.folder)
            });
        });
        if most > MOST_BYTES {
            return Err(format!("reading it took {most} bytes at once"));
        }
        became.map_err(|words| format!("it panicked: {words}"))
    }
}
