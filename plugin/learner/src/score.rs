//! SCORE: the ties of an online policy to the skill decoder.
//!
//! Three switches over PPO or SAC. The policy reads the skill z ([`ScoreConfig::condition`]). It starts as a copy of
//! the decoder ([`ScoreConfig::init_from_decoder`]; not where SAC squashes actions). Its loss gains kl_coef times a
//! penalty ([`ScoreConfig::kl`]). The penalty is mean(α KL(decoder ‖ policy)) (the SCORE paper's Eq. 3 as a loss to
//! minimise), where α is the decoder's confidence in the row, or one of the other forms of [`PenaltyForm`].
//!
//! The folder, in reading order:
//!
//! - `config`: settings of SCORE.
//! - `teacher`: the frozen decoder and prior of a skill model.
//! - `penalty`: the penalty for leaving the decoder.

mod config;
pub mod penalty;
mod teacher;

pub(crate) use crate::score::teacher::{Teacher, TeacherOutput, TiedTo};
pub use crate::score::{
    config::{ConfidenceKind, KlDirection, PenaltyForm, PriorKind, ScoreConfig},
    penalty::{Penalty, confidences, decoder_kl, own_samples, penalty, penalty_weights},
    teacher::TeacherBatch,
};
