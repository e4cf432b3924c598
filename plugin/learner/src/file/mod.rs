//! Self-describing safetensors files: tensors by name, and a JSON description in the header.

mod header;
mod network;
mod seal;
mod tensor_file;

pub(crate) use header::FileKind;
pub use seal::{BrokenSeal, Unsealed, seal_json, seal_text, unseal_json, unseal_text};
pub(crate) use tensor_file::TensorFile;
