//! Self-describing safetensors files: tensors by name, and a JSON description in the header.

mod atomic;
mod header;
mod network;
mod tensor_file;

pub use atomic::{write_atomically, write_atomically_with};
pub(crate) use header::FileKind;
pub(crate) use tensor_file::TensorFile;
