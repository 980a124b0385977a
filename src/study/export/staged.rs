//! Staged: a file that is written under a temporary name and gets its own name only when all is well.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Why results could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The directory does not exist and cannot be made.
    #[error("cannot make the directory {}: {source}", path.display())]
    Directory {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// No file can be made in the directory.
    #[error("cannot create {}: {source}", path.display())]
    Create {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The disk is full, most likely.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// What an earlier run left cannot be removed.
    #[error("cannot remove {}, which an earlier run has left: {source}", path.display())]
    Remove {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The finished file cannot take its place.
    #[error("cannot put {} in its place: {source}", path.display())]
    Place {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// A file under its temporary name, in the directory where it will stay. Dropped, it is removed.
#[derive(Debug)]
pub struct Staged {
    file: NamedTempFile,
    path: PathBuf,
}

impl Staged {
    /// Begins the file `name` in `dir`.
    ///
    /// # Errors
    /// [`ExportError::Create`] if no file can be made there.
    pub fn create(dir: &Path, name: &str) -> Result<Self, ExportError> {
        let path = dir.join(name);
        let mut builder = tempfile::Builder::new();
        builder.prefix(".isodp-").suffix(".tmp");
        #[cfg(unix)]
        builder.permissions(<fs::Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
        match builder.tempfile_in(dir) {
            Ok(file) => Ok(Self { file, path }),
            Err(source) => Err(ExportError::Create { path, source }),
        }
    }

    /// Where the file will stay.
    pub fn path(&self) -> &Path {
        &self.path
    }
    /// `source` as an error about this file.
    pub fn error(&self, source: io::Error) -> ExportError {
        ExportError::Write { path: self.path.clone(), source }
    }
    /// Gives the file its name, over whatever had it.
    ///
    /// # Errors
    /// [`ExportError::Place`] if it cannot have this name; the file is gone then.
    pub fn place(self) -> Result<PathBuf, ExportError> {
        match self.file.persist(&self.path) {
            Ok(_) => Ok(self.path),
            Err(error) => Err(ExportError::Place { path: self.path, source: error.error }),
        }
    }
    /// Gives all files their names; if one cannot have its, none of them stays.
    ///
    /// # Errors
    /// As [`place`](Self::place).
    pub fn place_all(files: Vec<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let mut placed = Vec::new();
        for file in files {
            match file.place() {
                Ok(path) => placed.push(path),
                Err(error) => {
                    for path in placed {
                        // What cannot be removed either is whole at least; the first error is the one to tell.
                        let _ = fs::remove_file(path);
                    }
                    return Err(error);
                }
            }
        }
        Ok(placed)
    }

    /// A file that says no to every octet.
    #[cfg(all(test, target_os = "linux"))]
    pub(in crate::study) fn full(dir: &Path, name: &str) -> Self {
        let mut staged = Self::create(dir, name).unwrap();
        *staged.file.as_file_mut() = fs::File::options().write(true).open("/dev/full").unwrap();
        staged
    }
}

impl Write for Staged {
    fn write(&mut self, octets: &[u8]) -> io::Result<usize> {
        self.file.as_file_mut().write(octets)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.as_file_mut().flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_has_its_name_only_at_the_end() {
        let dir = tempfile::tempdir().unwrap();
        let mut staged = Staged::create(dir.path(), "a.txt").unwrap();
        staged.write_all(b"all of it").unwrap();
        assert!(names(dir.path()).iter().all(|name| name.starts_with(".isodp-")));
        assert_eq!(staged.place().unwrap(), dir.path().join("a.txt"));
        assert_eq!(fs::read(dir.path().join("a.txt")).unwrap(), b"all of it");
        drop(Staged::create(dir.path(), "b.txt").unwrap());
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn if_one_cannot_take_its_place_none_does() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("b.txt/occupied")).unwrap();
        let files = ["a.txt", "b.txt", "c.txt"].map(|name| Staged::create(dir.path(), name).unwrap());
        let error = Staged::place_all(files.into()).unwrap_err();
        assert!(error.to_string().contains("b.txt in its place: "), "{error}");
        assert_eq!(names(dir.path()), ["b.txt"]);
    }
}
