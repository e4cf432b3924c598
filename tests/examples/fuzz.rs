//! Fuzzer of file readers: reads changed files of all kinds for a given time, as the tests do for seconds:
//!
//! ```sh
//! cargo run --release -p playbot_tests --example fuzz -- --seconds 3600 --seed 1
//! ```
//!
//! A file that makes its reader panic, takes it longer than five seconds, or makes it ask for much memory is kept in
//! the folder `fuzz`, or the one that `--out` names; the exit code is 1 then. If the whole program dies of a file, that
//! file is `current` in the folder. `--kind NAME` reads files of one kind alone.
#![allow(clippy::print_stdout, reason = "it prints what it does")]

use std::{
    collections::BTreeMap,
    env, fs,
    path::PathBuf,
    process::ExitCode,
    time::{Duration, Instant},
};

use playbot_tests::hostile::{FileKind, HostileFault, all_kinds, read_mutants};

/// Mutants between two looks at the clock; fewer for kinds that are read into a World.
const AT_ONCE: u64 = 200;
const SLOW_AT_ONCE: u64 = 20;
/// Seeds of mutants of one seed of the command line.
const SEEDS: u64 = 1 << 32;

struct Options {
    seconds: u64,
    seed: u64,
    out: PathBuf,
    kind: Option<String>,
}

impl Options {
    fn read() -> Result<Self, String> {
        let mut options = Self { seconds: 60, seed: 1, out: "fuzz".into(), kind: None };
        let mut words = env::args().skip(1);
        while let Some(word) = words.next() {
            let value = words.next().ok_or(format!("{word} needs a value"))?;
            let number = || value.parse().map_err(|_| format!("`{word} {value}`: write a number"));
            match word.as_str() {
                "--seconds" => options.seconds = number()?,
                "--seed" => options.seed = number()?,
                "--out" => options.out = value.into(),
                "--kind" => options.kind = Some(value),
                _ => return Err(format!("unknown option {word}: there are --seconds, --seed, --out and --kind")),
            }
        }
        Ok(options)
    }

    /// Returns the requested kinds.
    fn kinds(&self) -> Result<Vec<FileKind>, String> {
        let all = all_kinds();
        let names: Vec<&str> = all.iter().map(|kind| kind.name).collect();
        let is_wanted = |kind: &FileKind| self.kind.as_ref().is_none_or(|name| kind.name == name);
        if !all.iter().any(is_wanted) {
            return Err(format!("there is no such kind: name one of {}", names.join(", ")));
        }
        Ok(all.iter().filter(|kind| is_wanted(kind)).cloned().collect())
    }

    /// Keeps a file, and prints its path.
    fn keep(&self, fault: &HostileFault) -> Result<(), String> {
        let path = self.out.join(format!("{}-{}", fault.kind.replace(' ', "-"), fault.seed));
        fs::write(&path, &fault.bytes).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        println!("{}, seed {}: {}; the file is {}", fault.kind, fault.seed, fault.what, path.display());
        Ok(())
    }
}

/// Counts of the mutants of a kind.
#[derive(Default)]
struct Count {
    whole: u64,
    refused: u64,
    faults: u64,
}

fn measure(work: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(work).bytes_max
}

/// Returns true if every file was read without a fault.
fn run(options: &Options) -> Result<bool, String> {
    let kinds = options.kinds()?;
    fs::create_dir_all(&options.out).map_err(|error| format!("cannot create {}: {error}", options.out.display()))?;
    let current = options.out.join("current");
    let end = Instant::now() + Duration::from_secs(options.seconds);
    let mut counts: BTreeMap<&str, Count> = BTreeMap::new();
    let (mut is_stuck, mut round) = (false, 0);
    while !is_stuck && Instant::now() < end {
        for kind in &kinds {
            let at_once = if kind.is_slow { SLOW_AT_ONCE } else { AT_ONCE };
            let first = options.seed.wrapping_mul(SEEDS).saturating_add(round * at_once);
            let tally = read_mutants(kind, first..first + at_once, &current, measure);
            let count = counts.entry(kind.name).or_default();
            count.whole += tally.whole;
            count.refused += tally.refused;
            count.faults += tally.faults.len() as u64;
            tally.faults.iter().try_for_each(|fault| options.keep(fault))?;
            is_stuck |= tally.is_stuck;
            if is_stuck || Instant::now() >= end {
                break;
            }
        }
        round += 1;
    }
    let mut all = Count::default();
    for (name, Count { whole, refused, faults }) in &counts {
        println!(
            "{name:<34} {:>9} mutants: {whole:>9} read, {refused:>9} refused, {faults} faults",
            whole + refused + faults
        );
        (all.whole, all.refused, all.faults) = (all.whole + whole, all.refused + refused, all.faults + faults);
    }
    let Count { whole, refused, faults } = all;
    println!(
        "{:<34} {:>9} mutants: {whole:>9} read, {refused:>9} refused, {faults} faults",
        "all",
        whole + refused + faults
    );
    if is_stuck {
        println!("stopped: the reader of the last file goes on for ever");
    }
    Ok(faults == 0)
}

fn main() -> ExitCode {
    match Options::read().and_then(|options| run(&options)) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(words) => {
            println!("error: {words}");
            ExitCode::from(3)
        }
    }
}
