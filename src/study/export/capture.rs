//! Captures: the files of stretches that were kept complete, one line per format.
//!
//! | file | opens in |
//! |---|---|
//! | `flight.txt` | any editor |
//! | `flight.pcapng` | Wireshark, with `profibus_dp.lua` |
//! | `profibus_dp.lua` | Wireshark: the dissector |
//! | `flight.vcd` | GTKWave, Surfer and other viewers of wave forms |

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::staged::{ExportError, Staged};
use super::{pcapng, vcd};
use crate::study::flight::Recording;
use crate::study::trace;

/// One file of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Its name.
    pub file: &'static str,
    /// What it is, for people.
    pub what: &'static str,
    /// Writes it.
    pub write: fn(&Recording, &mut dyn Write) -> io::Result<()>,
}

/// Every format.
pub const FORMATS: &[Format] = &[
    Format {
        file: "flight.txt",
        what: "every telegram and every observation, line by line",
        write: |recording, out| out.write_all(trace::flight(recording).as_bytes()),
    },
    Format { file: "flight.pcapng", what: "the telegrams for Wireshark", write: pcapng::write },
    Format {
        file: "profibus_dp.lua",
        what: "the dissector that Wireshark needs for them",
        write: |_, out| out.write_all(pcapng::DISSECTOR.as_bytes()),
    },
    Format { file: "flight.vcd", what: "bus and stations as wave forms", write: vcd::write },
];

/// Writes all files of `recording` into `dir` under temporary names.
///
/// # Errors
/// A file cannot be made or written; none stays then.
pub fn stage(dir: &Path, recording: &Recording) -> Result<Vec<Staged>, ExportError> {
    let mut staged = Vec::with_capacity(FORMATS.len());
    for format in FORMATS {
        let mut file = Staged::create(dir, format.file)?;
        let mut out = BufWriter::new(&mut file);
        let written = (format.write)(recording, &mut out).and_then(|()| out.flush());
        drop(out);
        written.map_err(|error| file.error(error))?;
        staged.push(file);
    }
    Ok(staged)
}

/// Writes all files of `recording` into `dir`, which is made if it does not exist.
///
/// # Errors
/// As [`stage`], or a file cannot have its name; none stays then.
pub fn write(dir: &Path, recording: &Recording) -> Result<Vec<PathBuf>, ExportError> {
    std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
    Staged::place_all(stage(dir, recording)?)
}
