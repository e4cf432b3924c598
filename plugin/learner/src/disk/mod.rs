//! The layer through which everything is written to a disk: files, names and folders.
//!
//! The functions are those of [`std::fs`]. Their operations can be [recorded](DiskRecording), so that a test can put
//! a disk into every state that a power cut would leave.

mod atomic;
mod disk_file;
mod folders;
mod operation;
mod recording;
mod temporary;

pub use atomic::{write_atomically, write_atomically_with};
pub use disk_file::DiskFile;
pub use folders::{create_dir_all, hard_link, remove_dir, remove_dir_all, remove_file, rename};
pub use operation::DiskOperation;
pub use recording::DiskRecording;
pub use temporary::{remove_temporaries, temporary_name};
