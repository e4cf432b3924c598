//! Short names for the contents of files.

use std::{fs, path::Path};

use super::run_dir::{RunError, io_error};

/// CRC-32 (the one of zip, ISO-HDLC) of a file's bytes, as eight hexadecimal digits: tells two skill models apart.
///
/// # Errors
///
/// [`RunError::Io`].
pub fn file_checksum(path: &Path) -> Result<String, RunError> {
    let bytes = fs::read(path).map_err(io_error("read", path))?;
    Ok(format!("{:08x}", crc32fast::hash(&bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "123456789").expect("writable");
        assert_eq!(file_checksum(&file).expect("readable"), "cbf43926", "the check value of the standard");
        let error = file_checksum(&folder.path().join("none")).expect_err("not there").to_string();
        assert!(error.contains("none"), "{error}");
    }
}
