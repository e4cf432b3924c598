//! The verbs of the command line, one module each.

pub(crate) mod bench;
pub(crate) mod bugs;
pub(crate) mod config;
pub(crate) mod demo;
pub(crate) mod doctor;
pub(crate) mod eval;
pub(crate) mod explore;
pub(crate) mod eyes;
pub(crate) mod learn_skills;
pub(crate) mod level;
pub(crate) mod play;
pub(crate) mod policy;
pub(crate) mod quickstart;
pub(crate) mod record;
pub(crate) mod replay;
pub(crate) mod report;
pub(crate) mod runs;
pub(crate) mod study;
pub(crate) mod test;
pub(crate) mod trace;
pub(crate) mod train;
pub(crate) mod view;
