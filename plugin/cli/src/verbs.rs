//! The verbs of the command line: a module each, with its options (`Args`) and its `run`.
//!
//! - Begin: [`init`].
//! - Test levels: [`mod@test`], [`doctor`], [`replay`], [`review`], [`explore`], [`levels`], [`watch`],
//!   [`report`], [`history`], [`bisect`], [`bugs`].
//! - See levels and episodes: [`level`], [`trace`], [`view`], [`eyes`], [`skills`], [`play`].
//! - Record: [`record`], [`demo`].
//! - Learn: [`quickstart`], [`teach`], [`learn_skills`], [`imitate`], [`train`], [`diagnose`], [`study`], [`eval`],
//!   [`config`], [`runs`], [`policy`], [`bench`].
//! - Let other programs play: [`serve`]; play for others: [`work`].
//! - Use the shell: [`completions`].
//!
//! A verb reads its options, opens what they name, calls the library, and prints what comes back. Options that several
//! verbs have are in [`arguments`](crate::arguments), errors with their exit codes in [`error`](crate::error). A new
//! verb is a module here, a variant of the command line's `Verb`, and a word in a group of
//! [`reference`](crate::reference).

pub(crate) mod bench;
pub(crate) mod bisect;
pub(crate) mod bugs;
pub(crate) mod completions;
pub(crate) mod config;
pub(crate) mod demo;
pub(crate) mod diagnose;
pub(crate) mod doctor;
pub(crate) mod eval;
pub(crate) mod explore;
pub(crate) mod eyes;
pub(crate) mod history;
pub(crate) mod imitate;
pub(crate) mod init;
pub(crate) mod learn_skills;
pub(crate) mod level;
pub(crate) mod levels;
pub(crate) mod play;
pub(crate) mod policy;
pub(crate) mod quickstart;
pub(crate) mod record;
pub(crate) mod replay;
pub(crate) mod report;
pub(crate) mod review;
pub(crate) mod runs;
pub(crate) mod serve;
pub(crate) mod skills;
pub(crate) mod study;
pub(crate) mod teach;
pub(crate) mod test;
pub(crate) mod trace;
pub(crate) mod train;
pub(crate) mod view;
pub(crate) mod watch;
pub(crate) mod work;
