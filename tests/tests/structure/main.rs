//! How the workspace is built, read from its sources as text: no circles, short files, few public items, an example for each
//! concept, components and resources that are reflected.
//!
//! The sources are read and not compiled, so that every feature and every platform is seen at once; only what is registered
//! is asked of Bevy. Code for tests (`#[cfg(test)]`, `tests/`, `examples/`) may import what it likes; only the length of its
//! files is looked at.

mod adapters;
mod circles;
mod doctests;
mod files;
mod hidden;
mod imports;
mod items;
mod modules;
mod packages;
mod planted;
mod public;
mod reflected;
mod resolve;
mod rules;
mod tokens;
mod use_tree;
mod writes;
