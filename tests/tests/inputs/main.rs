//! What an agent's action presses, and what a person's keys become.

mod foreign;
mod foreign_managers;
mod keyboard;
mod managers;
mod virtual_input;
