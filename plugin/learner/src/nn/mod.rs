//! The building blocks of the networks: layers with named parameters, distributions, and the optimizer.
//!
//! Every network is a plain struct of tensors that implements [`Parameters`]. The names of its tensors are used in
//! the files (`actor.l0.weight`), for the optimizer's moments and in error messages. Weights start from generators
//! that the caller owns; burn's global generator is not used.

mod activation;
mod adam;
mod conv;
mod cpu;
mod dist;
mod dist_rows;
mod flat_adam;
mod grads;
mod gru;
mod image_net;
mod impala;
mod init;
mod layer_norm;
mod linear;
mod mlp;
mod moments;
mod nature;
mod obs_batch;
mod packed_pixels;
mod params;
mod sample;
mod source;
mod squash;
mod tensors;
mod unsquash;

pub use activation::Activation;
pub use adam::{Adam, AdamConfig};
pub use conv::{Conv2d, max_pool, window_places};
pub(crate) use cpu::{is_host, known_gradient};
pub(crate) use cpu::share::{OF_A_MOVE, share, share_each};
pub use dist::{ActionBatch, Dist, HostDist};
pub(crate) use dist_rows::{CategoricalRows, DistRows, GaussianRows, RowTerms};
pub use grads::NamedGrads;
pub use gru::{Gru, GruLayer};
pub use image_net::{CnnKind, ImageNet};
pub use impala::{Impala, ImpalaStage, ResidualBlock};
pub use init::orthogonal;
pub use layer_norm::LayerNorm;
pub use linear::Linear;
pub use mlp::Mlp;
pub use nature::Nature;
pub use obs_batch::ObsBatch;
pub(crate) use packed_pixels::PackedPixels;
pub use params::{ParamVisitor, Parameters, frozen, parameter_count, tracked};
pub(crate) use params::{moved, path};
pub(crate) use sample::categorical_at;
pub use sample::{
    argmax, categorical_log_prob, gaussian_log_prob, sample_categorical, sample_gaussian, squashed_log_prob,
};
pub(crate) use source::{Init, ParamSource, RandomInit};
pub use squash::{LogProbForm, SquashedDraw, SquashedGaussian, bounded_log_std};
pub(crate) use tensors::{check_loss, finite, host, matrix, scalar, vector};
pub use unsquash::unsquashed;
pub(crate) use unsquash::unsquashed_action;
