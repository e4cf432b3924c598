//! An empty crate. Its manifest names the features that the parts of the workspace need of shared crates. Every
//! selection of packages and features therefore builds the shared crates once, with the same features. Without it,
//! adding `--features window` or testing one crate builds burn and Bevy's core again.
