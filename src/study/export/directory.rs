//! Directory: where results go, made only to stay if something comes into it.

use std::fs;
use std::path::{Path, PathBuf};

use super::ExportError;

/// A directory for results. Dropped, it is removed if it is new and empty, and so are those above it.
#[derive(Debug)]
pub(super) struct Directory {
    /// Those that were not there before, the innermost first.
    new: Vec<PathBuf>,
}

impl Directory {
    /// Makes `dir` and what is missing above it.
    ///
    /// # Errors
    /// [`ExportError::Directory`] if it cannot be made; then nothing is left of it.
    pub(super) fn make(dir: &Path) -> Result<Self, ExportError> {
        let is_missing = |dir: &&Path| !dir.as_os_str().is_empty() && !dir.exists();
        let new = dir.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        // Also of a failure half-way nothing stays.
        let made = Self { new };
        fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
        Ok(made)
    }
}
impl Drop for Directory {
    fn drop(&mut self) {
        for dir in &self.new {
            // One that is not empty stays, and so must those above it.
            let _ = fs::remove_dir(dir);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_directories_stay_with_a_file_and_old_ones_always() {
        let room = tempfile::tempdir().unwrap();
        let path = |name: &str| room.path().join(name);
        drop(Directory::make(&path("a/b/c")).unwrap());
        assert!(!path("a").exists());
        fs::create_dir(path("a")).unwrap();
        drop(Directory::make(&path("a/b/c")).unwrap());
        assert!(path("a").exists() && !path("a/b").exists());
        drop(Directory::make(&path("a")).unwrap());
        assert!(path("a").exists(), "it was there before");
        let made = Directory::make(&path("a/b/c")).unwrap();
        fs::write(path("a/b/file"), "").unwrap();
        drop(made);
        assert!(path("a/b/file").exists() && !path("a/b/c").exists());
        // A file is in the way.
        assert!(matches!(Directory::make(&path("a/b/file/d")), Err(ExportError::Directory { .. })));
        assert!(path("a/b/file").is_file());
    }
}
