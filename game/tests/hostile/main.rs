//! What an adversary, a bad disk or a slip of the keyboard does to files: nothing is accepted silently, and nothing panics.

mod dice;
mod experiments;
mod runs;
