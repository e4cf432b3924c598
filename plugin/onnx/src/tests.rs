//! Tests of export and import, over every kind of policy that the trainers make.

mod exported;
mod imported;
mod kinds;
