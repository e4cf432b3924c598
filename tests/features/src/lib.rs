//! Holds no code. Its manifest names the features that the parts of the workspace ask of what they share, so that every
//! selection of packages and features builds the shared crates once, with the same features: without it, adding
//! `--features window` or testing one crate builds burn and Bevy's core again.
