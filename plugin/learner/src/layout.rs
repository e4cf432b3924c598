//! Whether a file holds the networks that its header describes, found out before anything of those sizes is made.
//!
//! A header is text and can ask for any size; the tensors behind it are as large as the file. Every size that decides
//! how much memory a network needs is compared with a stored tensor.

use crate::file::TensorFile;
use crate::nn::{CnnKind, NATURE_LAYERS, path, window_places};
use crate::policy::NetShape;
use crate::{ActionSpace, FileError, ImageShape};

/// The product of `sizes`, each of which must be at least 1; an error that names `what` if it is beyond all files.
pub(crate) fn product(file: &TensorFile, what: &str, sizes: &[usize]) -> Result<usize, FileError> {
    if sizes.contains(&0) {
        return Err(file.format(format!("`{what}` has a size of 0")));
    }
    let product = sizes.iter().try_fold(1usize, |product, &size| product.checked_mul(size));
    let product = product.filter(|product| *product <= isize::MAX as usize / 8);
    product.ok_or_else(|| file.format(format!("`{what}` cannot be as large as its description says: {sizes:?}")))
}

/// `a + b`, likewise.
fn sum(file: &TensorFile, what: &str, a: usize, b: usize) -> Result<usize, FileError> {
    let sum = a.checked_add(b);
    sum.ok_or_else(|| file.format(format!("`{what}` cannot be as wide as its description says: {a} + {b}")))
}

/// A tensor of `shape`, none of whose sides is 0.
pub(crate) fn check_tensor(file: &TensorFile, name: &str, shape: &[usize]) -> Result<(), FileError> {
    product(file, name, shape)?;
    file.expect(name, shape)
}

/// An `Mlp` called `prefix`.
pub(crate) fn check_mlp(
    file: &TensorFile,
    prefix: &str,
    (inputs, hidden, outputs): (usize, &[usize], usize),
) -> Result<(), FileError> {
    let mut width = inputs;
    for (i, &next) in hidden.iter().enumerate() {
        check_tensor(file, &path(prefix, &format!("l{i}.weight")), &[width, next])?;
        width = next;
    }
    check_tensor(file, &path(prefix, "head.weight"), &[width, outputs])
}

/// The width of `[z, s]`.
pub(crate) fn joined_width(file: &TensorFile, prefix: &str, shape: &NetShape) -> Result<usize, FileError> {
    sum(file, prefix, shape.latent, shape.obs_dim)
}

/// An actor's layers behind its trunk; `by_state`: a layer gives the standard deviation.
pub(crate) fn check_actor(
    file: &TensorFile,
    prefix: &str,
    shape: &NetShape,
    space: ActionSpace,
    by_state: bool,
) -> Result<(), FileError> {
    let inputs = joined_width(file, prefix, shape)?;
    check_mlp(file, prefix, (inputs, &shape.hidden, space.dim()))?;
    if by_state && matches!(space, ActionSpace::Continuous(_)) {
        let width = shape.hidden.last().copied().unwrap_or(inputs);
        check_tensor(file, &path(prefix, "log_std.weight"), &[width, space.dim()])?;
    }
    Ok(())
}

/// A trunk of convolutions called `prefix`.
pub(crate) fn check_cnn(file: &TensorFile, prefix: &str, kind: &CnnKind, image: ImageShape) -> Result<(), FileError> {
    product(file, prefix, &[image.channels, image.height, image.width])?;
    let (mut inputs, mut height, mut width) = (image.channels, image.height, image.width);
    match kind {
        CnnKind::Impala { channels, .. } => {
            let pooled = |side: usize| window_places(side, 3, 2, 1).unwrap_or(1);
            for (i, &outputs) in channels.iter().enumerate() {
                let stage = path(prefix, &format!("s{i}"));
                check_tensor(file, &path(&stage, "conv.weight"), &[outputs, inputs, 3, 3])?;
                check_tensor(file, &path(&stage, "res0.conv0.weight"), &[outputs, outputs, 3, 3])?;
                (inputs, height, width) = (outputs, pooled(height), pooled(width));
            }
        }
        CnnKind::Nature { .. } => {
            for (i, (outputs, kernel, stride)) in NATURE_LAYERS.into_iter().enumerate() {
                check_tensor(file, &path(prefix, &format!("conv{i}.weight")), &[outputs, inputs, kernel, kernel])?;
                // An image that is too small has a message of its own when the network is made.
                let places = |side: usize| window_places(side, kernel, stride, 0);
                let Some(sides) = places(height).zip(places(width)) else { return Ok(()) };
                (inputs, (height, width)) = (outputs, sides);
            }
        }
    }
    let flat = product(file, prefix, &[inputs, height, width])?;
    check_tensor(file, &path(prefix, "fc.weight"), &[flat, kind.features()])
}
