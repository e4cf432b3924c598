//! Tests of learning from pictures, from recordings to policy files.

mod corridor;
mod eyes;
mod learning;
mod recordings;
