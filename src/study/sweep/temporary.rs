//! Temporary: files without a name, which nobody finds and which end with the process.

use std::env;
use std::fs::File;
use std::io;

/// An empty one in the directory for temporary files.
///
/// # Errors
/// None can be made there; the directory is named.
pub(super) fn file() -> io::Result<File> {
    tempfile::tempfile().map_err(|error| {
        let dir = env::temp_dir();
        let text = format!("no temporary file in {}: {error}; TMPDIR names another directory", dir.display());
        io::Error::new(error.kind(), text)
    })
}
