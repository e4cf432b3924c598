//! Tests of files changed by an adversary who knows their structure, checksums and all.

use playbot_tests::hostile::{Reading, read_mutants};

use crate::KINDS;

/// Mutants of each kind; fewer of kinds that are read into a World.
const MUTANTS: u64 = 300;
const SLOW_MUTANTS: u64 = 60;

fn measure(work: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(work).bytes_max
}

/// An hour of the same is `cargo run --release -p playbot_tests --example fuzz -- --seconds 3600 --seed 1`.
#[test]
fn no_mutant_of_any_kind_is_too_much_for_its_reader() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut whole, mut refused, mut faults) = (0, 0, Vec::new());
    for kind in KINDS.iter() {
        let seeds = 0..if kind.is_slow { SLOW_MUTANTS } else { MUTANTS };
        let tally = read_mutants(kind, seeds, &folder.path().join("kind"), measure);
        (whole, refused) = (whole + tally.whole, refused + tally.refused);
        faults.extend(tally.faults.iter().map(|fault| format!("{}, seed {}: {}", kind.name, fault.seed, fault.what)));
        if tally.is_stuck {
            break;
        }
    }
    assert!(faults.is_empty(), "{} mutants\n{}", faults.len(), faults.join("\n"));
    // Checksums that fit let some of them in.
    assert!(whole > 300 && refused > 3000, "{whole} were read, {refused} refused");
}

#[test]
fn a_checkpoint_that_asks_for_actions_which_the_game_does_not_have_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let kind = KINDS.iter().find(|kind| kind.name == "arenas.json").expect("it is a kind");
    let text = std::str::from_utf8(kind.bytes()).expect("text");
    let changed = text.replace("\"Discrete\":[", "\"Discrete\":[99,").replace("99,]", "99]");
    assert_ne!(changed, text);
    kind.put(folder.path(), &kind.form.reseal(changed.as_bytes()));
    match kind.read(folder.path()) {
        Reading::Refused(words) => assert!(words.contains("99 of 3 choices"), "{words}"),
        Reading::Whole(parts) => panic!("{parts:?}"),
    }
}
