//! An empty crate. Its manifest names the features that tests add to crates which the program is built on too, so that
//! Bevy and burn are built once for both.
