//! Camera sensors.

mod errors;
mod foreign;
mod of;
mod sensor;
mod ticks;
