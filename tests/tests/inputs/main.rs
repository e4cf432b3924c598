//! Tests of the input of agents' actions, and of the actions of people's keys.

mod clicks;
mod fixed_steps;
mod foreign;
mod foreign_managers;
mod keyboard;
mod legal;
mod managers;
mod people;
mod pointers;
mod virtual_input;
