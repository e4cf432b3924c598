//! How the workspace is built, read from its sources as text: no circles, short files, few public items, an example for each
//! concept.
//!
//! Nothing here is compiled but the reader itself, so it sees every feature and every platform at once. Code for tests
//! (`#[cfg(test)]`, `tests/`, `examples/`) may import what it likes; only the length of its files is looked at.

mod circles;
mod doctests;
mod files;
mod imports;
mod items;
mod modules;
mod packages;
mod planted;
mod public;
mod resolve;
mod rules;
mod tokens;
mod use_tree;
