//! The building blocks of the networks: layers with named parameters, distributions, and the optimizer.
//!
//! Every network is a plain struct of tensors that implements [`Parameters`]. The names of its tensors are used in
//! the files (`actor.l0.weight`), for the optimizer's moments and in error messages. Weights start from generators
//! that the caller owns; burn's global generator is not used.
//!
//! The folder, in reading order:
//!
//! - `params`: named parameters, and the sources of their first values.
//! - `linear`, `conv` and `gru`: layers; `image_net`: the network that turns images into features.
//! - `dist`: distributions over actions; `sample`: draws from them.
//! - `grads` and `adam`: gradients by parameter name, and the optimizer.

mod adam;
mod conv;
mod dist;
mod grads;
mod gru;
mod image_net;
mod linear;
mod params;
mod sample;

pub(crate) use crate::nn::{
    adam::FlatGrads,
    conv::PackedPixels,
    dist::{CategoricalRows, DistRows, GaussianRows, JointRows, RowTerms},
    params::{Init, ParamSource, RandomInit, check_loss, finite, moved, path},
    sample::{categorical_at, unsquashed_action},
};
pub use crate::nn::{
    adam::{Adam, AdamConfig},
    conv::{Conv2d, ObsBatch, max_pool},
    dist::{ActionBatch, Dist, HostDist},
    grads::NamedGrads,
    gru::{Gru, GruLayer},
    image_net::{CnnKind, ImageNet, Impala, ImpalaStage, Nature, ResidualBlock},
    linear::{LayerNorm, Linear, Mlp},
    params::{ParamVisitor, Parameters, frozen, host, matrix, orthogonal, parameter_count, scalar, tracked, vector},
    sample::{
        LogProbForm, SquashedDraw, SquashedGaussian, argmax, bounded_log_std, categorical_log_prob, gaussian_log_prob,
        sample_categorical, sample_gaussian, squashed_log_prob, unsquashed,
    },
};
pub use playbot_kernels::{elementwise::Activation, trunk::grid::window_places};
