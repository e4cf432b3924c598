//! Games that know nothing of the plugin, and their adapters.

mod experiments;
mod faults;
mod headless;
mod lines;
mod namesakes;
mod play;
mod rebuild;
