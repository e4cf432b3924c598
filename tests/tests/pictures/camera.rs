//! Camera sensors.

mod errors;
mod of;
mod sensor;
mod ticks;
