//! Exports: the files that a run leaves, each readable by a tool that someone else wrote.
//!
//! All files of a run appear together at its end: each is written under a temporary name in the directory where it will
//! stay and renamed when everything is whole. If anything fails, none of them stays.

pub mod capture;
pub mod csv;
pub mod decimal;
mod directory;
pub mod hlog;
pub mod json;
pub mod live_list;
pub mod pcapng;
pub mod staged;
pub mod thinning;
pub mod vcd;

use std::fs;
use std::path::{Path, PathBuf};

use directory::Directory;
pub use staged::{ExportError, Staged};

use super::histogram::Histograms;
use super::layout::Layout;
use super::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use super::scenario::CsvTable;
use super::summary::Summary;

/// What a run will be and where its files go.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The directory; it is made if it does not exist.
    pub dir: &'a Path,
    /// The network.
    pub layout: &'a Layout,
    /// How many cycles the run will have, as far as known: tables are thinned by this ([`thinning::Thinning`]).
    pub cycles: u64,
    /// How many rows a table may have before it is thinned.
    pub rows: u64,
    /// Which tables are wanted.
    pub tables: &'a [CsvTable],
}

/// One exporter at work: it takes rows during the run and hands over its files at the end.
pub trait Export: Sink + Send {
    /// Writes what is left and hands over all files. May add to the summary what a reader of its files must know.
    ///
    /// # Errors
    /// The first one of the whole run.
    fn close(self: Box<Self>, histograms: &Histograms, summary: &mut Summary) -> Result<Vec<Staged>, ExportError>;
}

/// One kind of export.
#[derive(Clone, Copy, Debug)]
pub struct Exporter {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it writes, for people.
    pub what: &'static str,
    /// The names of its files.
    pub files: fn(&Target<'_>) -> Vec<String>,
    /// The names that its files can have in any run.
    pub every: fn() -> Vec<String>,
    /// Begins its files.
    pub open: fn(&Target<'_>) -> Result<Box<dyn Export>, ExportError>,
}

/// Every exporter. They close in this order; the summary is the last one, because the others add to it.
pub const EXPORTERS: &[Exporter] = &[csv::EXPORTER, hlog::EXPORTER, live_list::EXPORTER, json::EXPORTER];

/// The files of one run.
pub struct Exports {
    open: Vec<Box<dyn Export>>,
    names: Vec<String>,
    /// The last to go: by then no file is left under its temporary name.
    _directory: Directory,
}

impl Exports {
    /// Begins the files of `exporters`.
    ///
    /// # Errors
    /// If the directory or a file cannot be made; neither stays then.
    pub fn open(target: &Target<'_>, exporters: &[Exporter]) -> Result<Self, ExportError> {
        let directory = Directory::make(target.dir)?;
        let open = exporters.iter().map(|exporter| (exporter.open)(target)).collect::<Result<_, _>>()?;
        let names = exporters.iter().flat_map(|exporter| (exporter.files)(target)).collect();
        Ok(Self { open, names, _directory: directory })
    }

    /// The run is over: writes what is left and gives every file its name, those that are `staged` already included.
    /// Adds the names of its own files to the summary first.
    ///
    /// # Errors
    /// The first one of the whole run; no file stays then.
    pub fn finish(
        self,
        mut staged: Vec<Staged>,
        histograms: &Histograms,
        summary: &mut Summary,
    ) -> Result<Vec<PathBuf>, ExportError> {
        summary.files.extend(self.names);
        for export in self.open {
            staged.extend(export.close(histograms, summary)?);
        }
        Staged::place_all(staged)
    }
}

/// Removes the files of earlier runs in `dir` that this run has not written: those called as one of `names`, but for
/// `placed`. What is called otherwise, or is no file, stays.
///
/// # Errors
/// The first one that cannot be removed.
pub fn clear(dir: &Path, names: impl Iterator<Item = String>, placed: &[PathBuf]) -> Result<(), ExportError> {
    let old = names.map(|name| dir.join(name)).filter(|path| !placed.contains(path));
    for path in old.filter(|path| path.is_file()) {
        if let Err(source) = fs::remove_file(&path) {
            return Err(ExportError::Remove { path, source });
        }
    }
    Ok(())
}

impl core::fmt::Debug for Exports {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_tuple("Exports").field(&self.names).finish()
    }
}

impl Sink for Exports {
    fn cycle(&mut self, row: &CycleRow) {
        self.open.iter_mut().for_each(|export| export.cycle(row));
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.open.iter_mut().for_each(|export| export.slave(row));
    }
    fn link(&mut self, row: &LinkRow) {
        self.open.iter_mut().for_each(|export| export.link(row));
    }
    fn event(&mut self, row: &EventRow) {
        self.open.iter_mut().for_each(|export| export.event(row));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample;
    use std::collections::BTreeSet;

    fn names(dir: &Path) -> BTreeSet<String> {
        fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }
    fn fed(dir: &Path) -> Exports {
        let layout = sample::layout();
        let mut exports =
            Exports::open(&Target { dir, layout: &layout, cycles: 3, rows: 100, tables: CsvTable::EVERY }, EXPORTERS)
                .unwrap();
        for cycle in 0..3 {
            exports.event(&sample::event(cycle));
            exports.cycle(&sample::cycle(cycle));
            exports.slave(&sample::slave(cycle, 3));
            exports.link(&sample::link(cycle));
        }
        exports
    }
    fn finish(exports: Exports) -> Result<Vec<PathBuf>, ExportError> {
        let mut summary = Summary { files: Vec::new(), ..sample::run() };
        exports.finish(Vec::new(), &Histograms::new(&sample::layout()), &mut summary)
    }

    #[test]
    fn exporters_know_every_name_that_their_files_can_have() {
        let layout = sample::layout();
        let target = Target { dir: Path::new(""), layout: &layout, cycles: 3, rows: 100, tables: CsvTable::EVERY };
        let mut all = BTreeSet::new();
        for exporter in EXPORTERS {
            let every: BTreeSet<_> = (exporter.every)().into_iter().collect();
            assert!((exporter.files)(&target).iter().all(|name| every.contains(name)), "{}", exporter.name);
            let count = all.len() + every.len();
            all.extend(every);
            assert_eq!(all.len(), count, "{}: a name of another exporter", exporter.name);
        }
    }

    #[test]
    fn only_files_of_known_names_that_were_not_written_are_cleared() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        for name in ["old.txt", "new.txt", "mine.txt"] {
            fs::write(path(name), name).unwrap();
        }
        fs::create_dir(path("old.d")).unwrap();
        let known = ["old.txt", "new.txt", "old.d", "never.txt"].map(str::to_owned);
        clear(dir.path(), known.into_iter(), &[path("new.txt")]).unwrap();
        let left: BTreeSet<_> = ["new.txt", "mine.txt", "old.d"].map(str::to_owned).into();
        assert_eq!(names(dir.path()), left);
    }

    #[test]
    fn a_run_leaves_the_files_that_its_exporters_name() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (dir.path().join("new/a"), dir.path().join("b"));
        let placed = finish(fed(&a)).unwrap();
        finish(fed(&b)).unwrap();
        let layout = sample::layout();
        let target = Target { dir: &a, layout: &layout, cycles: 3, rows: 100, tables: CsvTable::EVERY };
        let named: BTreeSet<_> = EXPORTERS.iter().flat_map(|exporter| (exporter.files)(&target)).collect();
        assert_eq!(names(&a), named);
        assert_eq!(placed.len(), named.len());
        for name in named {
            assert_eq!(fs::read(a.join(&name)).unwrap(), fs::read(b.join(&name)).unwrap(), "{name}");
        }
        let json: serde_json::Value = serde_json::from_slice(&fs::read(a.join("summary.json")).unwrap()).unwrap();
        assert_eq!(json["files"].as_array().unwrap().len(), placed.len());
        assert_eq!(json["thinning"][0]["rows_written"], 3);
        finish(fed(&a)).expect("a second run takes the place of the first");
    }

    #[test]
    fn every_file_of_this_folder_that_exports_has_a_line() {
        let exporters: BTreeSet<_> = EXPORTERS.iter().map(|exporter| format!("{}.rs", exporter.name)).collect();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/study/export");
        let written: BTreeSet<_> = names(&folder)
            .into_iter()
            .filter(|name| fs::read_to_string(folder.join(name)).unwrap().contains("\npub const EXPORTER: Exporter"))
            .collect();
        assert_eq!(exporters, written);
        assert_eq!(EXPORTERS.last().unwrap().name, "json", "the others add to the summary");
    }

    #[test]
    fn a_failure_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        drop(fed(dir.path()));
        assert!(names(dir.path()).is_empty(), "an interrupted run");
        drop(fed(&dir.path().join("new/a")));
        assert!(names(dir.path()).is_empty(), "an interrupted run with a directory of its own");
        fs::create_dir_all(dir.path().join("summary.json/occupied")).unwrap();
        let error = finish(fed(dir.path())).unwrap_err();
        assert!(matches!(&error, ExportError::Place { path, .. } if path.ends_with("summary.json")), "{error}");
        assert_eq!(names(dir.path()), BTreeSet::from(["summary.json".to_owned()]));
        let file = dir.path().join("file");
        fs::write(&file, "").unwrap();
        let target = Target { dir: &file, layout: &sample::layout(), cycles: 3, rows: 100, tables: CsvTable::EVERY };
        assert!(matches!(Exports::open(&target, EXPORTERS), Err(ExportError::Directory { .. })));
    }
}
