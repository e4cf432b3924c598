//! Tests of the input of agents' actions, and of the actions of people's keys.

mod fixed_steps;
mod foreign;
mod foreign_managers;
mod keyboard;
mod managers;
mod virtual_input;
