//! Tests of files damaged by an adversary, a bad disk or a slip of the keyboard: nothing is accepted silently, and
//! nothing panics.

mod dice;
mod experiments;
mod runs;
